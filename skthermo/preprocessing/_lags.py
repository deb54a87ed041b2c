"""Earlier temperatures as additional columns."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from datetime import timedelta
from numbers import Integral
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._estimators.warnings import warn_user
from skthermo._tables.frames import Table, check_duration
from skthermo._tables.text import duration_text
from skthermo._validation import Interval, StrOptions
from skthermo.exceptions import FewRecordsWarning
from skthermo.preprocessing._records import PastFeatures

DEFAULT_TOLERANCE = 6  # times freq
MISSING = -1  # instead of the number of a row
MAX_LAGS = 10_000  # or as many as there are rows: a list of 10^9 lags would end the interpreter
LONGEST_LAG = np.timedelta64(100 * 365, "D")  # stamps in nanoseconds span 292 years


class LagFeatures(PastFeatures):
    """Current and earlier values of every sensor: a structure follows the temperature with delay.

    Parameters
    ----------
    lags : int or sequence of int, default=24
        Number of columns for each sensor, the current value included, or an explicit list of lags, such as ``[0, 1,
        24]``. At most 10,000 or as many as there are rows, and at most 100 years back.
    freq : str or timedelta, optional
        Length of one lag, such as "1h", for frames on a DatetimeIndex. By default the most frequent time between
        records of `fit`.
    tolerance : str or timedelta, optional
        How much older than t - k freq the record for lag k may be. By default 6 freq.
    padding : {"edge", "nan"}, default="edge"
        Values before the first record: those of the first record, or NaN.

    Attributes
    ----------
    lags_ : list of int
        Lags in the order of each sensor's columns.
    freq_ : numpy.timedelta64 or None
        Length of one lag; None where rows are consecutive.
    tolerance_ : numpy.timedelta64 or None
        How much older the record for a lag may be; None where rows are consecutive.
    history_ : ndarray of shape (n_samples, n_sensors) or None
        Records of `fit`, to which lags of `transform` reach back; None where rows are consecutive.
    stamps_ : ndarray of datetime64 or None
        Their stamps, in UTC where they have a time zone.
    time_zone_ : str or None
        Time zone of the stamps.
    lookback_ : int or numpy.timedelta64
        How far back the longest lag looks: a number of rows, or a time on a DatetimeIndex, the tolerance included.
    first_rows_ : ndarray
        First records of `fit`: the padding of records that begin with them is known from `fit`, and no warning says so
        again.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of sensors and, where `fit` saw a frame with such, their names.

    Notes
    -----
    On an array, or a frame without a DatetimeIndex, lag k is the value k rows earlier, and the rows of `fit` are not
    used in `transform`: give the rows before new records, too, and leave their results out.

    On a DatetimeIndex, or an index of other stamps, lag k is the last record at or before t - k freq, or NaN if that
    record is older than the tolerance. Records of `fit` and of `transform` are searched together; for a stamp in both,
    the values of `transform` count. Rows may come in any order. Lags that find no record before the first one give a
    warning (``no-earlier-records``).

    Examples
    --------
    >>> import pandas as pd
    >>> from skthermo.preprocessing import LagFeatures
    >>> hours = pd.to_datetime(["2025-01-01 00:00", "2025-01-01 01:00", "2025-01-01 03:00"])
    >>> T = pd.DataFrame({"T1": [4.0, 5.0, 7.0]}, index=hours)
    >>> LagFeatures(lags=2, freq="1h").fit_transform(T)
                         T1_lag0  T1_lag1
    2025-01-01 00:00:00      4.0      4.0
    2025-01-01 01:00:00      5.0      4.0
    2025-01-01 03:00:00      7.0      5.0
    >>> LagFeatures(lags=2, freq="1h").fit(T.to_numpy())
    Traceback (most recent call last):
    ...
    ValueError: freq is '1h', but X has no DatetimeIndex; expected a frame on one, or freq=None
    """

    _parameter_constraints: dict = {
        "lags": [Interval(Integral, 1, None, closed="left"), "array-like"],
        "freq": [str, timedelta, np.timedelta64, pd.offsets.BaseOffset, None],
        "tolerance": [str, timedelta, np.timedelta64, pd.offsets.BaseOffset, None],
        "padding": [StrOptions({"edge", "nan"})],
    }

    def __init__(
        self,
        lags: int | Sequence[int] = 24,
        *,
        freq: str | timedelta | None = None,
        tolerance: str | timedelta | None = None,
        padding: Literal["edge", "nan"] = "edge",
    ):
        self.lags = lags
        self.freq = freq
        self.tolerance = tolerance
        self.padding = padding

    def _learn(self, X: Table, values: NDArray) -> None:
        self.lags_ = _read_lags(self.lags, len(values))
        self.freq_ = self.tolerance_ = None
        stamps = self._remember(X, values)
        if stamps is None:
            for name in ("freq", "tolerance"):
                if getattr(self, name) is not None:
                    raise ValueError(
                        f"{name} is {getattr(self, name)!r}, but X has no DatetimeIndex; "
                        f"expected a frame on one, or {name}=None"
                    )
        else:
            self.freq_ = (
                _most_frequent_step(stamps)
                if self.freq is None
                else check_duration(self.freq, "freq", may_be_zero=False).to_timedelta64()
            )
            self.tolerance_ = DEFAULT_TOLERANCE * self.freq_
            if self.tolerance is not None:
                self.tolerance_ = check_duration(self.tolerance, "tolerance").to_timedelta64()
            if max(self.lags_) > LONGEST_LAG / self.freq_:
                raise ValueError(
                    f"lags reach back {max(self.lags_)} times {pd.Timedelta(self.freq_)}; expected at most 100 years"
                )
        self.first_rows_ = values[: max(self.lags_) + 1].copy()

    def _features(
        self, X: Table, values: NDArray, stamps: pd.DatetimeIndex | None
    ) -> tuple[NDArray, NDArray | np.bool_]:
        if stamps is None:
            return self._by_row(values, self.lags_), self._warn_of_padding(values)
        return self._by_time(stamps, values)

    @property
    def lookback_(self) -> int | np.timedelta64:
        """How far back the longest lag looks: a number of rows, or a time, the tolerance included."""
        longest = max(self.lags_)
        return longest * self.freq_ + self.tolerance_ if longest and self.freq_ is not None else longest

    def _names(self, sensors: Sequence[Hashable]) -> list[Hashable]:
        return [f"{sensor}_lag{lag}" for sensor in sensors for lag in self.lags_]

    def _warn_of_padding(self, values: NDArray) -> NDArray[np.bool_]:
        """Warn of first rows whose lags are not known, unless they are those of `fit`; which rows these are."""
        reach, n_rows = max(self.lags_), len(values)
        begins = values[: reach + 1]
        is_warned = bool(reach) and not np.array_equal(begins, self.first_rows_[: len(begins)], equal_nan=True)
        if is_warned:
            done = "are padded with the first record" if self.padding == "edge" else "lack lags"
            warn_user(
                f"lags reach {reach} rows back: the first {min(reach, n_rows)} of {n_rows} rows {done}. Give the "
                f"{reach} rows before, too, or a frame on a DatetimeIndex",
                FewRecordsWarning,
                "no-earlier-records",
            )
        return is_warned & (np.arange(n_rows) < reach)

    def _warn_of_no_history(self, stamps: pd.DatetimeIndex, unknown: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Warn if more than half of the rows have lags that reach before the first of them and find no record; which
        rows these are."""
        is_warned = bool(2 * unknown.sum() > len(unknown))
        if is_warned:
            reach = duration_text(pd.Timedelta(max(self.lags_) * self.freq_))
            warn_user(
                f"lags reach {reach} back: {unknown.sum()} of {len(unknown)} rows have one before the first record, "
                f"{stamps.min()}, and lack lags. Give the {reach} before, too",
                FewRecordsWarning,
                "no-earlier-records",
            )
        return is_warned & unknown

    def _by_row(self, values: NDArray, lags: Sequence[int]) -> NDArray:
        n_rows, sensors = len(values), np.ascontiguousarray(values.T)
        lagged = np.empty((len(sensors), len(lags), n_rows), dtype=values.dtype)
        for k, lag in enumerate(lags):
            before = min(lag, n_rows)
            lagged[:, k, before:] = sensors[:, : n_rows - before]
            lagged[:, k, :before] = sensors[:, :1] if self.padding == "edge" else np.nan
        return lagged.reshape(-1, n_rows).T

    def _by_time(self, stamps: pd.DatetimeIndex, values: NDArray) -> tuple[NDArray, NDArray[np.bool_] | np.bool_]:
        """Lagged values, and the rows of which a warning says that they lack lags."""
        own, old = stamps.as_unit("ns").asi8, self.stamps_.view(np.int64)
        freq, tolerance = (int(duration.astype(np.int64)) for duration in (self.freq_, self.tolerance_))
        rows_per_lag = _rows_per_step(own, freq)
        if rows_per_lag and np.array_equal(own, old):
            return self._by_row(values, [lag * rows_per_lag for lag in self.lags_]), np.False_
        found = self._found(own, max(self.lags_) * freq + tolerance)
        found[old.argmin()] = True  # the padding of what is before the first record of all
        known, records = self._joined(found, own, values)
        order = np.argsort(known)
        ascending = known[order]
        sources, unknown = [], np.zeros(len(own), dtype=bool)
        for lag in self.lags_:
            wanted = own - lag * freq
            at = np.searchsorted(ascending, wanted, side="right") - 1
            stale = wanted - ascending[at] > tolerance
            before = at < 0
            unknown |= (stale | before) & (wanted < own.min())
            source = np.where(stale & ~before, MISSING, order[np.maximum(at, 0)])
            sources.append(np.where(before & (self.padding == "nan"), MISSING, source))
        warned = self._warn_of_no_history(stamps, unknown) if not np.isin(own, old[found]).all() else np.False_
        return _rows_by_lag(records, sources), warned


