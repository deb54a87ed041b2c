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
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from skthermo.studies import DetectabilityStudy

# Okabe and Ito's palette for colour-blind readers. What is measured is blue, what is predicted or simulated orange.
BLUE, ORANGE, GREEN, PURPLE, SKY, AMBER = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00"
BLACK, GREY, LIGHT = "#000000", "#555555", "#BBBBBB"
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY, BLACK)
MARKERS = ("o", "x", "^", "s", "+", "v", "D")
LINES = ("-", "--", "-.", ":")
DAMAGE_INDEX = "damage index (Mahalanobis, unsquared)"
DENSE = 10_000  # points from which on files of vectors, such as SVG, hold them as an image
LETTER = 0.085  # inches that a letter of a legend takes
EDGES: dict[tuple[str, bool], tuple[str, float, dict[str, object]]] = {
    ("y", False): ("v", 0.0, {"x": 0.99, "y": 0.03, "ha": "right", "va": "bottom"}),
    ("y", True): ("^", 1.0, {"x": 0.99, "y": 0.96, "ha": "right", "va": "top"}),
    ("x", False): ("<", 0.0, {"x": 0.02, "y": 0.5, "ha": "left", "va": "center", "rotation": 90}),
    ("x", True): (">", 1.0, {"x": 0.98, "y": 0.5, "ha": "right", "va": "center", "rotation": 90}),
}
"""Marker of an edge, its coordinate in shares of the axes, and how its text stands."""


def drawing(module: str) -> ModuleType:
    """A module of matplotlib, imported when something is drawn."""
    return import_optional(module, extra="plot")


def pyplot() -> ModuleType:
    """Matplotlib's pyplot."""
    return drawing("matplotlib.pyplot")


def shortened(name: Hashable) -> str:
    """A name for a legend, a title or a tick: a very long one loses its middle, dollar signs stay as they are."""
    text = printable(name)
    if len(text) > 36:
        text = f"{text[:18].rstrip()} ... {text[-12:].lstrip()}"
    return plain(text)


def plain(text: Hashable) -> str:
    """A text whose dollar signs matplotlib draws as they are, in lines where they enclose no formula."""
    return "\n".join(_plain_line(printable(line)) for line in str(text).split("\n"))


def _plain_line(line: str) -> str:
    if "$" not in line:
        return line
    try:
        drawing("matplotlib.mathtext").MathTextParser("path").parse(line)
    except ValueError:
        return line.replace("\\$", "$").replace("$", "\\$")
    return line


def label_of(name: Hashable) -> str:
    """A column's name as text; f1 becomes a symbol with an index."""
    text = str(name)
    found = re.fullmatch(r"([fT])_?(\d+)", text)
    return f"${found[1]}_{{{found[2]}}}$" if found else shortened(text)


def marker_style(number: int, n_points: int) -> dict[str, object]:
    """Options of plot for unconnected points: colour, and a marker that tells them apart in greyscale too."""
    size = 5.0 if n_points <= 100 else 3.5 if n_points <= 1000 else 2.0
    marker = MARKERS[number % len(MARKERS)]
    return {
        "linestyle": "",
        "marker": marker,
        "markersize": size,
        "color": COLOURS[number % len(COLOURS)],
        "markeredgewidth": 0.8 if marker in "x+" else 0.0,
        "rasterized": n_points > DENSE,
    }


def line_style(number: int, dashes: int = 0, n_points: int = 0) -> dict[str, object]:
    """Options of plot for lines: colour, and dashes that tell them apart in greyscale too."""
    style = {"linestyle": LINES[dashes % len(LINES)], "color": COLOURS[number % len(COLOURS)], "linewidth": 1.0}
    return style | {"rasterized": n_points > DENSE}


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
        figure = pyplot().figure(figsize=(size[0] * n_columns, size[1] * n_rows), layout="constrained")
        axes = figure.subplots(n_rows, n_columns, sharex=share_x, squeeze=False).ravel()
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


def figure_legend(axes: np.ndarray, is_own_figure: bool, n_columns: int = 4) -> None:
    """One legend of all panels' labels above those of a new figure, or within the first of given axes."""
    handles, labels, scale = _labelled(axes)
    if not handles:
        return
    if is_own_figure:
        style = {"ncols": legend_columns(labels, axes[0].figure, n_columns), "frameon": False, "markerscale": scale}
        axes[0].figure.legend(handles, labels, loc="outside upper center", **style)
    else:
        axes[0].legend(handles, labels, frameon=False, markerscale=scale, fontsize="small")


def _labelled(axes: np.ndarray) -> tuple[list[Artist], list[str], float]:
    """Symbols and labels of panels, each label once, and how much larger small symbols are shown."""
    by_label: dict[str, Artist] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            by_label.setdefault(label, handle)
    is_small = any(getattr(handle, "get_markersize", lambda: 9)() < 4 for handle in by_label.values())
    return list(by_label.values()), list(by_label), 2.0 if is_small else 1.0


