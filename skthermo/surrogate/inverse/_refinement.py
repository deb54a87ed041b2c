"""Parameters of measured frequencies and mode shapes by steps on the FE model, which end at the posterior mode."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations_with_replacement
from math import comb
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import Bunch

from skthermo._estimators.threads import single_blas_thread
from skthermo._io import with_progress
from skthermo._tables.arrays import (
    Array,
    by_mode,
    check_bounds,
    check_dofs,
    check_prior,
    real_array,
    robust_deviation,
    spread_evenly,
)
from skthermo.fem import FEModel, evaluate_modes, shape_components
from skthermo.surrogate._simulator import Simulator

NODE = 1e-6
"""Largest component at the sensors, as a share of the largest of the shape, below which a mode does not move them."""


@dataclass(frozen=True)
class ShapeInputs:
    """Columns of frequencies, and of the components of mode shapes, mode by mode.

    ``dofs`` are the sensors' degrees of freedom, ``reference`` the nominal shapes there, (n_sensors, n_modes), which
    set the signs, and ``noise`` standard deviations of components as a share of their shape's root mean square.
    """

    dofs: NDArray[np.intp]
    reference: Array
    noise: Array

    @classmethod
    def of(cls, model: FEModel, dofs: ArrayLike, noise: ArrayLike) -> ShapeInputs:
        """The columns for a model and sensors, which must be able to see each mode."""
        if not hasattr(model, "modes"):
            raise ValueError(f"dofs are given, but {model!r} has no method 'modes'; expected a model that gives shapes")
        shapes = np.asarray(model.modes(np.ones((1, len(model.parameter_names))))[1])[0]
        places = check_dofs(dofs, len(shapes), getattr(model, "dofs", ()))
        largest = np.abs(shapes[places]).max(axis=0) / np.abs(shapes).max(axis=0)
        if (largest < NODE).any():
            raise ValueError(
                f"mode {largest.argmin()} does not move the degrees of freedom {places.tolist()}; expected one that "
                "it moves, or model.with_modes without this mode"
            )
        deviations = real_array(by_mode(noise, model.n_modes, None, "shape_noise"), "shape_noise")
        if deviations.shape not in ((), (model.n_modes,)) or not ((deviations > 0) & (deviations < 1)).all():
            raise ValueError(
                f"shape_noise is {deviations}; expected standard deviations between 0 and 1, one number or "
                f"{model.n_modes}. 0.01 means 1 % of the root mean square of a shape"
            )
        return cls(places, shapes[places], np.broadcast_to(deviations, (model.n_modes,)))

    @property
    def n_sensors(self) -> int:
        return len(self.dofs)

    @property
    def n_modes(self) -> int:
        return self.reference.shape[1]

    @property
    def n_columns(self) -> int:
        return self.n_modes * (1 + self.n_sensors)

    @property
    def deviations(self) -> Array:
        """Standard deviations of the components of shapes of unit length, mode by mode, (n_modes * n_sensors,)."""
        return np.repeat(self.noise / np.sqrt(self.n_sensors), self.n_sensors)

    def normalised(self, inputs: Array) -> Array:
        """Inputs with components of a root mean square of 1 and the signs of the nominal shapes."""
        shapes = inputs[:, self.n_modes :].reshape(len(inputs), self.n_modes, self.n_sensors)
        return np.hstack([inputs[:, : self.n_modes], shape_components(shapes, self.reference)])

    def unit_shapes(self, inputs: Array) -> Array:
        """Measured shapes of unit length from normalised inputs, (n_samples, n_modes, n_sensors)."""
        shapes = inputs[:, self.n_modes :].reshape(len(inputs), self.n_modes, self.n_sensors)
        return shapes / np.sqrt(self.n_sensors)

    def of_parameters(self, model: FEModel, theta: Array, n_jobs: int | None = None) -> Array:
        """Inputs that the model gives for rows of theta, without noise."""
        frequencies, shapes = evaluate_modes(model, theta, self.dofs, n_jobs=n_jobs)
        return np.hstack([frequencies, shape_components(shapes.swapaxes(1, 2), self.reference)])

    def with_noise(self, inputs: Array, random_state: np.random.RandomState) -> Array:
        """Normalised inputs with noise on the components, normalised again."""
        noise = np.repeat(self.noise, self.n_sensors) * random_state.standard_normal(
            (len(inputs), len(self.deviations))
        )
        return self.normalised(np.hstack([inputs[:, : self.n_modes], inputs[:, self.n_modes :] + noise]))


def shape_misfit(units: Array, shapes: Array, slopes: Array) -> tuple[Array, Array]:
    """Differences u - v of measured shapes u, (n_samples, n_modes, n_sensors), and computed shapes v of unit length,
    and the derivatives of v.

    Computed shapes, (n_samples, n_sensors, n_modes), get the signs of the measured ones. Where a mode is missing, the
    difference is 0.
    """
    phi, d_phi = shapes.swapaxes(1, 2), slopes.swapaxes(1, 2)
    length = np.linalg.norm(phi, axis=2, keepdims=True)
    v = phi / length
    along = np.einsum("smd,smdp->smp", v, d_phi)
    dv = (d_phi - v[:, :, :, np.newaxis] * along[:, :, np.newaxis]) / length[:, :, :, np.newaxis]
    u = np.where(np.isnan(units), v, units)
    signs = np.where(np.einsum("smd,smd->sm", u, v) < 0, -1.0, 1.0)[:, :, np.newaxis]
    n_samples, n_parameters = len(u), slopes.shape[3]
    residual = (u - signs * v).reshape(n_samples, -1)
    return residual, (signs[:, :, :, np.newaxis] * dv).reshape(n_samples, -1, n_parameters)


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
    def of_box(cls, bounds: Array, width: Array | None = None) -> Prior:
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

    ``log_measured`` and ``units``, measured shapes of unit length, (n_samples, n_modes, n_sensors), are NaN where a
    mode is missing; without shapes, there are no sensors. ``noise``, (n_samples, n_observations), holds standard
    deviations of ln f and, mode by mode, of the components of shapes.
    """

    linearise: Linearise
    log_measured: Array
    noise: Array
    prior: Prior
    units: Array

    @property
    def n_sensors(self) -> int:
        return self.units.shape[2]

    @property
    def missing(self) -> NDArray[np.bool_]:
        """Which observations are missing, (n_samples, n_observations)."""
        n_components = self.log_measured.shape[1] * self.n_sensors
        return np.isnan(np.hstack([self.log_measured, self.units.reshape(len(self.units), n_components)]))

    def at(self, x: Array) -> Local:
        """The objective of every row, and its Gauss-Newton model, at ln theta = x."""
        (frequencies, sensitivity, *modes), missing = self.linearise(np.exp(x)), self.missing
        residual = self.log_measured - np.log(frequencies)
        if self.n_sensors:
            misfit, change = shape_misfit(self.units, *modes)
            residual, sensitivity = np.hstack([residual, misfit]), np.hstack([sensitivity, change])
        residual = np.where(missing, 0.0, residual)
        distance = (x - self.prior.mean) / self.prior.width
        value = 0.5 * (((residual / self.noise) ** 2).sum(axis=1) + (distance**2).sum(axis=1))
        gradient = -np.einsum("smp,sm->sp", sensitivity, residual / self.noise**2) + distance / self.prior.width
        hessian = self.prior.information(sensitivity, np.where(missing, np.inf, self.noise))
        return Local(x, np.where(np.isfinite(value), value, np.inf), gradient, hessian, residual, sensitivity)

    def of(self, rows: NDArray) -> Objective:
        return replace(self, log_measured=self.log_measured[rows], noise=self.noise[rows], units=self.units[rows])

    def without_shapes(self) -> Objective:
        """The objective of frequencies alone."""
        return replace(self, noise=self.noise[:, : self.log_measured.shape[1]], units=self.units[:, :, :0])

    def with_modes(self, order: NDArray) -> Objective:
        """The objective with the measured modes in another order."""
        n_modes, n_observations = self.log_measured.shape[1], self.noise.shape[1]
        later = np.arange(n_modes, n_observations).reshape(n_modes, -1)[order]
        noise = self.noise[:, np.append(order, later)]
        return replace(self, log_measured=self.log_measured[:, order], noise=noise, units=self.units[:, order])


