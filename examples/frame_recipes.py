"""A frame of three storeys on soft soil, for ``plot_model_updating.py``."""

from itertools import pairwise

import numpy as np

from skthermo.fem import Beam, Spring, Structure

CORNERS = {"sw": (0.0, 0.0), "se": (7.0, 0.0), "ne": (7.0, 5.0), "nw": (0.0, 5.0)}
HEIGHT, N_STOREYS, N_ELEMENTS = 3.5, 3, 4
COLUMN = {"E": 30e9, "G": 12e9, "A": 0.16, "I_yy": 2.1e-3, "I_zz": 2.1e-3, "J": 3.6e-3, "density": 2500.0}
BEAM = {**COLUMN, "A": 0.21, "I_yy": 6.3e-3, "I_zz": 1.6e-3, "J": 4.0e-3, "density": 14000.0}  # with the floors
SOIL = {"x": 1.2e8, "y": 1.2e8, "z": 5e8, "rx": 1.5e8, "ry": 1.5e8, "rz": 1e8}  # N/m, N m/rad


def frame():
    """Columns and beams of three storeys on springs, each storey's columns and beams a group."""
    nodes, members, groups = {}, {}, {}

    def line(group, section, first, last):
        places = np.linspace(nodes[first], nodes[last], N_ELEMENTS + 1)
        names = [first, *((first, last, i) for i in range(1, N_ELEMENTS)), last]
        nodes.update(zip(names, map(tuple, places), strict=True))
        for one, other in pairwise(names):
            members[one, other] = Beam(one, other, **section)
            groups.setdefault(group, []).append((one, other))

    for level in range(N_STOREYS + 1):
        nodes.update({(level, corner): (*xy, HEIGHT * level) for corner, xy in CORNERS.items()})
    for level in range(1, N_STOREYS + 1):
        for corner, following in zip(CORNERS, [*list(CORNERS)[1:], "sw"], strict=True):
            line(f"columns {level}", COLUMN, (level - 1, corner), (level, corner))
            line(f"beams {level}", BEAM, (level, corner), (level, following))
    for corner in CORNERS:
        members.update({("soil", corner, d): Spring((0, corner), d, k) for d, k in SOIL.items()})
    groups["soil"] = [name for name in members if name[0] == "soil"]
    return Structure(nodes, members, {}, groups)
