"""Warnings that point at the user's line, each given once."""

import os
import sys
import warnings
from collections.abc import Iterable
from pathlib import Path
from types import FrameType
from typing import ClassVar

import joblib
import sklearn

OURS = tuple(str(Path(package).parent) + os.sep for package in (__file__, sklearn.__file__, joblib.__file__))


class _Folds:
    """The cross-validation or search that warned last, by its frame, and the kinds of warnings it has given."""

    frame: FrameType | None = None
    kinds: ClassVar[set[str]] = set()


def warn_user(message: str, kind: str) -> None:
    """Warn at the nearest line outside skthermo, scikit-learn and joblib.

    Parameters
    ----------
    message : str
        Text of the warning.
    kind : str
        One cross-validation or search gives one warning of each kind, not one for each fold.
    """
    frame, level, folds = sys._getframe(1), 2, None
    while frame.f_back is not None and frame.f_code.co_filename.startswith(OURS):
        if frame.f_globals.get("__name__", "").startswith("sklearn.model_selection"):
            folds = frame
        frame, level = frame.f_back, level + 1
    if folds is not None:
        if folds is not _Folds.frame:
            _Folds.frame, _Folds.kinds = folds, set()
        if kind in _Folds.kinds:
            return
        _Folds.kinds.add(kind)
    warnings.warn(message, UserWarning, stacklevel=level)


def warn_each(warnings_by_kind: Iterable[tuple[str, str]]) -> None:
    """Give each warning, a pair of kind and text."""
    for kind, message in warnings_by_kind:
        warn_user(message, kind)
