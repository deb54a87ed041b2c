"""The whole chain: temperatures and frequencies in, a thermal FE model out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from numbers import Integral, Real
from typing import Any, Literal, Self, overload

import numpy as np
import pandas as pd
from joblib import Memory
from numpy.typing import ArrayLike, NDArray
from scipy.stats import norm
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.utils import Bunch, get_tags

from skthermo._core.arrays import (
    Array,
    MatrixLike,
    as_columns,
    as_floats,
    as_random_state,
    check_flag,
    check_model,
    is_auto,
    is_real,
    tolerance,
)
from skthermo._core.estimators import (
    CallbackSupport,
    Estimator,
    HasMethods,
    Interval,
    Stages,
    StrOptions,
    _fit_context,
    check_array,
    check_is_fitted,
    check_takes_weights,
    fit_checked,
    inputs_of_last_step,
    last_step,
    seed_parts,
    seeded,
    validate_data,
    with_means,
)
from skthermo._core.frames import (
    DAY_NS,
    Table,
    column_names,
    frame_like,
    has_stamps,
    like_targets,
    row_times,
    row_weights,
)
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.warnings import collected, warn_each
from skthermo.exceptions import UnevaluatedRowsWarning
from skthermo.fem import FEModel
from skthermo.fem.damage import LossKind, damage_directions
from skthermo.metrics.errors import complete_r2
from skthermo.preprocessing import BiasAligner
from skthermo.preprocessing.checks import misplaced_columns
from skthermo.residuals.sensors import SensorRegression
from skthermo.residuals.weather import TrainingRange
from skthermo.surrogate._fit_report import few_rows, report_of
from skthermo.surrogate._inverse import InverseSurrogate
from skthermo.surrogate._posterior import PosteriorInverse, ShapeInputs
from skthermo.surrogate._records import (
    RecordSimulator,
    TrainingRecords,
    doubts_of_order,
    frequency_table,
    measurement_noise,
    usable_records,
)
from skthermo.surrogate._regression import FrequencyInverse, TemperatureMapper
from skthermo.surrogate._simulator import Simulator
from skthermo.surrogate._thermal import (
    Discrepancy,
    ThermalModel,
    Weather,
    doubts_of_factors,
    limits_in_weather,
    possible,
    ratio_regressor,
)


class DataInformedFEM(CallbackSupport, SavesFrames, RegressorMixin, Estimator):
    """FE model whose parameters depend on temperature as learned from monitoring data.

    The method of Kamali et al. (2026), Section 2 [KCM26]_. M1 turns measured frequencies into parameters (eq. (5)), M2
    maps temperatures to those parameters (eq. (6)), and the FE model, healthy or damaged, turns the parameters back
    into frequencies (eqs. (7)-(8)).

    Parameters
    ----------
    model : FE model
        Its modes are the columns of the frequencies.
    inverse : transformer, optional
        M1. By default ``PosteriorInverse(model)``; the paper's is an ``InverseSurrogate`` (`paper_chain`). Either gets
        this model if it has none. Names such as ``inverse__noise`` in ``set_params`` and grids reach the default parts,
        too.
    mapper : regressor, optional
        M2. By default ``TemperatureMapper()``. With lags of hours, for example ``make_pipeline(LagFeatures(),
        TemperatureMapper())``. Means of earlier temperatures that a mapper chooses are those that explain the
        frequencies, and ``mapper_`` is a pipeline that begins with them.
    aligner : transformer, "auto" or "passthrough", default="auto"
        Maps measured frequencies onto the model's and back. "auto" is ``BiasAligner(method="scale")``, and
        ``BiasAligner("simulations")`` the paper's shift. A `~skthermo.preprocessing.BiasAligner` without a reference
        gets this model.
    imputer : transformer or "passthrough", default="passthrough"
        Fills gaps in temperatures and frequencies, given both side by side; used in `fit` only. Without one, missing
        temperatures are filled from the other sensors, a `PosteriorInverse` inverts rows with gaps from the modes that
        are there, and other inverses leave them out.
    discrepancy : "auto", regressor or None, default="auto"
        Learns the ratio of measured over modelled frequencies from the inputs of M2, mode by mode, because the FE model
        cannot follow all of the weather's effects. Changes of the ratio count as far as they hold for records left out.
        "auto" is a `TemperatureMapper`; None, as in the paper, none.
    reduce : "auto", bool or float, default="auto"
        Whether predictions, simulations and a `PosteriorInverse` use a reduced model, as its ``reduce`` says, which
        gets this value if its own is "auto" (:doc:`/guide/costs`). An `InverseSurrogate` learns from the full model.
        ``report_`` says which model solved.
    memory : str or joblib.Memory, optional
        Folder for the means of earlier temperatures that the records have and, unless the inverse has a memory of its
        own, for all that its ``memory`` stores.
    n_jobs : int, optional
        Number of parallel jobs when the model is solved for many rows.
    random_state : int, RandomState or None, default=None
        Seed of every part that has no seed of its own.
    verbose : bool or int, default=0
        Whether `fit` prints a line with the time of each of its stages.

    Attributes
    ----------
    inverse_, mapper_, aligner_, imputer_ : estimators
        Fitted clones; None without an imputer.
    parameters_ : DataFrame or ndarray of shape (n_samples, n_parameters)
        Multipliers that M1 found in the training data, eq. (5).
    noise_ : ndarray of shape (n_modes,)
        Relative standard deviation of the records about a regression on their weather, out of fold; an
        `InverseSurrogate` with ``noise="auto"`` takes it.
    discrepancy_ : callable
        ``discrepancy_(T)``, (n_samples, n_modes), is the logarithm of measured over modelled frequencies at
        temperatures T; 0 with ``discrepancy=None``.
    records_ : TrainingRecords
        The training records (``temperatures``, ``frequencies``), and what M2 learned from them.
    thermal_ : ThermalModel
        Mapper, simulator, aligner and discrepancy, which predict: ``thermal_.simulated(weather(T), modes)`` also gives
        modes that were not measured.
    recorder_ : RecordSimulator
        What draws noise, gaps and outliers as the training records have them (``noise``, ``gaps`` and ``service_of``).
        ``residuals`` of the records are out of fold and relative: measured frequency over the prediction, minus 1;
        ``residuals.expected(weather(T).inputs)`` is their mean in similar weather.
    report_ : FitReport
        Findings of `fit`: rows left out and why, offsets of modes, errors, and doubtful data.
    sensors_ : SensorRegression
        What each temperature sensor shows, given the others: fills missing temperatures.
    training_range_ : TrainingRange
        Lowest and highest value of each input of M2, lags included, in the training records.
    simulator_ : Simulator
        The model and, where it is reduced, its reduced model.
    parameter_names_, mode_names_ : list of str
        Columns of the parameters and of the frequencies.
    y_is_vector_ : bool
        Whether `fit` saw one mode as a vector.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of temperature columns and, where `fit` saw a frame with such, their names.

    Notes
    -----
    ``predict(T)`` is ``aligner_.inverse_transform(model.frequencies(predict_parameters(T))) * exp(discrepancy_(T))``,
    and simulations of damage have the same discrepancy, as Kennedy and O'Hagan [KOH01]_ separate the parameters of a
    calibrated model from it. Outliers train neither aligner nor M1; they stay in the records, so that ``recorder_``
    knows them. Without an imputer in `fit`, and later, a missing temperature is filled from the other sensors, also if
    the mapper would deal with it in another way. If temperatures are a frame, results are frames. A row that cannot be
    computed, such as one without any temperature, is NaN; no row is dropped.

    A mapper whose ``predict`` takes ``return_std``, such as ``TemperatureMapper(BayesianRidge())`` or a `FleetMapper`,
    makes standard deviations and intervals as wide as it is uncertain; errors of different parameters count as
    independent. See :doc:`/guide/records_theory` and :doc:`/guide/estimation`.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.metrics import mape
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year = make_truss_campaign(random_state=0)
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> later = make_truss_campaign(damage={"bottom": 0.5}, random_state=1)
    >>> damaged = fem.simulate(later.temperatures, damage={"bottom": 0.5})
    >>> bool(mape(later.clean_frequencies, damaged).max() < 0.6)
    True
    """

    _leaves_out_gaps = True
    _parameter_constraints: dict = {
        "model": [HasMethods(["frequencies"])],
        "inverse": [HasMethods(["fit", "transform"]), None],
        "mapper": [HasMethods(["fit", "predict"]), None],
        "aligner": [HasMethods(["fit", "transform", "inverse_transform"]), StrOptions({"auto", "passthrough"})],
        "imputer": [HasMethods(["fit_transform"]), StrOptions({"passthrough"})],
        "discrepancy": [HasMethods(["fit", "predict"]), StrOptions({"auto"}), None],
        "reduce": [StrOptions({"auto"}), "boolean", Interval(Real, 0, 1, closed="neither")],
        "memory": [str, HasMethods(["cache"]), None],
        "n_jobs": [Integral, None],
        "random_state": ["random_state"],
        "verbose": ["verbose"],
    }

    def __init__(
        self,
        model: FEModel,
        *,
        inverse: BaseEstimator | None = None,
        mapper: BaseEstimator | None = None,
        aligner: BaseEstimator | str = "auto",
        imputer: BaseEstimator | str = "passthrough",
        discrepancy: BaseEstimator | str | None = "auto",
        reduce: bool | float | Literal["auto"] = "auto",
        memory: str | Memory | None = None,
        n_jobs: int | None = None,
        random_state: int | np.random.RandomState | None = None,
        verbose: bool | int = 0,
    ):
        self.model = model
        self.inverse = inverse
        self.mapper = mapper
        self.aligner = aligner
        self.imputer = imputer
        self.discrepancy = discrepancy
        self.reduce = reduce
        self.memory = memory
        self.n_jobs = n_jobs
        self.random_state = random_state
        self.verbose = verbose

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(
        self, X: ArrayLike, y: ArrayLike, *, shapes: ArrayLike | None = None, sample_weight: ArrayLike | None = None
    ) -> DataInformedFEM:
        """Learn how temperature moves the parameters.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius; NaN is allowed, and filled from the other sensors. Sensors that
            are constant or missing throughout are left out, also of later records.
        y : array-like or DataFrame of shape (n_samples, n_modes)
            Measured frequencies of the healthy structure in Hz; NaN is allowed. With a model of one mode, it may be a
            series or a vector of shape (n_samples,); `predict` then gives vectors.
        shapes : array-like of shape (n_samples, n_modes, n_sensors), optional
            Measured mode shapes, real or complex, of any scale, sign and phase, NaN where a mode is missing; for an
            inverse with ``dofs``, whose order the sensors have.
        sample_weight : array-like of shape (n_samples,), optional
            Weight of each record in the fits of M2 and of the discrepancy; those of a series are matched to the rows of
            a frame by index. Their scale does not count. Records of weight 0 do not train them and have no residuals;
            imputer, aligner and M1 see all alike.

        Returns
        -------
        DataInformedFEM
            The fitted estimator.

        Raises
        ------
        ValueError
            If the records have gross errors, all of which are listed: tables of different rows, another number of modes
            than the model's, modes or all sensors that are constant or missing throughout, temperatures in kelvin,
            frequencies that are not positive or not in Hz, infinite values, or numbers that stand for a missing value;
            if shapes are given to an inverse without ``dofs``, or not given to one with ``dofs``; if weights are
            negative, NaN or infinite, all 0, not one for each row, or of no use to the mapper, whose ``fit`` takes
            none.

        Warns
        -----
        UserWarning
            One, with counts, for each kind of doubtful data in ``report_``, and for what
            `~skthermo.preprocessing.check_records` finds.
        """
        check_model(self.model)
        options = {"dtype": np.float64, "copy": True, "allow_infinite": True}
        T = frame_like(X, validate_data(self, X, ensure_min_samples=2, **options))
        F, self.y_is_vector_ = frequency_table(y)
        T, F, gate = usable_records(T, frame_like(F, check_array(F, **options)), self.model)
        far = gate.outliers.to_numpy()
        weights = row_weights(sample_weight, X)
        if weights is not None:
            weights = weights / weights[weights > 0].mean()  # penalties do not depend on their scale
        usable = frame_like(F, np.where(far, np.nan, as_floats(F)))  # outliers train nothing
        self.mode_names_, self.parameter_names_ = column_names(F, "f"), list(self.model.parameter_names)
        self._clone_parts(has_shapes=shapes is not None)
        inverse, mapper = self.inverse_, self.mapper_
        if weights is not None:
            check_takes_weights(mapper)
        stages = Stages(self, 5, X, y)
        with collected(), stages.stage("noise"):
            self.sensors_ = SensorRegression.fitted(T)
            filled, complete = frame_like(T, self.sensors_.fill(T)[0]), usable
            if self.imputer_ is not None:
                sensors = np.where(self.sensors_.learned, as_floats(T), 0.0)
                values = as_floats(self.imputer_.fit_transform(np.hstack([sensors, usable])))
                filled, complete, *_ = np.hsplit(values, np.cumsum([T.shape[1], usable.shape[1]]))
                filled, complete = frame_like(T, filled), frame_like(usable, complete)
            self.mapper_ = mapper = with_means(mapper, filled, usable)
            self.noise_ = measurement_noise(mapper, filled, usable)
        with collected() as findings, stages.stage("inverse", inverse):
            for part in parts_within(inverse, InverseSurrogate):
                if isinstance(part.noise, str):
                    part.set_params(noise=self.noise_)
            has_learned = learn_from_simulations(inverse, self.aligner_, complete)
            aligned = with_shapes(inverse, self.aligner_.fit(complete).transform(complete), shapes)
            if not has_learned:
                inverse.fit(aligned)
        with stages.stage("parameters of the records"):
            found = invert(inverse, aligned, self.parameter_names_)
            if shapes is not None:
                posterior: Any = last_step(inverse)
                findings += posterior.shape_inputs_.doubts(posterior.model, aligned, found.theta)
        with collected() as of_mapper, stages.stage("temperature mapper", mapper):
            index = filled.index if isinstance(filled, pd.DataFrame) else None
            targets = pd.DataFrame(found.theta, index, self.parameter_names_, copy=False)  # with the names of outputs
            try:
                fit_checked(mapper, filled, targets, weights)
            except ValueError as error:
                if get_tags(last_step(mapper)).target_tags.multi_output:
                    raise
                wanted = f"expected one of several, such as TemperatureMapper({last_step(mapper)!r:.100})"
                raise ValueError(f"the mapper may be a regressor of a single output ({error}); {wanted}") from error
        with collected(), stages.stage("discrepancy and report"):
            self._hold(self._recorder(T, F, filled, usable, found.theta, weights))
            findings += [*found.findings, *of_mapper]
            few_outliers = {"doubtful-values"} if far.mean() <= 0.05 else ()
            of_records = [
                *gate.warnings(exclude=few_outliers),
                *misplaced_columns(T, F),
                *doubts_of_order(self.model, F),
            ]
            self.report_ = report_of(self, found, gate, [*of_records, *findings])
        stages.end()
        warn_each(self.report_.doubts)
        return self

    @overload
    def estimate_parameters(self, F: pd.DataFrame, shapes: ArrayLike | None = None) -> pd.DataFrame: ...
    @overload
    def estimate_parameters(self, F: ArrayLike, shapes: ArrayLike | None = None) -> NDArray[np.float64]: ...
    def estimate_parameters(self, F: ArrayLike, shapes: ArrayLike | None = None) -> Table:
        """Parameters behind measured frequencies, equation (5).

        Parameters
        ----------
        F : array-like or DataFrame of shape (n_samples, n_modes)
            Measured frequencies in Hz; NaN is allowed.
        shapes : array-like of shape (n_samples, n_modes, n_sensors), optional
            Measured mode shapes, as in `fit`. Without them, an inverse with ``dofs`` estimates parameters from
            frequencies alone.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters; NaN in rows without any mode and, with an `InverseSurrogate`, where
            one is missing.

        Raises
        ------
        ValueError
            If the number or the names of the modes differ from `fit`, or a frequency is not positive.
        """
        check_is_fitted(self)
        measured = frame_like(F, check_array(F, dtype=np.float64))
        inputs = with_shapes(self.inverse_, self.aligner_.transform(measured), shapes)
        return frame_like(F, as_floats(self.inverse_.transform(inputs)), self.parameter_names_)

    @overload
    def predict_parameters(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def predict_parameters(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def predict_parameters(self, X: ArrayLike) -> Table:
        """Parameters at given temperatures, equation (7).

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters; with a warning, NaN where an input of M2 is missing, and where M2
            gives a physically impossible multiplier (less than 1e-6 or more than 1e6).

        Warns
        -----
        UserWarning
            If temperatures were filled, rows cannot be predicted or are in weather far outside the training range, or a
            sensor departs from the other sensors' predictions; `predict`, `predict_interval` and `simulate` warn of the
            same.
        """
        with collected() as findings:
            weather = self.weather(X)
        warn_each(findings + self.thermal_.doubts(weather))
        return frame_like(X, weather.theta, self.parameter_names_)

    @overload
    def predict(self, X: pd.DataFrame, return_std: Literal[False] = False) -> pd.DataFrame: ...
    @overload
    def predict(self, X: pd.DataFrame, return_std: Literal[True]) -> tuple[pd.DataFrame, pd.DataFrame]: ...
    @overload
    def predict(self, X: ArrayLike, return_std: Literal[False] = False) -> NDArray[np.float64]: ...
    @overload
    def predict(self, X: ArrayLike, return_std: Literal[True]) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    @overload
    def predict(self, X: ArrayLike, return_std: bool) -> Any: ...
    def predict(self, X: ArrayLike, return_std: bool = False) -> Table | tuple[Table, Table]:
        """Frequencies of the healthy structure at given temperatures.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        return_std : bool, default=False
            Whether to return standard deviations too.

        Returns
        -------
        frequencies : ndarray or DataFrame of shape (n_samples, n_modes)
            In Hz, in the measured domain. A vector if `fit` saw one mode as a vector, and so are the standard
            deviations.
        std : ndarray or DataFrame of shape (n_samples, n_modes)
            Only with ``return_std``: root mean square differences between measured and predicted frequencies in similar
            weather, out of fold, in Hz. They contain the scatter of the measurement, what a missing temperature costs,
            and the standard deviations of the mapper, if it states some.
        """
        has_std = check_flag(return_std, "return_std")
        frequencies, deviations = self._predicted(X, has_margins=has_std)
        predicted = self._as_targets(X, frequencies)
        return (predicted, self._as_targets(X, frequencies * deviations)) if has_std else predicted

    @overload
    def predict_interval(self, X: pd.DataFrame, confidence: float = 0.9) -> tuple[pd.DataFrame, pd.DataFrame]: ...
    @overload
    def predict_interval(self, X: ArrayLike, confidence: float = 0.9) -> tuple[Array, Array]: ...
    def predict_interval(self, X: ArrayLike, confidence: float = 0.9) -> tuple[Any, Any]:
        """Intervals that hold the measured frequencies with a given probability, mode by mode.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        confidence : float, default=0.9
            Probability, between 0 and 1.

        Returns
        -------
        lowest : ndarray or DataFrame of shape (n_samples, n_modes)
            In Hz, in the measured domain, and a vector where `predict` gives one; 0 if there are too few records.
        highest : ndarray or DataFrame of shape (n_samples, n_modes)
            Likewise; infinite if there are too few.

        Raises
        ------
        ValueError
            If the confidence is not between 0 and 1.

        Notes
        -----
        Split-conformal intervals [LGR18]_ from ``recorder_.residuals``, in multiples of their spread in similar weather
        (:ref:`intervals-of-predictions`). If new records are exchangeable with the training records, an interval holds
        a mode with about the probability asked; the share of a short period varies more, because records are serially
        correlated. Beyond the training range, and where a temperature was filled, it is wider.

        Examples
        --------
        >>> from skthermo.datasets import make_truss, make_truss_campaign
        >>> from skthermo.surrogate import DataInformedFEM
        >>> year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
        >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
        >>> lowest, highest = fem.predict_interval(later.temperatures)
        >>> held = (later.frequencies > lowest) & (later.frequencies < highest)
        >>> bool(0.85 < held.to_numpy().mean() < 0.95)
        True
        """
        if not is_real(confidence) or not 0 < confidence < 1:
            raise ValueError(f"confidence is {confidence!r}; expected a probability between 0 and 1, such as 0.9")
        frequencies, margins = self._predicted(X, confidence)
        lowest = frequencies * np.maximum(1 - margins, 0.0)
        return self._as_targets(X, lowest), self._as_targets(X, frequencies * (1 + margins))

    def _predicted(
        self, X: ArrayLike, confidence: float | None = None, *, has_margins: bool = True
    ) -> tuple[Array, Array]:
        """Frequencies with relative margins of a confidence, by default of a standard deviation; or 0 without."""
        margins = np.zeros(1)
        with collected() as findings:
            weather, thermal = self.weather(X), self.thermal_
            frequencies = thermal.simulated(weather)
            if has_margins:
                residuals, scatter, known = self.recorder_.residuals, 1.0, 1.0
                if confidence is not None:
                    scatter, known = residuals.quantiles(confidence), norm.ppf((1 + confidence) / 2)
                spread = residuals.spread(weather.inputs)
                margins = np.hypot(scatter * spread, known * thermal.known_deviations(weather))
                findings += residuals.findings
        warn_each(findings + thermal.doubts(weather))
        return frequencies, margins

    @overload
    def simulate(self, X: pd.DataFrame, **options: Any) -> pd.DataFrame: ...
    @overload
    def simulate(self, X: ArrayLike, **options: Any) -> Array: ...
    def simulate(
        self,
        X: ArrayLike,
        *,
        damage: Mapping[str, float | ArrayLike] | None = None,
        kind: LossKind = "stiffness",
        parameters: Mapping[str, float] | None = None,
        stiffness: MatrixLike | None = None,
        mass: MatrixLike | None = None,
        noise: ArrayLike | Literal["fitted"] = 0.0,
        gaps: float | Literal["fitted"] | None = None,
        outliers: ArrayLike | Literal["fitted"] | None = None,
        random_state: int | np.random.RandomState | None = None,
    ) -> Array | pd.DataFrame:
        """Frequencies of the structure, healthy or damaged, as monitoring would record them, equation (8).

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        damage : mapping of str to float or array-like of shape (n_samples,), optional
            Severity by damage group of the model: 0.5 halves the stiffness, -0.15 adds 15 %. A vector gives each row
            its own severity, for damage that grows.
        kind : {"stiffness", "section"}, default="stiffness"
            What damage takes: stiffness alone or, with cross-section, mass too, as `~skthermo.fem.AffineModel.damaged`
            has it.
        parameters : mapping of str to float, optional
            Factor by parameter of the model, which multiplies the values that belong to the temperatures.
        stiffness : matrix of shape (n_dof, n_dof), optional
            Stiffness added to the model's in N/m, as by a retrofit.
        mass : matrix of shape (n_dof, n_dof) or array-like of shape (n_dof,), optional
            Mass added to the model's in kg; a vector holds lumped masses.
        noise : float, array-like of shape (n_modes,) or "fitted", default=0.0
            Relative standard deviation of Gaussian noise on the frequencies. With "fitted", each row gets the
            out-of-fold residuals of a whole training record of similar weather, with the modes that are missing there,
            in runs as long as residuals are correlated (:doc:`/guide/records_theory`). Rows should be in order of time.
        gaps : float or "fitted", optional
            Values that are missing: with "fitted", modes and whole records as often, together, and for as long as in
            the training records; a number is the share of the values, each by itself. By default, modes are missing
            with ``noise="fitted"`` only, as in the record that the noise of a row is of.
        outliers : float, "fitted" or array-like of shape (n_training_records, n_modes), optional
            Values that are far off: with "fitted", the outliers of the training records, in the same modes together,
            and for as many records; a number is the share of the values whose noise is ten times as large. If the
            training records were cleaned, give the frequencies before that: what cleaning has changed or removed comes
            back. By default they come with ``noise="fitted"`` only, one record at a time.
        random_state : int, RandomState or None, default=None
            Seed of the noise.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_modes)
            In Hz, in the measured domain.

        Raises
        ------
        ValueError
            If a damage group or a parameter is unknown, a severity is 1 or more, a factor is not positive, or the model
            cannot be changed in this way, or does not know the mass of a group; if gaps or outliers are no shares.

        Warns
        -----
        UserWarning
            If a factor is above 10, which may be meant in percent.
        """
        changes = {"damage": damage, "kind": kind, "parameters": parameters, "stiffness": stiffness, "mass": mass}
        with collected() as findings:
            weather = self.weather(X)
            frequencies = self.thermal_.simulated(weather, **changes)
            frequencies *= 1 + self.recorder_.noise(weather, noise, gaps, outliers, random_state)
            if isinstance(noise, str):
                findings += self.recorder_.residuals.findings
        warn_each(findings + self.thermal_.doubts(weather) + doubts_of_factors(parameters))
        return frame_like(X, frequencies, self.mode_names_)

    def weather(self, X: ArrayLike) -> Weather:
        """Temperatures, checked and filled, as ``thermal_`` and ``recorder_`` take them.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.

        Returns
        -------
        Weather
            With the temperatures that are ``given`` and ``filled`` from the other sensors, the ``inputs`` of M2, and
            its parameters ``theta``.
        """
        check_is_fitted(self)
        return self.thermal_.weather(X, validate_data(self, X, dtype=np.float64, reset=False))

    def damage_directions(self, groups: Sequence[str] | None = None, *, kind: LossKind | None = None) -> pd.DataFrame:
        """Relative change of each frequency per loss of each damage group, for small losses.

        Parameters
        ----------
        groups : sequence of str, optional
            Damage groups. By default all but those that other groups make up.
        kind : {"stiffness", "section"}, optional
            What is lost. By default stiffness and, of the groups whose mass the model knows, section.

        Returns
        -------
        DataFrame of shape (n_directions, n_modes)
            Derivatives of ln f by the severity at the mean of the learned parameters, in the measured domain, with the
            names of the modes. Rows are named as in `~skthermo.fem.AffineModel.damage_directions`; losses that move no
            frequency are left out.

        Raises
        ------
        ValueError
            If a group is unknown, none moves a frequency, or the mass of a group is not known.
        """
        check_is_fitted(self)
        theta = np.nanmean(as_floats(self.parameters_), axis=0, keepdims=True)
        directions = damage_directions(self.model, groups, kind, theta)
        return (directions * self.thermal_.elasticity(theta)[0]).set_axis(self.mode_names_, axis=1)

    def extrapolation_distance(self, X: ArrayLike) -> pd.DataFrame:
        """How far the inputs of M2 are outside the training range, row by row.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.

        Returns
        -------
        DataFrame
            With X's index. A column for each input of M2, lags included: its distance outside the range of the training
            rows, divided by that range (0 inside).
        """
        weather = self.weather(X)
        excess, index = self.training_range_.excess(weather.inputs), X.index if isinstance(X, pd.DataFrame) else None
        return pd.DataFrame(excess, index, self.training_range_.names)

    def score(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> float:
        """Coefficient of determination R2 over complete rows, averaged over modes.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        y : array-like or DataFrame of shape (n_samples, n_modes)
            Measured frequencies in Hz; of one mode, also a vector.
        sample_weight : array-like of shape (n_samples,), optional
            Weight of each record; weights in a series are matched to the rows of a frame by index.

        Returns
        -------
        float
            NaN if fewer than two rows are complete. There is a warning if fewer than half of the rows are scored;
            `~skthermo.metrics.frequency_scorer` reports their share.
        """
        predicted = self.predict(X)
        score = complete_r2(y, predicted, row_weights(sample_weight, X))
        scored = int((~np.isnan(as_columns(y) + as_columns(predicted)).any(axis=1)).sum())
        if 2 * scored < len(predicted):
            text = "the score leaves out most rows, which have gaps. Compare scores of the same rows only"
            warn_each([UnevaluatedRowsWarning(text, "not-evaluated")])
        return score

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        tags.target_tags.single_output = getattr(self.model, "n_modes", None) == 1
        return tags

    def _default_part(self, name: str) -> BaseEstimator | None:
        defaults = {
            "inverse": PosteriorInverse(reduce=self.reduce, n_jobs=self.n_jobs),
            "mapper": TemperatureMapper(),
            "aligner": BiasAligner(method="scale"),
            "discrepancy": None if self.discrepancy is None else ratio_regressor(),
        }
        return defaults.get(name)

    def _part(self, name: str) -> Any:
        """A clone of a part, or the default part."""
        part = getattr(self, name)
        return self._default_part(name) if part is None or is_auto(part) else clone(part)

    def _clone_parts(self, *, has_shapes: bool) -> None:
        """Clone inverse, mapper, aligner and imputer, with model, memory, choice of a reduced model, and seeds."""
        tolerance(self.model, self.reduce)
        self.inverse_, self.mapper_ = self._part("inverse"), self._part("mapper")
        self.aligner_ = FunctionTransformer().set_output(transform="default")  # frequencies stay as they are
        if self.aligner != "passthrough":
            self.aligner_ = self._part("aligner")
        for aligner in parts_within(self.aligner_, BiasAligner):
            if aligner.reference is None:
                aligner.set_params(reference=self.model)
        self.imputer_ = None if self.imputer == "passthrough" else clone(self.imputer)
        names = list(self.model.parameter_names)
        for part in parts_within(self.inverse_, FrequencyInverse):
            given = {"model": self.model, "memory": self.memory}
            part.set_params(**{name: value for name, value in given.items() if getattr(part, name) is None})
            if list(part.model.parameter_names) != names:
                raise ValueError(
                    f"the inverse's model has the parameters {list(part.model.parameter_names)}; expected {names}, as "
                    f"{self.model!r} has"
                )
            may_reduce = isinstance(part, PosteriorInverse) and is_auto(part.reduce)
            if may_reduce and (not self.reduce or hasattr(part.model, "reduced")):
                part.set_params(reduce=self.reduce)
        if not has_shapes and getattr(last_step(self.inverse_), "dofs", None) is not None:
            raise ValueError("the inverse has dofs, but there are no shapes; expected fit(T, F, shapes=shapes)")
        random_state = seeded(self.random_state)
        for part in (self.inverse_, self.mapper_, self.aligner_, self.imputer_):
            if part is not None:
                seed_parts(part, random_state)

    def _recorder(
        self, T: Table, F: Table, filled: Table, usable: Table, theta: Array, weights: Array | None
    ) -> RecordSimulator:
        """What predicts and draws records, once the mapper has learned theta."""
        inputs = inputs_of_last_step(self.mapper_, filled)
        predicted, posterior = as_columns(self.mapper_.predict(filled)), last_step(self.inverse_)
        if predicted.shape != theta.shape or not np.isfinite(predicted).all(axis=1).any():
            raise ValueError(
                f"the mapper predicts {np.isfinite(predicted).all(axis=1).sum()} finite rows in a table of the shape "
                f"{predicted.shape}; expected parameters of the shape {theta.shape}: has it diverged?"
            )
        learned = possible(predicted)[0]
        is_shared = isinstance(posterior, PosteriorInverse) and posterior.model is self.model
        simulator = Simulator.around(self.model, learned, self.reduce, posterior.simulator_ if is_shared else None)
        modelled = as_floats(self.aligner_.inverse_transform(simulator.frequencies(learned, self.n_jobs)))
        records = TrainingRecords(
            T, F, as_floats(inputs), theta, learned, as_floats(usable), modelled, weights, self.parameter_names_
        )
        parts, order = {"sensors": self.sensors_, "mapper": self.mapper_}, np.argsort(row_times(T), kind="stable")
        ratios, own = (records.usable / modelled)[order], None if weights is None else weights[order]
        thermal = ThermalModel(
            simulator=simulator,
            aligner=self.aligner_,
            discrepancy=Discrepancy.fitted(self._part("discrepancy"), records.inputs[order], ratios, own, **parts),
            training_range=TrainingRange.spanned(inputs, records.trained),
            limits=limits_in_weather(theta),
            parameter_names=self.parameter_names_,
            mode_names=self.mode_names_,
            n_jobs=self.n_jobs,
            **parts,
        )
        return RecordSimulator(thermal, records)

    def _hold(self, recorder: RecordSimulator) -> Self:
        """Hold what was learned, and its parts by the names that users know."""
        thermal, records = recorder.model, recorder.records
        self.thermal_, self.recorder_, self.records_ = thermal, recorder, records
        self.mapper_, self.aligner_, self.simulator_ = thermal.mapper, thermal.aligner, thermal.simulator
        self.discrepancy_, self.training_range_ = thermal.discrepancy, thermal.training_range
        self.parameters_ = frame_like(records.temperatures, records.targets, self.parameter_names_)
        return self

    def _as_targets(self, X: Table, frequencies: Array) -> Any:
        """Frequencies as a vector if the training frequencies were one, else as a table like X."""
        return like_targets(X, frequencies, self.mode_names_, is_vector=self.y_is_vector_)


def learn_from_simulations(inverse: Any, aligner: BaseEstimator, F: Table) -> bool:
    """Whether an aligner asks for simulations; if so, the inverse has learned from them, and it has their means."""
    asking = [part for part in parts_within(aligner, BiasAligner) if isinstance(part.reference, str)]
    if asking and not isinstance(inverse, InverseSurrogate):
        raise ValueError(
            f"the aligner's reference is 'simulations', but {inverse!r:.100} has none; expected an InverseSurrogate"
        )
    if asking:
        inverse.fit(F)  # whose columns are all that it takes from F
    for part in asking:
        part.set_params(reference=inverse.samples_.frequencies.mean(axis=0))
    return bool(asking)


def parts_within(estimator: BaseEstimator, kind: type) -> list[Any]:
    """Estimators of a kind: this one, and parts of it."""
    return [one for one in (estimator, *estimator.get_params().values()) if isinstance(one, kind)]


def invert(inverse: BaseEstimator, aligned: Table, names: list[str]) -> Bunch:
    """``theta`` of aligned records and ``findings`` and, of a `PosteriorInverse`, all that its ``invert`` gives."""
    last = last_step(inverse)
    if not isinstance(last, PosteriorInverse):
        with collected() as findings:
            theta = as_floats(inverse.transform(aligned))
        if theta.shape[1] != len(names):
            raise ValueError(f"the inverse gave {theta.shape[1]} columns; expected {names}")
        return Bunch(theta=theta, findings=findings)
    found = last.invert(inputs_of_last_step(inverse, aligned))
    known = found.weight[found.weight > 0]
    if len(known) and known.mean() < 0.25:  # with four of six modes missing in each, say
        found.findings.append(few_rows("because of gaps, they tell less than a quarter of what complete ones would"))
    return Bunch(**{**found, "theta": as_floats(found.theta)})


def with_shapes(inverse: BaseEstimator, F: Table, shapes: ArrayLike | None) -> Table:
    """Frequencies with the columns of shapes that the inverse expects; NaN there without shapes."""
    part: Any = last_step(inverse)
    if getattr(part, "dofs", None) is not None:
        return ShapeInputs.read(part.model, part.dofs, part.shape_noise).joined(F, shapes)
    if shapes is not None:
        raise ValueError("shapes are given, but the inverse has no dofs; expected PosteriorInverse(dofs=...)")
    return F


def refitted(
    fem: DataInformedFEM,
    X: ArrayLike | None = None,
    y: ArrayLike | None = None,
    *,
    model: FEModel | None = None,
    random_state: int = 0,
) -> DataInformedFEM:
    """A chain of the same parts that has learned other records, or has another FE model.

    Parameters
    ----------
    fem : DataInformedFEM
        Fitted; it is unchanged.
    X : array-like or DataFrame of shape (n_samples, n_sensors), optional
        Temperatures in degrees Celsius; by default as in `DataInformedFEM.fit`.
    y : array-like or DataFrame of shape (n_samples, n_modes), optional
        Frequencies in Hz; by default as in `DataInformedFEM.fit`.
    model : FE model, optional
        With the parameters, damage groups and modes of the chain's, such as
        `~skthermo.updating.ModelUpdater.sample_models` gives; by default the same.
    random_state : int, default=0
        Seed of every part that has no seed of its own.

    Returns
    -------
    DataInformedFEM
        A fitted one.

    Notes
    -----
    Prior and noise are learned anew. A `PosteriorInverse` sees frequencies alone, also where the chain was fitted to
    shapes. Records whose weight was 0 are left out, and other weights are 1.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.surrogate import DataInformedFEM, refitted
    >>> year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> other = refitted(fem, later.temperatures, later.frequencies)
    >>> bool(abs(other.predict(year.temperatures) / fem.predict(year.temperatures) - 1).max().max() < 0.02)
    True
    """
    check_is_fitted(fem)
    records = fem.records_
    T, F, counted = records.temperatures, records.frequencies, records.counted
    chain = clone(fem)
    models = {name: model for name, part in chain.get_params().items() if part is fem.model}
    chain.set_params(**({} if model is None else models), random_state=random_state, verbose=0, memory=None)
    if isinstance(fem.inverse_, PosteriorInverse):
        chain.set_params(inverse__dofs=None, inverse__memory=None)  # others than its own are hardly asked for again
    weights = None if counted.all() or X is not None else counted.astype(float)
    if fem.y_is_vector_:
        F = F.squeeze(axis=1)
    return chain.fit(T if X is None else X, F if y is None else y, sample_weight=weights)


def resampled(fem: DataInformedFEM, random_state: int | np.random.RandomState | None = None) -> DataInformedFEM:
    """A chain that has learned other records, as its structure could have given them in the training weather.

    Such chains differ from this one as it differs from the structure, if its model is right.

    Parameters
    ----------
    fem : DataInformedFEM
        Fitted; it is unchanged.
    random_state : int, RandomState or None, default=None
        Seed of the records.

    Returns
    -------
    DataInformedFEM
        With a temperature mapper, a discrepancy, ``records_``, ``parameters_`` and fitted noise of its own; all else,
        such as ``report_``, is the chain's.

    Notes
    -----
    A bootstrap of pairs of temperatures and parameters: the mapper and the discrepancy learn the records of weeks that
    are drawn with replacement. Nothing is inverted.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.surrogate import DataInformedFEM, resampled
    >>> year = make_truss_campaign(random_state=0)
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> other = resampled(fem, random_state=1)
    >>> bool(abs(other.predict(year.temperatures) / fem.predict(year.temperatures) - 1).max().max() < 0.02)
    True
    """
    check_is_fitted(fem)
    records, random = fem.records_, as_random_state(random_state)
    filled = frame_like(records.temperatures, fem.sensors_.fill(as_floats(records.temperatures))[0])
    stamped = has_stamps(records.temperatures)
    weeks = row_times(filled) // (7 * DAY_NS) if stamped else np.arange(len(filled)) * 52 // len(filled)
    of_week = [rows[records.trained[rows]] for rows in (np.flatnonzero(weeks == week) for week in np.unique(weeks))]
    rows = np.concatenate([of_week[week] for week in random.randint(len(of_week), size=len(of_week))])
    weights = None if records.weights is None else records.weights[rows]
    with collected():
        seen, inputs = inputs_of_last_step(fem.mapper_, filled), records.inputs[rows]
        if isinstance(seen, pd.DataFrame):
            inputs = pd.DataFrame(inputs, columns=seen.columns)
        targets = pd.DataFrame(records.targets[rows], columns=fem.parameter_names_)
        mapper = with_last_step(fem.mapper_, fit_checked(clone(last_step(fem.mapper_)), inputs, targets, weights))
        learned = possible(mapper.predict(filled))[0]
        modelled = fem.thermal_.frequencies(learned)
        known = records.usable[rows] / modelled[rows]
        parts = {"shares": fem.discrepancy_.shares, "sensors": fem.sensors_, "mapper": mapper}
        discrepancy = Discrepancy.fitted(fem.discrepancy_.regressor, records.inputs[rows], known, weights, **parts)
    thermal = replace(fem.thermal_, mapper=mapper, discrepancy=discrepancy)
    records = replace(records, learned=learned, modelled=modelled)
    return copy(fem)._hold(RecordSimulator(thermal, records, fem.recorder_.service))


def with_last_step(mapper: BaseEstimator, fitted: BaseEstimator) -> BaseEstimator:
    """A fitted pipeline that ends with another fitted estimator; what is no pipeline is that estimator itself."""
    if not isinstance(mapper, Pipeline):
        return fitted
    name, last = mapper.steps[-1]
    return Pipeline([*mapper.steps[:-1], (name, with_last_step(last, fitted))])


def with_model(fem: DataInformedFEM, model: FEModel) -> DataInformedFEM:
    """A fitted chain with another model of the same frequencies, such as one with divided damage groups.

    Parameters
    ----------
    fem : DataInformedFEM
        Fitted; it is unchanged.
    model : FE model
        With the parameters and modes of the chain's. It is not reduced.

    Returns
    -------
    DataInformedFEM
        All that was learned is the chain's, and so are the records.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.surrogate import DataInformedFEM, with_model
    >>> year, truss = make_truss_campaign(random_state=0), make_truss()
    >>> fem = DataInformedFEM(truss, random_state=0).fit(year.temperatures, year.frequencies)
    >>> damaged = with_model(fem, truss.damaged({"bottom": 0.1})).predict(year.temperatures)
    >>> bool((damaged < fem.predict(year.temperatures)).all().all())
    True
    """
    check_is_fitted(fem)
    twin, simulator = copy(fem), replace(fem.simulator_, model=model, reduced=None, box=None, usual=None)
    twin.model, twin.simulator_, twin.thermal_ = model, simulator, replace(fem.thermal_, simulator=simulator)
    return twin