class Rows:
    """Arrays of the same rows, and further objects of the same rows."""

    def of(self, rows: NDArray) -> Self:
        return type(self)(*(part.of(rows) if isinstance(part, Rows) else part[rows] for part in vars(self).values()))

    def put(self, rows: NDArray, other: Self) -> None:
        for mine, theirs in zip(vars(self).values(), vars(other).values(), strict=True):
            if isinstance(mine, Rows):
                mine.put(rows, theirs)
            else:
                mine[rows] = theirs

    @classmethod
    def together(cls, parts: Sequence[Self]) -> Self:
        """The rows of all parts, one after the other."""
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        return cls(*(type(c[0]).together(c) if isinstance(c[0], Rows) else np.concatenate(c) for c in columns))


@dataclass
class Local(Rows):
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

    def moved(self, step: Array, missing: NDArray[np.bool_]) -> Local:
        """These rows after a small step: residuals and objective are those of the linearised model."""
        residual = self.residual - np.einsum("smp,sp->sm", self.sensitivity, step)
        value = self.value - self.gain(step)
        return replace(self, x=self.x + step, value=value, residual=np.where(missing, 0.0, residual))


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
class Refined(Rows):
    """Where the steps of each row have ended, whether it has converged or stalled, and how often models were solved."""

    local: Local
    converged: NDArray[np.bool_]
    stalled: NDArray[np.bool_]
    solves: NDArray[np.intp]
    full_solves: NDArray[np.intp]


