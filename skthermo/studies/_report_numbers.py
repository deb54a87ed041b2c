"""Numbers of a report as an owner of a bridge reads them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

SPACE = "\N{NO-BREAK SPACE}"
UNKNOWN = "not known"


def percent(share: float, digits: int = 2) -> str:
    """A share in percent with so many significant digits; shares of nearly 1 do not become 100 %."""
    if not np.isfinite(share):
        return UNKNOWN
    value = 100 * float(share)
    if 99.5 <= value < 100:
        return f"{value:.1f}{SPACE}%" if value < 99.95 else f"over{SPACE}99.9{SPACE}%"
    return f"{shortened(value, digits)}{SPACE}%"


def shortened(value: float, digits: int = 2) -> str:
    """A number with so many significant digits; those before the point are all kept."""
    if value == 0 or not np.isfinite(value):
        return "0" if value == 0 else UNKNOWN
    decimals = max(digits - 1 - int(np.floor(np.log10(abs(value)))), 0)
    return f"{value:.{decimals}f}"


def between(lowest: float, highest: float) -> str:
    """Bounds in percent, on one line."""
    return f"{percent(lowest)}{SPACE}to{SPACE}{percent(highest)}"


def tested(severity: float) -> str:
    """Magnitude of a severity that was tested, as it was given."""
    return f"{100 * abs(float(severity)):.4g}{SPACE}%"


def severity_text(severity: float) -> str:
    """Magnitude of a severity that was found by a curve."""
    return f"{100 * abs(float(severity)):.3g}{SPACE}%"


def exact(share: float) -> str:
    """A share in percent with one decimal, for estimates with an error of their own."""
    return f"{100 * float(share):.1f}{SPACE}%" if np.isfinite(share) else UNKNOWN


def probability(value: float) -> str:
    """A probability as a number."""
    if not np.isfinite(value):
        return UNKNOWN
    return "less than 0.001" if value < 0.001 else f"{value:.2g}"


def counted(number: int, one: str, many: str | None = None) -> str:
    """A number with its noun."""
    return f"{number:,}{SPACE}{one if number == 1 else many or one + 's'}"


def listed(names: Sequence[Any]) -> str:
    """Names in a sentence."""
    *first, last = [str(name) for name in names] or [""]
    return f"{', '.join(first)} and {last}" if first else last


def duration(wait: Any) -> str:
    """Time to an alarm, in records or as a time."""
    if pd.isna(wait):
        return "no alarm"
    if not isinstance(wait, pd.Timedelta):
        return f"{float(wait):.3g} records" if wait else "first record"
    hours = wait.total_seconds() / 3600
    if hours == 0:
        return "first record"
    size, unit = (hours / 24, "day") if hours >= 48 else (hours, "hour") if hours >= 1 else (60 * hours, "minute")
    text = f"{size:.2g}" if size < 99 else f"{size:.0f}"
    return f"{text} {unit}{'' if text == '1' else 's'}"


def period(index: pd.Index | None) -> str:
    """First and last day of records on an index of times; nothing for others."""
    if not isinstance(index, pd.DatetimeIndex) or not len(index):
        return ""
    return f"from {index.min():%Y-%m-%d} to {index.max():%Y-%m-%d}"
