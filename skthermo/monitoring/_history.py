"""All that a monitor knows besides its detector: records, evaluations, events, and how late records are taken in."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from operator import attrgetter

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array
from skthermo._core.frames import midnight, midnights, midnights_between
from skthermo._core.saved_frames import SavesFrames
from skthermo.monitoring._active import ActiveDetector
from skthermo.monitoring._corrections import Corrected, Corrections, CorrectionState
from skthermo.monitoring._events import (
    DAMAGE,
    MEASUREMENT,
    WATCH,
    Acknowledgement,
    EventLog,
    EventRule,
    Shown,
    Transition,
    event_changes,
    event_table,
    leading,
)
from skthermo.monitoring._records import Intake, RecordStore
from skthermo.monitoring._threshold import FalseAlarmEstimate

ANSWER = ("state", "index", "threshold", "modes", "groups", "reason", "event")


@dataclass(frozen=True)
class Checkpoint(SavesFrames):
    """Where everything stood at the beginning of a day, before its first record."""

    day: pd.Timestamp
    corrections: CorrectionState
    log: EventLog


@dataclass(frozen=True)
class History(SavesFrames):
    """Records, evaluations by record and by day, checkpoints of the last days, and what the owner has said of events.

    ``corrected`` are the records as the detector sees them, those kept and the memory before the first checkpoint. It
    does not change: another one takes its place.
    """

    store: RecordStore
    corrected: pd.DataFrame
    checkpoints: tuple[Checkpoint, ...]
    log: EventLog
    evaluations: pd.DataFrame
    days: pd.DataFrame
    estimates: tuple[tuple[pd.Timestamp, FalseAlarmEstimate], ...]
    acknowledgements: tuple[Acknowledgement, ...] = ()
    n_repeated: int = 0
    n_late: int = 0
    n_too_late: int = 0
    transitions: tuple[Transition, ...] = ()
    before: History | None = None  # the latest jump of the stamps

    @classmethod
    def of(cls, active: ActiveDetector, store: RecordStore) -> History:
        """The state after the baseline, whose last records are the first memory."""
        times, end = store.baseline.index.asi8, store.last
        start = active.memory.start(times, len(times), int(times[-1]) + 1)
        nothing = not_evaluated(store.baseline.index[:0])
        checkpoint = Checkpoint(midnight(end), active.corrections.start(), EventLog())
        memory = active.corrections.cleaned(store.baseline.iloc[start:])[list(active.trained.columns)]
        days = _days_of(nothing, np.zeros(0, dtype=np.int64))
        return cls(store, memory, (checkpoint,), checkpoint.log, nothing, days, ((end, active.estimate),))

    @property
    def corrections(self) -> CorrectionState:
        return self.checkpoints[-1].corrections

    @property
    def event_table(self) -> pd.DataFrame:
        """Events as a frame, counted from 1, with what the owner has said of them."""
        return event_table(self.log.events, self.acknowledgements, self.store.last.tz)

    @property
    def acknowledged(self) -> list[int]:
        """Times (nanoseconds) at which what was set aside was said to be the fault of a sensor."""
        by_peak = {}
        for one in self.acknowledgements:
            if one.kind == MEASUREMENT:
                by_peak[one.peak_time] = one.time if one.harmless else None
        return list(filter(None, by_peak.values()))

    @property
    def has_set_aside(self) -> bool:
        """Whether an event of responses set aside is open that nobody has acknowledged as harmless."""
        opened = [one.start for one in self.log.events if one.kind == MEASUREMENT and one.end is None]
        return any(all(time < start for time in self.acknowledged) for start in opened)

    @property
    def state(self) -> str:
        """How the structure is by the newest record, as `MonitorStatus` has it."""
        if self.log.is_open(DAMAGE) or self.has_set_aside:
            return "alarm"
        if self.log.is_open(WATCH):
            return "watch"
        newest = self.evaluations["state"].iloc[-1] if len(self.evaluations) else "not evaluated"
        return "not evaluated" if newest == "alarm" else newest  # what was set aside has been acknowledged

    @property
    def counts(self) -> dict[str, int]:
        n_outside = self.n_too_late + len(self.store.ahead)
        n_records, n_evaluated, n_left_out = (
            int(self.days[name].sum()) for name in ("n_records", "n_evaluated", "n_left_out")
        )
        return {
            "n_records": n_records + n_outside,
            "n_repeated": self.n_repeated,
            "n_late": self.n_late,
            "n_too_late": self.n_too_late,
            "n_ahead": len(self.store.ahead),
            "n_not_evaluated": n_records - n_evaluated + n_outside,
            "n_left_out": n_left_out,
        }

    def taken_in(self, active: ActiveDetector, intake: Intake) -> tuple[History, pd.DataFrame]:
        """The state after a batch, and what it says of its records and of others that are evaluated anew."""
        state = replace(
            self,
            store=intake.store,
            n_repeated=self.n_repeated + intake.n_repeated,
            n_late=self.n_late + intake.n_late,
            n_too_late=self.n_too_late + len(intake.too_late),
        )
        answers = not_evaluated(intake.too_late.index[:0]).assign(revised=False)
        if len(intake.fresh):
            if self.store.jumps(intake.fresh.index):
                state = replace(state, before=replace(self, before=None, transitions=()))
            state, answers = state.advanced(active, intake.fresh.index)
        outside = pd.concat([intake.too_late, intake.ahead])
        if len(outside):
            refused = not_evaluated(outside.index, active.threshold, intake.reasons)
            answers = pd.concat([answers, refused.assign(revised=False)]).sort_index(kind="stable")
        return replace(state, store=intake.store.trimmed()).changed_from(self, active), answers

    def changed_from(self, before: History, active: ActiveDetector, *others: Transition) -> History:
        """This state with what has changed since another one, in order of time, and other changes first."""
        newest = self.store.last.as_unit("ns").value
        found = [*event_changes(before.log.events, self.log.events, newest)]
        watch = active.corrections.sensors
        if watch is not None:
            found += watch.changes(before.corrections.sensors, self.corrections.sensors, newest)
        found.sort(key=attrgetter("time"))
        return replace(self, transitions=(*before.transitions, *others, *found))

    def advanced(self, active: ActiveDetector, fresh: pd.DatetimeIndex) -> tuple[History, pd.DataFrame]:
        """The state after new records, which are in the store already, and what it says of these and of later ones.

        It goes on from the beginning of the day of the first new record, and evaluates all records from that one on.
        """
        first, rules, store = fresh[0], active.rules, self.store
        place = _last_before(self.checkpoints, first)
        begin = self.checkpoints[place]
        raw = store.kept.iloc[store.kept.index.searchsorted(begin.day) :]
        states, seen = self._corrected_by_day(active.corrections, begin, raw)
        memory = self.corrected.iloc[: self.corrected.index.searchsorted(raw.index[0])]
        records, n_memory = pd.concat([memory, seen.records]), len(memory)
        known = self.evaluations.iloc[slice(*self.evaluations.index.searchsorted(pd.DatetimeIndex([begin.day, first])))]
        new = n_memory + len(known)
        index = np.append(known["index"].to_numpy(), active.index(records, new))
        index, is_contested = _by_rivals(index, seen, active, records, n_memory)
        outside = active.extrapolated(records.iloc[n_memory:])
        is_blind = active.is_blind(records, n_memory, outside) & ~seen.is_held
        is_doubtful, times = seen.is_held | is_contested, raw.index.asi8
        # where a response was set aside the others cannot close an event, nor can records that thermometers leave open
        level = np.where(is_doubtful, np.maximum(index, np.nextafter(rules[DAMAGE].release, np.inf)), index)
        is_open = np.zeros(len(raw), dtype=bool)
        for kind in active.estimates:
            is_open |= rules[kind].follow(begin.log.state(kind), level, times)[0]
        modes, effects = active.explained(records, n_memory, np.flatnonzero(is_open & ~np.isnan(index)))
        series: dict[str, Shown] = dict.fromkeys(active.estimates, (level, modes, effects))
        series[MEASUREMENT] = seen.n_held, seen.held, [{}] * len(raw)
        log, numbers, points = _followed(rules, begin.log, states, series, raw.index)
        reasons = active.reasons(records, new, index[len(known) :], seen.notes[len(known) :], outside[len(known) :])
        reasons = known["reason"].tolist() + reasons
        before = self.evaluations.iloc[: self.evaluations.index.searchsorted(begin.day)]
        is_above = (index > active.threshold) & (numbers[DAMAGE] == 0)
        pending = _pending(is_above, is_doubtful | is_blind | np.isnan(index), [*before["state"].iloc[-1:]])
        remarks = {
            "above the threshold, not yet for long": pending,
            "thermometers contradict each other, and without one of them it would be in alarm": is_contested,
            f"even a fall of all responses by {100 * active.fall_to_detect:.2g} % would stay undetected": is_blind,
        }
        for text, rows in remarks.items():
            for row in np.flatnonzero(rows[len(known) :]) + len(known):
                reasons[row] = f"{reasons[row]}; {text}" if reasons[row] else text
        is_held = is_doubtful | is_blind | pending | self._unexplained(log, numbers[MEASUREMENT], times)
        shown = np.where((modes == "") & seen.is_held, seen.held, modes)
        answers = _answers(raw.index, index, active.threshold, shown, effects, reasons, numbers, is_held)
        points = [*self.checkpoints[:place], *points]
        state = replace(
            self,
            checkpoints=tuple(points[_last_before(points, store.last - store.max_delay) :]),
            log=log,
            evaluations=pd.concat([before, answers]),
            days=self._with_days(active.corrections, states, _days_of(answers, seen.n_left_out)),
        )
        return state._remembering(active, records), self._news(answers.iloc[len(known) :], fresh)

    def _remembering(self, active: ActiveDetector, records: pd.DataFrame) -> History:
        """The state with those of some corrected records that are kept, or that records to come need."""
        first, since = self.checkpoints[0].day, self.store.last - self.store.retention
        needed = active.memory.start(records.index.asi8, records.index.searchsorted(first), first.value)
        return replace(
            self,
            corrected=records.iloc[min(needed, records.index.searchsorted(since)) :],
            evaluations=self.evaluations.iloc[self.evaluations.index.searchsorted(since) :],
        )

    def without(
        self, active: ActiveDetector, start: pd.Timestamp, end: pd.Timestamp | None = None
    ) -> tuple[History, int]:
        """The state as if records from one stamp to another had never come, and the number of these.

        It is an error if how things stood before them is not known.
        """
        tables = {"kept": self.store.kept, "ahead": self.store.ahead}
        end = max((table.index[-1] for table in tables.values() if len(table)), default=start) if end is None else end
        rest = {name: table[(table.index < start) | (table.index > end)] for name, table in tables.items()}
        store, n_discarded = replace(self.store, **rest), sum(len(tables[name]) - len(rest[name]) for name in tables)
        if not n_discarded:
            raise ValueError(f"no record since the baseline is stamped {start} to {end}; expected some to be discarded")
        base, fresh = self._as_before(active, store, start)
        state = replace(
            base,
            estimates=self.estimates,
            acknowledgements=self.acknowledgements,
            n_repeated=self.n_repeated,
            n_late=self.n_late,
            n_too_late=self.n_too_late,
        )
        if len(fresh):
            state = state.advanced(active, fresh)[0]
        state = replace(state, store=state.store.trimmed())
        times = (one.as_unit("ns").value for one in (start, self.store.last))
        said = Transition("discarded", *times, "", detail=f"records: {n_discarded}")
        return state.changed_from(self, active, said), n_discarded

    def _as_before(
        self, active: ActiveDetector, store: RecordStore, start: pd.Timestamp
    ) -> tuple[History, pd.DatetimeIndex]:
        """A state that is not later than a stamp, with a store, and the stamps of records that follow it."""
        kept = store.kept.index
        places = [n for n, one in enumerate(self.checkpoints) if one.day <= start]
        if places:
            begin = self.checkpoints[places[-1]]
            tables = {name: getattr(self, name) for name in ("corrected", "evaluations", "days")}
            earlier = {name: table[table.index < begin.day] for name, table in tables.items()}
            state = replace(self, store=store, checkpoints=self.checkpoints[: places[-1] + 1], log=begin.log, **earlier)
            return state, kept[kept >= begin.day]
        if self.before is not None and self.before.store.last < start:
            known = self.before.store.kept
            new = store.kept[~kept.isin(known.index)]
            together = pd.concat([known, new]).sort_index()
            return replace(self.before, store=replace(store, kept=together)), new.index
        if len(self.days) and self.days.index[0] >= midnight(self.store.kept.index[0]):
            nothing = replace(store, kept=store.kept.iloc[:0])
            return replace(History.of(active, nothing), store=store), kept
        raise ValueError(
            f"records from {start} on cannot be discarded: how things stood then is known from "
            f"{self.checkpoints[0].day} on; expected a later start, or a monitor that was saved before"
        )

    def handed_over(self, active: ActiveDetector, end: int | None = None) -> History:
        """The state with another detector, which evaluates the records of the newest day anew.

        With an ``end``, events that are open have ended then, and sensors are watched from new.
        """
        points, log = self.checkpoints, self.log
        if end is not None:
            log, start = log.ended(end), active.corrections.start()
            points = tuple(replace(one, log=one.log.ended(end), corrections=start) for one in points)
        day = points[-1].day
        estimates = (*self.estimates, (self.store.last, active.estimate))
        kept = self.evaluations[self.evaluations.index < day]
        state = replace(self, checkpoints=points, log=log, evaluations=kept, estimates=estimates)
        today = self.store.kept.index[self.store.kept.index >= day]
        return state.advanced(active, today)[0] if len(today) else state

    def _corrected_by_day(
        self, corrections: Corrections, begin: Checkpoint, raw: pd.DataFrame
    ) -> tuple[dict[pd.Timestamp, CorrectionState], Corrected]:
        """States before each day from a checkpoint to the last record, and the records as the detector sees them."""
        days = list(midnights_between(begin.day, raw.index[-1]))
        bounds = [*raw.index.searchsorted(pd.DatetimeIndex(days)), len(raw)]
        parts = [raw.iloc[start:stop] for start, stop in pairwise(bounds)]
        states = [begin.corrections]
        for day in parts[:-1]:
            states.append(corrections.advance(states[-1], day))
        seen = [
            corrections.corrected(*pair, self.acknowledged) for pair in zip(states, parts, strict=True) if len(pair[1])
        ]
        return dict(zip(days, states, strict=True)), Corrected.joined(seen)

    def _unexplained(self, log: EventLog, numbers: NDArray[np.int64], times: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Records in an event of responses set aside that nobody had acknowledged as harmless before them."""
        unexplained = numbers > 0
        if len(self.acknowledged):
            starts = np.array([0, *(event.start for event in log.events)])[numbers]
            for time in self.acknowledged:
                unexplained &= ~((starts <= time) & (time < times))
        return unexplained

    def _news(self, answers: pd.DataFrame, fresh: pd.DatetimeIndex) -> pd.DataFrame:
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
        states: Mapping[pd.Timestamp, CorrectionState],
        new: pd.DataFrame,
    ) -> pd.DataFrame:
        """Daily summaries, those of some days anew."""
        if corrections.drift is not None:
            shares = pd.DataFrame({day: corrections.drift.taken_out(states[day].drift) for day in new.index}).T
            new = new.join(shares.add_prefix("drift "))
        before = self.days.iloc[: self.days.index.searchsorted(next(iter(states)))]
        return pd.concat([before, new]) if len(before) else new


