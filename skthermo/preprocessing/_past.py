"""Records of `fit` as the past of those of `transform`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._validation import Estimator, TransformerMixin, validate_data
from skthermo.preprocessing._stamps import as_stamps

EARLIEST = np.iinfo(np.int64).min  # stamp that there may be, in nanoseconds


class PastFeatures(TransformerMixin, Estimator):
    """A transformer whose columns depend on earlier records, which it finds by their stamps among those of `fit`."""

    history_: NDArray | None
    stamps_: NDArray | None
    time_zone_: str | None

    def _validated(self, X: ArrayLike, *, reset: bool) -> NDArray[np.float64]:
        return validate_data(self, X, reset=reset, dtype=[np.float64, np.float32], ensure_all_finite="allow-nan")

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


def in_words(duration: np.timedelta64) -> str:
    """A duration in hours, or in days from two days on."""
    hours = duration / np.timedelta64(1, "h")
    return f"{hours:.3g} h" if hours < 48 else f"{hours / 24:.3g} days"


def _time_zone(stamps: pd.DatetimeIndex) -> str | None:
    return None if stamps.tz is None else str(stamps.tz)
