"""Earlier temperatures as columns: lags and exponentially weighted means."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable, Sequence
from datetime import timedelta
from numbers import Integral, Real
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array
from skthermo._core.estimators import Interval, StrOptions
from skthermo._core.frames import DAY, YEAR, Table, as_index, as_stamps, check_duration, frame_like
from skthermo._core.text import duration_text
from skthermo._core.warnings import warn_each
from skthermo.exceptions import FewRecordsWarning
from skthermo.preprocessing._transformers import DURATION, RecordTransformer

MEAN_REACH = 6  # half-lives beyond which records have no weight: they would have 2 % of it


class PastFeatures(RecordTransformer):
    """A transformer whose columns depend on earlier records, which it finds by their stamps among those of `fit`."""

    history_: NDArray | None
    stamps_: NDArray | None
    time_zone_: str | None

    def _transformed(self, X: Table, values: NDArray) -> Table:
        features, findings = self._features(values, self._stamps_as_in_fit(X))
        warn_each(findings)
        return frame_like(X, features, self._names(getattr(X, "columns", ())))

    @abstractmethod
    def _features(self, values: Array, stamps: pd.DatetimeIndex | None) -> tuple[Array, list[FewRecordsWarning]]:
        """The features, and a finding where many rows lack some."""

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
            has, had = (
                "rows without a DatetimeIndex" if one is None else "a DatetimeIndex" for one in (stamps, self.stamps_)
            )
            raise ValueError(f"X has {has}; expected {had}, as in fit")
        if stamps is not None and (self.time_zone_ is None) != (stamps.tz is None):
            raise ValueError(f"X has stamps in time zone {stamps.tz}; expected {self.time_zone_}, as in fit")
        return stamps

    def _with_history(
        self, own: NDArray[np.int64], values: NDArray, reach: int, *, and_first: bool = False
    ) -> tuple[NDArray[np.int64], NDArray]:
        """Stamps and values of records of `fit` up to so many nanoseconds before new records, and of the first of all
        if asked for, then of the new ones, which replace those of the same stamp."""
        old = self.stamps_.view(np.int64)
        is_near = (old >= max(int(own.min()) - reach, np.iinfo(np.int64).min)) & (old <= own.max())
        is_near[old.argmin()] |= and_first
        is_near &= ~np.isin(old, own)
        return np.concatenate([old[is_near], own]), np.concatenate([self.history_[is_near], values])


def stamps_of(X: Table) -> pd.DatetimeIndex | None:
    """Stamps of the rows, or None where rows have none and are consecutive."""
    index = as_stamps(X.index) if isinstance(X, pd.DataFrame) else None
    if index is None:
        return None
    if index.hasnans:
        raise ValueError(f"X has a missing stamp (NaT) in row {np.flatnonzero(index.isna())[0]}")
    if index.has_duplicates:
        row = int(index.duplicated().argmax())
        raise ValueError(f"X has the duplicate stamp {index[row]} in row {row}; expected each stamp once")
    return index


class LagFeatures(PastFeatures):
    """Current and earlier values of every sensor: a structure follows the temperature with delay.

    Parameters
    ----------
    lags : int or sequence of int, default=24
        Number of columns for each sensor, the current value included, or an explicit list of lags, such as ``[0, 1,
        24]``. At most 10,000 or as many as there are rows, and at most 100 years back.
    freq : str or timedelta, optional
        Length of one lag, such as "1h", for frames on a DatetimeIndex, or a step of the calendar, such as "MS". By
        default the most frequent time between records of `fit`; the calendar's step where their stamps are of one time
        of day in a time zone, whose days have 23 or 25 hours twice a year, or of one day of the month.
    tolerance : str or timedelta, optional
        How much older than t - k freq the record for lag k may be. By default 6 freq.
    padding : {"edge", "nan"}, default="edge"
        Values before the first record: the values of the first record, or NaN.

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
        First records of `fit`. New records that begin with them are padded without a warning.
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
        "freq": [*DURATION, None],
        "tolerance": [*DURATION, None],
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
        for name in ("freq", "tolerance") if stamps is None else ():
            if (given := getattr(self, name)) is not None:
                raise ValueError(
                    f"{name} is {given!r}, but X has no DatetimeIndex; expected a frame on one, or {name}=None"
                )
        if stamps is not None:
            if self.freq is None or self._calendar() is not None:
                self.freq_ = _most_frequent_step(stamps)
            else:
                self.freq_ = check_duration(self.freq, "freq", may_be_zero=False).to_timedelta64()
            given = 6 * pd.Timedelta(self.freq_) if self.tolerance is None else self.tolerance
            self.tolerance_ = check_duration(given, "tolerance").to_timedelta64()
            if max(self.lags_) > np.timedelta64(100 * 365, "D") / self.freq_:  # stamps in nanoseconds span 292 years
                reach = f"{max(self.lags_)} times {pd.Timedelta(self.freq_)}"
                raise ValueError(f"lags reach back {reach}; expected at most 100 years")
        self.first_rows_ = values[: max(self.lags_) + 1].copy()

    def _features(self, values: Array, stamps: pd.DatetimeIndex | None) -> tuple[Array, list[FewRecordsWarning]]:
        if stamps is not None:
            return self._by_time(stamps, values)
        rows, first = np.arange(len(values)), 0 if self.padding == "edge" else -1
        sources = [np.where(rows < lag, first, rows - lag) for lag in self.lags_]
        begins, reach = values[: max(self.lags_) + 1], f"{max(self.lags_)} rows"
        if not max(self.lags_) or np.array_equal(begins, self.first_rows_[: len(begins)], equal_nan=True):
            return _rows_by_lag(values, sources), []
        done = "are padded with the first record" if self.padding == "edge" else "lack lags"
        return _rows_by_lag(values, sources), no_earlier_records(
            f"lags reach {reach} back, and the first rows {done}", reach
        )

    @property
    def lookback_(self) -> int | np.timedelta64:
        """How far back the longest lag looks: a number of rows, or a time, the tolerance included."""
        longest = max(self.lags_)
        return longest * self.freq_ + self.tolerance_ if longest and self.freq_ is not None else longest

    def _names(self, sensors: Sequence[Hashable]) -> list[Hashable]:
        return [f"{sensor}_lag{lag}" for sensor in sensors for lag in self.lags_]

    def _calendar(self) -> pd.offsets.BaseOffset | None:
        """The step of the calendar by which records of `fit` follow each other; None where steps are times."""
        stamps = as_index(self.stamps_.view(np.int64), self.time_zone_).tz_localize(None).unique()
        if (stamps - stamps.normalize()).nunique() > 1:
            return None
        given = _step_of_calendar(self.freq)
        if given is not None or self.freq_ is None:
            return given if given is not None and all(map(given.is_on_offset, stamps)) else None
        n_days, is_rest = divmod(pd.Timedelta(self.freq_), DAY)
        if len(stamps) < 3 or is_rest:
            return None
        if self.freq is None and 28 <= n_days <= 31 and (stamps.day.nunique() == 1 or stamps.is_month_end.all()):
            return pd.offsets.MonthEnd() if stamps.is_month_end.all() else pd.DateOffset(months=1)
        return None if self.time_zone_ is None else pd.DateOffset(days=n_days)

    def _steps_back(self, stamps: pd.DatetimeIndex, lag: int, step: pd.offsets.BaseOffset) -> NDArray[np.int64]:
        """Times that are so many steps of the calendar earlier, by local clocks, in UTC."""
        zone, is_summer = self.time_zone_, np.ones(len(stamps), dtype=bool)
        local = stamps if zone is None else stamps.tz_convert(zone).tz_localize(None)
        earlier = local - lag * step if lag else local
        return earlier.tz_localize(zone, ambiguous=is_summer, nonexistent="shift_forward").as_unit("ns").asi8

    def _by_time(self, stamps: pd.DatetimeIndex, values: Array) -> tuple[Array, list[FewRecordsWarning]]:
        own = stamps.as_unit("ns").asi8
        freq, tolerance = (int(duration.astype(np.int64)) for duration in (self.freq_, self.tolerance_))
        calendar = self._calendar()
        known, records = self._with_history(own, values, max(self.lags_) * freq + tolerance, and_first=True)
        order = np.argsort(known)
        ascending, first = pd.Index(known[order]), order[0] if self.padding == "edge" else -1
        sources, unknown = [], np.zeros(len(own), dtype=bool)
        for lag in self.lags_:
            wanted = own - lag * freq if calendar is None else self._steps_back(stamps, lag, calendar)
            at = ascending.get_indexer(wanted, method="ffill", tolerance=tolerance)
            unknown |= (at < 0) & (wanted < own.min())
            source = np.where(at < 0, -1, order[at])
            sources.append(np.where(wanted < ascending[0], first, source))
        if 2 * unknown.sum() <= len(own) or np.isin(own, self.stamps_.view(np.int64)).all():
            return _rows_by_lag(records, sources), []
        reach = duration_text(pd.Timedelta(max(self.lags_) * self.freq_))
        found = no_earlier_records(f"lags reach {reach} back, and most rows lack lags", reach)
        return _rows_by_lag(records, sources), found


