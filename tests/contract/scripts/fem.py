import tempfile
from pathlib import Path

import numpy as np

from skthermo import fem
from skthermo.datasets import make_truss


def fem_cantilever():
    """A cantilever of beams, which bends about two axes."""
    section = {"E": 210e9, "G": 81e9, "A": 0.02, "I_yy": 4e-5, "I_zz": 1e-5, "J": 3e-5, "density": 7850.0}
    nodes = {i: (0.5 * i, 0, 0) for i in range(9)}
    beams = {f"beam {i}": fem.Beam(i, i + 1, **section) for i in range(8)}
    cantilever = fem.Structure(nodes, beams, {0: "xyz rx ry rz"}, {"all": list(beams), "half": list(beams)[:4]})
    model = cantilever.assemble(["all"], groups=["half"], n_modes=4)
    return {
        "frequencies": model.frequencies([[1.0], [1.1]]),
        "a softer half": model.damaged({"half": 0.4}).frequencies([[1.0]]),
        "divided": list(cantilever.divide(model, {"half": {"root": ["beam 0"]}}).groups),
    }, {"*": {"rtol": 1e-7}}


def fem_exported_folder():
    """A folder as Abaqus writes it: one job as built, and one with each spring doubled."""
    text = "1,1, 1,1, {}\n2,1, 1,1, {}\n2,1, 2,1, {}\n"
    jobs = {"nominal": (800, -400, 400), "base": (1200, -400, 400), "top": (1200, -800, 800)}
    with tempfile.TemporaryDirectory() as folder:
        for job, entries in jobs.items():
            Path(folder, f"{job}_STIF1.mtx").write_text(text.format(*entries))
        Path(folder, "nominal_MASS1.mtx").write_text(text.format(1, 0, 1))
        model = fem.load_affine(folder, factor=2.0, n_modes=2)
    return {
        "parameters": list(model.parameter_names),
        "labels": [list(label) for label in model.dofs],
        "frequencies": model.frequencies([[1.0, 1.0], [1.2, 0.9]]),
    }, {"*": {"rtol": 1e-8}}


def fem_frame():
    """A king-post truss whose rafters and post are parameters, with its modes, masses and springs."""
    steel = {"E": 210e9, "A": 0.01, "density": 7850.0}
    ends = {"tie 1": ("left", "foot"), "tie 2": ("foot", "right"), "rafter 1": ("left", "apex")}
    ends |= {"rafter 2": ("apex", "right"), "post": ("foot", "apex")}
    members = {name: fem.Bar(*nodes, **steel) for name, nodes in ends.items()}
    nodes = {"left": (0, 0), "foot": (3, 0), "right": (6, 0), "apex": (3, 2)}
    groups = {"rafters": ["rafter 1", "rafter 2"], "post": ["post"]}
    supports = {"left": "xy", "right": "y"}
    model = fem.Structure(nodes, members, supports, groups).assemble(["rafters", "post"], n_modes=2)
    members |= {"bell": fem.PointMass("foot", m=250.0), "spring": fem.Spring("right", "x", k=3e7)}
    heavier = fem.Structure(nodes, members, supports, groups).assemble(["rafters"], n_modes=3)
    return {
        "frequencies": model.frequencies([[1.0, 1.0], [1.2, 1.0], [1.0, 0.8]]),
        "damaged": model.damaged({"post": 0.3}).frequencies([[1.0, 1.0]]),
        "heavier": heavier.frequencies([[1.0]]),
    }, {"*": {"rtol": 1e-8}}


def fem_imported_structure():
    """A tower of three storeys, of which a program has written the stiffness of each, divided into damage groups."""
    stiffness = {("s1",): 400 * np.diag([1.0, 0, 0])}
    for name, i in {"s2": 0, "s3": 1}.items():
        stiffness[name,] = np.zeros((3, 3))
        stiffness[name,][i : i + 2, i : i + 2] = [[400, -400], [-400, 400]]
    heights = {storey: (0.0, 0.0, 3.0 * storey) for storey in range(4)}
    members = {"s1": (0, 1), "s2": (1, 2), "s3": (2, 3)}
    exported = fem.AffineModel(stiffness, np.eye(3), n_modes=2)
    tower = fem.ImportedStructure(exported, heights, members, {"all": members, "upper": ["s2", "s3"]})
    model = tower.assemble(["all"], groups=["upper"], n_modes=2)
    divided = tower.divide(model, {"upper": {"top": ["s3"]}})
    return {
        "frequencies": model.frequencies([[1.0], [1.1]]),
        "groups": list(divided.groups),
        "damaged top": divided.damaged({"top": 0.5}).frequencies([[1.0]]),
        "local": exported.local_modes([1.0] * 3).frequencies,
    }, {"*": {"rtol": 1e-8}}


