"""A cantilever of beams, which bends about two axes."""

from skthermo.fem import Beam, Structure

section = {"E": 210e9, "G": 81e9, "A": 0.02, "I_yy": 4e-5, "I_zz": 1e-5, "J": 3e-5, "density": 7850.0}
nodes = {i: (0.5 * i, 0, 0) for i in range(9)}
beams = {f"beam {i}": Beam(i, i + 1, **section) for i in range(8)}
cantilever = Structure(nodes, beams, {0: "xyz rx ry rz"}, {"all": list(beams), "half": list(beams)[:4]})
model = cantilever.assemble(["all"], groups=["half"], n_modes=4)
RESULTS = {
    "frequencies": model.frequencies([[1.0], [1.1]]),
    "a softer half": model.damaged({"half": 0.4}).frequencies([[1.0]]),
    "divided": list(cantilever.divide(model, {"half": {"root": ["beam 0"]}}).groups),
}
TOLERANCES = {"*": {"rtol": 1e-7}}
