"""FE model of the railway bridge KW51: sections, structure, parameters, sensors; see `make_kw51` for assumptions."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from skthermo._core.arrays import check_flag, check_names, positive_integer
from skthermo.fem import AffineModel, Beam, Membrane, Structure

Section = dict[str, float]
"""Area, second moments and torsion constant of a steel member, upright, in m: ``I_yy`` resists vertical bending of a
level member, ``I_zz`` lateral bending."""


def box(depth: float, width: float, thickness: float) -> Section:
    """Closed box of one wall thickness; torsion by Bredt."""
    d, w, t = depth, width, thickness
    hole = (2 * t - w, d - 2 * t, 0.0, 0.0)
    return of_rectangles((w, d, 0.0, 0.0), hole) | {"J": 2 * t * ((d - t) * (w - t)) ** 2 / (d + w - 2 * t)}


def tee(stem: float, flange: float, thickness: float) -> Section:
    """Tee of overall depth ``stem``; open, thin-walled torsion."""
    t, web = thickness, stem - thickness
    return of_rectangles((flange, t, 0.0, stem - t / 2), (t, web, 0.0, web / 2)) | {"J": (flange + web) * t**3 / 3}


def channel(depth: float, width: float, thickness: float) -> Section:
    """Channel with its web upright; open, thin-walled torsion."""
    d, t, flange = depth, thickness, width - thickness
    flanges = [(flange, t, t + flange / 2, z) for z in ((t - d) / 2, (d - t) / 2)]
    return of_rectangles((t, d, t / 2, 0.0), *flanges) | {"J": (d + 2 * flange) * t**3 / 3}


def rectangle(depth: float, width: float) -> Section:
    """Solid rectangle, deeper than wide; torsion by Roark's formula."""
    ratio = width / depth
    return of_rectangles((width, depth, 0.0, 0.0)) | {
        "J": depth * width**3 * (1 / 3 - 0.21 * ratio * (1 - ratio**4 / 12))
    }


def pipe(diameter: float, thickness: float) -> Section:
    """Round pipe."""
    outer, inner = diameter / 2, diameter / 2 - thickness
    inertia = math.pi * (outer**4 - inner**4) / 4
    return {"A": math.pi * (outer**2 - inner**2), "I_yy": inertia, "I_zz": inertia, "J": 2 * inertia}


def of_rectangles(*rectangles: tuple[float, float, float, float]) -> Section:
    """Area and second moments of rectangles (width, depth, y and z of the centre); holes have a negative width."""
    width, depth, y, z = np.transpose(rectangles)
    area = width * depth
    y, z = y - area @ y / area.sum(), z - area @ z / area.sum()
    return {
        "A": float(area.sum()),
        "I_yy": float((area * (depth**2 / 12 + z**2)).sum()),
        "I_zz": float((area * (width**2 / 12 + y**2)).sum()),
    }


Node = tuple[object, ...]

N_BAYS, N_PANELS = 32, 4  # of the mesh along and across the deck
PIPE_PLACES = (0.25, 0.385, 0.615, 0.75)  # shares of the span
KW51_STEEL = {"E": 210e9, "G": 210e9 / 2.6, "density": 7850.0, "I_p": 0.0, "lumped": True}
KW51_PARAMETERS: dict[str, tuple[str | tuple[str, ...], float]] = {
    "E_bot": ("bottom", 1.3),
    "E_arc": ("arch", 0.9),
    "E_br": ("braces", 0.9),
    "E_con": ("connections", 0.9),
    "E_pip": ("pipes", 0.942523),
    "E_b": ("ballast", 1.0),
    "A_c": (("A", "connections", "stiffness"), 1.5),
    "A_p": (("A", "pipes", "stiffness"), 1.0),
    "I_33p": (("I_yy", "pipes"), 1.0),
    "I_22p": (("I_zz", "pipes"), 0.5),
    "A_d": (("A", "braces", "stiffness"), 1.031471),
    "I_33a": (("I_yy", "arch"), 1.0),
    "I_22a": (("I_zz", "arch"), 1.128122),
    "A_a": (("A", "arch", "stiffness"), 1.016123),
    "J_a": (("J", "arch"), 1.0),
    "M_a": (("mass", "arch"), 0.711763),
    "I_33g": (("I_yy", "girders"), 1.0),
    "I_22g": (("I_zz", "girders"), 1.0),
    "M_g": (("mass", "girders"), 1.0),
    "A_tb": (("A", "transverse_beams", "stiffness"), 1.0),
    "I_22s": (("I_zz", "stiffeners"), 1.0),
}
"""What parameters are, as `Structure.assemble` binds them, and their multipliers in the updated model: the optimum of
the third fit of examples/plot_kw51_updating.py."""


