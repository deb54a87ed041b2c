"""Measured modes, the model's modes paired with them, the residuals between them and the search for their minimum."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import OptimizeResult, least_squares, linear_sum_assignment, minimize

from skthermo._core.arrays import (
    Array,
    as_floats,
    by_name,
    central_differences,
    check_dofs,
    means_of_usual,
    real_array,
    shape_array,
)
from skthermo._core.parallel import single_blas_thread
from skthermo.exceptions import RecordsWarning, SkthermoWarning
from skthermo.fem import FEModel

TOL = 1e-9  # relative change of the loss and of theta at which a search ends


@dataclass
class Measured:
    """Modes that were measured, each with a frequency, a shape or both."""

    names: list[str]
    columns: NDArray[np.intp]  # of these modes in F
    frequencies: Array  # means over records in Hz; NaN where only the shape was measured
    deviations: Array  # standard deviations in Hz by which residuals are divided
    shapes: Array  # (n_dofs, n_measured), of unit length; NaN where only the frequency was measured
    dofs: NDArray[np.intp]  # empty where no shapes were measured
    shape_weights: Array  # 0 where no shape was measured
    findings: list[SkthermoWarning] = field(default_factory=list)

    @property
    def has_frequency(self) -> NDArray[np.bool_]:
        return np.isfinite(self.frequencies)

    @property
    def has_shape(self) -> NDArray[np.bool_]:
        return np.asarray(np.isfinite(self.shapes).any(axis=0))

    @property
    def n_residuals(self) -> int:
        """Number of independent residuals: a shape has one less than degrees of freedom, since its scale is free."""
        weighted = self.has_shape & (self.shape_weights > 0)
        return int(self.has_frequency.sum() + weighted.sum() * max(len(self.dofs) - 1, 0))


def read_measured(
    model: Any, F: Array, names: list[str], shapes: Any, dofs: Any, frequency_std: Any, shape_weight: ArrayLike
) -> Measured:
    """Means over records, with shapes and weights, of the modes that were measured."""
    means, findings = means_of_usual(F, names)
    places, unit, of_shapes = _read_shapes(model, shapes, dofs, names)
    weights = _per_mode(shape_weight, names, "shape_weight")
    if (weights < 0).any() or not np.isfinite(weights).all():
        raise ValueError(f"shape_weight is {shape_weight!r}; expected finite numbers, none negative")
    if not places.size and weights.any():
        raise ValueError(
            f"shape_weight is {shape_weight!r} but no shapes were given; expected shapes, or a weight of 0"
        )
    with_shape = np.isfinite(unit).any(axis=0)
    columns = np.flatnonzero(~np.isnan(means) | with_shape)
    if not columns.size:
        raise ValueError(f"F is NaN, or not above 0, in all {len(F)} records; expected a measured frequency in Hz")
    return Measured(
        names=[names[i] for i in columns],
        columns=columns,
        frequencies=means[columns],
        deviations=_read_deviations(frequency_std, means, names)[columns],
        shapes=unit[:, columns],
        dofs=places,
        shape_weights=np.where(with_shape, weights, 0.0)[columns],
        findings=findings + of_shapes,
    )


def _real_shapes(shapes: NDArray) -> tuple[Array, list[SkthermoWarning]]:
    """Real parts of complex shapes, each rotated by the phase that makes its real part largest, and the finding of what
    is lost."""
    squares = np.nansum(shapes**2, axis=0)
    turned = shapes * np.exp(-0.5j * np.angle(squares))
    lengths = np.sqrt(np.nansum(np.abs(shapes) ** 2, axis=0))
    lost = np.sqrt(np.nansum(turned.imag**2, axis=0)) / np.where(lengths > 0, lengths, 1)
    text = (
        f"shapes are complex: each is rotated to its largest real part, and the rest, up to {lost.max():.1%} of a "
        "shape's length, is dropped. If that is more than a few percent, check how the shape was identified"
    )
    return np.where(np.isnan(shapes), np.nan, turned.real), [RecordsWarning(text, "doubtful-shapes")]


def _read_shapes(
    model: Any, shapes: Any, dofs: Any, names: list[str]
) -> tuple[NDArray[np.intp], Array, list[SkthermoWarning]]:
    if (shapes is None) != (dofs is None):
        given, missing = ("shapes", "dofs") if dofs is None else ("dofs", "shapes")
        raise ValueError(f"{given} were given without {missing}; expected both, or neither")
    if shapes is None:
        return np.empty(0, dtype=np.intp), np.empty((0, len(names))), []
    places = check_dofs(dofs, model.n_dof, getattr(model, "dofs", ()))
    array = shape_array(shapes, "shapes")
    if array.shape != (len(places), len(names)):
        raise ValueError(
            f"shapes have shape {array.shape}; expected ({len(places)}, {len(names)}): a row for each of dofs and a "
            "column for each mode of F"
        )
    array, findings = _real_shapes(array) if np.iscomplexobj(array) else (array, [])
    for name, column in zip(names, array.T, strict=True):
        if np.isnan(column).any() and not np.isnan(column).all():
            row = np.flatnonzero(np.isnan(column))[0]
            raise ValueError(f"the shape of {name!r} is NaN in row {row} but not in all; expected all rows or none")
        if np.isinf(column).any() or not column.any():
            raise ValueError(f"the shape of {name!r} is zero throughout or infinite; expected a mode shape")
    return places, array / np.linalg.norm(array, axis=0), findings


def _read_deviations(frequency_std: ArrayLike | None, means: Array, names: list[str]) -> Array:
    """Standard deviations in Hz; without any, the frequencies themselves, for a weight of 1."""
    if frequency_std is None:
        return means
    deviations = _per_mode(frequency_std, names, "frequency_std")
    wrong = np.flatnonzero(np.isfinite(means) & ~((deviations > 0) & np.isfinite(deviations)))
    if wrong.size:
        raise ValueError(
            f"frequency_std of {names[wrong[0]]!r} is {deviations[wrong[0]]}; expected a positive number in Hz"
        )
    return deviations


def _per_mode(values: ArrayLike, names: list[str], what: str) -> Array:
    array, n_modes = real_array(by_name(values, names, what, "modes"), what), len(names)
    if array.shape not in ((), (n_modes,)):
        raise ValueError(f"{what} has shape {array.shape}; expected a number, or one for each of the {n_modes} modes")
    return np.broadcast_to(array, n_modes)


@dataclass
class PairedModes:
    """The model's modes at one theta, one for each measured mode and in their order."""

    frequencies: Array
    shapes: Array  # (n_dofs, n_measured) at the measured degrees of freedom
    ranks: NDArray[np.intp] | None  # among the model's modes; None where modes are paired column by column
    derivatives: Callable[[], tuple[Array, Array]]  # of frequencies and of shapes, by the parameters


