"""Axes that a few outliers do not stretch: marks at the edges count what lies beyond, or is not evaluated."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from skthermo._tables.arrays import Array
from skthermo.plotting._style import GREY, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

FEW = 0.02  # share of the points of a line, at either end, that may lie beyond an axis
FEWEST = 10  # points of a line from which on it may have outliers
MARGIN = 0.05  # empty share of the axis next to its edges
BEYOND = "beyond"
"""Name (gid) of the marks at the edges."""

EDGES: dict[tuple[str, bool], tuple[str, float, dict[str, object]]] = {
    ("y", False): ("v", 0.0, {"x": 0.99, "y": 0.03, "ha": "right", "va": "bottom"}),
    ("y", True): ("^", 1.0, {"x": 0.99, "y": 0.96, "ha": "right", "va": "top"}),
    ("x", False): ("<", 0.0, {"x": 0.02, "y": 0.5, "ha": "left", "va": "center", "rotation": 90}),
    ("x", True): (">", 1.0, {"x": 0.98, "y": 0.5, "ha": "right", "va": "center", "rotation": 90}),
}
"""Marker of an edge, its coordinate in shares of the axes, and how its text stands."""


def hold_outliers(ax: Axes, keep: Iterable[float] = (), also: Iterable[Array] = (), direction: str = "y") -> None:
    """End an axis where the points of its lines end but for a few far ones; these are marked at the edge and counted.

    Far is what would make the axis more than three times as long. ``keep`` are values that stay in view, ``also`` those
    of bands, and ``direction`` names the axis, "x" or "y".
    """
    for mark in [*ax.lines, *ax.texts]:
        if mark.get_gid() == f"{BEYOND} {direction}":
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
    margin = MARGIN * np.ptp(seen)
    lowest = seen.min() - margin if seen.min() not in keep else seen.min()
    getattr(ax, f"set_{direction}lim")(lowest, seen.max() + margin)
    for is_upper in (False, True):
        beyond = [values > high if is_upper else values < low for values in columns]
        if np.any(np.concatenate(beyond)):
            _mark_edge(ax, lines, columns, beyond, direction, is_upper)


def middle_of(values: Array) -> Array:
    """All values but a few at either end, in order; of values that hardly differ otherwise, and of few values, all."""
    known = np.sort(values[np.isfinite(values)])
    n_few = int(np.ceil(FEW * len(known))) if len(known) >= FEWEST else 0
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
        ax.plot(points["x"], points["y"], transform=transform, gid=f"{BEYOND} {direction}", **style)
    far = np.concatenate([values[rows] for values, rows in zip(columns, beyond, strict=True)])
    text = f"{len(far)} beyond, {'up' if is_upper else 'down'} to {far.max() if is_upper else far.min():.4g}"
    _write(ax, text, gid=f"{BEYOND} {direction}", **place)


def mark_not_evaluated(ax: Axes, places: dict[str, Array], noun: str = "") -> None:
    """Grey ticks at the bottom where records of each label are not evaluated, and a text that counts them."""
    texts = []
    for label, x in places.items():
        if len(x):
            style = {"linestyle": "", "marker": "|", "markersize": 7, "color": GREY, "markeredgewidth": 0.8}
            ax.plot(x, np.full(len(x), 0.02), transform=ax.get_xaxis_transform(), gid="not evaluated", **style)
            nouns = f" {noun}{'' if len(x) == 1 else 's'}" if noun else ""
            texts.append(f"{f'{label}: ' if len(places) > 1 else ''}{len(x)}{nouns} not evaluated")
    if texts:
        _write(ax, "; ".join(texts), x=0.01, y=0.05, ha="left", va="bottom", gid="not evaluated")


def _write(ax: Axes, text: str, x: float, y: float, **style: object) -> None:
    """A small text in shares of the axes, on a ground that keeps points off it."""
    box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.0}
    ax.text(x, y, plain(text), transform=ax.transAxes, fontsize="small", color=GREY, bbox=box, **style)
