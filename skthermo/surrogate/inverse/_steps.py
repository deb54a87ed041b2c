"""What is measured of modes, and steps from it on an FE model to the posterior mode of the parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import Array, by_mode, check_dofs, real_array
from skthermo.fem import FEModel, evaluate_modes, shape_components

Linearise = Callable[[Array], tuple[Array, ...]]
"""Frequencies (n_samples, n_modes) and d ln f / d ln theta (n_samples, n_modes, n_parameters) at theta; where shapes
are measured, also shapes (n_samples, n_sensors, n_modes) and d phi / d ln theta."""


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
    def read(cls, model: FEModel, dofs: ArrayLike, noise: ArrayLike) -> ShapeInputs:
        """The columns for a model and sensors, each mode of which must move a sensor."""
        if not hasattr(model, "modes"):
            raise ValueError(f"dofs are given, but {model!r} has no method 'modes'; expected a model that gives shapes")
        shapes = np.asarray(model.modes(np.ones((1, len(model.parameter_names))))[1])[0]
        places = check_dofs(dofs, len(shapes), getattr(model, "dofs", ()))
        largest = np.abs(shapes[places]).max(axis=0) / np.abs(shapes).max(axis=0)
        if (largest < 1e-6).any():  # rounding errors at a node
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

    def simulated(self, model: FEModel, theta: Array, n_jobs: int | None = None) -> Array:
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


def deviations(information: Array, *, least_damping: float = 1e-14) -> Array:
    """Standard deviations, (n_samples, n_parameters), of Gaussians with these precision matrices.

    A share of the diagonal is added to a matrix, which rounding could make singular.
    """
    diagonal = np.einsum("spp->sp", information)
    regular = information + np.eye(diagonal.shape[1]) * (least_damping * diagonal)[:, np.newaxis]
    return np.sqrt(np.abs(np.einsum("spp->sp", np.linalg.inv(regular))))


class Rows:
    """Arrays of the same rows, and further objects of the same rows."""

    def some(self, rows: NDArray) -> Self:
        """Some of the rows."""
        parts = []
        for part in vars(self).values():
            parts.append(part.some(rows) if isinstance(part, Rows) else part[rows])
        return type(self)(*parts)

    def put(self, rows: NDArray, other: Self) -> None:
        """Put other values into some of the rows."""
        for mine, theirs in zip(vars(self).values(), vars(other).values(), strict=True):
            if isinstance(mine, Rows):
                mine.put(rows, theirs)
            else:
                mine[rows] = theirs

    @classmethod
    def together(cls, parts: Sequence[Self]) -> Self:
        """The rows of all parts, one after the other."""
        joined = []
        for column in zip(*map(dict.values, map(vars, parts)), strict=True):
            is_nested = isinstance(column[0], Rows)
            joined.append(type(column[0]).together(column) if is_nested else np.concatenate(column))
        return cls(*joined)


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
        """Damped Gauss-Newton step, that changes no ln theta by more than 0.5."""
        diagonal = np.einsum("spp->sp", self.hessian)
        shares = np.maximum(damping, 1e-14)[:, np.newaxis]  # rounding could make the matrix singular
        damped = self.hessian + np.eye(self.x.shape[1]) * (shares * diagonal)[:, np.newaxis]
        step = -np.linalg.solve(damped, self.gradient[:, :, np.newaxis])[:, :, 0]
        return step * np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=1, keepdims=True), 0.5))

    def gain(self, step: Array) -> Array:
        """How much a step would lower the objective if it were quadratic."""
        return -(self.gradient * step).sum(axis=1) - 0.5 * np.einsum("sp,spq,sq->s", step, self.hessian, step)


@dataclass(frozen=True)
class Objective:
    """Half of the squared misfits of ln f and of shapes in standard deviations of the noise, and of ln theta by the
    ``precision`` of its prior about 0, (n_parameters, n_parameters).

    ``log_measured`` and ``units``, measured shapes of unit length, (n_samples, n_modes, n_sensors), are NaN where a
    mode is missing; without shapes, there are no sensors. ``noise``, (n_samples, n_observations), holds standard
    deviations of ln f and, mode by mode, of the components of shapes; ``missing`` tells which observations are.
    """

    linearise: Linearise
    log_measured: Array
    noise: Array
    precision: Array
    units: Array
    missing: NDArray[np.bool_]

    def at(self, x: Array) -> Local:
        """The objective of every row, and its Gauss-Newton model, at ln theta = x."""
        frequencies, sensitivity, *modes = self.linearise(np.exp(x))
        residual = self.log_measured - np.log(frequencies)
        if self.units.shape[2]:
            misfit, change = shape_misfit(self.units, *modes)
            residual, sensitivity = np.hstack([residual, misfit]), np.hstack([sensitivity, change])
        residual = np.where(self.missing, 0.0, residual)
        pull = x @ self.precision
        value = 0.5 * (((residual / self.noise) ** 2).sum(axis=1) + (pull * x).sum(axis=1))
        gradient = -np.einsum("smp,sm->sp", sensitivity, residual / self.noise**2) + pull
        hessian = information(sensitivity, np.where(self.missing, np.inf, self.noise), self.precision)
        return Local(x, np.where(np.isfinite(value), value, np.inf), gradient, hessian, residual, sensitivity)

    def some(self, rows: NDArray) -> Objective:
        """The objective of some rows."""
        parts = self.log_measured[rows], self.noise[rows], self.precision, self.units[rows], self.missing[rows]
        return Objective(self.linearise, *parts)

    def without_shapes(self) -> Objective:
        """The objective of frequencies alone."""
        n_modes = self.log_measured.shape[1]
        noise, missing = self.noise[:, :n_modes], self.missing[:, :n_modes]
        return replace(self, noise=noise, units=self.units[:, :, :0], missing=missing)

    def misfit(self, found: Local) -> Array:
        """Root mean square of the residuals in standard deviations of the noise."""
        n_measured = np.maximum((~self.missing).sum(axis=1), 1)
        return np.sqrt(((found.residual / self.noise) ** 2).sum(axis=1) / n_measured)


@dataclass
class Refined(Rows):
    """Where the steps of each row have ended, whether it has converged or stalled, and how often models were solved."""

    local: Local
    converged: NDArray[np.bool_]
    stalled: NDArray[np.bool_]
    solves: NDArray[np.intp]
    full_solves: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.converged)


def refine(
    objective: Objective,
    start: Array,
    n_steps: int = 100,
    *,
    sorts: bool,
    some_misfit: float = 0.5,
    large_misfit: float = 3.0,
    close: float = 0.1,
) -> Refined:
    """Posterior modes of ln theta, by at most ``n_steps`` steps from each start.

    A model that ``sorts`` its modes has kinks where two modes cross. Rows that stall there start again beyond; so do
    rows with some misfit, root mean square in standard deviations of the noise, where two modes within ``close`` of ln
    f are exchanged. Rows with a large misfit start again at the nominal state and, where two modes exchange their
    shapes, at the estimate from frequencies alone.
    """
    found = minimise(objective, start, n_steps)
    for lower in range(objective.log_measured.shape[1] - 1 if sorts else 0):
        rows = doubtful(objective, found, some_misfit)
        some, here = objective.some(rows), found.local.some(rows)
        fitted = some.log_measured - here.residual[:, : some.log_measured.shape[1]]
        near = np.abs(fitted[:, lower + 1] - fitted[:, lower]) < close  # not where one is missing
        if not near.any():
            continue
        rows, some, here = rows[near], some.some(near), here.some(near)
        beyond = some.at(across(some, here, lower))
        goes_on = ~found.converged[rows] | exchanged(here, beyond, lower)
        found.solves[rows[~goes_on]] += 1
        start_again(objective, found, rows[goes_on], beyond.some(goes_on), n_steps)
    if sorts and (rows := doubtful(objective, found, large_misfit)).size:
        start_again(objective, found, rows, np.zeros((len(rows), len(objective.precision))), n_steps)
    if objective.units.shape[2] and (rows := doubtful(objective, found, large_misfit)).size:
        by_frequencies = minimise(objective.without_shapes().some(rows), start[rows], n_steps)
        start_again(objective, found, rows, by_frequencies.local.x, n_steps)
    return found


def doubtful(objective: Objective, found: Refined, misfit: float) -> NDArray[np.intp]:
    """Rows that have not converged, or have a larger misfit."""
    return np.flatnonzero(~found.converged | (objective.misfit(found.local) > misfit))


def start_again(
    objective: Objective, found: Refined, rows: NDArray[np.intp], start: Array | Local, n_steps: int
) -> None:
    """Take steps from another start, and keep their end in rows with a smaller objective there."""
    if not rows.size:
        return
    there = minimise(objective.some(rows), start, n_steps)
    there.solves += found.solves[rows]
    better = there.local.value < found.local.value[rows]
    found.solves[rows] = there.solves
    found.put(rows[better], there.some(better))


def minimise(
    objective: Objective,
    start: Array | Local,
    n_steps: int = 100,
    *,
    small_gain: float = 1e-10,
    first_damping: float = 1e-4,
    last_damping: float = 1e8,
) -> Refined:
    """Levenberg-Marquardt steps from each start, ln theta or the objective there.

    An undamped step is a row's last one if it is small, or if it would gain a ``small_gain`` of the objective, below
    which rounding errors hide it. After a first step that fails, the damping is ``first_damping`` of the Hessian's
    diagonal; at ``last_damping`` a row stalls.
    """
    found = start if isinstance(start, Local) else objective.at(start.copy())
    converged, damping = np.zeros(len(found.x), dtype=bool), np.zeros(len(found.x))
    solves = np.ones(len(found.x), dtype=np.intp)
    active = np.flatnonzero(np.isfinite(found.value))
    for remaining in range(n_steps, -1, -1):
        here, problem = found.some(active), objective.some(active)
        undamped = here.step(np.zeros(len(active)))
        # after a small step, the linearised model gives residuals and objective
        change = np.einsum("smp,sp->sm", here.sensitivity, undamped)
        gain, residual = here.gain(undamped), np.where(problem.missing, 0.0, here.residual - change)
        last = replace(here, x=here.x + undamped, value=here.value - gain, residual=residual)
        is_last = is_small(undamped, problem, last) | (gain <= small_gain * here.value)
        found.put(active[is_last], last.some(is_last))
        converged[active] = is_last
        active = active[~converged[active] & (damping[active] < last_damping)]
        if not active.size or not remaining:
            break
        here = found.some(active)
        step = here.step(damping[active])
        there = objective.some(active).at(here.x + step)
        solves[active] += 1
        better = there.value < here.value
        found.put(active[better], there.some(better))
        with np.errstate(invalid="ignore"):  # a row that cannot step is damped more
            success = (here.value - there.value) / here.gain(step)
        harder, easier = np.maximum(first_damping, 4 * damping[active]), damping[active] / 10
        easier[easier < first_damping] = 0.0
        damping[active] = np.where(success > 0.75, easier, np.where(success > 0.25, damping[active], harder))
    stalled = ~converged & ((damping > first_damping) | ~np.isfinite(found.value))
    return Refined(found, converged, stalled, solves, np.zeros_like(solves))


def is_small(
    step: Array, objective: Objective, after: Local, *, share: float = 0.001, least: float = 1e-6
) -> NDArray[np.bool_]:
    """Whether steps, after which rows are as given, are so small beside the noise that no further one is needed.

    A step is small if it is less than a share of the posterior standard deviations, and if the curvature of ln f along
    it changes no frequency by more than that share of the noise. The noise is what is stated or, where the residuals of
    a row show more, what they show. A change of ln theta by ``least`` counts as none.
    """
    shown = np.maximum(1.0, objective.misfit(after))[:, np.newaxis]
    by_noise = share * shown * deviations(after.hessian)
    by_curvature = np.sqrt(share * shown * objective.noise.min(axis=1, keepdims=True))
    return (np.abs(step) <= np.maximum(least, np.minimum(by_noise, by_curvature))).all(axis=1)


def across(objective: Objective, found: Local, lower: int) -> Array:
    """One Gauss-Newton step that aims at the measured modes ``lower`` and ``lower + 1`` in exchanged order."""
    frequencies = objective.without_shapes()
    n_modes = objective.log_measured.shape[1]
    order = np.arange(n_modes)
    order[[lower, lower + 1]] = order[[lower + 1, lower]]
    fitted = np.exp(objective.log_measured - found.residual[:, :n_modes]), found.sensitivity[:, :n_modes]
    parts = frequencies.log_measured[:, order], frequencies.noise[:, order], frequencies.precision
    missing = frequencies.missing[:, order]
    here = Objective(lambda _: fitted, *parts, frequencies.units, missing).at(found.x)
    return here.x + here.step(np.zeros(len(here.x)))


def exchanged(before: Local, after: Local, lower: int) -> NDArray[np.bool_]:
    """Whether the modes ``lower`` and ``lower + 1`` have each other's derivatives afterwards, as beyond a crossing."""
    pair = slice(lower, lower + 2)
    mine, now = before.sensitivity[:, pair], after.sensitivity[:, pair]
    return ((now - mine[:, ::-1]) ** 2).sum(axis=(1, 2)) < ((now - mine) ** 2).sum(axis=(1, 2))
