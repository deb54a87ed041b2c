"""Drawings of a page: displays as SVG within it, whose values can be read under the pointer, and as CSV."""

from __future__ import annotations

import textwrap
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from io import BytesIO
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import quote

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

from skthermo._core.estimators import import_optional
from skthermo._core.text import printable
from skthermo._core.warnings import collected
from skthermo.fem import Structure
from skthermo.plotting import DamageIndexDisplay, DetectorsDisplay, PredictionDisplay, StructureDisplay

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skthermo.studies import IdentifiedDamage


class Drawing(NamedTuple):
    """A picture, what it shows in words, and the table behind it, as addresses of data.

    ``x`` and ``y`` are places of the rows in thousandths of the picture's width and height, from the top left corner.
    Without a table ``csv`` is empty, without matplotlib ``source`` is.
    """

    alt: str
    source: str = ""
    name: str = ""
    csv: str = ""
    n_rows: int = 0
    x: str = ""
    y: str = ""


def csv_address(table: pd.DataFrame) -> str:
    """A table as CSV, within an address."""
    index = table.index
    if isinstance(index, pd.DatetimeIndex):
        times = index.tz_localize(None)
        index = times.strftime("%Y-%m-%d %H:%M" if (times != times.normalize()).any() else "%Y-%m-%d")
    elif not is_numeric_dtype(index):
        index = index.map(printable)
    shown = table.rename(columns=printable).set_axis(index)
    label = printable(table.index.name or "record")
    content = shown.to_csv(float_format="%.6g", index_label=label, lineterminator="\n")
    return f"data:text/csv;charset=utf-8,{quote(content, safe=',:;+/')}"


def draw(
    make: Callable[..., Any],
    alt: str,
    title: str = "",
    *,
    height: float | None = 2.8,
    width: float = 4.2,
    name: str = "",
    table: pd.DataFrame | None = None,
    is_scatter: bool = False,
    legend: str | None = "outside upper center",
) -> Drawing:
    """A display as an image of fixed width, in matplotlib's own style and on white; its values can be read.

    Width and height are in inches, so that a telephone shows it at nearly full size; without a height, the drawing
    keeps its proportions, with room for a legend. The index of the table is in the unit of the horizontal axis; in a
    scatter plot, a row is a point of its first column. Without matplotlib, what the image shows is said, and its values
    can be saved.
    """
    drawn = Drawing(alt)
    if table is not None:
        drawn = drawn._replace(name=name, csv=csv_address(table), n_rows=len(table))
    try:
        plt = import_optional("matplotlib.pyplot", extra="plot")
    except ImportError:
        return drawn
    others = set(plt.get_fignums())
    settings = {"svg.hashsalt": "skthermo", "figure.facecolor": "white", "savefig.dpi": 150}
    try:
        with plt.style.context("default"), plt.rc_context(settings):
            figure = make().figure_
            own_width, own_height = figure.get_size_inches()
            figure.set_size_inches(width, own_height / own_width * width + 0.5 if height is None else height)
            _fold_legend(figure, legend)
            if title:
                text = textwrap.shorten(printable(title), 50, placeholder=" ...")
                figure.axes[0].set_title(text, fontsize="medium", parse_math=False)
            drawn = drawn._replace(source=f"data:image/svg+xml;base64,{b64encode(_svg(figure)).decode()}")
            return drawn if table is None else drawn._replace(**_places(figure.axes[0], table, is_scatter))
    finally:
        for number in set(plt.get_fignums()) - others:
            plt.close(number)


def _fold_legend(figure: Figure, place: str | None) -> None:
    """Put the legends of a figure into one place and at most two columns, so that they fit a narrow drawing."""
    for one in [*figure.legends, *(ax.get_legend() for ax in figure.axes if ax.get_legend())]:
        labels = [text.get_text() for text in one.get_texts()]
        one.remove()
        is_wide = max(map(len, labels)) > 28  # letters, of which two labels fit beside each other
        style = {"ncols": 1 if is_wide else 2, "frameon": False, "fontsize": "small" if is_wide else "medium"}
        if place is not None:
            figure.legend(one.legend_handles, labels, loc=place, **style)


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


