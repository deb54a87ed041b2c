"""Small drawings of a damage index, written as SVG in the colours of the page: a hundred of them take a second."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from skthermo._core.arrays import Array
from skthermo._core.text import significant
from skthermo.reporting._html import Html, element, joined
from skthermo.reporting._readable import Values, readable

WIDTH, HEIGHT, LEFT, BOTTOM, TOP = 420, 190, 44, 24, 20  # of a chart, and its margins, in units of its view box
LINE_WIDTH, LINE_HEIGHT = 132, 30  # of a line of a table
HIGHEST = 5.0  # times the threshold, beyond which points stand at the upper edge
WEEK = 7


def chart(
    index: pd.Series,
    is_alarm: pd.Series,
    threshold: float,
    alt: str,
    events: Iterable[tuple[pd.Timestamp, pd.Timestamp]] = (),
) -> Html:
    """Highest damage index of each day as dots over its threshold; ticks for days not evaluated, events shaded.

    ``index`` has a row for each day, NaN where none was evaluated, on midnights without a time zone.
    """
    days, values = index.index, index.to_numpy(dtype=float)
    top = _highest(values, threshold)
    x = LEFT + (WIDTH - LEFT) * (np.arange(len(days)) + 0.5) / len(days)
    y = _heights(values, top)
    known, alarms = np.isfinite(values), is_alarm.to_numpy(dtype=bool)
    step = (WIDTH - LEFT) / len(days)
    shades = []
    for start, end in events:
        first, last = (float(np.clip((t - days[0]) / pd.Timedelta("1D"), 0, len(days))) for t in (start, end))
        place = {"x": _number(LEFT + step * first), "width": _number(max(step * (last - first), 1.0))}
        shades.append(element("rect", class_="event", y=TOP, height=HEIGHT - BOTTOM - TOP, **place))
    level = _number(_heights(np.array([threshold]), top)[0])
    beyond = int((values > top).sum())
    far = f"{beyond} beyond, up to {significant(np.nanmax(values), 3)}" if beyond else ""
    parts = [
        *shades,
        _path("axis", f"M{LEFT} {TOP}V{HEIGHT - BOTTOM}H{WIDTH}"),
        _path("threshold", f"M{LEFT} {level}H{WIDTH}"),
        _path("dots", _dots(x[known & ~alarms], y[known & ~alarms])),
        _path("dots above", _dots(x[known & alarms], y[known & alarms])),
        _path("gaps", "".join(f"M{_number(place)} {HEIGHT - BOTTOM}v-7" for place in x[~known])),
        _label(LEFT - 5, HEIGHT - BOTTOM, "0", "end"),
        _label(LEFT - 5, float(level) + 4, significant(threshold, 3), "end"),
        _label(WIDTH, TOP - 8, far, "end"),
        *_months(days, step),
    ]
    box = {"viewBox": f"0 0 {WIDTH} {HEIGHT}", "class_": "chart", "role": "img", "aria_label": alt}
    picture = element("svg", joined(part for part in parts if part), **box)
    table = pd.DataFrame({"highest of the day": values, "threshold": threshold}, pd.Index(days, name="date"))
    return readable(picture, Values("damage index of the last year", table), x / WIDTH)


def line(index: Sequence[float], threshold: float) -> Html:
    """Highest index of each week as a line, with its threshold; nothing where none was evaluated."""
    values = np.asarray(index, dtype=float)
    values = np.pad(values, (-len(values) % WEEK, 0), constant_values=np.nan).reshape(-1, WEEK)
    weeks = np.fmax.reduce(values, axis=1, initial=-np.inf)
    weeks = np.where(np.isfinite(weeks), weeks, np.nan)
    if not np.isfinite(weeks).any():
        return Html()
    top = _highest(weeks, threshold)
    places = np.linspace(2, LINE_WIDTH - 2, len(weeks)) if len(weeks) > 1 else np.array([LINE_WIDTH / 2])
    heights = 2 + (LINE_HEIGHT - 4) * (1 - np.minimum(weeks, top) / top)
    level = _number(2 + (LINE_HEIGHT - 4) * (1 - threshold / top))
    above = weeks > threshold
    drawn = [
        _path("threshold", f"M0 {level}H{LINE_WIDTH}"),
        _path("line", _line(places, heights)),
        _path("dots above", _dots(places[above], heights[above])),
    ]
    box = {"viewBox": f"0 0 {LINE_WIDTH} {LINE_HEIGHT}", "class_": "spark", "aria_hidden": "true"}
    return element("svg", *(part for part in drawn if part), **box)


def _highest(values: Array, threshold: float) -> float:
    """Upper end of the vertical axis."""
    highest = np.nanmax(values, initial=0.0)
    return float(np.clip(1.05 * highest, 1.2 * threshold, HIGHEST * threshold))


def _heights(values: Array, top: float) -> Array:
    return TOP + (HEIGHT - BOTTOM - TOP) * (1 - np.minimum(values, top) / top)


def _months(days: pd.DatetimeIndex, step: float) -> list[Html]:
    """Names of months below the axis, every third one of a year, with the year at the first."""
    firsts = np.flatnonzero(days.day == 1)
    chosen = firsts[:: max(1, -(-len(firsts) // 5))]
    months = days[chosen]
    names = [
        f"{day:%b %Y}" if number == 0 or day.year != months[number - 1].year else f"{day:%b}"
        for number, day in enumerate(months)
    ]
    return [
        _label(LEFT + step * place, HEIGHT - 6, name, "start" if LEFT + step * place < WIDTH - 60 else "end")
        for place, name in zip(chosen, names, strict=True)
    ]


def _dots(x: Array, y: Array) -> str:
    """Lines of no length, which a round cap makes dots."""
    return "".join(f"M{_number(a)} {_number(b)}h0" for a, b in zip(x, y, strict=True))


def _line(x: Array, y: Array) -> str:
    """A line with breaks where values are missing."""
    known = np.isfinite(y)
    begins = known & ~np.append(False, known[:-1])
    return "".join(
        f"{'M' if begin else 'L'}{_number(a)} {_number(b)}{'h0' if begin else ''}"
        for a, b, begin in zip(x[known], y[known], begins[known], strict=True)
    )


def _path(name: str, d: str) -> Html:
    return element("path", class_=name, d=d) if d else Html()


def _label(x: float, y: float, text: str, anchor: str) -> Html:
    return element("text", text, x=_number(x), y=_number(y), text_anchor=anchor) if text else Html()


def _number(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")
