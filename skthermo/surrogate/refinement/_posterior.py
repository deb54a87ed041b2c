"""Posterior modes of ln theta given ln f, all rows at once: Levenberg-Marquardt steps, restarts where modes cross."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo.surrogate.refinement._shapes import MeasuredShapes

Linearise = Callable[[Array], tuple[Array, ...]]
"""Frequencies (n_samples, n_modes) and d ln f / d ln theta (n_samples, n_modes, n_parameters) at theta; where shapes
are measured, also shapes (n_samples, n_sensors, n_modes) and d phi / d ln theta."""

REACH = 3.0  # half-widths of the box, in ln theta, from its middle to the limits of an estimate
LEAST_DAMPING = 1e-14  # share of the diagonal added to precision matrices, which rounding could make singular
LONGEST_STEP = 0.5  # largest change of ln theta in one step


def deviations(information: Array) -> Array:
    """Standard deviations, (n_samples, n_parameters), of Gaussians with these precision matrices."""
    diagonal = np.einsum("spp->sp", information)
    regular = information + np.eye(diagonal.shape[1]) * (LEAST_DAMPING * diagonal)[:, np.newaxis]
    return np.sqrt(np.abs(np.einsum("spp->sp", np.linalg.inv(regular))))


@dataclass(frozen=True)
class Prior:
    """Gaussian prior of ln theta, within limits; each (n_parameters,)."""

    mean: Array
    width: Array
    lowest: Array
    highest: Array

    @classmethod
    def of_box(cls, bounds: Array, width: Array | None = None) -> "Prior":
        """The prior about the middle of a box and, without a width, with the variance of ln theta spread over it."""
        lowest, highest = np.log(bounds).T
        mean, half = np.log(bounds.mean(axis=1)), (highest - lowest) / 2
        return cls(mean, half / np.sqrt(3) if width is None else width, mean - REACH * half, mean + REACH * half)

    @property
    def limits(self) -> Array:
        """Lowest and highest multiplier of an estimate, (n_parameters, 2)."""
        return np.exp(np.column_stack([self.lowest, self.highest]))

    def information(self, sensitivity: Array, noise: Array) -> Array:
        """Precision of ln theta given derivatives of the observations and the noise, infinite where one is missing."""
        scaled = sensitivity / noise[:, :, np.newaxis]
        return scaled.swapaxes(1, 2) @ scaled + np.diag(self.width**-2.0)

    def deviations(self, sensitivity: Array, noise: Array) -> Array:
        """Posterior standard deviations of ln theta (Laplace's approximation), (n_samples, n_parameters)."""
        return deviations(self.information(sensitivity, noise))


@dataclass(frozen=True)
class Objective:
    """Half of the squared misfits of ln f, of shapes and of ln theta, in standard deviations of noise and prior.

    ``log_measured`` is NaN where a mode is missing; ``noise``, (n_samples, n_observations), holds standard deviations
    of ln f and, mode by mode, of the components of shapes of unit length.
    """

    linearise: Linearise
    log_measured: Array
    noise: Array
    prior: Prior
    shapes: MeasuredShapes | None = None

    @property
    def missing(self) -> NDArray[np.bool_]:
        """Which observations are missing, (n_samples, n_observations)."""
        missing = np.isnan(self.log_measured)
        return missing if self.shapes is None else np.hstack([missing, self.shapes.missing])

    def at(self, x: Array) -> "Local":
        """The objective of every row, and its Gauss-Newton model, at ln theta = x."""
        (frequencies, sensitivity, *modes), missing = self.linearise(np.exp(x)), self.missing
        residual = self.log_measured - np.log(frequencies)
        if self.shapes is not None:
            misfit, change = self.shapes.misfit(*modes)
            residual, sensitivity = np.hstack([residual, misfit]), np.hstack([sensitivity, change])
        residual = np.where(missing, 0.0, residual)
        distance = (x - self.prior.mean) / self.prior.width
        value = 0.5 * (((residual / self.noise) ** 2).sum(axis=1) + (distance**2).sum(axis=1))
        gradient = -np.einsum("smp,sm->sp", sensitivity, residual / self.noise**2) + distance / self.prior.width
        hessian = self.prior.information(sensitivity, np.where(missing, np.inf, self.noise))
        return Local(x, np.where(np.isfinite(value), value, np.inf), gradient, hessian, residual, sensitivity)

    def of(self, rows: NDArray) -> "Objective":
        """The objective of some rows."""
        shapes = None if self.shapes is None else self.shapes.of(rows)
        return replace(self, log_measured=self.log_measured[rows], noise=self.noise[rows], shapes=shapes)

    def without_shapes(self) -> "Objective":
        """The objective of frequencies alone."""
        return replace(self, noise=self.noise[:, : self.log_measured.shape[1]], shapes=None)

    def with_modes(self, order: NDArray) -> "Objective":
        """The objective with the measured modes in another order."""
        shapes = None if self.shapes is None else self.shapes.with_modes(order)
        n_modes, n_observations = self.log_measured.shape[1], self.noise.shape[1]
        later = np.arange(n_modes, n_observations).reshape(n_modes, -1)[order]
        noise = self.noise[:, np.append(order, later)]
        return replace(self, log_measured=self.log_measured[:, order], noise=noise, shapes=shapes)


@dataclass
class Local:
    """An `Objective` at ln theta = x, row by row, with residuals and derivatives of the observations."""

    x: Array
    value: Array
    gradient: Array
    hessian: Array
    residual: Array
    sensitivity: Array

    def step(self, prior: Prior, damping: Array) -> Array:
        """Damped Gauss-Newton step within the limits; parameters that it would carry beyond stop there."""
        held = ((self.x <= prior.lowest) & (self.gradient > 0)) | ((self.x >= prior.highest) & (self.gradient < 0))
        n_parameters = self.x.shape[1]
        diagonal = np.einsum("spp->sp", self.hessian)
        shares = np.maximum(damping, LEAST_DAMPING)[:, np.newaxis]
        damped = self.hessian + np.eye(n_parameters) * (shares * diagonal)[:, np.newaxis]
        fixed, step = np.zeros_like(self.x), np.zeros_like(self.x)
        for _ in range(n_parameters):
            free = ~held
            pull = -self.gradient - np.einsum("spq,sq->sp", damped, fixed)
            matrix = damped * (free[:, :, np.newaxis] & free[:, np.newaxis])
            matrix += np.eye(n_parameters) * (held * diagonal)[:, np.newaxis]
            step = np.where(held, fixed, np.linalg.solve(matrix, np.where(free, pull, 0.0)[:, :, np.newaxis])[:, :, 0])
            there = self.x + step
            beyond = free & ((there < prior.lowest) | (there > prior.highest))
            if not beyond.any():
                break
            at_limit = np.clip(there, prior.lowest, prior.highest) - self.x
            held, fixed = held | beyond, np.where(beyond, at_limit, fixed)
        longest = np.abs(step).max(axis=1, keepdims=True)
        step *= np.minimum(1.0, LONGEST_STEP / np.maximum(longest, LONGEST_STEP))
        return np.clip(self.x + step, prior.lowest, prior.highest) - self.x

    def gain(self, step: Array) -> Array:
        """How much a step would lower the objective if it were quadratic."""
        return -(self.gradient * step).sum(axis=1) - 0.5 * np.einsum("sp,spq,sq->s", step, self.hessian, step)

    def moved(self, step: Array, missing: NDArray[np.bool_]) -> "Local":
        """These rows after a small step: residuals and objective are those of the linearised model."""
        residual = self.residual - np.einsum("smp,sp->sm", self.sensitivity, step)
        value = self.value - self.gain(step)
        return replace(self, x=self.x + step, value=value, residual=np.where(missing, 0.0, residual))

    def put(self, rows: NDArray, other: "Local") -> None:
        """Replace some rows."""
        for mine, theirs in zip(vars(self).values(), vars(other).values(), strict=True):
            mine[rows] = theirs

    def beside(self, other: "Local") -> "Local":
        """These rows, and then others."""
        return Local(*(np.concatenate(pair) for pair in zip(vars(self).values(), vars(other).values(), strict=True)))

    def of(self, rows: NDArray) -> "Local":
        """Some rows."""
        return Local(*(values[rows] for values in vars(self).values()))


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
    """Where the steps of each row have ended, whether it has converged or stalled, and how often models were solved."""

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

    Rows that stall where a model that sorts its modes has kinks start again beyond; rows with a large misfit, where two
    modes exchange their shapes, start again at the estimate from frequencies alone.
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