def legend_columns(labels: Sequence[str], figure: Figure, most: int) -> int:
    """How many columns of a legend fit into the width of a figure."""
    widest = 0.5 + LETTER * max(map(len, labels))
    return int(np.clip(figure.get_figwidth() // widest, 1, most))


def date_axis(ax: Axes, index: pd.Index) -> None:
    """Ticks and label of an axis of time, or of the number of the record."""
    if isinstance(index, pd.DatetimeIndex):
        dates = drawing("matplotlib.dates")
        locator = dates.AutoDateLocator()
        ax.xaxis.set_major_locator(locator)
        ax.xaxis.set_major_formatter(dates.ConciseDateFormatter(locator))
        ax.set_xlabel("date")
    else:
        ax.set_xlabel(plain(index.name or "record"))


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


def hold_outliers(ax: Axes, keep: Iterable[float] = (), also: Iterable[Array] = (), direction: str = "y") -> None:
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
    middle = np.concatenate([*middles, [*keep]])
    low, high = middle.min() - np.ptp(middle), middle.max() + np.ptp(middle)
    if not any((values < low).any() or (values > high).any() for values in columns):
        return
    seen = np.concatenate([*columns, *also, [*keep]])
    seen = seen[(seen >= low) & (seen <= high)]
    margin = 0.05 * np.ptp(seen)
    lowest = seen.min() - margin if seen.min() not in keep else seen.min()
    getattr(ax, f"set_{direction}lim")(lowest, seen.max() + margin)
    for is_upper in (False, True):
        beyond = [values > high if is_upper else values < low for values in columns]
        if np.any(np.concatenate(beyond)):
            _mark_edge(ax, lines, columns, beyond, direction, is_upper)


def middle_of(values: Array) -> Array:
    """All values but 2 % at either end, in order; of values that hardly differ otherwise, and of few values, all."""
    known = np.sort(values[np.isfinite(values)])
    n_few = int(np.ceil(0.02 * len(known))) if len(known) >= 10 else 0
    middle = known[n_few : len(known) - n_few]
    return middle if middle[0] < middle[-1] else known


def _mark_edge(
    ax: Axes, lines: list[Line2D], columns: list[Array], beyond: list[Array], direction: str, is_upper: bool
) -> None:
    """A triangle at the edge for each point beyond it, in the colour of its line, and a text that counts them."""
    marker, edge, place = EDGES[direction, is_upper]
    transform = ax.get_xaxis_transform() if direction == "y" else ax.get_yaxis_transform()
    other = "x" if direction == "y" else "y"
    for line, rows in zip(lines, beyond, strict=True):
        along = getattr(line, f"get_{other}data")(orig=False)[rows]
        points = {other: along, direction: np.full(len(along), edge)}
        style = {"linestyle": "", "marker": marker, "markersize": 5, "color": line.get_color(), "markeredgewidth": 0}
        style["rasterized"] = len(along) > DENSE
        ax.plot(points["x"], points["y"], transform=transform, gid=f"beyond {direction}", **style)
    far = np.concatenate([values[rows] for values, rows in zip(columns, beyond, strict=True)])
    text = f"{len(far)} beyond, {'up' if is_upper else 'down'} to {far.max() if is_upper else far.min():.4g}"
    _write(ax, text, gid=f"beyond {direction}", **place)


def mark_not_evaluated(ax: Axes, places: dict[str, Array]) -> None:
    """Grey ticks at the bottom where records of each label are not evaluated, and a text that counts them."""
    texts = []
    for label, x in places.items():
        if len(x):
            style = {"linestyle": "", "marker": "|", "markersize": 7, "color": GREY, "markeredgewidth": 0.8}
            style["rasterized"] = len(x) > DENSE
            ax.plot(x, np.full(len(x), 0.02), transform=ax.get_xaxis_transform(), gid="not evaluated", **style)
            texts.append(f"{f'{label}: ' if len(places) > 1 else ''}{len(x)} not evaluated")
    if texts:
        _write(ax, "; ".join(texts), x=0.01, y=0.95, ha="left", va="top", gid="not evaluated")


def _write(ax: Axes, text: str, x: float, y: float, **style: object) -> None:
    """A small text in shares of the axes, on a ground that keeps points off it."""
    box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.0}
    ax.text(x, y, plain(text), transform=ax.transAxes, fontsize="small", color=GREY, bbox=box, **style)


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
    is_numeric = pd.api.types.is_numeric_dtype(index)
    return (index.to_numpy() if is_numeric else np.arange(len(index))), values


def with_breaks(x: NDArray, values: NDArray) -> tuple[NDArray, NDArray]:
    """The same with NaN in gaps of more than ten usual steps of time, so that a line breaks there."""
    if not np.issubdtype(x.dtype, np.datetime64) or len(x) < 3:
        return x, values
    steps = np.diff(x)
    usual = np.median(steps)
    before = np.flatnonzero(steps > 10 * usual)
    return np.insert(x, before + 1, x[before] + usual), np.insert(values, before + 1, np.nan, axis=0)


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
