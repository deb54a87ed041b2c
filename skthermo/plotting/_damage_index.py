"""Damage indices of detectors and monitors over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator

from skthermo._core.arrays import is_real
from skthermo._core.estimators import last_step
from skthermo._core.frames import midnights_between
from skthermo.detection import MahalanobisDetector
from skthermo.plotting._display import (
    AMBER,
    BLACK,
    DAMAGE_INDEX,
    GREY,
    ORANGE,
    PURPLE,
    Display,
    as_table,
    date_axis,
    figure_legend,
    hold_outliers,
    in_time,
    mark_not_evaluated,
    marker_style,
    on_axis,
    panels,
    plain,
    shortened,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

SHADES = {"damage": (ORANGE, ""), "watch": (AMBER, "\\\\"), "drift": (PURPLE, "//"), "harmless": (GREY, "..")}
"""Colour and hatching of an event by its kind; others are grey with crosses."""


Time = str | pd.Timestamp | None


@dataclass(eq=False, repr=False)
class DamageIndexDisplay(Display):
    """Damage index of every record, the threshold above which it is an alarm, the onset of damage, and events.

    Records without an index, which are not evaluated, are grey ticks at the bottom, with their number. A few indices
    far above the others do not stretch the axis: triangles at its edge and a number stand for them. Events are shaded.

    It is best made by `from_estimator` or `from_predictions`.

    Parameters
    ----------
    scenarios : dict of str to dict of str to DataFrame of shape (n_samples, 1)
        Damage indices by the title of their panel and by their label.
    thresholds : dict of str to float or Series
        Threshold of each panel; a Series is a threshold in time.
    onset : time or number, optional
        When damage began; on an axis of time, a number is the position of a record of the first table.
    label : str
        Label of the vertical axes.
    events : DataFrame, optional
        ``kind``, ``start``, ``end`` (NaT while it is open) and ``harmless``.
    watch : float, optional
        A second, lower threshold.

    Attributes
    ----------
    axes_, ax_, figure_ : array of matplotlib's Axes, the first of them, and Figure
        Where it is drawn.
    points_ : dict of str to list of Line2D
        Points of each panel, in the order of their labels.
    threshold_lines_ : list of Line2D
        Threshold of each panel.
    event_spans_ : list of Polygon
        Shades of events.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector
    >>> from skthermo.plotting import DamageIndexDisplay
    >>> healthy, damaged = (make_truss_campaign(damage=damage, random_state=0) for damage in (None, {"bottom": 0.3}))
    >>> detector = MahalanobisDetector().fit(healthy.frequencies)
    >>> display = DamageIndexDisplay.from_estimator(
    ...     detector, {"healthy": healthy.frequencies, "damaged": damaged.frequencies})
    >>> display.ax_.get_ylabel()
    'damage index (Mahalanobis, unsquared)'
    >>> plt.close(display.figure_)
    """

    scenarios: Mapping[str, Mapping[str, pd.DataFrame]]
    thresholds: Mapping[str, float]
    _: KW_ONLY
    onset: object = None
    label: str = DAMAGE_INDEX
    events: pd.DataFrame | None = None
    watch: float | None = None

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: Mapping[str, ArrayLike] | ArrayLike | None = None,
        *,
        start: Time = None,
        end: Time = None,
        by: Literal["day", "record"] = "day",
        **options: object,
    ) -> DamageIndexDisplay:
        """Draw the damage index that a fitted detector gives to records, or that a monitor has given, with its events.

        Parameters
        ----------
        estimator : fitted outlier detector or Monitor
            A detector of this package, one of scikit-learn's with ``score_samples`` and ``offset_``, or a pipeline
            that ends with one; or a `~skthermo.monitoring.Monitor` that has evaluated records.
        X : array-like or DataFrame of shape (n_samples, n_columns), or mapping of str to such
            What the detector evaluates, in Hz for frequencies; several tables by label. Not for a monitor.
        start, end : time, optional
            First and last time of a monitor that are drawn; by default all days in service.
        by : {"day", "record"}, default="day"
            Whether the highest index of each day of a monitor is drawn, or that of every record that it keeps.
        **options : dict
            ``onset`` and ``label`` of the display, and options of `plot`.

        Returns
        -------
        DamageIndexDisplay

        Raises
        ------
        ValueError
            If the detector has no scores or no threshold; if the monitor has no records in this time.
        """
        if X is None:
            return cls.from_predictions(**monitored(estimator, start, end, by), **options)
        last = last_step(estimator)
        if not hasattr(estimator, "score_samples"):
            raise ValueError(f"{estimator!r:.200} has no method 'score_samples'; expected an outlier detector")
        threshold = getattr(last, "threshold_", None)
        if threshold is None:
            threshold = -getattr(last, "offset_", float("nan"))
        tables = X if isinstance(X, Mapping) else {"records": X}
        indices = {label: index_of(estimator, records) for label, records in tables.items()}
        name = DAMAGE_INDEX if isinstance(last, MahalanobisDetector) else "damage index"
        return cls.from_predictions(indices, threshold, **{"label": name, **options})

    @classmethod
    def from_predictions(
        cls,
        index: Mapping[str, Mapping[str, ArrayLike] | ArrayLike] | ArrayLike,
        threshold: float | pd.Series | Mapping[str, float | pd.Series],
        **options: object,
    ) -> DamageIndexDisplay:
        """Draw damage indices.

        Parameters
        ----------
        index : array-like or Series of shape (n_samples,), or mapping of str to such, or of str to such mappings
            Damage index of each record; several by label; or by the title of their panel, and then by label.
        threshold : float or Series, or mapping of str to such
            A damage index above it is an alarm; one for all panels, or one for each title. A Series holds a threshold
            that changes in time.
        **options : dict
            ``onset``, ``label``, ``events`` and ``watch`` of the display, and options of `plot`.

        Returns
        -------
        DamageIndexDisplay

        Raises
        ------
        ValueError
            If an index is not a column of numbers, or a threshold missing or not a number.
        """
        has_panels = isinstance(index, Mapping) and any(isinstance(one, Mapping) for one in index.values())
        panels = index if has_panels else {"": index if isinstance(index, Mapping) else {"records": index}}
        tables = {title: columns_of(by_label) for title, by_label in panels.items()}
        given = threshold if isinstance(threshold, Mapping) else dict.fromkeys(panels, threshold)
        thresholds = {title: as_threshold(given.get(title), title) for title in panels}
        return cls._drawn(tables, thresholds, **options)

    def plot(
        self,
        ax: Axes | np.ndarray | None = None,
        *,
        n_columns: int = 1,
        colours: Mapping[str, str] | None = None,
    ) -> DamageIndexDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes or array of Axes, optional
            One for each scenario. A new figure by default.
        n_columns : int, default=1
            Panels beside each other in a new figure.
        colours : mapping of str to str, optional
            Colours by label; by default those of the palette in their order.

        Returns
        -------
        DamageIndexDisplay
            Itself.

        Raises
        ------
        ValueError
            If the onset or an event is not on the axis.
        """
        titles = list(self.scenarios)
        width = 9.0 if n_columns == 1 else 4.6
        height = 3.4 if len(titles) == 1 else 2.6
        self.axes_ = panels(ax, titles, (width, height), n_columns=n_columns, share_x=True)
        self.points_: dict[str, list[Line2D]] = {}
        self.threshold_lines_: list[Line2D] = []
        self.event_spans_: list[Polygon] = []
        for number, (one, title) in enumerate(zip(self.axes_, titles, strict=True)):
            self._draw_events(one, next(iter(self.scenarios[title].values())).index)
            self.points_[title] = self._draw_points(one, self.scenarios[title], colours or {})
            drawn = {shortened(label): in_time(table) for label, table in self.scenarios[title].items()}
            mark_not_evaluated(one, {label: x[np.isnan(values[:, 0])] for label, (x, values) in drawn.items()})
            highest = self._draw_threshold(one, self.thresholds[title])
            if self.onset is not None:
                first = next(iter(self.scenarios[title].values()))
                one.axvline(
                    on_axis(self.onset, first.index), color=GREY, linestyle="-", linewidth=1.2, label="onset of damage"
                )
            one.set_title(shortened(title))
            one.set_ylim(bottom=0)
            hold_outliers(one, keep=(0.0, highest))
            if ax is not None or number % n_columns == 0:
                one.set_ylabel(plain(self.label if height > 3 else self.label.replace(" (", "\n(")))
        for one, title in list(zip(self.axes_, titles, strict=True))[-n_columns if ax is None else 0 :]:
            date_axis(one, next(iter(self.scenarios[title].values())).index)
        figure_legend(self.axes_, ax is None, n_columns=5)
        return self

    def _draw_threshold(self, ax: Axes, threshold: float | pd.Series) -> float:
        """A line, in steps where the threshold changes, and that of a watch; the highest value."""
        style = {"color": BLACK, "linestyle": "--", "linewidth": 1, "label": "threshold"}
        if isinstance(threshold, pd.Series) and threshold.nunique() > 1:
            x, values = in_time(threshold.to_frame())
            self.threshold_lines_ += ax.plot(x, values[:, 0], drawstyle="steps-post", **style)
            highest = float(threshold.max())
        else:
            highest = float(np.max(threshold))
            self.threshold_lines_.append(ax.axhline(highest, **style))
        if self.watch is not None:
            ax.axhline(self.watch, color=GREY, linestyle=":", linewidth=1, label="threshold of a watch")
        return highest

    def _draw_events(self, ax: Axes, index: pd.Index) -> None:
        """Shades from the start of each event to its end or, of an open one, to the last record."""
        events = pd.DataFrame() if self.events is None else self.events
        for _, event in events.iterrows():
            is_harmless = bool(event.get("harmless", False))
            ends = index.max() if pd.isna(event["end"]) else event["end"]
            colour, hatch = SHADES.get("harmless" if is_harmless else event["kind"], (GREY, "xx"))
            style = {"facecolor": (colour, 0.2), "edgecolor": (colour, 0.5), "hatch": hatch, "linewidth": 1}
            label = "event marked as harmless" if is_harmless else f"{event['kind']} event"
            places = on_axis(event["start"], index), on_axis(ends, index)
            self.event_spans_.append(ax.axvspan(*places, label=label, **style))

    def _draw_points(self, ax: Axes, tables: Mapping[str, pd.DataFrame], colours: Mapping[str, str]) -> list[Line2D]:
        """Points in the colour and marker that their label has in every panel."""
        drawn, labels = [], list(dict.fromkeys(label for by_label in self.scenarios.values() for label in by_label))
        for label, table in tables.items():
            x, values = in_time(table)
            style = marker_style(labels.index(label), len(x))
            style |= {"color": colours.get(label, style["color"]), "label": shortened(label)}
            drawn += ax.plot(x, values[:, 0], **style)
        return drawn


