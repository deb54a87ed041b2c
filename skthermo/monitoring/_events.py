"""Events of a series of damage indices: their levels, how many are false, which changes they detect; their table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray
from scipy.stats import nbinom

from skthermo._core.arrays import Array
from skthermo._core.frames import DAY, YEAR
from skthermo._core.text import counted_number, duration_text, percent, plain
from skthermo.exceptions import FewRecordsWarning, RecordsWarning, ResultWarning, SkthermoWarning

DAMAGE, DRIFT, WATCH, FAULT = "damage", "drift", "watch", "fault"
"""Kinds of events: an alarm, a mean of 30 days that has moved, a raised index, and values of sensors at fault."""


def levels(index: Array, persistence: int) -> Array:
    """The median index of the last ``2 persistence - 1`` evaluated records; records before the first count as 0.

    It exceeds a threshold where ``persistence`` of these records do; NaN for records that are not evaluated.
    """
    level, known, n = np.full(len(index), np.nan), ~np.isnan(index), 2 * (persistence - 1)
    if known.any():
        level[known] = np.median(sliding_window_view(np.append(np.zeros(n), index[known]), n + 1), axis=1)
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
    index: Array, times: NDArray[np.int64], limits: pd.DataFrame, persistence: int, starts: ArrayLike = ()
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


def leading(sizes: pd.Series | dict[str, float]) -> str:
    """Names of the largest sizes in standard deviations, the largest first: at most three, those after it above 2."""
    ordered = pd.Series(sizes, dtype=float).sort_values(ascending=False, kind="stable")[:3]
    return ", ".join(map(str, ordered.index[(np.arange(len(ordered)) == 0) | (ordered > 2)]))


def event_changes(before: pd.DataFrame, after: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Events that have opened, closed, or been withdrawn, as late records may show that there was none."""
    left = before.copy()
    for number, event in after.iterrows():
        overlaps = (left["kind"] == event["kind"]) & ~(left["end"] <= event["start"]) & ~(left["start"] >= event["end"])
        known = (left["start"][overlaps] - event["start"]).abs().idxmin() if overlaps.any() else 0
        was_open = known and pd.isna(left.loc[known, "end"])
        left = left.drop(index=known) if known else left
        is_open = pd.isna(event["end"])
        about = {"kind": event["kind"], "event": int(number)}
        if not known or (is_open and not was_open):
            groups = f"; explained by a loss of stiffness of {event['groups']}" if event["groups"] else ""
            yield {"what": "opened", "time": event["start"], "detail": event["modes"] + groups} | about
        if not is_open and (not known or was_open):
            yield {"what": "closed", "time": event["end"], "detail": f"peak {event['peak']:.4g}"} | about
    for number, event in left.iterrows():
        about = {"kind": event["kind"], "event": int(number)}
        yield {"what": "withdrawn", "time": event["start"], "detail": "by records that came late"} | about