def _followed(
    rules: dict[str, EventRule],
    log: EventLog,
    states: dict[pd.Timestamp, CorrectionState],
    series: dict[str, Shown],
    stamps: pd.DatetimeIndex,
) -> tuple[EventLog, dict[str, NDArray[np.int64]], list[Checkpoint]]:
    """The log after some days, numbers of the events at their records by kind, and checkpoints before each day."""
    bounds = [*stamps.searchsorted(pd.DatetimeIndex(list(states))), len(stamps)]
    numbers, points = dict(zip(series, np.zeros((len(series), len(stamps)), dtype=np.int64), strict=True)), []
    for (day, state), (start, stop) in zip(states.items(), pairwise(bounds), strict=True):
        points.append(Checkpoint(day, state, log))
        own = slice(start, stop)
        of_day = {kind: (level[own], modes[own], effects[own]) for kind, (level, modes, effects) in series.items()}
        found, log = log.follow(rules, of_day, stamps.asi8[own])
        for kind, number in found.items():
            numbers[kind][own] = number
    return log, numbers, points


def _by_rivals(
    index: Array, seen: Corrected, active: ActiveDetector, records: pd.DataFrame, first: int
) -> tuple[Array, NDArray[np.bool_]]:
    """Indices of the records from a position on, and which of them thermometers that contradict each other leave open.

    Each of these is left out in turn: the lowest index counts, and a record is open unless the highest is low, too.
    """
    index, is_contested = index.copy(), np.zeros(len(index), dtype=bool)
    for dispute in set(seen.disputes) - {None}:
        rows = np.array([one == dispute for one in seen.disputes])
        since = pd.Timestamp(dispute.since, tz="UTC").tz_convert(records.index.tz)
        each = []
        for columns in dispute.rivals:
            without = records.copy()
            without.loc[since:, [name for name in columns if name in records]] = np.nan
            each.append(active.index(without, first)[rows])
        index[rows], is_contested[rows] = np.fmin.reduce(each), ~(np.maximum.reduce(each) <= active.threshold)
    return index, is_contested & ~np.isnan(index)


