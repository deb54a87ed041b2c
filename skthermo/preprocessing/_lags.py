"""Earlier temperatures as additional columns."""

from collections.abc import Sequence
from datetime import timedelta
from numbers import Integral
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, TransformerMixin

from skthermo._frames import frame_like
from skthermo._validation import (
    Interval,
    StrOptions,
    _check_feature_names_in,
    _fit_context,
    check_is_fitted,
    validate_data,
)

DEFAULT_TOLERANCE = 6  # times freq
MISSING = -1  # instead of the number of a row


class LagFeatures(TransformerMixin, BaseEstimator):
    """Current and earlier values of every sensor: a structure follows the temperature with delay.

    Parameters
    ----------
    lags : int or sequence of int, default=24
        Number of columns for each sensor, the current value included: 24 gives the values at
        t, t-1, ..., t-23. Or an explicit list of lags, such as ``[0, 1, 24]``.
    freq : str or timedelta, optional
        Length of one lag, such as "1h", for frames on a DatetimeIndex. By default the most
        frequent time between consecutive records of `fit`.
    tolerance : str or timedelta, optional
        How much older than t - k freq the record for lag k may be; "0h" allows only records at exactly
        that time. By default 6 freq.
    padding : {"edge", "nan"}, default="edge"
        Values before the first record: those of the first record, or NaN.

    Attributes
    ----------
    lags_ : list of int
        Lags in the order of each sensor's columns.
    freq_ : Timedelta or None
        Length of one lag; None where rows are consecutive.
    tolerance_ : Timedelta or None
        How much older the record for a lag may be; None where rows are consecutive.
    history_ : DataFrame or None
        Records of `fit`, to which lags of `transform` reach back; None where rows are consecutive.
    n_features_in_ : int
        Number of sensors.
    feature_names_in_ : ndarray of str
        Names of the sensors, where `fit` saw a frame with such names.

    Notes
    -----
    On an array, or a frame without a DatetimeIndex, lag k is the value k rows earlier, and the rows of
    `fit` are not used in `transform`.

    On a DatetimeIndex, lag k is the last record at or before t - k freq, or NaN if that record is older
    than the tolerance. Records of `fit` and of `transform` are searched together; for a stamp in both, the
    values of `transform` count. Rows may come in any order, which the result keeps.

    A missing value is NaN in every lag that refers to it.

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

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: ArrayLike, y: None = None) -> "LagFeatures":
        """Read the lags and, on a DatetimeIndex, store the records.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        y : None
            Ignored.

        Returns
        -------
        LagFeatures
            The fitted transformer.

        Raises
        ------
        ValueError
            If the lags are not different non-negative integers; if ``freq`` or ``tolerance`` is given
            without a DatetimeIndex, or is not positive; if a stamp is missing or occurs twice.
        """
        values = self._validated(X, reset=True)
        self.lags_ = _read_lags(self.lags)
        self.freq_ = self.tolerance_ = self.history_ = None
        stamps = _stamps(X)
        if stamps is None:
            for name in ("freq", "tolerance"):
                if getattr(self, name) is not None:
                    raise ValueError(
                        f"{name} is {getattr(self, name)!r}, but X has no DatetimeIndex; "
                        f"expected a frame on one, or {name}=None"
                    )
        else:
            self.freq_ = _most_frequent_step(stamps) if self.freq is None else _duration(self.freq, "freq")
            self.tolerance_ = (
                DEFAULT_TOLERANCE * self.freq_ if self.tolerance is None else _duration(self.tolerance, "tolerance")
            )
            self.history_ = frame_like(X, values.copy(), _check_feature_names_in(self, None))
        return self

    def transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Lagged values, one block of columns for each sensor.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_sensors * n_lags)
            A frame gives a frame on its own index.

        Raises
        ------
        ValueError
            If the number or names of sensors, or the kind of index, differ from `fit`.
        """
        check_is_fitted(self)
        values = self._validated(X, reset=False)
        stamps = _stamps(X)
        if (stamps is None) != (self.freq_ is None):
            kinds = ["a DatetimeIndex", "rows without a DatetimeIndex"]
            had, has = kinds if stamps is None else kinds[::-1]
            raise ValueError(f"X has {has}; expected {had}, as in fit")
        lagged = self._by_row(values, self.lags_) if stamps is None else self._by_time(stamps, values)
        return frame_like(X, lagged, self.get_feature_names_out())

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Names of the columns: sensor_lag0, sensor_lag1, ...

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the sensors; by default those seen in `fit`.

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self)
        sensors = _check_feature_names_in(self, input_features)
        return np.array([f"{sensor}_lag{lag}" for sensor in sensors for lag in self.lags_], dtype=object)

    def _validated(self, X: ArrayLike, *, reset: bool) -> NDArray[np.float64]:
        return validate_data(self, X, reset=reset, dtype=[np.float64, np.float32], ensure_all_finite="allow-nan")

    def _by_row(self, values: NDArray, lags: Sequence[int]) -> NDArray:
        n_rows, sensors = len(values), np.ascontiguousarray(values.T)
        lagged = np.empty((len(sensors), len(lags), n_rows), dtype=values.dtype)
        for k, lag in enumerate(lags):
            before = min(lag, n_rows)
            lagged[:, k, before:] = sensors[:, : n_rows - before]
            lagged[:, k, :before] = sensors[:, :1] if self.padding == "edge" else np.nan
        return lagged.reshape(-1, n_rows).T

    def _by_time(self, stamps: pd.DatetimeIndex, values: NDArray) -> NDArray:
        old_stamps, old_values = self.history_.index, self.history_.to_numpy()
        if (old_stamps.tz is None) != (stamps.tz is None):
            raise ValueError(f"X has stamps in time zone {stamps.tz}; expected {old_stamps.tz}, as in fit")
        own = stamps.as_unit("ns").asi8
        old = old_stamps.as_unit("ns").asi8
        rows_per_lag = _rows_per_step(own, self.freq_.value)
        if rows_per_lag and np.array_equal(own, old):
            return self._by_row(values, [lag * rows_per_lag for lag in self.lags_])
        only_old = ~np.isin(old, own)
        known = np.concatenate([old[only_old], own])
        order = np.argsort(known)
        ascending = known[order]
        sources = []
        for lag in self.lags_:
            wanted = own - lag * self.freq_.value
            at = np.searchsorted(ascending, wanted, side="right") - 1
            stale = wanted - ascending[at] > self.tolerance_.value
            before = at < 0
            source = np.where(stale & ~before, MISSING, order[np.maximum(at, 0)])
            sources.append(np.where(before & (self.padding == "nan"), MISSING, source))
        return _rows_by_lag(np.concatenate([old_values[only_old], values]), sources)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags


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


