"""A space frame for tests, as fine as wanted."""

import functools

import numpy as np

from skthermo.fem import Beam, PointMass, Spring, Structure

SECTION = {"E": 30e9, "G": 12e9, "A": 0.6, "I_yy": 0.05, "I_zz": 0.02, "J": 0.03, "density": 2500.0}


def portal(n_elements=7, **options):
    """A space frame of four columns, four beams and a soft foot: sparse at 7 elements a member."""
    corners = {"sw": (0.0, 0.0), "se": (6.0, 0.0), "ne": (6.0, 4.0), "nw": (0.0, 4.0)}
    nodes, members = {}, {}

    def line(name, start, end, first, last):
        names = [first, *((name, i) for i in range(1, n_elements)), last]
        for i, node in enumerate(names):
            nodes[node] = tuple(np.add(start, np.subtract(end, start) * i / n_elements))
        members.update({(name, i): Beam(*names[i : i + 2], **SECTION) for i in range(n_elements)})

    for name, (x, y) in corners.items():
        line(f"column {name}", (x, y, 0.0), (x, y, 5.0), f"foot {name}", f"head {name}")
    for one, other in zip(corners, [*list(corners)[1:], "sw"], strict=True):
        line(f"beam {one}", (*corners[one], 5.0), (*corners[other], 5.0), f"head {one}", f"head {other}")
    springs = {f"soil {d}": Spring("foot sw", d, 5e8) for d in ("x", "y", "z", "rx", "ry", "rz")}
    supports = {f"foot {name}": "xyz rx ry rz" for name in ("se", "ne", "nw")}
    groups = {
        "columns": [m for m in members if m[0].startswith("column")],
        "beams": [m for m in members if m[0].startswith("beam")],
        "soil": list(springs),
    }
    structure = Structure(nodes, members | springs | {"tank": PointMass("head ne", 3000.0)}, supports, groups)
    parameters = {"columns": "columns", "beams": ("E", "beams"), "density": ("density", "beams"), "soil": "soil"}
    return structure.assemble(parameters, **options)


FRAME = portal()


@functools.cache
def frame(*, track=False, is_reduced=False):
    """The sparse frame, as it is or reduced; no test changes it."""
    if is_reduced:
        return frame(track=track).reduced(0.3, random_state=0)
    return portal(track=True) if track else FRAME


def local_shapes(model, row, dofs=None):
    """Mode shapes at one row of theta, and their derivatives by the modes that `local_modes` gives."""
    modes = model.local_modes(row, follow=True)
    columns = modes.ranks if model.track else np.arange(model.n_modes)
    places = np.arange(model.n_dof) if dofs is None else dofs
    return modes.shapes(places)[:, columns], modes.derivatives(columns, places)[1]
