"""Records of `fit` as the past of those of `transform`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._estimators.warnings import explain_rows
from skthermo._tables.frames import frame_like
from skthermo._validation import (
    Estimator,
    TransformerMixin,
    _check_feature_names_in,
    check_is_fitted,
)
from skthermo.preprocessing._stamps import as_stamps

EARLIEST = np.iinfo(np.int64).min  # stamp that there may be, in nanoseconds


class PastFeatures(TransformerMixin, Estimator):
    """A transformer whose columns depend on earlier records, which it finds by their stamps among those of `fit`."""

    history_: NDArray | None
    stamps_: NDArray | None
    time_zone_: str | None

    @overload
    def transform(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def transform(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Features of every row, from its own values and those of earlier records.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius; NaN is allowed.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_features)
            In the columns of `get_feature_names_out`. A frame gives a frame on its own index.

        Raises
        ------
        ValueError
            If the number or names of sensors, or the kind of index, differ from `fit`.

        Warns
        -----
        UserWarning
            If many rows lack records before them, as the notes of the class say.
        """
        check_is_fitted(self)
        values = self._validated(X, reset=False)
        features, told = self._features(X, values, self._stamps_as_in_fit(X))
        return explain_rows(frame_like(X, features, self._names(getattr(X, "columns", ()))), told)

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Names of the columns: of each sensor and lag, or of the sensors and then of their means.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the sensors; by default those seen in `fit`.

        Returns
        -------
        ndarray of str
            Such as ``T1_lag0`` or ``T1_mean30D``.
        """
        check_is_fitted(self)
        return np.array(self._names(_check_feature_names_in(self, input_features)), dtype=object)

    def _features(
        self, X: Any, values: NDArray, stamps: pd.DatetimeIndex | None
    ) -> tuple[NDArray, NDArray[np.bool_] | np.bool_]:
        """The features, and the rows of which a warning has said why they lack some."""
        raise NotImplementedError

    def _names(self, sensors: Sequence[Any]) -> list[Any]:
        """Names of the features of some sensors."""
        raise NotImplementedError

    def _remember(self, X: Any, values: NDArray) -> pd.DatetimeIndex | None:
        """Store the records of `fit` where they have stamps, and return these."""
        self.history_ = self.stamps_ = self.time_zone_ = None
        stamps = stamps_of(X)
        if stamps is not None:
            self.history_ = values.copy()
            self.stamps_ = stamps.as_unit("ns").asi8.view("datetime64[ns]")
            self.time_zone_ = _time_zone(stamps)
        return stamps

    def _stamps_as_in_fit(self, X: Any) -> pd.DatetimeIndex | None:
        """Stamps of new records, of the same kind as those of `fit`."""
        stamps = stamps_of(X)
        if (stamps is None) != (self.stamps_ is None):
            kinds = ["a DatetimeIndex", "rows without a DatetimeIndex"]
            had, has = kinds if stamps is None else kinds[::-1]
            raise ValueError(f"X has {has}; expected {had}, as in fit")
        if stamps is not None and (self.time_zone_ is None) != (stamps.tz is None):
            raise ValueError(f"X has stamps in time zone {_time_zone(stamps)}; expected {self.time_zone_}, as in fit")
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


def stamps_of(X: Any) -> pd.DatetimeIndex | None:
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


def _time_zone(stamps: pd.DatetimeIndex) -> str | None:
    return None if stamps.tz is None else str(stamps.tz)