def _rows_by_lag(values: NDArray, sources: list[NDArray[np.intp]]) -> NDArray:
    """Values of the source rows of every lag, one block of columns for each sensor."""
    sensors = np.ascontiguousarray(values.T)
    lagged = np.empty((len(sensors), len(sources), len(sources[0])), dtype=values.dtype)
    for k, source in enumerate(sources):
        for sensor, column in zip(sensors, lagged[:, k], strict=True):
            np.take(sensor, source, out=column, mode="clip")
        lagged[:, k, source == MISSING] = np.nan
    return lagged.reshape(-1, len(sources[0])).T


def _rows_per_step(stamps: NDArray[np.int64], step: int) -> int | None:
    """Number of rows in a step, if stamps are equally spaced and the step is a multiple of their spacing."""
    steps = np.diff(stamps)
    even = steps.size and steps[0] > 0 and step % steps[0] == 0 and (steps == steps[0]).all()
    return int(step // steps[0]) if even else None


def _read_lags(lags: Any, n_rows: int) -> list[int]:
    if isinstance(lags, bool | np.bool_):
        raise ValueError(f"lags is {lags!r}; expected a positive number or different non-negative integers")
    count = lags if isinstance(lags, Integral) else len(lags)
    if count > max(MAX_LAGS, n_rows):
        raise ValueError(
            f"lags are {count} for {n_rows} rows; expected at most {MAX_LAGS}, or as many as there are rows"
        )
    if isinstance(lags, Integral):
        return list(range(lags))
    explicit = list(lags)
    whole = all(isinstance(lag, Integral) and not isinstance(lag, bool) and lag >= 0 for lag in explicit)
    if not explicit or not whole or len(set(explicit)) < len(explicit):
        raise ValueError(f"lags is {lags!r}; expected a positive number or different non-negative integers")
    return [int(lag) for lag in explicit]


def _most_frequent_step(stamps: pd.DatetimeIndex) -> np.timedelta64:
    steps = np.diff(np.sort(stamps.as_unit("ns").asi8))
    if not steps.size:
        raise ValueError("X has 1 sample, whose stamp gives no step between records; expected freq, such as '1h'")
    lengths, counts = np.unique(steps, return_counts=True)
    return np.timedelta64(lengths[counts.argmax()], "ns")
