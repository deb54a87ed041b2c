"""Warnings that point at the user's line, once each, also where several steps repeat them; records checked once."""

import multiprocessing
import re
import sys
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar
from weakref import WeakKeyDictionary, ref

import numpy as np
from joblib import Parallel
from joblib import hash as content_of
from numpy.typing import NDArray

Records = TypeVar("Records")

PASSED_OVER = {"skthermo", "sklearn", "joblib", "contextlib"}  # packages whose lines are not the user's

_given: WeakKeyDictionary[Any, set[str]] = WeakKeyDictionary()
"""Kinds of warnings that the jobs of each cross-validation or search, or a worker process, have given."""

_told: ContextVar[frozenset[str]] = ContextVar("kinds of warnings that an estimator around gives", default=frozenset())
_found: ContextVar[dict[str, Any] | None] = ContextVar("findings of a check by content of its tables", default=None)
ALL = "all"  # key of findings that stand for those of all records within
_job: ContextVar[Any] = ContextVar("the job whose warnings are counted", default=None)
_turn = threading.RLock()  # held by the job of this process whose warnings are counted
_in_turn: threading.Thread | None = None  # that runs it
REPORTED = (UserWarning, RuntimeWarning, FutureWarning)  # others are for developers
Told = tuple[type[Warning], str, str, int]  # category, text, file and line of a warning
_explained: dict[int, tuple[Any, NDArray[np.bool_]]] = {}
"""Tables by identity while they exist, and their rows without a value of which a warning has given the cause."""


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
    if kind in _told.get():
        return
    frame, level, in_folds, jobs = sys._getframe(1), 2, False, None
    while frame.f_back is not None and (module := frame.f_globals.get("__name__", "")).split(".")[0] in PASSED_OVER:
        in_folds = in_folds or module.startswith("sklearn.model_selection")
        if frame.f_code is Parallel.__call__.__code__:
            jobs = frame.f_locals["self"]
        frame, level = frame.f_back, level + 1
    if (job := _job.get()) is not None:
        jobs = job
    elif multiprocessing.parent_process() is not None:
        in_folds, jobs = True, multiprocessing.current_process()
    if in_folds and jobs is not None:
        kinds = _given.setdefault(jobs, set())
        if kind in kinds:
            return
        kinds.add(kind)
    warning: Any = UserWarning(message)
    warning.kind = kind
    warnings.warn(warning, stacklevel=level)


@contextmanager
def counted_warnings() -> Iterator[Counter[tuple[str, str]]]:
    """Count the warnings of a job by kind and text, in any thread; none is shown.

    Jobs of one process take turns, because filters belong to the whole process. Warnings of other packages have their
    class as their kind.
    """
    global _in_turn
    counts: Counter[tuple[str, str]] = Counter()
    with _turn:
        token, before, _in_turn = _job.set(Counted()), _in_turn, threading.current_thread()
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("ignore")
                for category in REPORTED:
                    warnings.simplefilter("always", category)
                yield counts
        finally:
            _job.reset(token)
            _in_turn = before
            counts.update((_kind(one), str(one.message)) for one in caught)


class Counted:
    """A job whose warnings are counted: those of its folds are given once."""


def _kind(caught: warnings.WarningMessage) -> str:
    kind: str = getattr(caught.message, "kind", caught.category.__name__)
    return "repeated" if kind.startswith(("once: ", "again: ")) else kind


def _may_filter() -> bool:
    """Whether this thread may set filters, which belong to the whole process."""
    return threading.current_thread() in (threading.main_thread(), _in_turn)


def warn_each(warnings_by_kind: Iterable[tuple[str, str]]) -> None:
    """Give warnings by kind and text."""
    for kind, message in warnings_by_kind:
        warn_user(message, kind)


@contextmanager
def told_around(kinds: Iterable[str], findings: Any = None) -> Iterator[None]:
    """Parts within give no warnings of some kinds, and check no records: the estimator around them has done so.

    What it has found in its records, if given, is what `findings_of` gives the parts.
    """
    told = _told.set(_told.get() | set(kinds))
    found = _found.set(_found.get() if findings is None else {ALL: findings})
    try:
        yield
    finally:
        _told.reset(told)
        _found.reset(found)


@contextmanager
def checked_once() -> Iterator[None]:
    """Estimators within that learn from the same records share one check of them, and its warnings."""
    found = _found.get()
    token = _found.set({} if found is None else found)
    try:
        yield
    finally:
        _found.reset(token)


def findings_of(check: Callable[..., Any], *tables: Any, mended: Collection[str] = ()) -> Any:
    """What a check has found in tables, with its warnings; neither is repeated for records that were checked before.

    Of kinds that the caller has ``mended``, there is no warning.
    """
    found = _found.get()
    if found is None:
        found, content = {}, ALL
    else:
        content = ALL if ALL in found else content_of(tables)
    if content not in found:
        found[content] = check(*tables)
        warn_each((kind, text) for kind, text in found[content].warnings() if kind not in mended)
    return found[content]


def explain_rows(table: Records, rows: NDArray[np.bool_] | np.bool_) -> Records:
    """The table, of which a warning has said why some rows have no value."""
    if rows.any():
        key = id(table)
        _explained[key] = ref(table, lambda _: _explained.pop(key, None)), rows
    return table


def explained_rows(table: Any) -> NDArray[np.bool_] | np.bool_:
    """Which rows lack values for a cause that a warning has given; False where there are none, or rows were dropped."""
    known = _explained.get(id(table))
    if known is None or len(table) != len(known[1]):
        return np.False_
    return known[1] & np.isnan(np.asarray(table, dtype=float)).reshape(len(table), -1).any(axis=1)


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
    if name is None or not _may_filter():
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
def recorded() -> Iterator[list[Told]]:
    """Keep the warnings of what runs inside in a list, for `give_again`; outside the main thread they pass as they are,
    because filters belong to the whole process."""
    told: list[Told] = []
    if not _may_filter():
        yield told
        return
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield told
    finally:
        told += [(one.category, str(one.message), one.filename, one.lineno) for one in caught]


def give_again(told: Iterable[Told]) -> None:
    """Give warnings that were recorded, those for users at the user's line of now."""
    for category, text, filename, line in told:
        if category is UserWarning:
            warn_user(text, f"again: {text}")
        else:
            warnings.warn_explicit(text, category, filename, line)


@contextmanager
def without_warnings() -> Iterator[None]:
    """Ignore warnings, unless this is a thread beside the main one: filters belong to the whole process."""
    if not _may_filter():
        yield
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
