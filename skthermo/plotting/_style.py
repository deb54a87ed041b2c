"""Colours, markers and labels that all displays share."""

import re
from collections.abc import Hashable
from types import ModuleType

from skthermo._tables.text import printable
from skthermo._validation import import_optional

BLUE, ORANGE, GREEN, PURPLE, SKY, AMBER = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00"
BLACK, GREY, LIGHT = "#000000", "#555555", "#BBBBBB"

COLOURS = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY, BLACK)
"""Okabe and Ito's palette for colour-blind readers. What is measured is blue, what is predicted or simulated orange."""

MARKERS = ("o", "x", "^", "s", "+", "v", "D")
LINES = ("-", "--", "-.", ":")
LONGEST_NAME = 30  # number of letters above which a name is shortened
DAMAGE_INDEX = "damage index (Mahalanobis, unsquared)"


def drawing(module: str) -> ModuleType:
    """A module of matplotlib, imported when something is drawn."""
    return import_optional(module, extra="plot")


def pyplot() -> ModuleType:
    """Matplotlib's pyplot."""
    return drawing("matplotlib.pyplot")


def shortened(name: Hashable) -> str:
    """A name for a legend, a title or a tick: a very long one loses its middle, dollar signs stay as they are."""
    text = printable(name)
    if len(text) > LONGEST_NAME:
        text = f"{text[: LONGEST_NAME // 2].rstrip()} ... {text[-LONGEST_NAME // 3 :].lstrip()}"
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


def with_unit(quantity: str, unit: str) -> str:
    """Label of an axis."""
    return plain(f"{quantity} ({unit})" if unit else quantity)


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
    }


def line_style(number: int, dashes: int = 0) -> dict[str, object]:
    """Options of plot for lines: colour, and dashes that tell them apart in greyscale too."""
    return {"linestyle": LINES[dashes % len(LINES)], "color": COLOURS[number % len(COLOURS)], "linewidth": 1.0}