class Events:
    """All events of a table of decisions, in order of their start, and which of them each record is in.

    ``table`` has a row for each event, counted from 1; ``numbers`` gives for each kind the event of every record, 0 for
    none.
    """

    def __init__(self, decisions: pd.DataFrame, persistence: int, starts: ArrayLike = ()):
        times, index = decisions.index.asi8, decisions["index"].to_numpy()
        limits = {
            DAMAGE: decisions[["threshold", "release"]],
            WATCH: decisions[["watch", "watch_release"]].set_axis(["threshold", "release"], axis=1),
            FAULT: pd.DataFrame({"threshold": 0.5, "release": 0.5}, decisions.index),
        }
        # where a response was set aside the others cannot close an event
        is_held, held = decisions["n_held"].to_numpy() > 0, decisions["n_held"].to_numpy()
        above = np.nextafter(decisions["release"].to_numpy(), np.inf)
        shown = np.where(is_held & ~np.isnan(index), np.maximum(index, above), index)
        effects = decisions.filter(regex="^effect ")
        rows, spans = [], []
        for kind, limit in limits.items():
            if limit["threshold"].isna().all() or (kind == FAULT and not is_held.any()):
                continue
            of_kind = (held, 3) if kind == FAULT else (shown, persistence)
            level, found = followed(of_kind[0], times, limit, of_kind[1], starts)
            modes = decisions["held" if kind == FAULT else "modes"]
            for first, stop in found:
                peak = first + int(np.nanargmax(level[first:stop]))
                n_alarms = int((~np.isnan(level[first:stop])).sum())
                means = effects[first:stop].sum() / n_alarms
                groups = "" if kind == FAULT else leading(means[means > 2].rename(lambda name: name[7:]))
                size = decisions[f"loss {groups.split(', ')[0]}"][first:stop].sum() / n_alarms if groups else np.nan
                end = decisions.index[stop] if stop < len(times) else pd.NaT
                stamps = decisions.index[first], end, level[peak], decisions.index[peak]
                rows.append((kind, *stamps, modes.iloc[peak], groups, size, n_alarms))
                spans.append((first, stop))
        order = sorted(range(len(rows)), key=lambda n: (spans[n][0], rows[n][0]))
        self.numbers = {kind: np.zeros(len(times), dtype=np.int64) for kind in limits}
        for number, n in enumerate(order, 1):
            self.numbers[rows[n][0]][slice(*spans[n])] = number
        stamp = decisions.index.dtype
        dtypes = {"kind": object, "start": stamp, "end": stamp, "peak": float, "peak_time": stamp}
        dtypes |= {"modes": object, "groups": object, "size": float, "n_alarms": np.int64}
        columns = zip(*(rows[n] for n in order), strict=True) if rows else [()] * len(dtypes)
        series = zip(dtypes, map(list, columns), dtypes.values(), strict=True)
        table = pd.DataFrame({name: pd.Series(values, dtype=dtype) for name, values, dtype in series})
        self.table = table.set_axis(pd.RangeIndex(1, len(rows) + 1, name="event"))


def with_acknowledgements(events: pd.DataFrame, said: pd.DataFrame) -> pd.DataFrame:
    """Events with the owner's last answer to each, found by its kind and time."""
    answers = []
    for event in events.itertuples():
        end = np.inf if pd.isna(event.end) else event.end.value
        own = said[(said["kind"] == event.kind) & (said["time"] >= event.start.value) & (said["time"] < end)]
        answers.append((True, *own[["harmless", "note"]].iloc[-1]) if len(own) else (False, False, ""))
    table = pd.DataFrame(answers, events.index, ["acknowledged", "harmless", "note"])
    return events.join(table.astype({"acknowledged": bool, "harmless": bool, "note": object}))


def evaluations(decisions: pd.DataFrame, events: Events, said: pd.DataFrame) -> pd.DataFrame:
    """State, event and what drives it of each record."""
    index, n_held = decisions["index"].to_numpy(), decisions["n_held"].to_numpy()
    damage, measurement, watch = (events.numbers[kind] for kind in (DAMAGE, FAULT, WATCH))
    is_unexplained = measurement > 0
    for event in with_acknowledgements(events.table, said).query("harmless").itertuples():
        own = said[(said["kind"] == event.kind) & (said["time"] >= event.start.value)]
        is_unexplained &= ~((measurement == event.Index) & (decisions.index.asi8 > own["at"].iloc[0]))
    is_held = (n_held > 0) | decisions["is_blind"].to_numpy() | is_unexplained
    has_index = ~np.isnan(index)
    is_alarm = (has_index & (damage > 0)) | (is_held & (measurement > 0))
    is_watch = has_index & ~is_alarm & (watch > 0)
    quiet = np.where(has_index & ~is_held, "healthy", "not evaluated")
    state = np.where(is_alarm, "alarm", np.where(is_watch, "watch", quiet))
    number = np.where(damage > 0, damage, np.where(measurement > 0, measurement, watch))
    is_shown, modes = is_alarm | is_watch, decisions["modes"].to_numpy()
    modes = np.where((modes == "") & (n_held > 0), decisions["held"].to_numpy(), modes)
    groups, effects = np.full(len(index), "", dtype=object), decisions.filter(regex="^effect ")
    for row in np.flatnonzero(is_shown) if len(effects.columns) else ():
        groups[row] = leading(effects.iloc[row].dropna().rename(lambda name: name[7:]))
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