def refine(objective: Objective, start: Array, n_steps: int, *, sorts: bool) -> Refined:
    """Posterior modes of ln theta, by at most ``n_steps`` steps from each start.

    Rows that stall where a model that sorts its modes has kinks start again beyond, and so do those with a misfit, if
    two modes are exchanged there; rows with a large misfit, where two modes exchange their shapes, start again at the
    estimate from frequencies alone.
    """
    found = minimise(objective, start, n_steps)

    def again(rows: NDArray[np.intp], start: Array | Local) -> None:
        there = minimise(objective.of(rows), start, n_steps)
        there.solves += found.solves[rows]
        better = there.local.value < found.local.value[rows]
        found.solves[rows] = there.solves
        found.put(rows[better], there.of(better))

    def doubtful(misfit: float) -> NDArray[np.intp]:
        return np.flatnonzero(~found.converged | (normalised_misfit(objective, found.local) > misfit))

    for lower in range(objective.log_measured.shape[1] - 1 if sorts else 0):
        rows = doubtful(SOME_MISFIT)
        rows = rows[np.abs(gap(objective.of(rows), found.local.of(rows), lower)) < CLOSE]
        if rows.size:
            here, some = found.local.of(rows), objective.of(rows)
            beyond = some.at(across(some, here, lower))
            goes_on = ~found.converged[rows] | exchanged(here, beyond, lower)
            found.solves[rows[~goes_on]] += 1
            if goes_on.any():
                again(rows[goes_on], beyond.of(goes_on))
    if sorts and (rows := doubtful(LARGE_MISFIT)).size:
        again(rows, np.tile(objective.prior.mean, (len(rows), 1)))
    if objective.n_sensors and (rows := doubtful(LARGE_MISFIT)).size:
        again(rows, minimise(objective.without_shapes().of(rows), start[rows], n_steps).local.x)
    return found


