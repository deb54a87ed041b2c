"""Warnings that several steps repeat, given once."""

import re
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from skthermo._warnings import warn_user


@contextmanager
def warnings_once(where: str = "") -> Iterator[list[str]]:
    """Give warnings that differ only in their numbers once, when the context ends, and yield a list of their texts.

    ``where`` is said of the repetitions with their number, such as "in the simulations of this study"; by default they
    are not mentioned.
    """
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield texts
    alike: dict[str, list[warnings.WarningMessage]] = {}
    for warning in caught:
        alike.setdefault(re.sub(r"[\d.]+", "0", str(warning.message)), []).append(warning)
    for first, *others in alike.values():
        again = f" (and {len(others)} times more {where})" if others and where else ""
        texts.append(f"{first.message}{again}")
        if first.category is UserWarning:
            warn_user(f"{first.message}{again}", f"once: {first.message}")
        else:
            warnings.warn_explicit(first.message, first.category, first.filename, first.lineno)


@contextmanager
def without_warnings() -> Iterator[None]:
    """Ignore warnings, unless this is a thread beside the main one: filters belong to the whole process."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
