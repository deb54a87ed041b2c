"""Periods of the baseline that are predicted from the others."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.model_selection import check_cv

Rows = NDArray[np.intp]


def folds_of(cv: Any, X: Any) -> tuple[list[tuple[Rows, Rows]], Rows]:
    """Folds that test every row once, and the first rows, which a splitter that goes forward in time does not test."""
    folds = list(check_cv(cv).split(X))
    tested = np.bincount(np.concatenate([[], *(test for _, test in folds)]).astype(int), minlength=len(X))
    untested = np.arange(tested.argmax())
    wrong = len(untested) + np.flatnonzero(tested[len(untested) :] != 1)
    if wrong.size:
        raise ValueError(
            f"cv is {cv!r}, which tests row {wrong[0]} {tested[wrong[0]]} times ({wrong.size} of {len(X)} "
            "rows not exactly once); expected a partition of the rows, such as KFold makes, or of all but the "
            "first, as TimeSeriesSplit does"
        )
    return folds, untested
