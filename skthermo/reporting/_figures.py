"""Drawings of a report, as SVG within the page."""

from __future__ import annotations

import textwrap
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from io import BytesIO
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

from skthermo._core.arrays import Array, as_floats
from skthermo._core.estimators import import_optional
from skthermo._core.text import printable
from skthermo.fem import Structure
from skthermo.plotting import (
    DamageIndexDisplay,
    DetectorsDisplay,
    PODCurveDisplay,
    PredictionDisplay,
    StructureDisplay,
)
from skthermo.reporting._html import Html, image
from skthermo.reporting._readable import Values, csv_link, readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skthermo.reporting._findings import Finding
    from skthermo.studies import IdentifiedDamage


class HasFigure(Protocol):
    """What is drawn has a figure."""

    figure_: Figure


WIDTH, HEIGHT = 4.2, 2.8  # inches; a telephone shows them at nearly full size
LONGEST_LABEL = 28  # number of letters above which labels of a legend stand below each other
MANY_POINTS = 1000  # number of points of one line from which on it is drawn as pixels
SETTINGS = {"svg.hashsalt": "skthermo", "figure.facecolor": "white", "savefig.dpi": 150}


def draw(
    make: Callable[[], HasFigure],
    alt: str,
    title: str = "",
    *,
    height: float | None = HEIGHT,
    width: float = WIDTH,
    values: Values | None = None,
) -> Html:
    """A display as an image of fixed width, in matplotlib's own style and on white; its values can be read.

    Width and height are in inches; without a height, the drawing keeps its proportions. The index of the values is in
    the unit of the horizontal axis.
    """
    plt = import_optional("matplotlib.pyplot", extra="plot")
    others = set(plt.get_fignums())
    try:
        with plt.style.context("default"), plt.rc_context(SETTINGS):
            display = make()
            own_width, own_height = display.figure_.get_size_inches()
            display.figure_.set_size_inches(width, own_height / own_width * width if height is None else height)
            if title:
                text = textwrap.shorten(printable(title), 50, placeholder=" ...")
                display.figure_.axes[0].set_title(text, fontsize="medium", parse_math=False)
            picture = image(_svg(display.figure_), alt)
            return picture if values is None else readable(picture, values, *_places(display.figure_.axes[0], values))
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
        n_columns = 2 if max(map(len, labels)) <= LONGEST_LABEL else 1
        style = {"ncols": n_columns, "frameon": False, "fontsize": "medium" if n_columns == 2 else "small"}
        figure.legend(legend.legend_handles, labels, loc=place, **style)


def _svg(figure: Figure) -> bytes:
    """A figure as SVG: letters as shapes or, if the font lacks some, as text in fonts of the reader."""
    plt = import_optional("matplotlib.pyplot", extra="plot")
    for line in figure.findobj(lambda artist: hasattr(artist, "get_xdata")):
        line.set_rasterized(len(line.get_xdata()) > MANY_POINTS)
    drawn = b""
    for letters in ("path", "none"):
        buffer = BytesIO()
        with warnings.catch_warnings(record=True) as caught, plt.rc_context({"svg.fonttype": letters}):
            warnings.simplefilter("always")
            figure.savefig(buffer, format="svg", metadata={"Date": None})
        drawn = buffer.getvalue()
        if not any("missing from" in str(warning.message) for warning in caught):
            break
    return drawn


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


def draw_curve(finding: Finding, title: str, alt: str) -> Html:
    """Probability of detection of one family of scenarios."""
    fitted = finding.curve
    is_curve = bool(np.isfinite(fitted.slope))
    marks = is_curve and max(abs(fitted.a90), abs(fitted.a90_95)) <= finding.largest  # no extrapolation

    def make() -> PODCurveDisplay:
        display = PODCurveDisplay.from_predictions(fitted, label="fitted curve", marks=marks)
        if not is_curve:
            display.ax_.get_legend().remove()
        return display

    observed = 100 * np.asarray(fitted.n_detected) / np.asarray(fitted.n_records)
    columns = ["observed", "fitted", "lowest", "highest"] if is_curve else ["observed"]
    shares = [observed, *(100 * np.asarray(share) for share in fitted.predict(fitted.severities))][: len(columns)]
    index = pd.Index(100 * np.asarray(fitted.severities), name="severity (%)")
    table = pd.DataFrame({f"detected, {name} (%)": share for name, share in zip(columns, shares, strict=True)}, index)
    return draw(make, alt, title, height=3.2, values=Values(f"detection of {finding.family}", table))


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

    def make() -> StructureDisplay:
        display = StructureDisplay.from_structure(structure, groups=groups)
        fold_legend(display.figure_, "lower center" if structure.dimension == 3 else "outside lower center")
        return display

    return draw(make, alt, height=None, width=5.2)


def draw_identified_damage(identified: IdentifiedDamage, alt: str) -> Html:
    """Probabilities and severities, one below the other."""
    plt = import_optional("matplotlib.pyplot", extra="plot")
    height = 2.6 + 0.6 * len(identified.table)

    def make() -> DetectorsDisplay:
        axes = plt.subplots(2, 1, figsize=(WIDTH, height), layout="constrained")[1]
        display = DetectorsDisplay.from_predictions(identified.table, ax=axes)
        fold_legend(display.figure_, "outside upper center")
        return display

    return draw(make, alt, height=height)


def chosen_sensor(T: pd.DataFrame, F: pd.DataFrame) -> pd.Series:
    """The temperature that goes most closely with the frequencies."""
    X, y = as_floats(T), as_floats(F)
    both = pd.DataFrame(np.hstack([X, y])).corr().to_numpy()[: X.shape[1], X.shape[1] :]
    closeness = np.nan_to_num(np.abs(both)).mean(axis=1)
    return T.iloc[:, int(closeness.argmax())]


def identified_facts(identified: IdentifiedDamage) -> dict[str, Any]:
    """What the template of the section is given."""
    groups = Values("identified damage", identified.table.rename_axis("group"))
    return {
        "found": identified,
        "draw": draw_identified_damage,
        "saved": csv_link(groups, "Table of all groups (CSV)"),
    }