def _pending(is_above: NDArray[np.bool_], is_unknown: NDArray[np.bool_], before: Sequence[str]) -> NDArray[np.bool_]:
    """Records above the threshold, but not for long enough for an alarm, just after some that were not evaluated.

    ``before`` is the state of the record before the first one, if there is one.
    """
    pending = np.zeros(len(is_above), dtype=bool)
    for row in np.flatnonzero(is_above & ~is_unknown):
        pending[row] = "not evaluated" in before if row == 0 else is_unknown[row - 1] or pending[row - 1]
    return pending


def _last_before(points: Sequence[Checkpoint], time: pd.Timestamp) -> int:
    """Position of the last checkpoint that is not after a time, or of the first one."""
    return max(bisect_right(points, time, key=attrgetter("day")) - 1, 0)


def not_evaluated(stamps: pd.DatetimeIndex, threshold: float = np.nan, reasons: Sequence[str] = ()) -> pd.DataFrame:
    """A row for each of some records that are not evaluated."""
    nothing, number = np.full(len(stamps), np.nan), np.zeros(len(stamps), dtype=np.int64)
    shown, is_held = ([""] * len(stamps), [{}] * len(stamps)), np.zeros(len(stamps), dtype=bool)
    return _answers(stamps, nothing, threshold, *shown, list(reasons), {DAMAGE: number}, is_held)


