"""The bridge behind `make_kw51_campaign`: frequencies in weather, while stiffness and mass change."""

from collections.abc import Hashable, Mapping
from functools import lru_cache

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo.datasets._kw51_model import N_BAYS, N_PANELS, kw51_structure, updated_model
from skthermo.datasets._kw51_weather import REFERENCE
from skthermo.fem import AffineModel, Element, PointMass, ReducedModel, Spring, Structure

TRUTH = {
    "E_gir": "deck_beams",
    "E_pla": "plate",
    "E_arc": "arch",
    "E_br": "braces",
    "E_con": "connections",
    "E_pip": "pipes",
    "E_b": "ballast",
    "I_33g": ("I_yy", "girders"),
    "K_bea": "bearings",
    "M_b": ("mass", "ballast"),
}
"""Parameters of the healthy bridge, as `Structure.assemble` binds them."""

BOX: dict[str, float | tuple[float, float]] = {
    **dict.fromkeys(("E_gir", "E_pla", "E_arc", "E_br", "E_pip"), 0.02),
    "E_con": 0.035,
    "E_b": (0.9, 1.7),
    "I_33g": (0.9, 2.2),
    "K_bea": (0.6, 1.6),
    "M_b": 0.015,
}
"""What weather does to them stays within these bounds."""

STEEL, CONNECTIONS, BALLAST, COMPOSITE, BEARINGS = 3.6e-4, 8e-4, 1.5e-3, 1.5e-3, 0.012  # softer by 1/K
FROZEN_BALLAST, FROZEN_COMPOSITE, FROST_DEPTH = 0.5, 1.0, 2.0  # stiffer by (ratios), K
MOISTURE = 0.0018  # standard deviation of the ballast's mass
SLIDING, ROCKING = 1e7, 3e7  # N/m and N m/rad at each bearing

STIFFENED = {"arch_connections": 0.906, "deck_connections": 0.430}
ADDED = {"arch": 353.0, "deck": 837.0}  # kg at each joint of brace and connection
PROGRESS = pd.DataFrame(
    {"mass": [0.0, 0.0, 0.5, 0.5, 0.5, 1.0], "stiffness": [0.0, 0.0, 0.0, 0.5, 0.5, 1.0]},
    index=pd.to_datetime(["2019-05-15", "2019-06-06", "2019-06-20", "2019-06-28", "2019-09-06", "2019-09-16"]),
)

TOLERANCE = 1e-4  # errors were found to be below 1e-5 at simulated states
LASTING = 500  # hours
NO_MASS = 1e-9  # multipliers are positive
ROWS = 200  # whose shapes are in memory together


def thermal_multipliers(weather: pd.DataFrame) -> pd.DataFrame:
    """Multipliers of the parameters ``TRUTH`` in every hour."""
    warm = weather[["steel", "sun", "slab"]] - REFERENCE
    frozen = 1 - np.exp(-weather["frost"] / FROST_DEPTH)
    return pd.DataFrame(
        {
            "E_gir": 1 - STEEL * warm["steel"],
            "E_pla": 1 - STEEL * warm["slab"],
            "E_arc": 1 - STEEL * warm["sun"],
            "E_br": 1 - STEEL * warm["sun"],
            "E_con": 1 - CONNECTIONS * warm["sun"],
            "E_pip": 1 - STEEL * warm["sun"],
            "E_b": (1 - BALLAST * warm["slab"]) * (1 + FROZEN_BALLAST * frozen),
            "I_33g": (1 - COMPOSITE * warm["slab"]) * (1 + FROZEN_COMPOSITE * frozen),
            "K_bea": np.exp(-BEARINGS * warm["steel"]),
            "M_b": 1 + MOISTURE * weather["moisture"],
        }
    )


def truth_structure(added: Mapping[Hashable, Element] | None = None) -> Structure:
    """KW51 with bearings that resist sliding and rocking, and with members that are added as the group "added"."""
    bridge, added = kw51_structure(), added or {}
    ends, lines = (0, N_BAYS), (0, N_PANELS)
    bearings: dict[Hashable, Element] = {
        ("bearing", end, "x"): Spring(("deck", end, N_PANELS), "x", SLIDING) for end in ends
    }
    bearings |= {
        ("bearing", end, line, "ry"): Spring(("deck", end, line), "ry", ROCKING) for end in ends for line in lines
    }
    groups = bridge.groups
    groups["deck_beams"] = groups["girders"] | groups["transverse_beams"] | groups["stiffeners"]
    groups["bearings"] = frozenset(bearings)
    return Structure(
        nodes=bridge.nodes,
        members={**bridge.members, **bearings, **added},
        supports=bridge.supports,
        groups=groups | ({"added": frozenset(added)} if added else {}),
    )


@lru_cache(maxsize=1)
def truth_model() -> AffineModel:
    """The healthy bridge, updated, with the parameters ``TRUTH``."""
    return updated_model(truth_structure(), TRUTH, 6)


