"""The bridge of `make_kw51_campaign`: how weather moves its stiffness and mass, and its retrofit."""

from functools import lru_cache

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo.datasets._kw51 import updated_model
from skthermo.datasets._kw51_structure import N_BAYS, N_PANELS, kw51_structure
from skthermo.datasets._kw51_weather import REFERENCE
from skthermo.fem import AffineModel, PointMass, ReducedModel, Spring, Structure

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
BOX = {
    **dict.fromkeys(("E_gir", "E_pla", "E_arc", "E_br", "E_pip"), 0.02),
    "E_con": 0.035,
    "E_b": (0.9, 1.7),
    "I_33g": (0.9, 2.2),
    "K_bea": (0.6, 1.6),
    "M_b": 0.015,
}
TOLERANCE = 1e-4  # the reduced models' own estimate; frequencies were found within 3e-5
LASTING = 500  # hours
NO_MASS = 1e-9  # share, because multipliers are positive

STEEL = 3.6e-4  # 1/K
CONNECTIONS = 8e-4
BALLAST, COMPOSITE = 1.5e-3, 1.5e-3
BEARINGS = 0.012
FROZEN_BALLAST, FROZEN_COMPOSITE, FROST_DEPTH = 0.5, 1.0, 2.0  # ratio, ratio, K
MOISTURE = 0.0018  # standard deviation of the ballast's mass

SLIDING, ROCKING = 1e7, 3e7  # N/m and N m/rad at each bearing

STIFFENED = {"arch_connections": 0.906, "deck_connections": 0.430}
ADDED = {"arch": 353.0, "deck": 837.0}  # kg at each joint


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


def truth_structure(*, with_joint_masses: bool = False) -> Structure:
    """KW51 with bearings that resist sliding and rocking and, where asked for, the masses that its retrofit adds."""
    bridge = kw51_structure()
    bearings = {
        **{("bearing", s, "x"): Spring(("deck", s, N_PANELS), "x", SLIDING) for s in (0, N_BAYS)},
        **{
            ("bearing", s, line, "ry"): Spring(("deck", s, line), "ry", ROCKING)
            for s in (0, N_BAYS)
            for line in (0, N_PANELS)
        },
    }
    masses = {("mass", node): PointMass(node, m=ADDED[node[-1]]) for node in bridge.nodes if node[0] == "joint"}
    added = masses if with_joint_masses else {}
    groups = bridge.groups
    groups |= {
        "bearings": list(bearings),
        "deck_beams": groups["girders"] | groups["transverse_beams"] | groups["stiffeners"],
    }
    return Structure(
        nodes=bridge.nodes,
        members=bridge.members | bearings | added,
        supports=bridge.supports,
        groups=groups | ({"joint masses": list(added)} if added else {}),
    )


@lru_cache(maxsize=1)
def truth_model() -> AffineModel:
    """The healthy bridge, updated, with the parameters ``TRUTH``."""
    return updated_model(truth_structure(), TRUTH, 6)


@lru_cache(maxsize=6)
def fixed_truth(factors: tuple[tuple[str, float], ...], mass_share: float) -> ReducedModel:
    """The same with the stiffness of groups multiplied and a share of the retrofit's mass, reduced within ``BOX``."""
    model = truth_model().damaged({group: 1 - factor for group, factor in factors})
    if mass_share > 0:
        model = model.with_added(mass=mass_share * retrofit_mass())
    return model.reduced(BOX, tol=TOLERANCE, random_state=0)


@lru_cache(maxsize=4)
def varying_truth(bounds: tuple[tuple[str, float, float], ...], has_masses: bool) -> ReducedModel:
    """The same with further parameters: the share of the retrofit's mass, and the factor of each group in bounds."""
    parameters = TRUTH | ({"added mass": ("mass", "joint masses")} if has_masses else {})
    model = updated_model(truth_structure(with_joint_masses=has_masses), parameters, 6)
    box = BOX | ({"added mass": (NO_MASS, 1.0)} if has_masses else {})
    box |= {f"1 - {group}": (lowest, highest) for group, lowest, highest in bounds}
    groups = [group for group, _, _ in bounds]
    return model.with_damage_parameters(groups).reduced(box, tol=TOLERANCE, random_state=0)


def retrofit_mass() -> Array:
    """Mass in kg that the retrofit adds at each degree of freedom."""
    return np.array(
        [ADDED[node[-1]] if node[0] == "joint" and d in "xyz" else 0.0 for node, d in kw51_structure().dofs]
    )


def retrofit_keywords() -> dict[str, object]:
    """The retrofit as keyword arguments of `DataInformedFEM.simulate`."""
    return {"damage": {group: -share for group, share in STIFFENED.items()}, "mass": retrofit_mass()}


def simulate(
    theta: pd.DataFrame, factors: pd.DataFrame, mass_share: Array, dofs: NDArray[np.intp] | None = None
) -> tuple[Array, Array | None]:
    """Frequencies (n, 6) in Hz and, at ``dofs``, shapes (n, 6, n_dofs).

    ``factors`` multiply the stiffness of the groups that are its columns; ``mass_share`` multiplies the mass that the
    retrofit adds. A state that lasts has a model of its own, which is smaller than one in which the state varies.
    """
    factors = factors.loc[:, (factors != 1).any()]
    changes = np.column_stack([mass_share, factors])
    states, state, counts = np.unique(changes, axis=0, return_inverse=True, return_counts=True)
    frequencies = np.empty((len(theta), 6))
    shapes = None if dofs is None else np.empty((len(theta), 6, len(dofs)))
    lasts = (counts >= LASTING) | (states == [0.0] + [1.0] * factors.shape[1]).all(axis=1)
    parts = [(state.ravel() == number, True) for number in np.flatnonzero(lasts)]
    for rows, is_fixed in [*parts, (~lasts[state.ravel()], False)]:
        if not rows.any():
            continue
        values = theta.to_numpy()[rows]
        if is_fixed:
            share, *fixed = changes[rows][0]
            model = fixed_truth(tuple(zip(factors.columns, fixed, strict=True)), share)
        else:
            varied, share = factors[rows], changes[rows, 0]
            bounds = tuple((group, _down(f.min()), -_down(-f.max())) for group, f in varied.items())
            has_masses = bool((share > 0).any())
            model = varying_truth(bounds, has_masses)
            masses = np.maximum(share, NO_MASS)[:, np.newaxis]
            values = np.hstack([values, masses, varied] if has_masses else [values, varied])
        if shapes is None:
            frequencies[rows] = model.frequencies(values)
        else:
            frequencies[rows], shapes[rows] = _modes_at(model, values, dofs)
    return frequencies, shapes


def _down(value: float) -> float:
    """Rounded down to two digits, so that similar campaigns share a reduced model."""
    return float(np.floor(100 * value - 1e-9) / 100)


def _modes_at(model: ReducedModel, theta: Array, dofs: NDArray[np.intp]) -> tuple[Array, Array]:
    frequencies, shapes = [], []
    for rows in np.array_split(theta, max(1, len(theta) // 500)):
        f, phi = model.modes(rows)
        frequencies.append(f)
        shapes.append(phi[:, dofs].transpose(0, 2, 1))
    return np.vstack(frequencies), np.vstack(shapes)
