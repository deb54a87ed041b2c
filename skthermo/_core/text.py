"""Numbers, names and times as text that an owner of a bridge reads."""

from __future__ import annotations

import re
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from skthermo._core.frames import midnight

SPACE = "\N{NO-BREAK SPACE}"


def percent(share: float, digits: str = ".4g") -> str:
    """A share in percent, with digits as in a format specification."""
    return f"{100 * float(share):{digits}}{SPACE}%" if np.isfinite(share) else "not known"


def share_text(share: float) -> str:
    """A share in percent with two significant digits; shares of nearly 1 do not become 100 %, nor tiny ones long."""
    value = 100 * float(share)
    if 0 < value < 0.005:
        return f"below{SPACE}0.01{SPACE}%"
    if 99.5 <= value < 100:
        return percent(share, ".1f") if value < 99.95 else f"over{SPACE}99.9{SPACE}%"
    return f"{significant(value)}{SPACE}%" if np.isfinite(share) else "not known"


def significant(value: float, digits: int = 2) -> str:
    """A number with so many significant digits; those before the point are all kept."""
    if value == 0 or not np.isfinite(value):
        return "0" if value == 0 else "not known"
    decimals = max(digits - 1 - int(np.floor(np.log10(abs(value)))), 0)
    return f"{value:.{decimals}f}"


def probability_text(value: float) -> str:
    """A probability as a number."""
    if not np.isfinite(value):
        return "not known"
    return "less than 0.001" if value < 0.001 else f"{value:.2g}"


def chance_text(probability: float) -> str:
    """A probability in percent without more digits than it deserves; one of nearly 0 or 1 is below or above a limit."""
    if probability < 0.001 or probability > 0.999:
        return f"below {percent(0.001)}" if probability < 0.001 else f"above {percent(0.999)}"
    return percent(probability, ".0f" if 0.0095 <= probability < 0.995 else ".1f")


def counted(number: int, one: str, many: str | None = None) -> str:
    """A number with its noun."""
    return f"{number:,}{SPACE}{one if number == 1 else many or one + 's'}"


def counted_number(value: float, noun: str, digits: int = 6) -> str:
    """A number that need not be whole, with its noun."""
    number = f"{value:.{digits}g}"
    return f"{number} {noun if number == '1' else noun + 's'}"


def printable(text: Any) -> str:
    """Text in which control characters are seen as their escapes and harm no reader; white space becomes one space."""
    text = str(text)
    if text.isprintable():
        return text
    turning = "\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"  # the direction of text
    spaced = re.sub(r"[\t\n\v\f\r\x85\u2028\u2029]+", " ", text)
    return "".join(
        letter if unicodedata.category(letter) not in ("Cc", "Cs") and letter not in turning else ascii(letter)[1:-1]
        for letter in spaced
    )


def listed(names: Sequence[Any], word: str = "and") -> str:
    """Names in a sentence."""
    *first, last = [str(name) for name in names] or [""]
    return f"{', '.join(first)} {word} {last}" if first else last


def bare(name: Any) -> str:
    """The name of a column without a unit in brackets, as sentences have it."""
    return re.sub(r"\s*[\[(][^\])]*[\])]$", "", str(name)) or str(name)


def capital(text: str) -> str:
    """A text as the beginning of a sentence."""
    return text[:1].upper() + text[1:]


def duration_text(wait: Any) -> str:
    """Time to an alarm, in records or as a time."""
    if pd.isna(wait):
        return "no alarm"
    if not isinstance(wait, pd.Timedelta):
        return f"{float(wait):.3g} records" if wait else "first record"
    hours = wait.total_seconds() / 3600
    if hours == 0:
        return "first record"
    size, unit = (
        (hours / 24, "day") if hours >= 48 or hours == 24 else (hours, "hour") if hours >= 1 else (60 * hours, "minute")
    )
    text = f"{size:.2g}" if size < 99 else f"{size:.0f}"
    return f"{text} {unit}{'' if text == '1' else 's'}"


def day_text(time: Any, *, is_short: bool = False) -> str:
    """A time as text that stays on one line: its day, and the hour where it is not midnight; nothing for none."""
    if pd.isna(time):
        return ""
    stamp = pd.Timestamp(time)
    day = f"{stamp.day} {stamp.month_name()[: 3 if is_short else None]} {stamp.year}".replace(" ", SPACE)
    return day if stamp == midnight(stamp) else f"{day}, {stamp:%H:%M}"


def plain(value: Any) -> Any:
    """A value as JSON has it: times as texts of ISO 8601, durations in seconds, None for numbers that are not
    finite."""
    if isinstance(value, Mapping):
        return {str(name): plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if value is pd.NaT:
        return None
    if isinstance(value, pd.Timestamp | pd.Timedelta):
        return value.isoformat() if isinstance(value, pd.Timestamp) else value.total_seconds()
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def period_text(index: pd.Index | None) -> str:
    """First and last day of records on an index of times; nothing for others."""
    if not isinstance(index, pd.DatetimeIndex) or not len(index):
        return ""
    return f"from {index.min():%Y-%m-%d} to {index.max():%Y-%m-%d}"


class Sentences(ABC):
    """A result in sentences: an answer, open questions, and remarks."""

    @abstractmethod
    def _answer(self) -> Iterator[str]: ...

    def _limits(self) -> Iterator[str]:
        yield from ()

    def _remarks(self) -> Iterator[str]:
        yield from ()

    def answer(self) -> list[str]:
        """The answer, and how certain it is.

        Returns
        -------
        list of str
            Sentences. The first has the most probable answer.
        """
        return list(self._answer())

    def limits(self) -> list[str]:
        """Open questions.

        Returns
        -------
        list of str
            Sentences; none if nothing is left open.
        """
        return list(self._limits())

    def summary(self) -> str:
        """Answer, open questions and remarks.

        Returns
        -------
        str
            One sentence a line.
        """
        return "\n".join([*self._answer(), *self._limits(), *self._remarks()]).replace(SPACE, " ")
