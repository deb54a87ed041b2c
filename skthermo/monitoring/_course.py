"""The course of a monitor: what it has evaluated, what it needs to go on, and how late records are taken in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo._tables.saved_frames import SavesFrames
from skthermo.monitoring._active import ActiveDetector
from skthermo.monitoring._corrections import Corrections, CorrectionState
from skthermo.monitoring._events import EventLog
from skthermo.monitoring._records import RecordStore

ANSWER = ("state", "index", "threshold", "modes", "reason", "event")


@dataclass(frozen=True)
class Checkpoint(SavesFrames):
    """Where everything stood at the beginning of a day, before its first record."""

    day: pd.Timestamp
    corrections: CorrectionState
    log: EventLog


@dataclass(frozen=True)
class Course(SavesFrames):
    """Evaluations so far, by record and by day, and the checkpoints of the last days.

    ``corrected`` are the records as the detector sees them, those kept and the memory before the first checkpoint.
    """

    corrected: pd.DataFrame
    checkpoints: tuple[Checkpoint, ...]
    log: EventLog
    evaluations: pd.DataFrame
    days: pd.DataFrame

    @classmethod
    def of(cls, active: ActiveDetector, baseline: pd.DataFrame) -> Course:
        """The course that begins after a baseline, whose last records are the first memory."""
        times, end = baseline.index.asi8, baseline.index[-1]
        start = active.memory.start(times, len(times), int(times[-1]) + 1)
        nothing = no_evaluations(baseline.index[:0])
        checkpoint = Checkpoint(end.normalize(), active.corrections.start(), EventLog())
        return cls(
            active.plausible.cleaned(baseline)[0].iloc[start:],
            (checkpoint,),
            checkpoint.log,
            nothing,
            _days_of(nothing),
        )

    @property
    def corrections(self) -> CorrectionState:
        """States of the corrections at the beginning of the newest day."""
        return self.checkpoints[-1].corrections

    def advanced(self, active: ActiveDetector, fresh: pd.DataFrame, store: RecordStore) -> tuple[Course, pd.DataFrame]:
        """The course after new records, which are in the store already, and what it says of these and of later ones.

        It goes on from the beginning of the day of the first new record, and evaluates all records from that one on.
        """
        first, rules = fresh.index[0], active.rules
        place = max(n for n, one in enumerate(self.checkpoints) if n == 0 or one.day <= first)
        begin = self.checkpoints[place]
        raw = store.kept.iloc[store.kept.index.searchsorted(begin.day) :]
        cleaned, marks = active.plausible.cleaned(raw)
        days, states, corrected = _corrected_by_day(active.corrections, begin, cleaned)
        memory = self.corrected.iloc[: self.corrected.index.searchsorted(raw.index[0])]
        records, n_memory = pd.concat([memory, corrected]), len(memory)
        told = self.evaluations.iloc[slice(*self.evaluations.index.searchsorted(pd.DatetimeIndex([begin.day, first])))]
        new = n_memory + len(told)
        index = np.append(told["index"].to_numpy(), active.index(records, new))
        series, times = active.by_kind(records, n_memory, index), raw.index.asi8
        is_open = np.any(list(begin.log.follow(rules, series, times)[0].values()), axis=0) & ~np.isnan(index)
        modes, rows = np.full(len(raw), "", dtype=object), np.flatnonzero(is_open)
        modes[rows] = active.drivers(records, rows + n_memory)
        bounds = [*raw.index.searchsorted(pd.DatetimeIndex(days)), len(raw)]
        log, numbers, points = begin.log, {kind: np.zeros(len(raw), dtype=np.int64) for kind in series}, []
        for day, state, (start, stop) in zip(days, states, pairwise(bounds), strict=True):
            points.append(Checkpoint(day, state, log))
            own = slice(start, stop)
            found, log = log.follow(rules, {kind: one[own] for kind, one in series.items()}, times[own], modes[own])
            for kind, number in found.items():
                numbers[kind][own] = number
        reasons = active.reasons(records, new, index[len(told) :], marks[len(told) :])
        reasons = _with_stiffening(told["reason"].tolist() + reasons, numbers, len(told))
        answers = _answers(raw.index, index, active.threshold, modes, reasons, numbers)
        points = _since([*self.checkpoints[:place], *points], store.last - store.max_delay)
        needed = active.memory.start(records.index.asi8, records.index.searchsorted(points[0].day), points[0].day.value)
        evaluated = pd.concat([self.evaluations.iloc[: self.evaluations.index.searchsorted(begin.day)], answers])
        course = Course(
            records.iloc[min(needed, records.index.searchsorted(store.last - store.retention)) :],
            tuple(points),
            log,
            evaluated.iloc[evaluated.index.searchsorted(store.last - store.retention) :],
            self._with_days(active.corrections, days, states, answers),
        )
        return course, self._news(answers.iloc[len(told) :], fresh.index)

    def handed_over(self, active: ActiveDetector, store: RecordStore, end: int | None = None) -> Course:
        """The course with another detector, which evaluates the records of the newest day anew.

        With an ``end``, events that are open have ended then, and sensors are watched from new.
        """
        points, log = self.checkpoints, self.log
        if end is not None:
            log, start = log.ended(end), active.corrections.start()
            points = tuple(replace(one, log=one.log.ended(end), corrections=start) for one in points)
        day = points[-1].day
        course = replace(self, checkpoints=points, log=log, evaluations=self.evaluations[self.evaluations.index < day])
        today = store.kept[store.kept.index >= day]
        return course.advanced(active, today, store)[0] if len(today) else course

    def _news(self, answers: pd.DataFrame, fresh: pd.DatetimeIndex) -> pd.DataFrame:
        """The answers to new records, and those to others that have changed."""
        is_new = answers.index.isin(fresh)
        changed = np.zeros(len(answers), dtype=bool)
        if not is_new.all():
            known = answers[~is_new]
            before = self.evaluations.loc[known.index]
            same = [(known[c] == before[c]) | (known[c].isna() & before[c].isna()) for c in ANSWER]
            changed[~is_new] = ~np.all(same, axis=0)
        return answers.assign(revised=changed)[is_new | changed]

    def _with_days(
        self,
        corrections: Corrections,
        days: Sequence[pd.Timestamp],
        states: Sequence[CorrectionState],
        answers: pd.DataFrame,
    ) -> pd.DataFrame:
        """Daily summaries, those of some days anew."""
        new = _days_of(answers)
        if corrections.drift is not None:
            by_day = dict(zip(days, states, strict=True))
            shares = pd.DataFrame({day: corrections.drifts(by_day[day])["taken_out"] for day in new.index}).T
            new = new.join(shares.add_prefix("drift "))
        before = self.days.iloc[: self.days.index.searchsorted(days[0])]
        return pd.concat([before, new]) if len(before) else new


def _corrected_by_day(
    corrections: Corrections, begin: Checkpoint, records: pd.DataFrame
) -> tuple[list[pd.Timestamp], list[CorrectionState], pd.DataFrame]:
    """Days from a checkpoint to the last record, states of the corrections before each, and the corrected records."""
    days = list(pd.date_range(begin.day, records.index[-1].normalize(), freq="D"))
    bounds = [*records.index.searchsorted(pd.DatetimeIndex(days)), len(records)]
    parts = [records.iloc[start:stop] for start, stop in pairwise(bounds)]
    states = [begin.corrections]
    for day in parts[:-1]:
        states.append(corrections.advance(states[-1], day))
    corrected = [corrections.corrected(state, day) for state, day in zip(states, parts, strict=True) if len(day)]
    return days, states, pd.concat(corrected)


def _since(points: Sequence[Checkpoint], horizon: pd.Timestamp) -> Sequence[Checkpoint]:
    """The checkpoints from the last one before a time on."""
    return points[max(n for n, one in enumerate(points) if n == 0 or one.day <= horizon) :]


def _with_stiffening(reasons: list[str], numbers: dict[str, NDArray[np.int64]], n_told: int) -> list[str]:
    """Reasons that say so of records, from a position on, that are stiffer than the baseline."""
    stiffer = np.flatnonzero(numbers.get("stiffening", np.zeros(0)) > 0)
    for row in stiffer[stiffer >= n_told]:
        reasons[row] = "; ".join(filter(None, [reasons[row], "stiffer than the baseline"]))
    return reasons


def no_evaluations(stamps: pd.DatetimeIndex, threshold: float = np.nan, reasons: Sequence[str] = ()) -> pd.DataFrame:
    """A row for each of some records that are not evaluated."""
    modes, number = np.full(len(stamps), "", dtype=object), np.zeros(len(stamps), dtype=np.int64)
    return _answers(stamps, np.full(len(stamps), np.nan), threshold, modes, list(reasons), {"damage": number})


def _answers(
    stamps: pd.DatetimeIndex,
    index: Array,
    threshold: float,
    modes: NDArray[Any],
    reasons: list[str],
    numbers: dict[str, NDArray[np.int64]],
) -> pd.DataFrame:
    """A row for each record."""
    evaluated, is_alarm = ~np.isnan(index), numbers["damage"] > 0
    state = np.where(evaluated, np.where(is_alarm, "alarm", "healthy"), "not evaluated")
    event = np.where(is_alarm, numbers["damage"], numbers.get("stiffening", 0))
    table = {
        "state": pd.Series(state.tolist(), stamps, dtype=object),
        "index": index,
        "threshold": np.full(len(index), threshold),
        "modes": pd.Series(np.where(evaluated & is_alarm, modes, "").tolist(), stamps, dtype=object),
        "reason": pd.Series(reasons, stamps, dtype=object),
        "event": np.where(evaluated, event, 0),
    }
    return pd.DataFrame(table, stamps)


def _days_of(answers: pd.DataFrame) -> pd.DataFrame:
    """A row for each calendar day that has records, from the evaluations of all of them in order of time.

    ``n_records``, of which ``n_evaluated`` and ``n_alarms``; ``index_median`` and ``index_max``, NaN if
    none is evaluated.
    """
    by_day = answers.assign(is_alarm=answers["state"] == "alarm").groupby(answers.index.normalize().rename("day"))
    index = by_day["index"]
    return pd.DataFrame(
        {
            "n_records": by_day.size(),
            "n_evaluated": index.count(),
            "n_alarms": by_day["is_alarm"].sum().astype("int64"),
            "index_median": index.median(),
            "index_max": index.max(),
        }
    )
