"""Fills gaps in monitoring records."""

from __future__ import annotations

from typing import Any, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.impute import KNNImputer

from skthermo._tables.arrays import rows_by_pattern
from skthermo._tables.frames import frame_like, warn_of_markers
from skthermo._validation import (
    _check_feature_names_in,
    _get_weights,
    _num_samples,
    check_array,
    check_is_fitted,
    validate_data,
    with_nan,
)
from skthermo.preprocessing._nearest import Donors

FLOATS = [np.float64, np.float32]


class KNNGapImputer(KNNImputer):
    """Fill gaps with the mean of the nearest records in which the value is present.

    scikit-learn's ``KNNImputer``, fast enough for years of hourly records. It takes ten neighbours, as the
    paper does; a frame stays a frame with its index; and a column without any value is an error instead of
    being dropped.

    Parameters
    ----------
    missing_values : int, float, str, numpy.nan, None or pandas.NA, default=numpy.nan
        The value that marks a missing value.
    n_neighbors : int, default=10
        Number of neighbours.
    weights : {"uniform", "distance"} or callable, default="uniform"
        Weights of the neighbours.
    metric : {"nan_euclidean"} or callable, default="nan_euclidean"
        Distance between rows.
    copy : bool, default=True
        True leaves the input unchanged; False may overwrite it.
    add_indicator : bool, default=False
        Whether to append a column of zeros and ones for each column with gaps; 1 marks a gap.
    keep_empty_features : bool, default=False
        True fills a column without any value with zeros; otherwise it is an error.

    Attributes
    ----------
    is_empty_ : ndarray of bool
        Columns that had no value in `fit`.
    donors_ : object or None
        Records of `fit`, prepared for the search of neighbours; None where ``KNNImputer`` does the search.
    indicator_ : MissingIndicator or None
        Makes the columns of ``add_indicator``.
    n_features_in_ : int
        Number of columns.
    feature_names_in_ : ndarray of str
        Their names, where `fit` saw a frame with such names.

    See Also
    --------
    sklearn.impute.KNNImputer : The parameters in full.

    Notes
    -----
    The results are those of ``KNNImputer``. It computes the distances between all pairs of rows, so its time
    grows with the square of the number of rows n. Here, rows with the same missing columns are searched
    together by k-d trees, and the time grows as n log n. ``KNNImputer`` itself does the work for few rows,
    for very many different patterns of missing columns, for another metric, and for other
    ``missing_values`` than NaN.

    Results can differ in two cases. Where several rows are equally far away, the two may choose different
    neighbours. And ``KNNImputer`` computes distances by a formula that loses digits of very small ones,
    which can change the ninth digit with ``weights="distance"``.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from skthermo.preprocessing import KNNGapImputer
    >>> F = pd.DataFrame({"f1": [4.0, 4.1, np.nan, 4.3], "f2": [5.0, 5.1, 5.1, 5.3]})
    >>> KNNGapImputer(n_neighbors=1).fit_transform(F).loc[[2]]
        f1   f2
    2  4.1  5.1
    """

    def __init__(
        self,
        *,
        missing_values: Any = np.nan,
        n_neighbors: int = 10,
        weights: Any = "uniform",
        metric: Any = "nan_euclidean",
        copy: bool = True,
        add_indicator: bool = False,
        keep_empty_features: bool = False,
    ):
        super().__init__(
            missing_values=missing_values,
            n_neighbors=n_neighbors,
            weights=weights,
            metric=metric,
            copy=copy,
            add_indicator=add_indicator,
            keep_empty_features=keep_empty_features,
        )

    def fit(self, X: ArrayLike, y: None = None) -> KNNGapImputer:
        if isinstance(self.n_neighbors, bool):
            raise ValueError(f"n_neighbors is {self.n_neighbors}; expected an integer")
        if isinstance(self.weights, type) or isinstance(self.metric, type):
            raise ValueError(f"weights is {self.weights!r} and metric {self.metric!r}; expected no class")
        X = with_nan(X)
        super().fit(X, y)
        kept = set(super().get_feature_names_out())
        self.is_empty_ = np.array([name not in kept for name in _check_feature_names_in(self, None)])
        if self.is_empty_.any() and not self.keep_empty_features:
            empty = list(_check_feature_names_in(self, None)[self.is_empty_])
            raise ValueError(
                f"the columns {empty} are missing in all {_num_samples(X)} rows; expected values to "
                "impute from: leave them out, or keep_empty_features=True fills them with zeros"
            )
        self.donors_ = None
        if self.metric == "nan_euclidean" and isinstance(self.missing_values, float) and np.isnan(self.missing_values):
            values = check_array(X, dtype=np.float64, ensure_all_finite="allow-nan", copy=True)
            warn_of_markers(frame_like(X, values))
            self.donors_ = Donors(values)
        return self

    @overload
    def transform(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def transform(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        check_is_fitted(self)
        X, values = with_nan(X), None
        names = [*getattr(X, "columns", ()), *self.get_feature_names_out()[self.n_features_in_ :]]
        if self.donors_ is not None:
            values = validate_data(self, X, dtype=FLOATS, ensure_all_finite="allow-nan", reset=False)
        if values is None or not self.donors_.trees_are_faster(np.isnan(values)):
            return frame_like(X, np.asarray(super().transform(X)), names)
        filled = self._filled(values)
        if self.add_indicator:
            filled = np.hstack([filled, self.indicator_.transform(np.isnan(values))])
        return frame_like(X, filled, names)

    def _filled(self, values: NDArray) -> NDArray:
        """Fill each missing column of rows with the same missing columns with means of their nearest donors."""
        filled = values.copy()
        for missing, rows in rows_by_pattern(np.isnan(values)):
            observed = ~missing
            for column in np.flatnonzero(missing & ~self.is_empty_):
                distances, donors = self.donors_.nearest(values[rows], observed, column, self.n_neighbors)
                filled[rows, column] = self._mean(distances, self.donors_.values[donors, column], column)
        filled[:, self.is_empty_] = 0
        return filled

    def _mean(self, distances: NDArray, values: NDArray, column: int) -> NDArray:
        present = np.isfinite(distances)
        weights = _get_weights(np.where(present, distances, np.nan), self.weights)
        weights = np.where(present, 1.0 if weights is None else weights, 0.0)
        total = weights.sum(axis=1)
        mean = np.full(len(values), self.donors_.mean(column))
        np.divide((weights * np.where(present, values, 0)).sum(axis=1), total, out=mean, where=total > 0)
        return mean

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        check_is_fitted(self)
        names = list(_check_feature_names_in(self, input_features))
        indicators = [name for name in super().get_feature_names_out(input_features) if name not in names]
        return np.array(names + indicators, dtype=object)