def _step_of_calendar(freq: Any) -> pd.offsets.BaseOffset | None:
    """A step of the calendar, such as "MS"; None for lengths of time."""
    try:
        offset = pd.tseries.frequencies.to_offset(freq) if isinstance(freq, str | pd.offsets.BaseOffset) else None
    except ValueError:
        return None
    return None if isinstance(offset, pd.offsets.Tick | pd.offsets.Day) else offset


def _rows_by_lag(values: NDArray, sources: list[NDArray[np.intp]]) -> NDArray:
    """Values of the source rows of every lag, NaN for -1, one block of columns for each sensor."""
    sensors = np.vstack([values, np.full(values.shape[1], np.nan)]).T
    return np.ascontiguousarray(sensors).take(sources, axis=1).reshape(-1, len(sources[0])).T


def _read_lags(lags: Any, n_rows: int) -> list[int]:
    count = lags if isinstance(lags, Integral) else len(lags)
    if count > max(10_000, n_rows):  # a list of 10^9 lags would end the interpreter
        raise ValueError(f"lags are {count} for {n_rows} rows; expected at most 10000, or as many as there are rows")
    found = list(range(lags) if isinstance(lags, Integral) else lags)
    are_whole = all(isinstance(lag, Integral) and not isinstance(lag, bool) and lag >= 0 for lag in found)
    if not found or not are_whole or len(set(found)) < len(found):
        raise ValueError(f"lags is {lags!r}; expected a positive number or different non-negative integers")
    return list(map(int, found))


