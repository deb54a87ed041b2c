"""Warnings that point at the user's line, once each."""

import os
import sys
import warnings
from collections.abc import Iterable
from pathlib import Path
from types import FrameType

import joblib
import sklearn

OURS = tuple(str(Path(package).parent) + os.sep for package in (__file__, sklearn.__file__, joblib.__file__))

_given: set[tuple] = set()


def warn_user(message: str, kind: str) -> None:
    """Warn at the nearest line outside skthermo, scikit-learn and joblib.

    Parameters
    ----------
    message : str
        What is to be said.
    kind : str
        Within one cross-validation or search, one warning of each kind is given, not one for each fold.
    """
    frame, level, in_folds = sys._getframe(1), 2, False
    while frame.f_back is not None and frame.f_code.co_filename.startswith(OURS):
        in_folds = in_folds or _runs_folds(frame)
        frame, level = frame.f_back, level + 1
    if in_folds:
        call = (kind, id(frame), frame.f_code.co_filename, frame.f_lasti)
        if call in _given:
            return
        _given.add(call)
    warnings.warn(message, UserWarning, stacklevel=level)


def warn_each(warnings_by_kind: Iterable[tuple[str, str]]) -> None:
    """Give warnings by kind and text."""
    for kind, message in warnings_by_kind:
        warn_user(message, kind)


def _runs_folds(frame: FrameType) -> bool:
    module = frame.f_globals.get("__name__", "")
    return module.startswith("sklearn.model_selection")
