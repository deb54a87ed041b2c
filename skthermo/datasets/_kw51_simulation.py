"""Frequencies and shapes of KW51 in weather, while its stiffness and mass change."""

from functools import lru_cache

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo.datasets._kw51 import updated_model
from skthermo.datasets._kw51_retrofit import joint_masses, retrofit_mass
from skthermo.datasets._kw51_truth import BOX, TRUTH, truth_model, truth_structure
from skthermo.fem import ReducedModel

TOLERANCE = 1e-4  # errors were found to be below 1e-5 at simulated states
LASTING = 500  # hours
NO_MASS = 1e-9  # multipliers are positive
ROWS = 200  # whose shapes are in memory together


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
