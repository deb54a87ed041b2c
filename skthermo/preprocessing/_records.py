"""What transformers of records share, and records of `fit` as the past of those of `transform`."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable, Sequence
from typing import Self, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._estimators.warnings import explain_rows
from skthermo._tables.frames import Table, frame_like
from skthermo._validation import (
    Estimator,
    TransformerMixin,
    _check_feature_names_in,
    _fit_context,
    check_is_fitted,
)
from skthermo.preprocessing._stamps import as_stamps

EARLIEST = np.iinfo(np.int64).min  # stamp that there may be, in nanoseconds


class RecordTransformer(TransformerMixin, Estimator):
    """A transformer that gives a row for every record, and a frame on the same index for a frame."""

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: ArrayLike, y: None = None) -> Self:
        """Learn from records what `transform` needs of them.

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
            If X holds what is no number, or has not what a parameter asks for, such as stamps, each once, for a
            duration.
        """
        self._learn(X, self._validated(X, reset=True))
        return self

    @overload
    def transform(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def transform(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """What the class says, for each record.

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

    @abstractmethod
    def _learn(self, X: Table, values: NDArray) -> None:
        """What `fit` learns from X and its checked values."""

    @abstractmethod
    def _transformed(self, X: Table, values: NDArray) -> Table:
        """The result of `transform`, from X and its checked values."""

    def _names(self, columns: Sequence[Hashable]) -> list[Hashable]:
        """Names of the results for columns of these names: by default the same."""
        return list(columns)


class PastFeatures(RecordTransformer):
    """A transformer whose columns depend on earlier records, which it finds by their stamps among those of `fit`."""

    history_: NDArray | None
    stamps_: NDArray | None
    time_zone_: str | None

    def _transformed(self, X: Table, values: NDArray) -> Table:
        features, told = self._features(X, values, self._stamps_as_in_fit(X))
        return explain_rows(frame_like(X, features, self._names(getattr(X, "columns", ()))), told)

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
            self.time_zone_ = _time_zone(stamps)
        return stamps

    def _stamps_as_in_fit(self, X: Table) -> pd.DatetimeIndex | None:
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


def _time_zone(stamps: pd.DatetimeIndex) -> str | None:
    return None if stamps.tz is None else str(stamps.tz)
