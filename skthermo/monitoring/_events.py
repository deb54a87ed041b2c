"""Events of a series of damage indices: their levels, how many are false, which changes they detect; their table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from numbers import Integral
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray
from scipy.stats import nbinom

from skthermo._core.arrays import Array
from skthermo._core.frames import DAY, YEAR
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.text import counted_number, duration_text, percent, plain
from skthermo.exceptions import FewRecordsWarning, RecordsWarning, ResultWarning, SkthermoWarning

DAMAGE, DRIFT, WATCH, FAULT = "damage", "drift", "watch", "fault"
"""Kinds of events, the gravest first: an alarm, a mean of 30 days that has moved, a raised index; sensors at fault."""
RANKED_KINDS = (DAMAGE, DRIFT, WATCH, FAULT)
STATES = ("alarm", "drift", "watch", "known damage")


Persistence: TypeAlias = int | Sequence[int]


def rule_of(persistence: Persistence) -> tuple[int, int]:
    """Number of records above a threshold by which an event opens, and among how many; 3 means 3 of 5."""
    is_pair = isinstance(persistence, tuple | list) and len(persistence) == 2
    numbers = persistence if is_pair else [persistence]
    are_integers = all(isinstance(one, Integral) and not isinstance(one, bool) for one in numbers)
    if not are_integers or not 1 <= numbers[0] <= numbers[-1]:
        raise ValueError(
            f"The 'persistence' parameter of Monitor is {persistence!r:.100}; expected an integer from 1 on, such as 3 "
            "(3 of 5 records), or two integers (number, among), such as (4, 6), with number from 1 to among"
        )
    return int(numbers[0]), int(numbers[1] if is_pair else 2 * numbers[0] - 1)


def levels(index: Array, persistence: Persistence) -> Array:
    """The ``number``-th largest index of the last ``among`` evaluated records; records before the first count as 0.

    It exceeds a threshold where ``number`` of these records do; NaN for records that are not evaluated.
    """
    number, among = rule_of(persistence)
    level, known = np.full(len(index), np.nan), ~np.isnan(index)
    if known.any():
        last = sliding_window_view(np.append(np.zeros(among - 1), index[known]), among)
        level[known] = np.partition(last, -number, axis=1)[:, -number]
    return level


def open_events(
    level: Array, times: NDArray[np.int64], threshold: ArrayLike, release: ArrayLike, hold: pd.Timedelta = DAY
) -> NDArray[np.bool_]:
    """Whether an event is open after each record, in order of time (nanoseconds).

    It opens with a level above the threshold, and closes when the levels of ``hold`` have stayed within ``release``.
    Records that are not evaluated (NaN) neither open nor close it.
    """
    known = np.flatnonzero(~np.isnan(level))
    value, at, order = level[known], times[known], np.arange(len(known))
    limits = (np.broadcast_to(limit, len(level))[known] for limit in (threshold, release))
    opens, is_quiet = (
        compare(value, limit) for compare, limit in zip((np.greater, np.less_equal), limits, strict=True)
    )
    begins = is_quiet & ~np.append(False, is_quiet[:-1])
    quiet_since = at[np.maximum.accumulate(np.where(begins, order, 0))]
    closes = is_quiet & (at - quiet_since >= hold.value)
    latest = np.maximum.accumulate(np.where(opens | closes, order, -1))
    is_open = np.append(False, (latest >= 0) & opens[latest])  # False before the first evaluated record
    return is_open[np.cumsum(~np.isnan(level))]


def runs(is_open: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First position of each event, and the position after its last one."""
    change = np.diff(np.r_[False, is_open, False].astype(np.int8))
    yield from zip(np.flatnonzero(change == 1).tolist(), np.flatnonzero(change == -1).tolist(), strict=True)


def followed(
    index: Array, times: NDArray[np.int64], limits: pd.DataFrame, persistence: Persistence, starts: ArrayLike = ()
) -> tuple[Array, list[tuple[int, int]]]:
    """Levels of a series of indices, and the first and the last position of each of its events.

    ``limits`` has the ``threshold`` and the ``release`` of each record. The series begins anew at ``starts``
    (nanoseconds), at which open events end.
    """
    level, found = np.full(len(index), np.nan), []
    for begin, stop in pairwise([0, *np.searchsorted(times, starts), len(index)]):
        own = slice(begin, stop)
        level[own] = levels(index[own], persistence)
        is_open = open_events(
            level[own], times[own], limits["threshold"].to_numpy()[own], limits["release"].to_numpy()[own]
        )
        found += [(begin + first, begin + last) for first, last in runs(is_open)]
    return level, found


