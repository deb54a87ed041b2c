"""Refinement of estimated parameters on the FE model: Levenberg-Marquardt steps, restarts where modes cross."""

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo.surrogate._posterior import Local, Objective

SMALL_STEP = 1e-6
"""A Gauss-Newton step of ln theta below which a row has converged."""

SMALL_SHARE = 0.01
"""The same as a share of the posterior standard deviation."""

SMALL_GAIN = 1e-8
"""The share of the objective that a Gauss-Newton step would gain, below which rounding errors hide it."""

FIRST_DAMPING, LAST_DAMPING = 1e-4, 1e8
"""Damping after a first step that fails, as a share of the Hessian's diagonal, and damping at which a row stalls."""

LARGE_MISFIT = 3.0
"""Residuals, root mean square in standard deviations of the noise, above which another order of modes is tried."""

CLOSE = 0.1
"""Difference of ln f up to which two neighbouring modes may have crossed."""


def refine(objective: Objective, start: Array, n_steps: int, *, sorts: bool) -> tuple[Local, NDArray[np.bool_]]:
    """Posterior modes of ln theta, by at most ``n_steps`` steps from each start, and which rows have converged.

    The frequencies of a model that sorts its modes have kinks where modes cross, and rows may stall there. Such rows
    are started again beyond the kink.
    """
    found, converged = minimise(objective, start, n_steps)
    if sorts:
        for lower in range(objective.log_measured.shape[1] - 1):
            crossed = doubtful(objective, found, converged) & (np.abs(gap(objective, found, lower)) < CLOSE)
            retry(objective, found, converged, crossed, n_steps, lower)
        retry(objective, found, converged, doubtful(objective, found, converged), n_steps)
    return found, converged


def minimise(objective: Objective, x: Array, n_steps: int) -> tuple[Local, NDArray[np.bool_]]:
    """Levenberg-Marquardt steps from x: where each row ends, and whether it has converged."""
    found = objective.at(x)
    converged = np.zeros(len(x), dtype=bool)
    damping = np.zeros(len(x))
    active = np.flatnonzero(np.isfinite(found.value))
    for remaining in range(n_steps, -1, -1):
        here = found.of(active)
        undamped = here.step(objective.prior, np.zeros(len(active)))
        is_small = (np.abs(undamped) <= np.maximum(SMALL_STEP, SMALL_SHARE * deviations(here))).all(axis=1)
        gain = -0.5 * (here.gradient * undamped).sum(axis=1)
        converged[active] = is_small | (gain <= SMALL_GAIN * here.value)
        active = active[~converged[active] & (damping[active] < LAST_DAMPING)]
        if not active.size or not remaining:
            break
        here = found.of(active)
        there = objective.of(active).at(here.x + here.step(objective.prior, damping[active]))
        better = there.value < here.value
        found.put(active[better], there.of(better))
        damping[active] = np.where(better, relaxed(damping[active]), np.maximum(FIRST_DAMPING, 10 * damping[active]))
    return found, converged


def deviations(here: Local) -> Array:
    """Posterior standard deviations of ln theta."""
    return np.sqrt(np.einsum("spp->sp", np.linalg.inv(here.hessian)))


def relaxed(damping: Array) -> Array:
    """Damping after a step that succeeds."""
    return np.where(damping > FIRST_DAMPING, damping / 10, 0.0)


def retry(
    objective: Objective,
    found: Local,
    converged: NDArray[np.bool_],
    chosen: NDArray[np.bool_],
    n_steps: int,
    lower: int | None = None,
) -> None:
    """Start some rows again, beyond the crossing of two modes or at the prior's mean, and keep what is better."""
    rows = np.flatnonzero(chosen)
    if not rows.size:
        return
    part, here = objective.of(rows), found.of(rows)
    start = np.tile(objective.prior.mean, (len(rows), 1)) if lower is None else across(part, here, lower)
    there, done = minimise(part, start, n_steps)
    better = there.value < here.value
    found.put(rows[better], there.of(better))
    converged[rows[better]] = done[better]


def doubtful(objective: Objective, found: Local, converged: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Rows that have not converged, or whose residuals are large against the noise."""
    return ~converged | (normalised_misfit(objective, found) > LARGE_MISFIT)


def normalised_misfit(objective: Objective, found: Local) -> Array:
    """Root mean square of the residuals in standard deviations of the noise."""
    n_measured = np.maximum((~np.isnan(objective.log_measured)).sum(axis=1), 1)
    return np.sqrt(((found.residual / objective.noise) ** 2).sum(axis=1) / n_measured)


def gap(objective: Objective, found: Local, lower: int) -> Array:
    """Difference of ln f between two neighbouring modes of the model; NaN where one of them is missing."""
    fitted = (objective.log_measured - found.residual)[:, lower : lower + 2]
    return fitted[:, 1] - fitted[:, 0]


def across(objective: Objective, found: Local, lower: int) -> Array:
    """One Gauss-Newton step that aims at the measured modes ``lower`` and ``lower + 1`` in exchanged order."""
    order = np.arange(objective.log_measured.shape[1])
    order[[lower, lower + 1]] = order[[lower + 1, lower]]
    here = objective.with_modes(order).at(found.x)
    return here.x + here.step(objective.prior, np.zeros(len(here.x)))
