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

    ================  ==========  =======  =================================================================
    quantity          value       unit     reason
    ================  ==========  =======  =================================================================
    spans             14, 30, 14  m        [PD01]_; straight, without the bridge's skew, same at both ends
    pier height       5.5         m        from the girder's axis to the footing; assumed
    element length    1           m        at most; halving it moves no frequency by 0.1 %
    girder E          37.5e9      Pa       concrete, where FE models of this bridge begin [TD04]_
    girder G          16e9        Pa       likewise
    girder density    2700        kg/m3    concrete, and the pavement smeared over its section
    girder A          4.4         m2       box girder, constant along the bridge; assumed
    girder I_yy       0.609       m4       vertical bending: fitted, start 0.6
    girder I_zz       17          m4       lateral bending, mostly of a deck slab 8.6 m wide; assumed
    girder J          1.27        m4       torsion: fitted, start 1.25
    pier E            37.5e9      Pa       the girder's
    pier G            16e9        Pa       the girder's
    pier density      2500        kg/m3    concrete
    pier A            2.4         m2       a wall, 0.6 m along and 4 m across the bridge; assumed
    pier I_yy         0.072       m4       bending along the bridge: 4 * 0.6**3 / 12
    pier I_zz         3.2         m4       bending across: 0.6 * 4**3 / 12
    pier J            0.26        m4       4 * 0.6**3 / 3, less a tenth for the section's ends
    soil x            1.5e9       N/m      order of a footing on gravel, here and in the next five rows
    soil y            2e9         N/m
    soil z            3e9         N/m
    soil rx           9.95e9      N m/rad  rocking across the bridge: fitted, start 1e10
    soil ry           5e9         N m/rad
    soil rz           5e9         N m/rad
    abutment x        3e9         N/m      earth behind it; half of that brings a longitudinal mode below f4
    abutment y        3e9         N/m      as along x
    abutment z        5.39e8      N/m      fitted, start 5e8
    abutment rx       3e9         N m/rad  z spread over the 8.6 m: 8.6**2 / 12 times as much; ry, rz free
    ================  ==========  =======  =================================================================

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