def kw51_structure() -> Structure:
    """Nodes, members, supports and groups of the model `make_kw51`.

    Returns
    -------
    Structure
        Its axes are x along the bridge, y across it from -6.2 to 6.2 m, z upwards. Nodes are ("deck", station, line)
        and ("arch", station, line), with stations 0 to 32 and lines 0 to 4; lines 0 and 4 carry arches; ("joint", foot,
        head, line, "deck" or "arch") is where a brace meets a connection.

    See Also
    --------
    make_kw51 : The FE model and its assumptions.

    Examples
    --------
    >>> from skthermo.datasets import kw51_structure
    >>> structure = kw51_structure()
    >>> len(structure.dofs), len(structure.groups["braces"])
    (1760, 32)
    """
    sides = (0, N_PANELS)
    stations = sorted({*range(N_BAYS + 1), *(N_BAYS * x for x in PIPE_PLACES)})  # of an arch
    feet = range(2, N_BAYS, 4)
    hangers = [  # a V-pair of braces reaches the arch at least one bay away from the supports
        hanger(foot, head, line)
        for line in sides
        for foot in feet
        for head in (max(foot - 2, 1), min(foot + 2, N_BAYS - 1))
    ]
    connection, t_beam = rectangle(0.31, 0.045), tee(1.235, 0.6, 0.08)
    across = [[("deck", station, line) for line in range(N_PANELS + 1)] for station in range(N_BAYS + 1)]
    parts = {
        "girders": beams("girder", (along_deck(line) for line in sides), t_beam),
        "transverse_beams": beams("transverse beam", across[1:-1], t_beam)
        | beams("transverse beam", across[::N_BAYS], t_beam, 1.4),  # those at the ends are stiffer
        "stiffeners": stiffeners(),
        "plate": membranes("plate", E=210e9, t=0.015, density=7850.0),
        "ballast": membranes("ballast", E=550e6, t=0.6, density=1500.0),
        "arch": beams("arch", ([on_arch(s, line) for s in stations] for line in sides), box(1.3, 0.86, 0.05)),
        "deck_connections": beams("deck connection", (nodes[:2] for nodes in hangers), connection),
        "braces": beams("brace", (nodes[1:3] for nodes in hangers), box(0.35, 0.35, 0.016)),
        "arch_connections": beams("arch connection", (nodes[2:] for nodes in hangers), connection),
        "pipes": beams("pipe", ([on_arch(N_BAYS * x, line) for line in sides] for x in PIPE_PLACES), pipe(0.75, 0.04)),
    }
    groups = {part: list(members) for part, members in parts.items()}
    groups["bottom"] = [m for part in ("girders", "transverse_beams", "stiffeners", "plate") for m in groups[part]]
    groups["connections"] = groups["deck_connections"] + groups["arch_connections"]
    members = {name: element for part in parts.values() for name, element in part.items()}
    supports = {(0, 0): "xyz", (0, N_PANELS): "yz", (N_BAYS, 0): "xyz", (N_BAYS, N_PANELS): "yz"}
    return Structure(
        nodes={node: place(node) for element in members.values() for node in element.nodes},
        members=members,
        supports={("deck", *corner): fixed for corner, fixed in supports.items()},
        groups=groups,
    )


