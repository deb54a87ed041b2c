"""Transformers of records: their base, and transformers that treat each row for itself."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from datetime import timedelta
from numbers import Integral
from typing import Any, Literal, Self, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import as_floats, by_mode, is_model, means_of_known, piecewise_linear, real_array
from skthermo._core.estimators import (
    Estimator,
    HasMethods,
    Interval,
    StrOptions,
    TransformerMixin,
    _check_feature_names_in,
    _fit_context,
    check_array,
    check_is_fitted,
)
from skthermo._core.frames import Table, frame_like, marker_findings, row_weights
from skthermo._core.warnings import warn_each

DURATION = (str, timedelta, np.timedelta64, pd.offsets.BaseOffset)
"""Types of durations."""


class RecordTransformer(TransformerMixin, Estimator):
    """A transformer that gives a row for every record, and a frame on the same index for a frame."""

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: ArrayLike, y: None = None) -> Self:
        """Learn from records.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures in degrees Celsius, frequencies in Hz or other columns, as the class says; NaN is ignored.
        y : None
            Ignored.

        Returns
        -------
        Self
            The fitted transformer.

        Raises
        ------
        ValueError
            If X holds other values than numbers, or lacks an index that a parameter asks for, such as stamps, each
            once, for a duration.
        """
        self._learn(X, self._validated(X, reset=True))
        return self

    @overload
    def transform(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def transform(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Transform each record as the class describes.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            In the columns and the units of `fit`; NaN is allowed.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_features_out)
            In the columns of `get_feature_names_out`. A frame gives a frame on its own index.

        Raises
        ------
        ValueError
            If the number or names of columns, or the kind of index, differ from `fit`.
        """
        check_is_fitted(self)
        return self._transformed(X, self._validated(X, reset=False))

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Names of the columns that `transform` gives.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the columns of X; by default those seen in `fit`.

        Returns
        -------
        ndarray of str
            Names such as ``T1``, ``T1_lag0``, ``T1_mean30D``, or ``T1_above1`` for the hinge at its first knot.
        """
        check_is_fitted(self)
        return np.array(self._names(_check_feature_names_in(self, input_features)), dtype=object)

    def _refuse_empty(self, values: NDArray) -> None:
        empty = np.isnan(values).all(axis=0)
        if empty.any():
            name = _check_feature_names_in(self, None)[empty][0]
            raise ValueError(f"column {name!r} is NaN in all {len(values)} rows; expected values")

    @abstractmethod
    def _learn(self, X: Table, values: NDArray) -> None:
        """Learn from X and its checked values."""

    @abstractmethod
    def _transformed(self, X: Table, values: NDArray) -> Table:
        """The result of `transform`, from X and its checked values."""

    def _names(self, columns: Sequence[Hashable]) -> list[Hashable]:
        """Names of the results for columns of these names: by default the same."""
        return list(columns)


class HingeFeatures(RecordTransformer):
    """Append max(x - knot, 0) for some knots of every column, so that linear regression is piecewise-linear.

    Frequencies are piecewise-linear in temperature: a bridge that freezes has a kink at 0 °C. Beyond the data the lines
    go on straight. By linear regression, scikit-learn's ``SplineTransformer(degree=1, extrapolation="linear")`` gives
    the same lines. Beyond it, hinges pass missing values through, and ridge regression on them penalises changes of
    slope rather than values.

    Parameters
    ----------
    n_knots : int, default=4
        Knots of each column, at quantiles that divide its values into ``n_knots + 1`` equal parts.

    Attributes
    ----------
    knots_ : ndarray of shape (n_knots, n_features)
        The knots of every column.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of columns and, where `fit` saw a frame with such, their names.

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
        if weights is not None:
            values = np.where(weights[:, np.newaxis] > 0, values, np.nan)
        self._refuse_empty(values)
        shares = np.linspace(0, 1, self.n_knots + 2)[1:-1]
        if weights is None:
            self.knots_ = np.nanquantile(values, shares, axis=0)
        else:
            self.knots_ = np.column_stack([weighted_quantiles(column, shares, weights) for column in values.T])

    def _transformed(self, X: Table, values: NDArray) -> Table:
        return frame_like(X, piecewise_linear(values, self.knots_), self.get_feature_names_out())

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