def _answers(
    stamps: pd.DatetimeIndex,
    index: Array,
    threshold: float,
    modes: Sequence[str],
    effects: Sequence[dict[str, float]],
    reasons: list[str],
    numbers: dict[str, NDArray[np.int64]],
    is_held: NDArray[np.bool_],
) -> pd.DataFrame:
    has_index, number = ~np.isnan(index), numbers[DAMAGE]
    has_changed = is_held & (numbers.get(MEASUREMENT, np.zeros(len(index))) > 0)
    is_alarm = (has_index & (number > 0)) | has_changed
    is_watch = has_index & ~is_alarm & (numbers.get(WATCH, np.zeros(len(index))) > 0)
    for kind in (MEASUREMENT, WATCH):
        number = np.where(number > 0, number, numbers.get(kind, 0))
    is_shown, groups = is_alarm | is_watch, [""] * len(index)
    for row in np.flatnonzero(is_shown):
        groups[row] = ", ".join(leading(effects[row]))
    quiet = np.where(has_index & ~is_held, "healthy", "not evaluated")
    state = np.where(is_alarm, "alarm", np.where(is_watch, "watch", quiet))
    table = {
        "state": pd.Series(state.tolist(), stamps, dtype=object),
        "index": index,
        "threshold": np.full(len(index), threshold),
        "modes": pd.Series(np.where(is_shown, modes, "").tolist(), stamps, dtype=object),
        "groups": pd.Series(groups, stamps, dtype=object),
        "reason": pd.Series(reasons, stamps, dtype=object),
        "event": np.where(has_index | is_held, number, 0),
    }
    return pd.DataFrame(table, stamps)