def _most_frequent_step(stamps: pd.DatetimeIndex) -> np.timedelta64:
    steps = np.diff(np.sort(stamps.as_unit("ns").asi8))
    if not steps.size:
        raise ValueError("X has 1 sample, whose stamp gives no step between records; expected freq, such as '1h'")
    lengths, counts = np.unique(steps, return_counts=True)
    return np.timedelta64(lengths[counts.argmax()], "ns")


class ExponentialMeans(PastFeatures):
    """Append exponentially weighted means of sensors: soil and large concrete follow the air late.

    A body that exchanges heat with the air has the exponentially weighted mean of the air's temperature, with a
    half-life of hours (steel), of a day (thick concrete) or of weeks (soil).

    Parameters
    ----------
    half_lives : sequence of str, timedelta or int, default=("30D",)
        Half-lives, such as ``("12h", "30D")``: the weight of a record halves in this time. At most ten years. Integers
        count rows, for arrays and frames without a DatetimeIndex.
    sensors : sequence of str or int, optional
        Sensors that get means, by name or position; by default all.
    recorded : float, default=0.75
        Least share of a mean's weight that lies on recorded time; with less, as after an outage, the mean is missing.

    Attributes
    ----------
    half_lives_ : ndarray
        Half-lives, in nanoseconds on a DatetimeIndex, else in rows.
    step_ : int
        Usual time between records of `fit`, likewise.
    sensors_ : ndarray of int
        Positions of the sensors that get means.
    history_ : ndarray of shape (n_samples, n_sensors) or None
        Records of `fit`, which means of `transform` reach back to; None where rows are consecutive.
    stamps_ : ndarray of datetime64 or None
        Their stamps, in UTC where they have a time zone.
    time_zone_ : str or None
        Time zone of the stamps.
    first_row_ : ndarray of shape (n_sensors,)
        Earliest record of `fit`. Means of new records that begin with it have no past, and give no warning.
    lookback_ : int or numpy.timedelta64
        How far back means look: a number of rows, or a time on a DatetimeIndex.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of sensors and, where `fit` saw a frame with such, their names.

    See Also
    --------
    skthermo.surrogate.TemperatureMapper : Finds out whether such means explain its targets, and with which half-life.
    LagFeatures : Single earlier values, for delays of hours.

    Notes
    -----
    The mean of a record at time t has weights 2 ** (-(t - s) / half-life) for the known values at times s from six
    half-lives before t up to t itself. Near the first record it is the mean of the known values. A record
    stands for the time since the one before it, at most three usual steps. After a long outage, a mean is missing for
    two half-lives. Records of `fit` and of `transform` count together, as in `LagFeatures`. There is a warning
    if means are missing in more than half of the rows, or if these have no earlier record and do not begin as the
    records of `fit` do.

    Examples
    --------
    >>> import pandas as pd
    >>> from skthermo.preprocessing import ExponentialMeans
    >>> days = pd.date_range("2025-01-01", periods=4)
    >>> T = pd.DataFrame({"air": [4.0, 4.0, 9.0, 9.0]}, index=days)
    >>> means = ExponentialMeans(half_lives=["1D"]).fit(T[:3])
    >>> means.transform(T).round(2)
                air  air_mean1D
    2025-01-01  4.0        4.00
    2025-01-02  4.0        4.00
    2025-01-03  9.0        6.86
    2025-01-04  9.0        8.00
    >>> means.transform(T[3:]).round(2)
                air  air_mean1D
    2025-01-04  9.0         8.0
    >>> ExponentialMeans(half_lives=["2D"]).fit(T.to_numpy())
    Traceback (most recent call last):
    ...
    ValueError: half-life is '2D', but X has no DatetimeIndex; expected a positive number of rows
    """

    _parameter_constraints: dict = {
        "half_lives": ["array-like"],
        "sensors": ["array-like", None],
        "recorded": [Interval(Real, 0, 1, closed="both")],
    }

    def __init__(
        self,
        *,
        half_lives: Sequence[str | timedelta | int] = ("30D",),
        sensors: Sequence[Hashable] | None = None,
        recorded: float = 0.75,
    ):
        self.half_lives = half_lives
        self.sensors = sensors
        self.recorded = recorded

    def _learn(self, X: Table, values: NDArray) -> None:
        stamps = self._remember(X, values)
        self.half_lives_ = _read_half_lives(self.half_lives, stamps is not None)
        times = np.arange(len(values)) if stamps is None else np.sort(self.stamps_.view(np.int64))
        self.step_ = int(np.median(np.diff(times))) if len(times) > 1 else int(self.half_lives_.min())
        self.sensors_ = np.arange(values.shape[1])
        if self.sensors is not None:
            columns = list(getattr(self, "feature_names_in_", range(values.shape[1])))
            known = [one for one in self.sensors if one in columns]
            if len(known) < len(self.sensors) or len(set(known)) < len(known) or not known:
                raise ValueError(f"sensors is {self.sensors!r}; expected different ones of the columns {columns}")
            self.sensors_ = np.array([columns.index(one) for one in known], dtype=np.intp)
        self.first_row_ = values[0 if stamps is None else stamps.argmin()].copy()

    def _features(self, values: Array, stamps: pd.DatetimeIndex | None) -> tuple[Array, list[FewRecordsWarning]]:
        own, records = np.arange(len(values)), values
        times = own
        if stamps is not None:
            own = stamps.as_unit("ns").asi8
            times, records = self._with_history(own, values, MEAN_REACH * self._longest)
        order = np.argsort(times, kind="stable")
        times, records = times[order], records[np.ix_(order, self.sensors_)]
        rows = np.argsort(order)[len(order) - len(own) :]
        begun = times[0] if self.stamps_ is None else min(int(times[0]), int(self.stamps_.view(np.int64).min()))
        means = []
        for half_life in self.half_lives_.tolist():
            mean, share = trailing_means(times, records, half_life, self.step_, begun)
            means.append(np.where(share < self.recorded, np.nan, mean)[rows])
        return np.hstack([values, *means]), self._doubts_of_past(values, own, times, means)

    @property
    def lookback_(self) -> int | np.timedelta64:
        """How far back means look: a number of rows, or a time on a DatetimeIndex."""
        reach = MEAN_REACH * self._longest
        return reach if self.stamps_ is None else np.timedelta64(reach, "ns")

    @property
    def _longest(self) -> int:
        return int(self.half_lives_.max())

    def _names(self, sensors: Sequence[Hashable]) -> list[Hashable]:
        if not len(sensors):
            return []
        labels = [one if isinstance(one, str) else str(one).replace(" ", "") for one in self.half_lives]
        return [*sensors, *(f"{sensors[place]}_mean{label}" for label in labels for place in self.sensors_)]

    def _doubts_of_past(
        self, values: Array, own: NDArray[np.int64], times: NDArray[np.int64], means: list[Array]
    ) -> list[FewRecordsWarning]:
        """A finding where more than half of the rows lack a mean, or a record a half-life back, unless the first of
        them is that of `fit`."""
        at = np.searchsorted(times, own - self._longest, side="right") - 1
        lacking = (at < 0) | (own - times[np.maximum(at, 0)] > MEAN_REACH * self._longest)
        lacking |= np.isnan(np.hstack(means)).any(axis=1) & ~np.isnan(values[:, self.sensors_]).any(axis=1)
        is_first = np.array_equal(values[own.argmin()], self.first_row_, equal_nan=True)
        if is_first or 2 * lacking.sum() <= len(own):
            return []
        is_timed = self.stamps_ is not None
        reach = duration_text(pd.Timedelta(self._longest)) if is_timed else f"{self._longest} rows"
        few = f"most rows have too few records in the {reach} before for means with such a half-life"
        return no_earlier_records(few, f"{MEAN_REACH} times {reach}")


