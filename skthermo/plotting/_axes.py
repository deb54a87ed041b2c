"""New axes, or those that the user gives; panels, dates, legends, and maps of colours."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from skthermo.plotting._style import GREY, drawing, label_of, plain, pyplot

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HANDLE, LETTER = 0.5, 0.085
"""Inches that the symbol and a letter of a legend take."""


def panels(
    ax: Axes | np.ndarray | None,
    names: Sequence[object],
    size: tuple[float, float],
    n_columns: int = 1,
    share_x: bool = False,
    heights: Sequence[float] | None = None,
) -> np.ndarray:
    """One axes for each name: those that are given, or those of a new figure, perhaps with heights of its rows."""
    if ax is None:
        n_columns = min(n_columns, len(names))
        n_rows = -(-len(names) // n_columns)
        height = size[1] * n_rows if heights is None else sum(heights)
        figure = pyplot().figure(figsize=(size[0] * n_columns, height), layout="constrained")
        axes = figure.subplots(n_rows, n_columns, sharex=share_x, squeeze=False, height_ratios=heights).ravel()
        for unused in axes[len(names) :]:
            unused.remove()
        for above in axes[max(len(names) - n_columns, 0) : len(names)] if share_x else ():
            above.tick_params(labelbottom=True)
        return axes[: len(names)]
    given = np.ravel(np.asarray(ax, dtype=object))
    if not all(hasattr(one, "plot") and hasattr(one, "figure") for one in given):
        raise ValueError(f"ax is {ax!r:.200}; expected matplotlib's axes")
    if len(given) != len(names):
        raise ValueError(f"ax holds {len(given)} axes; expected {len(names)}, for {list(names)}")
    return given


def panel_names(titles: Sequence[str] | None, columns: Sequence[Hashable]) -> list[str]:
    """Names of the panels: those that are given, or those of the columns."""
    if titles is not None and len(titles) != len(columns):
        raise ValueError(f"titles is {list(titles)}; expected {len(columns)}, for {list(columns)}")
    return [label_of(name) for name in (columns if titles is None else titles)]


def size_in_time(n_panels: int, n_columns: int) -> tuple[float, float]:
    """Width and height in inches of panels over time: wide ones, and taller if there are few."""
    n_rows = -(-n_panels // n_columns)
    return (9.0 if n_columns == 1 else 5.5), (3.4 if n_rows == 1 else 2.5 if n_rows == 2 else 1.9)


def figure_legend(axes: np.ndarray, is_own_figure: bool, n_columns: int = 4) -> None:
    """One legend of all panels' labels above those of a new figure, or within the first of given axes."""
    by_label: dict[str, Artist] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            by_label.setdefault(label, handle)
    handles, labels = list(by_label.values()), list(by_label)
    scale = 2.0 if any(getattr(h, "get_markersize", lambda: 9)() < 4 for h in handles) else 1.0
    if not handles:
        return
    if is_own_figure:
        n_columns = legend_columns(labels, axes[0].figure, n_columns)
        axes[0].figure.legend(
            handles, labels, loc="outside upper center", ncols=n_columns, frameon=False, markerscale=scale
        )
    else:
        axes[0].legend(frameon=False, markerscale=scale, fontsize="small")


def legend_columns(labels: Sequence[str], figure: Figure, most: int) -> int:
    """How many columns of a legend fit into the width of a figure."""
    widest = HANDLE + LETTER * max(map(len, labels))
    return int(np.clip(figure.get_figwidth() // widest, 1, most))


def date_axis(ax: Axes, index: pd.Index, label: str | None = None) -> None:
    """Ticks and label of an axis of time, or of the number of the record."""
    if isinstance(index, pd.DatetimeIndex):
        dates = drawing("matplotlib.dates")
        locator = dates.AutoDateLocator()
        ax.xaxis.set_major_locator(locator)
        ax.xaxis.set_major_formatter(dates.ConciseDateFormatter(locator))
        ax.set_xlabel(label or "date")
    else:
        ax.set_xlabel(label or plain(index.name or "record"))


def draw_marks(axes: np.ndarray, marks: Mapping[str, object] | None, index: pd.Index) -> None:
    """Vertical lines in all panels, with their labels above the first."""
    for text, place in (marks or {}).items():
        for ax in axes:
            ax.axvline(on_axis(place, index), color=GREY, linestyle="--", linewidth=1)
        above = axes[0].get_xaxis_transform()
        axes[0].text(on_axis(place, index), 1.03, f" {plain(text)}", transform=above, fontsize="small")


def on_axis(place: object, index: pd.Index) -> float | np.datetime64:
    """A time in the zone of the index, or a number; on an axis of time, a number is the position of a record."""
    is_number = isinstance(place, Real)
    if not isinstance(index, pd.DatetimeIndex):
        if not is_number:
            raise ValueError(f"{place!r} is not a number; expected one, since the records have no DatetimeIndex")
        return place
    if is_number:
        if not 0 <= place < len(index):
            raise ValueError(f"there is no record number {place!r}; expected a time, or 0 to {len(index) - 1}")
        place = index[int(place)]
    try:
        time = pd.Timestamp(place)
    except (TypeError, ValueError):
        raise ValueError(f"{place!r} is not a time; expected one, such as '2025-03-01', or a record's number") from None
    if time.tz is not None and index.tz is not None:
        time = time.tz_convert(index.tz)
    return time.tz_localize(None).to_datetime64()