class SensorMeans(RecordTransformer):
    """Mean of the sensors of each role.

    Structures differ in number, names and places of their thermometers. Their mean by role ("air", "deck") is an input
    that all of them have.

    A sensor that fails does not make the mean jump: `fit` learns by how much each sensor differs from the others of its
    role, and `transform` allows for it where some are missing.

    Parameters
    ----------
    roles : mapping of str or int to str, optional
        Role of each column, by its name, or by its position in arrays. Columns whose role is None are left out. By
        default all columns have one role, "ambient".

    Attributes
    ----------
    columns_ : dict of str to list of int
        Positions of the columns of each role. Roles are sorted, as they are after `transform`.
    offsets_ : ndarray of shape (n_features,)
        By how much each sensor reads more than the mean of its role; NaN where a column is left out.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of columns and, where `fit` saw a frame with such, their names.

    See Also
    --------
    LagFeatures : Earlier values of the means.

    Notes
    -----
    The offsets minimise the squares of x_ti - r_t - d_i over the values that are there, where r_t is the mean of the
    role in record t and the offsets d_i of its sensors sum to zero. In records without gaps, the result is the plain
    mean; where all sensors of a role are missing, it is NaN.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from skthermo.preprocessing import SensorMeans
    >>> T = pd.DataFrame({"T1": [4.0, 8.0, np.nan], "T2": [6.0, 10.0, 3.0], "slab": [5.0, 7.0, 6.0]})
    >>> SensorMeans({"T1": "air", "T2": "air", "slab": "deck"}).fit_transform(T)
       air  deck
    0  5.0   5.0
    1  9.0   7.0
    2  2.0   6.0
    """

    _parameter_constraints: dict = {"roles": [Mapping, None]}

    def __init__(self, roles: Mapping[Hashable, str | None] | None = None):
        self.roles = roles

    def _learn(self, X: Table, values: NDArray) -> None:
        role_of = self._read_roles()
        roles = sorted({role for role in role_of if role is not None})
        self.columns_ = {role: [i for i, own in enumerate(role_of) if own == role] for role in roles}
        self.offsets_ = np.full(values.shape[1], np.nan)
        for columns in self.columns_.values():
            self.offsets_[columns] = offsets_between(values[:, columns])

    def _transformed(self, X: Table, values: NDArray) -> Table:
        level = values - self.offsets_
        means = [means_of_known(level[:, columns], axis=1) for columns in self.columns_.values()]
        return frame_like(X, np.column_stack(means), self.columns_)

    def _names(self, columns: Sequence[Hashable]) -> list[Hashable]:
        return list(self.columns_)

    def _read_roles(self) -> list[str | None]:
        names = list(getattr(self, "feature_names_in_", range(self.n_features_in_)))
        if self.roles is None:
            return ["ambient"] * len(names)
        if set(self.roles) != set(names):
            wanted = f"{list(map(str, names))}, with None as the role of a column that is left out"
            raise ValueError(f"roles names the columns {sorted(map(str, self.roles))}; expected each of {wanted}")
        found = [self.roles[name] for name in names]
        if not all(role is None or isinstance(role, str) for role in found) or not any(found):
            raise ValueError(f"roles is {self.roles!r:.200}; expected names such as 'air', or None, and one at least")
        return found


