"""Events of a series of damage indices: when they open and close, and what changes from one table to another."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import Array
from skthermo._core.frames import DAY

DAMAGE, MEASUREMENT, WATCH = "damage", "measurement or structure", "watch"
"""Kinds of events; the second is that of responses set aside as implausible or stuck, the last of a raised index."""


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
            MEASUREMENT: pd.DataFrame({"threshold": 0.5, "release": 0.5}, decisions.index),
        }
        # where a response was set aside the others cannot close an event
        is_held, held = decisions["n_held"].to_numpy() > 0, decisions["n_held"].to_numpy()
        above = np.nextafter(decisions["release"].to_numpy(), np.inf)
        shown = np.where(is_held & ~np.isnan(index), np.maximum(index, above), index)
        effects = decisions.filter(regex="^effect ")
        rows, spans = [], []
        for kind, limit in limits.items():
            if limit["threshold"].isna().all() or (kind == MEASUREMENT and not is_held.any()):
                continue
            of_kind = (held, 3) if kind == MEASUREMENT else (shown, persistence)
            level, found = followed(of_kind[0], times, limit, of_kind[1], starts)
            modes = decisions["held" if kind == MEASUREMENT else "modes"]
            for first, stop in found:
                peak = first + int(np.nanargmax(level[first:stop]))
                n_alarms = int((~np.isnan(level[first:stop])).sum())
                means = effects[first:stop].sum() / n_alarms
                groups = "" if kind == MEASUREMENT else leading(means[means > 2].rename(lambda name: name[7:]))
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
    damage, measurement, watch = (events.numbers[kind] for kind in (DAMAGE, MEASUREMENT, WATCH))
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
