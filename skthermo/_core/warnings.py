"""Warnings that point at the user's line, once each, also where several steps repeat them; records checked once."""

import multiprocessing
import re
import sys
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import Any, TypeVar
from weakref import WeakKeyDictionary, ref

import numpy as np
from joblib import Parallel
from numpy.typing import NDArray

from skthermo._core.answers import content_of
from skthermo.exceptions import SkthermoWarning

Records = TypeVar("Records")

PASSED_OVER = {"skthermo", "sklearn", "joblib", "contextlib", "functools"}  # packages whose lines are not the user's
REPORTED = (UserWarning, RuntimeWarning, FutureWarning)  # others are for developers
ALL = "all"  # key of findings that stand for those of all records within


@dataclass(frozen=True)
class Context:
    """What the warnings and checks within a call know of what was warned of and found before."""

    reported: frozenset[str] = frozenset()  # kinds of warnings that the calling estimator gives
    found: dict[str, Any] | None = None  # findings of a check by content of its tables
    given: set[str] | None = None  # kinds that the folds of the job that is counted have given
    explained: tuple[tuple[Callable[[], Any], NDArray[np.bool_]], ...] = ()
    """Tables while they exist, and their rows without a value of which a warning has given the cause."""


_context: ContextVar[Context] = ContextVar("of warnings and checks", default=Context())  # noqa: B039 (it is frozen)
_inspected: WeakKeyDictionary[Any, set[tuple[str, str, int]]] = WeakKeyDictionary()  # kinds and lines of warnings given
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


def warn_user(message: str, category: type[SkthermoWarning], kind: str) -> None:
    """Warn at the nearest line outside skthermo, scikit-learn and joblib, once for all folds of a cross-validation or
    search, and once for each estimator that one such line inspects, as for a partial dependence; a worker process,
    which sees only its own folds, warns once in its life. The text ends with the kind; an empty one is no warning."""
    if message:
        warn_each([category(message, kind)])


def warn_each(warned: Iterable[SkthermoWarning]) -> None:
    """Give warnings as `warn_user` does."""
    for warning in warned:
        _give(warning, warning.kind)


def _give(warning: Warning, kind: str) -> None:
    context = _context.get()
    if kind in context.reported:
        return
    frame, level, in_folds, jobs, inspected = sys._getframe(1), 2, False, None, None
    while frame.f_back is not None and (module := frame.f_globals.get("__name__", "")).split(".")[0] in PASSED_OVER:
        in_folds = in_folds or module.startswith("sklearn.model_selection")
        if module.startswith("sklearn.inspection"):
            inspected = frame.f_locals.get("estimator", inspected)
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
    if inspected is not None and isinstance(inspected, Hashable):
        place = (kind, frame.f_code.co_filename, frame.f_lineno)
        if place in _inspected.setdefault(inspected, set()):
            return
        _inspected[inspected].add(place)
    warnings.warn(warning, stacklevel=level)


@contextmanager
def counted_warnings() -> Iterator[Counter[tuple[str, str]]]:
    """Count the warnings of a job by kind and text (other packages' by class), in any thread; none is shown. Jobs of
    one process take turns, because filters belong to the whole process."""
    counts: Counter[tuple[str, str]] = Counter()
    with _turn, _within(given=set()), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        for category in REPORTED:
            warnings.simplefilter("always", category)
        try:
            yield counts
        finally:
            kinds = (getattr(one.message, "kind", one.category.__name__) for one in caught)
            counts.update(zip(kinds, (_text_of(one) for one in caught), strict=True))


def _may_filter() -> bool:
    """Whether this thread may set filters, which belong to the whole process: it is the main one, or has its turn."""
    return threading.current_thread() is threading.main_thread() or _context.get().given is not None


def reported_by_caller(kinds: Iterable[str], findings: Any = None) -> AbstractContextManager[None]:
    """Parts within give no warnings of some kinds, and check no records: the estimator that calls them has done so.

    What it has found in its records, if given, is what `findings_of` gives the parts.
    """
    context = _context.get()
    return _within(reported=context.reported | set(kinds), found=context.found if findings is None else {ALL: findings})


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
        content = ALL if ALL in found else content_of(*tables)
    if content not in found:
        found[content] = check(*tables)
        warn_each(warning for warning in found[content].warnings() if warning.kind not in mended)
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
def collected() -> Iterator[list[SkthermoWarning]]:
    """Warnings of the parts within become findings of the estimator that calls them; other warnings pass.

    Outside the main thread they pass as they are, because filters belong to the whole process.
    """
    findings: list[SkthermoWarning] = []
    if not _may_filter():
        yield findings
        return
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SkthermoWarning)
        yield findings
    for one in caught:
        if isinstance(one.message, SkthermoWarning):
            findings.append(one.message)
        else:
            warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)


@contextmanager
def recorded() -> Iterator[list[warnings.WarningMessage]]:
    """Keep the warnings of what runs inside in a list, for `give_again`; outside the main thread they pass as they are,
    because filters belong to the whole process."""
    if not _may_filter():
        yield []
        return
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield caught


@contextmanager
def without_warnings() -> Iterator[None]:
    """Ignore warnings, unless this is a thread beside the main one."""
    with recorded():
        yield


@contextmanager
def warnings_of_detector(name: str | None) -> Iterator[None]:
    """Mark warnings with the detector that they come from, so that `warnings_once` can name it, if it has a name."""
    if name is None:
        yield
        return
    with recorded() as caught:
        yield
    for one in caught:
        vars(one.message)["detector"] = name
        warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)


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
    for same in alike.values():
        detectors = dict.fromkeys(repr(one.message.detector) for one in same if hasattr(one.message, "detector"))
        notes = [f"detectors {', '.join(detectors)}"] if detectors else []
        notes += [f"and {len(same) - 1} time{'s' * (len(same) > 2)} more {where}"] if len(same) > 1 and where else []
        if notes:
            vars(same[0])["message"].args = (f"{_text_of(same[0])} ({'; '.join(notes)})",)
        texts.append(str(same[0].message))
    give_again(same[0] for same in alike.values())


def give_again(caught: Iterable[warnings.WarningMessage]) -> None:
    """Give warnings that were recorded, those for users at the user's line of now."""
    for one in caught:
        _again(one)


def _text_of(caught: warnings.WarningMessage) -> str:
    """What a warning says, without the code of its kind."""
    return caught.message.args[0] if isinstance(caught.message, SkthermoWarning) else str(caught.message)


def _again(caught: warnings.WarningMessage) -> None:
    warning: Any = caught.message
    if isinstance(warning, SkthermoWarning) or caught.category is UserWarning:
        _give(warning, f"again: {warning}")
    else:
        warnings.warn_explicit(warning, caught.category, caught.filename, caught.lineno)