def paired_modes(model: FEModel, measured: Measured, theta: Array) -> PairedModes:
    """Pair modes by their shapes where shapes were measured, else column by column."""
    if measured.dofs.size and hasattr(model, "local_modes"):
        return _by_shape(model, measured, theta)
    return _by_column(model, measured, theta[np.newaxis])


def macs(shapes: Array, measured: Array) -> Array:
    """MAC of each shape with the measured unit shape in the same column, (n_measured,)."""
    return np.diagonal(mac_table(shapes, measured))


def mac_table(shapes: Array, measured: Array) -> Array:
    """MAC of measured unit shapes and all shapes, (n_measured, n_shapes); 0 for a shape that is zero at all sensors."""
    squares = (shapes**2).sum(axis=0)
    return (measured.T @ shapes) ** 2 / np.where(squares > 0, squares, np.inf)


def tangents(shapes: Array, measured: Array) -> Array:
    """Differences e = phi / (u' phi) - u between shapes phi and measured unit shapes u, (n_dofs, n_modes).

    Whatever the scale and sign of phi, e is orthogonal to u, and its length is the tangent of the angle between them:
    its square is 1 / MAC - 1.
    """
    return shapes / np.einsum("dm,dm->m", measured, shapes) - measured


def tangent_derivatives(shapes: Array, d_shapes: Array, measured: Array) -> Array:
    """Derivatives of `tangents`, from derivatives of the shapes (n_dofs, n_modes, n_parameters)."""
    along = np.einsum("dm,dm->m", measured, shapes)[:, np.newaxis]
    d_along = np.einsum("dm,dmp->mp", measured, d_shapes)
    return d_shapes / along - shapes[:, :, np.newaxis] * (d_along / along**2)