def offsets_between(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """By how much columns differ from their mean, by least squares over the values that are there."""
    known = ~np.isnan(values)
    means = means_of_known(values, axis=1)[:, np.newaxis]
    shares = known / np.maximum(known.sum(axis=1, keepdims=True), 1)
    normal = np.diag(known.sum(axis=0)) - known.T @ shares
    # singular, because only differences are known: its zero eigenvalues are rounding errors of any size
    return np.linalg.lstsq(normal, np.where(known, values - means, 0.0).sum(axis=0), rcond=1e-9)[0]


class BiasAligner(RecordTransformer):
    """Move measured frequencies so that their means are the model's frequencies, equation (22) [KCM26]_.

    Parameters
    ----------
    reference : array-like of shape (n_modes,) or (n_samples, n_modes), FE model, "simulations" or None, default=None
        Means of the frequencies after `transform`: a vector in Hz; a table, such as simulated frequencies, which stands
        for its means; or an FE model, which stands for its nominal frequencies. For the aligner of a
        `~skthermo.surrogate.DataInformedFEM`, None stands for the chain's model, and "simulations" for the frequencies
        by which its `~skthermo.surrogate.InverseSurrogate` has learned, the paper's reference. Elsewhere, None stands
        for zeros, or for ones with ``method="scale"``.
    method : {"shift", "scale"}, default="shift"
        ``F - mean(F) + reference``, or ``F / mean(F) * reference``, which keeps relative changes.

    Attributes
    ----------
    mean_ : ndarray of shape (n_modes,)
        Means of the measured frequencies in Hz, NaN ignored.
    reference_ : ndarray of shape (n_modes,)
        Means after `transform`, in Hz.
    findings_ : list of SkthermoWarning
        Doubts about the records of `fit`, which it also gives as warnings.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of modes and, where `fit` saw a frame with such, their names.

    Examples
    --------
    >>> from skthermo.preprocessing import BiasAligner
    >>> aligner = BiasAligner([4.0, 9.0]).fit([[3.9, 9.3], [4.3, 9.5]])
    >>> aligner.transform([[4.1, 9.5]]).round(3)
    array([[4. , 9.1]])
    >>> aligner.inverse_transform([[4.0, 9.1]]).round(3)
    array([[4.1, 9.5]])
    """

    _parameter_constraints: dict = {
        "reference": ["array-like", HasMethods(["frequencies"]), StrOptions({"simulations"}), None],
        "method": [StrOptions({"shift", "scale"})],
    }

    def __init__(self, reference: Any = None, *, method: Literal["shift", "scale"] = "shift"):
        self.reference = reference
        self.method = method

    def _learn(self, X: Table, values: NDArray) -> None:
        self._refuse_empty(values)
        self.findings_ = marker_findings(frame_like(X, values))
        self.mean_ = np.nanmean(values, axis=0)
        self.reference_ = self._read_reference(values.shape[1])
        if self.method == "scale":
            for what, factors in (("mean", self.mean_), ("reference", self.reference_)):
                if (factors == 0).any():
                    name = self.get_feature_names_out()[factors == 0][0]
                    raise ValueError(f"the {what} of mode {name!r} is zero; expected another number to scale by")
        warn_each(self.findings_)

    def _transformed(self, X: Table, values: NDArray) -> Table:
        return frame_like(X, self._moved(values, self.mean_, self.reference_))

    def _moved(self, values: NDArray, old: NDArray, new: NDArray) -> NDArray:
        return values / old * new if self.method == "scale" else values - old + new

    @overload
    def inverse_transform(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def inverse_transform(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def inverse_transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Shift or scale the model's frequencies back to the measured ones.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            In Hz; NaN stays NaN.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_modes)
            Frequencies in the measured domain in Hz.
        """
        check_is_fitted(self)
        if hasattr(X, "columns") and hasattr(self, "feature_names_in_"):
            F = self._validated(X, reset=False)
        else:  # frequencies of a model have no column names
            F = check_array(X)
        if F.shape[1] != self.n_features_in_:
            raise ValueError(f"X has {F.shape[1]} features; expected {self.n_features_in_} modes, as in fit")
        return frame_like(X, self._moved(F, self.reference_, self.mean_))

    def _read_reference(self, n_modes: int) -> NDArray[np.float64]:
        if self.reference is None:
            return np.full(n_modes, 1.0 if self.method == "scale" else 0.0)
        if isinstance(self.reference, str):
            hint = "expected the aligner of a DataInformedFEM with one"
            raise ValueError(f"reference is 'simulations', but no InverseSurrogate has simulated any; {hint}")
        if is_model(self.reference):
            reference = as_floats(self.reference.frequencies(np.ones((1, len(self.reference.parameter_names)))))[0]
        else:
            names = getattr(self, "feature_names_in_", None)
            means = np.mean(self.reference, axis=0) if np.ndim(self.reference) == 2 else self.reference
            reference = real_array(by_mode(means, n_modes, names, "reference"), "reference")
        if reference.shape != (n_modes,) or not np.isfinite(reference).all():
            expected = f"a frequency for each of the {n_modes} modes of X"
            raise ValueError(f"reference {reference} has shape {reference.shape}; expected {expected}")
        return reference
