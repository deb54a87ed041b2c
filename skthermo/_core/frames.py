"""Tables of records: pandas frames in and out, checks of rows and columns, stamps, durations and times of rows."""

import re
from collections.abc import Hashable, Iterable, Mapping, Set
from datetime import timedelta, tzinfo
from numbers import Integral, Real
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.fft import irfft, next_fast_len, rfft

from skthermo._core.arrays import Array, as_floats, is_real, real_array, refuse_no_array
from skthermo._core.estimators import _num_samples
from skthermo.exceptions import RecordsWarning

Table: TypeAlias = Array | pd.DataFrame
MISSING_CODES = (-99.0, -999.0, -9999.0, -99999.0)  # numbers that loggers write for a missing value
YEAR, DAY = pd.Timedelta(days=365.25), pd.Timedelta(days=1)
DAY_NS = DAY.value  # nanoseconds


def frame_like(X: Any, values: NDArray, columns: Iterable[Hashable] | None = None) -> Any:
    """Values as a frame with X's index (and by default X's columns) if X is a frame, else unchanged."""
    if not isinstance(X, pd.DataFrame):
        return values
    return pd.DataFrame(values, index=X.index, columns=X.columns if columns is None else list(columns), copy=False)


def named_frame(X: Any, values: Array) -> Any:
    """Values as a frame with X's columns, and X's index where X is a frame of pandas; unchanged for columns without
    names."""
    if isinstance(X, pd.DataFrame) or not hasattr(X, "columns"):
        return frame_like(X, values)
    return pd.DataFrame(values, columns=list(X.columns), copy=False)


def like_targets(X: Any, values: Array, names: Iterable[Hashable] | None, *, is_vector: bool) -> Any:
    """Predictions, (n_samples, n_targets), as a vector or a frame if the targets that were learned were."""
    if is_vector:
        return values[:, 0]
    return values if names is None else frame_like(X, values, names)


def column_names(X: Any, default: str) -> list[Hashable]:
    """Names of X's columns, for messages and outputs: a frame's own, else default1, default2, ..."""
    if hasattr(X, "columns"):
        return list(X.columns)
    return [f"{default}{i + 1}" for i in range(np.shape(X)[1])]


def columns_by_sensor(T: Any) -> dict[Hashable, list[int]]:
    """Positions of each sensor's columns: its own, and its lags and means where `LagFeatures` and
    `ExponentialMeans` made columns of them."""
    columns: dict[Hashable, list[int]] = {}
    for position, name in enumerate(column_names(T, "T")):
        sensor = re.sub(r"_(lag\d+|mean\d+[A-Za-z]*)$", "", name) if isinstance(name, str) else name
        columns.setdefault(sensor, []).append(position)
    return columns


def positions_of(targets: Any, n_columns: int, columns: Iterable[Hashable]) -> NDArray[np.intp]:
    """Positions of the targets, which are given by the names of a frame's columns, or by position. Integers that could
    be names as well as positions are refused."""
    if isinstance(targets, str | bytes | type | Mapping | Set) or not isinstance(targets, Iterable):
        hint = f", such as [{targets!r}]" if isinstance(targets, str | Integral) else ""
        raise ValueError(
            f"targets is {targets!r:.100}, of type {type(targets).__name__}; expected a list of names of columns or "
            f"of positions from 0{hint}"
        )
    targets, columns = list(targets), list(columns)
    are_integers = all(isinstance(name, Integral) for name in (*columns, *targets))
    if are_integers and columns not in ([], list(range(len(columns)))):
        raise ValueError(
            f"targets are the integers {targets}, which may be names or positions of the columns {columns}; expected "
            "columns named by text, or 0, 1, 2, ..."
        )
    if targets and all(isinstance(target, str) for target in targets):
        if not all(isinstance(name, str) for name in columns) or not columns:
            raise ValueError(f"targets are the names {targets}, but X has no column names; expected a frame or indexes")
        unknown = [target for target in targets if columns.count(target) != 1]
        if unknown:
            raise ValueError(f"targets {unknown} are not columns of X, or more than one; expected some of {columns}")
        positions = [columns.index(target) for target in targets]
    elif all(isinstance(target, Integral) and not isinstance(target, bool) for target in targets):
        positions = [int(target) for target in targets]
        outside = [position for position in positions if not 0 <= position < n_columns]
        if outside:
            raise ValueError(f"targets {outside} are not columns of X; expected indexes from 0 to {n_columns - 1}")
    else:
        raise ValueError(f"targets is {targets}; expected names of columns, or integers that are their indexes")
    if len(set(positions)) < len(positions):
        raise ValueError(f"targets {targets} repeat a column; expected each once")
    if not 0 < len(positions) < n_columns:
        raise ValueError(
            f"targets are {len(positions)} of the {n_columns} columns of X; expected at least one, and at least one "
            "other column to predict them from"
        )
    return np.array(positions, dtype=np.intp)


