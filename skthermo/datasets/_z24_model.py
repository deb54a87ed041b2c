"""The Z24 bridge as a stick of beams on springs."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import ceil

import numpy as np

from skthermo.fem import AffineModel, Beam, Spring, Structure

Place = tuple[float, float, float]

SPANS = (14.0, 30.0, 14.0)
PIER_HEIGHT = 5.5
CONCRETE = {"E": 37.5e9, "G": 16e9}
CONSTANTS: dict[str, dict[str, float]] = {
    "girder": {**CONCRETE, "density": 2700.0, "A": 4.4, "I_yy": 0.609, "I_zz": 17.0, "J": 1.27},
    "pier": {**CONCRETE, "density": 2500.0, "A": 2.4, "I_yy": 0.072, "I_zz": 3.2, "J": 0.26},
    "soil": {"x": 1.5e9, "y": 2e9, "z": 3e9, "rx": 9.95e9, "ry": 5e9, "rz": 5e9},
    "abutment": {"x": 3e9, "y": 3e9, "z": 5.39e8, "rx": 3e9},
}
PARAMETERS: dict[str, str | tuple[str, str]] = {
    "girder_bending": ("E", "girder"),
    "piers_soil": "piers_soil",
    "girder_torsion": ("G", "girder"),
    "abutments": "abutments",
}
DAMAGE_GROUPS = PARAMETERS | {"piers": "piers", "soil": "soil"}


def make_z24(n_modes: int = 4, *, track: bool = True) -> AffineModel:
    """FE model of the Z24 highway bridge: a stick of 3-D beams on springs.

    A girder over three spans, clamped to two pier walls; springs under the piers and at the abutments
    stand for the soil. Its first four modes are those of the monitoring that `load_z24` reads: vertical
    bending (symmetric), lateral, vertical bending (antisymmetric) and torsion.

    Parameters
    ----------
    n_modes : int, default=4
        Number of modes.
    track : bool, default=True
        Whether a column follows its mode by shape; False sorts columns by frequency.

    Returns
    -------
    AffineModel
        With 426 degrees of freedom and four parameters: ``girder_bending`` (E of
        the girder: vertical and lateral bending and the axial stiffness), ``piers_soil`` (the pier walls
        and the springs under them), ``girder_torsion`` (G of the girder) and ``abutments`` (all springs
        there). Each is also a damage group, and so are ``piers`` and ``soil``, the two parts of ``piers_soil``.

    See Also
    --------
    load_z24 : The monitoring of this bridge.

    Notes
    -----
    Axes: x along the bridge from one abutment, y across, z upwards; the girder's axis is at z = 0. The model assumes:

    =====================  =========================================================================================
    spans                  14, 30 and 14 m [PD01]_; straight, without the bridge's skew, same at both ends
    pier height            5.5 m from the girder's axis to the footing; assumed
    element length         at most 1 m; halving it moves no frequency by 0.1 %
    E and G                37.5 and 16 GPa: concrete, where FE models of this bridge begin [TD04]_
    density                2700 kg/m3 (girder, with its pavement) and 2500 kg/m3 (piers)
    girder A, I_zz         4.4 m2 and 17 m4: box girder with a deck slab 8.6 m wide, constant along the bridge; assumed
    girder I_yy, J         0.609 and 1.27 m4: vertical bending and torsion, fitted, start 0.6 and 1.25
    pier A, I_yy, I_zz, J  2.4 m2; 0.072, 3.2 and 0.26 m4: a wall, 0.6 m along and 4 m across the bridge; assumed
    soil x, y, z           1.5, 2 and 3 GN/m: order of a footing on gravel
    soil rx, ry, rz        9.95 (rocking across the bridge: fitted, start 10), 5 and 5 GN m/rad
    abutment x, y          3 GN/m: earth behind it; half of that in x brings a longitudinal mode below f4
    abutment z             0.539 GN/m: fitted, start 0.5
    abutment rx            3 GN m/rad: z spread over the 8.6 m, 8.6**2 / 12 times as much; ry, rz free
    =====================  =========================================================================================

    ``tools/fit_z24_constants.py`` found the four fitted constants by `~skthermo.updating.ModelUpdater`, with a
    weak prior centred on the start values, from the mean frequencies of the healthy records in which all seven
    sensors are above 5 C, so that nothing is frozen.

    Torsion (f4) has vertical modes close below and above it, so that modes change their order in most of the box of
    +-30 %; columns therefore follow shapes. Only the abutments affect f1 and f3 differently, and weakly: the smallest
    singular value of d ln f / d ln theta is 0.06, a tenth of the largest.

    References
    ----------
    Peeters & De Roeck, One-year monitoring of the Z24-Bridge: environmental effects versus damage events,
    Earthquake Engineering and Structural Dynamics 30 (2001) 149-171 [PD01]_.

    Teughels & De Roeck, Structural damage identification of the highway bridge Z24 by FE model updating, Journal of
    Sound and Vibration 278 (2004) 589-610 [TD04]_.

    Examples
    --------
    >>> from skthermo.datasets import make_z24
    >>> model = make_z24()
    >>> model.frequencies([[1.0, 1.0, 1.0, 1.0]]).round(1)
    array([[ 3.9,  5.2, 10. , 10.7]])
    >>> model.damaged({"soil": 0.3}).frequencies([[1.0, 1.0, 1.0, 1.0]]).round(1)
    array([[ 3.9,  4.8, 10. , 10.6]])
    """
    return z24_structure().assemble(PARAMETERS, groups=DAMAGE_GROUPS, n_modes=n_modes, track=track)


def z24_structure(
    constants: Mapping[str, Mapping[str, float]] = CONSTANTS, *, element_length: float = 1.0
) -> Structure:
    """Girder, piers, soil and abutments; nodes are named by their coordinates."""
    axes = [0.0, *np.cumsum(SPANS).tolist()]
    spans = [divided(start, end, element_length) for start, end in pairwise(axes)]
    girder: list[Place] = [(x, 0.0, 0.0) for x in dict.fromkeys(x for span in spans for x in span)]
    heights = divided(-PIER_HEIGHT, 0.0, element_length)
    piers: list[list[Place]] = [[(x, 0.0, z) for z in heights] for x in axes[1:-1]]
    parts = {
        "girder": [Beam(*ends, **constants["girder"]) for ends in pairwise(girder)],
        "piers": [Beam(*ends, **constants["pier"]) for pier in piers for ends in pairwise(pier)],
        "soil": [Spring(pier[0], along, k) for pier in piers for along, k in constants["soil"].items()],
        "abutments": [
            Spring(end, along, k) for end in (girder[0], girder[-1]) for along, k in constants["abutment"].items()
        ],
    }
    members = {(part, i): element for part, elements in parts.items() for i, element in enumerate(elements)}
    groups = {part: [name for name in members if name[0] == part] for part in parts}
    return Structure(
        nodes={place: place for line in (girder, *piers) for place in line},
        members=members,
        supports={},
        groups=groups | {"piers_soil": groups["piers"] + groups["soil"]},
    )


def divided(start: float, end: float, element_length: float) -> list[float]:
    """Ends of equal elements of at most the given length."""
    return np.linspace(start, end, 1 + ceil((end - start) / element_length)).tolist()
