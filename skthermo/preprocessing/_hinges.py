"""Broken lines: features whose slopes change at knots."""

from numbers import Integral
from typing import overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator

from skthermo._frames import frame_like
from skthermo._validation import (
    Interval,
    TransformerMixin,
    _check_feature_names_in,
    _fit_context,
    check_is_fitted,
    validate_data,
)


class HingeFeatures(TransformerMixin, BaseEstimator):
    """Append max(x - knot, 0) for some knots of every column, so that linear regression fits broken lines.

    Frequencies over temperature are broken lines: a bridge that freezes has a kink at 0 °C. Beyond the data the lines
    go on straight. Ridge regression penalises their changes of slope.

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
    sklearn.preprocessing.SplineTransformer : Splines of any degree; ridge regression then penalises values, not slopes.

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
    def fit(self, X: ArrayLike, y: None = None) -> "HingeFeatures":
        """Place the knots.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures in degrees Celsius, or any other inputs; NaN is ignored.
        y : None
            Ignored.

        Returns
        -------
        HingeFeatures
            The fitted transformer.

        Raises
        ------
        ValueError
            If a column is NaN in every row.
        """
        values = validate_data(self, X, dtype=np.float64, ensure_all_finite="allow-nan")
        empty = np.isnan(values).all(axis=0)
        if empty.any():
            name = _check_feature_names_in(self, None)[empty][0]
            raise ValueError(f"{name!r} is NaN in every row; expected values to place knots at")
        self.knots_ = np.nanquantile(values, np.linspace(0, 1, self.n_knots + 2)[1:-1], axis=0)
        return self

    @overload
    def transform(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def transform(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Append the hinges.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            In the columns of `fit`; NaN stays NaN.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_features * (1 + n_knots))
            The columns of X, then max(x - knot, 0) of all columns for each knot.
        """
        check_is_fitted(self)
        values = validate_data(self, X, dtype=np.float64, ensure_all_finite="allow-nan", reset=False)
        hinges = [np.maximum(values - knots, 0.0) for knots in self.knots_]
        return frame_like(X, np.hstack([values, *hinges]), self.get_feature_names_out())

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Names of the columns.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the columns of X; by default those seen in `fit`.

        Returns
        -------
        ndarray of str
            ``T`` itself, ``T_above1`` for its first knot, and so on.
        """
        check_is_fitted(self)
        names = _check_feature_names_in(self, input_features)
        above = [f"{name}_above{knot}" for knot in range(1, self.n_knots + 1) for name in names]
        return np.array([*names, *above], dtype=object)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags
