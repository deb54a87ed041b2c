"""A king-post truss whose rafters and post are parameters, with its modes, masses and springs."""

from skthermo.fem import Bar, PointMass, Spring, Structure

steel = {"E": 210e9, "A": 0.01, "density": 7850.0}
ends = {"tie 1": ("left", "foot"), "tie 2": ("foot", "right"), "rafter 1": ("left", "apex")}
ends |= {"rafter 2": ("apex", "right"), "post": ("foot", "apex")}
members = {name: Bar(*nodes, **steel) for name, nodes in ends.items()}
nodes = {"left": (0, 0), "foot": (3, 0), "right": (6, 0), "apex": (3, 2)}
groups = {"rafters": ["rafter 1", "rafter 2"], "post": ["post"]}
supports = {"left": "xy", "right": "y"}
model = Structure(nodes, members, supports, groups).assemble(["rafters", "post"], n_modes=2)
members |= {"bell": PointMass("foot", m=250.0), "spring": Spring("right", "x", k=3e7)}
heavier = Structure(nodes, members, supports, groups).assemble(["rafters"], n_modes=3)
RESULTS = {
    "frequencies": model.frequencies([[1.0, 1.0], [1.2, 1.0], [1.0, 0.8]]),
    "damaged": model.damaged({"post": 0.3}).frequencies([[1.0, 1.0]]),
    "heavier": heavier.frequencies([[1.0]]),
}
TOLERANCES = {"*": {"rtol": 1e-8}}
