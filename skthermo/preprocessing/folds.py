"""What to expect of records: folds of blocks of time, what the weather says out of fold, and neighbours in time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from numbers import Integral
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.model_selection import BaseCrossValidator

from skthermo._core.arrays import NORMAL, Array, median, piecewise_linear, robust_deviation, spread_evenly
from skthermo._core.estimators import _num_samples
from skthermo._core.frames import Table, check_duration, has_stamps, row_times

WEEK = "7D"
BLOCKS_OF_ROWS = 52  # into which records without stamps are divided: weeks, if they are those of a year
BLOCKS_OF_A_FOLD = 2  # at least, in different seasons
MOST_COORDINATES = 3  # principal components of the weather
EXPLAINED = 0.99  # share of its variance that is enough
N_FILLS = 20  # steps in which the components fill gaps
KNOTS = (0.25, 0.5, 0.75)  # quantiles at which lines may break
MOST_LEARNED = 20_000  # rows, evenly spread, from which anything is learned
PENALTY = 1e-4  # of the ridge, per row
TRIMMED = 5.0  # robust deviations beyond which a row does not train a second time


class BlockedKFold(BaseCrossValidator):
    """Folds of blocks of time, dealt in turn: the first block to the first fold, the second to the second, and so on.

    Each fold then holds records of all seasons that there are, and so do the records that it is predicted from. With
    ``KFold``, whose folds are long periods, the records of a fold are predicted from other seasons, and with random
    folds from their neighbours in time, which are nearly the same records.

    Parameters
    ----------
    n_splits : int, default=5
        Number of folds, at least 2.
    block : int or duration, optional
        Length of a block: a number of rows or, for frames on a ``DatetimeIndex``, a duration such as "7D". It should be
        several times as long as records remember what was before them. By default a week on a ``DatetimeIndex``, else
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
        longest = len(times) // (BLOCKS_OF_A_FOLD * self.n_splits)
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
            return check_duration(WEEK if self.block is None else self.block, "block", may_be_zero=False)
        if self.block is not None:
            raise ValueError(f"block is {self.block!r}, but X has no DatetimeIndex; expected a number of rows")
        return max(_num_samples(X) // BLOCKS_OF_ROWS, 1)

    def _iter_test_masks(self, X: Any = None, y: Any = None, groups: Any = None) -> Iterator[NDArray[np.bool_]]:
        folds = self.fold_of(X)
        for fold in range(self.n_splits):
            yield folds == fold


Rows = NDArray[np.intp]


def out_of_fold(learn: Callable[[Rows], Callable[[Rows], ArrayLike]], folds: Rows | list[tuple[Rows, Rows]]) -> Array:
    """Value of each row, by what was learned from other rows.

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
    if isinstance(folds, np.ndarray):
        n_rows = len(folds)
        tests = [folds == fold for fold in np.unique(folds[folds >= 0])]
        folds = [(np.flatnonzero(~test), np.flatnonzero(test)) for test in tests]
    else:
        n_rows = 1 + max(rows.max(initial=-1) for pair in folds for rows in pair)
    found = [(test, np.asarray(learn(train)(test), dtype=float)) for train, test in folds]
    values = np.full((n_rows, *(found[0][1].shape[1:] if found else ())), np.nan)
    for test, value in found:
        values[test] = value
    return values


@dataclass(frozen=True)
class WeatherBasis:
    """Principal components of the temperatures, gaps filled by them, and lines that break at quantiles of each."""

    centre: Array
    scale: Array
    components: Array
    knots: Array

    @classmethod
    def of(cls, temperatures: Array) -> WeatherBasis:
        """Learn from records."""
        values = temperatures[spread_evenly(np.arange(len(temperatures)), MOST_LEARNED)]
        known = ~np.isnan(values)
        counts = np.maximum(known.sum(axis=0), 1)
        centre = np.where(known, values, 0.0).sum(axis=0) / counts
        scale = np.sqrt(np.where(known, (values - centre) ** 2, 0.0).sum(axis=0) / counts)
        scale = np.where(scale > 1e-12 * np.maximum(np.abs(centre), 1.0), scale, np.inf)
        standard = (values - centre) / scale
        filled = np.where(known, standard, 0.0)
        for _ in range(N_FILLS if not known.all() else 1):
            variances, vectors = np.linalg.eigh(filled.T @ filled)
            variances, vectors = variances[::-1], vectors[:, ::-1]
            n_needed = 1 + np.searchsorted(np.cumsum(variances), EXPLAINED * max(variances.sum(), 1e-300))
            components = vectors[:, : min(MOST_COORDINATES, n_needed)].T
            filled = np.where(known, standard, filled @ components.T @ components)
        return cls(centre, scale, components, np.quantile(filled @ components.T, KNOTS, axis=0))

    def coordinates(self, temperatures: Array) -> Array:
        """Components of each row, (n_samples, n_components); NaN where no sensor has a value."""
        known = ~np.isnan(temperatures)
        standard = np.where(known, (temperatures - self.centre) / self.scale, 0.0)
        places = standard @ self.components.T
        gaps = ~known.all(axis=1)
        for _ in range(N_FILLS if gaps.any() else 0):
            places[gaps] = np.where(known[gaps], standard[gaps], places[gaps] @ self.components) @ self.components.T
        places[~known.any(axis=1)] = np.nan
        return places

    def lines(self, places: Array) -> Array:
        """Piecewise-linear functions of the coordinates, with a constant first."""
        return np.hstack([np.ones((len(places), 1)), piecewise_linear(places, self.knots)])


class Grams(NamedTuple):
    """Products of inputs with inputs and with each mode, by fold."""

    inputs: Array
    targets: Array
    counts: Array

    @classmethod
    def of(cls, inputs: Array, values: Array, folds: NDArray[np.intp]) -> Grams:
        """Products over the rows of each fold that have an input and a value."""
        n_folds, n_modes, n_inputs = folds.max() + 1, values.shape[1], inputs.shape[1]
        grams = cls(
            np.zeros((n_folds, n_modes, n_inputs, n_inputs)),
            np.zeros((n_folds, n_modes, n_inputs)),
            np.zeros((n_folds, n_modes)),
        )
        usable = ~np.isnan(inputs).any(axis=1)
        for fold in range(n_folds):
            rows = np.flatnonzero(usable & (folds == fold))
            X, Y = inputs[rows], values[rows]
            known = ~np.isnan(Y)
            whole = X.T @ X if known.any() else None
            for mode in range(n_modes):
                n_known = np.count_nonzero(known[:, mode])
                if not n_known:
                    continue
                x = X if n_known == len(X) else X[known[:, mode]]
                grams.inputs[fold, mode] = whole if n_known == len(X) else x.T @ x
                grams.targets[fold, mode] = x.T @ Y[known[:, mode], mode]
                grams.counts[fold, mode] = n_known
        return grams

    def coefficients(self) -> Array:
        """Ridge coefficients of each mode without each of the folds, (n_folds, n_modes, n_inputs)."""
        others = 1.0 - np.eye(len(self.counts))
        gram, target, counts = (np.tensordot(others, part, 1) for part in self)
        identity = np.eye(gram.shape[-1])
        penalty = PENALTY * np.maximum(counts, 1.0)[..., np.newaxis] * np.ones(len(identity))
        penalty[..., 0] = 1e-9  # of the constant
        return np.linalg.solve(gram + penalty[..., np.newaxis] * identity, target[..., np.newaxis])[..., 0]


def predicted_by_weather(inputs: Array, values: Array, folds: NDArray[np.intp], *, trim: bool = True) -> Array:
    """Predictions of each fold's rows from the others, far values left out of the second of two fits by ``trim``."""
    centre = median(values)
    centred = trained = values - centre
    for _ in range(2 if trim else 1):
        predicted = np.empty_like(values)
        for fold, coefficients in enumerate(Grams.of(inputs, trained, folds).coefficients()):
            rows = folds == fold
            predicted[rows] = inputs[rows] @ coefficients.T
        trained = without_far(centred, centred - predicted)
    return predicted + centre


def without_far(values: Array, residuals: Array) -> Array:
    """NaN in place of values whose residuals are far from the median of their column."""
    with np.errstate(invalid="ignore"):
        far = np.abs(residuals - median(residuals)) > TRIMMED * robust_deviation(residuals)
    return np.where(far, np.nan, values)


def distances_from_neighbours(values: Array, times: Array, window: int | pd.Timedelta) -> tuple[Array, Array]:
    """Distance of each value from the median of its neighbours in time, and the standard deviation of the distances.

    That is estimated by the median of the neighbours' distances.
    """
    order = np.argsort(times, kind="stable")
    table = pd.DataFrame(values[order])
    if isinstance(window, pd.Timedelta):
        table.index = pd.to_datetime(times[order], unit="ns")
    around = {"window": window, "center": True, "min_periods": 1}
    distances = table - table.rolling(**around).median()
    local = NORMAL * distances.abs().rolling(**around).median()
    back = np.argsort(order)
    return distances.to_numpy()[back], local.to_numpy()[back]