def _by_column(model: FEModel, measured: Measured, row: Array) -> PairedModes:
    def frequencies_at(rows: Array) -> Array:
        return as_floats(model.frequencies(rows))  # not `evaluate`, which warns of every theta without modes

    def derivatives() -> tuple[Array, Array]:
        if exact is not None:
            slopes = exact
        elif hasattr(model, "jacobian"):
            slopes = model.jacobian(row)
        else:
            slopes = central_differences(frequencies_at, row, frequencies, 1e-3)
        return slopes[0, measured.columns], np.empty((0, len(measured.columns), row.shape[1]))

    frequencies, exact = model.linearised(row) if hasattr(model, "linearised") else (frequencies_at(row), None)
    return PairedModes(frequencies[0, measured.columns], np.empty((0, len(measured.columns))), None, derivatives)


def _by_shape(model: Any, measured: Measured, theta: Array) -> PairedModes:
    modes = model.local_modes(theta)
    shapes = modes.shapes(measured.dofs)
    # The MAC with the nominal modes decides where sensors are so few that several modes look the same at them.
    mac_sums = 0.25 * modes.nominal_mac[measured.columns]
    with_shape = measured.has_shape
    mac_sums[with_shape] += mac_table(shapes, measured.shapes[:, with_shape])
    ranks = linear_sum_assignment(np.nan_to_num(mac_sums), maximize=True)[1]
    wanted_dofs = measured.dofs if measured.shape_weights.any() else measured.dofs[:0]
    return PairedModes(modes.frequencies[ranks], shapes[:, ranks], ranks, lambda: modes.derivatives(ranks, wanted_dofs))


class Residuals:
    """Residuals of frequencies, of the prior and of shapes, in one vector with one loss, which a search minimises.

    Without a prior, its standard deviations are infinite.

    A shape's residuals are its `tangents` e, of squared length E = 1 / MAC - 1. Together they have the loss
    ((1 - sqrt(MAC)) / sqrt(MAC))^2 = (sqrt(1 + E) - 1)^2, whose slope weights them in the Gauss-Newton matrix.
    (1 - sqrt(MAC)) / sqrt(MAC) itself is quadratic in e: its derivative vanishes at the optimum.

    With ``noise``, residuals are in units of their standard deviations, each less a standard normal number, and their
    loss is their square: as with another measurement and another mean of the prior, which are as likely as the given
    ones.
    """

    def __init__(self, model: FEModel, measured: Measured, prior: Array, noise: Array | None = None):
        self.model, self.measured, self.prior, self.noise = model, measured, prior, noise
        self.weighted = np.flatnonzero(measured.shape_weights > 0)  # modes whose shapes have a weight
        self.held = np.isfinite(prior)  # parameters with a prior
        self.n_plain = int(measured.has_frequency.sum() + self.held.sum())

    def at(self, theta: Array) -> "Point":
        return Point(self, theta, paired_modes(self.model, self.measured, theta))

    def randomised(self, n: int, random: np.random.RandomState) -> "list[Residuals]":
        """These with noise, drawn n times. Noise of a shape is orthogonal to the shape, whose scale is free."""
        unit = self.measured.shapes[:, self.weighted]
        noise = random.standard_normal((n, self.n_plain + unit.size))
        across = noise[:, self.n_plain :].reshape(n, *unit.T.shape)
        along = np.einsum("smd,dm,em->sme", across, unit, unit)
        noise[:, self.n_plain :] -= along.reshape(n, -1)
        return [Residuals(self.model, self.measured, self.prior, row) for row in noise]

    @property
    def precisions(self) -> Array:
        """Precision of each tangent of the weighted shapes, (n_weighted,), with the noise their weights are made for.

        A shape with the weight sqrt(2 (n - 1)) / s^2 has noise of s times its root mean square at n degrees of freedom:
        each of its tangents, and of the unit shape's components, has the variance s^2 / n.
        """
        n_dofs = len(self.measured.dofs)
        return self.measured.shape_weights[self.weighted] * n_dofs / np.sqrt(2 * max(n_dofs - 1, 1))

    def loss(self, squares: Array) -> Array:
        """Loss of squared residuals, its slope and its curvature, as `scipy.optimize.least_squares` asks."""
        rho = np.array([squares, np.ones_like(squares), np.zeros_like(squares)])
        if self.noise is not None:
            return rho
        weights = self.measured.shape_weights[self.weighted] ** 2
        per_mode = len(self.measured.dofs)
        E = squares[self.n_plain :].reshape(len(self.weighted), per_mode).sum(axis=1)
        secant = np.sqrt(1 + E)
        values = weights * (E / (1 + secant)) ** 2
        slopes = weights * E / (secant * (1 + secant))
        rho[0, self.n_plain :] = np.repeat(values, per_mode) / max(per_mode, 1)
        rho[1, self.n_plain :] = np.repeat(slopes, per_mode)
        return rho


