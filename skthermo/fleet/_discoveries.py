"""Events that stand out among those of many bridges."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import false_discovery_control

from skthermo._estimators.arguments import check_size
from skthermo._tables.arrays import Array
from skthermo._tables.text import counted_number, percent, significant
from skthermo.monitoring import Monitor


@dataclass(frozen=True, repr=False)
class Discoveries:
    """Events of all bridges, of which those are called that stand out among all.

    Parameters
    ----------
    share : float
        Share of false ones among the bridges that are called, on average.
    table : DataFrame
        Damage events that are open or recent, and were not acknowledged as harmless: ``bridge``, ``event`` (its number
        in the monitor's ``events_``), ``start``, ``end``, ``peak``, ``modes``, ``p_value`` (`Monitor.event_p_values`),
        and ``is_discovery``.
    p_values : Series
        By bridge that was judged: that of its highest event, 1 without one.
    not_evaluated : list
        Names of bridges with a monitor that nothing is known of: they count neither as healthy nor as called.
    expected_false_per_year : float
        Bridges that would be called in a year, if all were healthy, by the level at which bridges are called now.
    promised_false_per_year : float
        What the monitors' own promises add up to.

    Notes
    -----
    Benjamini and Hochberg's procedure on the bridges' p values. It allows for the number of bridges, and keeps the
    share also where common weather moves them together; that p values are right in weather that no baseline has seen,
    it cannot promise.
    """

    share: float
    table: pd.DataFrame
    p_values: pd.Series
    not_evaluated: list[Hashable]
    expected_false_per_year: float
    promised_false_per_year: float

    @property
    def called(self) -> list[Hashable]:
        """Names of the bridges that are called, the least probable first."""
        return self.table.loc[self.table["is_discovery"]].sort_values("p_value")["bridge"].unique().tolist()

    @property
    def n_evaluated(self) -> int:
        """Number of bridges that were judged."""
        return len(self.p_values)

    def __repr__(self) -> str:
        return self.summary()

    def summary(self) -> str:
        """Which bridges are called, and how many false ones to expect.

        Returns
        -------
        str
            Plain sentences.
        """
        promised, left = (
            counted_number(float(significant(number, 2)), "false alarm")
            for number in (self.promised_false_per_year, self.expected_false_per_year)
        )
        names = ", ".join(map(str, self.called))
        lines = [
            f"{len(self.called)} of {self.n_evaluated} judged bridges stand out{f': {names}' if names else ''}.",
            f"Where p values hold, {percent(self.share)} of those called are false on average, and about {left} a year "
            f"over all bridges, where single monitors promise {promised}. Outliers and new weather make more.",
        ]
        if self.not_evaluated:
            lines.append(f"Not evaluated, and so not known to be healthy: {', '.join(map(str, self.not_evaluated))}.")
        return "\n".join(lines).replace("\N{NO-BREAK SPACE}", " ")


def discover(
    monitors: Mapping[Hashable, Monitor], standings: Mapping[Hashable, Mapping[str, Any]], share: float, days: float
) -> Discoveries:
    """Compare the events of all monitors that were open within so many days before the newest record of all."""
    share = check_size(share, "share", 0, 1, "a number between 0 and 1, such as 0.1")
    window = pd.Timedelta(days=check_size(days, "days", 0, np.inf, "a number of days, such as 365"))
    last = [without_zone(standing["last"]) for standing in standings.values() if not pd.isna(standing["last"])]
    begin = max(last, default=pd.NaT) - window
    tables, p_values, years, promised, not_evaluated = [], {}, {}, 0.0, []
    for name in monitors:
        try:
            monitor = monitors[name]
            promised += monitor.false_alarm_estimate_.expected
            table, n_years = _compared(monitor, begin)
        except Exception:  # damaged files raise errors of every type, and the table of errors tells them
            not_evaluated.append(name)
            continue
        is_blind = standings[name]["state"] == "not evaluated" or not n_years
        if (is_blind and not len(table)) or table["p_value"].isna().any():
            not_evaluated.append(name)
            continue
        p_values[name], years[name] = table["p_value"].min() if len(table) else 1.0, n_years
        table = table.reset_index()
        table.insert(0, "bridge", pd.Series([name] * len(table), dtype=object))
        tables.append(table)
    p = pd.Series(p_values, dtype=float)
    limit, level = _limits(p.to_numpy(), share)
    columns = ["bridge", "event", "start", "end", "peak", "modes", "p_value"]
    tables = [table for table in tables if len(table)]
    table = pd.concat(tables, ignore_index=True)[columns] if tables else pd.DataFrame(columns=columns)
    table["is_discovery"] = table["p_value"].astype(float) <= limit
    false = float((-np.log1p(-level) / np.array(list(years.values()), dtype=float)).sum()) if len(p) else 0.0
    return Discoveries(share, table, p, not_evaluated, false, promised)


def _limits(p_values: Array, share: float) -> tuple[float, float]:
    """The highest p value that is called, negative if none is, and the level at which p values are called."""
    n = len(p_values)
    if not n:
        return -1.0, 0.0
    called = p_values[false_discovery_control(p_values) <= share]
    return (float(called.max()) if len(called) else -1.0), share * max(len(called), 1) / n


def _compared(monitor: Monitor, begin: pd.Timestamp) -> tuple[pd.DataFrame, float]:
    """Events of a monitor with their p values, and the years that it has watched since then, or since the first."""
    if not len(monitor.days_) or pd.isna(begin):
        return monitor.events_.iloc[:0].assign(p_value=0.0), 0.0
    since = begin.tz_localize("UTC").tz_convert(monitor.last_.tz) if monitor.last_.tz else begin
    chances = monitor.event_p_values(since)
    table = monitor.events_.loc[chances.index].assign(p_value=chances)
    table = table[~table["harmless"].astype(bool)]
    return table, monitor.years_watched(min([since, *table.loc[table["end"].isna(), "start"]]))


def without_zone(stamp: pd.Timestamp) -> pd.Timestamp:
    """A stamp of UTC without a time zone, by which those of all bridges can be compared."""
    return stamp if stamp.tzinfo is None else stamp.tz_convert("UTC").tz_localize(None)
