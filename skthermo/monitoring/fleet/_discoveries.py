"""Events that are significant after correction for many bridges."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import false_discovery_control

from skthermo._core.arrays import Array, check_size
from skthermo._core.text import counted_number, listed, percent, significant
from skthermo.monitoring._monitor import Monitor
from skthermo.monitoring._threshold import times_exceeded

THREE_DAYS = 3 / 365.25  # of each peak of a baseline, in years


@dataclass(frozen=True, repr=False)
class Discoveries:
    """Events of all bridges, and which of those that are open are significant after correction for many bridges.

    Parameters
    ----------
    fdr : float
        False discovery rate: share of healthy ones among the bridges with a significant event, on average.
    table : DataFrame
        Damage events that are open or recent, and were not acknowledged as harmless: ``bridge``, ``event`` (its number
        in the monitor's ``events_``), ``start``, ``end``, ``peak``, ``modes``, ``p_value``, ``acknowledged``, and
        ``is_discovery``: it is open, and its bridge is significant.
    p_values : Series
        By bridge that was evaluated: that of its highest open event, 1 without one.
    level : float
        P value up to which bridges are significant.
    not_evaluated : list
        Names of bridges with a monitor of which nothing is known: they count neither as healthy nor as significant.
    false_discoveries_per_year : float
        Expected number of bridges with a significant event in a year at this level, if all are healthy.
    false_alarms_per_year : float
        Number for which all monitors together are set.

    Notes
    -----
    The p value of an event is the probability that a healthy bridge has so high a peak of its damage index in the time
    in which it was watched: from the rank of the peak among the highest indices of three days each of its baseline.
    The squares of higher ones are taken as exponential. Benjamini and Hochberg's procedure compares the bridges.

    References
    ----------
    Benjamini and Hochberg, *J. R. Stat. Soc. B* 57 (1995) 289-300.
    """

    fdr: float
    table: pd.DataFrame
    p_values: pd.Series
    level: float
    not_evaluated: list[Hashable]
    false_discoveries_per_year: float
    false_alarms_per_year: float

    @property
    def bridges(self) -> list[Hashable]:
        """Names of the bridges with a significant open event, the least probable first."""
        return self.table.loc[self.table["is_discovery"]].sort_values("p_value")["bridge"].unique().tolist()

    @property
    def unexplained(self) -> pd.DataFrame:
        """Events that have ended, would be significant, and were not acknowledged."""
        ended = self.table["end"].notna() & ~self.table["acknowledged"].astype(bool)
        return self.table[ended & (self.table["p_value"].astype(float) <= self.level)]

    @property
    def n_evaluated(self) -> int:
        """Number of bridges that were evaluated."""
        return len(self.p_values)

    def __repr__(self) -> str:
        return self.summary()

    def summary(self) -> str:
        """Which bridges are in alarm significantly, and how many false alarms and discoveries to expect.

        Returns
        -------
        str
            One sentence a line.
        """
        names, is_open = self.bridges, self.table["end"].isna()
        n_open = self.table.loc[is_open, "bridge"].nunique()
        alarms = counted_number(float(significant(self.false_alarms_per_year, 2)), "false alarm")
        false = significant(self.false_discoveries_per_year, 2)
        found = f"{len(names)} of them significantly after correction for many bridges{': ' if names else ''}"
        lines = [
            f"{n_open} of {self.n_evaluated} evaluated bridges are in alarm, {found}{listed(names)}."
            if n_open
            else f"None of the {self.n_evaluated} evaluated bridges is in alarm.",
            f"Expected if all bridges are healthy: {alarms} a year over all bridges, {false} of them significant.",
            f"False discovery rate: {percent(self.fdr)} of the significant bridges are healthy on average.",
        ]
        if self.not_evaluated:
            lines.append(f"Not evaluated, state not known: {listed(self.not_evaluated)}.")
        return "\n".join(lines).replace("\N{NO-BREAK SPACE}", " ")


def discover(
    monitors: Mapping[Hashable, Monitor], blind: set[Hashable], last: pd.Timestamp, fdr: float, days: float
) -> Discoveries:
    """Compare the events of all monitors that were open within so many days before the ``last`` record of all."""
    fdr = check_size(fdr, "fdr", 0, 1, "a number between 0 and 1, such as 0.1")
    most = 100_000
    begin = last - pd.Timedelta(days=check_size(days, "days", 0, most, f"a number of days up to {most}, such as 365"))
    tables, p_values, years, expected, not_evaluated = [], {}, {}, 0.0, []
    for name in monitors:
        try:
            monitor = monitors[name]
            expected += monitor.false_alarms_per_year
            table, n_years = _events_since(monitor, begin)
        except Exception:  # damaged files raise errors of every type, which are in the table of errors
            not_evaluated.append(name)
            continue
        if not len(table) and (name in blind or not n_years):
            not_evaluated.append(name)
            continue
        table = table.assign(p_value=[event_p_value(monitor, peak, n_years) for peak in table["peak"]])
        p_values[name], years[name] = table.loc[table["end"].isna(), "p_value"].min(), n_years
        tables += [table.reset_index().assign(bridge=name)] if len(table) else []
    p = pd.Series(p_values, dtype=float).fillna(1.0)
    is_significant, level = significant_bridges(p.to_numpy(), fdr)
    columns = ["bridge", "event", "start", "end", "peak", "modes", "p_value", "acknowledged"]
    table = pd.concat(tables, ignore_index=True)[columns] if tables else pd.DataFrame(columns=columns)
    table["is_discovery"] = table["end"].isna() & table["bridge"].isin(p.index[is_significant])
    false = float(np.sum(-np.log1p(-level) / np.array(list(years.values()))))
    return Discoveries(fdr, table, p, level, not_evaluated, false, expected)


def event_p_value(monitor: Monitor, peak: float, n_years: float) -> float:
    """Probability that a healthy bridge has so high a peak in so many years."""
    peaks = monitor.baseline_peaks_.to_numpy()
    per_year = times_exceeded(peaks, peak) / (len(peaks) * THREE_DAYS)
    return float(-np.expm1(-per_year * n_years))


def _events_since(monitor: Monitor, begin: pd.Timestamp) -> tuple[pd.DataFrame, float]:
    """Events that are open or have ended since a time, and years in which records were evaluated since their begin."""
    events = monitor.events_
    events = events[(events["kind"] == "damage") & ~events["harmless"].astype(bool)]
    if not len(monitor.days_) or pd.isna(begin):
        return events.iloc[:0], 0.0
    since = begin.tz_localize("UTC").tz_convert(monitor.last_.tz) if monitor.last_.tz else begin
    events = events[events["end"].isna() | (events["end"] >= since)]
    return events, monitor.years_watched(min([since, *events.loc[events["end"].isna(), "start"]]))


def significant_bridges(p_values: Array, fdr: float) -> tuple[Array, float]:
    """Which p values are significant at a false discovery rate, and the level up to which they are."""
    if not len(p_values):
        return np.zeros(0, dtype=bool), 0.0
    found = false_discovery_control(p_values) <= fdr
    return found, fdr * max(np.count_nonzero(found), 1) / len(p_values)


def without_zone(stamp: pd.Timestamp) -> pd.Timestamp:
    """A stamp of UTC without a time zone, by which those of all bridges can be compared."""
    return stamp if stamp.tzinfo is None else stamp.tz_convert("UTC").tz_localize(None)
