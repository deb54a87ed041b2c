"""Removes the effect of temperature from frequencies by regression."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from typing import Any, Literal, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.model_selection import BaseCrossValidator, check_cv, cross_val_predict

from skthermo._arrays import Array, as_floats
from skthermo._columns import check_positions_are_names, positions_of
from skthermo._frames import (
    check_columns,
    check_temperatures,
    frame_like,
    warn_of_disorder,
    warn_of_markers,
)
from skthermo._validation import (
    Estimator,
    HasMethods,
    StrOptions,
    TransformerMixin,
    _check_feature_names_in,
    _fit_context,
    check_is_fitted,
    validate_data,
)
from skthermo._warnings import warn_each, warn_user
from skthermo._weather import TrainingRange
from skthermo.detection.compensation._complete_rows import CompleteRowsRegressor
from skthermo.detection.compensation._whitening import Spread
from skthermo.preprocessing import check_records

Rows = NDArray[np.intp]
AS_FLOATS = {"order": "C", "dtype": np.float64, "ensure_all_finite": "allow-nan"}


class TemperatureCompensator(TransformerMixin, Estimator):
    """Residuals of frequencies: measured minus predicted from temperatures.

    Parameters
    ----------
    estimator : regressor
        Predicts the targets from all other columns: any of scikit-learn's regressors (one that takes a single
        target is fitted once for each), a pipeline with ``LagFeatures``, or `~skthermo.surrogate.DataInformedFEM`.
    targets : sequence of str or sequence of int
        Names of the frequency columns in a frame, or their positions counted from 0, in the order of
        the output.
    cv : int, cross-validation splitter or iterable, default=None
        Folds of `fit_transform`. An int gives that many folds of consecutive rows, None gives 5. A
        splitter must put every row into exactly one test fold, or all but the first rows, as ``TimeSeriesSplit``
        does: the residuals of those are NaN.
    scale : {None, "global", "local"}, default=None
        What the residuals are divided by:

        - ``None``: nothing; they are in Hz.
        - ``"global"``: their covariance. They are then in standard deviations, and uncorrelated.
        - ``"local"``: the covariance that they have in similar weather. Frost that makes residuals scatter then no
          longer hides damage on warm days.

    Attributes
    ----------
    estimator_, regression_ : regressor
        Clone of ``estimator``, fitted on all rows that it can take: alone, and with what rows with gaps need.
    spread_ : object
        Covariance of the residuals by weather, if they are scaled. ``spread_.smoothing`` says over how many records of
        similar weather it is taken (None: all), ``spread_.deviations(T)`` gives standard deviations in Hz.
    training_range_ : object
        Lowest and highest values of the other columns.
    targets_ : ndarray of int
        Positions of the targets.
    n_features_in_ : int
        Number of columns, targets included.
    feature_names_in_ : ndarray of str
        Their names, where `fit` saw a frame with such names.

    See Also
    --------
    MahalanobisDetector : Raises alarms on the residuals.
    OutlierDetector : The same with any of scikit-learn's outlier detectors.

    Notes
    -----
    ``fit_transform(X)`` differs from ``fit(X).transform(X)`` by design. A regressor partly learns the noise of the rows
    it was fitted on: their residuals are smaller than those of new records, and a threshold set on them gives too many
    false alarms. `fit_transform` predicts each row by a clone fitted on the other folds, and also fits on all rows for
    the records to come. In a pipeline, a detector that follows gets these out-of-fold residuals in its own ``fit``.

    Rows should be in order of time, so that folds are periods of time: with random folds, a row would be predicted by
    its neighbours in time, which are nearly the same record. If the baseline holds each season only once, a fold is
    predicted from other seasons, and its residuals and the threshold become too large.

    Scaling multiplies residuals r - m by the symmetric root of the inverse of a covariance S, m being their mean:
    each stays close to its own mode. "local" takes S from the records whose weather is most similar (in the principal
    components of the standardised temperatures), drawn towards the covariance of all records by pseudo-rows. Of seven
    pairs of their numbers, and one covariance for all weather, that is taken under which baseline records are likeliest
    given the others, records fewer than 24 rows apart left out; such records are left out too where the baseline itself
    is scaled. A new record takes S from the baseline record with the most similar weather; with a missing temperature,
    from all records. Where its temperatures lie outside the baseline's by e ranges of their columns (on average over
    the columns), "local" also divides by sqrt(1 + (e / 2)^2): what the regression says there is less certain.

    Missing values:

    - In a pipeline, the first transformers that accept NaN (scikit-learn's tag ``allow_nan``) get every row, so that
      lags and imputers find their neighbours. What follows applies to the rows that they give to the rest.
    - A missing target makes only its own residual NaN. Where targets are missing, each of them gets a clone of the
      estimator of its own, fitted on the rows that have it. Only an estimator with an FE model (``DataInformedFEM``,
      also at the end of a pipeline or in a search) gets all rows; it leaves out incomplete ones after its lags.
    - A row with another missing value, such as a lag that finds no record, is used if the estimator accepts NaN.
      Otherwise the row does not train, and its residuals are NaN.
    - On a ``DatetimeIndex``, lags inside the estimator go by time, and a lag whose record is in another fold takes the
      last record before it, or NaN if that is older than the tolerance of ``LagFeatures``. Without one, the rows of
      another fold shift the lags.

    Examples
    --------
    >>> from sklearn.neighbors import KNeighborsRegressor
    >>> from sklearn.pipeline import make_pipeline
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector, TemperatureCompensator
    >>> healthy, later = (make_truss_campaign(2, random_state=seed) for seed in (0, 1))
    >>> baseline = healthy.temperatures.join(healthy.frequencies)
    >>> unseen = later.temperatures.join(later.frequencies)
    >>> compensator = TemperatureCompensator(KNeighborsRegressor(), targets=list(healthy.frequencies))
    >>> detector = make_pipeline(compensator, MahalanobisDetector()).fit(baseline)
    >>> print(f"{(detector.predict(unseen) == -1).mean():.0%} false alarms")
    2% false alarms

    A threshold set on residuals of rows that the regressor was fitted on is too low:

    >>> in_sample = MahalanobisDetector().fit(compensator.fit(baseline).transform(baseline))
    >>> print(f"{(in_sample.predict(compensator.transform(unseen)) == -1).mean():.0%} false alarms")
    14% false alarms
    """

    _parameter_constraints: dict = {
        "estimator": [HasMethods(["fit", "predict"])],
        "targets": ["array-like"],
        "cv": ["cv_object"],
        "scale": [StrOptions({"global", "local"}), None],
    }

    def __init__(
        self,
        estimator: BaseEstimator,
        *,
        targets: Sequence[Hashable],
        cv: int | BaseCrossValidator | Iterable | None = None,
        scale: Literal["global", "local"] | None = None,
    ):
        self.estimator = estimator
        self.targets = targets
        self.cv = cv
        self.scale = scale

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
            If a target is not among the columns or is named twice; if the targets are all of the columns
            or none; if a target is NaN in every row, or in every row that the estimator can learn from; if the
            residuals that are to be scaled have a singular covariance.

        Warns
        -----
        UserWarning
            If another column looks like kelvin; if there are numbers that stand for a missing value, such as -999; if
            stamps are not in order; and for each kind of fault that `~skthermo.preprocessing.check_records` finds.
        """
        temperatures, frequencies = self._read_baseline(X)
        if self.scale is None:
            self._learn(temperatures, frequencies)
        else:
            self._out_of_fold(temperatures, frequencies)
        return self

    @overload
    def fit_transform(self, X: pd.DataFrame, y: None = None) -> pd.DataFrame: ...
    @overload
    def fit_transform(self, X: ArrayLike, y: None = None) -> NDArray[np.float64]: ...
    @_fit_context(prefer_skip_nested_validation=False)
    def fit_transform(self, X: ArrayLike, y: None = None) -> NDArray[np.float64] | pd.DataFrame:
        """Fit on all rows of a baseline, and give its out-of-fold residuals.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures in degrees Celsius and frequencies in Hz of the healthy structure, side by side.
        y : None
            Ignored.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_targets)
            In Hz, or dimensionless if scaled; each row predicted by a clone that was not fitted on its fold.

        Raises
        ------
        ValueError
            As in `fit`; if there are fewer rows than folds, or ``cv`` does not test every row exactly once.

        Warns
        -----
        UserWarning
            As in `fit`.
        """
        temperatures, frequencies = self._read_baseline(X)
        return frame_like(frequencies, self._out_of_fold(temperatures, frequencies))

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
            Measured minus predicted, in Hz, or dimensionless if scaled. For the rows of `fit` they are too small: use
            `fit_transform` there.

        Raises
        ------
        ValueError
            If columns differ from `fit`, or the estimator predicts another number of targets.

        Warns
        -----
        UserWarning
            As in `fit`, and if temperatures are far outside those of `fit`.
        """
        check_is_fitted(self)
        temperatures, frequencies = split_columns(X, validate_data(self, X, **AS_FLOATS, reset=False), self.targets_)
        weather = as_floats(temperatures)
        message = "" if np.isnan(weather).any(axis=1).all() else self.training_range_.warning(weather)
        if message and not hasattr(self.estimator_, "applicability"):  # which says so itself
            warn_user(message, "weather outside the training range")
        residuals = as_floats(frequencies) - self.regression_.predict(temperatures)
        return frame_like(frequencies, residuals if self.scale is None else self.spread_.whiten(weather, residuals))

    @overload
    def applicability(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def applicability(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def applicability(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
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
        temperatures, _ = split_columns(X, validate_data(self, X, **AS_FLOATS, reset=False), self.targets_)
        return frame_like(temperatures, self.training_range_.excess(temperatures))

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

    def _read_baseline(self, X: Any) -> tuple[Any, Any]:
        if isinstance(self.estimator, type):
            raise ValueError(f"estimator is the class {self.estimator.__name__}; expected an instance of it")
        values = validate_data(self, X, **AS_FLOATS, ensure_min_features=2)
        check_positions_are_names(self.targets, getattr(X, "columns", ()))
        self.targets_ = positions_of(self.targets, values.shape[1], getattr(self, "feature_names_in_", None))
        names = _check_feature_names_in(self, None)[self.targets_]
        check_columns(pd.DataFrame(values[:, self.targets_], columns=names), "frequency")
        temperatures, frequencies = split_columns(X, values, self.targets_)
        warn_of_disorder(X)
        named = pd.DataFrame(frequencies, copy=False).set_axis(names, axis=1)
        warn_each(check_records(pd.DataFrame(temperatures), named).warnings())
        return temperatures, frequencies

    def _learn(self, temperatures: Any, frequencies: Any) -> None:
        self.regression_ = CompleteRowsRegressor(self.estimator).fit(temperatures, frequencies)
        self.estimator_ = self.regression_.estimator_
        self.training_range_ = TrainingRange.of(temperatures, ~np.isnan(as_floats(frequencies)).all(axis=1))

    def _out_of_fold(self, temperatures: Any, frequencies: Any) -> Array:
        """Learn from all rows; residuals of each from a clone fitted on the other folds."""
        folds, untested = folds_of(self.cv, temperatures)
        self._learn(temperatures, frequencies)
        partition = [*folds, (untested, untested)] if untested.size else folds
        predicted = cross_val_predict(CompleteRowsRegressor(self.estimator), temperatures, frequencies, cv=partition)
        residuals, weather = as_floats(frequencies) - predicted, as_floats(temperatures)
        residuals[untested] = np.nan
        if self.scale is None:
            return residuals
        empty = np.isnan(residuals).all(axis=0)
        if empty.any():
            name = self.get_feature_names_out()[empty][0]
            raise ValueError(f"target {name!r} has no out-of-fold residual; expected records of it in several periods")
        size = np.fmax.reduce(np.abs(as_floats(frequencies)))
        self.spread_, white = Spread.of(weather, residuals, size, local=self.scale == "local")
        return white


def folds_of(cv: Any, X: Any) -> tuple[list[tuple[Rows, Rows]], Rows]:
    """Folds that test every row once, and the first rows, which a splitter that goes forward in time does not test."""
    folds = list(check_cv(cv).split(X))
    tested = np.bincount(np.concatenate([[], *(test for _, test in folds)]).astype(int), minlength=len(X))
    untested = np.arange(tested.argmax())
    wrong = len(untested) + np.flatnonzero(tested[len(untested) :] != 1)
    if wrong.size:
        raise ValueError(
            f"cv is {cv!r}, which tests row {wrong[0]} {tested[wrong[0]]} times ({wrong.size} of {len(X)} "
            "rows not exactly once); expected a partition of the rows, such as KFold makes, or of all but the "
            "first, as TimeSeriesSplit does"
        )
    return folds, untested


def split_columns(X: Any, values: NDArray, targets: NDArray[np.intp]) -> tuple[Any, Any]:
    """The other columns and the targets, as frames if X is one."""
    columns = np.asarray(getattr(X, "columns", range(values.shape[1])), dtype=object)
    others = np.delete(np.arange(len(columns)), targets)
    temperatures, frequencies = (frame_like(X, values[:, part], columns[part]) for part in (others, targets))
    warn_of_markers(pd.DataFrame(frequencies, copy=False).set_axis(columns[targets], axis=1))
    try:
        check_temperatures(pd.DataFrame(temperatures, copy=False).set_axis(columns[others], axis=1))
    except ValueError as error:  # only a warning, as another column may be something else than a temperature
        warn_user(str(error), "temperatures")
    return temperatures, frequencies