def place(node: Node) -> np.ndarray:
    """Coordinates of a node."""
    if node[0] == "joint":
        _, foot, head, line, end = node
        start, other = place(("deck", foot, line)), place(on_arch(head, line))
        if end == "arch":
            start, other = other, start
        return start + 1.6 * (other - start) / np.linalg.norm(other - start)
    part, station, line = node
    x = station / N_BAYS
    return np.array([115.0 * x, 12.4 * (line / N_PANELS - 0.5), 4 * 18.0 * x * (1 - x) if part == "arch" else 0.0])


def on_arch(station: float, line: int) -> Node:
    """Node of an arch, which ends at the deck's corners."""
    return "deck" if station in (0, N_BAYS) else "arch", station, line


def along_deck(line: int) -> list[Node]:
    """Nodes of one line of the deck."""
    return [("deck", station, line) for station in range(N_BAYS + 1)]


def hanger(foot: int, head: int, line: int) -> list[Node]:
    """Nodes of a connection, a brace and a connection in line, from deck to arch."""
    joints = [("joint", foot, head, line, end) for end in ("deck", "arch")]
    return [("deck", foot, line), *joints, on_arch(head, line)]


def beams(part: str, chains: Iterable[Sequence[Node]], section: Section, stiffness: float = 1.0) -> dict[Node, Beam]:
    """Steel beams along chains of nodes; ``stiffness`` multiplies the modulus."""
    material = KW51_STEEL | {modulus: stiffness * KW51_STEEL[modulus] for modulus in ("E", "G")}
    return {
        (part, start, end): Beam(start, end, **material, **section)
        for chain in chains
        for start, end in pairwise(chain)
    }


def stiffeners() -> dict[Node, Beam]:
    """All stiffeners, lumped at the lines of the mesh in proportion to the tributary width of each."""
    gathered = {}
    for line in range(N_PANELS + 1):
        number = 12.4 / N_PANELS / (2 if line in (0, N_PANELS) else 1) / 0.5
        section = {name: number * value for name, value in channel(0.25, 0.25, 0.008).items()}
        gathered |= beams("stiffener", [along_deck(line)], section)
    return gathered


def membranes(part: str, **properties: float) -> dict[Node, Membrane]:
    """A layer over the deck."""
    return {
        (part, s, n): Membrane(
            (("deck", s, n), ("deck", s + 1, n), ("deck", s + 1, n + 1), ("deck", s, n + 1)),
            **properties,
            nu=0.3,
            lumped=True,
        )
        for s in range(N_BAYS)
        for n in range(N_PANELS)
    }


