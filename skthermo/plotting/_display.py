"""What displays share: their base, style, axes and limits of what is drawn, which are frames of columns over time."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import fields
from numbers import Real
from types import ModuleType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.exceptions import NotFittedError

from skthermo._core.arrays import Array, as_columns, real_array
from skthermo._core.estimators import import_optional
from skthermo._core.text import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skthermo.studies import DetectabilityStudy

# Okabe and Ito's palette for colour-blind readers. What is measured is blue, what is predicted or simulated orange.
BLUE, ORANGE, GREEN, PURPLE, SKY, AMBER = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00"
BLACK, GREY, LIGHT = "#000000", "#555555", "#BBBBBB"
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY, BLACK)
MARKERS = ("o", "x", "^", "s", "+", "v", "D")
LINES = ("-", "--", "-.", ":")
DENSE = 10_000  # points from which on files of vectors, such as SVG, hold them as an image
LETTER = 0.085  # inches that a letter of a legend takes
EDGES: dict[tuple[str, bool], tuple[str, dict[str, object]]] = {
    ("y", False): ("v", {"x": 0.99, "y": 0.03, "ha": "right", "va": "bottom"}),
    ("y", True): ("^", {"x": 0.99, "y": 0.96, "ha": "right", "va": "top"}),
    ("x", False): ("<", {"x": 0.02, "y": 0.5, "ha": "left", "va": "center", "rotation": 90}),
    ("x", True): (">", {"x": 0.98, "y": 0.5, "ha": "right", "va": "center", "rotation": 90}),
}
"""Marker of the lower or upper edge of an axis, and how its text stands."""


def drawing(module: str) -> ModuleType:
    """A module of matplotlib, imported when something is drawn."""
    return import_optional(module, extra="plot")


def plain(text: str) -> str:
    """A text whose dollar signs matplotlib draws as they are where they enclose no formula."""
    if "$" not in text:
        return text
    try:
        drawing("matplotlib.mathtext").MathTextParser("path").parse(text)
    except ValueError:
        return text.replace("\\$", "$").replace("$", "\\$")
    return text


def shortened(name: Hashable) -> str:
    """A name for a legend, a title or a tick: a very long one loses its middle, dollar signs stay as they are."""
    text = printable(name)
    return plain(text if len(text) <= 36 else f"{text[:18].rstrip()} ... {text[-12:].lstrip()}")


def label_of(name: Hashable) -> str:
    """A column's name as text; f1 becomes a symbol with an index."""
    found = re.fullmatch(r"([fT])_?(\d+)", str(name))
    return f"${found[1]}_{{{found[2]}}}$" if found else shortened(name)


def marker_style(number: int, n_points: int) -> dict[str, object]:
    """Options of plot for unconnected points: colour, and a marker that tells them apart in greyscale too."""
    marker, colour = MARKERS[number % len(MARKERS)], COLOURS[number % len(COLOURS)]
    size = 5.0 if n_points <= 100 else 3.5 if n_points <= 1000 else 2.0
    style = {"linestyle": "", "marker": marker, "markersize": size, "color": colour, "rasterized": n_points > DENSE}
    return style | {"markeredgewidth": 0.8 if marker in "x+" else 0.0}