def columns_of(by_label: Mapping[str, ArrayLike]) -> dict[str, pd.DataFrame]:
    """Damage indices of one panel as frames of one column."""
    if not isinstance(by_label, Mapping) or not by_label:
        raise ValueError(f"damage index is {by_label!r:.200}; expected one or more by label")
    tables = {str(label): as_table(values, f"damage index {label!r}", "index") for label, values in by_label.items()}
    for label, table in tables.items():
        if table.shape[1] != 1:
            raise ValueError(f"damage index {label!r} has {table.shape[1]} columns; expected one")
    return tables


def index_of(estimator: BaseEstimator, records: ArrayLike) -> ArrayLike:
    """Damage index of records: a detector's own, or minus its score."""
    if hasattr(estimator, "damage_index"):
        return estimator.damage_index(records)
    index = -estimator.score_samples(records)
    return pd.Series(index, records.index) if isinstance(records, pd.DataFrame) else index


def monitored(monitor: Any, start: Time, end: Time, by: str) -> dict[str, Any]:
    """Indices of a monitor's days or records, those in alarm apart, with its thresholds and events."""
    missing = [name for name in ("days_", "events_", "evaluations_", "threshold_") if not hasattr(monitor, name)]
    if missing:
        raise ValueError(f"{monitor!r:.200} has no {missing}; expected a fitted Monitor, or records for a detector")
    if by not in ("day", "record"):
        raise ValueError(f"by is {by!r}; expected 'day' or 'record'")
    evaluated = monitor.evaluations_
    start, end = (in_zone(time, evaluated.index) for time in (start, end))
    if by == "record":
        table, is_alarm = evaluated["index"].loc[start:end], (evaluated["state"] == "alarm").loc[start:end]
    else:
        days = monitor.days_.loc[start:end]
        days = days.reindex(midnights_between(days.index[0], days.index[-1])) if len(days) else days
        table, is_alarm = days["index_max"], days["n_alarms"].fillna(0) > 0
    if not len(table):
        raise ValueError(
            f"there is no {by} between {start or 'the first'} and {end or 'the last'}; expected a time with records"
        )
    first, last = table.index[0], table.index[-1] + pd.Timedelta("1D" if by == "day" else "0s")
    events = monitor.events_
    events = events[(events["start"] <= last) & (events["end"].isna() | (events["end"] >= first))]
    names = ("highest of the day", "day with an alarm") if by == "day" else ("record", "record in alarm")
    parts = {name: table[rows].astype(float) for name, rows in zip(names, (~is_alarm, is_alarm), strict=True)}
    threshold = evaluated["threshold"].loc[first:last].astype(float)
    return {
        "index": {name: part for name, part in parts.items() if len(part)},
        "threshold": threshold if len(threshold) else float(monitor.threshold_),
        "events": events.assign(
            start=events["start"].clip(lower=first), end=events["end"].fillna(last).clip(upper=last)
        ),
        "watch": getattr(monitor, "watch_threshold_", None),
        "label": "damage index",
    }


def in_zone(time: Time, index: pd.DatetimeIndex) -> pd.Timestamp | None:
    """A time in the zone of an index."""
    if time is None:
        return None
    stamp = pd.Timestamp(time)
    return stamp.tz_localize(index.tz) if stamp.tz is None else stamp


def as_threshold(value: object, title: str) -> float | pd.Series:
    """A threshold as a number, or as numbers in time."""
    if isinstance(value, pd.Series) and np.isfinite(value.astype(float)).all() and len(value):
        return value
    threshold = float(value) if is_real(value) else np.nan
    if not np.isfinite(threshold):
        raise ValueError(f"threshold{f' of {title!r}' if title else ''} is {value!r}; expected a number")
    return threshold
