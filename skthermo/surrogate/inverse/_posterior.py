"""The posterior mode of parameters given frequencies, by steps on the FE model; records teach prior and noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
from skthermo._core.parallel import with_progress
from skthermo._core.text import listed, percent
from skthermo._core.warnings import collected, warn_each
from skthermo.exceptions import FewRecordsWarning, ModelWarning
from skthermo.fem import FEModel, evaluate
from skthermo.fem.affine import ResponseSurface, n_terms
from skthermo.surrogate._regression import FrequencyInverse
from skthermo.surrogate._simulator import Simulator
from skthermo.surrogate.inverse._steps import (
    Linearise,
    Local,
    Objective,
    Refined,
    ShapeInputs,
    deviations,
    information,
    minimise,
    refine,
)

LEAST_NOISE, MOST_NOISE = 1e-5, 0.3  # range of the relative noise that records teach


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
    def around(cls, local: Local, missing: NDArray[np.bool_]) -> LinearRecords:
        """Records by the linear model of an objective at some ln theta."""
        values = local.residual + np.einsum("smp,sp->sm", local.sensitivity, local.x)
        usable = ~missing & np.isfinite(values) & np.isfinite(local.sensitivity).all(axis=2)
        return cls(np.where(usable, values, np.nan), np.where(usable[:, :, np.newaxis], local.sensitivity, 0.0))

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
    """ThermalPosterior modes of records, by an FE model or by a surface in its place.

    ``noise`` holds standard deviations of all observations, frequencies and components of shapes, (n_observations,).
    Rows start where the response ``surface`` has its posterior mode. A model without derivatives, ``is_program``, takes
    no steps of its own, and was run ``n_runs`` times.
    """

    simulator: Simulator
    prior: ThermalPrior
    noise: Array
    n_modes: int
    shapes: ShapeInputs | None
    surface: ResponseSurface | None
    is_program: bool
    n_runs: int = 0

    def linearise(self, simulator: Simulator, n_jobs: int | None) -> Linearise:
        """Frequencies and, perhaps, shapes by a simulator, with their derivatives by ln theta."""
        dofs = None if self.shapes is None else self.shapes.dofs
        return partial(simulator.linearise, n_jobs=n_jobs, dofs=dofs, relative=True)

    def objective(self, inputs: Array, n_jobs: int | None) -> Objective:
        """The objective of rows of inputs, by the reduced model where there is one.

        Frequencies count as exact to 1e-6 at most. Where modes are missing, many parameters fit the others, and a noise
        of 1e-3 lets steps move along the curve of these parameters.
        """
        frequencies = inputs[:, : self.n_modes]
        units = np.empty((*frequencies.shape, 0)) if self.shapes is None else self.shapes.unit_shapes(inputs)
        gaps = np.isnan(frequencies).any(axis=1, keepdims=True)
        noise = np.tile(self.noise, (len(inputs), 1))
        noise[:, : self.n_modes] = np.maximum(self.noise[: self.n_modes], np.where(gaps, 1e-3, 1e-6))
        is_by_surface = self.is_program and self.surface is not None
        linearise = self.surface.linearise if is_by_surface else self.linearise(self.simulator.approximate, n_jobs)
        missing = np.isnan(np.hstack([frequencies, units.reshape(len(units), -1)]))
        return Objective(linearise, np.log(frequencies), noise, self.prior.precision, units, missing)

    def refined(self, objective: Objective, n_jobs: int | None) -> Refined:
        """Refine rows, a few chunks of the model at a time, so that progress is visible."""
        n_rows = len(objective.log_measured)
        start = np.zeros((n_rows, len(self.prior.own)))
        if self.surface is not None:
            by_surface = replace(objective.without_shapes(), linearise=self.surface.linearise)
            found = minimise(by_surface, start)
            if self.is_program:
                return found
            start = found.local.x
        size = 8 * getattr(self.simulator.approximate.model, "rows_per_chunk", 32)
        blocks = map(slice, range(0, n_rows, size), range(size, n_rows + size, size))
        refine_block = partial(self._refine_block, objective, start, n_jobs)
        parts = with_progress(map(refine_block, blocks), n_rows, None, count=Refined.__len__, unit="records")
        return Refined.together([*parts])

    def _refine_block(self, objective: Objective, start: Array, n_jobs: int | None, rows: slice) -> Refined:
        """Refine rows; where the steps of a reduced model end outside its box, the full model takes the last ones."""
        some = objective.some(rows)
        found = refine(some, start[rows], sorts=not getattr(self.simulator.model, "track", False))
        if self.simulator.reduced is None:
            return found
        outside = np.flatnonzero(self.simulator.outside(np.exp(found.local.x)))
        if outside.size:
            full = self.linearise(Simulator(self.simulator.model), n_jobs)
            last = minimise(replace(some.some(outside), linearise=full), found.local.x[outside])
            last.full_solves += last.solves
            last.solves += found.solves[outside]
            found.put(outside, last)
        return found


def inverted(taught_by: Any, inputs: Array, posterior: ThermalPosterior, n_jobs: int | None) -> Bunch:
    """What `PosteriorInverse.invert` gives, for rows of inputs; a memory knows a posterior by what has taught it."""
    shape, some = (len(inputs), len(posterior.prior.own)), ~np.isnan(inputs).all(axis=1)
    result = Bunch(
        theta=np.full(shape, np.nan),
        std=np.full(shape, np.nan),
        residuals=np.full((len(inputs), posterior.n_modes), np.nan),
        weight=np.zeros(len(inputs)),
        converged=np.zeros(len(inputs), dtype=bool),
        solves=np.zeros(len(inputs), dtype=np.intp),
        full_solves=np.zeros(len(inputs), dtype=np.intp),
    )
    if not some.any():
        return result
    objective = posterior.objective(inputs[some], n_jobs)
    found = posterior.refined(objective, n_jobs)
    local, lost = found.local, found.stalled[:, np.newaxis]
    sensitivity = np.nan_to_num(local.sensitivity)
    noise, precision = objective.noise, posterior.prior.precision
    std = deviations(information(sensitivity, np.where(objective.missing, np.inf, noise), precision))
    at_best = deviations(information(sensitivity, noise, precision))
    result.theta[some] = np.where(lost, np.nan, np.exp(local.x))
    result.std[some] = np.where(lost, np.nan, std) * result.theta[some]
    unknown = lost | np.isnan(objective.log_measured)
    result.residuals[some] = np.where(unknown, np.nan, local.residual[:, : posterior.n_modes])
    result.weight[some] = ((at_best / std) ** 2).mean(axis=1)
    result.converged[some] = found.converged
    result.solves[some], result.full_solves[some] = found.solves, found.full_solves
    return result


def taught(
    first: ThermalPosterior,
    inputs: Array,
    reduce: Reduce,
    learns_prior: bool,
    learns_noise: NDArray[np.bool_],
    n_jobs: int | None,
    *,
    n_teaching: int = 300,
    n_passes: int = 4,
) -> ThermalPosterior:
    """A posterior with prior and noise as records teach them, and a model or surface that suits these records.

    At most ``n_teaching`` records, spread evenly, teach. The model is linearised at its nominal state first, and then
    in each pass at what is known of each record, whose ln theta moves by at most 1 from one pass to the next.
    """
    rows = spread_evenly(np.flatnonzero(~np.isnan(inputs).all(axis=1)), n_teaching)
    if not len(rows):
        return first
    n_parameters = len(first.prior.own)
    at_nominal = first.linearise(first.simulator, n_jobs)(np.ones((1, n_parameters)))
    nominal = [*map(partial(np.repeat, repeats=len(rows), axis=0), at_nominal)]
    now, x = first, np.zeros((len(rows), n_parameters))
    objective = replace(first.objective(inputs[rows], n_jobs), linearise=lambda _: nominal)
    least = first.noise.copy()
    least[: first.n_modes] = least_noise(np.log(inputs[:, : first.n_modes]))
    learns = {"learns_prior": learns_prior, "learns_noise": learns_noise}
    runs: list[tuple[Array, Array]] = []
    for number in range(n_passes):
        records = LinearRecords.around(objective.at(x), objective.missing)
        records = records.near(now.prior, now.noise) if number else records
        prior, noise = records.learned(now.prior, now.noise, least, **learns)
        x = x + np.clip(records.posterior(prior, noise)[0] - x, -1.0, 1.0)
        now = replace(now, prior=prior, noise=noise)
        if now.is_program:
            now = with_runs(now, x, runs, n_jobs) if number < 2 else now
        elif number == 0:
            around = Simulator.around(now.simulator.model, np.exp(x), reduce, n_rows=len(inputs))
            now = replace(now, simulator=around)
        else:
            now = replace(now, simulator=now.simulator.extended(np.exp(x)))
        objective = now.objective(inputs[rows], n_jobs)
    if now.is_program:
        return now
    solved = now.simulator.approximate.linearise(np.exp(x), n_jobs, relative=True)
    return replace(now, surface=ResponseSurface.fitted(x, *solved))


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