def panels(
    ax: Axes | np.ndarray | None,
    names: Sequence[object],
    size: tuple[float, float],
    n_columns: int = 1,
    share_x: bool = False,
) -> np.ndarray:
    """One axes for each name: those that are given, or those of a new figure."""
    if ax is None:
        n_columns = min(n_columns, len(names))
        n_rows = -(-len(names) // n_columns)
        size = size[0] * n_columns, size[1] * n_rows
        figure = drawing("matplotlib.pyplot").figure(figsize=size, layout="constrained")
        axes = figure.subplots(n_rows, n_columns, sharex=share_x, squeeze=False).ravel()
        for unused in axes[len(names) :]:
            unused.remove()
        for lowest in axes[: len(names)][-n_columns:] if share_x else ():
            lowest.tick_params(labelbottom=True)
        return axes[: len(names)]
    given = np.ravel(np.asarray(ax, dtype=object))
    if len(given) != len(names) or not all(hasattr(one, "plot") and hasattr(one, "figure") for one in given):
        raise ValueError(f"ax is {ax!r:.200}; expected {len(names)} of matplotlib's axes, for {list(names)}")
    return given


def legend(axes: np.ndarray, is_own_figure: bool, n_columns: int = 4, side: str = "upper") -> None:
    """One legend of all panels' labels above or below those of a new figure, or within the first of given axes."""
    by_label: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            by_label.setdefault(label, handle)
    if not by_label:
        return
    is_small = any(getattr(handle, "get_markersize", lambda: 9)() < 4 for handle in by_label.values())
    given = list(by_label.values()), list(by_label)
    style = {"frameon": False, "markerscale": 2.0 if is_small else 1.0, "fontsize": "small"}
    if not is_own_figure:
        axes[0].legend(*given, **style)
        return
    figure = axes[0].figure
    fitting = figure.get_figwidth() // (0.5 + LETTER * max(map(len, by_label)))
    figure.legend(*given, loc=f"outside {side} center", ncols=int(np.clip(fitting, 1, n_columns)), **style)


def date_axis(ax: Axes, index: pd.Index) -> None:
    """Ticks and label of an axis of time, or of the number of the record."""
    if not isinstance(index, pd.DatetimeIndex):
        ax.set_xlabel(shortened(index.name or "record"))
        return
    dates = drawing("matplotlib.dates")
    locator = dates.AutoDateLocator()
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(dates.ConciseDateFormatter(locator))
    ax.set_xlabel("date")


def on_axis(place: object, index: pd.Index) -> float | np.datetime64:
    """A time in the zone of the index, or a number; on an axis of time, a number is the position of a record."""
    is_number, is_time = isinstance(place, Real), isinstance(index, pd.DatetimeIndex)
    if (is_number and is_time and not 0 <= place < len(index)) or not (is_number or is_time):
        expected = f"a time, or a record's number from 0 to {len(index) - 1}" if is_time else "a number"
        raise ValueError(f"{place!r} is not on the axis; expected {expected}")
    if not is_time:
        return place
    time = index[int(place)] if is_number else pd.Timestamp(place)
    if time.tz is not None and index.tz is not None:
        time = time.tz_convert(index.tz)
    return time.tz_localize(None).to_datetime64()


def hold_outliers(ax: Axes, direction: str = "y", keep: Iterable[float] = (), also: Iterable[Array] = ()) -> None:
    """End an axis ("x" or "y") where the points of its lines end but for those that would make it more than three times
    as long; these are marked at the edge and counted. Values in ``keep`` and those of bands in ``also`` stay in view.
    """
    for mark in [*ax.lines, *ax.texts]:
        if mark.get_gid() == f"beyond {direction}":
            mark.remove()
    lines = [line for line in ax.lines if line.get_transform() == ax.transData]
    columns = [getattr(line, f"get_{direction}data")(orig=False).astype(float) for line in lines]
    middles = [middle_of(values) for values in [*columns, *also] if np.isfinite(values).any()]
    if not middles:
        return
    middle, seen = np.concatenate([*middles, [*keep]]), np.concatenate([*columns, *also, [*keep]])
    low, high = middle.min() - np.ptp(middle), middle.max() + np.ptp(middle)
    beyond = {False: [values < low for values in columns], True: [values > high for values in columns]}
    if not any(rows.any() for sides in beyond.values() for rows in sides):
        return
    seen = seen[(seen >= low) & (seen <= high)]
    margin = 0.05 * np.ptp(seen)
    lowest = seen.min() if seen.min() in keep else seen.min() - margin
    getattr(ax, f"set_{direction}lim")(lowest, seen.max() + margin)
    transform = ax.get_xaxis_transform() if direction == "y" else ax.get_yaxis_transform()
    for is_upper, sides in beyond.items():
        (marker, place), far = EDGES[direction, is_upper], []
        for line, values, rows in zip(lines, columns, sides, strict=True):
            points = np.column_stack(line.get_data(orig=False))[rows]
            points[:, "xy".index(direction)] = float(is_upper)
            style = {"linestyle": "", "marker": marker, "color": line.get_color(), "rasterized": len(points) > DENSE}
            if len(points):
                ax.plot(*points.T, transform=transform, gid=f"beyond {direction}", ms=5, mew=0, **style)
            far += values[rows].tolist()
        if far:
            text = f"{len(far)} beyond, {'up' if is_upper else 'down'} to {max(far) if is_upper else min(far):.4g}"
            _write(ax, text, gid=f"beyond {direction}", **place)


def middle_of(values: Array) -> Array:
    """All values but 2 % at either end, in order; of values that hardly differ otherwise, and of few values, all."""
    known = np.sort(values[np.isfinite(values)])
    n_few = int(np.ceil(0.02 * len(known))) if len(known) >= 10 else 0
    middle = known[n_few : len(known) - n_few]
    return middle if middle[0] < middle[-1] else known


def mark_not_evaluated(ax: Axes, places: dict[str, Array]) -> None:
    """Grey ticks at the bottom where records of each label are not evaluated, and a text that counts them."""
    for x in places.values():
        style = {"linestyle": "", "marker": "|", "color": GREY, "rasterized": len(x) > DENSE, "gid": "not evaluated"}
        if len(x):
            ax.plot(x, np.full(len(x), 0.02), transform=ax.get_xaxis_transform(), ms=7, mew=0.8, **style)
    texts = [
        f"{f'{label}: ' if len(places) > 1 else ''}{len(x)} not evaluated" for label, x in places.items() if len(x)
    ]
    if texts:
        _write(ax, "; ".join(texts), x=0.01, y=0.95, ha="left", va="top", gid="not evaluated")


def _write(ax: Axes, text: str, x: float, y: float, **style: object) -> None:
    """A small text in shares of the axes, on a ground that keeps points off it."""
    box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.0}
    ax.text(x, y, text, transform=ax.transAxes, fontsize="small", color=GREY, bbox=box, **style)


