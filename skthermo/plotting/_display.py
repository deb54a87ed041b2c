"""What displays share: their base, style, names, axes and legends."""

from __future__ import annotations

import re
from collections.abc import Hashable, Sequence
from dataclasses import fields
from types import ModuleType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from skthermo._core.estimators import import_optional
from skthermo._core.text import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# Okabe and Ito's palette for colour-blind readers. What is measured is blue, what is predicted or simulated orange.
BLUE, ORANGE, GREEN, PURPLE, SKY, AMBER = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00"
BLACK, GREY, LIGHT = "#000000", "#555555", "#BBBBBB"
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY, BLACK)
MARKERS = ("o", "x", "^", "s", "+", "v", "D")
LINES = ("-", "--", "-.", ":")
DENSE = 10_000  # points from which on files of vectors, such as SVG, hold them as an image
LETTER = 0.085  # inches that a letter of a legend takes


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