def blocks_of(times: pd.DatetimeIndex, length: pd.Timedelta = 7 * DAY) -> NDArray[np.intp]:
    """Number of the block of each record, counted without gaps."""
    return np.unique((times - times[0]) // length, return_inverse=True)[1]


def level_exceeded(peaks: Array, times: float, n_highest: int = 16) -> float:
    """The level that a healthy structure exceeds so many times, in as long a time as that of the peaks, on average.

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
    """How often a healthy structure exceeds a level, in as long a time as that of the peaks, on average.

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
    def learned(cls, index: pd.Series, per_year: float, persistence: int) -> EventLevels:
        """The threshold that a healthy structure exceeds in so many events a year.

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
        threshold = level_exceeded(peaks.to_numpy(), asked)
        k = max(asked, 1.0)  # peaks above the threshold, by which its rate is known
        fewest, most = nbinom.ppf([0.05, 0.95], k, k / (k + per_year)).astype(int)
        months = sorted({*range(1, 13)} - {*known.index.month})
        missing = ", ".join(pd.Timestamp(2001, month, 1).month_name() for month in months)
        method = (
            f"from {counted_number(len(peaks), 'peak')} of the damage index in {counted_number(n_years, 'year', 2)} of "
            "baseline" + (", extrapolated" if asked < 0.4 else "")
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
class SmallestChanges:
    """Falls of responses that a threshold sees: half of the records are above it, and an alarm follows ``within`` days.

    ``common`` is that of all responses by one share, NaN where some are not positive throughout; ``single`` that of
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
        losses: pd.DataFrame | None = None,
        steps: Sequence[float] = (0.0, 0.5, 2.0, 5.0),
    ) -> SmallestChanges:
        """Falls by which the median of the indices, ``index_of`` records in order of time, exceeds a threshold.

        ``losses`` are relative changes of the responses, in their order, by the loss of each damage group that moves a
        record by one standard deviation; their column ``"loss"`` is that loss. ``steps`` are in standard deviations.
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
        for group, row in (pd.DataFrame() if losses is None else losses).iterrows():
            falls = -row.drop("loss").to_numpy() * responses
            changes["groups", group] = float(row["loss"]), {name: falls[name] for name in names}
        start, found = index_of(some), {"single": {}, "common": {}, "groups": {}}
        for (kind, name), (size, falls) in changes.items():
            by_step = ({one: step * fall for one, fall in falls.items()} for step in steps[1:])
            indices = np.array([start, *(index_of(lowered(some, one)) for one in by_step)])
            known = indices[:, ~np.isnan(indices).any(axis=0)]
            fall = crossing(size * np.array(steps), np.median(known, axis=1) / threshold) if known.size else np.nan
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
        text = f"{', or '.join(parts)} raises an alarm within {duration_text(self.within)}"
        return text.replace("\N{NO-BREAK SPACE}", " ")


def _range_text(changes: Mapping[Any, float], form: str) -> str:
    """The smallest and the largest of some changes, with their names; "" where none is seen."""
    seen = {name: value for name, value in changes.items() if np.isfinite(value)}
    if not seen:
        return ""
    ends = dict.fromkeys((min(seen, key=seen.__getitem__), max(seen, key=seen.__getitem__)))
    factor = 100 if "%" in form else 1
    return "by " + " to ".join(f"{form.format(factor * seen[name])} ({name})" for name in ends)
