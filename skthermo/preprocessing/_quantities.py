"""What a column holds: its unit says it first, then whole words of its name, then its values.

The tables of units and words are in ``quantities.toml``. What none of them tells stays open.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple
from unicodedata import combining, normalize

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from skthermo._core.arrays import Array
from skthermo._core.frames import MISSING_CODES

TEMPERATURE, FREQUENCY, OPEN = "temperature", "frequency", ""
BRACKETS = re.compile(r"[\[({<]([^\])}>]*)[\])}>]")


class Unit(NamedTuple):
    """A unit, its quantity, and how values become degrees Celsius or Hz: (value - zero) * factor."""

    name: str
    kind: str
    zero: float = 0.0
    factor: float = 1.0


@cache
def _table(section: str) -> dict[str, Any]:
    """A section of the tables: units by spelling, words by meaning beside symbols, else the meaning of each word."""
    text = files("skthermo.preprocessing").joinpath("quantities.toml").read_text("utf-8")
    table = tomllib.loads(text)[section]
    if section == "units":
        kinds = {Unit(name, **{key: one[key] for key in one if key != "as"}): one["as"] for name, one in table.items()}
        return {spelling: unit for unit, spellings in kinds.items() for spelling in spellings.split()}
    words = {meaning: set(text.split()) for meaning, text in table.items()}
    return words if section == "beside" else {word: meaning for meaning, those in words.items() for word in those}


def unit_called(text: str) -> Unit | None:
    """The unit of a spelling such as "degC" or "deg C"; None where it is unknown."""
    signs = {"º": "°", "˚": "°", "\ufffd": "°", "μ": "µ", "Â": "", "℃": "°C"}
    spelling, units = re.sub(r"[\s._]", "", text.translate(str.maketrans(signs))), _table("units")
    return units.get(spelling) or next(
        (unit for one, unit in units.items() if one.lower() == spelling.lower() and spelling), None
    )


def unit_in(name: Any) -> Unit | None:
    """The unit that a name has in brackets or at its end, where a single letter may be a label."""
    found = [unit_called(text) for text in BRACKETS.findall(str(name))]
    text = re.sub(r"(?i)[_ .](avg|ave|mean|min|max|std|smp|tot|med)$", "", str(name))
    ends = [text[match.end() :] for match in re.finditer(r"[\s_,;:/.-]+(in )?", text)]
    found += [unit_called(end) for end in ends if end in ("°", "%") or (len(end) > 1 and end not in ("in", "to"))]
    return next((unit for unit in found if unit), None)


def kind_of(name: Any, unit: Unit | None = None, values: ArrayLike | None = None) -> tuple[str, str]:
    """The quantity in a column, "" where it stays open, and why.

    Symbols such as T1 or f1 are no words: values, where they are given, have to be such as the quantity has.
    """
    unit, words = unit or unit_in(name), words_of(name)
    by_unit = unit.kind if unit else OPEN
    if re.search(r"[\^*]\d|^t(0|_(s|ms|min|h))$", str(name)) and not unit:
        return OPEN, "it may be a power or a time"
    if about := [meaning for word in words if (meaning := _table("about").get(word))]:
        return about[0], f"its name says {about[0]}"
    named = [kind for word in words if (kind := _table("words").get(word))]
    by_unit = TEMPERATURE if unit and unit.name == "°" and named == [TEMPERATURE] else by_unit
    others = [kind for kind in named if kind not in (TEMPERATURE, FREQUENCY)]
    if by_unit not in (OPEN, TEMPERATURE, FREQUENCY):
        return (others or [by_unit])[0], f"it is in {unit.name}" if unit else ""
    is_last = named[-1:] == [TEMPERATURE]  # the temperature of a strain gauge
    if by_unit == TEMPERATURE or (TEMPERATURE in named and FREQUENCY not in named and (is_last or not others)):
        return TEMPERATURE, "its unit or name says temperature"
    if others or (TEMPERATURE in named and FREQUENCY in named):
        return (others or [OPEN])[0], f"its name says {' and '.join(dict.fromkeys(named))}"
    if by_unit == FREQUENCY or FREQUENCY in named:
        is_bound = _table("beside")["bounds"].intersection(words)
        return ("bound", "its name says bound") if is_bound else (FREQUENCY, "its unit or name says frequency")
    symbol = _symbol(words)
    checked = {TEMPERATURE: can_be_temperature, FREQUENCY: can_be_frequency}
    if symbol and values is not None and not checked[symbol](values):
        return OPEN, f"its name may mean a {symbol}, and its values are none"
    return symbol, f"its name may mean a {symbol}" if symbol else "nothing says what it is"


def words_of(name: Any) -> list[str]:
    """Words and numbers of a name in small letters without accents, without units in brackets."""
    text = BRACKETS.sub(lambda one: " " if unit_called(one[1]) else f" {one[1]} ", str(name))
    text = re.sub(r"_(lag\d+|mean\d+[A-Za-z]*)$", "", text)  # of LagFeatures and ExponentialMeans
    text = text.translate(str.maketrans({"Δ": " delta ", "∆": " delta ", "ß": "ss", "ζ": " zeta ", "ξ": " xi "}))
    text = "".join(sign for sign in normalize("NFKD", text) if not combining(sign))
    text = re.sub(r"(?i)pt[ _-]?1000?(?!\d)", " thermometer ", text)
    words = [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", text)]
    return [part for word in words for part in _parts_of(word)]


def _parts_of(word: str) -> list[str]:
    """A word, or the parts of a compound that is no word of the tables."""
    end = next((end for end in _table("ends") if word.endswith(end)), word)
    is_compound = word != end and word not in _table("words") and word not in _table("about")
    return [word.removesuffix(end), end] if is_compound else [word]


def _symbol(words: list[str]) -> str:
    """The quantity of a symbol, with nothing beside it but numbers, places, directions and words that say nothing."""
    air, places, modes, directions, nothing, bounds = _table("beside").values()
    rest = [word for word in words if not word.isdigit() and word not in nothing]
    is_numbered = any(word.isdigit() or word in ("first", "second", "third") for word in words)
    first = rest[0] if rest else ""
    if (
        first in ("t", "tc")
        or (len(first) > 2 and first[0] == "t" and first[1:] in air | places | bounds)
        or air.intersection(rest)
    ):
        beside = air | places | bounds | {"c", "f", "k"} | (set() if first[:1] == "t" else {"t", "tc", "tf"})
        return TEMPERATURE if beside.issuperset(rest[first[:1] == "t" :]) else OPEN
    if re.fullmatch("f[nvhlbt]?", first) and (is_numbered or words in (["f"], ["fn"])):
        return FREQUENCY if directions.issuperset(rest[1:]) else OPEN
    return FREQUENCY if modes.intersection(rest) and is_numbered and (modes | directions).issuperset(rest) else OPEN


def can_be_temperature(values: ArrayLike) -> bool:
    """Whether most values are such as thermometers in the open show, in degrees Celsius or kelvin, and vary so."""
    known = _known(values)
    if len(known) < 3:
        return True
    in_celsius, in_kelvin = (((known > zero - 60) & (known < zero + 90)).mean() for zero in (0.0, 273.15))
    is_steady = len(known) >= 50 and _spread(known) < min(0.03 * abs(np.median(known)), 0.5)
    is_flag = np.isin(known, (0.0, 1.0)).all()
    return bool(in_kelvin > 0.8 or (in_celsius > 0.8 and not is_steady)) and not is_flag


def can_be_frequency(values: ArrayLike) -> bool:
    """Whether most values are positive, and vary by less than a third."""
    known = _known(values)
    return not len(known) or bool((known > 0).mean() > 0.8 and _spread(known[known > 0]) < np.median(known) / 3)


def varies_as_modes(values: ArrayLike) -> bool:
    """Whether most values are such as the natural frequencies of structures in Hz: below 200, within some percent."""
    known = _known(values)
    return len(known) > 2 and bool((known > 0).mean() > 0.8 and _spread(known) < min(np.median(known), 200.0) / 20)


def _known(values: ArrayLike) -> Array:
    """Values that are there, without numbers that loggers write for missing ones."""
    values = np.asarray(values, dtype=float)
    return values[np.isfinite(values) & ~np.isin(values, MISSING_CODES) & (np.abs(values) < 9990)]


def _spread(known: Array) -> float:
    """Standard deviation by the middle of the values."""
    low, high = np.quantile(known, [0.1, 0.9])
    return float(high - low) / 2.563


def in_usual_units(table: pd.DataFrame, units: Mapping[str, str]) -> pd.DataFrame:
    """A table with columns that are in other units converted to degrees Celsius or Hz."""
    found = {name: unit for name, text in units.items() if name in table and (unit := unit_called(text))}
    return table.assign(**{name: (table[name] - unit.zero) * unit.factor for name, unit in found.items()})
