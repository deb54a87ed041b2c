"""Frequencies without what temperature explains of them."""

from collections.abc import Iterable, Sequence
from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.model_selection import BaseCrossValidator, check_cv, cross_val_predict

from skthermo._frames import check_columns, frame_like
from skthermo._validation import HasMethods, _check_feature_names_in, _fit_context, check_is_fitted, validate_data
from skthermo.detection._complete_rows import CompleteRowsRegressor

AS_FLOATS = {"dtype": np.float64, "ensure_all_finite": "allow-nan"}


class TemperatureCompensator(TransformerMixin, BaseEstimator):
    """Residuals of frequencies: measured minus predicted from the temperatures beside them.

    Parameters
    ----------
    estimator : regressor
        Predicts the targets from all other columns: any of scikit-learn's (in a ``MultiOutputRegressor``
        where it takes one target only), a pipeline with `LagFeatures`, or `DataInformedFEM`.
    targets : sequence of str or sequence of int
        Names of the frequency columns in a frame, or their positions counted from 0, in the order of
        the output.
    cv : int, cross-validation splitter or iterable, default=None
        Folds of `fit_transform`: None for 5 and an int for any number of folds of contiguous rows, or a
        splitter whose test parts hold every row once.

    Attributes
    ----------
    estimator_ : regressor
        Fitted clone.
    targets_ : ndarray of int
        Positions of the targets.
    n_features_in_ : int
        Number of columns, targets included.
    feature_names_in_ : ndarray of str
        Their names, where `fit` saw a frame with such names.

    See Also
    --------
    MahalanobisDetector : What residuals go to.

    Notes
    -----
    ``fit_transform(X)`` differs from ``fit(X).transform(X)`` by design. An estimator has seen the noise of the
    rows it was fitted on, so that their residuals are smaller than those of new records, and a threshold set
    on them alarms too often. `fit_transform` predicts every row by a clone that was fitted on the other folds,
    then fits on all rows for the records to come. A pipeline calls it in `fit`, and so
    ``make_pipeline(TemperatureCompensator(...), MahalanobisDetector())`` takes its threshold from out-of-fold
    residuals. Folds are of contiguous rows, which should come in order of time, because neighbouring records are
    alike: random folds would train on a row's neighbours. Where the baseline holds each season only once, a fold is
    predicted from other seasons, which makes its residuals and the threshold too large; more years, or more and
    shorter folds, mend that.

    A frame gives frames to the estimator, so that lags go by time, and gives a frame; an array gives arrays.

    Missing values flow through:

    - A missing target is NaN in its own residual only. Its row does not train the estimator, unless that has
      an FE model (`DataInformedFEM`, also at the end of a pipeline or in a search): such a chain gets all rows, for
      its lags, and leaves incomplete ones out itself.
    - A row where another column is missing is used if the estimator takes NaN: scikit-learn's tag ``allow_nan``
      says so, or an imputer in a pipeline fills it first. Else it does not train and its residuals are NaN.
    - Lags within the estimator reach across rows left out by time on a ``DatetimeIndex``; in other tables the rows
      around close up.

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

    A threshold from the training rows' own residuals is too low:

    >>> in_sample = MahalanobisDetector().fit(compensator.fit(baseline).transform(baseline))
    >>> print(f"{(in_sample.predict(compensator.transform(unseen)) == -1).mean():.0%} false alarms")
    16% false alarms
    """

    _parameter_constraints: dict = {
        "estimator": [HasMethods(["fit", "predict"])],
        "targets": ["array-like"],
        "cv": ["cv_object"],
    }

    def __init__(
        self,
        estimator: BaseEstimator,
        *,
        targets: Sequence[str] | Sequence[int],
        cv: int | BaseCrossValidator | Iterable | None = None,
    ):
        self.estimator = estimator
        self.targets = targets
        self.cv = cv

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: ArrayLike, y: None = None) -> "TemperatureCompensator":
        """Learn how the targets follow the other columns.

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
            If targets are not among the columns, repeat, or are all of them or none; if a target was never
            measured, or no row is complete.
        """
        temperatures, frequencies = self._read_baseline(X)
        self._regression = CompleteRowsRegressor(self.estimator).fit(temperatures, frequencies)
        self.estimator_ = self._regression.estimator_
        return self

    @_fit_context(prefer_skip_nested_validation=True)
    def fit_transform(self, X: ArrayLike, y: None = None) -> NDArray[np.float64] | pd.DataFrame:
        """Out-of-fold residuals of a baseline; then learn from all its rows.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures in degrees Celsius and frequencies in Hz of the healthy structure, side by side.
        y : None
            Ignored.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_targets)
            In Hz, each row predicted by a clone that has not seen its fold.

        Raises
        ------
        ValueError
            As in `fit`; if there are fewer rows than folds, or ``cv`` does not test every row once.
        """
        temperatures, frequencies = self._read_baseline(X)
        folds = self._folds(temperatures)
        predicted = cross_val_predict(CompleteRowsRegressor(self.estimator), temperatures, frequencies, cv=folds)
        self.fit(X)
        return frame_like(X, np.asarray(frequencies) - predicted, self.get_feature_names_out())

    def transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Residuals of new records.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures and frequencies, in the columns of `fit`.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_targets)
            In Hz, measured minus predicted; too small on the rows of `fit`.

        Raises
        ------
        ValueError
            If columns differ from `fit`, or the estimator predicts another number of targets.
        """
        check_is_fitted(self)
        temperatures, frequencies = self._split(X, validate_data(self, X, **AS_FLOATS, reset=False))
        residuals = np.asarray(frequencies) - self._regression.predict(temperatures)
        return frame_like(X, residuals, self.get_feature_names_out())

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Names of the targets.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of all columns; by default those seen in `fit`.

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self)
        return _check_feature_names_in(self, input_features)[self.targets_]

    def _read_baseline(self, X: Any) -> tuple[Any, Any]:
        values = validate_data(self, X, **AS_FLOATS, ensure_min_features=2)
        self.targets_ = _positions(self.targets, values.shape[1], getattr(self, "feature_names_in_", None))
        names = _check_feature_names_in(self, None)[self.targets_]
        check_columns(pd.DataFrame(values[:, self.targets_], columns=names), "frequency")
        return self._split(X, values)

    def _split(self, X: Any, values: NDArray) -> tuple[Any, Any]:
        """The other columns and the targets, as frames where X is one."""
        columns = np.asarray(getattr(X, "columns", range(values.shape[1])), dtype=object)
        others = np.delete(np.arange(len(columns)), self.targets_)
        return tuple(frame_like(X, values[:, part], columns[part]) for part in (others, self.targets_))

    def _folds(self, X: Any) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        folds = list(check_cv(self.cv).split(X))
        tested = np.bincount(np.concatenate([[], *(test for _, test in folds)]).astype(int), minlength=len(X))
        odd = np.flatnonzero(tested != 1)
        if odd.size:
            raise ValueError(
                f"cv is {self.cv!r}, which tests row {odd[0]} {tested[odd[0]]} times ({odd.size} of {len(X)} rows not "
                "exactly once); expected a partition of the rows, such as KFold makes"
            )
        return folds

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags


def _positions(targets: Any, n_columns: int, names: NDArray[np.object_] | None) -> NDArray[np.intp]:
    """Positions of the targets among the columns, by name or by index."""
    targets = list(targets)
    if targets and all(isinstance(target, str) for target in targets):
        if names is None:
            raise ValueError(f"targets are the names {targets}, but X has no column names; expected a frame or indexes")
        columns = list(names)
        unknown = [target for target in targets if columns.count(target) != 1]
        if unknown:
            raise ValueError(f"targets {unknown} are not columns of X, or more than one; expected some of {columns}")
        positions = [columns.index(target) for target in targets]
    elif all(isinstance(target, Integral) and not isinstance(target, bool) for target in targets):
        positions = [int(target) for target in targets]
        outside = [position for position in positions if not 0 <= position < n_columns]
        if outside:
            raise ValueError(f"targets {outside} are not columns of X; expected indexes from 0 to {n_columns - 1}")
    else:
        raise ValueError(f"targets is {targets}; expected names of columns or their indexes, not both")
    if len(set(positions)) < len(positions):
        raise ValueError(f"targets {targets} repeat a column; expected each once")
    if not 0 < len(positions) < n_columns:
        raise ValueError(
            f"targets are {len(positions)} of the {n_columns} columns of X; expected at least one, and at least one "
            "other column to predict them from"
        )
    return np.array(positions, dtype=np.intp)
