"""Warnings that point at the user's line, once each, also where several steps repeat them; records checked once."""

import multiprocessing
import re
import sys
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import Any, TypeVar
from weakref import ref

import numpy as np
from joblib import Parallel
from joblib import hash as content_of
from numpy.typing import NDArray

from skthermo.exceptions import (
    FewRecordsWarning,
    ModelWarning,
    RecordsWarning,
    ResultWarning,
    SkthermoWarning,
    UnevaluatedRowsWarning,
    WeatherWarning,
)

Records = TypeVar("Records")
Told = tuple[type[Warning], str, str, int]  # category, text, file and line of a warning

PASSED_OVER = {"skthermo", "sklearn", "joblib", "contextlib"}  # packages whose lines are not the user's
REPORTED = (UserWarning, RuntimeWarning, FutureWarning)  # others are for developers
ALL = "all"  # key of findings that stand for those of all records within

KINDS: dict[type[SkthermoWarning], str] = {
    RecordsWarning: (
        "absurd values, another KW51 file, complex shapes, exchanged modes, excursion of the baseline, few "
        "shapes, filled temperatures, foreign mode shapes, many outliers, markers, memory, modes of other shapes, "
        "modes that can be confused, mostly filled, names of temperatures, offset of modes, outliers, rows in "
        "disorder, sensor apart from others, stand-ins, step, stuck, temperatures, time shift, trend, unfinished file, "
        "weather"
    ),
    FewRecordsWarning: (
        "few independent, few modes, few records, few residuals, few rows, half of the rows, lags without stamps, "
        "modes never together, no records for, padded lags, scarce modes, threshold beyond the baseline"
    ),
    WeatherWarning: (
        "rows that stand on the fleet, same weather, seasons without baseline, weather of folds, weather outside "
        "the training range"
    ),
    UnevaluatedRowsWarning: (
        "modes not found, poles without shape, records not evaluated, records that were not compared, rows not "
        "evaluated, rows scored, rows that cannot be predicted, rows with a likelihood"
    ),
    ModelWarning: (
        "doubtful matrices, doubtful optimum, draws, failed replicates, failing program, hidden offsets, impossible "
        "parameters, large discrepancy, large factor, no reduced model, no solution, not converged, order of "
        "modes, outside the, refined by the full model, round trip, shapes unlike the model's, unfinished draws, "
        "worse than the mean"
    ),
    ResultWarning: (
        "bands without models, blind detector, confused groups, covariance with gaps, curve beside its points, "
        "families that are not found, family without a curve, inert settings searched, many false alarms, "
        "search that refits, separated severities, severity at its bound, the last records differ, unexplained "
        "shifts, unknown, unseen groups"
    ),
    SkthermoWarning: ("bridges that failed, monitors that begin again, versions of a monitor, warnings of bridges"),
}
"""Beginnings of the kinds of each category."""


@dataclass(frozen=True)
class Context:
    """What the warnings and checks within a call know of what was told and found before."""

    told: frozenset[str] = frozenset()  # kinds of warnings that an estimator around gives
    found: dict[str, Any] | None = None  # findings of a check by content of its tables
    given: set[str] | None = None  # kinds that the folds of the job that is counted have given
    explained: tuple[tuple[Callable[[], Any], NDArray[np.bool_]], ...] = ()
    """Tables while they exist, and their rows without a value of which a warning has given the cause."""


_context: ContextVar[Context] = ContextVar("of warnings and checks", default=Context())  # noqa: B039 (it is frozen)
_turn = threading.RLock()  # held by the job of this process whose warnings are counted


@contextmanager
def _within(**changes: Any) -> Iterator[None]:
    """Another context; what is explained within stays so."""
    before = {name: getattr(_context.get(), name) for name in changes}
    _context.set(replace(_context.get(), **changes))
    try:
        yield
    finally:
        _context.set(replace(_context.get(), **before))


def category_of(kind: str) -> type[SkthermoWarning]:
    """The class of the warnings of a kind; of two beginnings of it, the longer one counts."""
    known = {
        start: category for category, starts in KINDS.items() for start in starts.split(", ") if kind.startswith(start)
    }
    return known[max(known, key=len)] if known else SkthermoWarning