def as_table(values: ArrayLike, what: str, prefix: str = "f") -> pd.DataFrame:
    """A frame of floats; the columns of an array are called f1, f2, ... and its rows by their numbers from 0."""
    if isinstance(values, pd.Series):
        values = values.to_frame(f"{prefix}1" if values.name is None else values.name)
    real_array(values, what)
    columns = as_columns(values)
    if columns.ndim != 2 or not columns.size:
        raise ValueError(f"{what} has shape {np.shape(values)}; expected one or more records (rows) and columns")
    if isinstance(values, pd.DataFrame):
        return pd.DataFrame(columns, values.index, values.columns)
    return pd.DataFrame(columns, columns=[f"{prefix}{i + 1}" for i in range(columns.shape[1])])


def in_time(table: pd.DataFrame) -> tuple[NDArray, NDArray]:
    """Place of each record on the horizontal axis, (n_records,), and the values, in order of time where it is known."""
    values, index = table.to_numpy(), table.index
    if isinstance(index, pd.PeriodIndex):
        index = index.to_timestamp()
    if isinstance(index, pd.DatetimeIndex):
        order = np.argsort(index.to_numpy(), kind="stable")
        return index.tz_localize(None).to_numpy()[order], values[order]
    return (index.to_numpy() if pd.api.types.is_numeric_dtype(index) else np.arange(len(index))), values


def check_study(study: DetectabilityStudy) -> None:
    """Raise an error for what is no study, or one without results."""
    if not hasattr(study, "scenarios"):
        raise ValueError(f"study is {study!r:.200}; expected a DetectabilityStudy")
    if not hasattr(study, "results_"):
        raise NotFittedError("the study has no results yet; expected a call of run before")


class Display:
    """A display as scikit-learn has them: made and drawn in one call, with its axes and its figure as attributes."""

    axes_: np.ndarray

    @classmethod
    def _drawn(cls, *data: object, **options: Any) -> Self:
        """A display that is drawn: options that it has as parameters are its own, all others are those of `plot`."""
        own = {field.name: options.pop(field.name) for field in fields(cls) if field.name in options}
        return cls(*data, **own).plot(**options)

    @property
    def ax_(self) -> Axes:
        """The only axes, or the first of several."""
        return self.axes_[0]

    @property
    def figure_(self) -> Figure:
        """The figure of the axes."""
        return self.axes_[0].figure
