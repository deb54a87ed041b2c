"""Warnings that point at the user's line, once each."""

import multiprocessing
import sys
import warnings
import weakref
from collections.abc import Iterable
from typing import Any, ClassVar

PASSED_OVER = {"skthermo", "sklearn", "joblib", "contextlib"}
"""Packages whose lines are not the user's."""


class _Folds:
    """The run of jobs of the cross-validation or search that warned last, and the kinds of warnings it has given."""

    run: ClassVar[Any] = staticmethod(lambda: None)
    kinds: ClassVar[set[str]] = set()


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
    frame, level, in_folds, run = sys._getframe(1), 2, False, None
    while frame.f_back is not None and (module := frame.f_globals.get("__name__", "")).split(".")[0] in PASSED_OVER:
        in_folds = in_folds or module.startswith("sklearn.model_selection")
        if frame.f_code.co_name == "__call__" and type(frame.f_locals.get("self")).__name__ == "Parallel":
            run = frame.f_locals["self"]
        frame, level = frame.f_back, level + 1
    if multiprocessing.parent_process() is not None:
        in_folds, run = True, multiprocessing.current_process()
    if in_folds and run is not None:
        if _Folds.run() is not run:
            _Folds.run, _Folds.kinds = weakref.ref(run), set()
        if kind in _Folds.kinds:
            return
        _Folds.kinds.add(kind)
    warnings.warn(message, UserWarning, stacklevel=level)


def warn_each(warnings_by_kind: Iterable[tuple[str, str]]) -> None:
    """Give warnings by kind and text."""
    for kind, message in warnings_by_kind:
        warn_user(message, kind)
