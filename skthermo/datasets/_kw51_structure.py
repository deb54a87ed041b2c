"""Geometry and members of the railway bridge KW51; `make_kw51` explains the assumptions."""

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from skthermo.datasets._sections import Section, box, channel, pipe, rectangle, tee, times
from skthermo.fem import Beam, Membrane, Structure

Node = tuple[object, ...]

# Stated by Appendix A and Table A.1 of the paper.
SPAN, WIDTH = 115.0, 12.4
STEEL_E, BALLAST_E = 210e9, 550e6
PLATE_T, BALLAST_T = 0.015, 0.6
ARCH = box(1.3, 0.86, 0.05)
BRACE = box(0.35, 0.35, 0.016)
CONNECTION = rectangle(0.31, 0.045)
T_BEAM = tee(1.235, 0.6, 0.08)
STIFFENER = channel(0.25, 0.25, 0.008)
PIPE = pipe(0.75, 0.04)

# Assumed, in the order of the table in make_kw51.
N_BAYS = 32
RISE = 18.0
FEET, REACH = range(2, N_BAYS, 4), 2
CONNECTION_LENGTH = 1.6
PIPES = (0.25, 0.385, 0.615, 0.75)
N_PANELS = 4
END_STIFFNESS = 1.4
STIFFENER_SPACING = 0.5
NU = 0.3
STEEL_DENSITY, BALLAST_DENSITY = 7850.0, 1500.0
SUPPORTS = {(0, 0): "xyz", (0, N_PANELS): "yz", (N_BAYS, 0): "xyz", (N_BAYS, N_PANELS): "yz"}

STEEL = {"E": STEEL_E, "G": STEEL_E / (2 + 2 * NU), "density": STEEL_DENSITY, "I_p": 0.0, "lumped": True}
STATIONS, LINES, SIDES = range(N_BAYS + 1), range(N_PANELS + 1), (0, N_PANELS)
ARCH_STATIONS = sorted({*STATIONS, *(N_BAYS * x for x in PIPES)})


def kw51_structure() -> Structure:
    """Nodes, members, supports and groups of the model `make_kw51`.

    Returns
    -------
    Structure
        Its axes are x along the bridge, y across it from -6.2 to 6.2 m, z upwards. Nodes are ("deck", station, line)
        and ("arch", station, line), with stations 0 to 32 and lines 0 to 4, of which 0 and 4 carry arches;
        ("joint", foot, head, line, "deck" or "arch") is where a brace meets a connection.

    See Also
    --------
    make_kw51 : The FE model, and what it assumes.

    Examples
    --------
    >>> from skthermo.datasets import kw51_structure
    >>> structure = kw51_structure()
    >>> len(structure.dofs), len(structure.groups["braces"])
    (1760, 32)
    """
    hangers = [hanger(foot, head, line) for line in SIDES for foot in FEET for head in heads(foot)]
    parts = {
        "girders": beams("girder", (along_deck(line) for line in SIDES), T_BEAM),
        "transverse_beams": transverse_beams(),
        "stiffeners": stiffeners(),
        "plate": membranes("plate", E=STEEL_E, t=PLATE_T, density=STEEL_DENSITY),
        "ballast": membranes("ballast", E=BALLAST_E, t=BALLAST_T, density=BALLAST_DENSITY),
        "arch": beams("arch", ([on_arch(s, line) for s in ARCH_STATIONS] for line in SIDES), ARCH),
        "deck_connections": beams("deck connection", (nodes[:2] for nodes in hangers), CONNECTION),
        "braces": beams("brace", (nodes[1:3] for nodes in hangers), BRACE),
        "arch_connections": beams("arch connection", (nodes[2:] for nodes in hangers), CONNECTION),
        "pipes": beams("pipe", ([on_arch(N_BAYS * x, line) for line in SIDES] for x in PIPES), PIPE),
    }
    groups = {part: list(members) for part, members in parts.items()}
    groups["bottom"] = [m for part in ("girders", "transverse_beams", "stiffeners", "plate") for m in groups[part]]
    groups["connections"] = groups["deck_connections"] + groups["arch_connections"]
    members = {name: element for part in parts.values() for name, element in part.items()}
    return Structure(
        nodes={node: place(node) for element in members.values() for node in element.nodes},
        members=members,
        supports={("deck", *corner): fixed for corner, fixed in SUPPORTS.items()},
        groups=groups,
    )


def place(node: Node) -> np.ndarray:
    """Coordinates of a node."""
    if node[0] == "joint":
        _, foot, head, line, end = node
        start, other = place(("deck", foot, line)), place(on_arch(head, line))
        if end == "arch":
            start, other = other, start
        return start + CONNECTION_LENGTH * (other - start) / np.linalg.norm(other - start)
    part, station, line = node
    x = station / N_BAYS
    return np.array([SPAN * x, WIDTH * (line / N_PANELS - 0.5), 4 * RISE * x * (1 - x) if part == "arch" else 0.0])


def on_arch(station: float, line: int) -> Node:
    """Node of an arch, which ends at the deck's corners."""
    return "deck" if station in (0, N_BAYS) else "arch", station, line


def along_deck(line: int) -> list[Node]:
    """Nodes of one line of the deck."""
    return [("deck", station, line) for station in STATIONS]


def heads(foot: int) -> tuple[int, int]:
    """Stations of the arch that a V-pair of braces reaches, at least one bay away from the supports."""
    return max(foot - REACH, 1), min(foot + REACH, N_BAYS - 1)


def hanger(foot: int, head: int, line: int) -> list[Node]:
    """Nodes of a connection, a brace and a connection in line, from deck to arch."""
    joints = [("joint", foot, head, line, end) for end in ("deck", "arch")]
    return [("deck", foot, line), *joints, on_arch(head, line)]


def beams(part: str, chains: Iterable[Sequence[Node]], section: Section, stiffness: float = 1.0) -> dict[Node, Beam]:
    """Steel beams along chains of nodes; ``stiffness`` multiplies the modulus."""
    material = STEEL | {modulus: stiffness * STEEL[modulus] for modulus in ("E", "G")}
    return {
        (part, start, end): Beam(start, end, **material, **section)
        for chain in chains
        for start, end in pairwise(chain)
    }


def transverse_beams() -> dict[Node, Beam]:
    """Across the deck at every station; those at the ends are stiffer."""
    lines = [[("deck", station, line) for line in LINES] for station in STATIONS]
    first, *inner, last = lines
    ends = beams("transverse beam", [first, last], T_BEAM, END_STIFFNESS)
    return beams("transverse beam", inner, T_BEAM) | ends


def stiffeners() -> dict[Node, Beam]:
    """All stiffeners, lumped at the lines of the mesh in proportion to the tributary width of each."""
    gathered = {}
    for line in LINES:
        width = WIDTH / N_PANELS / (2 if line in SIDES else 1)
        gathered |= beams("stiffener", [along_deck(line)], times(width / STIFFENER_SPACING, STIFFENER))
    return gathered


def membranes(part: str, **properties: float) -> dict[Node, Membrane]:
    """A layer over the deck."""
    return {
        (part, s, n): Membrane(
            (("deck", s, n), ("deck", s + 1, n), ("deck", s + 1, n + 1), ("deck", s, n + 1)),
            **properties,
            nu=NU,
            lumped=True,
        )
        for s in STATIONS[:-1]
        for n in LINES[:-1]
    }
