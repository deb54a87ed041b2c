"""Folds of blocks of time, and the loop that predicts the rows of each fold from the others."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.model_selection import BaseCrossValidator

from skthermo._core.arrays import Array
from skthermo._core.estimators import _num_samples
from skthermo._core.frames import Table, check_duration, has_stamps, row_times


class BlockedKFold(BaseCrossValidator):
    """Folds of blocks of time, dealt in turn: the first block to the first fold, the second to the second, and so on.

    Each fold then holds records of all seasons, and so do its training records. The folds of ``KFold`` are long
    periods, whose records are predicted from other seasons. Records of random folds are predicted from their neighbours
    in time, which are nearly the same records.

    Parameters
    ----------
    n_splits : int, default=5
        Number of folds, at least 2.
    block : int or duration, optional
        Length of a block: a number of rows or, for frames on a ``DatetimeIndex``, a duration such as "7D". It should be
        several times as long as the correlation of successive records. By default a week on a ``DatetimeIndex``, else
        a 52nd of the rows; shorter where the records are fewer than a block for each fold.

    See Also
    --------
    skthermo.detection.TemperatureCompensator : Predicts the records of its baseline by such folds.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.preprocessing import BlockedKFold
    >>> for train, test in BlockedKFold(2, block=3).split(np.zeros((10, 1))):
    ...     print(train, test)
    [3 4 5 9] [0 1 2 6 7 8]
    [0 1 2 6 7 8] [3 4 5 9]
    """

    def __init__(self, n_splits: int = 5, *, block: Any = None):
        self.n_splits = n_splits
        self.block = block

    def get_n_splits(self, X: Any = None, y: Any = None, groups: Any = None) -> int:
        """Number of folds.

        Parameters
        ----------
        X, y, groups : object
            Ignored.

        Returns
        -------
        int
            Number of folds.
        """
        return self.n_splits

    def fold_of(self, X: Table) -> NDArray[np.intp]:
        """The fold of every row, counted from 0.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Records; the index of a frame tells their times.

        Returns
        -------
        ndarray of shape (n_samples,)
            From 0 to ``n_splits - 1``.

        Raises
        ------
        ValueError
            If there are fewer rows than folds, or ``n_splits`` or ``block`` is not as described.
        """
        if not isinstance(self.n_splits, Integral) or isinstance(self.n_splits, bool) or self.n_splits < 2:
            raise ValueError(f"n_splits is {self.n_splits!r}; expected an integer of 2 or more")
        times = row_times(X)
        n_rows = len(times)
        if n_rows < self.n_splits:
            raise ValueError(f"{n_rows} rows are fewer than {self.n_splits} folds; expected a row for each")
        positions, length = times - times.min(), self.length(X)
        ranks = np.argsort(np.argsort(times, kind="stable"))
        if (is_rows := isinstance(length, int)) or not has_stamps(X):
            positions = ranks
        blocks = np.unique(positions // (length if is_rows else length.as_unit("ns").value), return_inverse=True)[1]
        if blocks.max() + 1 < self.n_splits:
            blocks = ranks * self.n_splits // n_rows
        return blocks % self.n_splits

    def remembering(self, X: Table, n_records: float) -> BlockedKFold:
        """Folds whose blocks hold so many records or more, as far as each fold keeps two blocks.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Records; the index of a frame tells their times.
        n_records : float
            Least number of records in a block, such as five correlation times.

        Returns
        -------
        BlockedKFold
            The same folds where their blocks are long enough.

        Examples
        --------
        >>> import numpy as np
        >>> from skthermo.preprocessing import BlockedKFold
        >>> BlockedKFold(2, block=3).remembering(np.zeros((100, 1)), 10.2)
        BlockedKFold(block=11, n_splits=2)
        """
        times, is_timed = np.sort(row_times(X)), has_stamps(X)
        step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
        longest = len(times) // (2 * self.n_splits)  # two blocks of a fold, in different seasons
        least = min(int(np.ceil(n_records)), longest)
        length = self.length(X)
        if isinstance(length, int) or not is_timed:
            return self if least <= length else BlockedKFold(self.n_splits, block=least)
        wanted = pd.Timedelta(int(least * step), "ns")
        return self if wanted <= length else BlockedKFold(self.n_splits, block=wanted)

    def length(self, X: Table) -> int | pd.Timedelta:
        """Length of a block of records.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Records; the index of a frame tells their times.

        Returns
        -------
        int or Timedelta
            Number of rows, or duration.

        Raises
        ------
        ValueError
            If ``block`` is not as described.
        """
        if isinstance(self.block, Integral) and not isinstance(self.block, (bool, np.timedelta64)):
            if self.block < 1:
                raise ValueError(f"block is {self.block!r}; expected a number of rows of 1 or more, or a duration")
            return int(self.block)
        if has_stamps(X):
            return check_duration("7D" if self.block is None else self.block, "block", may_be_zero=False)
        if self.block is not None:
            raise ValueError(f"block is {self.block!r}, but X has no DatetimeIndex; expected a number of rows")
        return max(_num_samples(X) // 52, 1)  # weeks, if the rows are those of a year

    def _iter_test_masks(self, X: Any = None, y: Any = None, groups: Any = None) -> Iterator[NDArray[np.bool_]]:
        folds = self.fold_of(X)
        for fold in range(self.n_splits):
            yield folds == fold


Rows = NDArray[np.intp]


def out_of_fold(learn: Callable[[Rows], Callable[[Rows], ArrayLike]], folds: Rows | list[tuple[Rows, Rows]]) -> Array:
    """Value of each row, predicted by a model of other rows.

    Parameters
    ----------
    learn : callable
        Takes the positions of training rows; gives a function that takes the positions of test rows and gives their
        values, (n_test_rows, ...).
    folds : ndarray of int of shape (n_rows,), or list of pairs of rows
        The fold of each row, or training and test rows of each fold. A row that no fold tests, with a negative number
        or in no test rows, has the value NaN.

    Returns
    -------
    ndarray of shape (n_rows, ...)
        Values of all rows, in their order.

    Examples
    --------
    >>> import numpy as np
    >>> y = np.array([1.0, 2.0, 3.0, 4.0])
    >>> out_of_fold(lambda train: lambda test: np.full(len(test), y[train].mean()), np.array([0, 0, 1, 1]))
    array([3.5, 3.5, 1.5, 1.5])
    """
    n_rows, splits = len(folds), folds
    if isinstance(folds, np.ndarray):
        splits = []
        for number in np.flatnonzero(np.bincount(folds[folds >= 0])):
            splits.append((np.flatnonzero(folds != number), np.flatnonzero(folds == number)))
    else:
        n_rows = 1 + max(int(rows.max(initial=-1)) for pair in folds for rows in pair)
    values = np.full(n_rows, np.nan)
    for place, (train, test) in enumerate(splits):
        found = np.asarray(learn(train)(test), dtype=float)
        if place == 0:
            values = np.full((n_rows, *found.shape[1:]), np.nan)
        values[test] = found
    return values
