"""Exponentially weighted means of earlier temperatures as additional columns."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from datetime import timedelta
from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._estimators.warnings import warn_user
from skthermo._tables.frames import Table
from skthermo._tables.text import duration_text
from skthermo._validation import check_is_fitted
from skthermo.exceptions import FewRecordsWarning
from skthermo.preprocessing._records import PastFeatures
from skthermo.preprocessing._stamps import as_duration

REACH = 4  # time constants beyond which records have no weight; they would have 2 % of it
PAST = 2  # time constants after the first record from which means are as good as later
LONGEST = np.timedelta64(10 * 365, "D")
LONGEST_STRETCH = 300.0  # time constants whose weights are multiplied up without overflow


class ExponentialMeans(PastFeatures):
    """Append exponentially weighted means of sensors: soil and large concrete follow the air late.

    A body that exchanges heat with the air has the exponentially weighted mean of the air's temperature, with a time
    constant of hours (steel), of a day (thick concrete) or of weeks (soil).

    Parameters
    ----------
    time_constants : sequence of str, timedelta or int, default=("30D",)
        Time constants, such as ``("12h", "30D")``: the weight of a record falls by a factor of e in this time. At most
        ten years. Integers count rows, for arrays and frames without a DatetimeIndex.
    sensors : sequence of str or int, optional
        Sensors that get means, by name or position; by default all.

    Attributes
    ----------
    time_constants_ : ndarray
        Time constants, in nanoseconds on a DatetimeIndex, else in rows.
    sensors_ : ndarray of int
        Positions of the sensors that get means.
    history_ : ndarray of shape (n_samples, n_sensors) or None
        Records of `fit`, which means of `transform` reach back to; None where rows are consecutive.
    stamps_ : ndarray of datetime64 or None
        Their stamps, in UTC where they have a time zone.
    time_zone_ : str or None
        Time zone of the stamps.
    first_row_ : ndarray of shape (n_sensors,)
        Earliest record of `fit`: means of records that begin with it have no past, and no warning says so again.
    lookback_ : int or numpy.timedelta64
        How far back means look: a number of rows, or a time on a DatetimeIndex.
    n_features_in_ : int
        Number of sensors.
    feature_names_in_ : ndarray of str
        Their names, where `fit` saw a frame with such names.

    See Also
    --------
    find_memory : Finds out whether such means explain frequencies, and with which time constant.
    LagFeatures : Single earlier values, for delays of hours.

    Notes
    -----
    The mean of a record at time t is that of the known values at s with weights exp(-(t - s) / time constant), for
    t - s up to four time constants, the record's own value included. Near the first record it is the mean of what is
    known. Missing values have no weight, and a mean is NaN only where no value is known.

    Records of `fit` and of `transform` count together, as in `LagFeatures`: for a stamp in both, the values of
    `transform`. Rows may come in any order, which the result keeps. Without a DatetimeIndex rows count as consecutive,
    and those of `fit` are not used in `transform`. There is a warning if more than half of the rows have no record that
    is older than the longest time constant, and do not begin as the records of `fit` do.

    Examples
    --------
    >>> import pandas as pd
    >>> from skthermo.preprocessing import ExponentialMeans
    >>> days = pd.date_range("2025-01-01", periods=4)
    >>> T = pd.DataFrame({"air": [4.0, 4.0, 9.0, 9.0]}, index=days)
    >>> means = ExponentialMeans(["2D"]).fit(T[:3])
    >>> means.transform(T).round(2)
                air  air_mean2D
    2025-01-01  4.0        4.00
    2025-01-02  4.0        4.00
    2025-01-03  9.0        6.53
    2025-01-04  9.0        7.66
    >>> means.transform(T[3:]).round(2)
                air  air_mean2D
    2025-01-04  9.0        7.66
    >>> ExponentialMeans(["2D"]).fit(T.to_numpy())
    Traceback (most recent call last):
    ...
    ValueError: time constant '2D' is a duration, but X has no DatetimeIndex; expected a number of rows
    """

    _parameter_constraints: dict = {"time_constants": ["array-like"], "sensors": ["array-like", None]}

    def __init__(
        self,
        time_constants: Sequence[str | timedelta | int] = ("30D",),
        *,
        sensors: Sequence[Hashable] | None = None,
    ):
        self.time_constants = time_constants
        self.sensors = sensors

    def _learn(self, X: Table, values: NDArray) -> None:
        stamps = self._remember(X, values)
        self.time_constants_ = _read_time_constants(self.time_constants, stamps is not None)
        self.sensors_ = self._read_sensors(values.shape[1])
        self.first_row_ = values[0 if stamps is None else stamps.argmin()].copy()

    def _features(
        self, X: Table, values: NDArray, stamps: pd.DatetimeIndex | None
    ) -> tuple[NDArray, NDArray | np.bool_]:
        if stamps is None:
            own, records = np.arange(len(values)), values
            times = own
        else:
            own = stamps.as_unit("ns").asi8
            times, records = self._joined(self._found(own, REACH * self._longest), own, values)
        order = np.argsort(times, kind="stable")
        sorted_times, sorted_records = times[order], records[np.ix_(order, self.sensors_)]
        rows = np.argsort(order)[len(order) - len(own) :]
        means = [trailing_means(sorted_times, sorted_records, int(constant))[rows] for constant in self.time_constants_]
        told = self._warn_of_no_past(X, values, own, sorted_times)
        return np.hstack([values, *means]).astype(values.dtype, copy=False), told

    def lacks_past(self, X: pd.DataFrame) -> NDArray[np.bool_]:
        """Which rows follow the first record by less than two time constants: their means lack the weather before.

        Parameters
        ----------
        X : DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius on a DatetimeIndex.

        Returns
        -------
        ndarray of bool of shape (n_samples,)
            By the longest time constant; records of `fit` count.
        """
        check_is_fitted(self)
        own = self._stamps_as_in_fit(X).as_unit("ns").asi8
        first = min(int(own.min()), int(self.stamps_.view(np.int64).min()))
        return own - first < PAST * self._longest

    @property
    def lookback_(self) -> int | np.timedelta64:
        """How far back means look: a number of rows, or a time on a DatetimeIndex."""
        reach = REACH * self._longest
        return reach if self.stamps_ is None else np.timedelta64(reach, "ns")

    @property
    def _longest(self) -> int:
        return int(self.time_constants_.max())

    def _read_sensors(self, n_sensors: int) -> NDArray[np.intp]:
        if self.sensors is None:
            return np.arange(n_sensors)
        columns = list(getattr(self, "feature_names_in_", range(n_sensors)))
        known = [one for one in self.sensors if one in columns]
        if len(known) < len(self.sensors) or len(set(known)) < len(known) or not known:
            raise ValueError(f"sensors is {self.sensors!r}; expected different ones of the columns {columns}")
        return np.array([columns.index(one) for one in known], dtype=np.intp)

    def _names(self, sensors: Sequence[Hashable]) -> list[Hashable]:
        if not len(sensors):
            return []
        chosen = [sensors[position] for position in self.sensors_]
        return [*sensors, *(f"{one}_mean{_as_label(constant)}" for constant in self.time_constants for one in chosen)]

    def _warn_of_no_past(
        self, X: Table, values: NDArray, own: NDArray[np.int64], times: NDArray[np.int64]
    ) -> NDArray[np.bool_] | np.bool_:
        """Warn if more than half of the rows have no record a time constant back, unless the first is that of `fit`;
        which rows these are."""
        at = np.searchsorted(times, own - self._longest, side="right") - 1
        lacking = (at < 0) | (own - times[np.maximum(at, 0)] > REACH * self._longest)
        is_first = np.array_equal(values[own.argmin()], self.first_row_, equal_nan=True)
        if is_first or 2 * lacking.sum() <= len(own):
            return np.False_
        is_timed = self.stamps_ is not None
        reach = duration_text(pd.Timedelta(self._longest)) if is_timed else f"{self._longest} rows"
        warn_user(
            f"{lacking.sum()} of {len(own)} rows have no record {reach} or more before: their means are of the few "
            f"records since {X.index.min() if is_timed else 'the first row'}; give those of {REACH} times {reach} "
            "before, too",
            FewRecordsWarning,
            "no records for means",
        )
        return lacking


def trailing_means(times: NDArray[np.int64], values: NDArray, constant: int) -> NDArray[np.float64]:
    """Exponentially weighted means of columns in order of time, NaN left out, over `REACH` time constants."""
    known = ~np.isnan(values)
    centre = np.where(known, values, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    table = np.hstack([np.where(known, values - centre, 0.0), known])
    ages = (times - times[0]) / constant
    sums = _decayed_sums(ages, table)
    before = np.searchsorted(times, times - REACH * constant, side="right") - 1
    old = np.flatnonzero(before >= 0)
    sums[old] -= sums[before[old]] * np.exp(ages[before[old]] - ages[old])[:, np.newaxis]
    counts = sums[:, values.shape[1] :]
    is_known = counts > 0.5 * np.exp(-REACH)
    means = np.divide(sums[:, : values.shape[1]], counts, out=np.full(values.shape, np.nan), where=is_known)
    return means + centre


def _decayed_sums(ages: NDArray[np.float64], table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums of each row and of all before it, times exp of minus how much older they are."""
    sums = np.empty(table.shape)
    carried, start = np.zeros(table.shape[1]), 0
    while start < len(ages):
        stop = int(np.searchsorted(ages, ages[start] + LONGEST_STRETCH, side="right"))
        growth = np.exp(ages[start:stop] - ages[start])[:, np.newaxis]
        before = carried * np.exp(ages[start - 1] - ages[start]) if start else carried
        sums[start:stop] = (before + np.cumsum(table[start:stop] * growth, axis=0)) / growth
        carried, start = sums[stop - 1], stop
    return sums


def _read_time_constants(given: Any, is_timed: bool) -> NDArray[np.int64]:
    if isinstance(given, str) or not len(given):
        raise ValueError(f"time_constants is {given!r}; expected a sequence, such as ['30D']")
    constants = []
    for one in given:
        is_count = isinstance(one, Integral) and not isinstance(one, bool | np.bool_ | np.timedelta64)
        if is_timed:
            duration = as_duration(one, "time constant")
            if duration > LONGEST:
                raise ValueError(f"time constant is {one!r}; expected at most ten years")
            constants.append(int(duration.astype(np.int64)))
        elif not is_count:
            raise ValueError(
                f"time constant {one!r} is a duration, but X has no DatetimeIndex; expected a number of rows"
            )
        elif not 1 <= one <= np.iinfo(np.int32).max:
            raise ValueError(f"time constant is {one!r}; expected a positive number of rows")
        else:
            constants.append(int(one))
    if len(set(constants)) < len(constants):
        raise ValueError(f"time_constants is {given!r}; expected different ones")
    return np.array(constants, dtype=np.int64)


def _as_label(constant: Any) -> str:
    """A time constant as a part of a name, such as "30D"."""
    return constant if isinstance(constant, str) else str(constant).replace(" ", "")
