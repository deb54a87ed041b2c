"""Warnings of many simulations, given once."""

import re
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from skthermo._warnings import warn_user


@contextmanager
def warnings_once() -> Iterator[list[str]]:
    """Give warnings that differ only in their numbers once, with their count, when the context ends.

    Yields
    ------
    list of str
        Their texts, which it holds from then on.
    """
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield texts
    alike: dict[str, list[warnings.WarningMessage]] = {}
    for warning in caught:
        alike.setdefault(re.sub(r"[\d.]+", "0", str(warning.message)), []).append(warning)
    for first, *others in alike.values():
        again = f" (and {len(others)} times more in the simulations of this study)" if others else ""
        texts.append(f"{first.message}{again}")
        if first.category is UserWarning:
            warn_user(f"{first.message}{again}", f"study: {first.message}")
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
