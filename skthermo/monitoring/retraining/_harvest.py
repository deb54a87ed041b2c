"""Which records of the time in service may join the baseline."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from skthermo.monitoring._memory import Memory

MARGIN = pd.Timedelta("7D")  # before the first alarm of an event, in which a change may have begun unseen


@dataclass(frozen=True)
class Harvest:
    """Records that may train, and a table of what was left out and why.

    ``excluded`` has a row for each reason: ``start``, ``end`` (NaT: until the last record), ``columns`` (all, or the
    one whose values alone are left out), ``n_records`` and ``reason``.
    """

    records: pd.DataFrame
    excluded: pd.DataFrame

    @classmethod
    def of(
        cls,
        records: pd.DataFrame,
        events: pd.DataFrame,
        faults: pd.DataFrame | None,
        margin: pd.Timedelta = MARGIN,
        are_put_back: bool = False,
    ) -> Harvest:
        """Leave out events that were not acknowledged as harmless, and values of faulty sensors.

        Modes that were swapped for a time stand in their place already with ``are_put_back``.
        """
        kept, rows = np.ones(len(records), dtype=bool), []
        for start, end, reason in _spans(events, margin):
            inside = (records.index >= start) & (pd.isna(end) | (records.index <= end))
            kept &= ~inside
            rows.append((start, end, "all", int(inside.sum()), reason))
        masked = records.copy()
        told = faults if faults is not None else pd.DataFrame()
        for fault in told.itertuples():
            if fault.kind == "disagree" or (are_put_back and fault.kind == "swapped"):  # nothing is left out
                continue
            inside = (records.index >= fault.since) & (pd.isna(fault.until) | (records.index < fault.until))
            masked.loc[inside, fault.column] = np.nan
            rows.append((fault.since, fault.until, fault.column, int((inside & kept).sum()), f"sensor: {fault.kind}"))
        empty = kept & masked.isna().all(axis=1).to_numpy()
        if empty.any():
            rows.append((masked.index[empty][0], masked.index[empty][-1], "all", int(empty.sum()), "without a value"))
        excluded = pd.DataFrame(rows, columns=["start", "end", "columns", "n_records", "reason"])
        return cls(masked[kept & ~empty], excluded[excluded["n_records"] > 0].reset_index(drop=True))


def _spans(events: pd.DataFrame, margin: pd.Timedelta) -> Iterator[tuple[Any, Any, str]]:
    """Start, end and reason of each time that may not train."""
    for number, event in zip(events.index, events.itertuples(), strict=True):
        if event.harmless:
            continue
        is_open = pd.isna(event.end)
        state = "acknowledged, but not as harmless" if event.acknowledged else "not acknowledged"
        still = ", and still open: nothing after its start may train" if is_open else ""
        yield event.start - margin, event.end, f"event {number} ({event.kind}), {state}{still}"


def margin_of(memory: Memory, records: pd.DataFrame) -> pd.Timedelta:
    """How long before an event's first alarm records do not train: a week, or as long as the detector looks back."""
    return max(MARGIN, memory.duration(pd.Series(records.index).diff().median()))
