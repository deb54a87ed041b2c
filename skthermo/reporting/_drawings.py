"""Drawings of a page: displays as SVG within it, whose values can be read under the pointer, and as CSV."""

from __future__ import annotations

import textwrap
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from io import BytesIO
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol
from urllib.parse import quote

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

from skthermo._core.arrays import Array
from skthermo._core.estimators import import_optional
from skthermo._core.text import printable
from skthermo._core.warnings import collected
from skthermo.fem import Structure
from skthermo.plotting import (
    DamageIndexDisplay,
    DetectorsDisplay,
    PredictionDisplay,
    StructureDisplay,
)
from skthermo.reporting._page import Html, element

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skthermo.studies import IdentifiedDamage


class Values(NamedTuple):
    """The table behind a drawing: its index is on the horizontal axis.

    ``name`` is that of the CSV file. ``is_scatter`` says that a row is a point of the first column, and not a place on
    the horizontal axis.
    """

    name: str
    table: pd.DataFrame
    is_scatter: bool = False


def readable(picture: Html, values: Values, x: Array, y: Array | None = None) -> Html:
    """A picture with its values; ``x`` and ``y`` are places of the rows as shares of its width and height, from the top
    left corner. Rows that are out of view are in the CSV alone."""
    places = {"x": x} if y is None else {"x": x, "y": y}
    data = {f"data_{name}": " ".join(f"{1000 * share:.0f}" for share in shares) for name, shares in places.items()}
    ends = {"type": "range", "min": 0, "max": max(len(values.table) - 1, 0), "value": 0}
    slider = element("input", **ends, hidden="", aria_label=f"Values: {values.name}")
    mark = element("span", class_="mark" if y is None else "mark point", hidden="", aria_hidden="true")
    below = element("div", slider, element("output", aria_live="off"), csv_link(values), class_="values")
    return element("div", element("div", picture, mark, class_="picture"), below, class_="readable", **data)


def csv_link(values: Values, text: str = "CSV") -> Html:
    """A link that saves the table behind a drawing."""
    table = values.table.rename(columns=printable)
    if isinstance(table.index, pd.DatetimeIndex):
        times = table.index.tz_localize(None)
        has_hours = (times != times.normalize()).any()
        table = table.set_axis(times.strftime("%Y-%m-%d %H:%M" if has_hours else "%Y-%m-%d"))
    elif not is_numeric_dtype(table.index):
        table = table.set_axis([printable(name) for name in table.index])
    content = table.to_csv(
        float_format="%.6g", index_label=printable(values.table.index.name or "record"), lineterminator="\n"
    )
    address = f"data:text/csv;charset=utf-8,{quote(content, safe=',:;+/')}"
    name = f"{values.name.replace(' ', '_')}.csv"
    return element("a", text, href=address, download=name, aria_label=f"{text}: {values.name}")


class HasFigure(Protocol):
    """What is drawn has a figure."""

    figure_: Figure


def draw(
    make: Callable[[], HasFigure],
    alt: str,
    title: str = "",
    *,
    height: float | None = 2.8,
    width: float = 4.2,
    values: Values | None = None,
) -> Html:
    """A display as an image of fixed width, in matplotlib's own style and on white; its values can be read.

    Width and height are in inches, so that a telephone shows it at nearly full size; without a height, the drawing
    keeps its proportions. The index of the values is in the unit of the horizontal axis. Without matplotlib, what the
    image shows is said, and its values can be saved.
    """
    try:
        plt = import_optional("matplotlib.pyplot", extra="plot")
    except ImportError:
        return element("p", alt, " ", "" if values is None else csv_link(values))
    others = set(plt.get_fignums())
    settings = {"svg.hashsalt": "skthermo", "figure.facecolor": "white", "savefig.dpi": 150}
    try:
        with plt.style.context("default"), plt.rc_context(settings):
            figure = make().figure_
            own_width, own_height = figure.get_size_inches()
            figure.set_size_inches(width, own_height / own_width * width if height is None else height)
            if title:
                text = textwrap.shorten(printable(title), 50, placeholder=" ...")
                figure.axes[0].set_title(text, fontsize="medium", parse_math=False)
            source = f"data:image/svg+xml;base64,{b64encode(_svg(figure)).decode()}"
            picture = element("img", src=source, alt=alt)
            return picture if values is None else readable(picture, values, *_places(figure.axes[0], values))
    finally:
        for number in set(plt.get_fignums()) - others:
            plt.close(number)


def fold_legend(figure: Figure, place: str) -> None:
    """Put the legends of a figure into one place and at most two columns, so that they fit a narrow drawing."""
    for legend in [*figure.legends, *(ax.get_legend() for ax in figure.axes)]:
        if legend is None:
            continue
        labels = [text.get_text() for text in legend.get_texts()]
        legend.remove()
        n_columns = 2 if max(map(len, labels)) <= 28 else 1  # letters, of which two labels fit beside each other
        style = {"ncols": n_columns, "frameon": False, "fontsize": "medium" if n_columns == 2 else "small"}
        figure.legend(legend.legend_handles, labels, loc=place, **style)


