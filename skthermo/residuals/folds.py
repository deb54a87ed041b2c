"""Folds by which a baseline is predicted, and whether each of them has weather that the others know."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.model_selection import check_cv

from skthermo._tables.arrays import Array
from skthermo._tables.frames import correlation_times, row_times
from skthermo.preprocessing import BlockedKFold

Rows = NDArray[np.intp]
N_FOLDS = 5
CORRELATION_TIMES = 5  # of the residuals in a block of records that are predicted together, at least


@dataclass(frozen=True)
class Folds:
    """Pairs of training and test rows, the rows that no fold tests, and the blocks that they may be made of."""

    splits: list[tuple[Rows, Rows]]
    untested: Rows
    blocks: BlockedKFold | None = None

    @classmethod
    def of(cls, cv: Any, X: Any) -> Folds:
        """The folds that a user asks for; by default blocks of a week, or of a 52nd of the rows without stamps."""
        if cv is None:
            return cls.of_blocks(BlockedKFold(N_FOLDS), X)
        n_folds = N_FOLDS if isinstance(cv, str) else cv
        if isinstance(n_folds, Integral) and n_folds > len(X):
            raise ValueError(f"cv is {cv!r}, {n_folds} folds of {len(X)} rows; expected a row or more in each fold")
        splits = list(check_cv(checked(n_folds, len(X))).split(X))
        tested = np.bincount(np.concatenate([[], *(test for _, test in splits)]).astype(int), minlength=len(X))
        untested = np.arange(tested.argmax())
        wrong = len(untested) + np.flatnonzero(tested[len(untested) :] != 1)
        if wrong.size:
            raise ValueError(
                f"cv is {cv!r}, which tests row {wrong[0]} {tested[wrong[0]]} times ({wrong.size} of {len(X)} "
                "rows not exactly once); expected a partition of the rows, such as KFold makes, or of all but the "
                "first, as TimeSeriesSplit does"
            )
        return cls(splits, untested)

    @classmethod
    def of_blocks(cls, blocks: BlockedKFold, X: Any) -> Folds:
        """Blocks that are dealt in turn to the folds."""
        return cls(list(blocks.split(X)), np.empty(0, dtype=np.intp), blocks)

    def longer(self, X: Any, residuals: Array) -> Folds | None:
        """Folds of blocks as long as the residuals' memory wants them, if these are too short and may be longer."""
        if self.blocks is None:
            return None
        order = np.argsort(row_times(X), kind="stable")
        blocks = self.blocks.remembering(X, CORRELATION_TIMES * correlation_times(residuals[order]).mean())
        return None if blocks is self.blocks else self.of_blocks(blocks, X)

    def of_row(self, n_rows: int) -> Rows:
        """The fold of each row, -1 where there is none."""
        folds = np.full(n_rows, -1)
        for fold, (_, test) in enumerate(self.splits):
            folds[test] = fold
        return folds


def checked(cv: Any, n_rows: int) -> Any:
    """Folds as given, or as a list if they are an iterable of pairs of rows; refused if they are something else."""
    if not isinstance(cv, Iterable) or hasattr(cv, "split"):
        return cv
    pairs = list(cv)
    for number, pair in enumerate(pairs):
        if not (isinstance(pair, tuple | list) and len(pair) == 2 and all(are_rows(part, n_rows) for part in pair)):
            raise ValueError(
                f"cv holds {pair!r:.100} as its element {number}; expected a number of folds, a splitter, or pairs of "
                f"training and test rows, positions from 0 to {n_rows - 1}"
            )
    return pairs


def are_rows(part: Any, n_rows: int) -> bool:
    """Whether a part of a fold holds positions of rows."""
    rows = np.asarray(part)
    whole = rows.ndim == 1 and (rows.size == 0 or rows.dtype.kind in "iu")
    return whole and (rows.size == 0 or (rows.min() >= 0 and rows.max() < n_rows))
