"""Refinement of estimated parameters on the FE model: Levenberg-Marquardt steps, restarts where modes cross."""

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo.surrogate.refinement._posterior import Local, Objective, deviations

SMALL_STEP = 1e-6  # a Gauss-Newton step of ln theta below which a row has converged
SMALL_SHARE = 1e-3  # the same as a share of the posterior standard deviation
SMALL_GAIN = 1e-10
"""The share of the objective that a Gauss-Newton step would gain, below which rounding errors hide it."""

FIRST_DAMPING, LAST_DAMPING = 1e-4, 1e8
"""Damping after a first step that fails, as a share of the Hessian's diagonal, and damping at which a row stalls."""

SOME_MISFIT, LARGE_MISFIT = 0.5, 3.0
"""Residuals, root mean square in standard deviations of the noise: above the first, another order of modes is tried
where two are close; above the second, a row starts again at the middle of the box."""

CLOSE = 0.1  # difference of ln f up to which two neighbouring modes may have crossed


def refine(
    objective: Objective, start: Array, n_steps: int, *, sorts: bool
) -> tuple[Local, NDArray[np.bool_], NDArray[np.bool_]]:
    """Posterior modes of ln theta, by at most ``n_steps`` steps from each start; rows that have converged, and stalled.

    The frequencies of a model that sorts its modes have kinks where modes cross; rows that stall there start again
    beyond the kink. Where two modes exchange their shapes, rows with a large misfit start again at what frequencies
    alone say.
    """
    found, converged, stalled = minimise(objective, start.copy(), n_steps)

    def again(rows: NDArray[np.intp], beyond: Array) -> None:
        part = objective.of(rows)
        there, *state = minimise(part, beyond, n_steps)
        better = there.value < found.value[rows]
        found.put(rows[better], there.of(better))
        converged[rows[better]], stalled[rows[better]] = (values[better] for values in state)

    for lower in range(objective.log_measured.shape[1] - 1 if sorts else 0):
        doubtful = ~converged | (normalised_misfit(objective, found) > SOME_MISFIT)
        rows = np.flatnonzero(doubtful & (np.abs(gap(objective, found, lower)) < CLOSE))
        if rows.size:
            again(rows, across(objective.of(rows), found.of(rows), lower))
    if sorts:
        rows = np.flatnonzero(~converged | (normalised_misfit(objective, found) > LARGE_MISFIT))
        if rows.size:
            again(rows, np.tile(objective.prior.mean, (len(rows), 1)))
    if objective.shapes is not None:
        rows = np.flatnonzero(~converged | (normalised_misfit(objective, found) > LARGE_MISFIT))
        if rows.size:
            again(rows, minimise(objective.of(rows).without_shapes(), start[rows], n_steps)[0].x)
    return found, converged, stalled


def minimise(objective: Objective, x: Array, n_steps: int) -> tuple[Local, NDArray[np.bool_], NDArray[np.bool_]]:
    """Levenberg-Marquardt steps from x: where each row ends, whether it has converged, and whether it has stalled."""
    found = objective.at(x)
    converged, damping = np.zeros(len(x), dtype=bool), np.zeros(len(x))
    active = np.flatnonzero(np.isfinite(found.value))
    for remaining in range(n_steps, -1, -1):
        here = found.of(active)
        undamped = here.step(objective.prior, np.zeros(len(active)))
        is_small = (np.abs(undamped) <= np.maximum(SMALL_STEP, SMALL_SHARE * deviations(here.hessian))).all(axis=1)
        converged[active] = is_small | (here.gain(undamped) <= SMALL_GAIN * here.value)
        found.x[active] += np.where(converged[active, np.newaxis], undamped, 0.0)
        active = active[~converged[active] & (damping[active] < LAST_DAMPING)]
        if not active.size or not remaining:
            break
        here = found.of(active)
        step = here.step(objective.prior, damping[active])
        there = objective.of(active).at(here.x + step)
        better = there.value < here.value
        found.put(active[better], there.of(better))
        with np.errstate(invalid="ignore"):  # a row that cannot step is damped more
            success = (here.value - there.value) / here.gain(step)
        harder, easier = np.maximum(FIRST_DAMPING, 4 * damping[active]), damping[active] / 10
        easier[easier < FIRST_DAMPING] = 0.0
        damping[active] = np.where(success > 0.75, easier, np.where(success > 0.25, damping[active], harder))
    return found, converged, ~converged & ((damping > FIRST_DAMPING) | ~np.isfinite(found.value))


def normalised_misfit(objective: Objective, found: Local) -> Array:
    """Root mean square of the residuals in standard deviations of the noise."""
    n_measured = np.maximum((~objective.missing).sum(axis=1), 1)
    return np.sqrt(((found.residual / objective.noise) ** 2).sum(axis=1) / n_measured)


def gap(objective: Objective, found: Local, lower: int) -> Array:
    """Difference of ln f between two neighbouring modes of the model; NaN where one of them is missing."""
    fitted = (objective.log_measured - found.residual[:, : objective.log_measured.shape[1]])[:, lower : lower + 2]
    return fitted[:, 1] - fitted[:, 0]


def across(objective: Objective, found: Local, lower: int) -> Array:
    """One Gauss-Newton step that aims at the measured modes ``lower`` and ``lower + 1`` in exchanged order."""
    order = np.arange(objective.log_measured.shape[1])
    order[[lower, lower + 1]] = order[[lower + 1, lower]]
    here = objective.with_modes(order).at(found.x)
    return here.x + here.step(objective.prior, np.zeros(len(here.x)))