def joint_masses() -> dict[Hashable, PointMass]:
    """A point mass at every joint."""
    joints = [node for node in kw51_structure().nodes if node[0] == "joint"]
    return {("mass", node): PointMass(node, ADDED[node[-1]]) for node in joints}


def retrofit_mass() -> Array:
    """The same, in kg at each degree of freedom."""
    return np.array(
        [ADDED[node[-1]] if node[0] == "joint" and d in "xyz" else 0.0 for node, d in kw51_structure().dofs]
    )


def progress_of(index: pd.DatetimeIndex, retrofit: bool) -> pd.DataFrame:
    """Shares of the retrofit's mass and stiffness that are there in each hour."""
    if not retrofit:
        return pd.DataFrame(0.0, index, PROGRESS.columns)
    knots = (PROGRESS.index - index[0]) / pd.Timedelta(hours=1)
    hours = np.arange(len(index))
    return pd.DataFrame({name: np.interp(hours, knots, shares) for name, shares in PROGRESS.items()}, index)


def simulate(
    theta: pd.DataFrame, mass: pd.Series, factors: pd.DataFrame, dofs: NDArray[np.intp] | None
) -> tuple[Array, Array | None]:
    """Frequencies (n, 6) in Hz and, at ``dofs``, mode shapes (n, 6, n_dofs).

    ``mass`` is the share of the retrofit's mass, and ``factors`` multiply the stiffness of the groups that are its
    columns. A state that lasts has a model of its own, which is smaller than one of all states.
    """
    factors = factors.loc[:, (factors != 1).any()]
    changes = np.column_stack([mass, factors])
    states, state, counts = np.unique(changes, axis=0, return_inverse=True, return_counts=True)
    state = state.ravel()
    lasting = (counts >= LASTING) | (states == [0.0, *np.ones(factors.shape[1])]).all(axis=1)
    frequencies = np.empty((len(theta), 6))
    shapes = None if dofs is None else np.empty((len(theta), 6, len(dofs)))
    for number in [*np.flatnonzero(lasting), -1]:
        rows = ~lasting[state] if number < 0 else state == number
        if not rows.any():
            continue
        values = theta[rows].to_numpy()
        if number < 0:
            model, values = _varying(values, changes[rows], tuple(factors.columns))
        else:
            share, *fixed = states[number]
            changed = zip(factors.columns, fixed, strict=True)
            model = fixed_truth(float(share), tuple((group, factor) for group, factor in changed if factor != 1))
        if shapes is None or dofs is None:
            frequencies[rows] = model.frequencies(values)
        else:
            frequencies[rows], shapes[rows] = _modes_at(model, values, dofs)
    return frequencies, shapes


@lru_cache(maxsize=6)
def fixed_truth(mass: float, factors: tuple[tuple[str, float], ...]) -> ReducedModel:
    """The bridge with a share of the retrofit's mass and with groups whose stiffness is multiplied."""
    model = truth_model().damaged({group: 1 - factor for group, factor in factors})
    if mass > 0:
        model = model.with_added(mass=mass * retrofit_mass())
    return model.reduced(BOX, tol=TOLERANCE, random_state=0)


@lru_cache(maxsize=4)
def varying_truth(has_mass: bool, bounds: tuple[tuple[str, float, float], ...]) -> ReducedModel:
    """The bridge with these as further parameters, within bounds."""
    structure = truth_structure(joint_masses() if has_mass else None)
    parameters = TRUTH | ({"added": ("mass", "added")} if has_mass else {})
    model = updated_model(structure, parameters, 6).with_damage_parameters([group for group, _, _ in bounds])
    box = BOX | ({"added": (NO_MASS, 1.0)} if has_mass else {})
    box |= {f"1 - {group}": (lowest, highest) for group, lowest, highest in bounds}
    return model.reduced(box, tol=TOLERANCE, random_state=0)


def _varying(theta: Array, changes: Array, groups: tuple[str, ...]) -> tuple[ReducedModel, Array]:
    """The model whose parameters are the changes, too, and its theta."""
    mass, factors = np.maximum(changes[:, :1], NO_MASS), changes[:, 1:]
    has_mass = bool((mass > NO_MASS).any())
    lowest, highest = _floor(factors.min(axis=0)), -_floor(-factors.max(axis=0))
    bounds = tuple(zip(groups, lowest.tolist(), highest.tolist(), strict=True))
    return varying_truth(has_mass, bounds), np.hstack([theta, mass, factors] if has_mass else [theta, factors])


def _floor(values: Array) -> Array:
    """Rounded down to three digits, so that like campaigns share a reduced model."""
    return np.floor(1000 * values - 1e-6) / 1000


def _modes_at(model: ReducedModel, theta: Array, dofs: NDArray[np.intp]) -> tuple[Array, Array]:
    frequencies, shapes = np.empty((len(theta), 6)), np.empty((len(theta), 6, len(dofs)))
    for start in range(0, len(theta), ROWS):
        rows = slice(start, start + ROWS)
        frequencies[rows], everywhere = model.modes(theta[rows])
        shapes[rows] = everywhere[:, dofs].transpose(0, 2, 1)
    return frequencies, shapes
