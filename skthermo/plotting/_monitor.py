"""A detector in service: damage indices, events, drift and sensors over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
import pandas as pd

from skthermo._core.arrays import Array
from skthermo._core.frames import days_later, midnight, midnights_between
from skthermo.plotting._display import (
    AMBER,
    BLACK,
    BLUE,
    GREY,
    LIGHT,
    ORANGE,
    Display,
    date_axis,
    hold_outliers,
    in_time,
    line_style,
    mark_not_evaluated,
    marker_style,
    panel_legend,
    shortened,
    with_breaks,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

    from skthermo.monitoring import Monitor

Time: TypeAlias = str | pd.Timestamp | None

NEEDED = ("days_", "events_", "threshold_")
PARTS = ("index", "drift", "sensors")
DRIFT = "drift "  # how columns of daily drift begin
N_ERRORS = 2  # standard errors on either side of a change
DODGE = 0.02  # share of the axis of time between error bars beside the last day
SHADES: dict[str, dict[str, object]] = {
    "damage event": {"facecolor": (ORANGE, 0.2), "edgecolor": (ORANGE, 0.5)},
    "watch event": {"facecolor": (AMBER, 0.15), "edgecolor": (AMBER, 0.6), "hatch": "\\\\"},
    "measurement or structure event": {"facecolor": (GREY, 0.25), "edgecolor": (GREY, 0.7), "hatch": "xx"},
    "event marked as harmless": {"facecolor": (GREY, 0.15), "edgecolor": (GREY, 0.5), "hatch": ".."},
}


@dataclass(eq=False, repr=False)
class MonitorDisplay(Display):
    """Damage index of a monitor over time with its threshold and events; below it, drift and failed sensors.

    Records in alarm are orange triangles, others blue dots. Records or days that are not evaluated are grey ticks at
    the bottom, with their number. Events are shaded. Drift is the change of stiffness since the baseline.

    It is best made by `from_estimator`.

    Parameters
    ----------
    index : DataFrame
        On a ``DatetimeIndex``, a row for each record or day: ``index`` (NaN where none was evaluated), ``is_alarm``,
        ``threshold`` (an event begins above it), perhaps ``watch`` (a lower level) and, of days, ``median``.
    events : DataFrame
        ``kind``, ``start``, ``end`` (NaT while it is open) and ``harmless``.
    drift : DataFrame
        Relative change of stiffness by day and group; no columns where none is followed.
    drift_errors : Series
        Standard error of the last change by group.
    faults : DataFrame
        ``column``, ``kind``, ``since`` and ``until`` (NaT while it lasts) of failed sensors.
    parts : sequence of {"index", "drift", "sensors"}
        What is drawn, from top to bottom.

    Attributes
    ----------
    axes_, ax_, figure_ : array of matplotlib's Axes, the first of them, and Figure
        Where it is drawn.
    points_ : list of Line2D
        Records or days that are not in alarm, and those in alarm.
    threshold_line_ : Line2D or None
        Threshold, in steps where a new detector has taken over.
    event_spans_ : list of Polygon
        Shades of events.
    drift_lines_ : list of Line2D
        Drift of each group in percent.
    fault_bars_ : list of PolyCollection
        Times in which a sensor was left out or in doubt.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import pandas as pd
    >>> from types import SimpleNamespace
    >>> from skthermo.plotting import MonitorDisplay
    >>> days = pd.DataFrame(
    ...     {"n_alarms": [0, 0, 1], "index_median": [1.0, None, 4.0], "index_max": [1.5, None, 5.0]},
    ...     pd.date_range("2026-05-01", periods=3))
    >>> events = pd.DataFrame({"kind": ["damage"], "start": [days.index[2]], "end": [pd.NaT], "harmless": [False]})
    >>> monitor = SimpleNamespace(days_=days, events_=events, threshold_=3.0)  # a fitted Monitor
    >>> display = MonitorDisplay.from_estimator(monitor)
    >>> display.ax_.get_ylabel()
    'damage index'
    >>> plt.close(display.figure_)
    """

    index: pd.DataFrame
    events: pd.DataFrame
    drift: pd.DataFrame
    drift_errors: pd.Series
    faults: pd.DataFrame
    parts: Sequence[str]

    @classmethod
    def from_estimator(
        cls,
        monitor: Monitor,
        *,
        start: Time = None,
        end: Time = None,
        by: Literal["day", "record"] = "day",
        parts: Sequence[str] | None = None,
        **options: object,
    ) -> MonitorDisplay:
        """Draw a monitor.

        Parameters
        ----------
        monitor : Monitor
            A `~skthermo.monitoring.Monitor` that has evaluated records.
        start, end : time, optional
            First and last time that are drawn; by default all days in service.
        by : {"day", "record"}, default="day"
            Whether the highest index and the median of each day are drawn, or the index of every record that is kept.
        parts : sequence of {"index", "drift", "sensors"}, optional
            What is drawn. By default the index, the drift where it is followed, and sensors where some have failed.
        **options : dict
            Options of `plot`.

        Returns
        -------
        MonitorDisplay

        Raises
        ------
        ValueError
            If ``monitor`` is something else or not fitted; if it has no records in this time, or lacks a part.
        """
        missing = [name for name in NEEDED if not hasattr(monitor, name)]
        if missing:
            raise ValueError(f"monitor is {monitor!r:.200}, without {missing}; expected a fitted Monitor")
        if by not in ("day", "record"):
            raise ValueError(f"by is {by!r}; expected 'day' or 'record'")
        days = _between(monitor.days_, start, end)
        if by == "day":
            index = _by_day(days)
        else:
            evaluated = _between(monitor.evaluations_, start, end)
            index = pd.DataFrame({"index": evaluated["index"], "is_alarm": evaluated["state"] == "alarm"})
        if not len(index):
            raise ValueError(f"there is no {by} between {start} and {end}; expected a time with records")
        faults = getattr(monitor, "faults_", None)
        faults = pd.DataFrame(columns=["column", "kind", "since", "until"]) if faults is None else faults
        faults = _overlapping(faults, "since", "until", index.index)
        columns = [name for name in days.columns if str(name).startswith(DRIFT)]
        drift = days[columns].set_axis([str(name).removeprefix(DRIFT) for name in columns], axis=1).astype(float)
        table = getattr(monitor, "drift_", None)
        errors = pd.Series(dtype=float) if table is None else table["standard_error"]
        shown = {"index": True, "drift": bool(drift.notna().any(axis=None)), "sensors": len(faults) > 0}
        asked = [part for part in PARTS if shown[part]] if parts is None else list(parts)
        absent = [part for part in asked if not shown.get(part, False)]
        if absent or not asked:
            raise ValueError(f"parts are {asked}; expected some of {[part for part in PARTS if shown[part]]}")
        events = _overlapping(monitor.events_, "start", "end", index.index)
        watch = getattr(monitor, "watch_threshold_", None)  # of monitors with a second level
        index = index.assign(watch=np.nan if watch is None else watch)
        index = index.assign(threshold=_thresholds(monitor, index.index, pd.Timedelta("1D" if by == "day" else "1ns")))
        return cls(index, events, drift, errors, faults, asked).plot(**options)

    def plot(self, ax: Axes | np.ndarray | None = None) -> MonitorDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes or array of Axes, optional
            One for each part. A new figure by default.

        Returns
        -------
        MonitorDisplay
            Itself.
        """
        heights = {"index": 3.2, "drift": 2.2, "sensors": 0.9 + 0.3 * self.faults["column"].nunique()}
        self._take_axes(ax, self.parts, (9.0, 3.2), share_x=True, heights=[heights[part] for part in self.parts])
        self.points_: list[Line2D] = []
        self.threshold_line_: Line2D | None = None
        self.event_spans_: list[Polygon] = []
        self.drift_lines_: list[Line2D] = []
        self.fault_bars_: list[PolyCollection] = []
        draw = {"index": self._draw_index, "drift": self._draw_drift, "sensors": self._draw_sensors}
        first, last = self._ends()
        room = DODGE * self.drift.shape[1] * (last - first) if "drift" in self.parts else pd.Timedelta(0)
        for one, part in zip(self.axes_, self.parts, strict=True):
            draw[part](one)
            panel_legend(one, ax is None)
            one.set_xlim(first, last + room)
            if ax is not None or part == self.parts[-1]:
                date_axis(one, self.index.index)
        return self

    def _ends(self) -> tuple[pd.Timestamp, pd.Timestamp]:
        """Ends of the axis of time: half a step beyond the first and the last row."""
        times = _naive(self.index.index)
        half = pd.Timedelta("12h") if len(times) < 2 else (times[-1] - times[0]) / (2 * (len(times) - 1))
        return times[0] - half, times[-1] + max(half, pd.Timedelta("1h"))

    def _draw_index(self, ax: Axes) -> None:
        for _, event in self.events.iterrows():
            label = "event marked as harmless" if event["harmless"] else f"{event['kind']} event"
            span = self._span(event["start"], event["end"])
            style = SHADES.get(label, SHADES["damage event"])
            self.event_spans_.append(ax.axvspan(*span, linewidth=1, label=label, **style))
        x, values = in_time(self.index[["index"]])
        index, is_alarm = values[:, 0], self.index["is_alarm"].to_numpy(dtype=bool)
        is_daily = "median" in self.index
        if is_daily and (self.index["median"] < self.index["index"]).any():
            median = with_breaks(*in_time(self.index[["median"]]))
            ax.plot(median[0], median[1][:, 0], color=GREY, linewidth=0.9, label="median of the day")
        names = ("highest of the day", "day with an alarm") if is_daily else ("record", "record in alarm")
        for rows, label, colour, number in ((~is_alarm, names[0], BLUE, 0), (is_alarm, names[1], ORANGE, 2)):
            style = marker_style(number, len(x)) | {"marker": "o" if colour == BLUE else "^", "color": colour}
            if rows.any() or colour == BLUE:
                self.points_ += ax.plot(x[rows], index[rows], **style, label=label)
        mark_not_evaluated(ax, {"": x[np.isnan(index)]}, "day" if is_daily else "")
        threshold = self.index["threshold"].to_numpy()
        style = {"color": BLACK, "linestyle": "--", "linewidth": 1, "label": "threshold"}
        if (threshold == threshold[0]).all():
            self.threshold_line_ = ax.axhline(threshold[0], **style)
        else:
            self.threshold_line_ = ax.plot(x, threshold, drawstyle="steps-post", **style)[0]
        watch = self.index["watch"].iloc[-1] if "watch" in self.index else np.nan
        if np.isfinite(watch):
            ax.axhline(watch, color=GREY, linestyle=":", linewidth=1, label="threshold of a watch")
        ax.set_ylim(bottom=0)
        if np.isfinite(index).any():
            hold_outliers(ax, keep=(0.0, threshold.max()))
        ax.set_ylim(top=max(ax.get_ylim()[1], 1.1 * threshold.max()))
        ax.set_ylabel("damage index")

    def _draw_drift(self, ax: Axes) -> None:
        for number, group in enumerate(self.drift):
            x, values = in_time(100 * self.drift[[group]])
            known = np.flatnonzero(np.isfinite(values[:, 0]))
            style = line_style(number, number) | {"linewidth": 1.4, "label": shortened(group)}
            self.drift_lines_ += ax.plot(x, values[:, 0], **style)
            error = N_ERRORS * 100 * float(self.drift_errors.get(group, np.nan))
            if len(known) and np.isfinite(error):
                first, last = self._ends()
                beside = last + (number + 0.5) * DODGE * (last - first)
                label = None if number else f"± {N_ERRORS} standard errors"
                bar = {"color": style["color"], "marker": "o", "capsize": 3, "label": label}
                ax.errorbar([beside], values[known[-1:], 0], error, **bar)
        ax.axhline(0, color=BLACK, linewidth=0.8)
        ax.set_ylabel("change of stiffness\nsince baseline (%)")

    def _draw_sensors(self, ax: Axes) -> None:
        columns = list(dict.fromkeys(self.faults["column"]))
        for _, fault in self.faults.iterrows():
            begin, end = self._span(fault["since"], fault["until"])
            row = columns.index(fault["column"])
            bar = ax.broken_barh([(begin, end - begin)], (row - 0.35, 0.7), facecolor=LIGHT, edgecolor=GREY)
            self.fault_bars_.append(bar)
            text = f" {fault['kind']}"
            ax.text(begin, row, text, va="center", fontsize="small", clip_on=True)
        ax.set_yticks(range(len(columns)), [shortened(name) for name in columns])
        ax.set(ylim=(len(columns) - 0.4, -0.6), ylabel="failed\nsensors")

    def _span(self, begin: Time, end: Time) -> tuple[pd.Timestamp, pd.Timestamp]:
        """Beginning and end within the axis of time; what has no end lasts to the end of it."""
        first, last = self._ends()
        begin = _naive(pd.DatetimeIndex([begin]))[0]
        end = last if pd.isna(end) else min(_naive(pd.DatetimeIndex([end]))[0], last)
        return max(begin, first), end