class Point:
    """Residuals at one theta, and their derivatives on demand."""

    def __init__(self, residuals: Residuals, theta: Array, modes: PairedModes):
        self._residuals, self._theta, self._modes = residuals, theta, modes
        measured, prior, weighted = residuals.measured, residuals.prior, residuals.weighted
        misses = (modes.frequencies - measured.frequencies) / measured.deviations
        parts = [misses[measured.has_frequency], ((theta - 1) / prior)[residuals.held]]
        if len(weighted):
            parts.append(tangents(modes.shapes[:, weighted], measured.shapes[:, weighted]).T.ravel())
        self.values, self._scales = np.concatenate(parts), np.ones(1)
        if residuals.noise is not None:
            of_shapes = np.sqrt(np.repeat(residuals.precisions, len(measured.dofs)))
            self._scales = np.append(np.ones(residuals.n_plain), of_shapes)
            self.values = self._scales * self.values - residuals.noise

    @property
    def objective(self) -> float:
        """Sum of the squared and weighted residuals; infinite where the model has no modes."""
        total = self._residuals.loss(self.values**2)[0].sum()
        return float(total) if np.isfinite(total) else np.inf

    def jacobian(self) -> Array:
        """Derivatives of ``values``, (n_values, n_parameters)."""
        plain, slopes = self.blocks()
        rows = np.vstack([plain, slopes.swapaxes(0, 1).reshape(-1, len(self._theta))])
        return self._scales[:, np.newaxis] * rows

    def gradient(self) -> Array:
        """Derivative of ``objective``, (n_parameters,)."""
        slopes = self._residuals.loss(self.values**2)[1]
        return 2 * (slopes * self.values) @ self.jacobian()

    def information(self) -> Array:
        """Fisher information of the prior, and of measurements whose noise is that for which the weights are made."""
        plain, slopes = self.blocks()
        return plain.T @ plain + np.einsum("djp,j,djq->pq", slopes, self._residuals.precisions, slopes)

    def blocks(self) -> tuple[Array, Array]:
        """Derivatives of the residuals of frequencies and prior, and of tangents (n_dofs, n_shapes, n_parameters)."""
        measured, prior, weighted = self._residuals.measured, self._residuals.prior, self._residuals.weighted
        d_frequencies, d_shapes = self._modes.derivatives()
        misses = d_frequencies / measured.deviations[:, np.newaxis]
        plain = np.vstack([misses[measured.has_frequency], np.diag(1 / prior)[self._residuals.held]])
        if not len(weighted):
            return plain, np.empty((0, 0, len(self._theta)))
        shapes = self._modes.shapes[:, weighted]
        return plain, tangent_derivatives(shapes, d_shapes[:, weighted], measured.shapes[:, weighted])


