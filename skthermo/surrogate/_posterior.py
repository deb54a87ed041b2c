"""The posterior mode of parameters given frequencies and mode shapes, by steps on the FE model; records teach prior and
noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from numbers import Integral, Real
from typing import Any, Literal, overload

import numpy as np
import pandas as pd
from joblib import Memory
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from sklearn.utils import Bunch

from skthermo._core.arrays import (
    Array,
    Reduce,
    as_floats,
    check_dofs,
    check_flag,
    check_model,
    check_noise,
    check_prior,
    median,
    robust_deviation,
    spread_evenly,
    tolerance,
)
from skthermo._core.estimators import (
    Estimator,
    HasMethods,
    Interval,
    StrOptions,
    _fit_context,
    check_is_fitted,
)
from skthermo._core.frames import Table, column_names, frame_like, row_times
from skthermo._core.memory import remembered
from skthermo._core.text import listed, percent
from skthermo._core.warnings import collected, warn_each
from skthermo.exceptions import FewRecordsWarning, ModelWarning, RecordsWarning, SkthermoWarning
from skthermo.fem import FEModel, evaluate, evaluate_modes, shape_components
from skthermo.fem.affine import ResponseSurface, n_terms
from skthermo.surrogate._regression import FrequencyInverse
from skthermo.surrogate._simulator import Simulator

Linearise = Callable[[Array], tuple[Array, ...]]
"""Frequencies, (n_rows, n_modes), and d ln f / d ln theta, (n_rows, n_modes, n_parameters), at rows of theta; with
sensors also shapes, (n_rows, n_sensors, n_modes), and d phi / d ln theta."""


@dataclass(frozen=True)
class ThermalPrior:
    """Gaussian prior of ln theta about the nominal state, N(0, common^2 11' + diag(own^2)).

    ``common`` is the standard deviation of a factor of all parameters, ``own`` holds one of each parameter by itself.
    """

    names: tuple[str, ...]
    common: float
    own: Array

    @property
    def covariance(self) -> Array:
        """Of ln theta, (n_parameters, n_parameters)."""
        return self.common**2 + np.diag(self.own**2)

    @property
    def precision(self) -> Array:
        """The inverse of the covariance."""
        return np.linalg.inv(self.covariance)

    @property
    def deviations(self) -> Array:
        """Standard deviations of ln theta, (n_parameters,)."""
        return np.sqrt(np.diag(self.covariance))

    def __str__(self) -> str:
        own = listed(
            [f"{name!r} by itself by {percent(size, '.2g')}" for name, size in zip(self.names, self.own, strict=True)]
        )
        together = f"all stiffness together by {percent(self.common, '.2g')}, " if self.common else ""
        return f"temperature moves {together}{own} (standard deviations)".replace("\N{NO-BREAK SPACE}", " ")


@dataclass(frozen=True)
class LinearRecords:
    """Records by a model that was linearised near their ln theta: observation = J ln theta + noise, NaN where missing.

    ``values`` are (n_records, n_observations), ``slopes`` J (n_records, n_observations, n_parameters).
    """

    values: Array
    slopes: Array

    @classmethod
    def around(cls, x: Array, residual: Array, slopes: Array, missing: NDArray[np.bool_]) -> LinearRecords:
        """Records by the model linearised at ln theta = x, which leaves residuals of the observations there."""
        usable = ~missing & np.isfinite(residual) & np.isfinite(slopes).all(axis=2)
        values = residual + np.einsum("smp,sp->sm", slopes, x)
        return cls(np.where(usable, values, np.nan), np.where(usable[:, :, np.newaxis], slopes, 0.0))

    def near(self, prior: ThermalPrior, noise: Array) -> LinearRecords:
        """Records without observations that are five standard deviations from what prior and noise expect."""
        variances = np.einsum("smp,pq,smq->sm", self.slopes, prior.covariance, self.slopes) + noise**2
        with np.errstate(invalid="ignore"):
            return LinearRecords(np.where(self.values**2 <= 5.0**2 * variances, self.values, np.nan), self.slopes)

    def taught(
        self, prior: ThermalPrior, noise: Array, least: Array, learns_prior: bool, learns_noise: NDArray[np.bool_]
    ) -> tuple[ThermalPrior, Array, Array]:
        """The most likely prior and noise, by steps from given ones, and the means of ln theta given each record.

        ln theta of a record is the sum of a common factor and of one of each parameter, which are independent. Noise is
        relative, (n_observations,), and no smaller than the least; what the model cannot follow counts as noise.
        """
        known, deviations = ~np.isnan(self.values), np.append(prior.common, prior.own)
        values, has_size = np.where(known, self.values, 0.0), deviations > 0
        parts = np.column_stack([np.ones(len(prior.own)), np.eye(len(prior.own))])[:, has_size]
        effects, n_parts = self.slopes @ parts, parts.shape[1]

        def loss(logs: Array) -> tuple[float, Array, Array]:
            """Minus the logarithm of the likelihood, its derivatives, those expected given each record (Fisher's
            identity), and the means of the factors."""
            sizes, scatter = np.exp(logs[:n_parts]), np.exp(logs[n_parts:])
            weights = known / scatter**2
            covariances = np.linalg.inv(information(effects, weights, np.diag(sizes**-2.0)))
            pulls = np.einsum("smq,sm->sq", effects, weights * values)
            factors = np.einsum("spq,sq->sp", covariances, pulls)
            left = values - np.einsum("smp,sp->sm", effects, factors)
            moments = factors**2 + np.einsum("spp->sp", covariances)
            squares = known * (left**2 + ((effects @ covariances) * effects).sum(axis=2))
            volumes = np.log(sizes).sum() * len(values) - 0.5 * np.linalg.slogdet(covariances)[1].sum()
            misfits = 0.5 * ((weights * left**2).sum() + ((factors / sizes) ** 2).sum())
            of_sizes, of_scatter = (1 - moments / sizes**2).sum(axis=0), (known - squares / scatter**2).sum(axis=0)
            total = misfits + volumes + (known @ np.log(scatter)).sum()
            return float(total), np.append(of_sizes, of_scatter), factors

        start = np.log(np.append(deviations[has_size], noise))
        learns = np.append(np.full(n_parts, learns_prior), learns_noise & known.any(axis=0))
        lowest, highest = np.append(np.full(n_parts, 1e-3), least), np.repeat([3.0, 0.3], [n_parts, len(noise)])
        bounds = np.where(learns, np.log([lowest, highest]), start).T
        best = minimize(lambda logs: loss(logs)[:2], start, jac=True, method="L-BFGS-B", bounds=bounds).x
        found = np.exp(best)
        if learns_prior:
            prior = ThermalPrior(prior.names, float(found[0]), found[1:n_parts])
        return prior, np.where(learns[n_parts:], found[n_parts:], noise), loss(best)[2] @ parts.T


def least_noise(log_frequencies: Array) -> Array:
    """A lower limit of the noise of each mode, from records in their order, (n_modes,).

    It is a tenth of the scatter that the differences of successive records show. Without it, a mode that one parameter
    alone can follow would count as exact.
    """
    steps = robust_deviation(np.diff(log_frequencies, axis=0)) if len(log_frequencies) > 1 else np.zeros(1)
    share = 0.1 / np.sqrt(2) * np.nan_to_num(steps)
    return np.clip(np.broadcast_to(share, log_frequencies.shape[1:]), 1e-5, 0.15)


@dataclass(frozen=True)
class ThermalPosterior:
    """Prior, noise and model, by which records have posterior modes of ln theta.

    ``noise`` holds standard deviations of all observations, frequencies and components of shapes, (n_observations,).
    Steps start on the response ``surface``, which takes the place of a model without derivatives, a program: it was run
    ``n_runs`` times.
    """

    simulator: Simulator
    prior: ThermalPrior
    noise: Array
    shapes: ShapeInputs | None
    surface: ResponseSurface | None
    is_program: bool
    n_runs: int = 0

    def observed(self, inputs: Array) -> tuple[Array, Array]:
        """Observations of rows of inputs, ln f and components of shapes of unit length, (n_rows, n_observations), and
        their weights, 1 / noise^2, 0 where one is missing.

        Frequencies count as exact to 1e-6 at most. Where modes are missing, many parameters fit the others, and a noise
        of 1e-3 lets steps move along the curve of these parameters.
        """
        n_modes = self.simulator.model.n_modes
        values = inputs if self.shapes is None else inputs / np.sqrt(self.shapes.n_sensors)
        values = np.hstack([np.log(inputs[:, :n_modes]), values[:, n_modes:]])
        noise = np.tile(self.noise, (len(inputs), 1))
        has_gaps = np.isnan(values[:, :n_modes]).any(axis=1, keepdims=True)
        noise[:, :n_modes] = np.maximum(noise[:, :n_modes], np.where(has_gaps, 1e-3, 1e-6))
        return values, np.where(np.isnan(values), 0.0, noise**-2.0)

    def linearised(self, theta: Array, n_jobs: int | None) -> tuple[Array, ...]:
        """The model at rows of theta, relative derivatives included."""
        return self.simulator.linearise(theta, n_jobs, None if self.shapes is None else self.shapes.dofs)


def beside(
    values: Array, frequencies: Array, slopes: Array, shapes: Array | None = None, of_shapes: Array | None = None
) -> tuple[Array, Array]:
    """Residuals of observations beside a solved model, 0 where one is missing, and derivatives of the model's by ln
    theta.

    A model that gives no shapes, such as a surface, is compared with the frequencies alone.
    """
    n_rows, n_modes = frequencies.shape
    residual = values[:, :n_modes] - np.log(frequencies)
    if shapes is not None:
        misfit, change = shape_misfit(values[:, n_modes:].reshape(n_rows, n_modes, -1), shapes, of_shapes)
        residual, slopes = np.hstack([residual, misfit]), np.hstack([slopes, change])
    return np.where(np.isnan(values[:, : residual.shape[1]]), 0.0, residual), slopes


def posterior_modes(linearise: Linearise, values: Array, weights: Array, precision: Array, start: Array) -> Bunch:
    """Posterior modes of ln theta by Gauss-Newton steps, each damped more where one would raise the objective.

    The objective is the sum of the weighted squares of the residuals and of ln theta in its prior. A step is a row's
    last one if it is less than a hundredth of the posterior standard deviations and curvature along it is less than a
    thousandth of the noise, or if it is less than 1e-6, or would gain less than rounding hides. At a damping of 1e8, a
    share of the diagonal of the Hessian, a row stalls.
    """
    x = start.copy()
    residual, slopes = beside(values, *linearise(np.exp(x)))
    weights = weights[:, : residual.shape[1]]

    def objective(x: Array, residual: Array, weights: Array) -> Array:
        value = (weights * residual**2).sum(axis=1) + ((x @ precision) * x).sum(axis=1)
        return np.where(np.isfinite(value), value, np.inf)

    value, damping = objective(x, residual, weights), np.zeros(len(x))
    curvature = np.sqrt(1e-3 / np.sqrt(np.maximum(weights.max(axis=1, keepdims=True), np.finfo(float).tiny)))
    converged, active = np.zeros(len(x), dtype=bool), np.flatnonzero(np.isfinite(value))
    for _ in range(100):
        hessian = information(slopes[active], weights[active], precision)
        pull = np.einsum("smp,sm->sp", slopes[active], weights[active] * residual[active]) - x[active] @ precision
        step = gauss_newton(hessian, pull, np.zeros(len(active)))
        gain = (pull * step).sum(axis=1)
        smallest = np.maximum(1e-6, np.minimum(0.01 * deviations(hessian), curvature[active]))
        is_last = (np.abs(step) <= smallest).all(axis=1) | (gain <= 1e-10 * value[active])
        ended = active[is_last]
        x[ended] += step[is_last]
        residual[ended] -= np.einsum("smp,sp->sm", slopes[ended], step[is_last]) * (weights[ended] > 0)
        converged[ended] = True
        goes_on = ~is_last & (damping[active] < 1e8)
        active = active[goes_on]
        if not len(active):
            break
        tried = x[active] + gauss_newton(hessian[goes_on], pull[goes_on], damping[active])
        there, slopes_there = beside(values[active], *linearise(np.exp(tried)))
        value_there = objective(tried, there, weights[active])
        is_lower = value_there < value[active]
        damping[active] = np.where(is_lower, damping[active] / 30, np.maximum(1e-3, 5 * damping[active]))
        damping[damping < 1e-4] = 0.0
        rows = active[is_lower]
        x[rows], residual[rows], slopes[rows] = tried[is_lower], there[is_lower], slopes_there[is_lower]
        value[rows] = value_there[is_lower]
    stalled = ~converged & ((damping > 0) | np.isinf(value))
    return Bunch(x=x, residual=residual, slopes=slopes, converged=converged, stalled=stalled)


def information(slopes: Array, weights: Array, precision: Array) -> Array:
    """Precision of ln theta given derivatives of observations and their weights."""
    return slopes.swapaxes(1, 2) @ (slopes * weights[:, :, np.newaxis]) + precision


def gauss_newton(hessian: Array, pull: Array, damping: Array) -> Array:
    """Steps of rows, damped by a share of the diagonal, that change no ln theta by more than a half."""
    diagonal = np.einsum("spp->sp", hessian) * np.maximum(damping, 1e-14)[:, np.newaxis]  # against rounding
    step = np.linalg.solve(hessian + np.eye(pull.shape[1]) * diagonal[:, np.newaxis], pull[:, :, np.newaxis])[:, :, 0]
    return step * np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=1, keepdims=True), 0.5))


def deviations(hessian: Array) -> Array:
    """Standard deviations, (n_rows, n_parameters), of Gaussians with these precision matrices."""
    diagonal = np.einsum("spp->sp", hessian)
    regular = hessian + 1e-14 * np.eye(diagonal.shape[1]) * diagonal[:, np.newaxis]  # rounding could make it singular
    return np.sqrt(np.abs(np.einsum("spp->sp", np.linalg.inv(regular))))


def inverted(taught_by: Any, inputs: Array, posterior: ThermalPosterior, n_jobs: int | None) -> Bunch:
    """What `PosteriorInverse.invert` gives, for rows of inputs; a memory knows a posterior by what has taught it."""
    simulator, (values, weights), prior = posterior.simulator, posterior.observed(inputs), posterior.prior
    precision, found = prior.precision, Bunch(x=np.zeros((len(inputs), len(prior.own))))
    ways: list[Linearise] = [] if posterior.surface is None else [posterior.surface.linearise]
    if not (ways and posterior.is_program):
        ways.append(partial(posterior.linearised, n_jobs=n_jobs))
    for linearise in ways:
        found = posterior_modes(linearise, values, weights, precision, found.x)
    slopes = np.nan_to_num(found.slopes)
    weights, stated = weights[:, : slopes.shape[1]], posterior.noise[: slopes.shape[1]] ** -2.0
    std = deviations(information(slopes, weights, precision))
    at_best = deviations(information(slopes, np.where(weights > 0, weights, stated), precision))
    # by which each parameter may move by itself as far as all together: parameters that all follow one temperature,
    # each at its own rate, show nearly no movement of their own
    cautious = replace(prior, own=np.maximum(prior.own, prior.common))
    is_empty = np.isnan(inputs).all(axis=1)
    unknown = (is_empty | found.stalled)[:, np.newaxis]
    theta = np.where(unknown, np.nan, np.exp(found.x))
    return Bunch(
        theta=theta,
        std=deviations(information(slopes, weights, cautious.precision)) * theta,
        residuals=np.where(unknown | (weights == 0), np.nan, found.residual)[:, : simulator.model.n_modes],
        weight=np.where(is_empty, 0.0, ((at_best / std) ** 2).mean(axis=1)),
        converged=found.converged & ~is_empty,
        by_full_model=simulator.outside(np.exp(found.x)) & (simulator.reduced is not None),
    )


def taught(
    first: ThermalPosterior,
    inputs: Array,
    reduce: Reduce,
    learns_prior: bool,
    learns_noise: NDArray[np.bool_],
    n_jobs: int | None,
) -> ThermalPosterior:
    """A posterior with prior and noise as records teach them, and a model or surface that suits these records.

    At most 300 records, spread evenly, teach. The model is linearised at its nominal state first, and then
    in each pass at what is known of each record, whose ln theta moves by at most 1 from one pass to the next.
    """
    rows = spread_evenly(np.flatnonzero(~np.isnan(inputs).all(axis=1)), 300)
    if not len(rows):
        return first
    now, x, n_modes = first, np.zeros((len(rows), len(first.prior.own))), first.simulator.model.n_modes
    values = first.observed(inputs[rows])[0]
    solved = tuple(np.repeat(part, len(rows), axis=0) for part in first.linearised(np.exp(x[:1]), n_jobs))
    least = first.noise.copy()
    least[:n_modes] = least_noise(np.log(inputs[:, :n_modes]))
    runs: list[tuple[Array, Array]] = []
    for number in range(3):
        records = LinearRecords.around(x, *beside(values, *solved), np.isnan(values))
        records = records.near(now.prior, now.noise) if number else records
        prior, noise, means = records.taught(now.prior, now.noise, least, learns_prior, learns_noise)
        x = x + np.clip(means - x, -1.0, 1.0)
        now = replace(now, prior=prior, noise=noise)
        if now.is_program:
            now = with_runs(now, x, runs, n_jobs) if number < 2 else now
            solved = now.surface.linearise(np.exp(x))
        else:
            around = Simulator.around(now.simulator.model, np.exp(x), reduce, now.simulator, n_rows=len(inputs))
            now = replace(now, simulator=around)
            solved = now.linearised(np.exp(x), n_jobs)
    return now if now.is_program else replace(now, surface=ResponseSurface.fitted(x, *solved[:2]))


def with_runs(
    posterior: ThermalPosterior, x: Array, runs: list[tuple[Array, Array]], n_jobs: int | None
) -> ThermalPosterior:
    """A posterior with a surface through further runs of a program near some ln theta, three for a cubic one's term."""
    random, n_parameters = np.random.RandomState(len(runs)), x.shape[1]
    number = int(np.clip(3 * n_terms(n_parameters, 3), 200, 600))
    points = x[random.randint(len(x), size=number)]
    points = points + posterior.prior.deviations * random.standard_normal(points.shape)
    runs.append((points, evaluate(posterior.simulator.model, np.exp(points), n_jobs=n_jobs)))
    surface = ResponseSurface.fitted(*(np.concatenate(part) for part in zip(*runs, strict=True)))
    at_nominal = (2 * n_parameters + 1) * (len(runs) == 1)
    return replace(posterior, surface=surface, n_runs=posterior.n_runs + number + at_nominal)


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
        deviations = check_noise(noise, model.n_modes, what="shape_noise", most=1.0)
        if not deviations.all():
            raise ValueError(f"shape_noise is {deviations}; expected standard deviations between 0 and 1")
        return cls(places, shapes[places], deviations)

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

    def joined(self, F: Table, shapes: ArrayLike | None) -> Table:
        """Frequencies beside the components of measured shapes, NaN there without shapes."""
        components = np.full((len(F), self.n_columns - self.n_modes), np.nan)
        if shapes is not None:
            components = shape_components(shapes, self.reference)
            if len(components) != len(F):
                raise ValueError(
                    f"shapes have {len(components)} rows and frequencies {len(F)}; expected the same number"
                )
        modes = [str(name) for name in column_names(F, "f")]
        names = [*modes, *(f"{mode}_dof{dof}" for mode in modes for dof in self.dofs)]
        return frame_like(F, np.hstack([as_floats(F), components]), names)

    def doubts(self, model: FEModel, inputs: Table, theta: Array) -> list[SkthermoWarning]:
        """Findings that most measured shapes lack a sensor, or that a median component is five standard deviations of
        the noise from all shapes of the model at the parameters of 100 records."""
        values, shape, findings = as_floats(inputs), (-1, self.n_modes, self.n_sensors), []
        found = ~np.isnan(values[:, : self.n_modes])
        n_shapes = (found & ~np.isnan(values[:, self.n_modes :].reshape(shape)).any(axis=2)).sum()
        if n_shapes < 0.5 * found.sum():
            findings.append(
                RecordsWarning(
                    "most measured modes lack a component of their shape at some sensor. Their shapes are not used. "
                    "Leave sensors that failed out of dofs",
                    "doubtful-shapes",
                )
            )
        rows = spread_evenly(np.flatnonzero(~np.isnan(theta).any(axis=1)), 100)
        if not n_shapes or not len(rows):
            return findings
        simulated = self.simulated(model, theta[rows])[:, self.n_modes :].reshape(shape)
        middle = median(values[:, self.n_modes :]).reshape(shape[1:])
        beyond = np.maximum(simulated.min(axis=0) - middle, middle - simulated.max(axis=0))
        excess = np.nan_to_num(beyond / self.noise[:, np.newaxis])
        mode, sensor = np.unravel_index(excess.argmax(), excess.shape)
        if excess[mode, sensor] > 5:
            findings.append(
                RecordsWarning(
                    f"measured shapes of {column_names(inputs, 'f')[mode]!r} are unlike those of the model at the "
                    f"parameters of the records, the most at sensor {sensor}. They distort the parameters. Check the "
                    "modes, and order, signs and gains of the sensors (dofs), or raise shape_noise",
                    "doubtful-shapes",
                )
            )
        return findings

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


class PosteriorInverse(FrequencyInverse, Estimator):
    """Parameters of an FE model as the posterior mode given frequencies and mode shapes; equations (3)-(4) solved.

    Steps on the model, from its nominal state, minimise squared misfits in standard deviations of the noise plus those
    of ln theta by its prior. The records teach both: the prior, how much temperature moves all parameters together and
    each by itself, and the noise of each mode, in which effects count that the model cannot follow.

    Parameters
    ----------
    model : FE model, optional
        Needed, except in a chain, which gives its own. One without derivatives (``linearised``, ``jacobian``; with
        ``dofs``, ``linearised_modes``) is a program: a surface of simulated frequencies takes its place.
    prior : "learned", float, array-like of shape (n_parameters,) or mapping, default="learned"
        Standard deviations of ln theta about the nominal state, of each parameter by itself: a number for all, one for
        each, or a mapping from each parameter. "learned" takes them from the records of `fit`, with a common factor.
    noise : "auto", float or array-like of shape (n_modes,), default="auto"
        Relative standard deviation of the frequencies. "auto" takes it from the records of `fit`. With 0, frequencies
        count as exact (to 1e-6; to 0.1 % in rows where a mode is missing).
    dofs : array-like of int of shape (n_sensors,), or list of (node, direction), optional
        Degrees of freedom of the model where mode shapes are measured, by position, the first being 0, or by label, as
        in ``model.dofs``. Rows of X are then the frequencies followed by the shapes' real components at the sensors
        (`~skthermo.fem.shape_components`), mode by mode: n_modes * (1 + n_sensors) columns.
    shape_noise : float or array-like of shape (n_modes,), default=0.01
        Standard deviation of the measured components of a shape as a share of their root mean square.
    reduce : "auto", bool or float, default="auto"
        Whether steps are taken on the reduced model ``model.reduced(bounds)`` within what the records need, much faster
        for large models. "auto" reduces where ``model.reduction_pays`` and a basis is accurate. True allows a relative
        error of 1e-5 in the frequencies, as "auto" does; a number sets the error allowed. Rows that end outside its box
        are solved by the full model (:doc:`/guide/costs`).
    memory : str or joblib.Memory, optional
        Folder for what `fit` learns and for the inversion of the records, so that searches and cross-validation make
        each only once. Clear it when the program behind a model of your own changes.
    n_jobs : int, optional
        Number of parallel jobs when the model is solved for many rows.

    Attributes
    ----------
    prior_ : ThermalPrior
        ``common`` and ``own`` standard deviations, ``covariance``; ``print(prior_)`` says them in words.
    noise_ : ndarray of shape (n_modes,)
        Relative standard deviations of the frequencies.
    posterior_ : ThermalPosterior
        Prior, noise and model by which records are inverted.
    simulator_ : Simulator
        The model and, where it is reduced, its reduced model.
    shape_inputs_ : ShapeInputs or None
        With ``dofs``: how columns of shapes are read (``reference`` holds the nominal shapes at the sensors).
    n_runs_ : int
        How often a program without derivatives was run.
    taught_by_ : tuple or None
        What it has learned from, by which a memory knows its inversions; None without a memory.
    findings_ : list of SkthermoWarning
        What is doubtful about the records of `fit`.
    n_parameters_, parameter_names_ : int, list of str
        Number of parameters and their names.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of columns of X and, where `fit` saw a frame with such, their names.

    See Also
    --------
    InverseSurrogate : A regressor that is trained on simulations, as in the paper.

    Notes
    -----
    The prior is N(0, c^2 11' + diag(d^2)) of ln theta. Frequencies should be aligned to the nominal model's, as a
    `DataInformedFEM` does. A record with a missing mode is inverted from those that are there. An estimate is an
    effective stiffness, not a material property. :doc:`/guide/estimation` has the steps and what teaches the prior.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.surrogate import PosteriorInverse
    >>> year = make_truss_campaign(random_state=0)
    >>> inverse = PosteriorInverse(make_truss()).fit(year.frequencies)
    >>> print(f"temperature moves all stiffness together by {inverse.prior_.common:.0%}")
    temperature moves all stiffness together by 6%
    >>> theta, std = inverse.transform(year.frequencies, return_std=True)
    >>> std.mean().round(2).to_dict()
    {'bottom': 0.04, 'top': 0.05, 'diagonal': 0.02, 'vertical': 0.07}
    """

    _parameter_constraints: dict = {
        "model": [HasMethods(["frequencies"]), None],
        "prior": [StrOptions({"learned"}), Interval(Real, 0, None, closed="neither"), "array-like", dict],
        "noise": [StrOptions({"auto"}), Interval(Real, 0, None, closed="left"), "array-like"],
        "dofs": ["array-like", None],
        "shape_noise": [Interval(Real, 0, 1, closed="neither"), "array-like"],
        "reduce": [StrOptions({"auto"}), "boolean", Interval(Real, 0, 1, closed="neither")],
        "memory": [str, HasMethods(["cache"]), None],
        "n_jobs": [Integral, None],
    }

    def __init__(
        self,
        model: FEModel | None = None,
        *,
        prior: ArrayLike | Mapping[str, float] | Literal["learned"] = "learned",
        noise: ArrayLike | Literal["auto"] = "auto",
        dofs: ArrayLike | None = None,
        shape_noise: ArrayLike = 0.01,
        reduce: bool | float | Literal["auto"] = "auto",
        memory: str | Memory | None = None,
        n_jobs: int | None = None,
    ):
        self.model = model
        self.prior = prior
        self.noise = noise
        self.dofs = dofs
        self.shape_noise = shape_noise
        self.reduce = reduce
        self.memory = memory
        self.n_jobs = n_jobs

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: ArrayLike, y: None = None) -> PosteriorInverse:
        """Learn prior and noise from records of the healthy structure.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Frequencies in Hz and, with ``dofs``, components of shapes; NaN is allowed.
        y : None
            Ignored.

        Returns
        -------
        PosteriorInverse
            The fitted estimator.

        Raises
        ------
        ValueError
            If there is no model, the number of columns is not the model's, a frequency is not positive, or a model that
            is to be reduced has no method for it.

        Warns
        -----
        UserWarning
            If there are few records to learn from.
        """
        model = self._checked_model()
        check_model(model)
        tolerance(model, self.reduce)
        names = list(model.parameter_names)
        shapes = None if self.dofs is None else ShapeInputs.read(model, self.dofs, self.shape_noise)
        n_columns, self.shape_inputs_ = model.n_modes if shapes is None else shapes.n_columns, shapes
        inputs = self._positive(X, model.n_modes, reset=True)
        if (found := inputs.shape[1]) != n_columns:
            more = "" if shapes is None else f" and their shapes at {shapes.n_sensors} sensors, {n_columns} columns"
            raise ValueError(f"X has {found} columns; expected the {model.n_modes} modes of {model!r}{more}")
        self.parameter_names_, self.n_parameters_ = names, len(names)
        inputs = inputs if shapes is None else shapes.normalised(inputs)
        first = self._first(getattr(X, "columns", None))
        learns_prior, learns_noise = isinstance(self.prior, str), np.zeros(len(first.noise), dtype=bool)
        learns_noise[: model.n_modes] = isinstance(self.noise, str)
        in_order = inputs[np.argsort(row_times(X), kind="stable")]
        asked = first, in_order, self.reduce, learns_prior, learns_noise
        with collected() as self.findings_:
            known = remembered(self.memory, taught, *asked, self.n_jobs, ignore=["n_jobs"])
        self.taught_by_ = None if self.memory is None else asked
        self.simulator_ = replace(known.simulator, model=model)  # not a copy that was read
        self.posterior_ = replace(known, simulator=self.simulator_)
        self.prior_, self.noise_, self.n_runs_ = known.prior, known.noise[: model.n_modes], known.n_runs
        n_records = int((~np.isnan(inputs).all(axis=1)).sum())
        if n_records < 10 and (learns_prior or learns_noise.any()):
            self.findings_.append(
                FewRecordsWarning(
                    "fewer than 10 records teach the prior of the parameters and the noise of the modes. Both stay "
                    "near 1 to 3 %. Give prior and noise",
                    "few-records",
                )
            )
        warn_each(self.findings_)
        return self

    @overload
    def transform(self, X: pd.DataFrame, return_std: Literal[False] = False) -> pd.DataFrame: ...
    @overload
    def transform(self, X: ArrayLike, return_std: Literal[False] = False) -> NDArray[np.float64]: ...
    @overload
    def transform(self, X: ArrayLike, return_std: bool) -> Any: ...
    def transform(self, X: ArrayLike, return_std: bool = False) -> Any:
        """Multipliers of the nominal parameters.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Frequencies in Hz and, with ``dofs``, components of shapes; NaN is allowed.
        return_std : bool, default=False
            Whether to return standard deviations too.

        Returns
        -------
        theta : ndarray or DataFrame of shape (n_samples, n_parameters)
            NaN in rows without any mode. A frame gives a frame on its own index.
        std : ndarray or DataFrame of shape (n_samples, n_parameters)
            Only with ``return_std``: posterior standard deviations by Laplace's approximation; with a learned prior, as
            if each parameter could move by itself as far as all together.

        Warns
        -----
        UserWarning
            If more than 1 % of the rows have not converged.
        """
        found = self.invert(X)
        warn_each(found.findings)
        return (found.theta, found.std) if check_flag(return_std, "return_std") else found.theta

    def invert(self, X: ArrayLike) -> Bunch:
        """Parameters of measured frequencies, and how sure they are.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Frequencies in Hz and, with ``dofs``, components of shapes; NaN is allowed.

        Returns
        -------
        Bunch
            - ``theta`` (n_samples, n_parameters): the multipliers, NaN in rows without any mode and in rows that have
              stalled;
            - ``std`` (n_samples, n_parameters): their posterior standard deviations, as `transform` gives them;
            - ``residuals`` (n_samples, n_modes): ln f measured minus ln f of the model at theta, NaN where a mode is
              missing;
            - ``weight`` (n_samples,): mean precision of the parameters as a share of what all modes would give, 1 in
              complete rows and 0 in rows without any mode;
            - ``converged`` (n_samples,): whether the steps have converged. Rows that have run out of steps keep what
              they have reached;
            - ``by_full_model`` (n_samples,): whether the full model was solved for the row, which is outside the box of
              the reduced one;
            - ``findings``, a list: a warning if more than 1 % of the rows have not converged.

        Examples
        --------
        >>> from skthermo.datasets import make_truss
        >>> from skthermo.surrogate import PosteriorInverse
        >>> model = make_truss()
        >>> F = model.frequencies([[0.95, 1.05, 0.9, 1.0]])
        >>> found = PosteriorInverse(model, prior=0.2, noise=0.001).fit(F).invert(F)
        >>> found.theta.round(2), found.std.round(3)
        (array([[0.95, 1.05, 0.9 , 1.  ]]), array([[0.006, 0.009, 0.002, 0.126]]))
        """
        check_is_fitted(self)
        inputs = self._positive(X, self.model.n_modes)
        inputs = inputs if self.shape_inputs_ is None else self.shape_inputs_.normalised(inputs)
        with collected() as findings:
            asked = self.taught_by_, inputs, self.posterior_, self.n_jobs
            found = remembered(self.memory, inverted, *asked, ignore=["posterior", "n_jobs"])
        if unconverged(found).mean() > 0.01:
            findings.append(
                ModelWarning(
                    "parameters of many records did not converge, and are what was reached in 100 steps (invert says "
                    "which). Use a model with track=True where modes cross",
                    "poor-fit",
                )
            )
        theta = frame_like(X, found.theta, self.parameter_names_)
        std = frame_like(X, found.std, self.parameter_names_)
        return Bunch(**{**found, "theta": theta, "std": std, "findings": findings})

    def _first(self, mode_names: Any) -> ThermalPosterior:
        """What is known before the records: what is stated, and first values of the rest."""
        model, shapes = self.model, self.shape_inputs_
        names = tuple(model.parameter_names)
        prior, stated = ThermalPrior(names, 0.03, np.full(len(names), 0.03)), np.full(model.n_modes, 0.01)
        if not isinstance(self.prior, str):
            prior = ThermalPrior(names, 0.0, check_prior(self.prior, names))
        if not isinstance(self.noise, str):
            stated = np.maximum(check_noise(self.noise, model.n_modes, mode_names), 1e-6)
        noise = stated if shapes is None else np.append(stated, shapes.deviations)
        has_derivatives = hasattr(model, "linearised") or hasattr(model, "jacobian")
        is_program = not (has_derivatives if shapes is None else hasattr(model, "linearised_modes"))
        return ThermalPosterior(Simulator(model), prior, noise, shapes, None, is_program)


def unconverged(found: Bunch) -> NDArray[np.bool_]:
    """Rows with frequencies whose steps have not converged."""
    return ~found.converged & (found.weight > 0)