def minimise(objective: Objective, start: Array | Local, n_steps: int) -> Refined:
    """Levenberg-Marquardt steps from each start, ln theta or the objective there."""
    found = start if isinstance(start, Local) else objective.at(start.copy())
    converged, damping = np.zeros(len(found.x), dtype=bool), np.zeros(len(found.x))
    solves = np.ones(len(found.x), dtype=np.intp)
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
    n_modes = objective.log_measured.shape[1]
    order = np.arange(n_modes)
    order[[lower, lower + 1]] = order[[lower + 1, lower]]
    fitted = np.exp(objective.log_measured - found.residual[:, :n_modes]), found.sensitivity[:, :n_modes]
    here = replace(objective.without_shapes().with_modes(order), linearise=lambda theta: fitted).at(found.x)
    return here.x + here.step(objective.prior, np.zeros(len(here.x)))


def exchanged(before: Local, after: Local, lower: int) -> NDArray[np.bool_]:
    """Whether the modes ``lower`` and ``lower + 1`` have each other's derivatives afterwards, as beyond a crossing."""
    pair = slice(lower, lower + 2)
    mine, others = before.sensitivity[:, pair], before.sensitivity[:, pair][:, ::-1]
    same, other = (((after.sensitivity[:, pair] - one) ** 2).sum(axis=(1, 2)) for one in (mine, others))
    return other < same


SAMPLES_PER_TERM = 2  # least number of samples for each term of the polynomial
ROWS_PER_CHUNK = 1024
KEPT = 0.01  # weight of the samples of the box, beside solutions near the records


@dataclass(frozen=True)
class ResponseSurface:
    """ln f as a polynomial of z = (ln theta - middle) / scale; coefficients (n_terms, n_modes)."""

    degree: int
    middle: Array
    scale: Array
    coefficients: Array

    @classmethod
    def of_samples(cls, theta: Array, frequencies: Array) -> ResponseSurface | None:
        """The surface of samples of a box; None where they are too few."""
        known = ~(np.isnan(frequencies).any(axis=1) | np.isnan(theta).any(axis=1))
        x, log_f = np.log(theta[known]), np.log(frequencies[known])
        n_parameters = theta.shape[1]
        degree = next((d for d in (3, 2) if len(x) >= SAMPLES_PER_TERM * comb(n_parameters + d, d)), None)
        if degree is None:
            return None
        middle, scale = x.mean(axis=0), x.std(axis=0)
        return cls(degree, middle, scale, least_squares(terms((x - middle) / scale, degree), log_f))

    def near(self, x: Array, frequencies: Array, sensitivity: Array) -> ResponseSurface:
        """The surface that is accurate near solutions, frequencies and d ln f / d ln theta at rows of ln theta = x.

        In directions in which these hardly differ, this surface is kept.
        """
        solved = np.isfinite(frequencies).all(axis=1) & np.isfinite(sensitivity).all(axis=(1, 2))
        z, log_f = (x[solved] - self.middle) / self.scale, np.log(frequencies[solved])
        slopes = (sensitivity[solved] * self.scale).swapaxes(1, 2).reshape(-1, log_f.shape[1])
        kept = KEPT * np.sqrt(len(z)) * np.eye(len(self.coefficients))
        equations = np.vstack([terms(z, self.degree), slopes_of_terms(z, self.degree).reshape(-1, len(kept)), kept])
        coefficients = least_squares(equations, np.vstack([log_f, slopes, kept @ self.coefficients]))
        return replace(self, coefficients=coefficients)

    def linearise(self, theta: Array) -> tuple[Array, Array]:
        """Frequencies and d ln f / d ln theta."""
        z = (np.log(theta) - self.middle) / self.scale
        log_f = np.empty((len(z), self.coefficients.shape[1]))
        slopes = np.empty((*log_f.shape, z.shape[1]))
        for rows in (slice(i, i + ROWS_PER_CHUNK) for i in range(0, len(z), ROWS_PER_CHUNK)):
            log_f[rows] = terms(z[rows], self.degree) @ self.coefficients
            slopes[rows] = (slopes_of_terms(z[rows], self.degree) @ self.coefficients).swapaxes(1, 2)
        return np.exp(log_f), slopes / self.scale


