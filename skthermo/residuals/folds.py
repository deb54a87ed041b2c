"""Which records of a baseline predict which: folds, and the neighbours of a record in time, which depend on it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.model_selection import check_cv

from skthermo._core.arrays import Array, range_sums
from skthermo._core.frames import DAY_NS, YEAR, correlation_times, row_times
from skthermo.preprocessing import BlockedKFold
from skthermo.residuals.gaussian import Gaussian
from skthermo.residuals.weather import parts

Rows = NDArray[np.intp]
N_FOLDS = 5
CORRELATION_TIMES = 5  # of the residuals in a block of records that are predicted together, at least
REACH = 2  # correlation times beyond which records count as independent of each other
LEAST_KEPT = 0.8  # share of the records that stays when a neighbourhood is left out
BLOCK = 5  # least length of a block of time that is left out as a whole, in correlation times
N_BLOCKS = 50  # into which the records are divided where they depend on each other for less than that
MOST_ROWS = 1e12  # spans below are numbers of rows, and not nanoseconds
LEAST_YEAR = 300  # days or rows from which records can show a season
SINGULAR = 1e-9  # share of the smallest variance of all records below which the others have none


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


@dataclass(frozen=True)
class Neighbourhoods:
    """Records at some times, (n_records, n_columns), and for each those within two correlation times of it.

    Independent records, whose correlation time is 1, have no neighbours.
    """

    times: Array
    records: Array

    @cached_property
    def order(self) -> Rows:
        return np.argsort(self.times, kind="stable")

    @cached_property
    def correlation_time(self) -> float:
        """Mean over the columns, in records, of what the season does not explain: it comes again, and is no memory."""
        rows = _without_season(self.records[self.order], self.times[self.order])
        return float(correlation_times(rows).mean())

    @property
    def n_independent(self) -> float:
        """Number of records, those without any value left out, over their correlation time."""
        return np.count_nonzero(~np.isnan(self.records).all(axis=1)) / self.correlation_time

    @cached_property
    def ranges(self) -> tuple[Rows, Rows]:
        """Places in the order of time from which, and before which, the neighbours of each record are, itself too."""
        sorted_times, place = self.times[self.order], np.argsort(self.order)
        most = int(len(place) * (1 - LEAST_KEPT) / 2)
        steps = np.diff(sorted_times)
        reach = float(np.ceil(REACH * (self.correlation_time - 1)) * np.median(steps)) if len(steps) else 0.0
        first = sorted_times.searchsorted(self.times - reach, side="left")
        stop = sorted_times.searchsorted(self.times + reach, side="right")
        return np.maximum(first, place - most), np.minimum(stop, place + most + 1)

    @property
    def is_short(self) -> bool:
        """Whether the neighbours of a record would be more than the share of the records that may be left out."""
        return 2 * REACH * (self.correlation_time - 1) > (1 - LEAST_KEPT) * len(self.times)

    def folds(self, n_folds: int, block: Any = None) -> Iterator[tuple[Rows, Rows]]:
        """Blocks of time dealt in turn to some folds, each after the records that are no neighbours of any of it.

        After all others if the length of a block is given.
        """
        n_rows = len(self.times)
        if block is not None:
            is_timed = np.ptp(self.times) > MOST_ROWS
            stamps = pd.DatetimeIndex(self.times.astype("datetime64[ns]")) if is_timed else self.times
            yield from BlockedKFold(min(n_folds, n_rows), block=block).split(pd.DataFrame(index=stamps))
            return
        longest = max(n_rows // n_folds, 1)
        block = max(n_rows // N_BLOCKS, min(int(np.ceil(BLOCK * self.correlation_time)), longest))
        fold_of = np.empty(n_rows, dtype=np.intp)
        fold_of[self.order] = BlockedKFold(min(n_folds, n_rows), block=block).fold_of(self.records)
        for fold in range(min(n_folds, n_rows)):
            yield self.away_from(fold_of == fold), np.flatnonzero(fold_of == fold)

    def away_from(self, chosen: NDArray[np.bool_]) -> Rows:
        """The records that are no neighbours of any chosen one."""
        first, stop = self.ranges
        before = np.concatenate([[0], np.cumsum(chosen[self.order])])
        return np.flatnonzero(before[stop] == before[first])

    def out_of_fold(self, n_folds: int, index_of: Callable[[Array, Array], Array], block: Any = None) -> Array:
        """Damage index of the records of each fold, a function of the records away from it and of its own."""
        index = np.empty(len(self.times))
        for rest, fold in self.folds(n_folds, block):
            index[fold] = index_of(self.records[rest], self.records[fold])
        return index

    def distances(self, learned: Gaussian) -> Array:
        """Mahalanobis distance of each record from those that are not its neighbours, where no value is missing.

        From the mean and covariance of all records, the sums over its neighbours are taken away. Infinite if the others
        do not determine it.
        """
        scale = np.sqrt(np.diag(learned.covariance))
        standard = ((self.records - learned.mean) / scale)[self.order]
        correlation = learned.covariance / np.outer(scale, scale)
        first, stop = self.ranges[0][self.order], self.ranges[1][self.order]
        distances = np.empty(len(standard))
        for which in parts(len(standard), standard.shape[1] ** 2):
            few = _distances_left_out(standard, correlation, standard[which], first[which], stop[which])
            distances[self.order[which]] = few
        return distances


def _without_season(records: Array, times: Array) -> Array:
    """Columns less their mean and, from a year on, less what the yearly and half-yearly waves explain of them.

    A long table without stamps counts as one year.
    """
    span = np.ptp(times)
    year, length = (YEAR.value, span / DAY_NS) if span > MOST_ROWS else (span + 1, len(times))
    phases = 2 * np.pi / year * np.outer(times, [1, 2] if length >= LEAST_YEAR else [])
    season = np.hstack([np.ones((len(times), 1)), np.cos(phases), np.sin(phases)])
    left = np.empty_like(records)
    for place, column in enumerate(records.T):
        known = ~np.isnan(column)
        left[:, place] = column - season @ np.linalg.lstsq(season[known], column[known], rcond=None)[0]
    return left


def _distances_left_out(rows: Array, correlation: Array, some: Array, first: Rows, stop: Rows) -> Array:
    """Distances of some standardised rows from those outside a range of rows for each."""
    near, n_others = rows[first[0] : stop[-1]], (len(rows) - stop + first)[:, np.newaxis]
    mean = -range_sums(near, first - first[0], stop - first[0]) / n_others
    products = range_sums(near[:, :, np.newaxis] * near[:, np.newaxis, :], first - first[0], stop - first[0])
    moments = (len(rows) * correlation - products) / n_others[:, :, np.newaxis]
    variances, axes = np.linalg.eigh(moments - mean[:, :, np.newaxis] * mean[:, np.newaxis, :])
    along = np.einsum("ijk,ij->ik", axes, some - mean)
    known = variances[:, 0] > SINGULAR * np.linalg.eigvalsh(correlation)[0]
    squared = (along**2 / np.where(known[:, np.newaxis], variances, 1.0)).sum(axis=1)
    return np.where(known, np.sqrt(squared), np.inf)
