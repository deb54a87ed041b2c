"""The course of a monitor: what it has judged, what it needs to go on, and how it goes back when records come late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo._saved_frames import SavesFrames
from skthermo.monitoring._events import EventLog
from skthermo.monitoring._judge import Judge
from skthermo.monitoring._records import Plausible, RecordStore, stamps_of
from skthermo.monitoring._stages import Stages, StageState

ANSWER = ["state", "index", "threshold", "modes", "reason", "event"]


@dataclass(frozen=True)
class Checkpoint(SavesFrames):
    """Where everything stood at the beginning of a day, before its first record."""

    day: pd.Timestamp
    stages: StageState
    log: EventLog


@dataclass(frozen=True)
class Bench:
    """What records go through: plausible values, stages, the detector and the threshold. It does not change."""

    plausible: Plausible
    stages: Stages
    judge: Judge
    threshold: float


@dataclass(frozen=True)
class Course(SavesFrames):
    """Judgements so far, by record and by day, and the checkpoints of the last days.

    ``corrected`` are the records as the detector sees them, those kept and the memory before the first checkpoint.
    """

    corrected: pd.DataFrame
    checkpoints: tuple[Checkpoint, ...]
    log: EventLog
    judged: pd.DataFrame
    days: pd.DataFrame

    @classmethod
    def of(cls, bench: Bench, baseline: pd.DataFrame, log: EventLog) -> Course:
        """The course that begins after a baseline."""
        cleaned, _, _ = bench.plausible.cleaned(baseline)
        times, end = stamps_of(baseline), baseline.index[-1]
        start = bench.judge.memory.start(times, len(times), int(times[-1]) + 1)
        checkpoint = Checkpoint(end.normalize(), bench.stages.start(), log)
        nothing = nothing_judged(baseline.index[:0])
        return cls(cleaned.iloc[start:], (checkpoint,), log, nothing, _days_of(nothing))

    @property
    def stages(self) -> StageState:
        """States of the stages at the beginning of the newest day."""
        return self.checkpoints[-1].stages

    def advanced(self, bench: Bench, fresh: pd.DataFrame, store: RecordStore) -> tuple[Course, pd.DataFrame]:
        """The course after new records, which are in the store already, and what it says of these and of later ones.

        It goes on from the day of the first new record, and judges all records from that one on.
        """
        first = fresh.index[0]
        place = max(n for n, checkpoint in enumerate(self.checkpoints) if n == 0 or checkpoint.day <= first)
        begin = self.checkpoints[place]
        raw = store.kept[store.kept.index >= begin.day]
        cleaned, marks, _ = bench.plausible.cleaned(raw)
        days, stages, corrected = _through_stages(bench.stages, begin, cleaned)
        memory = self.corrected[self.corrected.index < (raw.index[0] if len(raw) else first)]
        records = pd.concat([memory, corrected])
        told = self.judged[(self.judged.index >= begin.day) & (self.judged.index < first)]
        n_told = len(told)
        index = np.concatenate([told["index"].to_numpy(), bench.judge.index(records, len(memory) + n_told)])
        modes = told["modes"].tolist() + [""] * (len(raw) - n_told)
        log, numbers, checkpoints = begin.log, np.zeros(len(raw), dtype=np.intp), []
        is_alarm = np.zeros(len(raw), dtype=bool)
        bounds = raw.index.searchsorted(pd.DatetimeIndex([*days, days[-1] + pd.Timedelta(days=2)]))
        open_before = _open_after(log, index, stamps_of(raw))
        rows = np.flatnonzero(open_before & ~np.isnan(index))
        rows = rows[rows >= n_told]
        for row, names in zip(rows, bench.judge.drivers(records, rows + len(memory)), strict=True):
            modes[row] = names
        for day, state, start, stop in zip(days, stages, bounds[:-1], bounds[1:], strict=True):
            checkpoints.append(Checkpoint(day, state, log))
            if start == stop:
                continue
            by_kind, log = log.follow({"damage": index[start:stop]}, stamps_of(raw)[start:stop], modes[start:stop])
            numbers[start:stop] = by_kind["damage"]
            is_alarm[start:stop] = by_kind["damage"] > 0
        reasons = told["reason"].tolist() + _reasons(
            bench.judge, records, len(memory) + n_told, index[n_told:], marks[n_told:]
        )
        answers = _answers(raw.index, index, bench.threshold, modes, reasons, numbers, is_alarm)
        judged = pd.concat([self.judged[self.judged.index < begin.day], answers])
        horizon = store.last - store.late
        all_points = [*self.checkpoints[:place], *checkpoints]
        first_kept = max(n for n, checkpoint in enumerate(all_points) if n == 0 or checkpoint.day <= horizon)
        all_points = all_points[first_kept:]
        after = all_points[0].day
        times = stamps_of(records)
        start = bench.judge.memory.start(times, records.index.searchsorted(after), int(after.value))
        start = min(start, int(records.index.searchsorted(store.last - store.keep)))
        course = Course(
            records.iloc[start:],
            tuple(all_points),
            log,
            judged[judged.index >= store.last - store.keep],
            self._with_days(days, stages, bench, answers),
        )
        return course, self._news(answers[n_told:], fresh)

    def _news(self, answers: pd.DataFrame, fresh: pd.DataFrame) -> pd.DataFrame:
        """The answers to new records, and those to others that have changed."""
        before = self.judged.reindex(answers.index)
        same = [(answers[c] == before[c]) | (answers[c].isna() & before[c].isna()) for c in ANSWER]
        is_new = answers.index.isin(fresh.index)
        changed = ~np.all(same, axis=0) & ~is_new
        return answers.assign(revised=changed)[is_new | changed]

    def _with_days(
        self, days: Sequence[pd.Timestamp], stages: Sequence[StageState], bench: Bench, answers: pd.DataFrame
    ) -> pd.DataFrame:
        """Daily summaries with those of some days anew."""
        new = _days_of(answers)
        drifts = {day: bench.stages.drifts(state) for day, state in zip(days, stages, strict=True)}
        if any(drift is not None for drift in drifts.values()):
            shares = pd.DataFrame({day: drifts[day]["taken_out"] for day in new.index}).T
            new = new.join(shares.add_prefix("drift "))
        return pd.concat([self.days[self.days.index < days[0]], new]) if len(self.days) else new


def _through_stages(
    stages: Stages, begin: Checkpoint, records: pd.DataFrame
) -> tuple[list[pd.Timestamp], list[StageState], pd.DataFrame]:
    """Days from a checkpoint to the last record, the states of the stages before each, and the corrected records."""
    last = max(records.index[-1].normalize(), begin.day)
    days = list(pd.date_range(begin.day, last, freq="D"))
    bounds = [*records.index.searchsorted(pd.DatetimeIndex(days)), len(records)]
    state, states, corrected = begin.stages, [], []
    for n, (start, stop) in enumerate(pairwise(bounds)):
        day = records.iloc[start:stop]
        if n:
            state = stages.advance(state, records.iloc[bounds[n - 1] : start])
        states.append(state)
        corrected.append(stages.corrected(state, day))
    return days, states, pd.concat(corrected)


def _open_after(log: EventLog, index: Array, times: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether a damage event is open after each record."""
    return log.follow({"damage": index}, times, [""] * len(times))[0]["damage"] > 0