def marker_findings(X: ArrayLike) -> list[RecordsWarning]:
    """A finding where numbers in columns of any quantity probably stand for a missing value, such as -999."""
    values = as_floats(X)
    marked = np.isin(values, MISSING_CODES)
    if not marked.any():
        return []
    names = column_names(X, "x")
    found = [
        f"{values[marked[:, place], place][0]:g} in {names[place]!r}" for place in np.flatnonzero(marked.any(axis=0))
    ]
    return [
        RecordsWarning(
            f"some values look like codes for missing values: {', '.join(found)}. They are used as measured. Put NaN "
            "there",
            "doubtful-values",
        )
    ]


def first_disorder(X: Any) -> int:
    """Position of the first row of a frame that is earlier than the row before it; 0 if there is none."""
    times = getattr(X, "index", None)
    if not isinstance(times, pd.DatetimeIndex) or times.is_monotonic_increasing:
        return 0
    return int(np.argmax(times[1:] < times[:-1])) + 1


def of_a_wrong_clock(stamps: pd.DatetimeIndex) -> NDArray[np.bool_]:
    """Which stamps a clock that was wrong for a time has written: less than a tenth of all, apart from the others by
    more than two years, or by four weeks where the clock goes back to them."""
    wrong = np.zeros(len(stamps), dtype=bool)
    if len(stamps) < 2 or stamps.hasnans:
        return wrong
    times = stamps.as_unit("s").asi8
    order = np.argsort(times, kind="stable")
    steps = np.diff(times)
    goes_back = np.append(False, steps < 0) if 2 * np.count_nonzero(steps < 0) < len(steps) / 5 else wrong
    gaps = np.diff(times[order]) / DAY.total_seconds()
    part = np.append(0, np.cumsum(gaps > 28))
    sizes = np.bincount(part)
    main = int(sizes.argmax())
    for number in np.flatnonzero(sizes < len(stamps) / 10):
        rows = np.sort(order[part == number])
        inner = int(np.flatnonzero(part == number)[0 if number > main else -1])
        gap = gaps[inner - 1] if number > main else gaps[inner]
        if gap > 730 or goes_back[rows[0]]:
            wrong[rows] = True
    return wrong


def check_same_rows(X: Any, y: Any, names: tuple[str, str]) -> None:
    """Raise an error if two tables differ in length or, where both are frames, in index."""
    for what, table in zip(names, (X, y), strict=True):
        refuse_no_array(table, what)
    if _num_samples(X) != _num_samples(y):
        raise ValueError(
            f"{names[0]} has {_num_samples(X)} rows and {names[1]} {_num_samples(y)}; expected the same number"
        )
    if not all(isinstance(table, pd.DataFrame | pd.Series) for table in (X, y)) or X.index.equals(y.index):
        return
    for row, (left, right) in enumerate(zip(X.index, y.index, strict=True)):
        if left != right:
            raise ValueError(
                f"{names[0]} and {names[1]} have different indices (row {row}: {left} and {right}); expected the same"
            )


def row_weights(sample_weight: Any, X: Any) -> Array | None:
    """A weight for each row of X, or None; weights in a series are matched to the rows of a frame by index."""
    if sample_weight is None:
        return None
    n_rows = _num_samples(X)
    if isinstance(sample_weight, pd.Series) and isinstance(X, pd.DataFrame | pd.Series):
        unknown, missing = (
            a.difference(b) for a, b in ((sample_weight.index, X.index), (X.index, sample_weight.index))
        )
        repeats = not sample_weight.index.equals(X.index) and not sample_weight.index.is_unique
        if len(unknown) or len(missing) or repeats:
            raise ValueError(
                f"sample_weight has {len(sample_weight)} rows, {len(unknown)} of them unknown to X, and lacks "
                f"{len(missing)} of its {n_rows}{', and labels repeat' if repeats else ''}; expected the index of X"
            )
        sample_weight = sample_weight if sample_weight.index.equals(X.index) else sample_weight.reindex(X.index)
    given = sample_weight if hasattr(sample_weight, "dtype") else np.asarray(sample_weight)
    is_mask = getattr(given.dtype, "kind", "") == "b"  # which rows count
    weights = real_array(given.astype(float) if is_mask else given, "sample_weight")
    weights = np.full(n_rows, weights) if weights.ndim == 0 else weights
    if weights.shape != (n_rows,):
        raise ValueError(f"sample_weight has shape {weights.shape}; expected ({n_rows},), a weight for each row of X")
    wrong = np.flatnonzero(~np.isfinite(weights) | (weights < 0))
    if wrong.size:
        raise ValueError(
            f"sample_weight is {weights[wrong[0]]:g} in row {wrong[0]}, and negative, NaN or infinite in {wrong.size} "
            f"of {n_rows} rows; expected numbers from 0"
        )
    if not weights.any():
        raise ValueError(f"sample_weight is zero in all {n_rows} rows; expected a positive weight in some")
    return weights