def leading(sizes: Mapping[Any, float]) -> str:
    """Names of the largest sizes in standard deviations, the largest first: at most three, those after it above 2."""
    ordered = sorted(((name, size) for name, size in sizes.items() if size == size), key=lambda one: -one[1])[:3]
    return ", ".join(str(name) for place, (name, size) in enumerate(ordered) if place == 0 or size > 2)


def event_changes(before: pd.DataFrame, after: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Events that have opened, closed, opened again, or become of another kind, and those that are withdrawn, as late
    records or a fault may show that there was none."""
    left = before.copy()
    for number, event in after.iterrows():
        overlaps = ~(left["end"] <= event["sign"]) & ~(left["sign"] >= event["end"])
        near = left[overlaps].assign(other=left["kind"] != event["kind"], away=(left["sign"] - event["sign"]).abs())
        known = near.sort_values(["other", "away"]).index[0] if len(near) else 0
        old = left.loc[known] if known else None
        left = left.drop(index=known) if known else left
        is_open, about = pd.isna(event["end"]), {"kind": event["kind"], "event": int(number)}
        groups = f"; explained by a loss of stiffness of {event['groups']}" if event["groups"] else ""
        if old is None or (is_open and not pd.isna(old["end"])):
            what = "opened" if old is None else "reopened"
            yield {"what": what, "time": event["start"], "detail": event["modes"] + groups} | about
        elif old["kind"] != event["kind"]:
            detail = f"{event['kind']}, was {old['kind']}: {event['modes']}{groups}"
            yield {"what": "became", "time": event["start"], "detail": detail} | about
        if not is_open and (old is None or pd.isna(old["end"])):
            yield {"what": "closed", "time": event["end"], "detail": f"peak {event['peak']:.4g}"} | about
    for number, event in left.iterrows():
        about = {"kind": event["kind"], "event": int(number)}
        yield {"what": "withdrawn", "time": event["start"], "detail": "by later knowledge of its records"} | about


def alike(one: Array, other: Array, cosine: float = 0.7) -> bool:
    """Whether two departures have about the same direction."""
    length = np.linalg.norm(one) * np.linalg.norm(other)
    return bool(length > 0 and one @ other >= cosine * length)


def table_of(rows: Sequence[Any], types: Mapping[str, Any], index: Any = None) -> pd.DataFrame:
    """Rows as a table whose columns have some types, also without any."""
    return pd.DataFrame(rows, index, list(types), dtype=object).astype(types)


@dataclass(frozen=True, eq=False)
class Run:
    """Records in a row, ``first`` up to ``stop``, in which a level is open, and what departs in them.

    ``level`` is the level of each record, NaN where there is none, and ``modes`` are those at its highest one.
    ``departed`` are departures of the responses, effects and losses of damage groups, one after the other: sums over
    its records, or over ``n_weeks`` of means.
    """

    kind: str
    first: int
    stop: int
    level: Array
    modes: str
    departed: Array
    n_weeks: int = 0

    @property
    def n_alarms(self) -> int:
        """Number of its records that have a level."""
        return int((~np.isnan(self.level)).sum())


class Events:
    """All events of a table of decisions, in order of their first sign: one for each cause.

    A watch, a drift and an alarm are one event where they overlap or follow each other ``within`` some weeks, in the
    same direction; its kind is the gravest of them. What the owner has called harmless is over: a later alarm is
    another event. No event goes on beyond a new baseline. Values of sensors that have failed have events of their own.

    ``table`` has a row for each event, counted from 1; ``sign`` is its first sign. ``answered`` is the table with what
    the owner has said of each. ``runs`` are the runs of each event; ``reached`` says by how many records.
    """

    def __init__(
        self,
        decisions: pd.DataFrame,
        weeks: pd.DataFrame,
        said: pd.DataFrame,
        persistence: Persistence,
        starts: ArrayLike = (),
        within: pd.Timedelta = 28 * DAY,
    ):
        self.decisions, self.times, self.said = decisions, decisions.index.as_unit("ns").asi8, said
        number, among = rule_of(persistence)
        self.reached = f"reached by {number} of {among} records" if among > 1 else "of a record"
        self.persistence, self.starts, self.within = persistence, np.asarray(starts, dtype=np.int64), within
        departed = weeks.filter(regex="^(departure|effect|loss) ")
        self.groups = [name.removeprefix("effect ") for name in departed if name.startswith("effect ")]
        self.n_modes = departed.shape[1] - 2 * len(self.groups)
        causes: list[list[Run]] = []
        of_records = np.nan_to_num(decisions.reindex(columns=departed.columns).to_numpy(dtype=float))
        found = [*self._raised(of_records), *self._drifts(weeks, departed.to_numpy()), *self._faults()]
        for run in sorted(found, key=lambda run: (run.first, RANKED_KINDS.index(run.kind))):
            cause = next((one for one in reversed(causes) if self._is_same(one, run)), None)
            if cause is None:
                causes.append([run])
            else:
                cause.append(run)
        self.runs, stamp = dict(enumerate(causes, 1)), decisions.index.dtype
        types = {"kind": object, "start": stamp, "end": stamp, "peak": float, "peak_time": stamp}
        types |= {"modes": object, "groups": object, "size": float, "n_alarms": np.int64, "n_times": np.int64}
        index = pd.RangeIndex(1, len(causes) + 1, name="event")
        self.table = table_of([self._row(runs) for runs in causes], types | {"sign": stamp}, index)
        self.answered = with_acknowledgements(self.table, said)

    def _runs(
        self, kind: str, values: Array, limits: pd.DataFrame, persistence: Persistence, modes: Any, departed: Array
    ) -> Iterator[Run]:
        """Runs of a series of values on the stamps of their limits, by the modes and the departures of each."""
        level, spans = followed(values, limits.index.as_unit("ns").asi8, limits, persistence, self.starts)
        for first, stop in spans:
            own = level[first:stop]
            peak = first + int(np.nanargmax(own))
            yield Run(kind, first, stop, own, modes.iloc[peak], departed[first:stop].sum(axis=0))

    def _raised(self, departed: Array) -> Iterator[Run]:
        """Runs of alarms and watches."""
        index, is_held = self.decisions["index"].to_numpy(), self.decisions["n_held"].to_numpy() > 0
        above = np.nextafter(self.decisions["release"].to_numpy(), np.inf)
        shown = np.where(is_held & ~np.isnan(index), np.maximum(index, above), index)  # others cannot close an event
        for kind, names in {DAMAGE: ["threshold", "release"], WATCH: ["watch", "watch_release"]}.items():
            limits = self.decisions[names].set_axis(["threshold", "release"], axis=1)
            yield from self._runs(kind, shown, limits, self.persistence, self.decisions["modes"], departed)

    def _drifts(self, weeks: pd.DataFrame, departed: Array) -> Iterator[Run]:
        """Runs of weeks in which the mean of the last days has moved."""
        at, limits = weeks.index.as_unit("ns").asi8, pd.DataFrame({"threshold": 1.0, "release": 0.7}, weeks.index)
        ends = np.append(np.searchsorted(self.times, at), len(self.times))
        week = np.searchsorted(at, self.times, side="right") - 1
        for run in self._runs(DRIFT, weeks["level"].to_numpy(), limits, 1, weeks["modes"], departed):
            anew = self.times.searchsorted(self.starts[self.starts > at[run.first]]).min(initial=len(self.times))
            first, stop = int(ends[run.first]), int(min(ends[run.stop], anew))
            if first < stop:
                level = run.level[week[first:stop] - run.first]
                yield replace(run, first=first, stop=stop, level=level, n_weeks=run.stop - run.first)

    def _faults(self) -> Iterator[Run]:
        """Runs of responses that were set aside, and of alarms that rested on values of sensors at fault."""
        decisions, nothing = self.decisions, np.zeros((len(self.times), self.n_modes + 2 * len(self.groups)))
        limits = pd.DataFrame({"threshold": 0.5, "release": 0.5}, decisions.index)
        yield from self._runs(FAULT, decisions["n_held"].to_numpy(), limits, 3, decisions["held"], nothing)
        then, index = decisions["index_then"].to_numpy(), decisions["index"].to_numpy()
        differs = ~((then == index) | (np.isnan(then) & np.isnan(index)))
        if not differs.any():
            return
        _, real = followed(index, self.times, decisions, self.persistence, self.starts)
        for run in self._runs(FAULT, then, decisions, self.persistence, decisions["at_fault"], nothing):
            names = decisions["at_fault"][run.first : run.stop][differs[run.first : run.stop]]
            if (names != "").any() and not any(first < run.stop and run.first < stop for first, stop in real):
                yield replace(run, modes=names[names != ""].iloc[0])

    def _is_same(self, cause: list[Run], run: Run) -> bool:
        """Whether a run has the cause of earlier ones."""
        begin, last = self.times[run.first], max(one.stop for one in cause)
        end = self.times[last] if last < len(self.times) else np.inf
        if (run.kind == FAULT) != (cause[0].kind == FAULT) or begin - end > self.within.value:
            return False
        if ((self.starts > self.times[cause[0].first]) & (self.starts <= begin)).any():
            return False
        if run.kind == FAULT:
            return run.modes == cause[0].modes
        if any(one.kind != run.kind and DRIFT not in (one.kind, run.kind) and run.first < one.stop for one in cause):
            return True  # an alarm within a watch
        said = self.said[self.said["harmless"] & (self.said["at"] < begin)]
        if ((said["time"] >= self.times[cause[0].first]) & (said["time"] < end)).any():
            return False
        earlier = [one.departed[: self.n_modes] for one in cause]
        mean = sum(one / max(np.linalg.norm(one), 1e-300) for one in earlier)
        return alike(mean, run.departed[: self.n_modes])

    def _row(self, runs: list[Run]) -> tuple[Any, ...]:
        """What the table says of an event."""
        stamps, kind = self.decisions.index, min((run.kind for run in runs), key=RANKED_KINDS.index)
        own, stop = [run for run in runs if run.kind == kind], max(run.stop for run in runs)
        highest, n_alarms = max(own, key=lambda run: np.nanmax(run.level)), sum(run.n_alarms for run in own)
        mean = sum(run.departed for run in own) / sum(run.n_weeks or run.n_alarms for run in own)
        effects, losses = (dict(zip(self.groups, part, strict=True)) for part in np.split(mean[self.n_modes :], 2))
        groups = leading({name: effect for name, effect in effects.items() if effect > 2})
        size = losses[groups.split(", ")[0]] if groups else np.nan
        start, end = stamps[own[0].first], stamps[stop] if stop < len(stamps) else pd.NaT
        peak = float(np.nanmax(highest.level)), stamps[highest.first + int(np.nanargmax(highest.level))]
        return kind, start, end, *peak, highest.modes, groups, size, n_alarms, len(own), stamps[runs[0].first]

    def is_raised(self) -> NDArray[np.bool_]:
        """Which records are in an alarm or a watch."""
        found = np.zeros(len(self.times), dtype=bool)
        for run in (run for runs in self.runs.values() for run in runs if run.kind in (DAMAGE, WATCH)):
            found[run.first : run.stop] = True
        return found

    @cached_property
    def standing(self) -> pd.DataFrame:
        """How the structure stands at each record by its events, whether it is evaluated or not, and the ``event``.

        What the owner has answered of an event holds for later records up to one and a half times the level that it had
        reached; the level of a mean of 30 days goes on to rise for so long after a change. After damage that is known,
        nothing is healthy until a new baseline. A record ``is_set_aside`` in an event of responses that were, and
        ``is_unexplained`` until somebody has explained it.
        """
        ranks, numbers = np.full(len(self.times), len(STATES)), np.zeros(len(self.times), dtype=np.int64)
        is_unexplained, is_set_aside = np.zeros((2, len(self.times)), dtype=bool)
        n_held = self.decisions["n_held"].to_numpy()
        for number, runs in self.runs.items():
            event = self.answered.loc[number]
            for run in sorted(runs, key=lambda run: -RANKED_KINDS.index(run.kind)):
                rows = np.arange(run.first, run.stop)
                is_said = event["acknowledged"] & (self.times[rows] >= event["at"])
                if run.kind == FAULT:
                    numbers[rows[numbers[rows] == 0]] = number
                    if (n_held[rows] > 0).any():
                        is_set_aside[rows] = True
                        is_unexplained[rows] |= ~(is_said & event["harmless"])
                    continue
                until = event["at"] + 30 * DAY.value * (run.kind == DRIFT)
                of_kind = [one for one in runs if one.kind == run.kind]
                before = [one.level[self.times[one.first : one.stop] <= until] for one in of_kind]
                most = 1.5 * np.fmax.reduce(np.concatenate(before), initial=-np.inf)
                is_calm = is_said & ~(run.level > (most if most > 0 else np.inf))
                higher = rows[~is_calm & (RANKED_KINDS.index(run.kind) <= ranks[rows])]
                ranks[higher], numbers[higher] = RANKED_KINDS.index(run.kind), number
            if event["acknowledged"] and not event["harmless"] and event["kind"] in (DAMAGE, DRIFT):
                later = self.starts[self.starts > self.times[runs[0].first]]
                known = (self.times >= event["at"]) & (self.times < (later.min() if len(later) else np.inf))
                ranks[known] = np.minimum(ranks[known], STATES.index("known damage"))
        table = {"state": np.array([*STATES, "healthy"], dtype=object)[ranks], "event": numbers}
        table |= {"is_unexplained": is_unexplained, "is_set_aside": is_set_aside}
        return pd.DataFrame(table, self.decisions.index).astype({"state": object})

    @cached_property
    def evaluations(self) -> pd.DataFrame:
        """State, event and what drives it of each record."""
        decisions = self.decisions
        standing, number, is_unexplained, is_set_aside = (self.standing[name].to_numpy() for name in self.standing)
        index, n_held = decisions["index"].to_numpy(), decisions["n_held"].to_numpy()
        is_held, has_index = (n_held > 0) | decisions["is_blind"].to_numpy() | is_unexplained, ~np.isnan(index)
        is_raised = has_index & np.isin(standing, ["alarm", "drift", "watch"])
        state = np.where((has_index & ~is_held) | is_raised, standing, "not evaluated")
        state = np.where(is_held & is_set_aside, "alarm", state)
        is_shown, modes = np.isin(state, ["alarm", "drift", "watch"]), decisions["modes"].to_numpy()
        modes = np.where((modes == "") & (n_held > 0), decisions["held"].to_numpy(), modes)
        groups, effects = np.full(len(index), "", dtype=object), decisions.filter(regex="^effect ")
        names, sizes = [name.removeprefix("effect ") for name in effects], effects.to_numpy()
        for row in np.flatnonzero(is_shown):
            groups[row] = leading(dict(zip(names, sizes[row], strict=True)))
        is_drift = state == "drift"
        modes[is_drift], groups[is_drift] = self.table.loc[number[is_drift], ["modes", "groups"]].to_numpy().T
        table = {
            "state": state,
            "index": index,
            "threshold": decisions["threshold"].to_numpy(),
            "modes": np.where(is_shown, modes, ""),
            "groups": groups,
            "reason": decisions["reason"],
            "event": np.where(has_index | is_held, number, 0),
        }
        return pd.DataFrame(table, decisions.index).astype(dict.fromkeys(("state", "modes", "groups"), object))


def with_acknowledgements(events: pd.DataFrame, said: pd.DataFrame) -> pd.DataFrame:
    """Events with the owner's last answer to each, found by its kind and time, and ``at`` which record it was given."""
    answers = []
    for event in events.itertuples():
        end = np.inf if pd.isna(event.end) else event.end.value
        own = said[(said["kind"] == event.kind) & (said["time"] >= event.start.value) & (said["time"] < end)]
        answers.append((True, *own[["harmless", "note", "at"]].iloc[-1]) if len(own) else (False, False, "", 0))
    types = {"acknowledged": bool, "harmless": bool, "note": object, "at": np.int64}
    return events.join(table_of(answers, types, events.index))


def blocks_of(times: pd.DatetimeIndex, length: pd.Timedelta = 7 * DAY) -> NDArray[np.intp]:
    """Number of the block of each record, counted without gaps."""
    return np.unique((times - times[0]) // length, return_inverse=True)[1]


def level_exceeded(peaks: Array, times: float, n_highest: int = 16) -> float:
    """The level that a healthy structure exceeds so many times on average, in as long a time as the peaks come from.

    Peaks are in descending order, of times that are independent of each other. The k-th highest peak is exceeded k
    times. The highest one is exceeded once, and the squares beyond it are taken as exponential, like the k highest
    ones, x_1 to x_k, over the next one, b: the level with the square

        b + ((x_1 - b) + ... + (x_k - b)) (((k + 1) / times)^(1 / k) - 1)

    is exceeded so many times on average over baselines, however few peaks there are.
    """
    if times >= 1:
        return float(np.interp(times, np.arange(1, len(peaks) + 1), peaks))
    k, base, excesses = highest_squares(peaks, n_highest)
    return float(np.sqrt(base + excesses.sum() * (((k + 1) / times) ** (1 / k) - 1)))


def times_exceeded(peaks: Array, level: float, n_highest: int = 16) -> float:
    """How often a healthy structure exceeds a level on average, in as long a time as the peaks come from.

    The inverse of `level_exceeded`, at most once beyond the highest peak.
    """
    if level <= peaks[0]:
        return float(np.interp(-level, -peaks, np.arange(1, len(peaks) + 1)))
    k, base, excesses = highest_squares(peaks, n_highest)
    return float(min((k + 1) * (1 + (level**2 - base) / max(excesses.sum(), np.finfo(float).tiny)) ** -k, 1.0))


def highest_squares(peaks: Array, n_highest: int = 16) -> tuple[int, float, Array]:
    """Number of the highest peaks, the square of the next one, and by how much their squares exceed it."""
    k = min(n_highest, len(peaks) - 1)
    squares = peaks[: k + 1] ** 2
    return k, float(squares[k]), squares[:k] - squares[k]


@dataclass(frozen=True)
class FalseAlarmEstimate:
    """How many damage events a healthy structure is expected to have in a year, and by which baseline.

    ``expected`` is their number on average over baselines and years. In a single year there are ``lowest`` to
    ``highest`` of them with a probability of 90 %, by chance and because one baseline leaves the rate uncertain.
    ``n_years`` is the time that the baseline's evaluated records cover, ``missing_season`` the months without baseline
    records, for which there is no estimate ("" if there is none), ``method`` how the threshold was found, in words.
    """

    expected: float
    lowest: int
    highest: int
    n_years: float
    missing_season: str
    method: str

    def __str__(self) -> str:
        return (
            f"{counted_number(self.expected, 'false alarm')} a year on average, {self.lowest} to {self.highest} in a "
            f"single year with probability 90 %; {self.method}"
            + (f"; no estimate for {self.missing_season}" if self.missing_season else "")
        )


@dataclass(frozen=True)
class EventLevels:
    """Levels of the damage index at which events open and close, from the out-of-fold indices of a baseline.

    ``peaks`` are the highest levels of the times that begin above the level's 80 % quantile and end when it has been
    within it for a day, as many as there would be events at a lower threshold; of single days where they are fewer
    than six. They are independent of each other, and have their own times.
    """

    threshold: float
    release: float
    peaks: pd.Series
    estimate: FalseAlarmEstimate

    @classmethod
    def learned(cls, index: pd.Series, per_year: float, persistence: Persistence, share: float = 1.0) -> EventLevels:
        """The threshold that a healthy structure exceeds in a share of so many events a year; others have the rest.

        Three of the baseline's peaks are enough. Events close within the level that it stays within for 95 % of time.
        """
        known = index.dropna()
        infinite = known.index[np.isinf(known)]
        if len(known) < 2 or len(infinite):
            raise ValueError(
                f"{len(known)} baseline records have a damage index, {len(infinite)} of them an infinite one"
                f"{f' (the first at {infinite[0]})' if len(infinite) else ''}; expected at least 2, all of them finite"
            )
        stamps = known.index.as_unit("ns").asi8
        level = pd.Series(levels(known.to_numpy(), persistence), known.index)
        usual, release = level.quantile([0.8, 0.95])
        spans = runs(open_events(level.to_numpy(), stamps, usual, usual))
        highest = [level.iloc[first:stop].idxmax() for first, stop in spans]
        if len(highest) < 6:
            highest = level.groupby(blocks_of(known.index, DAY)).idxmax().tolist()
        peaks = level[highest].sort_values(ascending=False)
        if len(peaks) < 3 or not peaks.iloc[0] > 0:
            raise ValueError(
                f"the baseline has only {counted_number(len(peaks), 'peak')} of its damage index, one a "
                "day; expected at least 3, better two weeks of records or more"
            )
        steps = np.diff(stamps)
        n_years = float(np.minimum(steps, max(DAY.value, np.median(steps))).sum() / YEAR.value)
        asked = per_year * n_years
        threshold = level_exceeded(peaks.to_numpy(), share * asked)
        k = max(asked, 1.0)  # peaks above the threshold, by which its rate is known
        fewest, most = nbinom.ppf([0.05, 0.95], k, k / (k + per_year)).astype(int)
        months = sorted({*range(1, 13)} - {*known.index.month})
        missing = ", ".join(pd.Timestamp(2001, month, 1).month_name() for month in months)
        method = (
            f"set by the highest of {len(peaks)} rises of the damage index in {counted_number(n_years, 'year', 2)} of "
            "healthy baseline" + (", extrapolated" if asked < 0.4 else "")
        )
        estimate = FalseAlarmEstimate(per_year, int(fewest), int(most), n_years, missing, method)
        return cls(threshold, min(float(release), threshold), peaks, estimate)

    def findings(self, seen: SmallestChanges) -> Iterator[SkthermoWarning]:
        """What is doubtful: a threshold from too short a time, that hides damage, or that a single peak raises."""
        estimate, highest, second = self.estimate, *self.peaks.iloc[:2]
        asked = estimate.expected * estimate.n_years
        if estimate.missing_season or asked < 0.4:
            without = f" and has no record of {estimate.missing_season}" if estimate.missing_season else ""
            yield FewRecordsWarning(
                f"the baseline has {counted_number(estimate.n_years, 'year', 2)} of records{without}: {asked:.2g} "
                f"events are expected in it (0.4 tell the threshold {self.threshold:.3g}), and other seasons may "
                f"have more. Now {seen}. Refit with a whole year, or allow more alarms a year",
                "few-records",
            )
        if asked >= 0.4 and seen.is_relative and seen.common > 0.025:  # 5 % of the stiffness of the structure
            yield ResultWarning(
                f"the threshold {self.threshold:.3g} is so high that {seen} (expected an alarm at 2.5 % of all "
                "responses). Smaller changes count as healthy. Use a longer window or a closer regression, or allow "
                "more alarms a year",
                "undetected-changes",
            )
        k, _, excesses = highest_squares(self.peaks.to_numpy())
        by_chance = 1.0 - (0.01 / k) ** (1 / (k - 1))  # share of the largest of k exponential excesses (Cochran)
        if excesses[0] > by_chance * excesses.sum():
            text = (
                f"the highest peak of the baseline, {self.peaks.index[0]}, has a damage index of {highest:.3g}, the "
                f"next {second:.3g}: chance explains that in fewer than 1 % of baselines. It raises the threshold to "
                f"{self.threshold:.3g}, which may hide damage. Put NaN there if it is a fault or another state"
            )
            yield RecordsWarning(text, "doubtful-values")


def whole_weeks(records: pd.DataFrame, most: int) -> pd.DataFrame:
    """Whole weeks, evenly spread, of at most some number of records, or one week."""
    if len(records) <= most:
        return records
    blocks = blocks_of(records.index)
    n_blocks = blocks.max() + 1
    chosen = np.unique(np.linspace(0, n_blocks - 1, max(n_blocks * most // len(records), 1)).astype(int))
    return records[np.isin(blocks, chosen)]


def lowered(records: pd.DataFrame, falls: Mapping[Any, Any]) -> pd.DataFrame:
    """Records in which some responses are lower."""
    changed = records.copy()
    for name, fall in falls.items():
        changed[name] -= fall
    return changed


def crossing(steps: Array, ratios: Array) -> float:
    """The step at which a ratio exceeds 1; NaN if it does so without any.

    Squared indices grow with squared steps, nearly on straight lines.
    """
    squares = ratios**2
    above = np.flatnonzero(squares > 1)
    if len(above) and above[0] == 0:
        return np.nan
    after = above[0] if len(above) else len(steps) - 1
    slope = (squares[after] - squares[after - 1]) / (steps[after] ** 2 - steps[after - 1] ** 2)
    return float(np.sqrt(steps[after - 1] ** 2 + (1 - squares[after - 1]) / slope)) if slope > 0 else np.nan


@dataclass(frozen=True)
class SmallestChanges(SavesFrames):
    """Falls of responses that raise an alarm: enough of the records are above a threshold, ``within`` a time.

    ``common`` is the fall of all responses by one share, NaN where some are not positive throughout; ``single`` of
    each alone, a share where ``is_relative``, else in its unit. ``groups`` are losses of stiffness of damage groups, of
    a detector that has their directions. NaN where no fall or loss is seen.
    """

    common: float
    single: dict[Any, float]
    is_relative: bool
    within: pd.Timedelta
    groups: dict[str, float] = field(default_factory=dict)

    @classmethod
    def measured(
        cls,
        index_of: Callable[[pd.DataFrame], Array],
        records: pd.DataFrame,
        names: Sequence[Any],
        threshold: float,
        within: pd.Timedelta,
        share_above: float,
        groups: pd.DataFrame | None = None,
        steps: Sequence[float] = (0.0, 0.5, 2.0, 5.0),
    ) -> SmallestChanges:
        """Falls by which a share of the indices, ``index_of`` records in order of time, is above a threshold.

        ``groups`` are relative changes of the responses, in their order, by a whole loss of each damage group, which
        moves a record by its ``"sensitivity"`` in standard deviations. ``steps`` are in these, too.
        """
        some = whole_weeks(records, 1000)
        responses = some[list(names)]
        deviations = records[list(names)].std(ddof=0).replace(0.0, 1.0)
        is_relative = bool((records[list(names)].min() > 0).all())
        shares = deviations / (responses.mean() if is_relative else 1.0)
        changes = {("single", name): (shares[name], {name: deviations[name]}) for name in names}
        if is_relative:
            share = float(np.median(shares))
            changes["common", ""] = share, {name: share * responses[name] for name in names}
        for group, row in () if groups is None else groups[groups["sensitivity"] > 0].iterrows():
            falls = -row.iloc[: len(names)].to_numpy(dtype=float) / row["sensitivity"] * responses
            changes["groups", group] = float(1 / row["sensitivity"]), {name: falls[name] for name in names}
        start, found = index_of(some), {"single": {}, "common": {}, "groups": {}}
        for (kind, name), (size, falls) in changes.items():
            by_step = ({one: step * fall for one, fall in falls.items()} for step in steps[1:])
            indices = np.array([start, *(index_of(lowered(some, one)) for one in by_step)])
            known = indices[:, ~np.isnan(indices).any(axis=0)]
            reached = np.quantile(known, 1 - share_above, axis=1) if known.size else np.zeros(len(steps))
            fall = crossing(size * np.array(steps), reached / threshold)
            found[kind][name] = fall if fall < 1 or not (is_relative or kind == "groups") else np.nan
        return cls(found["common"].get("", np.nan), found["single"], is_relative, within, found["groups"])

    def as_dict(self) -> dict[str, Any]:
        """Plain values: NaN is None, ``within`` in seconds."""
        facts = {name: getattr(self, name) for name in ("common", "single", "groups", "within")}
        return plain(facts)

    def __str__(self) -> str:
        parts = [f"a fall of all responses by {percent(self.common, '.2g')}"] if np.isfinite(self.common) else []
        if single := _range_text(self.single, "{:.2g} %" if self.is_relative else "{:.2g}"):
            parts.append(f"{'of' if parts else 'a fall of'} one response alone {single}")
        if groups := _range_text(self.groups, "{:.2g} %"):
            parts.append(f"a loss of stiffness {groups}")
        if not parts:
            return "no fall of the responses raises an alarm"
        text = f"{', or '.join(parts)} raises an alarm within {duration_text(self.within)} in half of the cases"
        return text.replace("\N{NO-BREAK SPACE}", " ")


def _range_text(changes: Mapping[Any, float], form: str) -> str:
    """The smallest and the largest of some changes, with their names; "" where none is seen.

    Changes that are no percentages may have several units: all of them.
    """
    seen = {name: value for name, value in changes.items() if np.isfinite(value)}
    if not seen:
        return ""
    if "%" not in form:
        return "by " + ", ".join(f"{form.format(size)} ({name})" for name, size in seen.items())
    ends = dict.fromkeys((min(seen, key=seen.__getitem__), max(seen, key=seen.__getitem__)))
    return "by " + " to ".join(f"{form.format(100 * seen[name])} ({name})" for name in ends)
