"""Earlier temperatures as columns: lags, exponentially weighted means, and whether these explain frequencies."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from datetime import timedelta
from numbers import Integral
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import Array, means_of_known, median, piecewise_linear, robust_deviation, spread_evenly
from skthermo._core.estimators import Interval, StrOptions, check_array, check_is_fitted
from skthermo._core.frames import (
    DAY,
    DAY_NS,
    Table,
    as_stamps,
    check_duration,
    check_same_rows,
    column_names,
    columns_by_sensor,
    frame_like,
    has_stamps,
)
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.text import duration_text
from skthermo._core.warnings import explain_rows, warn_user
from skthermo.exceptions import FewRecordsWarning
from skthermo.preprocessing._records import RecordTransformer
from skthermo.preprocessing.folds import (
    KNOTS,
    Grams,
    WeatherBasis,
    predicted_by_weather,
    without_far,
)

EARLIEST = np.iinfo(np.int64).min  # stamp that there may be, in nanoseconds
DEFAULT_TOLERANCE = 6  # times freq
MISSING = -1  # instead of the number of a row
MAX_LAGS = 10_000  # or as many as there are rows: a list of 10^9 lags would end the interpreter
LONGEST_LAG = np.timedelta64(100 * 365, "D")  # stamps in nanoseconds span 292 years

REACH = 4  # time constants beyond which records have no weight; they would have 2 % of it
PAST = 2  # time constants after the first record from which means are as good as later
LONGEST = np.timedelta64(10 * 365, "D")
LONGEST_STRETCH = 300.0  # time constants whose weights are multiplied up without overflow
TIME_CONSTANTS = ("3h", "12h", "2D", "5D", "10D", "20D", "40D", "60D")
MOST_CHOSEN = 2  # time constants that are put in
LEAST_SPANS = 4  # time constants that the records last
N_FOLDS = 5  # contiguous ones, so that a season is predicted from others
LEAST_ROWS = 100
MOST_ROWS = 3000  # evenly spread, from which errors are computed
MOST_SENSORS = 8  # evenly spread, of which means are tried
N_PLACES = 24  # of a step that competes with memory
LEAST_FALL = 0.05  # share by which the error falls
WEEKS = pd.Timedelta(days=5)  # time constants from which a mean can follow a season, a trend or a step
LEAST_FALL_OF_WEEKS = 0.15
ALL_SEASONS = pd.Timedelta(days=270)  # of records; in shorter ones a mean over days extrapolates to other seasons
LEAST_FALL_WITHOUT_SEASONS = 0.25  # by a mean over more than a day, in such records
LEAST_BESIDE = 0.5  # of that share, beside a trend and a step
WORST = 1.0  # ratio of errors in the fold that gains least
COLUMNS = ["time_constant", "sensor", "mode", "error_without", "error_with", "fall", "chosen"]


class PastFeatures(RecordTransformer):
    """A transformer whose columns depend on earlier records, which it finds by their stamps among those of `fit`."""

    history_: NDArray | None
    stamps_: NDArray | None
    time_zone_: str | None

    def _transformed(self, X: Table, values: NDArray) -> Table:
        features, warned = self._features(X, values, self._stamps_as_in_fit(X))
        return explain_rows(frame_like(X, features, self._names(getattr(X, "columns", ()))), warned)

    @abstractmethod
    def _features(
        self, X: Table, values: NDArray, stamps: pd.DatetimeIndex | None
    ) -> tuple[NDArray, NDArray[np.bool_] | np.bool_]:
        """The features, and the rows of which a warning has said why they lack some."""

    def _remember(self, X: Table, values: NDArray) -> pd.DatetimeIndex | None:
        """Store the records of `fit` where they have stamps, and return these."""
        self.history_ = self.stamps_ = self.time_zone_ = None
        stamps = stamps_of(X)
        if stamps is not None:
            self.history_ = values.copy()
            self.stamps_ = stamps.as_unit("ns").asi8.view("datetime64[ns]")
            self.time_zone_ = None if stamps.tz is None else str(stamps.tz)
        return stamps

    def _stamps_as_in_fit(self, X: Table) -> pd.DatetimeIndex | None:
        """Stamps of new records, of the same kind as those of `fit`."""
        stamps = stamps_of(X)
        if (stamps is None) != (self.stamps_ is None):
            kinds = ["a DatetimeIndex", "rows without a DatetimeIndex"]
            had, has = kinds if stamps is None else kinds[::-1]
            raise ValueError(f"X has {has}; expected {had}, as in fit")
        if stamps is not None and (self.time_zone_ is None) != (stamps.tz is None):
            raise ValueError(f"X has stamps in time zone {stamps.tz}; expected {self.time_zone_}, as in fit")
        return stamps

    def _found(self, own: NDArray[np.int64], reach: int) -> NDArray[np.bool_]:
        """Which records of `fit` are so many nanoseconds before some stamps, or between them."""
        old = self.stamps_.view(np.int64)
        return (old >= max(int(own.min()) - reach, EARLIEST)) & (old <= own.max())

    def _joined(
        self, found: NDArray[np.bool_], own: NDArray[np.int64], values: NDArray
    ) -> tuple[NDArray[np.int64], NDArray]:
        """Stamps and values of some records of `fit`, then of new records, which replace those of the same stamp."""
        old = self.stamps_.view(np.int64)
        only_old = np.flatnonzero(found)
        only_old = only_old[~np.isin(old[only_old], own)]
        return np.concatenate([old[only_old], own]), np.concatenate([self.history_[only_old], values])


def stamps_of(X: Table) -> pd.DatetimeIndex | None:
    """Stamps of the rows, or None where rows have none and are consecutive."""
    index = as_stamps(X.index) if isinstance(X, pd.DataFrame) else None
    if index is None:
        return None
    if index.hasnans:
        raise ValueError(f"X has a missing stamp (NaT) in row {np.flatnonzero(index.isna())[0]}")
    if index.has_duplicates:
        repeated = index[index.duplicated()]
        raise ValueError(
            f"X has {len(repeated)} duplicate stamps, the first {repeated[0]} in row "
            f"{np.flatnonzero(index.duplicated())[0]}; expected each stamp once"
        )
    return index


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
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of sensors and, where `fit` saw a frame with such, their names.

    See Also
    --------
    find_memory : Finds out whether such means explain frequencies, and with which time constant.
    LagFeatures : Single earlier values, for delays of hours.

    Notes
    -----
    The mean of a record at time t is that of the known values at s with weights exp(-(t - s) / time constant), for t -
    s up to four time constants, the record's own value included. Near the first record it is the mean of what is known.
    Missing values have no weight, and a mean is NaN only where no value is known. Records of `fit` and of `transform`
    count together, as in `LagFeatures`. There is a warning if more than half of the rows have no record that is older
    than the longest time constant, and do not begin as the records of `fit` do.

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
        warned = self._warn_of_no_past(X, values, own, sorted_times)
        return np.hstack([values, *means]).astype(values.dtype, copy=False), warned

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
            f"{lacking.sum()} of {len(own)} rows have no record {reach} or more before. Their means are of the few "
            f"records since {X.index.min() if is_timed else 'the first row'}. Give the records of {REACH} times "
            f"{reach} before, too",
            FewRecordsWarning,
            "no-earlier-records",
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
            duration = check_duration(one, "time constant", may_be_zero=False)
            if duration > LONGEST:
                raise ValueError(f"time constant is {one!r}; expected at most ten years")
            constants.append(duration.value)
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


@dataclass(frozen=True, repr=False)
class MemoryFindings(SavesFrames):
    """What `find_memory` has found.

    Parameters
    ----------
    table : DataFrame
        A row for each ``time_constant`` and ``mode``: the ``sensor`` whose mean explains most, mean absolute
        out-of-fold errors of the frequencies without and with this mean (``error_without``, ``error_with``, in their
        unit), the share by which they ``fall``, and whether the mean is ``chosen``.
    features : ExponentialMeans or None
        The transformer to put before a `~skthermo.surrogate.TemperatureMapper`; None where nothing is gained.
    fall : float
        Share by which the out-of-fold error falls by the chosen means, on average over the modes.

    Examples
    --------
    >>> from skthermo.preprocessing import find_memory
    >>> memory = find_memory([[4.0], [5.0]], [[2.1], [2.0]])
    >>> print(memory.summary())
    Earlier temperatures explain no more of the frequencies: their means do not lower the error in periods held out.
    >>> memory.fall
    0.0
    """

    table: pd.DataFrame
    features: ExponentialMeans | None
    fall: float

    def summary(self) -> str:
        """What was found, in a sentence.

        Returns
        -------
        str
            The means that explain the frequencies, and by how much the error falls.
        """
        if self.features is None:
            return (
                "Earlier temperatures explain no more of the frequencies: their means do not lower the error in "
                "periods held out."
            )
        means = " and ".join(f"{one} of {self._sensors}" for one in self.features.time_constants)
        return (
            "The frequencies depend on earlier temperatures: exponentially weighted means over "
            f"{means} lower the error in periods held out by {self.fall:.0%}."
        )

    @property
    def _sensors(self) -> str:
        return " and ".join(repr(one) for one in self.features.sensors)

    def __repr__(self) -> str:
        return self.summary()


def find_memory(temperatures: ArrayLike, frequencies: ArrayLike) -> MemoryFindings:
    """Look whether exponentially weighted means of earlier temperatures explain frequencies.

    Parameters
    ----------
    temperatures : array-like or DataFrame of shape (n_samples, n_sensors)
        In degrees Celsius; NaN is allowed.
    frequencies : array-like or DataFrame of shape (n_samples, n_modes)
        Of the healthy structure, in Hz, or another quantity that follows the weather; NaN is allowed. A mode with fewer
        than 100 values does not count, where others have more.

    Returns
    -------
    MemoryFindings
        Its ``features`` is the transformer to put in, or None; ``summary()`` is a sentence.

    Raises
    ------
    ValueError
        If the tables differ in length or index, repeat the name of a column, or hold something that is no real number
        or is infinite.

    See Also
    --------
    ExponentialMeans : The transformer.
    check_records : Names memory of weeks among other findings.

    Notes
    -----
    A mean is chosen if it lowers the mean absolute out-of-fold error of a piecewise-linear regression on the weather
    enough, by the rules of :doc:`/guide/records_theory`. Nothing is looked for in records without a DatetimeIndex.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from skthermo.preprocessing import ExponentialMeans, find_memory
    >>> random, days = np.random.default_rng(0), pd.date_range("2023-01-01", periods=1000)
    >>> season = 10 - 10 * np.cos(2 * np.pi * np.arange(1000) / 365.25)
    >>> air = pd.DataFrame({"air": season + 4 * random.standard_normal(1000)}, days)
    >>> soil = ExponentialMeans(["40D"]).fit_transform(air)["air_mean40D"]
    >>> f = pd.DataFrame({"f1": 4 - 0.004 * air["air"] - 0.008 * soil + 0.01 * random.standard_normal(1000)})
    >>> memory = find_memory(air[270:], f[270:])
    >>> round(memory.fall, 1)
    0.7
    >>> memory.features
    ExponentialMeans(sensors=['air'], time_constants=['40D'])
    """
    check_same_rows(temperatures, frequencies, ("temperatures", "frequencies"))
    T = check_array(temperatures, dtype=np.float64, input_name="temperatures")
    F = check_array(frequencies, dtype=np.float64, input_name="frequencies")
    nothing = MemoryFindings(pd.DataFrame(columns=COLUMNS), None, 0.0)
    if not has_stamps(temperatures):
        return nothing
    stamps = temperatures.index.as_unit("ns").asi8
    order = np.argsort(stamps, kind="stable")
    first = {name: columns[0] for name, columns in columns_by_sensor(temperatures).items()}
    T, F = T[np.ix_(order, list(first.values()))], F[order]
    is_known = ~np.isnan(F) & ~np.isnan(T).all(axis=1)[:, np.newaxis]
    is_scarce = is_known.sum(axis=0) < LEAST_ROWS  # modes that say nothing
    F = np.where(is_scarce & ~is_scarce.all(), np.nan, F)
    usable = np.flatnonzero(is_known[:, ~is_scarce | is_scarce.all()].any(axis=1))
    if len(usable) < LEAST_ROWS:
        return nothing
    return _Candidates(stamps[order], T, F, usable).findings(list(first), column_names(frequencies, "f"))


class _Candidates:
    """Inputs in rows: the weather, a trend and a step, and the means that are tried; their products by fold.

    Rows are in order of time. A mean has the positions of its time constant and its sensor as a key.
    """

    def __init__(self, times: NDArray[np.int64], T: Array, F: Array, usable: NDArray[np.intp]):
        rows = spread_evenly(usable, MOST_ROWS)
        self.ages, self.folds = (times[rows] - times[0]) / DAY_NS, np.arange(len(rows)) * N_FOLDS // len(rows)
        self.has_all_seasons = pd.Timedelta(np.ptp(times), "ns") >= ALL_SEASONS
        basis = WeatherBasis.of(T)
        lines = basis.lines(basis.coordinates(T[rows]))
        left = F[rows] - predicted_by_weather(lines, F[rows], self.folds)
        self.scale = robust_deviation(left)
        self.values = without_far(F[rows] - median(F[rows]), left) / np.where(self.scale > 0, self.scale, np.inf)
        blocks: dict[Any, Array] = {"weather": lines, "time": _time_shapes(without_far(left, left))}
        sensors = spread_evenly(np.flatnonzero(~np.isnan(T).all(axis=0)), MOST_SENSORS)
        for i, one in enumerate(TIME_CONSTANTS):
            constant = pd.Timedelta(one).as_unit("ns").value
            if np.median(np.diff(times)) <= constant <= np.ptp(times) / LEAST_SPANS:
                averages = trailing_means(times, T[:, sensors], constant)[rows]
                for sensor, column in zip(sensors, averages.T, strict=True):
                    if np.ptp(column) > 0:  # False for NaN
                        blocks[i, int(sensor)] = lines_of(column)
        self.places: dict[Any, NDArray[np.intp]] = {}  # of the columns of each block
        start = 0
        for key, block in blocks.items():
            self.places[key] = np.arange(start, start + block.shape[1])
            start += block.shape[1]
        self.means = list(self.places)[2:]
        inputs = np.hstack(list(blocks.values()))
        self.grams = Grams.of(inputs, self.values, self.folds)
        self.inputs = np.ascontiguousarray(inputs.T)
        self.known_left: dict[tuple[Any, ...], Array] = {}

    def errors(self, *blocks: Any, after: float = 0.0) -> Array:
        """Mean absolute error out of fold by fold and mode, relative to the scale of the mode, after some days."""
        if blocks not in self.known_left:
            columns = np.concatenate([self.places[block] for block in blocks])
            square = np.ix_(range(N_FOLDS), range(self.values.shape[1]), columns, columns)
            grams = Grams(self.grams.inputs[square], self.grams.targets[..., columns], self.grams.counts)
            inputs, left = self.inputs[columns], np.empty_like(self.values)
            for fold, coefficients in enumerate(grams.coefficients()):
                rows = self.folds == fold
                left[rows] = np.abs(self.values[rows] - (coefficients @ inputs[:, rows]).T)
            self.known_left[blocks] = left
        left = self.known_left[blocks]
        counted = ~np.isnan(left) & (self.ages >= after)[:, np.newaxis]
        starts = np.searchsorted(self.folds, np.arange(N_FOLDS))
        sums = np.add.reduceat(np.where(counted, left, 0.0), starts)
        counts = np.add.reduceat(counted.astype(float), starts)
        return np.divide(sums, counts, out=np.full(sums.shape, np.nan), where=counts > 0)

    def chosen(self) -> list[tuple[int, int]]:
        """Means that lower the error clearly, in nearly every part of the records, and beside a trend and a step.

        Records of the first two time constants do not count: their means lack the weather before.
        """
        chosen: list[tuple[int, int]] = []
        while len(chosen) < MOST_CHOSEN:
            known, found = ["weather", *chosen], []
            for mean in self.means:
                if chosen and (mean in chosen or mean[1] != chosen[0][1]):
                    continue
                constant = pd.Timedelta(TIME_CONSTANTS[mean[0]])
                least = LEAST_FALL_OF_WEEKS if constant >= WEEKS else LEAST_FALL
                if constant > DAY and not self.has_all_seasons:
                    least = LEAST_FALL_WITHOUT_SEASONS
                after = PAST * (constant / DAY)
                fall, worst = _fall(self.errors(*known, after=after), self.errors(*known, mean, after=after))
                if fall >= least and worst <= WORST:
                    known_beside = [*known, "time"]
                    beside = self.errors(*known_beside, after=after), self.errors(*known_beside, mean, after=after)
                    if _fall(*beside)[0] >= LEAST_BESIDE * fall:
                        found.append((fall, mean))
            if not found:
                break
            chosen.append(max(found)[1])
        return chosen

    def findings(self, sensors: list[Hashable], modes: list[Hashable]) -> MemoryFindings:
        """What is chosen, as a table and a transformer."""
        chosen = self.chosen()
        without = self.errors("weather")
        before, table = means_of_known(without), []
        for i, constant in enumerate(TIME_CONSTANTS):
            best, least, after, ratio = None, np.inf, before, before
            for mean in self.means:
                if mean[0] != i or (best in chosen and best is not None):
                    continue
                error = means_of_known(self.errors("weather", mean))
                with np.errstate(invalid="ignore", divide="ignore"):  # of modes without an error
                    share = error / before
                if best is None or mean in chosen or np.nansum(share) < least:
                    best, least, after, ratio = mean, np.nansum(share), error, share
            if best is not None:
                columns = modes, before * self.scale, after * self.scale, 1 - ratio
                table += [[constant, sensors[best[1]], *row, best in chosen] for row in zip(*columns, strict=True)]
        features = None
        if chosen:
            constants = [TIME_CONSTANTS[i] for i, _ in sorted(chosen)]
            features = ExponentialMeans(constants, sensors=[sensors[chosen[0][1]]])
        fall = _fall(without, self.errors("weather", *chosen))[0]
        return MemoryFindings(pd.DataFrame(table, columns=COLUMNS), features, fall)


def lines_of(column: Array) -> Array:
    """Piecewise-linear functions of a standardised column."""
    standard = ((column - column.mean()) / column.std())[:, np.newaxis]
    return piecewise_linear(standard, np.quantile(standard, KNOTS, axis=0))


def _time_shapes(left: Array) -> Array:
    """A straight line, and the step that explains most of residuals, (n_samples, 2)."""
    place = np.arange(len(left)) / len(left)
    shapes = (place[:, np.newaxis] >= np.arange(1, N_PLACES) / N_PLACES).astype(float)
    shapes -= shapes.mean(axis=0)
    deviation = robust_deviation(left)
    standard = np.nan_to_num((left - median(left)) / np.where(deviation > 0, deviation, np.inf))
    explained = ((shapes.T @ standard) ** 2).sum(axis=1) / (shapes**2).sum(axis=0)
    return np.column_stack([place - 0.5, shapes[:, explained.argmax()]])


def _fall(before: Array, after: Array) -> tuple[float, float]:
    """Share by which errors, (n_folds, n_modes), fall on average over the modes; ratio where they fall least.

    What is not known in a fold is NaN in both.
    """
    known = ~np.isnan(before) & (before > 0)
    if not known.any():
        return 0.0, np.inf
    modes, sums = known.any(axis=0), np.where(known, [before, after], 0.0).sum(axis=1)
    ratios = np.divide(after, before, out=np.full(before.shape, np.nan), where=known)[known.any(axis=1)]
    return 1 - float(np.mean(sums[1, modes] / sums[0, modes])), float(np.nanmean(ratios, axis=1).max())
