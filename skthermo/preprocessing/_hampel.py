"""Removes values that are far from their neighbours in time."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from datetime import timedelta
from numbers import Integral, Real

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import Array, median, robust_deviation, spread_evenly
from skthermo._core.estimators import Interval
from skthermo._core.frames import Table, check_duration, frame_like, has_stamps, positions_of, row_times
from skthermo.preprocessing._transformers import DURATION, RecordTransformer
from skthermo.preprocessing._weather_lines import WeatherLines, distances_from_neighbours, ridge, without_far


class HampelFilter(RecordTransformer):
    """NaN in place of values that are far from the median of their neighbours in time.

    With ``targets``, the other columns are the weather. A regression on the weather is subtracted from the targets
    before values are compared with their neighbours. A frost night then is no outlier, and neither is damage, which
    stays.

    Parameters
    ----------
    window : int or duration, default=25
        Neighbours of a value, half of them before it: a number of rows or, for frames on a ``DatetimeIndex``, a
        duration such as "1D".
    n_deviations : float, default=5.0
        Number of standard deviations beyond which a value is removed. The standard deviation is estimated by the median
        distance of the neighbours or of all records, whichever is larger.
    targets : sequence of str or sequence of int, optional
        Names of the frequency columns in a frame, or their positions counted from 0. The other columns, temperatures,
        stay as they are. By default all columns are filtered, each by itself.

    Attributes
    ----------
    n_removed_ : ndarray of shape (n_features,)
        Number of values of each column that `fit` has found to be outliers.
    deviations_ : ndarray of shape (n_features,)
        Standard deviation of each column about the median of its neighbours, by the median of the distances; NaN for
        the weather.
    targets_ : ndarray of int
        Positions of the columns that are filtered.
    regression_ : object or None
        The targets as piecewise-linear functions of the weather; None without targets.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of columns and, where `fit` saw a frame with such, their names.

    See Also
    --------
    check_records : Counts outliers, and finds other faults of records.

    Notes
    -----
    Clean the records that an FE model or a detector learns from. Do not clean records before a detector evaluates them
    one by one: a threshold for outliers is also one for damage that comes and goes.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.preprocessing import HampelFilter
    >>> F = np.random.default_rng(0).normal(4.0, 0.02, (200, 2))
    >>> F[50, 1] = 4.8
    >>> hampel = HampelFilter().fit(F)
    >>> hampel.n_removed_
    array([0, 1])
    >>> bool(np.isnan(hampel.transform(F)[50, 1]))
    True
    """

    _parameter_constraints: dict = {
        "window": [Interval(Integral, 3, None, closed="left"), *DURATION],
        "n_deviations": [Interval(Real, 0, None, closed="neither")],
        "targets": "no_validation",
    }

    def __init__(
        self,
        window: int | str | timedelta = 25,
        *,
        n_deviations: float = 5.0,
        targets: Sequence[Hashable] | None = None,
    ):
        self.window = window
        self.n_deviations = n_deviations
        self.targets = targets

    def _learn(self, X: Table, values: NDArray) -> None:
        self.targets_, self.regression_ = np.arange(values.shape[1]), None
        if self.targets is not None:
            self.targets_ = positions_of(self.targets, values.shape[1], getattr(X, "columns", ()))
            T, F = np.delete(values, self.targets_, axis=1), values[:, self.targets_]
            self.regression_ = WeatherRegression.learned(T, F)
        self.deviations_ = np.full(values.shape[1], np.nan)
        self.n_removed_ = np.zeros(values.shape[1], dtype=int)
        distances, local = self._distances(X, values)
        self.deviations_[self.targets_] = np.nan_to_num(robust_deviation(distances))
        self.n_removed_[self.targets_] = self._far(distances, local).sum(axis=0)

    def _transformed(self, X: Table, values: NDArray) -> Table:
        cleaned = values.copy()
        far = np.zeros(values.shape, dtype=bool)
        far[:, self.targets_] = self._far(*self._distances(X, values))
        cleaned[far] = np.nan
        return frame_like(X, cleaned)

    def _validated(self, X: ArrayLike, *, reset: bool) -> NDArray:
        return super()._validated(X, reset=reset, ensure_min_features=2 if reset and self.targets is not None else 1)

    def _distances(self, X: Table, values: NDArray) -> tuple[Array, Array]:
        """Distance of each value of the targets from the median of its neighbours, and their standard deviation."""
        rest = values[:, self.targets_]
        if self.regression_ is not None:
            predicted = self.regression_.predict(np.delete(values, self.targets_, axis=1))
            rest = rest - np.where(np.isnan(predicted), self.regression_.centre, predicted)
        return distances_from_neighbours(rest, row_times(X), self._rows_or_duration(X))

    def _far(self, distances: Array, local: Array) -> NDArray[np.bool_]:
        with np.errstate(invalid="ignore"):
            return np.abs(distances) > self.n_deviations * np.fmax(local, self.deviations_[self.targets_])

    def _rows_or_duration(self, X: Table) -> int | pd.Timedelta:
        if isinstance(self.window, Integral) and not isinstance(self.window, np.timedelta64):
            return int(self.window)
        if not has_stamps(X):
            raise ValueError(f"window is {self.window!r}, but X has no DatetimeIndex; expected a number of rows")
        return check_duration(self.window, "window", may_be_zero=False)


@dataclass(frozen=True)
class WeatherRegression:
    """Frequencies as piecewise-linear functions of the weather."""

    lines: WeatherLines
    coefficients: Array
    centre: Array

    @classmethod
    def learned(cls, T: Array, F: Array) -> WeatherRegression:
        """Learn from records, the second time without values that were far away the first time."""
        rows = spread_evenly(np.arange(len(T)), 20_000)
        lines, centre = WeatherLines.learned(T), median(F[rows])
        inputs, values = lines.inputs(T[rows])[1], F[rows] - centre
        near = without_far(values, values - inputs @ ridge(inputs, values))
        return cls(lines, ridge(inputs, near), centre)

    def predict(self, T: Array) -> Array:
        """Frequencies, (n_samples, n_modes); NaN where no sensor has a value."""
        return self.lines.inputs(T)[1] @ self.coefficients + self.centre
