"""Records as they come: read, sorted into new, repeated and late ones, and kept."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import as_floats
from skthermo._tables.saved_frames import SavesFrames
from skthermo._validation import with_nan


def read_records(X: Any, columns: pd.Index | None = None, zone: Any = None) -> pd.DataFrame:
    """Records in order of time as floats, in the columns and the time zone of the baseline."""
    if not isinstance(X, pd.DataFrame):
        raise ValueError(f"the records are of type {type(X).__name__}; expected a frame on a DatetimeIndex")
    if columns is not None and not len(X):
        return pd.DataFrame(np.empty((0, len(columns))), pd.DatetimeIndex([], tz=zone).as_unit("ns"), columns)
    if not isinstance(X.index, pd.DatetimeIndex):
        raise ValueError(
            f"the records have an index of type {type(X.index).__name__} ({X.index.dtype}); expected a DatetimeIndex, "
            "as pandas.to_datetime gives"
        )
    if X.index.hasnans:
        raise ValueError(f"{X.index.isna().sum()} of {len(X)} stamps are missing; expected one for each record")
    if columns is not None:
        missing, unknown = [c for c in columns if c not in X.columns], [c for c in X.columns if c not in columns]
        if missing or unknown or X.columns.has_duplicates:
            raise ValueError(
                f"the records lack the columns {missing} of the baseline, and have {unknown} beside them"
                f"{', some of them twice' if X.columns.has_duplicates else ''}; expected the columns of the baseline "
                "(a column of NaN for a sensor that is gone)"
            )
        if str(X.index.tz) != str(zone):
            raise ValueError(
                f"the records have the time zone {X.index.tz}, the baseline {zone}; expected the same, as "
                "tz_localize or tz_convert gives"
            )
        X = X.loc[:, list(columns)]
    values = as_floats(with_nan(X))
    infinite = np.argwhere(np.isinf(values))
    if len(infinite):
        row, column = infinite[0]
        raise ValueError(
            f"{len(infinite)} of {values.size} values are infinite, the first at {X.index[row]} in column "
            f"{X.columns[column]!r}; expected numbers, and NaN where a value is missing"
        )
    stamps = X.index.as_unit("ns")
    stamps.freq = None  # that of one batch is not that of its parts
    frame = pd.DataFrame(values, stamps, X.columns)
    return frame if X.index.is_monotonic_increasing else frame.sort_index(kind="stable")


@dataclass(frozen=True)
class Intake:
    """What a batch brings: records to evaluate, records that came too late, and how many were repeated or late."""

    fresh: pd.DataFrame
    too_late: pd.DataFrame
    n_repeated: int
    n_late: int


@dataclass(frozen=True)
class RecordStore(SavesFrames):
    """Raw records of the baseline, and those that came since for the time of ``retention``."""

    baseline: pd.DataFrame
    kept: pd.DataFrame
    max_delay: pd.Timedelta
    retention: pd.Timedelta

    @property
    def last(self) -> pd.Timestamp:
        """Stamp of the newest record."""
        return (self.kept if len(self.kept) else self.baseline).index[-1]

    def sort_in(self, batch: pd.DataFrame) -> Intake:
        """Tell new records of a batch from those that are known; another value at a known stamp is an error."""
        n_given = len(batch)
        again = batch.index.duplicated()
        if again.any():
            self._check_same(batch[again], batch[~again])
            batch = batch[~again]
        known = np.zeros(len(batch), dtype=bool)
        for table in (self.kept, self.baseline):
            known |= self._check_same(batch, table)
        batch = batch[~known]
        is_too_late = (batch.index <= self.baseline.index[-1]) | (batch.index < self.last - self.max_delay)
        fresh = batch[~is_too_late]
        n_late = int((fresh.index < self.last).sum())
        return Intake(fresh, batch[is_too_late], n_given - len(batch), n_late)

    def with_records(self, fresh: pd.DataFrame) -> RecordStore:
        """The store with new records."""
        if not len(fresh):
            return self
        kept = pd.concat([self.kept, fresh]) if len(self.kept) else fresh
        return replace(self, kept=kept if kept.index.is_monotonic_increasing else kept.sort_index())

    def trimmed(self) -> RecordStore:
        """The store without records that are too old to be kept."""
        first = self.kept.index.searchsorted(self.last - self.retention)
        return replace(self, kept=self.kept.iloc[first:]) if first else self

    def _check_same(self, batch: pd.DataFrame, table: pd.DataFrame) -> NDArray[np.bool_]:
        """Which rows of a batch stand in a table; an error if some have other values there."""
        if not len(batch) or not len(table) or batch.index[-1] < table.index[0] or batch.index[0] > table.index[-1]:
            return np.zeros(len(batch), dtype=bool)
        wanted, stamps = batch.index.asi8, table.index.asi8
        place = np.minimum(np.searchsorted(stamps, wanted), len(stamps) - 1)
        known = stamps[place] == wanted
        new, old = batch.to_numpy()[known], table.to_numpy()[place[known]]
        differs = ~((new == old) | (np.isnan(new) & np.isnan(old)))
        if differs.any():
            row, column = np.argwhere(differs)[0]
            raise ValueError(
                f"{differs.any(axis=1).sum()} of {known.sum()} repeated records have other values than before, the "
                f"first {batch.index[known][row]}: {batch.columns[column]!r} is {new[row, column]:.10g}, and was "
                f"{old[row, column]:.10g}; expected each stamp once, or with the same values"
            )
        return known