def products(n_variables: int, degree: int) -> list[NDArray[np.intp]]:
    """Which variables are multiplied in each product of one, two, ... variables, (n_products, n_factors)."""
    variables = range(n_variables)
    return [np.array([*combinations_with_replacement(variables, factors)]) for factors in range(1, degree + 1)]


def terms(z: Array, degree: int) -> Array:
    """1 and every product of up to so many variables, (n_samples, n_terms)."""
    values = [z[:, chosen].prod(axis=2) for chosen in products(z.shape[1], degree)]
    return np.hstack([np.ones((len(z), 1)), *values])


def slopes_of_terms(z: Array, degree: int) -> Array:
    """Derivatives of the terms by each variable, (n_samples, n_variables, n_terms)."""
    slopes = [np.zeros((*z.shape, 1))]
    for chosen in products(z.shape[1], degree):
        slope, column = np.zeros((*z.shape, len(chosen))), np.arange(len(chosen))
        for factor in range(chosen.shape[1]):
            slope[:, chosen[:, factor], column] += z[:, np.delete(chosen, factor, axis=1)].prod(axis=2)
        slopes.append(slope)
    return np.concatenate(slopes, axis=2)


def least_squares(equations: Array, values: Array) -> Array:
    """Least-squares solution, the same bits on any number of threads."""
    with single_blas_thread():
        return np.linalg.lstsq(equations, values, rcond=None)[0]


EXACT, EXACT_WITH_GAPS = 1e-6, 1e-3
"""Relative standard deviation of frequencies that count as exact. Where modes are missing, many parameters fit the
others, and this noise lets steps move along the curve of these parameters."""

FAR_OUTSIDE = 2 * np.sqrt(3)
"""Standard deviations of a box's prior that are two half-widths of the box; parameters beyond are far outside it."""

TINY_SHARE = 1e-12

LARGEST_SCATTER = 0.02  # scatter above which a misfit counts as a wrong model rather than noise
ASSUMED_SCATTER = 1e-3  # noise on which standard deviations are based where it is neither given nor can be estimated
ROWS_FOR_SCATTER = 365
STEPS_ON_SURFACE = 100
ROWS_FOR_SURFACE = 50  # number of records near which a response surface is made accurate
ROWS_FOR_BOX = 200  # number of records near which a reduced model has to be accurate
CHUNKS_PER_BLOCK = 8  # of the model, that are refined together: few, so that progress is visible


def unconverged(found: Bunch) -> NDArray[np.bool_]:
    """Rows with frequencies whose refinement has not converged."""
    return ~found.converged & (found.weight > 0)


