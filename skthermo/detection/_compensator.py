"""Residuals of frequencies: the effect of temperature is removed by regression, also where records have gaps."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from typing import Any, Literal, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.model_selection import BaseCrossValidator

from skthermo._core.arrays import Array, as_floats, median, robust_deviation
from skthermo._core.estimators import (
    Estimator,
    HasMethods,
    StrOptions,
    TransformerMixin,
    _check_feature_names_in,
    _fit_context,
    check_is_fitted,
    validate_data,
    with_means,
)
from skthermo._core.frames import (
    column_names,
    correlation_times,
    frame_like,
    marker_findings,
    positions_of,
    row_times,
)
from skthermo._core.warnings import collected, warn_each
from skthermo.detection._base import labelled_damaged, mean_log_density
from skthermo.detection._rows_regression import RowsRegression, read_folds
from skthermo.exceptions import RecordsWarning, SkthermoWarning
from skthermo.preprocessing.checks import listed_details, misplaced_columns, set_aside
from skthermo.preprocessing.folds import BlockedKFold, Rows
from skthermo.residuals.gaussian import Gaussian
from skthermo.residuals.sensors import SensorRegression, filled_findings
from skthermo.residuals.weather import (
    BEYOND,
    Extrapolation,
    TrainingRange,
    unpredicted_findings,
    unseen_weather,
)


class TemperatureCompensator(TransformerMixin, Estimator):
    """Residuals of frequencies: measured beside predicted from temperatures.

    Parameters
    ----------
    estimator : regressor, optional
        Predicts the targets from all other columns: any of scikit-learn's regressors (one that takes a single target is
        fitted once for each), a pipeline with ``LagFeatures``, or `~skthermo.surrogate.DataInformedFEM`. By default
        `~skthermo.surrogate.TemperatureMapper`.
    targets : sequence of str or sequence of int
        Names of the response columns in a frame, or their positions counted from 0.
    cv : "contiguous", int, cross-validation splitter or iterable, default=None
        Folds by which the baseline is predicted:

        - ``None``: blocks of a week (without stamps, of a 52nd of the rows), or of five correlation times of the
          residuals where that is longer, dealt in turn to five folds, so that each fold sees each season.
        - ``"contiguous"``: five periods of time, each predicted from the others. An int gives that many.
        - A splitter, or pairs of training and test rows: every row must be in exactly one test fold, or all but the
          first rows, as with ``TimeSeriesSplit``: the residuals of those are NaN.

    Attributes
    ----------
    estimator_ : regressor
        Clone of ``estimator``, fitted on all rows that it can take.
    folds_ : ndarray of int
        The fold of each row of the baseline, -1 where no fold tests it.
    relative_ : ndarray of bool of shape (n_targets,)
        Which targets are positive, with a standard deviation below a third of their mean: their residuals are relative.
    residuals_ : ndarray of shape (n_samples, n_targets)
        Residuals of the baseline, out of fold.
    scale_ : ndarray of shape (n_targets,)
        Robust standard deviations of the residuals of the baseline.
    usual_deviation_ : ndarray of shape (n_targets,)
        Median standard deviation of the predictions of the baseline, as a ``predict`` that takes ``return_std`` states
        it; else 0.
    regression_ : object
        The estimator behind its first transformers, which takes the rows that have all inputs.
    normal_ : object
        Normal distribution of the residuals of the baseline; `score` is a likelihood under it.
    sensors_ : object
        Regression of each of the other columns on the others: ``sensors_.fill(T)`` and ``sensors_.departures(T)``.
    training_range_ : object
        Lowest and highest values of the other columns.
    extrapolation_ : object
        Variance of residuals outside these values, ``extrapolation_.variances(T)``, in terms of the one inside.
    targets_ : ndarray of int
        Positions of the targets.
    findings_ : list of SkthermoWarning
        What `fit` has warned of.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of columns, targets included, and, where `fit` saw a frame with such, their names.

    See Also
    --------
    CompensatedDetector : Residuals, regimes, windows and a detector in one estimator.

    Notes
    -----
    The residual of a frequency is relative, ln f - ln f predicted. Another response, which may be zero or negative, has
    the residual measured minus predicted, in its own unit.

    Residuals of records whose prediction is less certain than usual in the baseline are divided by sqrt(1 + e / s),
    with the excess e of its variance and the variance s of the baseline's residuals. A prediction is uncertain where
    temperatures were filled, and where the estimator's ``predict`` takes ``return_std`` and says so. Outside the
    baseline's weather, by d times the range of a column, residuals are divided by the root of 1 + g ln(1 + d^2)
    besides: the coldest and the warmest fifth of the baseline, each predicted from the other records, tell a growth g
    for either end.

    ``fit_transform(X)`` differs from ``fit(X).transform(X)`` by design: it predicts each row of the baseline by a clone
    fitted on the other folds, because residuals of rows that a regressor was fitted on are smaller than residuals of
    new records. In a pipeline, a detector that follows gets these out-of-fold residuals in its own ``fit``. Rows should
    be in order of time.

    Targets whose residuals are farther than eight robust standard deviations from the median do not train the
    regression a second time; their residuals stay. A missing temperature is filled from the other sensors of its row. A
    missing target makes only its own residual NaN. A row with a value that is still missing, such as a lag that finds
    no record, is used if the estimator accepts NaN; otherwise it does not train, and its residuals are NaN.

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
    1% false alarms

    A threshold set on residuals of rows that the regressor was fitted on is too low:

    >>> in_sample = MahalanobisDetector().fit(compensator.fit(baseline).transform(baseline))
    >>> print(f"{(in_sample.predict(compensator.transform(second_year)) == -1).mean():.0%} false alarms")
    12% false alarms
    """

    _parameter_constraints: dict = {
        "estimator": [HasMethods(["fit", "predict"]), None],
        "targets": "no_validation",
        "cv": ["cv_object", StrOptions({"contiguous"})],
    }

    def __init__(
        self,
        estimator: BaseEstimator | None = None,
        *,
        targets: Sequence[Hashable],
        cv: int | BaseCrossValidator | Iterable | Literal["contiguous"] | None = None,
    ):
        self.estimator = estimator
        self.targets = targets
        self.cv = cv

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: ArrayLike, y: ArrayLike | None = None) -> TemperatureCompensator:
        """Fit the regression of the targets on the other columns.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures in degrees Celsius, or other inputs, and frequencies in Hz of the healthy structure, side by
            side.
        y : array-like of shape (n_samples,), optional
            Labels +1 and -1: what is labelled -1, as damaged, is not learned. Other values are ignored.

        Returns
        -------
        TemperatureCompensator
            The fitted transformer.

        Raises
        ------
        ValueError
            If a target is not among the columns or is named twice; if the targets are all of the columns or none; if a
            target is NaN in every row, or in every row that the estimator can learn from; if there are fewer rows than
            folds, or ``cv`` does not test every row exactly once.

        Warns
        -----
        UserWarning
            If values cannot be, such as -999, or whole columns; if another column behaves like the targets, or a target
            like a temperature; if temperatures are missing, with the sensors that fill them; if a fold has weather that
            the others do not know.
        """
        self.findings_, _ = self._learn(X, y)
        warn_each(self.findings_)
        return self

    @overload
    def fit_transform(self, X: pd.DataFrame, y: ArrayLike | None = None) -> pd.DataFrame: ...
    @overload
    def fit_transform(self, X: ArrayLike, y: ArrayLike | None = None) -> NDArray[np.float64]: ...
    @_fit_context(prefer_skip_nested_validation=False)
    def fit_transform(self, X: ArrayLike, y: ArrayLike | None = None) -> NDArray[np.float64] | pd.DataFrame:
        """Fit on all rows of a baseline, and give its out-of-fold residuals, with the errors and warnings of `fit`.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures in degrees Celsius, or other inputs, and frequencies in Hz of the healthy structure, side by
            side.
        y : array-like of shape (n_samples,), optional
            Labels +1 and -1: what is labelled -1, as damaged, is not learned. Other values are ignored.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_targets)
            Relative, or in the unit of a response that may be zero; each row predicted by a clone that was not fitted
            on its fold.
        """
        self.findings_, residuals = self._learn(X, y)
        warn_each(self.findings_)
        return residuals

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
            Relative, or in the unit of a response that may be zero. Too small for the rows of `fit`: use
            `fit_transform`.

        Raises
        ------
        ValueError
            If columns differ from `fit`, or the estimator predicts another number of targets.

        Warns
        -----
        UserWarning
            If temperatures are missing or far outside their range in `fit`; if a sensor departs from what the others
            predict, as one that drifts or is stuck does; if rows cannot be predicted.
        """
        residuals, _, findings = self.evaluated(X)
        warn_each(findings)
        return residuals

    def score(self, X: ArrayLike, y: None = None) -> float:
        """Mean log-likelihood of healthy records that `fit` has not seen, per value.

        The distribution is the normal one with the mean and the covariance of the baseline's out-of-fold residuals.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures and frequencies of the healthy structure, in the columns of `fit`.
        y : None
            Ignored.

        Returns
        -------
        float
            Natural logarithm of a density of the residuals, averaged over the targets that are there: higher is better,
            and a residual twice as small gains 0.69. NaN if no row has a residual; a warning says so if fewer than half
            of the rows have one.
        """
        residuals = self.evaluated(X)[0]
        R = np.where(np.diag(self.normal_.covariance) > 0, as_floats(residuals), np.nan)
        score, findings = mean_log_density(self.normal_.log_densities(R), ~np.isnan(R))
        warn_each(findings)
        return score

    @overload
    def extrapolation_distance(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def extrapolation_distance(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def extrapolation_distance(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """How far the temperatures of records lie outside their range in the baseline.

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

    def _learn(self, X: Any, y: Any) -> tuple[list[SkthermoWarning], Any]:
        """Learn from a baseline: findings, and residuals out of fold."""
        T, F, findings = self._read_baseline(X)
        F = frame_like(F, np.where(labelled_damaged(y, len(F))[:, np.newaxis], np.nan, as_floats(F)))
        self.sensors_ = SensorRegression.fitted(T)
        inputs, filled = self._filled(T)
        Y = as_floats(F)
        self.training_range_ = TrainingRange.spanned(inputs, ~np.isnan(Y).all(axis=1))
        self.relative_ = (np.fmin.reduce(Y) > 0) & (np.nanstd(Y, axis=0) < np.nanmean(Y, axis=0) / 3)
        estimator = self._default_part("estimator") if self.estimator is None else self.estimator
        estimator = with_means(estimator, inputs, F)
        predicted, folds, doubts = self._regress(estimator, inputs, F)
        residuals = self._difference(Y, predicted)
        self.folds_ = np.full(len(Y), -1)
        for number, (_, test) in enumerate(folds):
            self.folds_[test] = number
        self.scale_, self.usual_deviation_ = robust_deviation(residuals), median(self._deviations(predicted))
        self.extrapolation_ = self._learn_extrapolation(estimator, inputs, F)
        residuals = self._shrunk(residuals, inputs, self._with_fills(T, inputs, predicted))
        self.normal_ = Gaussian.fitted(residuals)
        self.residuals_ = residuals
        unknown = np.isnan(predicted[0]).all(axis=1) & (self.folds_ >= 0)
        findings += [*filled, *doubts, *unpredicted_findings(unknown, as_floats(inputs))]
        findings += unseen_weather(inputs, self.folds_, "Their residuals are too large, and may hide damage")
        return findings, frame_like(F, residuals)

    def _regress(
        self, estimator: BaseEstimator, T: Any, F: Any
    ) -> tuple[Array, list[tuple[Rows, Rows]], list[SkthermoWarning]]:
        """Fit the regression; predictions out of fold with standard deviations, folds, and findings of the estimator.

        Targets that are far from a first regression do not train the second one. Where residuals of the first are
        correlated for long, the blocks of the second are longer.
        """
        Y, in_time = as_floats(F), np.argsort(row_times(T), kind="stable")
        cv = BlockedKFold() if self.cv is None else self.cv
        for _ in range(2):
            folds = read_folds(cv, T)
            with collected() as found:
                self.regression_ = RowsRegression.fitted(estimator, T, F)
                predicted = self.regression_.out_of_fold(estimator, T, F, folds)
            residuals = self._difference(Y, predicted)
            far = np.abs(residuals - median(residuals)) > 8 * robust_deviation(residuals)
            shorter, usual = cv, np.where(far, np.nan, residuals)
            if self.cv is None:
                cv = shorter.remembering(T, 5.0 * correlation_times(usual[in_time]).max())
            if not far.any() and cv is shorter:
                break
            F = frame_like(F, np.where(far, np.nan, Y))
        self.estimator_ = self.regression_.estimator
        return predicted, folds, found

    def _learn_extrapolation(self, estimator: BaseEstimator, T: Any, F: Any) -> Extrapolation:
        """How residuals scatter where the regression extrapolates, in the coldest and the warmest fifth of records."""
        scale = np.where(self.scale_ > 0, self.scale_, np.nan)

        def residuals_of(others: Rows, fifth: Rows) -> Array:
            try:
                with collected():
                    predicted = self.regression_.out_of_fold(estimator, T, F, [(others, fifth)])[:, fifth]
            except ValueError:  # the others are too few for a regression
                return np.full((len(fifth), F.shape[1]), np.nan)
            return self._difference(as_floats(F)[fifth], predicted) / scale

        return Extrapolation.learned(self.training_range_, as_floats(T), residuals_of)

    def inputs(self, X: ArrayLike) -> tuple[Any, list[SkthermoWarning]]:
        """The columns beside the targets, gaps filled from the other sensors.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures and frequencies, in the columns of `fit`.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_features - n_targets)
            NaN in rows in which no sensor has a value.
        list of SkthermoWarning
            A finding where sensors were filled.
        """
        return self._filled(self._split(X)[0])

    def evaluated(self, X: ArrayLike) -> tuple[Any, Any, list[SkthermoWarning]]:
        """Residuals of new records as `transform` gives them, `inputs`, and what `transform` warns of.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures and frequencies, in the columns of `fit`.

        Returns
        -------
        residuals : ndarray or DataFrame of shape (n_samples, n_targets)
            Relative, or in the unit of a response that may be zero.
        inputs : ndarray or DataFrame of shape (n_samples, n_features - n_targets)
            Gaps filled from the other sensors.
        findings : list of SkthermoWarning
            None of them is given as a warning.
        """
        T, F = self._split(X)
        inputs, findings = self._filled(T)
        findings += marker_findings(pd.DataFrame(as_floats(F), columns=self.get_feature_names_out()))
        with collected():
            predicted = self._with_fills(T, inputs, self.regression_.predict(inputs))
        unknown = np.isnan(predicted[0]).all(axis=1)
        findings += [
            *self.training_range_.doubts(inputs),
            *self.sensors_.doubts(T),
            *unpredicted_findings(unknown, as_floats(inputs)),
        ]
        residuals = self._shrunk(self._difference(as_floats(F), predicted), inputs, predicted)
        return frame_like(F, residuals), inputs, findings

    def _difference(self, Y: Array, predicted: Array) -> Array:
        """Measured beside predicted: relative, or in the unit of a response that may be zero."""
        predicted = predicted[0]
        ratio = Y / np.where(predicted > 0, predicted, np.nan)
        relative = np.log(np.maximum(ratio, 1e-6))  # a frequency below zero is no less a fall
        return np.where(self.relative_, relative, Y - predicted)

    def _with_fills(self, T: Any, filled: Any, predicted: Array) -> Array:
        """Predictions whose standard deviations include the errors of filled inputs, sensor by sensor."""
        variances = predicted[1] ** 2
        for error in self.sensors_.errors(T):
            up, down = (
                self.regression_.predict(frame_like(filled, as_floats(filled) + side))[0] for side in (error, -error)
            )
            variances = variances + np.nan_to_num((up - down) / 2) ** 2
        return np.stack([predicted[0], np.sqrt(variances)])

    def _deviations(self, predicted: Array) -> Array:
        """Standard deviations of predictions, relative for relative residuals."""
        return np.where(self.relative_, predicted[1] / np.abs(predicted[0]), predicted[1])

    def _shrunk(self, residuals: Array, inputs: Any, predicted: Array) -> Array:
        """Residuals that count less where the regression is less certain than it usually was in the baseline."""
        excess = np.maximum(self._deviations(predicted) ** 2 - self.usual_deviation_**2, 0.0)
        variance = np.where(self.scale_ > 0, self.scale_, 1.0) ** 2
        outside = self.extrapolation_.variances(inputs)[:, np.newaxis]
        return residuals / np.sqrt(outside + np.nan_to_num(excess) / variance)

    def _filled(self, T: Any) -> tuple[Any, list[SkthermoWarning]]:
        """Inputs whose gaps the other sensors fill, and a finding that names these."""
        values, deviations = self.sensors_.fill(T)
        consequence = "The spread of residuals includes the error of that"
        return frame_like(T, values), filled_findings(deviations, column_names(T, "x"), consequence)

    def _read_baseline(self, X: Any) -> tuple[Any, Any, list[SkthermoWarning]]:
        """Inputs and targets without values that cannot be, and findings."""
        options: dict[str, Any] = {"ensure_min_features": 2, "ensure_min_samples": 2, "allow_infinite": True}
        values = validate_data(self, X, order="C", dtype=np.float64, **options)
        self.targets_ = positions_of(self.targets, values.shape[1], getattr(X, "columns", ()))
        T, F = split_columns(X, values, self.targets_)
        names = _check_feature_names_in(self, None)
        index = X.index if isinstance(X, pd.DataFrame) else None
        named_T = pd.DataFrame(as_floats(T), index, np.delete(names, self.targets_))
        named_F = pd.DataFrame(as_floats(F), named_T.index, names[self.targets_])
        # inputs need not be temperatures, and may be constant
        inputs, of_inputs = set_aside(frequencies=named_T, unit="", exclude={"useless-column"})
        responses, of_responses = set_aside(frequencies=named_F, unit="", needs_all=True)
        findings = [*of_inputs, *of_responses, *misplaced_columns(named_T, named_F)]
        is_constant = (inputs.table["what"] == "useless-column") & ~inputs.table["column"].isin(list(inputs.left_out))
        constant = inputs.table["detail"][is_constant]
        if len(constant):
            text = f"inputs are constant: {listed_details(constant)}. Records where they differ will hardly show damage"
            findings.append(RecordsWarning(f"{text}. Repair these sensors, or leave the columns out", "useless-column"))
        inputs.frequencies[list(inputs.left_out)] = np.nan
        cleaned = (np.ascontiguousarray(as_floats(found.frequencies)) for found in (inputs, responses))
        T, F = (frame_like(table, values) for table, values in zip((T, F), cleaned, strict=True))
        return T, F, findings

    def _split(self, X: Any) -> tuple[Any, Any]:
        """Inputs and targets of new records."""
        check_is_fitted(self)
        values = validate_data(self, X, order="C", dtype=np.float64, reset=False)
        return split_columns(X, values, self.targets_)

    def _default_part(self, name: str) -> BaseEstimator | None:
        from skthermo.surrogate import TemperatureMapper  # a detector with a regressor of its own needs no surrogate

        return TemperatureMapper() if name == "estimator" else None


def split_columns(X: Any, values: NDArray, targets: NDArray[np.intp]) -> tuple[Any, Any]:
    """The other columns and the targets, as frames if X is one."""
    columns = np.asarray(getattr(X, "columns", range(values.shape[1])), dtype=object)
    others = np.delete(np.arange(len(columns)), targets)
    T, F = (frame_like(X, np.ascontiguousarray(values[:, some]), columns[some]) for some in (others, targets))
    return T, F
