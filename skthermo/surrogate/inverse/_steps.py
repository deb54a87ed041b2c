"""What is measured of modes, and steps from it on an FE model to the posterior mode of the parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import Array, by_mode, check_dofs, real_array
from skthermo.fem import FEModel, evaluate_modes, shape_components

NODE = 1e-6
"""Largest component at the sensors, as a share of the largest of the shape, below which a mode does not move them."""

Linearise = Callable[[Array], tuple[Array, ...]]
"""Frequencies (n_samples, n_modes) and d ln f / d ln theta (n_samples, n_modes, n_parameters) at theta; where shapes
are measured, also shapes (n_samples, n_sensors, n_modes) and d phi / d ln theta."""

LEAST_DAMPING = 1e-14  # share of the diagonal added to precision matrices, which rounding could make singular
LONGEST_STEP = 0.5  # largest change of ln theta in one step


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


def information(sensitivity: Array, noise: Array, precision: Array) -> Array:
    """Precision of ln theta given derivatives of observations and their noise, infinite where one is missing."""
    scaled = sensitivity / noise[:, :, np.newaxis]
    return scaled.swapaxes(1, 2) @ scaled + precision


def deviations(information: Array) -> Array:
    """Standard deviations, (n_samples, n_parameters), of Gaussians with these precision matrices."""
    diagonal = np.einsum("spp->sp", information)
    regular = information + np.eye(diagonal.shape[1]) * (LEAST_DAMPING * diagonal)[:, np.newaxis]
    return np.sqrt(np.abs(np.einsum("spp->sp", np.linalg.inv(regular))))


@dataclass(frozen=True)
class Objective:
    """Half of the squared misfits of ln f and of shapes in standard deviations of the noise, and of ln theta by the
    ``precision`` of its prior about 0, (n_parameters, n_parameters).

    ``log_measured`` and ``units``, measured shapes of unit length, (n_samples, n_modes, n_sensors), are NaN where a
    mode is missing; without shapes, there are no sensors. ``noise``, (n_samples, n_observations), holds standard
    deviations of ln f and, mode by mode, of the components of shapes.
    """

    linearise: Linearise
    log_measured: Array
    noise: Array
    precision: Array
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
        pull = x @ self.precision
        value = 0.5 * (((residual / self.noise) ** 2).sum(axis=1) + (pull * x).sum(axis=1))
        gradient = -np.einsum("smp,sm->sp", sensitivity, residual / self.noise**2) + pull
        hessian = information(sensitivity, np.where(missing, np.inf, self.noise), self.precision)
        return Local(x, np.where(np.isfinite(value), value, np.inf), gradient, hessian, residual, sensitivity)

    def of(self, rows: NDArray) -> Objective:
        return replace(self, log_measured=self.log_measured[rows], noise=self.noise[rows], units=self.units[rows])

    def without_shapes(self) -> Objective:
        """The objective of frequencies alone."""
        return replace(self, noise=self.noise[:, : self.log_measured.shape[1]], units=self.units[:, :, :0])


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

    def step(self, damping: Array) -> Array:
        """Damped Gauss-Newton step."""
        diagonal = np.einsum("spp->sp", self.hessian)
        shares = np.maximum(damping, LEAST_DAMPING)[:, np.newaxis]
        damped = self.hessian + np.eye(self.x.shape[1]) * (shares * diagonal)[:, np.newaxis]
        step = -np.linalg.solve(damped, self.gradient[:, :, np.newaxis])[:, :, 0]
        longest = np.abs(step).max(axis=1, keepdims=True)
        return step * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, LONGEST_STEP))

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
where two are close; above the second, a row starts again at the nominal state."""

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
        again(rows, np.zeros((len(rows), len(objective.precision))))
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
        undamped = here.step(np.zeros(len(active)))
        last = here.moved(undamped, problem.missing)
        is_last = is_small(undamped, problem, last) | (here.gain(undamped) <= SMALL_GAIN * here.value)
        found.put(active[is_last], last.of(is_last))
        converged[active] = is_last
        active = active[~converged[active] & (damping[active] < LAST_DAMPING)]
        if not active.size or not remaining:
            break
        here = found.of(active)
        step = here.step(damping[active])
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
    frequencies = objective.without_shapes()
    n_modes = objective.log_measured.shape[1]
    order = np.arange(n_modes)
    order[[lower, lower + 1]] = order[[lower + 1, lower]]
    fitted = np.exp(objective.log_measured - found.residual[:, :n_modes]), found.sensitivity[:, :n_modes]
    measured, noise = frequencies.log_measured[:, order], frequencies.noise[:, order]
    here = replace(frequencies, linearise=lambda _: fitted, log_measured=measured, noise=noise).at(found.x)
    return here.x + here.step(np.zeros(len(here.x)))


def exchanged(before: Local, after: Local, lower: int) -> NDArray[np.bool_]:
    """Whether the modes ``lower`` and ``lower + 1`` have each other's derivatives afterwards, as beyond a crossing."""
    pair = slice(lower, lower + 2)
    mine, now = before.sensitivity[:, pair], after.sensitivity[:, pair]
    return ((now - mine[:, ::-1]) ** 2).sum(axis=(1, 2)) < ((now - mine) ** 2).sum(axis=(1, 2))
