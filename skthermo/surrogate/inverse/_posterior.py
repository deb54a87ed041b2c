"""The posterior mode of parameters given frequencies, by steps on the FE model; records teach prior and noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from numbers import Integral, Real
from typing import Any, Literal, NamedTuple, overload

import numpy as np
import pandas as pd
from joblib import Memory
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from sklearn.utils import Bunch

from skthermo._core.arrays import (
    Array,
    Reduce,
    check_flag,
    check_model,
    check_noise,
    check_prior,
    is_auto,
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
    validate_data,
)
from skthermo._core.frames import column_names, frame_like, row_times
from skthermo._core.memory import remembered
from skthermo._core.text import listed, percent
from skthermo._core.warnings import collected, warn_each
from skthermo.exceptions import FewRecordsWarning, ModelWarning
from skthermo.fem import FEModel, evaluate
from skthermo.fem.affine import ResponseSurface, n_terms
from skthermo.surrogate._regression import FrequencyInverse
from skthermo.surrogate._simulator import Simulator
from skthermo.surrogate.inverse._shapes import ShapeInputs, shape_misfit

LEAST_NOISE, MOST_NOISE = 1e-5, 0.3  # range of the relative noise that records teach
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
        weights = self.own**-2.0
        together = self.common**2 / (1 + self.common**2 * weights.sum())
        return np.diag(weights) - together * np.outer(weights, weights)

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

    def near(self, prior: ThermalPrior, noise: Array, *, far: float = 5.0) -> LinearRecords:
        """Records without observations that are ``far`` standard deviations from what prior and noise expect."""
        variances = np.einsum("smp,pq,smq->sm", self.slopes, prior.covariance, self.slopes) + noise**2
        with np.errstate(invalid="ignore"):
            return LinearRecords(np.where(self.values**2 <= far**2 * variances, self.values, np.nan), self.slopes)

    def posterior(self, prior: ThermalPrior, noise: Array) -> tuple[Array, Array]:
        """Means, (n_records, n_parameters), and covariances of ln theta given each record."""
        known = ~np.isnan(self.values)
        spread = np.where(known, noise, np.inf)
        covariances = np.linalg.inv(information(self.slopes, spread, prior.precision))
        pulls = np.einsum("smp,sm->sp", self.slopes, np.where(known, self.values, 0.0) / spread**2)
        return np.einsum("spq,sq->sp", covariances, pulls), covariances

    def learned(
        self,
        prior: ThermalPrior,
        noise: Array,
        least: Array,
        *,
        learns_prior: bool,
        learns_noise: NDArray[np.bool_],
        moved: tuple[float, float] = (1e-3, 3.0),
    ) -> tuple[ThermalPrior, Array]:
        """The most likely prior and noise, by steps from given ones.

        Noise is relative, one number for each observation, (n_observations,), and no smaller than the least. What the
        model cannot follow counts as noise. The deviations of the prior lie in the range ``moved``.
        """
        n_own = 1 + len(prior.own)

        def read(logs: Array) -> tuple[ThermalPrior, Array]:
            values, found = np.exp(logs), noise.copy()
            found[learns_noise] = values[n_own * learns_prior :]
            return ThermalPrior(prior.names, values[0], values[1:n_own]) if learns_prior else prior, found

        def loss(logs: Array) -> tuple[float, Array]:
            likelihood, of_prior, of_noise = self._likelihood(*read(logs))
            return -likelihood, -np.append(of_prior if learns_prior else [], of_noise[learns_noise])

        learns_noise = learns_noise & ~np.isnan(self.values).all(axis=0)
        start = np.log(np.append([prior.common, *prior.own] if learns_prior else [], noise[learns_noise]))
        if not len(start):
            return prior, noise
        lowest = np.append([moved[0]] * (n_own * learns_prior), least[learns_noise])
        highest = np.append([moved[1]] * (n_own * learns_prior), [MOST_NOISE] * learns_noise.sum())
        bounds = np.log(np.column_stack([lowest, highest]))
        return read(minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x)

    def _likelihood(self, prior: ThermalPrior, noise: Array) -> tuple[float, Array, Array]:
        """Logarithm of the likelihood, and its derivatives by the logarithms of the prior's deviations and the noise.

        The derivatives are those expected given each record (Fisher's identity).
        """
        known, precision = ~np.isnan(self.values), prior.precision
        x, covariances = self.posterior(prior, noise)
        values, spread = np.where(known, self.values, 0.0), np.where(known, noise, np.inf)
        left = values - np.einsum("smp,sp->sm", self.slopes, x)
        variances = np.einsum("smp,spq,smq->sm", self.slopes, covariances, self.slopes)
        volumes = np.linalg.slogdet(covariances)[1].sum() + len(x) * np.linalg.slogdet(precision)[1]
        squares = ((left / spread) ** 2).sum() + np.einsum("sp,pq,sq->", x, precision, x)
        likelihood = 0.5 * (volumes - squares) - (known @ np.log(noise)).sum()
        moments = x.T @ x + covariances.sum(axis=0)
        slope = precision @ moments @ precision - len(x) * precision
        of_prior = np.append(prior.common**2 * slope.sum(), prior.own**2 * np.diag(slope))
        of_noise = (np.where(known, left**2 + variances, 0.0) / noise**2 - known).sum(axis=0)
        return float(likelihood), of_prior, of_noise


def least_noise(log_frequencies: Array) -> Array:
    """A lower limit of the noise of each mode, from records in their order, (n_modes,).

    It is a tenth of the scatter that the differences of successive records show. Without it, a mode that one parameter
    alone can follow would count as exact.
    """
    steps = robust_deviation(np.diff(log_frequencies, axis=0)) if len(log_frequencies) > 1 else np.zeros(1)
    share = 0.1 / np.sqrt(2) * np.nan_to_num(steps)
    return np.clip(np.broadcast_to(share, log_frequencies.shape[1:]), LEAST_NOISE, MOST_NOISE / 2)


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
    n_modes: int
    shapes: ShapeInputs | None
    surface: ResponseSurface | None
    is_program: bool
    n_runs: int = 0

    def observed(self, inputs: Array) -> Observed:
        """What rows of inputs tell.

        Frequencies count as exact to 1e-6 at most. Where modes are missing, many parameters fit the others, and a noise
        of 1e-3 lets steps move along the curve of these parameters.
        """
        frequencies = inputs[:, : self.n_modes]
        units = np.empty((*frequencies.shape, 0)) if self.shapes is None else self.shapes.unit_shapes(inputs)
        noise = np.tile(self.noise, (len(inputs), 1))
        has_gaps = np.isnan(frequencies).any(axis=1, keepdims=True)
        noise[:, : self.n_modes] = np.maximum(noise[:, : self.n_modes], np.where(has_gaps, 1e-3, 1e-6))
        missing = np.isnan(np.hstack([frequencies, units.reshape(len(units), -1)]))
        return Observed(np.log(frequencies), units, np.where(missing, np.inf, noise))

    def linearised(self, theta: Array, n_jobs: int | None, *, exactly: bool = False) -> tuple[Array, ...]:
        """The model at rows of theta, relative derivatives included; unless ``exactly``, the reduced one if there is
        one, in any row."""
        simulator = Simulator(self.simulator.model) if exactly else self.simulator.approximate
        return simulator.linearise(theta, n_jobs, None if self.shapes is None else self.shapes.dofs, relative=True)

    def modes(self, observed: Observed, n_jobs: int | None) -> PosteriorModes:
        """Posterior modes of rows: by the surface, then by the model, and by the full one outside the reduced one's
        box."""
        precision, start = self.prior.precision, np.zeros((len(observed.noise), len(self.prior.own)))
        if self.surface is not None:
            found = posterior_modes(self.surface.linearise, observed, precision, start)
            if self.is_program:
                return found
            start = found.x
        model = partial(self.linearised, n_jobs=n_jobs)
        found = posterior_modes(model, observed, precision, start)
        if not getattr(self.simulator.model, "track", False):
            found = beyond_crossings(model, observed, precision, found)
        outside = self.simulator.outside(np.exp(found.x)) if self.simulator.reduced is not None else np.zeros(1, bool)
        if (rows := np.flatnonzero(outside)).size:
            exact = partial(self.linearised, n_jobs=n_jobs, exactly=True)
            last = posterior_modes(exact, observed.some(rows), precision, found.x[rows])
            last.full_solves[:] = last.solves
            found.put(rows, last)
        return found


class Observed(NamedTuple):
    """Measured ln f, (n_rows, n_modes), mode shapes of unit length, (n_rows, n_modes, n_sensors), and standard
    deviations of both, (n_rows, n_observations), infinite where one is missing."""

    log_frequencies: Array
    units: Array
    noise: Array

    def some(self, rows: NDArray[np.intp]) -> Observed:
        """Some of the rows."""
        return Observed(*(values[rows] for values in self))

    def beside(self, frequencies: Array, slopes: Array, *shapes: Array) -> tuple[Array, Array]:
        """Residuals beside a solved model, 0 where one is missing, and derivatives of the observations by ln theta.

        A model that gives no shapes, such as a surface, is compared with the frequencies alone.
        """
        residual = self.log_frequencies - np.log(frequencies)
        if shapes:
            misfit, change = shape_misfit(self.units, *shapes)
            residual, slopes = np.hstack([residual, misfit]), np.hstack([slopes, change])
        return np.where(np.isinf(self.noise[:, : residual.shape[1]]), 0.0, residual), slopes


class PosteriorModes(NamedTuple):
    """Where the steps of each row end, ln theta = x, with objective, residuals and derivatives there; how they end."""

    x: Array
    value: Array
    residual: Array
    slopes: Array
    converged: NDArray[np.bool_]
    stalled: NDArray[np.bool_]
    solves: NDArray[np.intp]
    full_solves: NDArray[np.intp]

    def put(self, rows: NDArray[np.intp], other: PosteriorModes) -> None:
        """Put other ends of some rows in place; solves of both count."""
        for name, values in zip(self._fields, other, strict=True):
            mine = getattr(self, name)
            mine[rows] = values + (mine[rows] if name.endswith("solves") else 0)


def posterior_modes(
    linearise: Linearise,
    observed: Observed,
    precision: Array,
    start: Array,
    *,
    n_steps: int = 100,
    share: float = 0.01,
    least: float = 1e-6,
    last_damping: float = 1e8,
) -> PosteriorModes:
    """Posterior modes of ln theta by Gauss-Newton steps, each damped more where one would raise the objective.

    The objective is half of the squared residuals over the noise and of ln theta in its prior. A step is a row's last
    one if it is less than a share of the posterior standard deviations and curvature along it is less than a tenth of
    that share of the noise, or if it is less than ``least``, or would gain less than rounding hides. At
    ``last_damping``, a share of the diagonal of the Hessian, a row stalls.
    """

    def objective(x: Array, residual: Array, noise: Array) -> Array:
        value = 0.5 * (((residual / noise) ** 2).sum(axis=1) + ((x @ precision) * x).sum(axis=1))
        return np.where(np.isfinite(value), value, np.inf)

    x = start.copy()
    residual, slopes = observed.beside(*linearise(np.exp(x)))
    noise = observed.noise[:, : residual.shape[1]]
    value, damping = objective(x, residual, noise), np.zeros(len(x))
    converged, solves, active = np.zeros(len(x), dtype=bool), np.ones(len(x), dtype=np.intp), np.arange(len(x))
    active = active[np.isfinite(value)]
    for _ in range(n_steps):
        hessian = information(slopes[active], noise[active], precision)
        pull = np.einsum("smp,sm->sp", slopes[active], residual[active] / noise[active] ** 2) - x[active] @ precision
        step = gauss_newton(hessian, pull, np.zeros(len(active)))
        gain = 0.5 * (pull * step).sum(axis=1)
        smallest = np.minimum(
            share * deviations(hessian), np.sqrt(0.1 * share * noise[active].min(axis=1, keepdims=True))
        )
        is_last = (np.abs(step) <= np.maximum(least, smallest)).all(axis=1) | (gain <= 1e-10 * value[active])
        ended = active[is_last]
        x[ended] += step[is_last]
        residual[ended] -= np.einsum("smp,sp->sm", slopes[ended], step[is_last]) * np.isfinite(noise[ended])
        value[ended] -= gain[is_last]
        converged[ended] = True
        goes_on = ~is_last & (damping[active] < last_damping)
        active, hessian, pull = active[goes_on], hessian[goes_on], pull[goes_on]
        if not len(active):
            break
        tried = x[active] + gauss_newton(hessian, pull, damping[active])
        there, slopes_there = observed.some(active).beside(*linearise(np.exp(tried)))
        solves[active] += 1
        value_there = objective(tried, there, noise[active])
        is_lower = value_there < value[active]
        damping[active] = np.where(is_lower, damping[active] / 30, np.maximum(1e-3, 5 * damping[active]))
        damping[damping < 1e-4] = 0.0
        rows = active[is_lower]
        x[rows], residual[rows], slopes[rows] = tried[is_lower], there[is_lower], slopes_there[is_lower]
        value[rows] = value_there[is_lower]
    stalled = ~converged & ((damping > 0) | np.isinf(value))
    return PosteriorModes(x, value, residual, slopes, converged, stalled, solves, np.zeros_like(solves))


def beyond_crossings(
    linearise: Linearise, observed: Observed, precision: Array, found: PosteriorModes, *, large: float = 3.0
) -> PosteriorModes:
    """Posterior modes of a model that sorts its modes, some of them beyond a crossing of two of these.

    A row whose root mean square misfit is ``large``, in standard deviations of the noise, starts again where the two
    modes fit in exchanged order, and ends there if that is better.
    """
    n_modes = observed.log_frequencies.shape[1]
    for lower in range(n_modes - 1):
        squares = (found.residual / observed.noise[:, : found.residual.shape[1]]) ** 2
        rows = np.flatnonzero(~found.converged | (squares.mean(axis=1) > large**2))
        if not rows.size:
            break
        order = np.arange(n_modes)
        order[[lower, lower + 1]] = order[[lower + 1, lower]]
        some, slopes = observed.some(rows), found.slopes[rows, :n_modes]
        fitted = some.log_frequencies - found.residual[rows, :n_modes]
        noise = some.noise[:, order]
        residual = np.where(np.isinf(noise), 0.0, some.log_frequencies[:, order] - fitted)
        pull = np.einsum("smp,sm->sp", slopes, residual / noise**2) - found.x[rows] @ precision
        start = found.x[rows] + gauss_newton(information(slopes, noise, precision), pull, np.zeros(len(rows)))
        again = posterior_modes(linearise, some, precision, start)
        is_better = np.flatnonzero(again.value < found.value[rows])
        found.put(rows[is_better], PosteriorModes(*(values[is_better] for values in again)))
    return found


def information(slopes: Array, noise: Array, precision: Array) -> Array:
    """Precision of ln theta given derivatives of observations and their noise, infinite where one is missing."""
    scaled = slopes / noise[:, :, np.newaxis]
    return scaled.swapaxes(1, 2) @ scaled + precision


def gauss_newton(hessian: Array, pull: Array, damping: Array, *, longest: float = 0.5) -> Array:
    """Steps of rows, damped by a share of the diagonal, that change no ln theta by more than the ``longest``."""
    diagonal = np.einsum("spp->sp", hessian) * np.maximum(damping, 1e-14)[:, np.newaxis]  # against rounding
    step = np.linalg.solve(hessian + np.eye(pull.shape[1]) * diagonal[:, np.newaxis], pull[:, :, np.newaxis])[:, :, 0]
    return step * np.minimum(1.0, longest / np.maximum(np.abs(step).max(axis=1, keepdims=True), longest))


def deviations(hessian: Array) -> Array:
    """Standard deviations, (n_rows, n_parameters), of Gaussians with these precision matrices."""
    diagonal = np.einsum("spp->sp", hessian)
    regular = hessian + 1e-14 * np.eye(diagonal.shape[1]) * diagonal[:, np.newaxis]  # rounding could make it singular
    return np.sqrt(np.abs(np.einsum("spp->sp", np.linalg.inv(regular))))


def inverted(taught_by: Any, inputs: Array, posterior: ThermalPosterior, n_jobs: int | None) -> Bunch:
    """What `PosteriorInverse.invert` gives, for rows of inputs; a memory knows a posterior by what has taught it."""
    observed, precision = posterior.observed(inputs), posterior.prior.precision
    found = posterior.modes(observed, n_jobs)
    slopes = np.nan_to_num(found.slopes)
    noise, stated = observed.noise[:, : slopes.shape[1]], posterior.noise[: slopes.shape[1]]
    std = deviations(information(slopes, noise, precision))
    at_best = deviations(information(slopes, np.where(np.isinf(noise), stated, noise), precision))
    is_empty = np.isnan(inputs).all(axis=1)
    unknown = (is_empty | found.stalled)[:, np.newaxis]
    theta = np.where(unknown, np.nan, np.exp(found.x))
    return Bunch(
        theta=theta,
        std=std * theta,
        residuals=np.where(unknown | np.isinf(noise), np.nan, found.residual)[:, : posterior.n_modes],
        weight=np.where(is_empty, 0.0, ((at_best / std) ** 2).mean(axis=1)),
        converged=found.converged & ~is_empty,
        solves=found.solves,
        full_solves=found.full_solves,
    )


def taught(
    first: ThermalPosterior,
    inputs: Array,
    reduce: Reduce,
    learns_prior: bool,
    learns_noise: NDArray[np.bool_],
    n_jobs: int | None,
    *,
    n_teaching: int = 300,
    n_passes: int = 3,
) -> ThermalPosterior:
    """A posterior with prior and noise as records teach them, and a model or surface that suits these records.

    At most ``n_teaching`` records, spread evenly, teach. The model is linearised at its nominal state first, and then
    in each pass at what is known of each record, whose ln theta moves by at most 1 from one pass to the next.
    """
    rows = spread_evenly(np.flatnonzero(~np.isnan(inputs).all(axis=1)), n_teaching)
    if not len(rows):
        return first
    now, observed, x = first, first.observed(inputs[rows]), np.zeros((len(rows), len(first.prior.own)))
    solved = tuple(np.repeat(part, len(rows), axis=0) for part in first.linearised(np.exp(x[:1]), n_jobs))
    least = first.noise.copy()
    least[: first.n_modes] = least_noise(np.log(inputs[:, : first.n_modes]))
    runs: list[tuple[Array, Array]] = []
    for number in range(n_passes):
        records = LinearRecords.around(x, *observed.beside(*solved), np.isinf(observed.noise))
        records = records.near(now.prior, now.noise) if number else records
        prior, noise = records.learned(
            now.prior, now.noise, least, learns_prior=learns_prior, learns_noise=learns_noise
        )
        x = x + np.clip(records.posterior(prior, noise)[0] - x, -1.0, 1.0)
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
    posterior: ThermalPosterior,
    x: Array,
    runs: list[tuple[Array, Array]],
    n_jobs: int | None,
    *,
    fewest: int = 200,
    most: int = 600,
    per_term: int = 3,
) -> ThermalPosterior:
    """A posterior with a surface through further runs of a program near some ln theta, ``per_term`` of a cubic one."""
    random, n_parameters = np.random.RandomState(len(runs)), x.shape[1]
    number = int(np.clip(per_term * n_terms(n_parameters, 3), fewest, most))
    points = x[random.randint(len(x), size=number)]
    points = points + posterior.prior.deviations * random.standard_normal(points.shape)
    runs.append((points, evaluate(posterior.simulator.model, np.exp(points), n_jobs=n_jobs)))
    surface = ResponseSurface.fitted(*(np.concatenate(part) for part in zip(*runs, strict=True)))
    at_nominal = (2 * n_parameters + 1) * (len(runs) == 1)
    return replace(posterior, surface=surface, n_runs=posterior.n_runs + number + at_nominal)


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
        are solved by the full model, with a warning that counts them (:doc:`/guide/costs`).
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
    {'bottom': 0.01, 'top': 0.02, 'diagonal': 0.01, 'vertical': 0.04}
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
            If there is no model, the number of columns is not the model's, a frequency is not positive, a mode is there
            twice, or a model that is to be reduced has no method for it.

        Warns
        -----
        UserWarning
            If there are few records to learn from.
        """
        model = self._checked_model()
        check_model(model)
        tolerance(model, self.reduce)
        names = list(model.parameter_names)
        self.shape_inputs_ = None if self.dofs is None else ShapeInputs.read(model, self.dofs, self.shape_noise)
        n_columns = model.n_modes if self.shape_inputs_ is None else self.shape_inputs_.n_columns
        found = validate_data(self, X).shape[1]
        if found != n_columns:
            sensors = 0 if self.shape_inputs_ is None else self.shape_inputs_.n_sensors
            more = f" and their shapes at {sensors} sensors, {n_columns} columns" if sensors else ""
            raise ValueError(f"X has {found} columns; expected the {model.n_modes} modes of {model!r}{more}")
        self.parameter_names_, self.n_parameters_ = names, len(names)
        inputs, first = self._read(X), self._first(getattr(X, "columns", None))
        self._check_different(inputs[:, : model.n_modes], column_names(X, "f"))
        learns_prior, learns_noise = isinstance(self.prior, str), np.zeros(len(first.noise), dtype=bool)
        learns_noise[: model.n_modes] = isinstance(self.noise, str)
        in_order = inputs[np.argsort(row_times(X), kind="stable")]
        asked = first, in_order, self.reduce, learns_prior, learns_noise
        with collected() as self.findings_:
            known = remembered(self.memory, taught, *asked, self.n_jobs, ignore=["n_jobs"])
        self.taught_by_ = None if self.memory is None else asked
        self.simulator_ = replace(known.simulator, model=model)  # not a copy that was read
        self.posterior_ = replace(known, simulator=self.simulator_)
        self.prior_, self.noise_ = known.prior, known.noise[: model.n_modes]
        n_records = int((~np.isnan(inputs).all(axis=1)).sum())
        if n_records < 10 and (learns_prior or learns_noise.any()):
            self.findings_.append(
                FewRecordsWarning(
                    "fewer than 10 records teach the prior of the parameters and the noise of the modes. Both stay "
                    "near 1 to 3 %. Give prior and noise",
                    "few-teaching-records",
                )
            )
        if not is_auto(self.reduce):
            self.findings_ += self.simulator_.doubts()
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
            Only with ``return_std``: posterior standard deviations by Laplace's approximation.

        Warns
        -----
        UserWarning
            If more than 1 % of the rows have not converged, or are solved by the full model beside a reduced one.
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
            - ``std`` (n_samples, n_parameters): their posterior standard deviations by Laplace's approximation;
            - ``residuals`` (n_samples, n_modes): ln f measured minus ln f of the model at theta, NaN where a mode is
              missing;
            - ``weight`` (n_samples,): mean precision of the parameters as a share of what all modes would give, 1 in
              complete rows and 0 in rows without any mode;
            - ``converged`` (n_samples,): whether the steps have converged. Rows that have run out of steps keep what
              they have reached;
            - ``solves``, ``full_solves`` (n_samples,): how often a model was solved with its derivatives for the row,
              and how many of these were of the full model because steps ended outside the box of the reduced one;
            - ``findings``, a list: warnings that more than 1 % of the rows have not converged, or were solved by the
              full model.

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
        inputs = self._read(X)
        with collected() as findings:
            asked = self.taught_by_, inputs, self.posterior_, self.n_jobs
            found = remembered(self.memory, inverted, *asked, ignore=["posterior", "n_jobs"])
        findings += doubts_of(found)
        theta = frame_like(X, found.theta, self.parameter_names_)
        std = frame_like(X, found.std, self.parameter_names_)
        return Bunch(**{**found, "theta": theta, "std": std, "findings": findings})

    @property
    def n_runs_(self) -> int:
        """How often a program without derivatives was run."""
        check_is_fitted(self)
        return self.posterior_.n_runs

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
        return ThermalPosterior(Simulator(model), prior, noise, model.n_modes, shapes, None, is_program)

    def _read(self, X: ArrayLike) -> Array:
        """Measured columns, with shapes normalised."""
        inputs = self._positive(X, self.model.n_modes)
        return inputs if self.shape_inputs_ is None else self.shape_inputs_.normalised(inputs)

    def _check_different(self, frequencies: Array, names: Sequence[Any]) -> None:
        """Refuse a mode that is there twice: all its records would count twice."""
        if len(frequencies) < 2:
            return
        _, first, which = np.unique(np.nan_to_num(frequencies), axis=1, return_index=True, return_inverse=True)
        for column, kind in enumerate(which):
            if first[kind] != column and not np.isnan(frequencies[:, column]).all():
                raise ValueError(
                    f"{names[column]!r} has the values of {names[first[kind]]!r} in all {len(frequencies)} rows; "
                    "expected each mode once"
                )


def unconverged(found: Bunch) -> NDArray[np.bool_]:
    """Rows with frequencies whose steps have not converged."""
    return ~found.converged & (found.weight > 0)


def doubts_of(found: Bunch, *, many: float = 0.01) -> list[ModelWarning]:
    """Findings that many rows have not converged, or were solved by the full model."""
    findings = []
    if unconverged(found).sum() > many * len(found.weight):
        findings.append(
            ModelWarning(
                "parameters of many records did not converge, and are what was reached in 100 steps (invert says "
                "which). Use a model with track=True where modes cross",
                "not-converged",
            )
        )
    if (found.full_solves > 0).sum() > many * len(found.weight):
        findings.append(
            ModelWarning(
                "parameters of many records are outside the box of the reduced model, and the full one was solved for "
                "them, which takes longer (invert says how often). Fit to records of such weather",
                "outside-reduced-model",
            )
        )
    return findings