@dataclass(frozen=True)
class Refinement:
    """Posterior modes of the parameters of measured frequencies and, perhaps, shapes.

    ``noise`` holds relative standard deviations, (n_modes,); ``n_steps`` is the most for each row. Rows start where the
    response ``surface`` has its posterior mode, or at the regressor's guess. Rows that end outside the box of a reduced
    model go on with the full one. ``recent`` holds the rows that the scatter was estimated from until they are needed.
    """

    simulator: Simulator
    noise: Array
    prior: Prior
    n_steps: int
    n_jobs: int | None
    shapes: ShapeInputs | None = None
    surface: ResponseSurface | None = None
    recent: list[tuple[Array, Refined]] = field(default_factory=list, repr=False)

    @classmethod
    def of(cls, inverse: Any) -> Refinement:
        """The refinement that the parameters of an `InverseSurrogate` ask for."""
        names = inverse.model.parameter_names
        width = None if inverse.prior is None else check_prior(inverse.prior, names)
        prior = Prior.of_box(check_bounds(inverse.bounds, names), width)
        drawn, surface = inverse.samples_, None
        if inverse.box_ is not None and inverse.shape_inputs_ is None:
            surface = ResponseSurface.of_samples(drawn.theta, drawn.frequencies)
        settings = inverse.n_steps_, inverse.n_jobs, inverse.shape_inputs_, surface
        return cls(inverse.simulator_, inverse.noise_, prior, *settings)

    def adapted(self, inputs: Array, guess: Array) -> Refinement:
        """The refinement whose reduced model and response surface suit where records have their parameters."""
        n_rows = ROWS_FOR_SURFACE if self.simulator.reduced is None else ROWS_FOR_BOX
        rows = spread_evenly(np.flatnonzero(~np.isnan(inputs).all(axis=1)), n_rows)
        if not rows.size or (self.surface is None and self.simulator.reduced is None):
            return self
        objective, start = self._problem(inputs[rows], guess[rows])
        x = minimise(objective, start, self.n_steps).local.x
        simulator = self.simulator.extended(np.exp(x), self.prior.limits)
        if self.surface is None:
            return replace(self, simulator=simulator)
        solved = simulator.approximate.linearise(np.exp(x), self.n_jobs, relative=True)
        return replace(self, simulator=simulator, surface=self.surface.near(x, *solved))

    def refined(self, inputs: Array, guess: Array, scatter: Array, *, remember: bool = False) -> Bunch:
        """What `InverseSurrogate.invert` gives, for rows of inputs and the regressor's guess."""
        n_modes, some = len(self.noise), ~np.isnan(inputs).all(axis=1)
        result = Bunch(
            theta=np.full_like(guess, np.nan),
            std=np.full_like(guess, np.nan),
            residuals=np.full((len(guess), n_modes), np.nan),
            weight=np.zeros(len(guess)),
            converged=np.zeros(len(guess), dtype=bool),
            outside=np.zeros(guess.shape, dtype=bool),
            solves=np.zeros(len(guess), dtype=np.intp),
            full_solves=np.zeros(len(guess), dtype=np.intp),
        )
        if not some.any():
            return result
        prior, guess = self.prior, guess[some]
        objective, start = self._problem(inputs[some], guess)
        found = self._recall(inputs[some], objective, start)
        if remember:
            self.recent.append((inputs[some], found))
        local, lost = found.local, found.stalled[:, np.newaxis]
        complete = self._with_shapes(np.maximum(objective.noise[:, :n_modes], scatter))
        deviations, at_best = (
            prior.deviations(np.nan_to_num(local.sensitivity), spread)
            for spread in (np.where(objective.missing, np.inf, complete), complete)
        )
        result.theta[some] = np.where(lost, guess, np.exp(local.x))
        result.std[some] = np.where(lost, prior.width, deviations) * result.theta[some]
        unknown = lost | np.isnan(objective.log_measured)
        result.residuals[some] = np.where(unknown, np.nan, local.residual[:, :n_modes])
        result.weight[some] = ((at_best / deviations) ** 2).mean(axis=1)
        result.outside[some] = self._contradicts(local.x, deviations)
        result.converged[some] = found.converged
        result.solves[some], result.full_solves[some] = found.solves, found.full_solves
        return result

    def _problem(self, inputs: Array, guess: Array) -> tuple[Objective, Array]:
        """The objective of rows of inputs, by the reduced model where there is one, and where their steps start."""
        prior, frequencies = self.prior, inputs[:, : len(self.noise)]
        gaps = np.isnan(frequencies).any(axis=1, keepdims=True)
        noise = np.maximum(self.noise, np.where(gaps, EXACT_WITH_GAPS, EXACT))
        units = np.empty((*frequencies.shape, 0)) if self.shapes is None else self.shapes.unit_shapes(inputs)
        linearise = self._by(self.simulator.approximate)
        objective = Objective(linearise, np.log(frequencies), self._with_shapes(noise), prior, units)
        start = np.clip(np.where(np.isnan(guess), prior.mean, np.log(guess)), prior.lowest, prior.highest)
        if self.surface is not None:
            start = minimise(replace(objective, linearise=self.surface.linearise), start, STEPS_ON_SURFACE).local.x
        return objective, start

    def _by(self, simulator: Simulator) -> Linearise:
        """Frequencies and, perhaps, shapes by a simulator, with their derivatives by ln theta."""
        dofs = None if self.shapes is None else self.shapes.dofs
        return partial(simulator.linearise, n_jobs=self.n_jobs, dofs=dofs, relative=True)

    def _recall(self, inputs: Array, objective: Objective, start: Array) -> Refined:
        """Refine rows, except those that were refined just before; rows do not depend on each other."""
        if not self.recent:
            return self._refine(objective, start)
        known_inputs, found = self.recent.pop()
        places = {row.tobytes(): place for place, row in enumerate(known_inputs)}
        place = np.array([places.get(row.tobytes(), -1) for row in inputs], dtype=np.intp)
        new = np.flatnonzero(place < 0)
        if new.size:
            place[new] = len(known_inputs) + np.arange(new.size)
            found = Refined.together([found, self._refine(objective.of(new), start[new])])
        return found.of(place)

    def _refine(self, objective: Objective, start: Array) -> Refined:
        """Refine rows in blocks, which show the progress."""
        size = CHUNKS_PER_BLOCK * getattr(self.simulator.approximate.model, "rows_per_chunk", 32)
        blocks = np.split(np.arange(len(start)), range(size, len(start), size))
        refined = (self._refine_block(objective.of(rows), start[rows]) for rows in blocks)
        parts = with_progress(refined, len(start), None, count=lambda part: len(part.converged), unit="records")
        return Refined.together([*parts])

    def _refine_block(self, objective: Objective, start: Array) -> Refined:
        """Refine rows; where those of a reduced model end outside its box, the full model takes the last steps."""
        sorts = not getattr(self.simulator.model, "track", False)
        found = refine(objective, start, self.n_steps, sorts=sorts)
        if self.simulator.reduced is not None:
            outside = np.flatnonzero(self.simulator.outside(np.exp(found.local.x)))
            if outside.size:
                exact = replace(objective.of(outside), linearise=self._by(Simulator(self.simulator.model)))
                last = minimise(exact, found.local.x[outside], self.n_steps)
                last.full_solves += last.solves
                last.solves += found.solves[outside]
                found.put(outside, last)
        return found

    def _with_shapes(self, noise: Array) -> Array:
        """Standard deviations of all observations, (n_samples, n_observations), given those of ln f."""
        if self.shapes is None:
            return noise
        return np.hstack([noise, np.tile(self.shapes.deviations, (len(noise), 1))])

    def _contradicts(self, x: Array, deviations: Array) -> NDArray[np.bool_]:
        """Whether ln theta is farther from the prior's mean than data from the prior can bring it.

        The share of the prior's variance that a row explains is 1 - (deviation / width)^2. The variance of posterior
        modes is that share of the prior's; the variance of exact inversions is the prior's over that share.
        """
        explained = np.maximum(1 - (deviations / self.prior.width) ** 2, TINY_SHARE)
        expected = self.prior.width * (np.sqrt(explained) if self.noise.all() else 1 / np.sqrt(explained))
        return np.abs(x - self.prior.mean) > FAR_OUTSIDE * expected

    def estimated_scatter(self, inputs: Array, guess: Array) -> Array:
        """The noise of each mode; where it is 0, what exact parameters leave of complete records, with more modes than
        parameters."""
        n_modes, n_parameters = len(self.noise), guess.shape[1]
        if self.noise.all():
            return self.noise
        rows = spread_evenly(np.flatnonzero(~np.isnan(inputs).any(axis=1)), ROWS_FOR_SCATTER)
        scatter = ASSUMED_SCATTER
        if n_modes > n_parameters and rows.size:
            exact = np.maximum(self.noise, EXACT)
            residuals = self.refined(inputs[rows], guess[rows], exact, remember=True).residuals
            residuals = residuals[~np.isnan(residuals).any(axis=1)]
            if len(residuals) > n_parameters:
                estimate = np.sqrt((robust_deviation(residuals) ** 2).sum() / (n_modes - n_parameters))
                scatter = min(max(estimate, EXACT), LARGEST_SCATTER)
        return np.where(self.noise > 0, self.noise, scatter)