def _svg(figure: Figure) -> bytes:
    """A figure as SVG: letters as shapes or, if the font lacks some, as text in fonts of the reader."""
    fonts, texts = (import_optional(f"matplotlib.{name}", extra="plot") for name in ("font_manager", "text"))
    for line in figure.findobj(lambda artist: hasattr(artist, "get_xdata")):
        line.set_rasterized(len(line.get_xdata()) > 1000)  # as an image, which is smaller
    letters = {ord(letter) for one in figure.findobj(texts.Text) for letter in one.get_text() if letter.isprintable()}
    has_all = letters <= set(fonts.get_font(fonts.findfont(fonts.FontProperties())).get_charmap())
    drawn = BytesIO()
    plt = import_optional("matplotlib.pyplot", extra="plot")
    with plt.rc_context({"svg.fonttype": "path" if has_all else "none"}), collected(drop_others=True):
        figure.savefig(drawn, format="svg", metadata={"Date": None})
    return drawn.getvalue()


def _places(ax: Axes, values: Values) -> tuple[Array, Array | None]:
    """Where the rows of values are drawn, as shares of the figure from its top left corner."""
    index = values.table.index
    if isinstance(index, pd.DatetimeIndex):
        index = index.tz_localize(None)
    across = index if isinstance(index, pd.DatetimeIndex) or is_numeric_dtype(index) else np.arange(len(index))
    up = values.table.iloc[:, 0].to_numpy(dtype=float) if values.is_scatter else np.zeros(len(index))
    pixels = ax.transData.transform(np.column_stack([ax.convert_xunits(np.asarray(across)), up]))
    x, y = ax.figure.transFigure.inverted().transform(pixels).T
    return x, np.clip(1 - y, 0, 1) if values.is_scatter else None


def draw_mode(
    measured: pd.Series, alt: str, predicted: pd.Series | None = None, temperature: pd.Series | None = None
) -> Html:
    """A measured frequency over time, or a measured and a predicted one over a temperature."""
    name, tables = str(measured.name), [None if one is None else one.to_frame() for one in (measured, predicted)]
    make = partial(PredictionDisplay.from_predictions, *tables, temperature=temperature)
    if predicted is None or temperature is None:
        table = measured.to_frame(f"{name} (Hz)").rename_axis(measured.index.name or "date")
        return draw(make, alt, height=2.2, values=Values(f"frequency {name} over time", table))
    both = pd.DataFrame({f"{name} measured (Hz)": measured, f"{name} predicted (Hz)": predicted})
    both = both.set_axis(pd.Index(temperature, name=f"{temperature.name} (°C)"))
    return draw(make, alt, values=Values(f"frequency {name} over temperature", both, is_scatter=True))


def draw_damage_indices(shown: Mapping[str, pd.Series], threshold: float, onset: object, alt: str) -> Html:
    """Damage index of some scenarios over time, and the threshold of the alarm."""

    def make() -> DamageIndexDisplay:
        display = DamageIndexDisplay.from_predictions(shown, threshold, onset=onset, label="damage index")
        fold_legend(display.figure_, "outside upper center")
        return display

    table = pd.DataFrame(dict(shown)).assign(threshold=threshold)
    values = Values(f"damage index {list(shown)[-1]}", table.rename_axis("date"))
    return draw(make, alt, height=3.2, values=values)


def draw_groups(structure: Structure, groups: Sequence[str], alt: str) -> Html:
    """Where the damage groups are."""
    return _draw_structure(structure, alt, 5.2, groups=groups)


def draw_detectable(structure: Structure, losses: Mapping[str, float], alt: str) -> Html:
    """The smallest loss of stiffness of each member's group that raises an alarm."""
    percents = {name: 100 * loss for name, loss in losses.items()}
    return _draw_structure(structure, alt, 6.2, values=percents, label="smallest loss (%)")


def _draw_structure(structure: Structure, alt: str, width: float, **options: Any) -> Html:
    def make() -> StructureDisplay:
        display = StructureDisplay.from_structure(structure, **options)
        fold_legend(display.figure_, "lower center" if structure.dimension == 3 else "outside lower center")
        return display

    return draw(make, alt, height=None, width=width)


def losses_on(structure: Structure | None, losses: Mapping[str, float]) -> dict[str, float]:
    """Losses that raise an alarm, of groups that can be drawn."""
    groups = [] if structure is None else structure.groups
    return {name: loss for name, loss in losses.items() if name in groups and np.isfinite(loss)}


def draw_identified_damage(identified: IdentifiedDamage, alt: str) -> Html:
    """Probabilities and severities, one below the other."""
    height = 2.6 + 0.6 * len(identified.table)

    def make() -> DetectorsDisplay:
        plt = import_optional("matplotlib.pyplot", extra="plot")
        axes = plt.subplots(2, 1, figsize=(4.2, height), layout="constrained")[1]
        display = DetectorsDisplay.from_predictions(identified.table, ax=axes)
        fold_legend(display.figure_, "outside upper center")
        return display

    return draw(make, alt, height=height)


def identified_facts(identified: IdentifiedDamage) -> dict[str, Any]:
    """What the template of the section is given."""
    groups = Values("identified damage", identified.table.rename_axis("group"))
    return {
        "found": identified,
        "draw": draw_identified_damage,
        "saved": csv_link(groups, "Table of all groups (CSV)"),
    }
