"""Damage indices of detectors and monitors over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from datetime import tzinfo
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator

from skthermo._core.arrays import is_real
from skthermo._core.estimators import last_step
from skthermo._core.frames import midnights_between
from skthermo.detection import MahalanobisDetector
from skthermo.plotting import _display as shared
from skthermo.plotting._display import AMBER, BLACK, GREY, ORANGE, PURPLE, Display

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

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
    label: str = "damage index (Mahalanobis, unsquared)"
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
        indices = {}
        for label, records in tables.items():
            if hasattr(estimator, "damage_index"):
                indices[label] = estimator.damage_index(records)
            else:
                indices[label] = pd.Series(-estimator.score_samples(records), getattr(records, "index", None))
        name = "damage index (Mahalanobis, unsquared)" if isinstance(last, MahalanobisDetector) else "damage index"
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
        by_title = index if has_panels else {"": index if isinstance(index, Mapping) else {"records": index}}
        given = threshold if isinstance(threshold, Mapping) else dict.fromkeys(by_title, threshold)
        tables: dict[str, dict[str, pd.DataFrame]] = {}
        for title, by_label in by_title.items():
            if not isinstance(by_label, Mapping) or not by_label:
                raise ValueError(f"damage index is {by_label!r:.200}; expected one or more by label")
            own = {str(label): shared.as_table(one, f"damage index {label!r}") for label, one in by_label.items()}
            if several := [label for label, table in own.items() if table.shape[1] > 1]:
                raise ValueError(f"damage index {several[0]!r} has several columns; expected one")
            tables[title] = own
            value = given.get(title)
            is_known = is_real(value) or (isinstance(value, pd.Series) and len(value) > 0)
            if not is_known or not np.isfinite(np.asarray(value, dtype=float)).all():
                raise ValueError(f"threshold{f' of {title!r}' if title else ''} is {value!r}; expected a number")
        return cls._drawn(tables, {title: given[title] for title in tables}, **options)

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
        titles, is_own_figure = list(self.scenarios), ax is None
        labels = list(dict.fromkeys(label for by_label in self.scenarios.values() for label in by_label))
        height = 3.4 if len(titles) == 1 else 2.6
        size = (9.0 if n_columns == 1 else 4.6), height
        self.axes_ = shared.panels(ax, titles, size, n_columns, share_x=True)
        self.points_: dict[str, list[Line2D]] = {}
        self.threshold_lines_: list[Line2D] = []
        self.event_spans_: list[Polygon] = []
        for number, (one, title) in enumerate(zip(self.axes_, titles, strict=True)):
            index = next(iter(self.scenarios[title].values())).index
            self._draw_events(one, index)
            self.points_[title], unknown = [], {}
            for label, table in self.scenarios[title].items():
                x, values = shared.in_time(table)
                style = shared.marker_style(labels.index(label), len(x)) | {"label": shared.shortened(label)}
                style["color"] = (colours or {}).get(label, style["color"])
                self.points_[title] += one.plot(x, values[:, 0], **style)
                unknown[style["label"]] = x[np.isnan(values[:, 0])]
            shared.mark_not_evaluated(one, unknown)
            highest = self._draw_threshold(one, self.thresholds[title])
            if self.onset is not None:
                at = shared.on_axis(self.onset, index)
                one.axvline(at, color=GREY, linewidth=1.2, label="onset of damage")
            one.set_title(shared.shortened(title))
            one.set_ylim(bottom=0)
            shared.hold_outliers(one, keep=(0.0, highest))
            if not is_own_figure or number % n_columns == 0:
                one.set_ylabel(shared.plain(self.label if height > 3 else self.label.replace(" (", "\n(")))
            if not is_own_figure or number >= len(titles) - n_columns:
                shared.date_axis(one, index)
        shared.legend(self.axes_, is_own_figure, n_columns=5)
        return self

    def _draw_threshold(self, ax: Axes, threshold: float | pd.Series) -> float:
        """A line, in steps where the threshold changes, and that of a watch; the highest value."""
        style = {"color": BLACK, "linestyle": "--", "linewidth": 1, "label": "threshold"}
        highest = float(np.max(threshold))
        if isinstance(threshold, pd.Series) and threshold.nunique() > 1:
            x, values = shared.in_time(threshold.to_frame())
            self.threshold_lines_ += ax.plot(x, values[:, 0], drawstyle="steps-post", **style)
        else:
            self.threshold_lines_.append(ax.axhline(highest, **style))
        if self.watch is not None:
            ax.axhline(self.watch, color=GREY, linestyle=":", linewidth=1, label="threshold of a watch")
        return highest

    def _draw_events(self, ax: Axes, index: pd.Index) -> None:
        """Shades from the start of each event to its end or, of an open one, to the last record."""
        shades = {"damage": (ORANGE, ""), "watch": (AMBER, "\\\\"), "drift": (PURPLE, "//"), "harmless": (GREY, "..")}
        for event in () if self.events is None else self.events.to_dict("records"):
            kind = "harmless" if event.get("harmless", False) else event["kind"]
            colour, hatch = shades.get(kind, (GREY, "xx"))
            style = {"facecolor": (colour, 0.2), "edgecolor": (colour, 0.5), "hatch": hatch, "linewidth": 1}
            label = "event marked as harmless" if kind == "harmless" else f"{kind} event"
            ends = event["start"], index.max() if pd.isna(event["end"]) else event["end"]
            places = (shared.on_axis(one, index) for one in ends)
            self.event_spans_.append(ax.axvspan(*places, label=label, **style))


def monitored(monitor: Any, start: Time, end: Time, by: str) -> dict[str, Any]:
    """Indices of a monitor's days or records, those in alarm apart, with its thresholds and events."""
    missing = [name for name in ("days_", "events_", "evaluations_", "threshold_") if not hasattr(monitor, name)]
    if missing:
        raise ValueError(f"{monitor!r:.200} has no {missing}; expected a fitted Monitor, or records for a detector")
    if by not in ("day", "record"):
        raise ValueError(f"by is {by!r}; expected 'day' or 'record'")
    evaluated, is_daily = monitor.evaluations_, by == "day"
    shown = slice(*(in_zone(time, evaluated.index.tz) for time in (start, end)))
    if is_daily:
        table = monitor.days_.loc[shown]
        table = table.reindex(midnights_between(table.index[0], table.index[-1])) if len(table) else table
        index, is_alarm = table["index_max"], table["n_alarms"].fillna(0) > 0
    else:
        index, is_alarm = evaluated.loc[shown, "index"], evaluated.loc[shown, "state"] == "alarm"
    if not len(index):
        ends = f"{shown.start or 'the first'} and {shown.stop or 'the last'}"
        raise ValueError(f"there is no {by} between {ends}; expected a time with records")
    names = ("highest of the day", "day with an alarm") if is_daily else ("record", "record in alarm")
    parts = {name: index[rows].astype(float) for name, rows in zip(names, (~is_alarm, is_alarm), strict=True)}
    first, last = index.index[0], index.index[-1] + pd.Timedelta("1D" if is_daily else "0s")
    events, threshold = monitor.events_, evaluated["threshold"].loc[first:last].astype(float)
    events = events.assign(start=events["start"].clip(lower=first), end=events["end"].fillna(last).clip(upper=last))
    return {
        "index": {name: part for name, part in parts.items() if len(part)},
        "threshold": threshold if len(threshold) else float(monitor.threshold_),
        "events": events[events["start"] <= events["end"]],
        "watch": getattr(monitor, "watch_threshold_", None),
        "label": "damage index",
    }


def in_zone(time: Time, zone: tzinfo | None) -> pd.Timestamp | None:
    """A time in the zone of the records."""
    if time is None:
        return None
    stamp = pd.Timestamp(time)
    return stamp.tz_localize(zone) if stamp.tz is None else stamp
