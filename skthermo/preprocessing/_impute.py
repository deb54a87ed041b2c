"""Gaps in monitoring records."""

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.impute import KNNImputer

from skthermo._frames import frame_like
from skthermo._validation import (
    _check_feature_names_in,
    _get_weights,
    _num_samples,
    check_array,
    check_is_fitted,
    validate_data,
)
from skthermo.preprocessing._nearest import Donors, row_patterns

FLOATS = [np.float64, np.float32]


class KNNGapImputer(KNNImputer):
    """Fill gaps with the mean of the nearest complete neighbours.

    scikit-learn's ``KNNImputer`` with the ten neighbours of the paper, at the scale of years of hourly
    records; a frame stays a frame with its index, and a column without any value is an error and not
    dropped.

    Parameters
    ----------
    missing_values : int, float, str, numpy.nan, None or pandas.NA, default=numpy.nan
        What stands for a missing value.
    n_neighbors : int, default=10
        Number of neighbours.
    weights : {"uniform", "distance"} or callable, default="uniform"
        Weights of the neighbours.
    metric : {"nan_euclidean"} or callable, default="nan_euclidean"
        Distance between rows.
    copy : bool, default=True
        Whether to leave the input as it is.
    add_indicator : bool, default=False
        Whether to append columns that mark what was missing.
    keep_empty_features : bool, default=False
        True fills a column without any value with zeros instead of refusing it.

    See Also
    --------
    sklearn.impute.KNNImputer : The parameters in full.

    Notes
    -----
    Values are those of ``KNNImputer``. It computes the distance of every pair of rows, which grows with the
    square of their number; here trees are searched for each pattern of missing columns, which grows as
    n log n. Data of few rows or very many patterns, another metric and other ``missing_values`` than NaN are
    left to it. Where several rows are exactly as far away as the last neighbour, either may choose any; and
    distances are computed directly here, by an expansion there that loses digits of very small ones, which
    ``weights="distance"`` can show in the ninth digit.

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

    def fit(self, X: ArrayLike, y: None = None) -> "KNNGapImputer":
        """Remember the rows among which neighbours are sought.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Records with gaps, such as temperatures and frequencies side by side.
        y : None
            Ignored.

        Returns
        -------
        KNNGapImputer
            The fitted imputer.

        Raises
        ------
        ValueError
            If a column holds no value at all, unless ``keep_empty_features``.
        """
        super().fit(X, y)
        kept = set(super().get_feature_names_out())
        self._is_empty = np.array([name not in kept for name in _check_feature_names_in(self, None)])
        if self._is_empty.any() and not self.keep_empty_features:
            empty = list(_check_feature_names_in(self, None)[self._is_empty])
            raise ValueError(
                f"the columns {empty} are missing in all {_num_samples(X)} rows; expected values to "
                "impute from: leave them out, or keep_empty_features=True fills them with zeros"
            )
        self._donors = None
        if self.metric == "nan_euclidean" and isinstance(self.missing_values, float) and np.isnan(self.missing_values):
            self._donors = Donors(check_array(X, dtype=np.float64, ensure_all_finite="allow-nan", copy=True))
        return self

    def transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Fill the gaps.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Records with gaps.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_features)
            A frame gives a frame on its own index.
        """
        check_is_fitted(self)
        values = None
        if self._donors is not None:
            values = validate_data(self, X, dtype=FLOATS, ensure_all_finite="allow-nan", reset=False)
        if values is None or not self._donors.are_worth_trees(np.isnan(values)):
            return frame_like(X, super().transform(X), self.get_feature_names_out())
        filled = self._filled(values)
        if self.add_indicator:
            filled = np.hstack([filled, self.indicator_.transform(np.isnan(values))])
        return frame_like(X, filled, self.get_feature_names_out())

    def _filled(self, values: NDArray) -> NDArray:
        """Weighted means of the nearest donors, for each pattern of missing columns and each of these."""
        filled = values.copy()
        for missing, rows in row_patterns(np.isnan(values)):
            observed = ~missing
            for column in np.flatnonzero(missing & ~self._is_empty):
                distances, donors = self._donors.nearest(values[rows], observed, column, self.n_neighbors)
                filled[rows, column] = self._mean(distances, self._donors.values[donors, column], column)
        filled[:, self._is_empty] = 0
        return filled

    def _mean(self, distances: NDArray, values: NDArray, column: int) -> NDArray:
        present = np.isfinite(distances)
        weights = _get_weights(np.where(present, distances, np.nan), self.weights)
        weights = np.where(present, 1.0 if weights is None else weights, 0.0)
        total = weights.sum(axis=1)
        mean = np.full(len(values), self._donors.mean(column))
        np.divide((weights * np.where(present, values, 0)).sum(axis=1), total, out=mean, where=total > 0)
        return mean

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Names of the columns: those of the input, and of the indicators where asked for.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the input's columns; by default those seen in `fit`.

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self)
        names = list(_check_feature_names_in(self, input_features))
        indicators = [name for name in super().get_feature_names_out(input_features) if name not in names]
        return np.array(names + indicators, dtype=object)