def _places(ax: Axes, table: pd.DataFrame, is_scatter: bool) -> dict[str, str]:
    """Where the rows of a table are drawn."""
    index = table.index.tz_localize(None) if isinstance(table.index, pd.DatetimeIndex) else table.index
    is_placed = isinstance(index, pd.DatetimeIndex) or is_numeric_dtype(index)
    across = ax.convert_xunits(np.asarray(index if is_placed else range(len(index))))
    up = table.iloc[:, 0].to_numpy(dtype=float) if is_scatter else np.zeros(len(table))
    pixels = ax.transData.transform(np.column_stack([across, up]))
    x, y = 1000 * ax.figure.transFigure.inverted().transform(pixels).T
    shares = {"x": x, "y": np.clip(1000 - y, 0, 1000)} if is_scatter else {"x": x}
    return {name: " ".join(f"{share:.0f}" for share in places) for name, places in shares.items()}


def draw_mode(
    measured: pd.Series, alt: str, predicted: pd.Series | None = None, temperature: pd.Series | None = None
) -> Drawing:
    """A measured frequency over time, or a measured and a predicted one over a temperature."""
    name, tables = str(measured.name), [None if one is None else one.to_frame() for one in (measured, predicted)]
    make = partial(PredictionDisplay.from_predictions, *tables, temperature=temperature)
    if predicted is None or temperature is None:
        table = measured.to_frame(f"{name} (Hz)").rename_axis(measured.index.name or "date")
        return draw(make, alt, height=2.2, name=f"frequency {name} over time", table=table)
    both = pd.DataFrame({f"{name} measured (Hz)": measured, f"{name} predicted (Hz)": predicted})
    both = both.set_axis(pd.Index(temperature, name=f"{temperature.name} (°C)"))
    return draw(make, alt, name=f"frequency {name} over temperature", table=both, is_scatter=True)


def draw_damage_indices(shown: Mapping[str, pd.Series], threshold: float, onset: object, alt: str) -> Drawing:
    """Damage index of some scenarios over time, and the threshold of the alarm."""
    make = partial(DamageIndexDisplay.from_predictions, shown, threshold, onset=onset, label="damage index")
    table = pd.DataFrame(dict(shown)).assign(threshold=threshold).rename_axis("date")
    return draw(make, alt, height=3.2, name=f"damage index {list(shown)[-1]}", table=table)


def draw_structure(
    structure: Structure, alt: str, groups: Sequence[str] | None = None, losses: Mapping[str, float] | None = None
) -> Drawing:
    """Where damage groups are, or the smallest loss of stiffness of each member's group that raises an alarm."""
    values = None if losses is None else {name: 100 * loss for name, loss in losses.items()}
    make = partial(StructureDisplay.from_structure, structure, values, groups=groups, label="smallest loss (%)")
    return draw(make, alt, height=None, width=5.2 if losses is None else 6.2, legend="outside lower center")


def identified_facts(identified: IdentifiedDamage) -> dict[str, Any]:
    """What the template of the section on identified damage is given: probabilities and severities are drawn one below
    the other."""
    height = 2.6 + 0.6 * len(identified.table)

    def make() -> DetectorsDisplay:
        plt = import_optional("matplotlib.pyplot", extra="plot")
        axes = plt.subplots(2, 1, figsize=(4.2, height), layout="constrained")[1]
        return DetectorsDisplay.from_predictions(identified.table, ax=axes)

    saved = Drawing("", name="identified damage", csv=csv_address(identified.table.rename_axis("group")))
    return {"found": identified, "draw": partial(draw, make, height=height), "saved": saved}
