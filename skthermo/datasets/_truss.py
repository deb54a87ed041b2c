"""The 28-bar planar truss."""

from __future__ import annotations

import json
from importlib.resources import files

from skthermo.fem import AffineModel, Bar, Structure

PARAMETERS = ("bottom", "top", "diagonal", "vertical")
ZONES = ("T1", "T2", "T3")


def make_truss(n_modes: int = 6) -> AffineModel:
    """FE model of the 28-bar planar steel truss of Kamali et al. (2026), Section 3.

    Five X-braced bays of 5.2 m x 2.0 m; bars of 0.01 m2, 210 GPa and 7850 kg/m3 with consistent
    mass; pinned at one end, on a roller at the other.

    Parameters
    ----------
    n_modes : int, default=6
        Number of modes.

    Returns
    -------
    AffineModel
        With 4 parameters, the stiffness of the ``bottom``, ``top``, ``diagonal`` and
        ``vertical`` members (E_l, E_t, E_d, E_v in eq. (16)), which are also its damage groups;
        23 degrees of freedom. Columns are sorted by frequency (no tracking).

    Notes
    -----
    The paper gives the members' groups and the material; its dimensions are given in a figure only. This
    geometry is a reconstruction found by fitting the published Table 3. Three members belong
    to no group: 11 and 12, which carry the apex, and 28, the last end post.

    References
    ----------
    Kamali, Ceravolo & Marzani, Mechanical Systems and Signal Processing 256 (2026) 114519 [KCM26]_.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> make_truss().frequencies([[1.0, 1.0, 1.0, 1.0]]).round(3)
    array([[ 7.485, 27.5  , 37.842, 62.614, 67.17 , 95.412]])
    """
    return truss_structure().assemble(PARAMETERS, groups=PARAMETERS, n_modes=n_modes)


def truss_structure() -> Structure:
    """The truss with its member groups and its thermal zones as named groups."""
    sheet = json.loads(files("skthermo.datasets").joinpath("data", "truss28.json").read_text())
    steel = {"E": sheet["E_Pa"], "A": sheet["A_m2"], "density": sheet["rho_kg_m3"]}
    groups = sheet["groups"] | sheet["thermal_groups"]
    return Structure(
        nodes=sheet["nodes"],
        members={name: Bar(str(start), str(end), **steel) for name, (start, end) in sheet["members"].items()},
        supports=sheet["supports"],
        groups={group: [str(member) for member in members] for group, members in groups.items()},
    )
