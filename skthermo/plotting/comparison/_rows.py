"""Panels with one row for each detector, and axes of rates."""

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from skthermo._arrays import Array
from skthermo._formatting import printable
from skthermo.plotting._axes import LETTER, Axes
from skthermo.plotting._style import GREY, label_of, plain

ROW, MARGINS = 0.26, 1.5
"""Inches that a row takes, and all that is above and below the rows."""

PERCENT = (0, 0.1, 0.5, 1, 2, 5, 10, 20, 30, 40, 60, 80, 100)  # ticks of an axis of small rates
MARGIN = 0.02  # share of an axis of small rates that is below 0
CLOSEST = 0.07  # share of the axis that two ticks are apart at least
LONGEST_NOTE = 45  # number of letters above which a note in a row is cut


def read_table(results: Any, needed: Sequence[str], what: str) -> pd.DataFrame:
    """A table with one or more rows and the columns that are needed."""
    columns = list(results.columns) if isinstance(results, pd.DataFrame) else []
    missing = [name for name in needed if name not in columns]
    if missing or not len(results):
        got = f"lacks the columns {missing}" if columns and missing else f"is {results!r:.200}"
        raise ValueError(f"{what} {got}; expected one row or more with {list(needed)}")
    return results


def places_of(names: Sequence[Hashable], groups: Mapping[Any, Any] | None = None) -> dict[tuple[Any, Any], int]:
    """Height of each row from above by group and detector; the row (group, None) is the heading of a group.

    Groups come in the order of their names in the mapping, detectors without a group before them.
    """
    groups = groups or {}
    unknown = [name for name in groups if name not in names]
    if unknown:
        raise ValueError(f"groups names the detectors {unknown}; expected some of {list(names)}")
    rows: list[tuple[Any, Any]] = [(None, name) for name in names if name not in groups]
    for group in dict.fromkeys(groups.values()):
        rows += [(group, None), *((group, name) for name in names if name in groups and groups[name] == group)]
    return {row: height for height, row in enumerate(rows)}


def size_of_rows(places: Mapping[tuple[Any, Any], int], n_columns: int) -> tuple[float, float]:
    """Width and height in inches of a panel beside others, left of which the names stand."""
    n_letters = max(len(label_of(name)) for _, name in places if name is not None)
    return 3.6 + LETTER * n_letters / n_columns, max(ROW * len(places) + MARGINS, 2.4)


def name_rows(ax: Axes, places: Mapping[tuple[Any, Any], int]) -> None:
    """Names of the detectors, headings of groups in bold type, and an empty frame; names stand left of the panels."""
    texts = [label_of(group) if name is None else label_of(name) for group, name in places]
    ax.set_yticks(list(places.values()), texts)
    for text, (_, name) in zip(ax.get_yticklabels(), places, strict=True):
        text.set_fontweight("bold" if name is None else "normal")
    ax.set_ylim(len(places) - 0.4, -0.6)
    cell = ax.get_subplotspec()
    ax.tick_params(axis="y", length=0, labelleft=cell is None or cell.is_first_col())
    for side in ("top", "right", "left"):
        ax.spines[side].set_visible(False)
    ax.grid(axis="x", color="#DDDDDD", linewidth=0.6)
    ax.set_axisbelow(True)


def note(ax: Axes, height: float, text: str, is_right: bool = True) -> None:
    """A small text at an end of a row."""
    text = printable(text)
    text = text if len(text) <= LONGEST_NOTE else f"{text[:LONGEST_NOTE].rstrip()} ..."
    place = {"x": 0.99 if is_right else 0.01, "ha": "right" if is_right else "left"}
    style = {"fontsize": "x-small", "color": GREY, "va": "center", "clip_on": True, "in_layout": False}
    ax.text(y=height, s=plain(text), transform=ax.get_yaxis_transform(), **place, **style)


def small_rates(ax: Axes, drawn: Array, direction: str = "x") -> None:
    """An axis from 0 to the largest of some rates in percent, whose square root is even: small ones are told apart."""
    largest = float(np.clip(1.08 * np.nanmax(drawn), 2.0, 101.0))
    functions = (lambda value: np.sign(value) * np.sqrt(np.abs(value)), lambda root: root * np.abs(root))
    ticks: list[float] = []
    for value in PERCENT:
        if value <= largest and (not ticks or np.sqrt(value) - np.sqrt(ticks[-1]) > CLOSEST * np.sqrt(largest)):
            ticks.append(value)
    _scale(ax, direction, functions, (-(MARGIN**2) * largest, largest), ticks)


def both_ends(ax: Axes, direction: str) -> None:
    """An axis of rates in percent, stretched near 0 and near 100 (arcsine of the square root)."""
    functions = (
        lambda value: np.arcsin(np.sqrt(np.clip(value, 0, 100) / 100)),
        lambda angle: 100 * np.sin(np.clip(angle, 0, np.pi / 2)) ** 2,
    )
    _scale(ax, direction, functions, (0.0, 100.0), [0, 2, 10, 30, 50, 70, 90, 98, 100])


def _scale(ax: Axes, direction: str, functions: Any, limits: tuple[float, float], ticks: Sequence[float]) -> None:
    getattr(ax, f"set_{direction}scale")("function", functions=functions)
    getattr(ax, f"set_{direction}lim")(*limits)
    getattr(ax, f"set_{direction}ticks")(ticks, [f"{value:g}" for value in ticks])


def in_percent(values: Any) -> Array:
    """Shares in percent."""
    return 100 * np.asarray(values, dtype=float)