def _read_lags(lags: Any) -> list[int]:
    if isinstance(lags, Integral):
        return list(range(lags))
    explicit = list(lags)
    whole = all(isinstance(lag, Integral) and lag >= 0 for lag in explicit)
    if not explicit or not whole or len(set(explicit)) < len(explicit):
        raise ValueError(f"lags is {lags!r}; expected a positive number or different non-negative integers")
    return [int(lag) for lag in explicit]


def _stamps(X: Any) -> pd.DatetimeIndex | None:
    index = getattr(X, "index", None)
    if not isinstance(index, pd.DatetimeIndex):
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


def _most_frequent_step(stamps: pd.DatetimeIndex) -> pd.Timedelta:
    steps = np.diff(np.sort(stamps.as_unit("ns").asi8))
    if not steps.size:
        raise ValueError("X has 1 sample, whose stamp gives no step between records; expected freq, such as '1h'")
    lengths, counts = np.unique(steps, return_counts=True)
    return pd.Timedelta(int(lengths[counts.argmax()]), unit="ns")


def _duration(value: Any, name: str) -> pd.Timedelta:
    numbered = f"1{value}" if isinstance(value, str) and value[:1].isalpha() else value
    try:
        duration = pd.Timedelta(numbered).as_unit("ns")
    except (ValueError, TypeError) as error:
        raise ValueError(f"{name} is {value!r}; expected a duration such as '1h'") from error
    without_unit = isinstance(value, str) and not any(letter.isalpha() for letter in value)
    if without_unit or duration.value < 0 or (name == "freq" and duration.value == 0):
        raise ValueError(f"{name} is {value!r}; expected a positive duration with its unit, such as '1h'")
    return duration