def row_times(T: Any) -> Array:
    """Time of every row since the first one in nanoseconds, or its number where T has no ``DatetimeIndex``."""
    if not has_stamps(T):
        return np.arange(_num_samples(T), dtype=float)
    stamps = T.index.as_unit("ns").asi8
    return (stamps - stamps[:1]).astype(float)


def time_of(T: Any, moment: Any, what: str) -> float:
    """A position counted from 0, or a time, on the scale of `row_times`; infinite for a position after the last."""
    times, is_timed = row_times(T), has_stamps(T)
    if isinstance(moment, int | np.integer) and not isinstance(moment, bool) and moment >= 0:
        if not is_timed:
            return float(moment)
        return float(times[moment]) if moment < len(times) else np.inf
    try:
        if is_timed and not isinstance(moment, Real | timedelta) and not pd.isna(moment):
            return float((pd.Timestamp(moment).as_unit("ns") - T.index[0].as_unit("ns")).value)
    except (TypeError, ValueError):
        pass
    zone = f" in the time zone {T.index.tz}" if is_timed and T.index.tz is not None else ""
    expected = f"a position from 0, or a time{zone}" if is_timed else "a position from 0"
    raise ValueError(f"{what} is {moment!r} for {len(times)} records; expected {expected}")


def as_moment(now: Any, zone: tzinfo | None) -> pd.Timestamp:
    """A time in the time zone of records, by the clock if none is given; records without a zone have local times."""
    try:
        time = pd.Timestamp.now(tz=zone) if now is None else pd.Timestamp(now)
    except (TypeError, ValueError):
        time = pd.NaT
    if pd.isna(time) or (time.tz is not None and zone is None):
        raise ValueError(f"now is {now!r:.100}; expected a time{' without a time zone' if zone is None else ''}")
    if zone is None:
        return time
    return time.tz_localize(zone) if time.tz is None else time.tz_convert(zone)


def check_stamp(moment: Any, index: pd.DatetimeIndex, name: str) -> pd.Timestamp:
    """A moment in the time zone of records."""
    try:
        stamp = pd.Timestamp(pd.NaT if isinstance(moment, Real) else moment)
        stamp = stamp.tz_localize(index.tz) if stamp.tz is None and index.tz is not None else stamp
        if not pd.isna(stamp) and (stamp.tz is None) == (index.tz is None):
            return stamp
    except (TypeError, ValueError, OverflowError):
        pass
    zone = " without a time zone" if index.tz is None else f" in the time zone {index.tz}"
    raise ValueError(f"{name} is {moment!r:.100}; expected a time{zone}, such as {index[-1]}")


def usual_step(stamps: pd.DatetimeIndex) -> pd.Timedelta:
    """Median time between records in order of time; zero for one record alone."""
    steps = np.diff(stamps.as_unit("ns").asi8)
    return pd.Timedelta(np.median(steps) if len(steps) else 0, "ns")


def as_index(times: ArrayLike, zone: Any) -> pd.DatetimeIndex:
    """Times in nanoseconds as stamps in a time zone, if there is one; missing for None."""
    missing = np.datetime64("NaT", "ns").astype(np.int64)
    numbers = np.array([missing if time is None else time for time in times], dtype=np.int64)
    stamps = pd.DatetimeIndex(numbers.view("M8[ns]"))
    return stamps.tz_localize("UTC").tz_convert(zone) if zone else stamps


def has_stamps(T: Any) -> bool:
    """Whether rows have times: a frame on a ``DatetimeIndex``."""
    return isinstance(getattr(T, "index", None), pd.DatetimeIndex)


