"""Broken lines: features whose slopes change at knots."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._tables.arrays import as_floats, broken_lines
from skthermo._tables.frames import Table, frame_like, row_weights
from skthermo._validation import Interval, _check_feature_names_in, _fit_context
from skthermo.preprocessing._records import RecordTransformer


class HingeFeatures(RecordTransformer):
    """Append max(x - knot, 0) for some knots of every column, so that linear regression fits broken lines.

    Frequencies over temperature are broken lines: a bridge that freezes has a kink at 0 °C. Beyond the data the lines
    go on straight. By linear regression, scikit-learn's ``SplineTransformer(degree=1, extrapolation="linear")`` gives
    the same lines. Hinges do what it cannot: missing values pass through, and ridge regression penalises changes of
    slope rather than values.

    Parameters
    ----------
    n_knots : int, default=4
        Knots of each column, at quantiles that divide its values into ``n_knots + 1`` equal parts.

    Attributes
    ----------
    knots_ : ndarray of shape (n_knots, n_features)
        The knots of every column.
    n_features_in_ : int
        Number of columns.
    feature_names_in_ : ndarray of str
        Their names, where `fit` saw a frame with such names.

    See Also
    --------
    sklearn.preprocessing.SplineTransformer : Splines of any degree.

    Notes
    -----
    Missing values are ignored in `fit` and stay missing in `transform`.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.linear_model import LinearRegression
    >>> from sklearn.pipeline import make_pipeline
    >>> from skthermo.preprocessing import HingeFeatures
    >>> T = np.linspace(-10.0, 10.0, 41)[:, np.newaxis]
    >>> frequency = 4.0 + 0.05 * np.maximum(-T[:, 0], 0.0)
    >>> lines = make_pipeline(HingeFeatures(n_knots=1), LinearRegression()).fit(T, frequency)
    >>> lines.predict([[-20.0], [20.0]]).round(3)
    array([5., 4.])
    """

    _parameter_constraints: dict = {"n_knots": [Interval(Integral, 1, None, closed="left")]}

    def __init__(self, n_knots: int = 4):
        self.n_knots = n_knots

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: ArrayLike, y: None = None, sample_weight: ArrayLike | None = None) -> HingeFeatures:
        """Place the knots.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures in degrees Celsius, or any other inputs; NaN is ignored.
        y : None
            Ignored.
        sample_weight : array-like of shape (n_samples,), optional
            Weight of each row: how often its values count. Those of a series are matched to the rows of a frame by
            index.

        Returns
        -------
        HingeFeatures
            The fitted transformer.

        Raises
        ------
        ValueError
            If a column is NaN in every row, or in every row that has a weight; if weights are negative, NaN or
            infinite, all 0, or not one for each row.
        """
        self._learn(X, self._validated(X, reset=True), row_weights(sample_weight, X))
        return self

    def _learn(self, X: Table, values: NDArray, weights: NDArray | None = None) -> None:
        values = as_floats(values)
        if weights is not None:
            values = np.where(weights[:, np.newaxis] > 0, values, np.nan)
        empty = np.isnan(values).all(axis=0)
        if empty.any():
            name = _check_feature_names_in(self, None)[empty][0]
            raise ValueError(f"{name!r} is NaN in every row; expected values to place knots at")
        shares = np.linspace(0, 1, self.n_knots + 2)[1:-1]
        if weights is None:
            self.knots_ = np.nanquantile(values, shares, axis=0)
        else:
            self.knots_ = np.column_stack([weighted_quantiles(column, shares, weights) for column in values.T])

    def _transformed(self, X: Table, values: NDArray) -> Table:
        return frame_like(X, broken_lines(as_floats(values), self.knots_), self.get_feature_names_out())

    def _names(self, columns: Sequence[Hashable]) -> list[Hashable]:
        return [*columns, *(f"{name}_above{knot}" for knot in range(1, self.n_knots + 1) for name in columns)]


def weighted_quantiles(values: NDArray[np.float64], shares: NDArray, weights: NDArray) -> NDArray[np.float64]:
    """Quantiles of a column that NumPy's would be if each row were repeated as often as its weight says.

    NumPy interpolates between two rows, as does the mean over a window of unit weight that is used here.
    """
    known = ~np.isnan(values)
    order = np.argsort(values[known], kind="stable")
    values, weights = values[known][order], weights[known][order]
    position, integral = (np.append(0.0, np.cumsum(steps)) for steps in (weights, weights * values))
    window = min(1.0, position[-1])
    start = shares * (position[-1] - window)
    return (np.interp(start + window, position, integral) - np.interp(start, position, integral)) / window