class Outcome(NamedTuple):
    """The result of one start; ``n_failed`` of its evaluations met theta without modes."""

    start: Array
    objective: float
    success: bool
    n_evaluations: int
    n_failed: int
    theta: Array


class SearchHistory:
    """Record of one optimisation: its last and its best point, and how many theta had no modes."""

    def __init__(self, residuals: Residuals, start: Array):
        self.residuals = residuals
        self._theta = self.theta = start
        self._point = self.best = residuals.at(start)
        self.first = self.best.objective
        self.n_evaluations = 1
        self.n_failed = 0 if np.isfinite(self.best.objective) else 1

    def at(self, theta: Array) -> Point:
        """Residuals at theta. Those at the last and at the best theta are remembered."""
        if np.array_equal(theta, self.theta):
            return self.best
        if not np.array_equal(theta, self._theta):
            self.n_evaluations += 1
            self._theta = theta.copy()
            self._point = self.residuals.at(self._theta)
            if not np.isfinite(self._point.objective):
                self.n_failed += 1
            elif self._point.objective < self.best.objective:
                self.theta, self.best = self._theta, self._point
        return self._point


class NoDerivatives(Exception):
    """The model has no finite derivatives at some theta."""


def optimise(residuals: Residuals, bounds: Array, start: Array, method: str, max_iter: int) -> Outcome:
    """Minimise the residuals' loss within bounds, until a relative change of it and of theta is below 1e-9.

    Where the model has no modes, steps are cut short, which looks like convergence. A search that met such theta is
    therefore started again from its best point, and has converged when it meets none.
    """
    search = {"lbfgs": _lbfgs, "least_squares": _least_squares}[method]
    success = False
    with single_blas_thread():
        history = SearchHistory(residuals, start)
        before = np.inf
        while max_iter > 0 and history.best.objective < (1 - TOL) * before:
            before, n_failed = history.best.objective, history.n_failed
            try:
                result = search(history, bounds, max_iter)
            except NoDerivatives:
                break
            max_iter -= result.get("nit", result.nfev)
            success = bool(result.success) and history.n_failed == n_failed
            if history.n_failed == n_failed:
                break
    return Outcome(start, history.best.objective, success, history.n_evaluations, history.n_failed, history.theta)


def _least_squares(history: SearchHistory, bounds: Array, max_iter: int) -> OptimizeResult:
    options = {"max_nfev": max_iter, "ftol": TOL, "xtol": TOL, "gtol": np.finfo(float).eps}
    return least_squares(
        lambda theta: history.at(theta).values.copy(),  # SciPy scales it in place
        history.theta,
        lambda theta: _finite(history.at(theta).jacobian()),
        bounds=bounds.T,
        loss=history.residuals.loss,
        **options,
    )


def _lbfgs(history: SearchHistory, bounds: Array, max_iter: int) -> OptimizeResult:
    """L-BFGS-B on the objective as a share of the first one, since its tolerances are absolute below 1.

    Where the model has no modes, it is given a parabola that rises from the best point, so that it turns back.
    """

    def share(theta: Array) -> tuple[float, Array]:
        point = history.at(theta)
        if np.isfinite(point.objective):
            gradient = _finite(point.gradient()) / scale
            if point is history.best:
                uphill[:] = gradient
            return point.objective / scale, gradient
        step = theta - history.theta
        slope = abs(uphill @ step)
        return history.best.objective / scale + slope / 2, 2 * slope * step / (step @ step)

    scale = history.first or 1.0
    uphill = np.empty_like(history.theta)
    options = {"maxiter": max_iter, "maxfun": 10 * max_iter, "ftol": TOL, "gtol": TOL, "maxcor": 20}
    return minimize(share, history.theta, jac=True, method="L-BFGS-B", bounds=bounds, options=options)


def _finite(derivatives: Array) -> Array:
    if not np.isfinite(derivatives).all():
        raise NoDerivatives
    return derivatives
