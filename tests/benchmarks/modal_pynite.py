"""One solve of a space frame against PyNiteFEA's modal analysis, and their frequencies side by side.

    OMP_NUM_THREADS=1 python tests/benchmarks/modal_pynite.py

A building of square columns and beams on fixed feet. PyNite takes the inertia of twist from the torsion
constant, so ``I_p`` is set to that. Its solve assembles the structure, as each new theta asks for; ours sums
the terms of an assembled model.
"""

from itertools import product

import numpy as np
from harness import arguments, median_seconds

from skthermo.fem import Beam, Structure

SECTION = {"E": 30e9, "G": 12e9, "A": 0.16, "I_yy": 0.0021, "I_zz": 0.0021, "J": 0.0036, "density": 2500.0}


def building(n_storeys, n_bays=2):
    """Nodes of a regular grid, members by name, and feet."""
    grid = list(product(range(n_bays + 1), range(n_bays + 1), range(n_storeys + 1)))
    nodes = {node: (6.0 * node[0], 5.0 * node[1], 3.5 * node[2]) for node in grid}
    members = {}
    for node in grid:
        for axis, name in enumerate(("x", "y", "column")):
            end = tuple(np.add(node, np.eye(3, dtype=int)[axis]).tolist())
            if end in nodes and (name == "column" or node[2] > 0):
                members[name, node] = (node, end)
    return nodes, members, [node for node in grid if node[2] == 0]


def ours(nodes, members, feet):
    beams = {name: Beam(*ends, **SECTION, I_p=SECTION["J"]) for name, ends in members.items()}
    columns = [name for name in members if name[0] == "column"]
    groups = {"columns": columns, "beams": [name for name in members if name[0] != "column"]}
    return Structure(nodes, beams, dict.fromkeys(feet, "xyz rx ry rz"), groups).assemble(list(groups))


def theirs(nodes, members, feet):
    from Pynite import FEModel3D

    model = FEModel3D()
    model.add_material("concrete", E=SECTION["E"], G=SECTION["G"], nu=0.25, rho=SECTION["density"])
    model.add_section("square", SECTION["A"], SECTION["I_yy"], SECTION["I_zz"], SECTION["J"])
    for node, place in nodes.items():
        model.add_node(str(node), *place)
    for name, ends in members.items():
        model.add_member(str(name), *map(str, ends), "concrete", "square")
    for foot in feet:
        model.def_support(str(foot), *[True] * 6)
    model.add_member_self_weight("FZ", -1.0, "weight")
    model.add_load_combo("mass", {"weight": 1.0})
    return model


def main():
    options = arguments(__doc__, storeys=[3, 10, 30], rounds=3)
    theta = np.random.default_rng(0).uniform(0.7, 1.3, (20, 2))
    print("   dof   skthermo ms a solve   PyNiteFEA ms   ratio   largest difference of a frequency")
    for n_storeys in options.storeys:
        frame = building(n_storeys)
        model, other = ours(*frame), theirs(*frame)

        def solve_theirs(other=other):
            other.analyze_modal(num_modes=6, mass_combo_name="mass", gravity=1.0)

        ways = {"ours": lambda model=model: model.frequencies(theta), "theirs": solve_theirs}
        seconds = median_seconds(ways, options.rounds)
        per_solve = seconds["ours"] / len(theta)
        difference = np.abs(np.sort(other.frequencies) / model.frequencies([[1.0, 1.0]])[0] - 1).max()
        print(
            f"{model.n_dof:6d}   {1000 * per_solve:19.2f}   {1000 * seconds['theirs']:12.1f}   "
            f"{seconds['theirs'] / per_solve:5.0f}   {difference:.1e}"
        )


if __name__ == "__main__":
    main()
