"""Records as they come: read, sorted into new, repeated and late ones, kept, and how far back a detector looks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, is_dataclass, replace
from datetime import timedelta
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import BaseEstimator
from sklearn.pipeline import Pipeline

from skthermo._core.arrays import as_floats, is_model, refuse_no_table
from skthermo._core.frames import DAY_NS, YEAR, usual_step
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.text import duration_text
from skthermo.detection import CompensatedDetector
from skthermo.preprocessing import HampelFilter

JUMP = pd.Timedelta("28D")  # shortest time between two records from which on a clock may be wrong
TIMES_LONGEST, TIMES_USUAL = 2, 10  # the same in longest and usual steps of the baseline, if those are longer
OF_TRAINING = frozenset({"no-rows", "missing-column", "constant"})  # gross errors that do no harm to a few records
CONFIRMED = 10  # records after a jump that confirm each other
Path = tuple[tuple[int, int], ...]
"""Reaches of the steps on one way through a detector, the last step first: (rows, nanoseconds), one of them zero."""


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
    refuse_no_table(X, "the table of records")
    values = as_floats(X)
    stamps = X.index.as_unit("ns")
    stamps.freq = None  # that of one batch is not that of its parts
    frame = pd.DataFrame(values, stamps, X.columns)
    return frame if X.index.is_monotonic_increasing else frame.sort_index(kind="stable")


@dataclass(frozen=True)
class Intake:
    """What a batch brings: records to evaluate, those that came too late or are stamped too far ahead, and the store.

    ``reasons`` say why those of ``too_late`` and ``ahead`` are not evaluated.
    """

    store: RecordStore
    fresh: pd.DataFrame
    too_late: pd.DataFrame
    ahead: pd.DataFrame
    reasons: list[str]
    n_repeated: int
    n_late: int


@dataclass(frozen=True)
class RecordStore(SavesFrames):
    """Raw records of the baseline, those that came since for the time of ``retention``, and those set aside.

    A record is set ``ahead`` if it is stamped more than a ``jump`` after the one before it, until it is of the
    present by the clock of this computer, or others confirm it.
    """

    baseline: pd.DataFrame
    kept: pd.DataFrame
    ahead: pd.DataFrame
    max_delay: pd.Timedelta
    jump: pd.Timedelta
    retention: pd.Timedelta

    @classmethod
    def of(cls, baseline: pd.DataFrame, max_delay: pd.Timedelta, retention: pd.Timedelta) -> RecordStore:
        """With no record since the baseline; a jump is one that no outage of the baseline explains."""
        longest = pd.Timedelta(np.diff(baseline.index.asi8).max(initial=0), "ns")
        jump = max(JUMP, TIMES_LONGEST * longest, TIMES_USUAL * usual_step(baseline.index))
        nothing = baseline.iloc[:0]
        return cls(baseline, nothing, nothing, max_delay, jump, retention)

    @property
    def last(self) -> pd.Timestamp:
        return (self.kept if len(self.kept) else self.baseline).index[-1]

    def sort_in(self, batch: pd.DataFrame, are_confirmed: bool = False) -> Intake:
        """Distinguish new records of a batch from known ones; another value at a known stamp is an error."""
        n_given, again = len(batch), batch.index.duplicated()
        if again.any():
            self._check_same(batch[again], batch[~again])
            batch = batch[~again]
        known = np.zeros(len(batch), dtype=bool)
        for table in (self.kept, self.baseline, self.ahead):
            known |= self._check_same(batch, table)
        batch = batch[~known]
        is_too_late = (batch.index <= self.baseline.index[-1]) | (batch.index < self.last - self.max_delay)
        too_late, timely = batch[is_too_late], batch[~is_too_late]
        timely = pd.concat([timely, self.ahead]).sort_index() if len(self.ahead) else timely
        n_taken = len(timely) if are_confirmed else self._n_in_time(timely.index)
        fresh, ahead = timely.iloc[:n_taken], timely.iloc[n_taken:]
        set_aside = ahead[ahead.index.isin(batch.index)]
        end, late = self.baseline.index[-1], f"more than {duration_text(self.max_delay)} after newer records"
        early = f"before the end of the baseline ({end})"
        reasons = np.where(too_late.index <= end, early, f"came too late, {late}").tolist()
        newest = max(self.last, fresh.index[-1]) if len(fresh) else self.last
        reasons += [
            f"stamped more than {duration_text(self.jump)} after the newest record ({newest}): set aside"
        ] * len(set_aside)
        n_late = int((fresh.index < self.last).sum())
        kept = pd.concat([self.kept, fresh]) if len(self.kept) and len(fresh) else fresh if len(fresh) else self.kept
        kept = kept if kept.index.is_monotonic_increasing else kept.sort_index()
        store = replace(self, kept=kept, ahead=ahead)
        return Intake(store, fresh, too_late, set_aside, reasons, n_given - len(batch), n_late)

    def jumps(self, stamps: pd.DatetimeIndex) -> bool:
        """Whether new records, in order of time, are farther apart than a clock that works would have them."""
        times = np.append(self.last.as_unit("ns").value, stamps.asi8)
        return bool((np.diff(times) > self.jump.value).any())

    def trimmed(self) -> RecordStore:
        """The store without records that are too old to be kept."""
        first = self.kept.index.searchsorted(self.last - self.retention)
        return replace(self, kept=self.kept.iloc[first:]) if first else self

    def _n_in_time(self, stamps: pd.DatetimeIndex) -> int:
        """How many records, in order of time, are not too far ahead.

        After a jump, those up to the next one are taken in if they reach the present, or if they are enough to confirm
        each other and are not in the future: a logger may have been silent for months. Where earlier records were in
        the future already, as in a simulation, the clock says nothing, and only a year or more is a jump.
        """
        times, last = stamps.asi8, self.last.as_unit("ns").value
        now = pd.Timestamp.now("UTC").as_unit("ns").value + DAY_NS  # stamps without a time zone are local
        is_live = last <= now
        jump = self.jump.value if is_live else max(self.jump.value, YEAR.value)
        before = np.maximum.accumulate(np.append(last, times[:-1]))
        for start, stop in pairwise([*np.flatnonzero(times - before > jump), len(times)]):
            newest = times[stop - 1]
            is_present = is_live and now - jump <= newest <= now
            if (is_live and newest > now) or (not is_present and stop - start < CONFIRMED):
                return int(start)
        return len(times)

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


@dataclass(frozen=True)
class Memory:
    """Which earlier records the evaluation of a record needs, on all ways from its records to its damage index."""

    paths: tuple[Path, ...]

    @classmethod
    def of(cls, detector: Any) -> Memory:
        """That of a fitted detector by ``lookback_`` of its parts: those in a row add up, of several ways all count."""
        return cls(tuple(sorted(_paths(detector, set()))))

    @classmethod
    def of_time(cls, duration: pd.Timedelta) -> Memory:
        return cls((((0, duration.value),),))

    def start(self, times: NDArray[np.int64], place: int, time: int | None = None) -> int:
        """Position of the earliest record that is needed for the one at a position, or at a time before it."""
        earliest = place
        for path in self.paths:
            at, moment = place, time
            for rows, duration in path:
                if rows:
                    at = max(at - rows, 0)
                else:
                    at = int(np.searchsorted(times[:at], (times[at] if moment is None else moment) - duration))
                moment = None
            earliest = min(earliest, at)
        return earliest

    def duration(self, step: pd.Timedelta) -> pd.Timedelta:
        """The longest of all ways in time, of records that are so far apart."""
        return max(
            sum((n * step + pd.Timedelta(time, "ns") for n, time in path), pd.Timedelta(0)) for path in self.paths
        )

    def __str__(self) -> str:
        """The reaches in words, such as "30 h" or "24 records and 30 h"."""
        rows, time = (max(sum(reach[part] for reach in path) for path in self.paths) for part in (0, 1))
        words = [f"{rows} records"] if rows else []
        words += [f"{time / 3.6e12:.3g} h"] if time else []
        return " and ".join(words) or "nothing"


def _paths(part: Any, seen: set[int]) -> set[Path]:
    """Ways through a fitted part, each with the reaches on it."""
    if id(part) in seen:
        return {()}
    if isinstance(part, CompensatedDetector):
        before = _paths(part.compensator_, seen)
        return {way + more for way in _paths(part.means_, seen) for more in before}
    if isinstance(part, Pipeline):
        ways: set[Path] = {()}
        for _, step in reversed(part.steps):
            ways = {way + more for way in ways for more in _paths(step, seen)}
        return ways
    seen = seen | {id(part)}
    if isinstance(part, HampelFilter):
        raise ValueError(
            f"the detector holds {part!r:.100}, which compares records with later ones; expected steps that look back "
            "only: filter the baseline before fit"
        )
    if hasattr(part, "lookback_"):
        lookback = part.lookback_
        is_time = isinstance(lookback, np.timedelta64 | timedelta)
        reach = (0, pd.Timedelta(lookback).as_unit("ns").value) if is_time else (int(lookback), 0)
        return {(reach,)} if any(reach) else {()}
    found = set().union(*(_paths(inner, seen) for inner in _inner(part)))
    return found or {()}


def _inner(part: Any) -> Iterator[Any]:
    """Estimators and objects of which a part is made."""
    for value in list(getattr(part, "__dict__", {}).values()):
        values = value.values() if isinstance(value, Mapping) else value if isinstance(value, list | tuple) else [value]
        for one in values:
            for inner in one if isinstance(one, tuple) else (one,):
                made = isinstance(inner, BaseEstimator) or (is_dataclass(inner) and not isinstance(inner, type))
                if made and not is_model(inner):
                    yield inner