def fem_matrices():
    """Terms from matrices of a program: differences, calls, and exported files."""

    def tower(theta=(1.0, 1.0)):
        base, top = 400.0 * theta[0], 400.0 * theta[1]
        return np.array([[base + top + 100, -top], [-top, top]])

    terms = fem.difference_terms(tower(), {"base": tower((2, 1)), "top": tower((1, 2))})
    probed = fem.probe(lambda theta: (tower(theta), np.eye(2)), ["base", "top"], n_modes=2, random_state=0)
    called = fem.CallableModel(lambda row: np.sqrt(row[0]) * np.array([1.0, 2.0]), ["E"], 2)
    with tempfile.TemporaryDirectory() as folder:
        matrices = {"".join(name) or "rest": term.toarray() for name, term in terms.items()}
        np.savez(f"{folder}/tower.npz", K0=tower(), k_base=matrices["base"], k_top=matrices["top"], M0=np.eye(2))
        loaded = fem.load_affine(f"{folder}/tower.npz", n_modes=2)
    theta = [[1.0, 1.0], [0.8, 1.1]]
    return {
        "terms": matrices,
        "affine": fem.AffineModel(terms, np.eye(2), n_modes=2).frequencies(theta),
        "probed": probed.frequencies(theta),
        "loaded": [list(loaded.parameter_names), loaded.frequencies(theta)],
        "called": called.frequencies([[1.0], [4.0]]),
        "called, damaged": called.damaged({"E": 0.19}).frequencies([[1.0]]),
    }, {"*": {"rtol": 1e-7, "atol": 1e-9}}


def fem_membrane():
    """Forces of a strip in tension."""
    strip = fem.Membrane(("a", "b", "c", "d"), E=210e9, t=0.015, nu=0.0, density=7850.0)
    corners = np.array([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0.0]])
    stretch = np.array([0, 0, 0, 1e-3, 0, 0, 1e-3, 0, 0, 0, 0, 0])
    return {"forces": strip.stiffness(corners)["E", "t"] @ stretch}, {"*": {"rtol": 1e-8, "atol": 1e-3}}


def fem_modes():
    """Which measured mode is which: MAC, pairs, chosen and tracked modes, shapes at sensors."""
    truss = make_truss()
    nominal, shapes = fem.evaluate_modes(truss, [[1.0] * 4], dofs=[0, 3, 8])
    _, others = fem.evaluate_modes(truss, [[0.7, 1.0, 1.2, 1.0]], dofs=[0, 3, 8])
    tracked = make_truss().with_modes([0, 2, 4])
    return {
        "mac": fem.mac(shapes[0], others[0]),
        "same": np.diag(fem.mac(shapes[0], shapes[0])),
        "pairs": fem.match_modes(truss, [7.6, 27.1, 62.0, 38.0]),
        "by shape": fem.match_modes(truss, nominal[0][[1, 0]], shapes=shapes[0][:, [1, 0]], dofs=[0, 3, 8])["mode"],
        "chosen": tracked.frequencies([[1.0] * 4]),
        "fewer parameters": truss.with_parameters(["bottom", "diagonal"]).frequencies([[0.9, 1.1]]),
    }, {"*": {"rtol": 1e-6, "atol": 1e-8}}


def fem_reduced():
    """A reduced model agrees with the full one to the error that it states."""
    truss = make_truss()
    reduced = truss.reduced(bounds=0.2, random_state=0)
    theta = [[0.9, 1.1, 1.0, 0.85]]
    return {
        "frequencies": reduced.frequencies(theta),
        "error": bool(reduced.error_ < 1e-5),
        "agrees": bool(np.abs(reduced.frequencies(theta) / truss.frequencies(theta) - 1).max() < 1e-5),
        "damaged": reduced.damaged({"top": 0.1}).frequencies(theta),
    }, {"*": {"rtol": 2e-5}}


def fem_samples():
    """Samples of the truss, noise on them, and sensitivities."""
    truss = make_truss()
    drawn = {
        method: fem.sample(truss, 0.2, 16, method=method, random_state=0) for method in ("uniform", "lhs", "sobol")
    }
    _, slopes = fem.linearise(truss, [[1.0] * 4], relative=True)
    return {
        "ranges": [[float(one.theta.min()) >= 0.8, float(one.theta.max()) <= 1.2] for one in drawn.values()],
        "uniform": drawn["uniform"].theta[:2],
        "solved": drawn["uniform"].frequencies[:2],
        "gaps": fem.evaluate(truss, [[0.9, np.nan, 1.0, 1.0]]),
        "slopes": slopes,
        "noise": fem.add_noise(np.full((4, 2), 4.0), [0.0, 0.01], random_state=0),
    }, {"*": {"rtol": 1e-6, "atol": 1e-9}}


def fem_two_masses():
    """Two masses on two springs, the second a parameter: frequencies, derivatives, damage, modes."""
    model = fem.AffineModel(
        {(): [[400.0, 0.0], [0.0, 0.0]], ("k",): [[400.0, -400.0], [-400.0, 400.0]]}, np.eye(2), n_modes=2
    )
    _, shapes = model.modes([[1.0]])
    return {
        "frequencies": model.frequencies([[1.0], [0.5]]),
        "jacobian": model.jacobian([[1.0]]),
        "damaged": model.damaged({"k": 0.5}).frequencies([[1.0]]),
        "shapes": np.abs(shapes),
        "names": [list(model.parameter_names), list(model.groups), model.n_modes, model.n_dof],
    }, {"*": {"rtol": 1e-8}}
