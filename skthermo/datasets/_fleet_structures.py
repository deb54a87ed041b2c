"""Trusses, girders and tied arches of any span: design, members, groups."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from skthermo.datasets._truss import truss_structure
from skthermo.fem import Bar, Beam, Element, PointMass, Spring, Structure

Design = dict[str, float]
YOUNG = {"steel": 210e9, "composite": 210e9, "concrete": 35e9}
SLENDER = 1e-6  # m2 or m4: of what a member does not carry


@dataclass(frozen=True)
class Kind:
    """A kind of bridge."""

    design: Callable[[float, str, np.random.RandomState], Design]  # draws stiffnesses and masses, in SI units
    build: Callable[[Design, bool], Structure]  # the mesh of the truth is fine
    parameters: Mapping[str, str | tuple[str, str]]  # what theta multiplies in the user's model
    zones: Mapping[str, str]  # thermal zone -> material ("own": the bridge's); they cut across the parameters
    groups: tuple[str, ...]  # what can be damaged
    spans: tuple[float, float]  # shortest and longest span in m
    materials: tuple[str, ...]
    n_modes: int = 5


def truss_design(span: float, material: str, random: np.random.RandomState) -> Design:
    """The 28-bar truss scaled, with a floor and pavement on its bottom chord, on bearings."""
    area, density = 0.02 * random.uniform(0.8, 1.2), 7850.0
    floor = random.uniform(0.6, 1.2) * (1.4 if material == "composite" else 1.0)
    total = area * density * (1 + floor) * 4.6 * span  # 28 bars are 4.6 spans long
    modal = total / 2 * (2 * np.pi * 200 / span / np.sqrt(1 + floor)) ** 2
    return {
        "span": span,
        "height": random.uniform(0.9, 1.2),
        "mass": area * density * floor * 4.6 * span / 6,
        "EA_bottom": YOUNG["steel"] * area * random.uniform(0.9, 1.3),
        "EA_top": YOUNG["steel"] * area * random.uniform(0.9, 1.3),
        "EA_diagonal": YOUNG["steel"] * area * random.uniform(0.7, 1.0),
        "EA_pavement": YOUNG["steel"] * area * random.uniform(0.03, 0.08),
        "k_bearing": random.uniform(6, 12) * modal,
        "k_sliding": random.uniform(0.2, 0.5) * YOUNG["steel"] * area / span,
    }


def truss(design: Design, fine: bool) -> Structure:
    """The scaled truss; its mesh is the same for the user and for the truth."""
    sheet = truss_structure()
    scale = design["span"] / 26.0
    nodes = {node: tuple(place * scale * np.array([1, design["height"]])) for node, place in sheet.nodes.items()}
    of = {name: group for group in ("bottom", "top", "diagonal") for name in sheet.groups[group]}
    members: dict[Hashable, Element] = {}
    for name, bar in sheet.members.items():
        area = design[f"EA_{of.get(name, 'diagonal')}"] / YOUNG["steel"]
        members[name] = Bar(*bar.nodes, E=YOUNG["steel"], A=area, density=7850.0)
    bottom = sorted(sheet.groups["bottom"])
    for name in bottom:
        members["pavement", name] = Bar(*sheet.members[name].nodes, E=YOUNG["steel"], A=design["EA_pavement"] / 210e9)
    for node in map(str, range(1, 7)):
        members["floor", node] = PointMass(node, design["mass"])
    bearings = {
        ("bearing", node, along): Spring(
            node, along, design["k_sliding" if (node, along) == ("6", "x") else "k_bearing"]
        )
        for along in "yx"
        for node in "16"
    }
    pavement = [("pavement", name) for name in bottom]
    groups = {zone: sheet.groups[zone] for zone in ("T1", "T2", "T3", "top", "bottom")} | {
        "deck": [*bottom, *pavement],
        "diagonals": [*sheet.groups["diagonal"], *sheet.groups["vertical"], "11", "12", "28"],
        "pavement": pavement,
        "bearings": list(bearings),
    }
    return Structure(nodes, members | bearings, {}, groups)


def girder_design(span: float, material: str, random: np.random.RandomState) -> Design:
    """A girder over two or three spans, sized for a first frequency of about 100 Hz m over its span."""
    mass = random.uniform(10e3, 16e3) * (0.7 if material == "composite" else 1.0)
    first = random.uniform(85, 115) / span
    bending = mass * (2 * span**2 * first / np.pi) ** 2
    polar = mass * random.uniform(9, 12) ** 2 / 12
    torsion = polar * (2 * span * first * random.uniform(2.1, 2.9)) ** 2
    modal = mass * span / 2 * (2 * np.pi * first) ** 2
    return {
        "span": span,
        "n_spans": random.randint(2, 4),
        "side": random.uniform(0.75, 0.9),
        "mass": mass,
        "polar": polar,
        "EI": bending,
        "GJ": torsion,
        "EI_pavement": bending * random.uniform(0.03, 0.07),
        "k_bearing": random.uniform(4, 10) * modal,
        "k_turning": random.uniform(0.3, 0.8) * bending / span,
        "k_soil": random.uniform(4, 10) * modal,
        "k_rocking": random.uniform(0.3, 1.0) * bending / span,
        "k_twisting": 15 * torsion / span,
        "E": YOUNG[material],
    }


def line_of_beams(
    line: Sequence[Hashable], part: str, design: Design, bending: float, torsion: float, mass: float, area: float = 1.0
) -> dict[Hashable, Beam]:
    """Beams from node to node, with the given E I, G J and mass by length."""
    young, shear = design["E"], 0.4 * design["E"]
    section = {"E": young, "G": shear, "A": area, "I_yy": bending / young, "I_zz": SLENDER}
    section |= {"J": torsion / shear, "density": mass / area}
    section["I_p"] = design.get("polar", 0.0) * area / mass if mass else 0.0
    return {(part, *ends): Beam(*ends, **section) for ends in pairwise(line)}


def girder(design: Design, fine: bool) -> Structure:
    """A continuous girder in bending and torsion, on bearings at its ends and on soil below its piers."""
    side = design["span"] * (design["side"] if design["n_spans"] == 3 else 1.0)
    axes = np.cumsum([0.0, side, *[design["span"]] * (int(design["n_spans"]) - 2), side])
    n = 6 if fine else 4
    line = [float(x) for start, end in pairwise(axes) for x in np.linspace(start, end, n + 1)[:-1]] + [float(axes[-1])]
    beams = line_of_beams(line, "girder", design, design["EI"], design["GJ"], design["mass"])
    pavement = line_of_beams(line, "pavement", design, design["EI_pavement"], SLENDER, 0.0)
    ends, piers = (line[0], line[-1]), [line[i * n] for i in range(1, int(design["n_spans"]))]
    supports = (("bearings", ends, ("k_bearing", "k_turning")), ("soil", piers, ("k_soil", "k_rocking")))
    springs = {
        (part, node, along): Spring(node, along, design[k])
        for part, nodes, below in supports
        for node in nodes
        for along, k in zip(("z", "ry", "rx"), (*below, "k_twisting"), strict=True)
    }
    members = beams | pavement | springs
    parts = ("girder", "pavement", "bearings", "soil")
    groups = {part: [name for name in members if name[0] == part] for part in parts}
    return Structure(
        {x: (x, 0.0, 0.0) for x in line},
        members,
        dict.fromkeys(line, ("x", "y", "rz")),  # it bends and twists, but does not move sideways
        groups
        | {
            "deck": groups["girder"] + groups["pavement"],
            "west": [name for name in beams if name[1] < axes[-1] / 2],
            "east": [name for name in beams if name[1] >= axes[-1] / 2],
            "first span": [name for name in beams if name[1] < axes[1]],
        },
    )


def arch_design(span: float, material: str, random: np.random.RandomState) -> Design:
    """A tied arch, sized for a first antisymmetric frequency of about 200 Hz m over its span."""
    mass = random.uniform(7e3, 10e3) * (1.3 if material == "composite" else 1.0)
    first = random.uniform(160, 220) / span
    bending = mass * 1.2 * (span**2 * first / (2 * np.pi)) ** 2
    share = random.uniform(0.45, 0.65)
    modal = mass * span / 2 * (2 * np.pi * first) ** 2
    return {
        "span": span,
        "rise": span * random.uniform(0.15, 0.2),
        "mass": mass,
        "mass_arch": 0.2 * mass,
        "EI_deck": bending * share,
        "EI_arch": bending * (1 - share),
        "radius": span / 150,
        "EA_hanger": 210e9 * 0.004 * (span / 80),
        "EI_pavement": bending * share * random.uniform(0.03, 0.08),
        "k_bearing": random.uniform(3, 8) * modal,
        "k_sliding": random.uniform(0.3, 1.0) * modal,
        "k_turning": random.uniform(0.5, 1.5) * bending * share / span,
        "E": YOUNG["steel"],
    }


def arch(design: Design, fine: bool) -> Structure:
    """A tied arch in its plane: arch, deck, hangers at the ends of six bays, bearings."""
    span, n_bays, n = design["span"], 6, 2 if fine else 1
    stations = np.linspace(0, span, n_bays * n + 1).tolist()
    heights = {x: 4 * design["rise"] * x * (span - x) / span**2 for x in stations}
    deck = [("deck", x) for x in stations]
    rib = [("arch", x) if 0 < x < span else ("deck", x) for x in stations]

    def beams(part, line, stiffness, mass):
        area = stiffness / design["E"] / design["radius"] ** 2
        return line_of_beams(line, part, design, stiffness, SLENDER, mass, area)

    members = beams("girder", deck, design["EI_deck"], design["mass"])
    members |= beams("pavement", deck, design["EI_pavement"], 0.0)
    members |= beams("arch", rib, design["EI_arch"], design["mass_arch"])
    steel = {"E": 210e9, "A": design["EA_hanger"] / 210e9, "density": 7850.0}
    members |= {("hangers", x): Bar(("deck", x), ("arch", x), **steel) for x in stations[n:-n:n]}
    members |= {
        ("bearings", x, along): Spring(("deck", x), along, design[k])
        for x, sideways in ((stations[0], "k_bearing"), (stations[-1], "k_sliding"))
        for along, k in {"z": "k_bearing", "x": sideways, "ry": "k_turning"}.items()
    }
    parts = ("girder", "pavement", "arch", "hangers", "bearings")
    groups = {part: [name for name in members if name[0] == part] for part in parts}
    above = groups["arch"] + groups["hangers"]
    nodes = {node: (node[1], 0.0, heights[node[1]] if node[0] == "arch" else 0.0) for node in dict.fromkeys(deck + rib)}

    def place(name):
        return min(end[1] if isinstance(end, tuple) else end for end in name[1:])

    return Structure(
        nodes,
        members,
        dict.fromkeys(nodes, ("y", "rx", "rz")),
        groups
        | {
            "deck": groups["girder"] + groups["pavement"],
            "west": [name for name in above if place(name) < span / 2],
            "east": [name for name in above if place(name) >= span / 2],
        },
    )


KINDS = {
    "truss": Kind(
        truss_design,
        truss,
        parameters={"deck": "deck", "top": "top", "diagonals": "diagonals", "bearings": "bearings"},
        zones={"T1": "steel", "T2": "steel", "T3": "steel", "pavement": "pavement", "bearings": "bearings"},
        groups=("bottom", "top", "diagonals", "bearings"),
        spans=(26.0, 58.0),
        materials=("steel", "composite"),
    ),
    "girder": Kind(
        girder_design,
        girder,
        parameters={"deck": ("E", "deck"), "torsion": ("G", "deck"), "bearings": "bearings", "soil": "soil"},
        zones={"west": "own", "east": "own", "pavement": "pavement", "bearings": "bearings", "soil": "soil"},
        groups=("girder", "first span", "bearings", "soil"),
        spans=(20.0, 45.0),
        materials=("concrete", "composite"),
    ),
    "arch": Kind(
        arch_design,
        arch,
        parameters={"deck": "deck", "arch": "arch", "hangers": "hangers", "bearings": "bearings"},
        zones={"west": "steel", "east": "steel", "girder": "own", "pavement": "pavement", "bearings": "bearings"},
        groups=("girder", "arch", "hangers", "bearings"),
        spans=(50.0, 120.0),
        materials=("steel", "composite"),
    ),
}