def correlation_time(series: Array) -> float:
    """1 + 2 * the sum of the autocorrelations up to the first that is not clearly above zero.

    That is the first within two standard errors of zero; lags reach half of the series, NaN is left out.
    """
    known = ~np.isnan(series)
    if not known.any() or np.ptp(series[known]) == 0:
        return 1.0
    centred = np.where(known, series - series[known].mean(), 0.0)
    variance = (centred**2).sum() / known.sum()
    size = next_fast_len(2 * len(series), real=True)
    spectra = np.abs(rfft([known.astype(float), centred], size)) ** 2  # of products of values 1, 2, ... places apart
    pairs, products = irfft(spectra, size)[:, 1 : max(len(series) // 2, 1)]
    pairs = np.maximum(np.rint(pairs), 1)
    correlations = products / pairs / variance
    n_clear = int(np.argmin(np.append(correlations > 2 / np.sqrt(pairs), False)))
    return float(1 + 2 * correlations[:n_clear].sum())


def correlation_times(columns: Array) -> Array:
    """The `correlation_time` of each column, (n_columns,)."""
    return np.array([correlation_time(column) for column in columns.T])


def as_stamps(index: pd.Index) -> pd.DatetimeIndex | None:
    """An index of stamps as a DatetimeIndex, periods by their start; None for an index of something else."""
    if isinstance(index, pd.DatetimeIndex):
        return index
    if isinstance(index, pd.PeriodIndex):
        return index.to_timestamp()
    if isinstance(index, pd.MultiIndex):
        if any(as_stamps(level) is not None for level in index.levels):
            raise ValueError(f"X has stamps on one of the index levels {list(index.names)}; expected a DatetimeIndex")
        return None
    kind = index.inferred_type
    if kind.startswith("timedelta"):
        raise ValueError(
            f"X has an index of durations, the first {index[0]}; expected a DatetimeIndex: add the time of the start"
        )
    if kind == "string" and re.match(r"\s*\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}", str(index[0])):
        raise ValueError(
            f"X has stamps as text, the first {index[0]!r}; expected a DatetimeIndex, as pandas.to_datetime gives"
        )
    if kind not in ("datetime", "datetime64", "date"):
        return None
    try:
        return pd.DatetimeIndex(index)
    except (ValueError, TypeError) as error:
        raise ValueError(
            f"the index of X holds stamps with several offsets from UTC ({error}); expected a DatetimeIndex: convert "
            "them by pandas.to_datetime(..., utc=True)"
        ) from error


def check_duration(value: Any, name: str, *, may_be_zero: bool = True) -> pd.Timedelta:
    """A duration of fixed length in nanoseconds, zero or more, or a positive one."""
    units = re.findall("[A-Za-z]+", value) if isinstance(value, str) else None
    fixed = {"D", "W", "H", "T", "S", "L", "U", "N"}  # days, weeks, hours ... nanoseconds; months and years are not
    if any(unit.isupper() and unit not in fixed for unit in units or ()):
        raise ValueError(
            f"{name} is {value!r}; expected a duration of fixed length with its unit, such as '10min', '1h' or '30D'"
        )
    try:
        if is_real(value) or isinstance(value, bool):  # nanoseconds for pandas
            raise TypeError
        numbered = f"1{value}" if isinstance(value, str) and value[:1].isalpha() else value
        duration = pd.Timedelta(numbered).as_unit("ns")
    except (ValueError, TypeError, AttributeError) as error:
        raise ValueError(f"{name} is {value!r}; expected a duration of fixed length, such as '1h'") from error
    if units == [] or not duration.value >= (0 if may_be_zero else 1):
        expected = "a duration of zero or more" if may_be_zero else "a positive duration"
        raise ValueError(f"{name} is {value!r}; expected {expected} with its unit, such as '1h'")
    return duration


def midnights(stamps: pd.DatetimeIndex) -> pd.DatetimeIndex:
    """The first moment of the calendar day of each stamp: midnight, or later where the clocks are set forward then."""
    return _localized(stamps.tz_localize(None).normalize(), stamps.tz)


def midnight(stamp: pd.Timestamp) -> pd.Timestamp:
    """The first moment of the calendar day of a stamp."""
    return midnights(pd.DatetimeIndex([stamp]))[0]


def midnights_between(first: pd.Timestamp, last: pd.Timestamp) -> pd.DatetimeIndex:
    """The first moment of each calendar day from the day of one stamp to the day of another."""
    ends = (stamp.tz_localize(None).normalize() for stamp in (first, last))
    return _localized(pd.date_range(*ends, freq="D"), first.tz).as_unit(first.unit)


def days_later(midnight: pd.Timestamp, number: int) -> pd.Timestamp:
    """The first moment of the calendar day that comes so many days after one."""
    later = midnight.tz_localize(None).normalize() + number * DAY
    return _localized(pd.DatetimeIndex([later]), midnight.tz)[0]


def _localized(days: pd.DatetimeIndex, zone: Any) -> pd.DatetimeIndex:
    """Days in a time zone; of a midnight that comes twice, the first."""
    if zone is None:
        return days
    return days.tz_localize(zone, nonexistent="shift_forward", ambiguous=np.ones(len(days), dtype=bool))
