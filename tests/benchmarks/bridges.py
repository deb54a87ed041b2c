"""A tied-arch bridge for benchmarks, as fine as wanted."""

from itertools import pairwise

import numpy as np

from skthermo.fem import Bar, Beam, PointMass, Spring, Structure

SPAN, WIDTH, RISE = 120.0, 14.0, 20.0
STEEL = {"E": 210e9, "G": 81e9, "density": 7850.0}
ARCH = STEEL | {"A": 0.12, "I_yy": 0.025, "I_zz": 0.02, "J": 0.03}
GIRDER = STEEL | {"A": 0.12, "I_yy": 0.08, "I_zz": 0.06, "J": 0.02}
STRINGER = STEEL | {"A": 0.03, "I_yy": 2e-3, "I_zz": 2e-3, "J": 2e-4}
CROSS_BEAM = STEEL | {"A": 0.03, "I_yy": 4e-3, "I_zz": 2e-4, "J": 3e-5}
BRACE = STEEL | {"A": 0.02, "I_yy": 6e-4, "I_zz": 6e-4, "J": 1e-3}
HANGER = {"E": 195e9, "A": 0.0015, "density": 7850.0}
SLAB = 600.0
"""Mass of the deck's slab, in kg for each square metre."""


def frame_bridge(n_bays=40, n_elements=4, n_stringers=9, n_zones=1, **options):
    """Two arches over a grillage of girders, stringers and cross beams: 5 parameters, 20,940 degrees of freedom.

    Hangers stand at the ends of the ``n_bays`` bays, and every other member is cut into ``n_elements`` beams. The
    deck is ``n_zones`` parameters, one after the other along the bridge.
    """
    decks = ["deck", *(f"deck {zone}" for zone in range(2, n_zones + 1))]
    nodes, members, groups = {}, {}, {g: [] for g in (*decks, "arches", "hangers", "bracing", "bearings")}
    lines = range(n_stringers + 2)
    stations = np.linspace(0, SPAN, n_bays + 1)
    offsets = np.linspace(-WIDTH / 2, WIDTH / 2, len(lines))
    heights = 4 * RISE * stations * (SPAN - stations) / SPAN**2

    def line(group, first, last, section):
        between = [(first, last, i) for i in range(1, n_elements)]
        for i, node in enumerate(between, start=1):
            nodes[node] = tuple(nodes[first] + np.subtract(nodes[last], nodes[first]) * i / n_elements)
        for ends in pairwise([first, *between, last]):
            add(group, ends, Beam(*ends, **section))

    def add(group, name, member):
        members[name] = member
        groups[group].append(name)

    for i, x in enumerate(stations):
        nodes |= {("deck", i, j): (x, y, 0.0) for j, y in enumerate(offsets)}
        if 0 < i < n_bays:
            nodes |= {("arch", i, j): (x, offsets[j], heights[i]) for j in (0, lines[-1])}

    def arch(i, j):
        return ("arch" if 0 < i < n_bays else "deck", i, j)

    def deck(bay):
        return decks[bay * n_zones // n_bays]

    for i in range(n_bays):
        for j in lines:
            line(deck(i), ("deck", i, j), ("deck", i + 1, j), GIRDER if j in (0, lines[-1]) else STRINGER)
        for j in (0, lines[-1]):
            line("arches", arch(i, j), arch(i + 1, j), ARCH)
    for i in range(n_bays + 1):
        for j, k in pairwise(lines):
            line(deck(min(i, n_bays - 1)), ("deck", i, j), ("deck", i, k), CROSS_BEAM)
        for j in lines:
            members["slab", i, j] = PointMass(("deck", i, j), SLAB * SPAN * WIDTH / ((n_bays + 1) * len(lines)))
    for i in range(1, n_bays):
        for j in (0, lines[-1]):
            add("hangers", ("hanger", i, j), Bar(("deck", i, j), ("arch", i, j), **HANGER))
    high = [i for i in range(1, n_bays) if heights[i] > RISE / 2]
    for i in high:
        line("bracing", ("arch", i, 0), ("arch", i, lines[-1]), BRACE)
    for i, k in pairwise(high):
        line("bracing", ("arch", i, 0), ("arch", k, lines[-1]), BRACE)
    for i in (0, n_bays):
        for j in (0, lines[-1]):
            for direction, k in (("x", 4e8), ("y", 4e8), ("z", 4e9)):
                add("bearings", ("bearing", i, j, direction), Spring(("deck", i, j), direction, k))
    return Structure(nodes, members, {}, groups).assemble(list(groups), **options)
