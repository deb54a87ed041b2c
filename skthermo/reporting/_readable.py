"""Drawings whose values can be read closely: under the pointer, by a slider, and as CSV."""

from __future__ import annotations

from typing import NamedTuple
from urllib.parse import quote

import pandas as pd
from pandas.api.types import is_numeric_dtype

from skthermo._core.arrays import Array
from skthermo._core.text import printable
from skthermo.reporting._html import Html, element

DIGITS = "%.6g"


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
        float_format=DIGITS, index_label=printable(values.table.index.name or "record"), lineterminator="\n"
    )
    address = f"data:text/csv;charset=utf-8,{quote(content, safe=',:;+/')}"
    name = f"{values.name.replace(' ', '_')}.csv"
    return element("a", text, href=address, download=name, aria_label=f"{text}: {values.name}")