def _naive(times: pd.DatetimeIndex) -> pd.DatetimeIndex:
    """Times as they are written, without their zone."""
    return times.tz_localize(None)


def _between(table: pd.DataFrame, start: Time, end: Time) -> pd.DataFrame:
    """Rows of a time; stamps in order."""
    zone = table.index.tz
    ends = [None if time is None else pd.Timestamp(time) for time in (start, end)]
    first, last = (time.tz_localize(zone) if time is not None and time.tz is None else time for time in ends)
    keep = np.ones(len(table), dtype=bool)
    keep &= True if first is None else table.index >= first
    keep &= True if last is None else table.index <= last
    return table[keep]


def _by_day(days: pd.DataFrame) -> pd.DataFrame:
    """A row for each calendar day, those without a record included."""
    if len(days):
        days = days.reindex(midnights_between(days.index[0], days.index[-1]))
    columns = {"index": days["index_max"], "median": days["index_median"], "is_alarm": days["n_alarms"].fillna(0) > 0}
    return pd.DataFrame(columns).astype({"index": float, "median": float})


def _thresholds(monitor: Monitor, times: pd.DatetimeIndex, length: pd.Timedelta) -> Array:
    """Threshold at the end of records or days of this length; before what is kept, the earliest known."""
    evaluated = getattr(monitor, "evaluations_", None)
    if evaluated is None or not len(evaluated):
        return np.full(len(times), float(monitor.threshold_))
    known, stamps = evaluated["threshold"].to_numpy(dtype=float), evaluated.index.as_unit("ns").asi8
    places = np.searchsorted(stamps, (times.as_unit("ns") + length).asi8) - 1
    return known[np.clip(places, 0, None)]


def _overlapping(table: pd.DataFrame, begin: str, end: str, times: pd.DatetimeIndex) -> pd.DataFrame:
    """Rows whose time, from one column to the other, has some of the days from the first to the last of these times."""
    first, last = midnight(times[0]), days_later(midnight(times[-1]), 1)
    keep = [
        begins < last and (pd.isna(ends) or ends >= first)
        for begins, ends in zip(table[begin], table[end], strict=True)
    ]
    return table[np.array(keep, dtype=bool)]