def _days_of(answers: pd.DataFrame, n_left_out: NDArray[np.int64]) -> pd.DataFrame:
    """A row for each calendar day that has records, from the evaluations of all of them in order of time.

    ``n_records``, of which ``n_evaluated`` and ``n_alarms``; ``n_left_out`` values; ``index_median`` and ``index_max``,
    NaN where there is none.
    """
    days = midnights(answers.index).rename("day")
    begins = np.flatnonzero(np.diff(days.asi8, prepend=days.asi8[:1] - 1))
    state, index = answers["state"].to_numpy(), answers["index"].to_numpy()
    counted = np.column_stack([np.ones(len(state)), state != "not evaluated", state == "alarm", n_left_out])
    totals, levels = np.zeros((len(begins), 4), dtype=np.int64), np.full((len(begins), 2), np.nan)
    if len(begins):
        totals = np.add.reduceat(counted.astype(np.int64), begins)
        for day, own in enumerate(np.split(index, begins[1:])):
            known = own[~np.isnan(own)]
            if len(known):
                levels[day] = np.median(known), known.max()
    table = pd.DataFrame(totals, days[begins], ["n_records", "n_evaluated", "n_alarms", "n_left_out"])
    return table.assign(index_median=levels[:, 0], index_max=levels[:, 1])