def no_earlier_records(found: str, needed: str) -> list[FewRecordsWarning]:
    """The finding that features reach to where there are no records, and how many are needed."""
    return [FewRecordsWarning(f"{found}. Give the records of {needed} before, too", "no-earlier-records")]


def trailing_means(
    times: NDArray[np.int64], values: NDArray, half_life: int, step: int, begun: int
) -> tuple[Array, Array]:
    """Exponentially weighted means of columns in order of time, NaN left out, over `MEAN_REACH` half-lives, and the
    share of the weight since records have ``begun`` that lies on recorded time."""
    known = ~np.isnan(values)
    centre = np.where(known, values, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    ages = (times - times[0]) * (np.log(2) / half_life)
    times_before = pd.DataFrame(np.where(known, times[:, np.newaxis], np.nan)).ffill().shift().to_numpy()
    since = np.minimum(np.nan_to_num(times[:, np.newaxis] - times_before, nan=step), 3 * step)
    covered = np.where(known, -np.expm1(-since * (np.log(2) / half_life)), 0.0)
    sums = _decayed_sums(ages, np.hstack([np.where(known, values - centre, 0.0), known, covered]))
    before = np.searchsorted(times, times - MEAN_REACH * half_life, side="right") - 1
    old = np.flatnonzero(before >= 0)
    sums[old] -= sums[before[old]] * np.exp(ages[before[old]] - ages[old])[:, np.newaxis]
    totals, counts, recorded = np.hsplit(sums, 3)
    is_known = counts > 0.5 * 2.0**-MEAN_REACH
    means = np.divide(totals, counts, out=np.full(values.shape, np.nan), where=is_known) + centre
    reach = np.minimum(times - begun + step, MEAN_REACH * half_life) * (np.log(2) / half_life)
    return means, recorded / -np.expm1(-reach)[:, np.newaxis]


def _decayed_sums(ages: NDArray[np.float64], table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums of each row and of all before it, times exp of minus how much older they are."""
    sums = np.empty(table.shape)
    carried, start = np.zeros(table.shape[1]), 0
    while start < len(ages):
        # exp of ages above 300 would overflow
        stop = int(np.searchsorted(ages, ages[start] + 300, side="right"))
        growth = np.exp(ages[start:stop] - ages[start])[:, np.newaxis]
        before = carried * np.exp(ages[start - 1] - ages[start]) if start else carried
        sums[start:stop] = (before + np.cumsum(table[start:stop] * growth, axis=0)) / growth
        carried, start = sums[stop - 1], stop
    return sums


def _read_half_lives(given: Any, is_timed: bool) -> NDArray[np.int64]:
    found = []
    for one in given:
        if is_timed:
            found.append(check_duration(one, "half-life", may_be_zero=False).value)
        elif isinstance(one, Integral) and not isinstance(one, bool | np.bool_ | np.timedelta64) and one > 0:
            found.append(int(one))
        else:
            raise ValueError(f"half-life is {one!r}, but X has no DatetimeIndex; expected a positive number of rows")
    if not found or len(set(found)) < len(found) or max(found) > 10 * YEAR.value:
        raise ValueError(f"half_lives is {given!r}; expected different ones of at most ten years, such as ['30D']")
    return np.array(found, dtype=np.int64)
