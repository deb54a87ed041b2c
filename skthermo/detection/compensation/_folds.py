"""Folds by which a baseline is predicted, and whether each of them has weather that the others know."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.model_selection import KFold, check_cv

from skthermo._arrays import Array, as_floats
from skthermo._dependence import correlation_time
from skthermo._times import has_stamps, row_times
from skthermo._warnings import warn_user
from skthermo._weather import TrainingRange
from skthermo.preprocessing import BlockedKFold

Rows = NDArray[np.intp]
N_FOLDS = 5
WEEK = pd.Timedelta("7D")
BLOCKS_OF_ROWS = 52  # into which records without stamps are divided
CORRELATION_TIMES = 5  # of the residuals (the mean over modes) that a block is longer than
LEAST_BLOCKS = 2  # of each fold, in different seasons
BEYOND = 0.05  # ranges of the other folds' temperatures, outside which a record's weather is unknown to them
UNSEEN, LEAST_UNSEEN = 0.1, 10  # share and number of a fold's records in unknown weather from which it is warned of


@dataclass(frozen=True)
class Folds:
    """Pairs of training and test rows, the rows that no fold tests, and the length of a block if they are blocks."""

    splits: list[tuple[Rows, Rows]]
    untested: Rows
    block: Any = None

    @classmethod
    def of(cls, cv: Any, X: Any) -> Folds:
        """The folds that a user asks for; by default blocks of a week, or of a 52nd of the rows without stamps."""
        if cv is None:
            return cls.of_blocks(X, WEEK if has_stamps(X) else max(len(X) // BLOCKS_OF_ROWS, 1))
        if isinstance(cv, str):
            cv = KFold(N_FOLDS)
        splits = list(check_cv(checked(cv, len(X))).split(X))
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
    def of_blocks(cls, X: Any, block: Any) -> Folds:
        """Blocks that are dealt in turn to the folds."""
        splits = list(BlockedKFold(N_FOLDS, block=block).split(X))
        return cls(splits, np.empty(0, dtype=np.intp), block)

    def longer(self, X: Any, residuals: Array) -> Folds | None:
        """Folds of blocks as long as the residuals' memory wants them, if these are too short and may be longer."""
        if self.block is None:
            return None
        times = row_times(X)
        order = np.argsort(times, kind="stable")
        steps = CORRELATION_TIMES * np.mean([correlation_time(mode) for mode in residuals[order].T])
        # Where each fold would have one block only, it could not see each season.
        longest = np.ptp(times) / (LEAST_BLOCKS * N_FOLDS)
        block = int(min(steps * np.median(np.diff(times[order])), longest)) if len(X) > 1 else 0
        wanted = pd.Timedelta(block, "ns") if has_stamps(X) else block
        return self.of_blocks(X, wanted) if wanted > self.block else None

    def of_row(self, n_rows: int) -> Rows:
        """The fold of each row, -1 where there is none."""
        folds = np.full(n_rows, -1)
        for fold, (_, test) in enumerate(self.splits):
            folds[test] = fold
        return folds

    def warn_of_unseen(self, weather: Any) -> None:
        """Warn of the fold that has most records in weather that the rows it is predicted from do not know."""
        values, worst, text = as_floats(weather), UNSEEN, ""
        for fold, (train, test) in enumerate(self.splits):
            known = TrainingRange.of(weather, train)
            excess = np.nan_to_num(known.excess(values[test]))
            unseen = (excess > BEYOND).any(axis=1)
            if unseen.mean() > worst and unseen.sum() >= LEAST_UNSEEN:
                worst, column = unseen.mean(), int(excess.max(axis=0).argmax())
                seen = values[test, column]
                text = (
                    f"{unseen.sum()} of {len(test)} records of fold {fold + 1} of {len(self.splits)} are in weather "
                    f"that the folds they are predicted from do not know: {known.names[column]!r} is there from "
                    f"{np.nanmin(seen):.4g} to {np.nanmax(seen):.4g}, elsewhere from {known.lowest[column]:.4g} to "
                    f"{known.highest[column]:.4g}: their residuals are too large, and may hide damage; expected folds "
                    "that all see each season, as the default cv=None makes, of a year or more"
                )
        if text:
            warn_user(text, "weather of folds")


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
