"""Removes the effect of temperature from frequencies by regression, on records with missing values, too."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, overload

import numpy as np
import pandas as pd
import scipy.sparse
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.compose import ColumnTransformer, TransformedTargetRegressor
from sklearn.model_selection import BaseCrossValidator, cross_val_predict
from sklearn.multioutput import MultiOutputRegressor
from sklearn.pipeline import FeatureUnion, Pipeline
from sklearn.utils import get_tags

from skthermo._core.answers import answer_once
from skthermo._core.arrays import Array, as_columns, as_floats, is_model, means_of_known
from skthermo._core.estimators import (
    BaseSearchCV,
    Estimator,
    HasMethods,
    StrOptions,
    TransformerMixin,
    _BaseImputer,
    _check_feature_names_in,
    _fit_context,
    check_is_fitted,
    fit_outputs,
    last_step,
    offers,
    predicted_covariance,
    reach_of,
    rows_from_fleet,
    validate_data,
    warn_of_fleet,
)
from skthermo._core.frames import (
    column_names,
    frame_like,
    has_stamps,
    positions_of,
    warn_of_markers,
)
from skthermo._core.origins import Changes, Origin, with_origin
from skthermo._core.warnings import (
    explain_rows,
    explained_rows,
    findings_of,
    reported_by_caller,
    warn_each,
    warn_user,
    warnings_once,
    without_warnings,
)
from skthermo.detection._base import mean_log_density
from skthermo.exceptions import FewRecordsWarning, RecordsWarning, UnevaluatedRowsWarning
from skthermo.preprocessing import RecordFindings, check_records, set_aside
from skthermo.residuals.folds import Folds
from skthermo.residuals.spread import FEWEST, Extrapolation, Spread, rows_near_in_time
from skthermo.residuals.weather import (
    BEYOND,
    NO_ERRORS,
    PredictionError,
    SensorRegression,
    TrainingRange,
    filled_text,
    implausible,
    misplaced_columns,
    unpredicted_text,
    unseen_weather,
)

AS_FLOATS = {"order": "C", "dtype": np.float64}
REPORTED = (
    "filled-temperatures",
    "implausible-temperatures",
    "not-predicted",
    "outside-training-weather",
    "sensor-disagrees",
    "rows-from-fleet",
)  # kinds of warnings that the compensator gives


class TemperatureCompensator(TransformerMixin, Estimator):
    """Residuals of frequencies: measured minus predicted from temperatures.

    Parameters
    ----------
    estimator : regressor
        Predicts the targets from all other columns: any of scikit-learn's regressors (one that takes a single target is
        fitted once for each), a pipeline with ``LagFeatures``, or `~skthermo.surrogate.DataInformedFEM`.
    targets : sequence of str or sequence of int
        Names of the frequency columns in a frame, or their positions counted from 0.
    cv : "contiguous", int, cross-validation splitter or iterable, default=None
        Folds by which the baseline is predicted:

        - ``None``: blocks of a week (without stamps, of a 52nd of the rows), dealt in turn to five folds, so that each
          fold sees each season. Blocks are longer where five correlation times of the residuals are.
        - ``"contiguous"``: five periods of time, each predicted from the others. An int gives that many.
        - A splitter, or pairs of training and test rows: every row must be in exactly one test fold, or all but the
          first rows, as with ``TimeSeriesSplit``: the residuals of those are NaN.
    whiten : {"auto", "global", "local", None}, default="auto"
        By which covariance residuals are whitened, so that they are in standard deviations and uncorrelated:

        - ``"auto"``: the one in similar weather, so that frost that makes residuals scatter does not hide damage on
          warm days. Where the baseline has no similar weather, it is no smaller than that of all weather.
        - ``"global"``: that of all weather.
        - ``"local"``: the one in the most similar weather, however different that is.
        - ``None``: none; residuals are in Hz.

    Attributes
    ----------
    estimator_, regression_ : regressor
        Clone of ``estimator``, fitted on all rows that it can take: alone, and with what rows with gaps need.
    folds_ : ndarray of int
        The fold of each row of the baseline, -1 where no fold tests it.
    block_ : timedelta64, int or None
        Length of the blocks that are dealt to the folds, as a time or in rows; None with other folds.
    sensors_ : object
        What each of the other columns shows, given any others: ``sensors_.fill(T)`` and ``sensors_.departures(T)``.
    spread_ : object
        Covariance of the residuals, by weather with "auto" and "local". ``spread_.smoothing`` says over how many
        records it is taken (None: all), ``spread_.deviations(T)`` gives standard deviations in Hz.
    training_range_ : object
        Lowest and highest values of the other columns.
    levels_ : ndarray of shape (n_targets,)
        Means of the targets, in Hz: a residual changes by them for a relative change of 1.
    targets_ : ndarray of int
        Positions of the targets.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of columns, targets included, and, where `fit` saw a frame with such, their names.

    See Also
    --------
    MahalanobisDetector : Raises alarms on the residuals.
    OutlierDetector : The same with any of scikit-learn's outlier detectors.

    Notes
    -----
    ``fit_transform(X)`` differs from ``fit(X).transform(X)`` by design: it predicts each row of the baseline by a clone
    fitted on the other folds, because residuals of rows that a regressor was fitted on are smaller than those of new
    records. In a pipeline, a detector that follows gets these out-of-fold residuals in its own ``fit``. Rows should be
    in order of time.

    A missing temperature is filled from the other sensors of its row. A missing target makes only its own residual NaN.
    A row with a value that is still missing, such as a lag that finds no record, is used if the estimator accepts NaN;
    otherwise it does not train, and its residuals are NaN.

    An estimator may state how uncertain its predictions are by a method ``predict_covariance(X)``, (n_samples,
    n_targets, n_targets) in Hz squared; residuals then count less by that uncertainty. :doc:`/guide/detectors_theory`
    says this, the whitening, the folds and what is added outside the baseline's weather in full.

    Examples
    --------
    >>> from sklearn.neighbors import KNeighborsRegressor
    >>> from sklearn.pipeline import make_pipeline
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector, TemperatureCompensator
    >>> healthy, later = (make_truss_campaign(2, random_state=seed) for seed in (0, 1))
    >>> baseline = healthy.temperatures.join(healthy.frequencies)
    >>> second_year = later.temperatures.join(later.frequencies)
    >>> compensator = TemperatureCompensator(KNeighborsRegressor(), targets=list(healthy.frequencies))
    >>> detector = make_pipeline(compensator, MahalanobisDetector()).fit(baseline)
    >>> print(f"{(detector.predict(second_year) == -1).mean():.0%} false alarms")
    2% false alarms

    A threshold set on residuals of rows that the regressor was fitted on is too low:

    >>> in_sample = MahalanobisDetector().fit(compensator.fit(baseline).transform(baseline))
    >>> print(f"{(in_sample.predict(compensator.transform(second_year)) == -1).mean():.0%} false alarms")
    14% false alarms
    """

    _parameter_constraints: dict = {
        "estimator": [HasMethods(["fit", "predict"])],
        "targets": "no_validation",
        "cv": ["cv_object", StrOptions({"contiguous"})],
        "whiten": [StrOptions({"auto", "global", "local"}), None],
    }

    def __init__(
        self,
        estimator: BaseEstimator,
        *,
        targets: Sequence[Hashable],
        cv: int | BaseCrossValidator | Iterable | Literal["contiguous"] | None = None,
        whiten: Literal["auto", "global", "local"] | None = "auto",
    ):
        self.estimator = estimator
        self.targets = targets
        self.cv = cv
        self.whiten = whiten

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: ArrayLike, y: None = None) -> TemperatureCompensator:
        """Fit the regression of the targets on the other columns.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures in degrees Celsius and frequencies in Hz of the healthy structure, side by side.
        y : None
            Ignored.

        Returns
        -------
        TemperatureCompensator
            The fitted transformer.

        Raises
        ------
        ValueError
            If a target is not among the columns or is named twice; if the targets are all of the columns or none; if a
            target is NaN in every row, or in every row that the estimator can learn from; if the residuals that are to
            be whitened have a singular covariance; if there are fewer rows than folds, or ``cv`` does not test every
            row exactly once.

        Warns
        -----
        UserWarning
            If another column looks like kelvin; if there are numbers that stand for a missing value, such as -999; for
            each kind of fault that `~skthermo.preprocessing.check_records` finds; if another column behaves like the
            targets, as a mode that was left out of them does, or a target like a temperature; if stamps are not in
            order; if
            temperatures are missing, with what they were filled with; if a fold has weather that the others do not
            know; if rows without stamps have lags inside an estimator.
        """
        self._learn(*self._read_baseline(X))
        return self

    @overload
    def fit_transform(self, X: pd.DataFrame, y: None = None) -> pd.DataFrame: ...
    @overload
    def fit_transform(self, X: ArrayLike, y: None = None) -> NDArray[np.float64]: ...
    @_fit_context(prefer_skip_nested_validation=False)
    def fit_transform(self, X: ArrayLike, y: None = None) -> NDArray[np.float64] | pd.DataFrame:
        """Fit on all rows of a baseline, and give its out-of-fold residuals; errors and warnings are those of `fit`.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures in degrees Celsius and frequencies in Hz of the healthy structure, side by side.
        y : None
            Ignored.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_targets)
            In Hz, or dimensionless if whitened; each row predicted by a clone that was not fitted on its fold.
        """
        temperatures, frequencies, findings = self._read_baseline(X)
        residuals, errors = self._learn(temperatures, frequencies, findings)
        weather = self.sensors_.fill(as_floats(temperatures))[0]
        changes = partial(self._changes, weather, ~np.isnan(residuals), errors)
        return frame_like(frequencies, with_origin(residuals, Origin(partial(np.zeros, len(residuals)), changes)))

    @overload
    def transform(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def transform(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Residuals of new records.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures and frequencies, in the columns of `fit`.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_targets)
            Measured minus predicted, in Hz, or dimensionless if whitened. Too small for the rows of `fit`: use
            `fit_transform`.

        Raises
        ------
        ValueError
            If columns differ from `fit`, or the estimator predicts another number of targets.

        Warns
        -----
        UserWarning
            As in `fit`; if temperatures are far outside those of `fit`; if a sensor departs from what the others
            predict, as one that drifts or is stuck does; if lags find no record in most rows.
        """
        frequencies, weather, residuals, errors, unknown = self._residuals(X)
        if self.whiten is None:
            scaled = self.spread_.shrunk(residuals, errors)
            volumes = partial(self._log_volumes_shrunk, weather, residuals, errors)
        else:
            scaled = self.spread_.whiten(weather, residuals, errors)
            volumes = partial(self.spread_.log_volumes, weather, residuals, errors)
        origin = Origin(volumes, partial(self._changes, weather, ~np.isnan(scaled), errors))
        return explain_rows(frame_like(frequencies, with_origin(scaled, origin)), unknown)

    def score(self, X: ArrayLike, y: None = None) -> float:
        """Mean log-likelihood of healthy records that `fit` has not seen, per value.

        The distribution is the normal one with the mean and the covariance of the baseline's out-of-fold residuals,
        with "auto" and "local" the covariance in similar weather. It is wider where predictions are uncertain.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures and frequencies of the healthy structure, in the columns of `fit`.
        y : None
            Ignored.

        Returns
        -------
        float
            Natural logarithm of a density per Hz, averaged over the targets that are there: higher is better, and a
            residual twice as small gains 0.69. Settings of all parameters, ``whiten`` included, can be compared. NaN if
            no row has a residual; a warning counts the rows scored if they are fewer than half.
        """
        _, weather, residuals, errors, _ = self._residuals(X)
        residuals = self._with_spread(residuals)
        white, present = self.spread_.whiten(weather, residuals, errors), ~np.isnan(residuals)
        densities = self.spread_.log_volumes(weather, residuals, errors) - 0.5 * np.nansum(white**2, axis=1)
        return mean_log_density(densities - 0.5 * np.log(2 * np.pi) * present.sum(axis=1), present)

    @overload
    def extrapolation_distance(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def extrapolation_distance(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def extrapolation_distance(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """How far the temperatures of records lie outside those of the baseline.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures and frequencies, in the columns of `fit`.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_features - n_targets)
            In units of the range of each column in the baseline; 0 inside it, NaN where the value is missing.
        """
        check_is_fitted(self)
        temperatures, _ = self._split(X)
        return frame_like(temperatures, self.training_range_.excess(temperatures))

    @overload
    def extrapolated(self, X: pd.DataFrame) -> pd.Series: ...
    @overload
    def extrapolated(self, X: ArrayLike) -> NDArray[np.bool_]: ...
    def extrapolated(self, X: ArrayLike) -> NDArray[np.bool_] | pd.Series:
        """Which records are in weather that the baseline does not show, so that their predictions are extrapolated.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures and frequencies, in the columns of `fit`.

        Returns
        -------
        ndarray or Series of bool, shape (n_samples,)
            True where a temperature lies outside the baseline's by more than a twentieth of their range. An alarm there
            may be damage, or a behaviour in such weather that nobody has seen yet.
        """
        check_is_fitted(self)
        temperatures, _ = self._split(X)
        far = (np.nan_to_num(self.training_range_.excess(temperatures)) > BEYOND).any(axis=1)
        return pd.Series(far, X.index, name="extrapolated") if isinstance(X, pd.DataFrame) else far

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Names of the targets.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of all columns; by default those seen in `fit`.

        Returns
        -------
        ndarray of str
            Names of the targets.
        """
        check_is_fitted(self)
        return _check_feature_names_in(self, input_features)[self.targets_]

    def _residuals(self, X: ArrayLike) -> tuple[Any, Array, Array, PredictionError, NDArray[np.bool_]]:
        """Frequencies and weather of new records, residuals in Hz, errors of predictions, rows without a prediction."""
        check_is_fitted(self)
        temperatures, frequencies = self._split(X)
        predict = partial(self._predicted, temperatures)
        weather, predicted, errors, unknown = answer_once(self, (temperatures,), 2 * np.size(X), predict)
        return frequencies, weather, as_floats(frequencies) - predicted, errors, unknown

    def _predicted(self, temperatures: Any) -> tuple[Array, Array, PredictionError, NDArray[np.bool_]]:
        """Weather of new records, predictions in Hz, their errors, and the rows without any."""
        filled = fill_temperatures(self.sensors_, temperatures)
        weather = as_floats(filled)
        known, from_fleet, errors = self.regression_.stated(filled)
        reach, inputs = known or (self.training_range_, weather)  # with that of a fleet
        warn_each(reach.doubts(inputs))
        warn_of_fleet(from_fleet, "Their residuals count less, by that uncertainty")
        warn_each(self.sensors_.doubts(temperatures))
        predicted = self.regression_.predict(filled)
        predicted[np.isnan(weather).all(axis=1)] = np.nan
        unknown = warn_of_unpredicted(predicted, weather)
        fills = PredictionError.of_fills(self.sensors_, temperatures, filled, self.regression_.predict)
        return weather, predicted, errors.plus(fills, len(predicted)), unknown

    def _split(self, X: Any) -> tuple[Any, Any]:
        """Temperatures and frequencies of new records, with a warning of values that are none."""
        values = validate_data(self, X, **AS_FLOATS, reset=False)
        temperatures, frequencies = split_columns(X, values, self.targets_)
        is_named = isinstance(X, pd.DataFrame)
        warn_of_markers(frequencies if is_named else pd.DataFrame(frequencies, columns=self.get_feature_names_out()))
        warn_each(implausible(self.training_range_, temperatures))
        return temperatures, frequencies

    def _with_spread(self, residuals: Array) -> Array:
        """Residuals without those of targets that had none in the baseline."""
        return np.where(np.diag(self.spread_.overall.covariance) > 0, residuals, np.nan)

    def _changes(self, weather: Array, present: NDArray[np.bool_], errors: PredictionError) -> Changes:
        """What relative changes of the frequencies make of residuals."""
        if self.whiten is None:
            shrinkages = self.spread_.shrinkages(present, errors)
            which = np.zeros(len(present), dtype=np.intp)
            which[errors.rows] = 1 + np.arange(len(shrinkages))
            roots = np.concatenate([np.eye(len(self.levels_))[np.newaxis], shrinkages.swapaxes(1, 2)])
            return Changes(roots * self.levels_, which)
        roots, which = self.spread_.roots(weather, present, errors)
        return Changes(roots * self.levels_, which)

    def _log_volumes_shrunk(self, weather: Array, residuals: Array, errors: PredictionError) -> Array:
        """As `Spread.log_volumes`, of residuals in Hz that are shrunk where predictions are uncertain."""
        known = self._with_spread(residuals)
        certain = self.spread_.log_volumes(weather, known, NO_ERRORS)
        return self.spread_.log_volumes(weather, known, errors) - certain

    def _read_baseline(self, X: Any) -> tuple[Any, Any, RecordFindings]:
        values = validate_data(self, X, **AS_FLOATS, ensure_min_features=2, ensure_min_samples=2, allow_infinite=True)
        self.targets_ = positions_of(self.targets, values.shape[1], getattr(X, "columns", ()))
        names = _check_feature_names_in(self, None)
        named = pd.DataFrame(values, getattr(X, "index", None), names, copy=False)
        T, F = named.drop(columns=names[self.targets_]), named[names[self.targets_]]
        needed = partial(set_aside, unit="", needs_all=True)  # inputs need not be temperatures, and may be constant
        usable = [needed(frequencies=F).frequencies, needed(frequencies=T, exclude={"constant"}).frequencies]
        warn_each(misplaced_columns(T, F))
        findings = findings_of(partial(check_records, unit=""), T, F)
        usable = pd.concat(usable, axis=1)[list(named)]
        return *split_columns(X, as_floats(usable), self.targets_), findings

    def _learn(self, temperatures: Any, frequencies: Any, findings: RecordFindings) -> tuple[Array, PredictionError]:
        """Learn from all rows; residuals of each from a clone fitted on the other folds, and the errors of those."""
        self.sensors_ = SensorRegression.of(temperatures)
        filled, measured = fill_temperatures(self.sensors_, temperatures), as_floats(frequencies)
        folds = Folds.of(self._wanted_folds(filled), filled)
        self.training_range_ = TrainingRange.of(filled, ~np.isnan(measured).all(axis=1))
        self.levels_ = means_of_known(measured)
        with warnings_once():
            learn = partial(learn_regression, self.estimator, filled, frequencies, findings, folds)
            asked = self.estimator, filled, frequencies, folds
            self.regression_, folds, predicted, stated = answer_once(type(self), asked, measured.size, learn)
        predicted = predicted.copy()
        self.estimator_ = self.regression_.estimator
        self.folds_ = folds.of_row(len(measured))
        if not self.regression_.states_errors:
            warn_each(unseen_weather(filled, self.folds_, "Their residuals are too large, and may hide damage"))
        length = None if folds.blocks is None else folds.blocks.length(filled)
        self.block_ = length.to_numpy() if isinstance(length, pd.Timedelta) else length  # which skops can load
        predicted[np.isnan(as_floats(temperatures)).all(axis=1)] = np.nan
        warn_of_unpredicted(predicted[self.folds_ >= 0], as_floats(filled)[self.folds_ >= 0])
        residuals = measured - predicted
        fills = PredictionError.of_fills(self.sensors_, temperatures, filled, self.regression_.predict)
        errors = stated.plus(fills, len(residuals))
        taught = residuals.copy()
        if len(fills.rows) < len(residuals) / 2:
            taught[fills.rows] = np.nan
        if self.whiten is None:
            self.spread_ = Spread.of_all(taught, stated)
            return self.spread_.shrunk(residuals, errors), errors
        empty = np.isnan(taught).all(axis=0)
        if empty.any():
            name = self.get_feature_names_out()[empty][0]
            raise ValueError(f"target {name!r} has no out-of-fold residual; expected records of it in several periods")
        weather = as_floats(filled)
        self.spread_ = Spread.of(taught, np.fmax.reduce(np.abs(measured)), stated)
        white = self.spread_.whiten(weather, taught, stated)
        if self.whiten != "global":
            floor, near = self.whiten == "auto", rows_near_in_time(filled)
            extrapolation = self._extrapolation(filled, frequencies) if floor else None
            followed, white = self.spread_.followed(weather, taught, stated, floor=floor, near=near)
            self.spread_ = replace(followed, extrapolation=extrapolation)
        if not len(fills.rows):
            return white, errors
        untaught = np.isnan(taught).all(axis=1)
        return np.where(untaught[:, np.newaxis], self.spread_.whiten(weather, residuals, errors), white), errors

    def _extrapolation(self, temperatures: Any, frequencies: Any) -> Extrapolation | None:
        """How predictions err beyond the baseline's weather; None where the estimator states it, or too few show it."""
        measured = as_floats(frequencies)
        if self.regression_.states_errors or (~np.isnan(measured).all(axis=1)).sum() < FEWEST:
            return None

        def residuals_of(apart: NDArray[np.bool_]) -> Array:
            if np.isnan(measured[~apart]).all(axis=0).any():
                return np.full_like(measured[apart], np.nan)
            return measured[apart] - self.regression_.predict_apart(temperatures, frequencies, apart)

        return Extrapolation.of(as_floats(temperatures), self.spread_.overall, residuals_of)

    def _wanted_folds(self, temperatures: Any) -> Any:
        """The folds that are asked for; rows without stamps stay together where lags need them to."""
        if self.cv is not None or has_stamps(temperatures) or not has_lags_behind(self.estimator):
            return self.cv
        warn_user(
            f"rows have no stamps, so that lags inside {type(last_step(self.estimator)).__name__} would take rows of "
            "other folds for earlier ones. Folds are therefore five long periods, and may lack weather of the others. "
            "Give a frame on a DatetimeIndex, or LagFeatures as the first step of a pipeline",
            FewRecordsWarning,
            "lags-without-stamps",
        )
        return "contiguous"


def learn_regression(
    estimator: BaseEstimator, temperatures: Any, frequencies: Any, findings: RecordFindings, folds: Folds
) -> tuple[Regression, Folds, Array, PredictionError]:
    """A regression on all rows, its predictions out of fold in Hz and their errors.

    The folds are longer than asked for where residuals depend on each other.
    """
    regression = Regression.of(estimator, temperatures, frequencies, findings)
    predicted, errors = regression.out_of_fold(temperatures, frequencies, folds)
    longer = folds.longer(temperatures, as_floats(frequencies) - predicted)
    if longer is None:
        return regression, folds, predicted, errors
    return regression, longer, *regression.out_of_fold(temperatures, frequencies, longer)


def fill_temperatures(sensors: SensorRegression, temperatures: Any) -> Any:
    """Temperatures in which the other sensors fill the gaps, with a warning that counts these by sensor."""
    filled, deviations = sensors.fill(temperatures)
    consequence = "The spread of residuals includes the error of that"
    message = filled_text(deviations, column_names(temperatures, "x"), consequence)
    warn_user(message, RecordsWarning, "filled-temperatures")
    return frame_like(temperatures, filled)


def warn_of_unpredicted(predicted: Array, weather: Array) -> NDArray[np.bool_]:
    """Rows of which nothing is predicted, so that they are not evaluated; a warning counts those not yet explained."""
    unknown = np.isnan(predicted).all(axis=1)
    others = "for which the estimator predicts nothing, such as those with lags that reach to no record"
    message = unpredicted_text(unknown & ~explained_rows(predicted), weather, others)
    warn_user(message, UnevaluatedRowsWarning, "not-predicted")
    return unknown


def split_columns(X: Any, values: NDArray, targets: NDArray[np.intp]) -> tuple[Any, Any]:
    """The other columns and the targets, as frames if X is one."""
    columns = np.asarray(getattr(X, "columns", range(values.shape[1])), dtype=object)
    others = np.delete(np.arange(len(columns)), targets)
    return frame_like(X, values[:, others], columns[others]), frame_like(X, values[:, targets], columns[targets])


@dataclass(frozen=True)
class Regression:
    """A fitted estimator, of which the first transformers got all rows and the rest those that it accepts.

    One that offers ``predict_covariance`` states the errors of its predictions.
    """

    estimator: BaseEstimator
    head: Pipeline | None
    rest: CompleteRowsRegressor
    states_errors: bool

    @classmethod
    def of(cls, estimator: BaseEstimator, X: Any, y: Any, findings: RecordFindings) -> Regression:
        """Fit a clone to records in which something was found."""
        head, rest = split_pipeline(estimator)
        head = None if head is None else clone(head)
        fitted = CompleteRowsRegressor(rest, findings).fit(X if head is None else head.fit_transform(X), y)
        whole = last = fitted.regressor_
        if head is not None:
            tail = last.steps if isinstance(last, Pipeline) else [(estimator.steps[-1][0], last)]
            whole = Pipeline([*head.steps, *tail], memory=estimator.memory, verbose=estimator.verbose)
        return cls(whole, head, fitted, offers(last, "predict_covariance"))

    def predict(self, X: Any) -> NDArray[np.float64]:
        """Predictions, NaN for rows that the estimator does not accept."""
        inputs = self._inputs(X)
        return explain_rows(self.rest.predict(inputs), explained_rows(inputs))

    def stated(self, X: Any) -> tuple[tuple[TrainingRange, Any] | None, NDArray[np.bool_], PredictionError]:
        """The weather that the estimator was fitted in, with X as its last step sees it, rows in weather that only a
        fleet has shown, and errors of predictions; none of them where the estimator does not say."""
        last = self.rest.regressor_
        if not (self.states_errors or offers(last, "reach_") or offers(last, "from_fleet")):
            return None, np.zeros(len(X), dtype=bool), NO_ERRORS
        with without_warnings():  # which predictions give
            inputs = self._inputs(X)
            errors = PredictionError.of_rows(self.rest.predict_covariance(inputs)) if self.states_errors else NO_ERRORS
            return reach_of(last, inputs), self.rest.from_fleet(inputs), errors

    def out_of_fold(self, X: Any, y: Any, folds: Folds) -> tuple[Any, PredictionError]:
        """Predictions by clones of the rest that are fitted on other rows, and their errors.

        The first transformers know all rows.
        """
        partition = [*folds.splits, (folds.untested, folds.untested)] if folds.untested.size else folds.splits
        learner, n_targets = clone(self.rest).set_params(states_errors=self.states_errors), y.shape[1]
        # With metadata routing, scikit-learn 1.6 fails where params are None.
        found = cross_val_predict(learner, self._inputs(X), y, cv=partition, params={})
        predicted, covariances = found[:, :n_targets], found[:, n_targets:]
        predicted[folds.untested] = np.nan
        if not self.states_errors:
            return predicted, NO_ERRORS
        return predicted, PredictionError.of_rows(covariances.reshape(-1, n_targets, n_targets))

    def predict_apart(self, X: Any, y: Any, apart: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Predictions of some rows by a clone of the rest that is fitted on all others."""
        inputs = self._inputs(X)
        with without_warnings():  # which the fit on all rows has given
            return clone(self.rest).fit(inputs[~apart], y[~apart]).predict(inputs[apart])

    def _inputs(self, X: Any) -> Any:
        return X if self.head is None else self.head.transform(X)


class CompleteRowsRegressor(RegressorMixin, BaseEstimator):
    """Fits and predicts with the rows that a regressor accepts; the prediction of other rows is NaN.

    The compensator has checked the records with some findings, and warns of what it hands on. With
    ``states_errors``, the covariance of each row's prediction follows in the columns behind it.
    """

    def __init__(self, estimator: BaseEstimator, findings: RecordFindings, states_errors: bool = False):
        self.estimator = estimator
        self.findings = findings
        self.states_errors = states_errors

    def fit(self, X: Any, y: Any) -> CompleteRowsRegressor:
        self.takes_nan_ = takes_nan(self.estimator)
        self.n_targets_ = y.shape[1]
        usable, present = self._predictable(X), ~np.isnan(as_floats(y))
        if is_model(getattr(last_step(self.estimator), "model", None)):
            present[:] = True  # with an FE model, it leaves out incomplete rows itself, after its lags
        in_use = usable[:, np.newaxis] & present
        if not in_use.any(axis=0).all():
            wanted = "that target" if self.takes_nan_ else "that target and every other column"
            target = column_names(y, "target ")[in_use.any(axis=0).argmin()]
            raise ValueError(
                f"{target!r} has none of {len(y)} rows to learn from, of all or in a fold; expected rows with {wanted} "
                f"for {type(self.estimator).__name__}"
            )
        is_whole = (in_use == usable[:, np.newaxis]).all()
        with reported_by_caller(REPORTED, self.findings):  # also in a worker process
            if is_whole:
                y = y[usable]  # a single target as a vector, unless the regressor always takes columns
                takes_columns = y.shape[1] > 1 or not get_tags(last_step(self.estimator)).target_tags.single_output
                self.regressor_ = fit_outputs(self.estimator, X[usable], y if takes_columns else y.squeeze(axis=1))
                return self
            self.regressor_ = MultiOutputRegressor(self.estimator)
            # Named, so that a regressor may know which target it learns.
            targets = [column for _, column in y.items()] if isinstance(y, pd.DataFrame) else as_floats(y).T
            self.regressor_.estimators_ = [
                clone(self.estimator).fit(X[rows], target[rows]) for rows, target in zip(in_use.T, targets, strict=True)
            ]
        return self

    def predict(self, X: Any) -> NDArray[np.float64]:
        usable = self._predictable(X)
        predicted = np.full((X.shape[0], self.n_targets_), np.nan)
        if usable.any():
            with reported_by_caller(REPORTED):
                values = as_columns(self.regressor_.predict(X[usable]))
            expected = (int(usable.sum()), self.n_targets_)
            if values.shape != expected:
                raise ValueError(
                    f"{type(self.regressor_).__name__} predicted the shape {values.shape}; expected {expected}, a "
                    "column for each target"
                )
            predicted[usable] = values
        if not self.states_errors:
            return predicted
        return np.hstack([predicted, self.predict_covariance(X).reshape(len(predicted), -1)])

    def predict_covariance(self, X: Any) -> NDArray[np.float64]:
        usable = self._predictable(X)
        covariances = np.full((X.shape[0], self.n_targets_, self.n_targets_), np.nan)
        if usable.any():
            with reported_by_caller(REPORTED):
                covariances[usable] = predicted_covariance(self.regressor_, X[usable])
        return covariances

    def from_fleet(self, X: Any) -> NDArray[np.bool_]:
        rows = self._predictable(X)
        if rows.any():
            rows[rows] = rows_from_fleet(self.regressor_, X[rows])
        return rows

    def _predictable(self, inputs: Any) -> NDArray[np.bool_]:
        if self.takes_nan_ or scipy.sparse.issparse(inputs):
            return np.ones(inputs.shape[0], dtype=bool)
        return ~np.isnan(as_floats(inputs)).any(axis=1)


def split_pipeline(estimator: BaseEstimator) -> tuple[Pipeline | None, BaseEstimator]:
    """The first transformers of a pipeline, as far as they accept NaN and learn without y, and what follows them."""
    if not isinstance(estimator, Pipeline):
        return None, estimator
    steps = [step for _, step in estimator.steps]
    n_head = next(
        (i for i, step in enumerate(steps[:-1]) if not takes_nan(step) or learns_from_y(step)), len(steps) - 1
    )
    if not n_head:
        return None, estimator
    return estimator[:n_head], steps[-1] if n_head == len(steps) - 1 else estimator[n_head:]


def has_lags_behind(estimator: BaseEstimator) -> bool:
    """Whether lags or means stand behind the first transformers, where they see the rows of their folds only."""
    parts = split_pipeline(estimator)[1].get_params(deep=True).values()
    return any(hasattr(type(part), "lookback_") for part in parts)


def takes_nan(estimator: BaseEstimator) -> bool:
    """Whether an estimator accepts NaN in X, also inside a wrapper, of which scikit-learn's tag does not say so."""
    if estimator is None or isinstance(estimator, str):  # "passthrough" or "drop"
        return True
    if isinstance(estimator, Pipeline):
        steps = [step for _, step in estimator.steps]
        imputer = next((i for i, step in enumerate(steps) if isinstance(step, _BaseImputer)), len(steps))
        return all(takes_nan(step) for step in steps[: imputer + 1])
    if isinstance(estimator, ColumnTransformer | FeatureUnion):
        parts = estimator.transformers if isinstance(estimator, ColumnTransformer) else estimator.transformer_list
        return all(takes_nan(part) for _, part, *_ in parts)
    if isinstance(estimator, MultiOutputRegressor | BaseSearchCV):
        return takes_nan(estimator.estimator)
    if isinstance(estimator, TransformedTargetRegressor) and estimator.regressor is not None:
        return takes_nan(estimator.regressor)
    return get_tags(estimator).input_tags.allow_nan


def learns_from_y(transformer: BaseEstimator | str | None) -> bool:
    """Whether a transformer may need the targets, which are not known in every row."""
    if transformer is None or isinstance(transformer, str):
        return False
    return get_tags(transformer).target_tags.required or hasattr(transformer, "estimator")
