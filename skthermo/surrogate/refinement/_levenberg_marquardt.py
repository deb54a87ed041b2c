"""Refinement of estimated parameters on the FE model: Levenberg-Marquardt steps, restarts where modes cross."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo.surrogate.refinement._posterior import Local, Objective, deviations

SMALL_STEP = 1e-6  # a Gauss-Newton step of ln theta that counts as none
SMALL_SHARE = 0.001
"""A Gauss-Newton step is the last one if it is smaller than this share of the posterior standard deviations, and if the
curvature of ln f along it changes no frequency by more than this share of the noise. The noise is what is stated or,
where the residuals of a row show more, what they show."""

SMALL_GAIN = 1e-10
"""The share of the objective that a Gauss-Newton step would gain, below which rounding errors hide it."""

FIRST_DAMPING, LAST_DAMPING = 1e-4, 1e8
"""Damping after a first step that fails, as a share of the Hessian's diagonal, and damping at which a row stalls."""

SOME_MISFIT, LARGE_MISFIT = 0.5, 3.0
"""Residuals, root mean square in standard deviations of the noise: above the first, another order of modes is tried
where two are close; above the second, a row starts again at the middle of the box."""

CLOSE = 0.1  # difference of ln f up to which two neighbouring modes may have crossed


@dataclass
class Refined:
    """Where the steps of each row have ended, and whether it has converged or stalled.

    ``full_solves`` tells how often the full model was solved beside a reduced one.
    """

    local: Local
    converged: NDArray[np.bool_]
    stalled: NDArray[np.bool_]
    solves: NDArray[np.intp]
    full_solves: NDArray[np.intp]

    def of(self, rows: NDArray) -> "Refined":
        """Some rows."""
        return Refined(self.local.of(rows), *(state[rows] for state in self._states))

    def put(self, rows: NDArray, other: "Refined") -> None:
        """Replace some rows."""
        self.local.put(rows, other.local)
        for mine, theirs in zip(self._states, other._states, strict=True):
            mine[rows] = theirs

    def beside(self, other: "Refined") -> "Refined":
        """These rows, and then others."""
        states = zip(self._states, other._states, strict=True)
        return Refined(self.local.beside(other.local), *(np.append(*pair) for pair in states))

    @property
    def _states(self) -> tuple[NDArray, ...]:
        return self.converged, self.stalled, self.solves, self.full_solves


def refine(objective: Objective, start: Array, n_steps: int, *, sorts: bool) -> Refined:
    """Posterior modes of ln theta, by at most ``n_steps`` steps from each start.

    The frequencies of a model that sorts its modes have kinks where modes cross; rows that stall there start again
    beyond the kink. Where two modes exchange their shapes, rows with a large misfit start again at what frequencies
    alone say.
    """
    found = minimise(objective, start, n_steps)

    def again(rows: NDArray[np.intp], beyond: Array) -> None:
        there = minimise(objective.of(rows), beyond, n_steps)
        there.solves += found.solves[rows]
        better = there.local.value < found.local.value[rows]
        found.solves[rows] = there.solves
        found.put(rows[better], there.of(better))

    for lower in range(objective.log_measured.shape[1] - 1 if sorts else 0):
        doubtful = ~found.converged | (normalised_misfit(objective, found.local) > SOME_MISFIT)
        rows = np.flatnonzero(doubtful & (np.abs(gap(objective, found.local, lower)) < CLOSE))
        if rows.size:
            again(rows, across(objective.of(rows), found.local.of(rows), lower))
    if sorts:
        rows = np.flatnonzero(~found.converged | (normalised_misfit(objective, found.local) > LARGE_MISFIT))
        if rows.size:
            again(rows, np.tile(objective.prior.mean, (len(rows), 1)))
    if objective.shapes is not None:
        rows = np.flatnonzero(~found.converged | (normalised_misfit(objective, found.local) > LARGE_MISFIT))
        if rows.size:
            again(rows, minimise(objective.of(rows).without_shapes(), start[rows], n_steps).local.x)
    return found


def minimise(objective: Objective, start: Array, n_steps: int) -> Refined:
    """Levenberg-Marquardt steps from each start."""
    found = objective.at(start.copy())
    converged, damping = np.zeros(len(start), dtype=bool), np.zeros(len(start))
    solves = np.ones(len(start), dtype=np.intp)
    active = np.flatnonzero(np.isfinite(found.value))
    for remaining in range(n_steps, -1, -1):
        here, problem = found.of(active), objective.of(active)
        undamped = here.step(objective.prior, np.zeros(len(active)))
        last = here.moved(undamped, problem.missing)
        is_last = is_small(undamped, problem, last) | (here.gain(undamped) <= SMALL_GAIN * here.value)
        found.put(active[is_last], last.of(is_last))
        converged[active] = is_last
        active = active[~converged[active] & (damping[active] < LAST_DAMPING)]
        if not active.size or not remaining:
            break
        here = found.of(active)
        step = here.step(objective.prior, damping[active])
        there = objective.of(active).at(here.x + step)
        solves[active] += 1
        better = there.value < here.value
        found.put(active[better], there.of(better))
        with np.errstate(invalid="ignore"):  # a row that cannot step is damped more
            success = (here.value - there.value) / here.gain(step)
        harder, easier = np.maximum(FIRST_DAMPING, 4 * damping[active]), damping[active] / 10
        easier[easier < FIRST_DAMPING] = 0.0
        damping[active] = np.where(success > 0.75, easier, np.where(success > 0.25, damping[active], harder))
    stalled = ~converged & ((damping > FIRST_DAMPING) | ~np.isfinite(found.value))
    return Refined(found, converged, stalled, solves, np.zeros_like(solves))


def is_small(step: Array, objective: Objective, after: Local) -> NDArray[np.bool_]:
    """Whether steps, after which rows are as given, are so small beside the noise that no further one is needed."""
    shown = np.maximum(1.0, normalised_misfit(objective, after))[:, np.newaxis]
    by_noise = SMALL_SHARE * shown * deviations(after.hessian)
    by_curvature = np.sqrt(SMALL_SHARE * shown * objective.noise.min(axis=1, keepdims=True))
    return (np.abs(step) <= np.maximum(SMALL_STEP, np.minimum(by_noise, by_curvature))).all(axis=1)


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