def make_kw51(
    parameters: str | Collection[str] | None = None, n_modes: int = 6, *, updated: bool = False
) -> AffineModel:
    """FE model of the railway bridge KW51 in Leuven before its retrofit, as drawn or updated.

    A steel tied arch of 115 m with an orthotropic deck, as [KCM26]_, Appendix A, describes it: a space frame with 1760
    degrees of freedom.

    Parameters
    ----------
    parameters : str or collection of str, optional
        Some of the 21 names of Table A.2, in the order of the columns of theta, or "all". By default the five that
        vary with temperature, eq. (21): E_bot, E_arc, E_br, E_con, E_pip.
    n_modes : int, default=6
        Number of modes.
    updated : bool, default=False
        Whether theta = 1 is the model updated to frequencies that were measured before the retrofit (see Notes), all
        parameters that are not named being frozen at their updated values.

    Returns
    -------
    AffineModel
        With modes followed by shape (``track=True``). Damage groups: ``bottom`` and its parts ``girders``,
        ``transverse_beams``, ``stiffeners`` and ``plate``; ``arch``; ``braces``; ``connections`` and its parts
        ``arch_connections`` and ``deck_connections``; ``pipes``; ``ballast``.

    Raises
    ------
    ValueError
        If a parameter is unknown or named twice.

    See Also
    --------
    kw51_structure : The structure itself, for parameters and groups of your own.
    make_kw51_campaign : Synthetic monitoring of the updated bridge.

    Notes
    -----
    Moduli E_bot (girders, transverse beams, stiffeners, plate), E_arc, E_br, E_con, E_pip and E_b (ballast) multiply
    the whole stiffness of their members. Areas A_c (connections), A_p (pipes), A_d (braces), A_a (arch) and A_tb
    (transverse beams) multiply stiffness, not mass; so do second moments of vertical bending, I_33p, I_33a and I_33g
    (girders), and of lateral bending, I_22p, I_22a, I_22g and I_22s (stiffeners), and the torsion constant J_a. M_a and
    M_g multiply the masses of arch and girders.

    :ref:`structure-of-kw51` lists the values that the paper gives, those that are assumed, and the frequencies of the
    updated model, whose eleven multipliers ``python examples/plot_kw51_updating.py`` fits to six measured frequencies
    [ML21]_.

    Examples
    --------
    >>> from skthermo.datasets import make_kw51
    >>> model = make_kw51(["E_arc", "M_a"], n_modes=2)
    >>> model.frequencies([[1.0, 1.0], [1.1, 1.0], [1.0, 1.1]]).round(3)
    array([[0.477, 1.113],
           [0.487, 1.146],
           [0.459, 1.07 ]])
    """
    thermal = ["E_bot", "E_arc", "E_br", "E_con", "E_pip"]
    names = thermal if parameters is None else parameters
    if isinstance(names, str):
        names = list(KW51_PARAMETERS) if names == "all" else [names]
    names = check_names(names, "parameters", KW51_PARAMETERS)
    bound = {name: KW51_PARAMETERS[name][0] for name in names}
    n_modes = positive_integer(n_modes, "n_modes")
    if check_flag(updated, "updated"):
        return updated_model(kw51_structure(), bound, n_modes)
    return kw51_structure().assemble(bound, n_modes=n_modes, track=True)


def updated_model(structure: Structure, parameters: Mapping[str, Any], n_modes: int) -> AffineModel:
    """The model of a structure that has KW51's members, as updated, with parameters bound as `Structure.assemble`."""
    updated = {name: factor for name, (_, factor) in KW51_PARAMETERS.items() if factor != 1}
    bound = parameters | {name: KW51_PARAMETERS[name][0] for name in updated}
    model = structure.assemble(bound, n_modes=n_modes, track=True)
    theta = [updated.get(name, 1.0) for name in model.parameter_names]
    return model.rescaled(theta).with_parameters(list(parameters))


def kw51_sensors() -> dict[str, int]:
    """Degrees of freedom of the FE model at the accelerometers of the railway bridge KW51.

    Returns
    -------
    dict of str to int
        Label of each of the 12 sensors, in the order of the monitoring data, and its degree of freedom in
        `make_kw51`.

    See Also
    --------
    kw51_structure : The structure, whose ``dofs`` these are.

    Notes
    -----
    The positions are read from the labels, and partly assumed (:ref:`structure-of-kw51`): check them by the MAC of
    measured and computed shapes (`~skthermo.fem.match_modes`). For `load_kw51`, ``[kw51_sensors()[name] for name in
    data.sensors]`` are the degrees of freedom of the last axis of ``shapes``.

    Examples
    --------
    >>> from skthermo.datasets import kw51_sensors, kw51_structure
    >>> kw51_structure().dofs[kw51_sensors()["aBD17Az"]]
    (('deck', 16, 0), 'z')
    """
    lines = {"A": 0, "C": N_PANELS}
    on_deck = ("aBD11Az", "aBD17Ay", "aBD17Az", "aBD17Cz", "aBD23Ay", "aBD23Az")
    places = {label: (("deck", int(label[3:5]) - 1, lines[label[5]]), label[6]) for label in on_deck}
    for pair, station in {"aAR0910": 10, "aAR1516": 16, "aAR2122": 22}.items():
        places |= {f"{pair}{side}y": (("arch", station, line), "y") for side, line in lines.items()}
    dofs = {dof: i for i, dof in enumerate(kw51_structure().dofs)}
    return {label: dofs[place] for label, place in places.items()}
