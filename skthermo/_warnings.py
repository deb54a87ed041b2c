"""Warnings that point at the user's line, once each, also where several steps repeat them."""

import multiprocessing
import re
import sys
import threading
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any
from weakref import WeakKeyDictionary

from joblib import Parallel

PASSED_OVER = {"skthermo", "sklearn", "joblib", "contextlib"}  # packages whose lines are not the user's

_given: WeakKeyDictionary[Any, set[str]] = WeakKeyDictionary()
"""Kinds of warnings that the jobs of each cross-validation or search, or a worker process, have given."""


def warn_user(message: str, kind: str) -> None:
    """Warn at the nearest line outside skthermo, scikit-learn and joblib.

    Parameters
    ----------
    message : str
        Text of the warning.
    kind : str
        One cross-validation or search gives one warning of each kind, not one for each fold; a worker process, which
        sees only its own folds, one in its life.
    """
    frame, level, in_folds, jobs = sys._getframe(1), 2, False, None
    while frame.f_back is not None and (module := frame.f_globals.get("__name__", "")).split(".")[0] in PASSED_OVER:
        in_folds = in_folds or module.startswith("sklearn.model_selection")
        if frame.f_code is Parallel.__call__.__code__:
            jobs = frame.f_locals["self"]
        frame, level = frame.f_back, level + 1
    if multiprocessing.parent_process() is not None:
        in_folds, jobs = True, multiprocessing.current_process()
    if in_folds and jobs is not None:
        kinds = _given.setdefault(jobs, set())
        if kind in kinds:
            return
        kinds.add(kind)
    warnings.warn(message, UserWarning, stacklevel=level)


def warn_each(warnings_by_kind: Iterable[tuple[str, str]]) -> None:
    """Give warnings by kind and text."""
    for kind, message in warnings_by_kind:
        warn_user(message, kind)


@contextmanager
def warnings_once(where: str = "") -> Iterator[list[str]]:
    """Give warnings that differ only in their numbers once, when the context ends, and yield a list of their texts.

    ``where`` is said of the repetitions with their number, such as "in the simulations of this study"; by default they
    are not mentioned. Detectors that warnings come from (`warnings_of_detector`) are named.
    """
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield texts
    alike: dict[str, list[warnings.WarningMessage]] = {}
    for warning in caught:
        alike.setdefault(re.sub(r"[\d.]+", "0", str(warning.message)), []).append(warning)
    for first, *others in alike.values():
        named = [one.message for one in (first, *others) if hasattr(one.message, "detector")]
        detectors = dict.fromkeys(repr(message.detector) for message in named)
        notes = [f"detectors {', '.join(detectors)}"] if detectors else []
        notes += [f"and {len(others)} times more {where}"] if others and where else []
        again = f" ({'; '.join(notes)})" if notes else ""
        texts.append(f"{first.message}{again}")
        if first.category is UserWarning:
            warn_user(f"{first.message}{again}", f"once: {first.message}")
        else:
            if detectors:
                first.message.args = (texts[-1],)
            warnings.warn_explicit(first.message, first.category, first.filename, first.lineno)


@contextmanager
def warnings_of_detector(name: str | None) -> Iterator[None]:
    """Mark warnings with the detector that they come from, so that `warnings_once` can name it; without a name, and
    outside the main thread, they pass as they are."""
    if name is None or threading.current_thread() is not threading.main_thread():
        yield
        return
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            yield
        finally:
            marked = list(caught)
    for one in marked:
        one.message.detector = name
        warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)


@contextmanager
def without_warnings() -> Iterator[None]:
    """Ignore warnings, unless this is a thread beside the main one: filters belong to the whole process."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