def warn_user(message: str, kind: str, category: type[Warning] | None = None) -> None:
    """Warn at the nearest line outside skthermo, scikit-learn and joblib.

    Parameters
    ----------
    message : str
        Text of the warning.
    kind : str
        One cross-validation or search gives one warning of each kind, not one for each fold; a worker process, which
        sees only its own folds, one in its life.
    category : type, default=None
        Class of the warning, if not that of its kind.
    """
    context = _context.get()
    if kind in context.told:
        return
    frame, level, in_folds, jobs = sys._getframe(1), 2, False, None
    while frame.f_back is not None and (module := frame.f_globals.get("__name__", "")).split(".")[0] in PASSED_OVER:
        in_folds = in_folds or module.startswith("sklearn.model_selection")
        if frame.f_code is Parallel.__call__.__code__:
            jobs = frame.f_locals["self"]
        frame, level = frame.f_back, level + 1
    if context.given is None and multiprocessing.parent_process() is not None:
        in_folds, jobs = True, multiprocessing.current_process()
    if in_folds and (context.given is not None or jobs is not None):
        given = vars(jobs).setdefault("_warned_by_skthermo", set()) if context.given is None else context.given
        if kind in given:
            return
        given.add(kind)
    warning: Any = (category or category_of(kind))(message)
    warning.kind = kind
    warnings.warn(warning, stacklevel=level)


@contextmanager
def counted_warnings() -> Iterator[Counter[tuple[str, str]]]:
    """Count the warnings of a job by kind and text, in any thread; none is shown.

    Jobs of one process take turns, because filters belong to the whole process. Warnings of other packages have their
    class as their kind.
    """
    counts: Counter[tuple[str, str]] = Counter()
    with _turn, _within(given=set()), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        for category in REPORTED:
            warnings.simplefilter("always", category)
        try:
            yield counts
        finally:
            counts.update((_kind(one), str(one.message)) for one in caught)


def _kind(caught: warnings.WarningMessage) -> str:
    kind: str = getattr(caught.message, "kind", caught.category.__name__)
    return "repeated" if kind.startswith(("once: ", "again: ")) else kind


def _may_filter() -> bool:
    """Whether this thread may set filters, which belong to the whole process: it is the main one, or has its turn."""
    return threading.current_thread() is threading.main_thread() or _context.get().given is not None


def warn_each(warnings_by_kind: Iterable[tuple[str, str]]) -> None:
    """Give warnings by kind and text."""
    for kind, message in warnings_by_kind:
        warn_user(message, kind)


def told_around(kinds: Iterable[str], findings: Any = None) -> AbstractContextManager[None]:
    """Parts within give no warnings of some kinds, and check no records: the estimator around them has done so.

    What it has found in its records, if given, is what `findings_of` gives the parts.
    """
    context = _context.get()
    return _within(told=context.told | set(kinds), found=context.found if findings is None else {ALL: findings})


def checked_once() -> AbstractContextManager[None]:
    """Estimators within that learn from the same records share one check of them, and its warnings."""
    found = _context.get().found
    return _within(found={} if found is None else found)


def findings_of(check: Callable[..., Any], *tables: Any, mended: Collection[str] = ()) -> Any:
    """What a check has found in tables, with its warnings; neither is repeated for records that were checked before.

    Of kinds that the caller has ``mended``, there is no warning.
    """
    found = _context.get().found
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
        context = _context.get()
        living = tuple(one for one in context.explained if one[0]() is not None)
        _context.set(replace(context, explained=(*living, (ref(table), np.asarray(rows)))))
    return table


def explained_rows(table: Any) -> NDArray[np.bool_] | np.bool_:
    """Which rows lack values for a cause that a warning has given; False where there are none, or rows were dropped."""
    for one, rows in reversed(_context.get().explained):
        if one() is table and len(table) == len(rows):
            return rows & np.isnan(np.asarray(table, dtype=float)).reshape(len(table), -1).any(axis=1)
    return np.False_


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
        if first.category is UserWarning or issubclass(first.category, SkthermoWarning):
            warn_user(f"{first.message}{again}", f"once: {first.message}", first.category)
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
        if category is UserWarning or issubclass(category, SkthermoWarning):
            warn_user(text, f"again: {text}", category)
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
