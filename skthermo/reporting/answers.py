"""What has changed and what to do, in sentences: the same on a page and in a terminal."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from skthermo._core.text import bare, day_text, listed, share_text, significant
from skthermo._core.warnings import collected

LONGEST = pd.Timedelta("30D")  # records of the state as it is now


def newest_since(table: pd.DataFrame, since: Any) -> pd.DataFrame:
    """Rows since a time, of the last 30 days at most."""
    return table[table.index >= max(pd.Timestamp(since), table.index[-1] - LONGEST)]


def _measured(monitor: Any) -> pd.DataFrame:
    """Records as they were measured, without the correction for slow drift, but for values that were left out."""
    seen = monitor.corrected_[monitor.features_]
    records = seen.copy()
    records[monitor.targets_] = monitor.records_.loc[seen.index, monitor.targets_]
    return records.where(seen.notna())


def shifts_of(monitor: Any, stamps: pd.DatetimeIndex) -> pd.Series:
    """How far each response is from that of the healthy structure in the same weather, in the median of some records.

    Relative, or in the unit of a response that may be zero; empty for a detector that has no residuals.
    """
    if not len(stamps) or not hasattr(monitor.detector_, "residuals"):
        return pd.Series(dtype=float)
    alone = getattr(monitor.detector_, "compensator_", None)  # residuals of records, not of a window
    residuals = monitor.detector_.residuals if alone is None else alone.transform
    records = _measured(monitor)
    seen_from = stamps[0] - 2 * LONGEST  # windows reach into these records
    with collected(drop_others=True):  # each record has its reason
        rest = residuals(records[records.index >= seen_from])
    return rest[rest.index.isin(stamps)].median()


def event_shifts(monitor: Any, event: Mapping[str, Any]) -> pd.Series:
    """How far each response has moved by the records that made an open event, as `shifts_of` has it.

    Of a drift, these are the last 30 days, as in its test, which begin before the event; of an alarm, the records above
    the threshold in the 30 days up to the last of them.
    """
    if event["kind"] == "drift":
        return monitor.means_[monitor.means_.index > monitor.last_ - LONGEST].mean()
    seen = monitor.evaluations_.loc[event["since"] :]
    is_own = (seen["index"] > seen["threshold"]) & seen["event"].isin([0, event["event"]])
    return shifts_of(monitor, newest_since(seen[is_own], event["since"]).index if is_own.any() else seen.index[:0])


def opened_since(monitor: Any) -> pd.Timestamp | None:
    """When the open damage or drift began; a drift has its records in the 30 days before it shows, too."""
    before = {"damage": pd.Timedelta(0), "drift": LONGEST}
    opened = [one for one in monitor.status().events if one["kind"] in before]
    return min((one["since"] - before[one["kind"]] for one in opened), default=None)


def identified_in(monitor: Any, since: Any) -> Any:
    """What explains the newest records since a time by the monitor's model, of the last 30 days at most."""
    from skthermo.studies import identify_damage  # jobs without an alarm need no studies

    records, targets = newest_since(_measured(monitor), since), monitor.targets_
    with collected(drop_others=True):
        return identify_damage(monitor.fem, records.drop(columns=targets), records[targets], random_state=0)


def change_text(shifts: Mapping[str, float], names: list[str], units: Mapping[str, str], is_relative: bool) -> str:
    """How far some responses have moved, such as "f1 is 2.1 %, f2 1.4 % lower"; "" where it is not known."""
    known = {name: shifts[name] for name in names if np.isfinite(shifts.get(name, np.nan))}
    ways = ["lower" if shift < 0 else "higher" for shift in known.values()]
    parts = []
    for place, (name, shift) in enumerate(known.items()):
        size = share_text(abs(shift)) if is_relative else f"{significant(abs(shift))} {units.get(name, '')}".strip()
        is_last = place == len(ways) - 1 or ways[place + 1] != ways[place]
        parts.append(f"{bare(name)}{'' if place else ' is'} {size}{f' {ways[place]}' if is_last else ''}")
    return listed(parts)


def event_sentences(monitor: Any, event: Mapping[str, Any], identified: Any = None) -> Iterator[str]:
    """What an event is, as `MonitorStatus.events` has it: since when, which modes by how much, which parts."""
    kind, since = event["kind"], event["since"]
    times = event.get("n_times", 1)
    begun = f"Event {event['event']} ({kind}) since {day_text(since)}"
    begun += f", {times} times in alarm" if times > 1 and kind == "damage" else ""
    has_grown = not event["acknowledged"] and monitor.events_.loc[event["event"], "acknowledged"]
    begun += ", which has grown since it was acknowledged" if has_grown else ""
    if kind == "fault":
        of = f" of {listed([bare(name) for name in event['modes']])}" if event["modes"] else ""
        yield f"{begun}: values{of} cannot be those of the structure as it was. A sensor or the structure has changed."
        return
    shifts = event_shifts(monitor, event).rename(str)
    moved = change_text(shifts, event["modes"], monitor.units_, monitor.smallest_changes_.is_relative)
    named = f"; most changed: {listed(event['modes'])}" if event["modes"] else ""
    yield f"{begun}: {moved} than in the healthy structure in the same weather." if moved else f"{begun}{named}."
    if identified is not None:
        yield identified.answer()[0]
    elif event["groups"]:
        size = event.get("size", np.nan)
        loss = f"A loss of stiffness{f' of about {share_text(size)}' if pd.notna(size) else ''}"
        yield f"{loss} in {', '.join(event['groups'])} explains most of it."


def regime_text(monitor: Any) -> str:
    """Where the detector divides records in two regimes; "" where it does not."""
    regime = getattr(monitor.detector_, "regime_", None)
    if regime is None:
        return ""
    name, highest = regime
    level = f"{highest:.4g} {monitor.units_.get(name, '')}".strip()
    return f"records up to {level} of {bare(name)!r} and above it are evaluated by detectors of their own"


def counted_reasons(reasons: pd.Series) -> dict[str, int]:
    """How many records have each reason, the most frequent first; all wrong values of a column are one reason."""
    without_values = reasons.str.replace(r" is -?(\d|inf)[^,:;]*(?=[^;]*: taken as missing)", "", regex=True)
    return without_values[reasons != ""].value_counts().to_dict()


def acknowledgement(event: int, settings: str | None) -> str:
    """How to say what an event was: the command or, without settings, the call."""
    if settings is None:
        return f'monitor.acknowledge({event}, harmless=False, note="what was found")'
    return f'skthermo acknowledge {shlex.quote(settings)} {event} --damage --note "what was found"'