def _reasons(judge: Judge, records: pd.DataFrame, first: int, index: Array, marks: Sequence[str]) -> list[str]:
    """Why records from a position on are not judged, and what else is worth saying of them."""
    unknown = np.flatnonzero(np.isnan(index))
    causes = dict(zip(unknown.tolist(), judge.causes(records, unknown + first), strict=True))
    outside = judge.far_outside(records.iloc[first:])
    phrases = (
        [causes.get(n, ""), marks[n], "temperatures far outside those of the baseline" if outside[n] else ""]
        for n in range(len(index))
    )
    return ["; ".join(filter(None, parts)) for parts in phrases]


def nothing_judged(stamps: pd.DatetimeIndex, threshold: float = np.nan, reasons: Sequence[str] = ()) -> pd.DataFrame:
    """A row for each of some records that are not judged."""
    nothing, nobody = np.full(len(stamps), np.nan), np.zeros(len(stamps), dtype=np.int64)
    return _answers(stamps, nothing, threshold, [""] * len(stamps), reasons, nobody, nobody > 0)


def _answers(
    stamps: pd.DatetimeIndex, index: Array, threshold: float, modes: Any, reasons: Any, numbers: Any, is_alarm: Any
) -> pd.DataFrame:
    """A row for each record."""
    judged = ~np.isnan(index)
    state = np.where(judged, np.where(is_alarm, "alarm", "healthy"), "not judged")
    table = {
        "state": pd.Series(state.tolist(), stamps, dtype=object),
        "index": index,
        "threshold": np.full(len(index), threshold),
        "modes": pd.Series(
            np.where(judged & is_alarm, np.array(modes, dtype=object), "").tolist(), stamps, dtype=object
        ),
        "reason": pd.Series(reasons, stamps, dtype=object),
        "event": np.where(judged, numbers, 0),
    }
    return pd.DataFrame(table, stamps)


def _days_of(answers: pd.DataFrame) -> pd.DataFrame:
    """A row for each day that has records."""
    index, day = answers["index"], answers.index.normalize()
    groups = pd.DataFrame(
        {
            "n_records": np.ones(len(answers), dtype=np.int64),
            "n_judged": index.notna().to_numpy().astype(np.int64),
            "n_alarms": (answers["state"] == "alarm").to_numpy().astype(np.int64),
        },
        day,
    ).groupby(level=0)
    by_index = index.set_axis(day).groupby(level=0)
    table = groups.sum().assign(index_median=by_index.median(), index_max=by_index.max())
    return table.rename_axis("day")
