"""Fills gaps in monitoring records."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree
from sklearn.impute import KNNImputer

from skthermo._core.arrays import Array, rows_by_pattern
from skthermo._core.estimators import _check_feature_names_in, _get_weights, check_array, check_is_fitted, validate_data
from skthermo._core.frames import frame_like, marker_findings, named_frame
from skthermo._core.warnings import warn_each

Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]
PAIRS_PER_TREE = 50_000  # below so many pairs of receiver and donor, computing all distances is faster than a tree
PAIRS_AT_ONCE = 1_000_000  # pairs whose distances are in memory
FEW_PAIRS = 10_000_000  # below so many pairs of receiver and donor, computing all distances is faster
PAIRS_PER_POOL = 2000  # searching one pool takes about as long as so many distances


class KNNGapImputer(KNNImputer):
    """Fill gaps with the mean of the nearest records in which the value is present.

    scikit-learn's ``KNNImputer``, fast enough for years of hourly records. It takes ten neighbours, as the
    paper does; a frame stays a frame with its index; and a column without any value is an error instead of
    being dropped.

    Parameters
    ----------
    missing_values : int, float, str, numpy.nan, None or pandas.NA, default=numpy.nan
        The value that marks a missing value.
    n_neighbors : int, default=10
        Number of neighbours.
    weights : {"uniform", "distance"} or callable, default="uniform"
        Weights of the neighbours.
    metric : {"nan_euclidean"} or callable, default="nan_euclidean"
        Distance between rows.
    copy : bool, default=True
        True leaves the input unchanged; False may overwrite it.
    add_indicator : bool, default=False
        Whether to append a column of zeros and ones for each column with gaps; 1 marks a gap.
    keep_empty_features : bool, default=False
        True fills a column without any value with zeros; otherwise it is an error.

    Attributes
    ----------
    is_empty_ : ndarray of bool
        Columns that had no value in `fit`.
    donors_ : object or None
        Records of `fit`, prepared for the search of neighbours; None where ``KNNImputer`` does the search.
    findings_ : list of SkthermoWarning
        Doubts about the records of `fit`, which it also gives as warnings.
    indicator_ : MissingIndicator or None
        Makes the columns of ``add_indicator``.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of columns and, where `fit` saw a frame with such, their names.

    See Also
    --------
    sklearn.impute.KNNImputer : The parameters in full.

    Notes
    -----
    The results equal ``KNNImputer``'s, in a time that grows as n log n, not as n squared. ``KNNImputer`` itself does
    the work for few rows, for very many different patterns of missing columns, for another metric, and for other
    ``missing_values`` than NaN. Where several rows are equally far away, the two may choose different neighbours; with
    ``weights="distance"`` the ninth digit can differ.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from skthermo.preprocessing import KNNGapImputer
    >>> F = pd.DataFrame({"f1": [4.0, 4.1, np.nan, 4.3], "f2": [5.0, 5.1, 5.1, 5.3]})
    >>> KNNGapImputer(n_neighbors=1).fit_transform(F).loc[[2]]
        f1   f2
    2  4.1  5.1
    """

    def __init__(
        self,
        *,
        missing_values: Any = np.nan,
        n_neighbors: int = 10,
        weights: Any = "uniform",
        metric: Any = "nan_euclidean",
        copy: bool = True,
        add_indicator: bool = False,
        keep_empty_features: bool = False,
    ):
        super().__init__(
            missing_values=missing_values,
            n_neighbors=n_neighbors,
            weights=weights,
            metric=metric,
            copy=copy,
            add_indicator=add_indicator,
            keep_empty_features=keep_empty_features,
        )

    def fit(self, X: ArrayLike, y: None = None) -> KNNGapImputer:
        """Store the records among which neighbours are searched.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Records with gaps, such as temperatures and frequencies side by side.
        y : None
            Ignored.

        Returns
        -------
        KNNGapImputer
            The fitted imputer.

        Raises
        ------
        ValueError
            If a column has no value, unless ``keep_empty_features=True``.

        Warns
        -----
        UserWarning
            If there are numbers that stand for a missing value, such as -999, while ``missing_values`` is NaN.
        """
        if isinstance(self.n_neighbors, bool):
            raise ValueError(f"n_neighbors is {self.n_neighbors}; expected an integer")
        if isinstance(self.weights, type) or isinstance(self.metric, type):
            raise ValueError(f"weights is {self.weights!r} and metric {self.metric!r}; expected no class")
        values = check_array(X, input_name="X")
        super().fit(named_frame(X, values), y)
        kept = set(super().get_feature_names_out())
        self.is_empty_ = np.array([name not in kept for name in _check_feature_names_in(self, None)])
        if self.is_empty_.any() and not self.keep_empty_features:
            empty = list(_check_feature_names_in(self, None)[self.is_empty_])
            raise ValueError(
                f"the columns {empty} are missing in all {len(values)} rows; expected values to impute from: "
                "leave them out, or keep_empty_features=True fills them with zeros"
            )
        self.donors_, self.findings_ = None, []
        if self.metric == "nan_euclidean" and isinstance(self.missing_values, float) and np.isnan(self.missing_values):
            self.donors_ = Donors(values)
            self.findings_ = marker_findings(named_frame(X, values))
        warn_each(self.findings_)
        return self

    @overload
    def transform(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def transform(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Fill the gaps.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Records with gaps.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_features)
            A frame gives a frame on its own index.
        """
        check_is_fitted(self)
        values = validate_data(self, X, reset=False)
        names = [*getattr(X, "columns", ()), *self.get_feature_names_out()[self.n_features_in_ :]]
        if self.donors_ is None or not self.donors_.trees_are_faster(np.isnan(values)):
            return frame_like(X, np.asarray(super().transform(named_frame(X, values))), names)
        filled = self._filled(values)
        if self.add_indicator:
            filled = np.hstack([filled, self.indicator_.transform(np.isnan(values))])
        return frame_like(X, filled, names)

    def _filled(self, values: NDArray) -> NDArray:
        """Fill each missing column of rows with the same missing columns with means of their nearest donors."""
        filled = values.copy()
        for missing, rows in rows_by_pattern(np.isnan(values)):
            observed = ~missing
            for column in np.flatnonzero(missing & ~self.is_empty_):
                distances, donors = self.donors_.nearest(values[rows], observed, column, self.n_neighbors)
                filled[rows, column] = self._mean(distances, self.donors_.values[donors, column], column)
        filled[:, self.is_empty_] = 0
        return filled

    def _mean(self, distances: NDArray, values: NDArray, column: int) -> NDArray:
        present = np.isfinite(distances)
        weights = _get_weights(np.where(present, distances, np.nan), self.weights)
        weights = np.where(present, 1.0 if weights is None else weights, 0.0)
        total = weights.sum(axis=1)
        mean = np.full(len(values), self.donors_.mean(column))
        np.divide((weights * np.where(present, values, 0)).sum(axis=1), total, out=mean, where=total > 0)
        return mean

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Names of the columns: the input's names, then the names of the indicators.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the input's columns; by default those seen in `fit`.

        Returns
        -------
        ndarray of str
            Names of the columns, indicators included.
        """
        check_is_fitted(self)
        names = list(_check_feature_names_in(self, input_features))
        indicators = [name for name in super().get_feature_names_out(input_features) if name not in names]
        return np.array(names + indicators, dtype=object)


class Donors:
    """Rows (donors) from which gaps of others (receivers) are filled, grouped by their missing columns.

    For a receiver and all donors of one group, the columns that both have are the same. The distance that ignores NaN
    is then the Euclidean distance in these shared columns, times the square root of (all columns / shared columns), and
    a k-d tree can find the nearest donors.
    """

    def __init__(self, values: Array):
        self.values = values
        missing = np.isnan(values)
        self.patterns = rows_by_pattern(missing)
        self._known = np.ascontiguousarray(~missing.T, dtype=float)
        filled = np.where(missing, 0.0, values)
        self._centre = filled.sum(axis=0) / np.maximum(self._known.sum(axis=1), 1)
        self._filled = np.ascontiguousarray(np.where(missing, 0.0, values - self._centre).T)

    def mean(self, column: int) -> float:
        """Mean of a column, NaN ignored."""
        return float(np.nanmean(self.values[:, column]))

    def trees_are_faster(self, missing: Mask) -> bool:
        """Whether searching trees is expected to take less time than computing all distances."""
        gappy = missing[missing.any(axis=1)]
        n_pairs = len(gappy) * len(self.values)
        if n_pairs < FEW_PAIRS:
            return False
        return len(rows_by_pattern(gappy)) * len(self.patterns) * PAIRS_PER_POOL < n_pairs

    def nearest(self, receivers: Array, observed: Mask, column: int, n_neighbors: int) -> tuple[Array, Rows]:
        """Distances and row numbers of the nearest donors that have a value in a column, both (n_receivers,
        n_neighbors) and ascending. If there are fewer donors, the remaining distances are infinite and row numbers 0.
        """
        distances = np.full((len(receivers), n_neighbors), np.inf)
        rows = np.zeros((len(receivers), n_neighbors), dtype=np.intp)
        others = []
        for shared, members in self._pools(observed, column, len(receivers)):
            if len(receivers) * len(members) < PAIRS_PER_TREE:
                others.append(members)
                continue
            scale = np.sqrt(len(shared) / shared.sum())
            # Building the tree takes most of the time, and these options make it quick.
            pool = self.values[np.ix_(members, shared)]
            tree = cKDTree(pool, leafsize=32, balanced_tree=False, compact_nodes=False)
            points, order = receivers[:, shared], [*range(1, min(n_neighbors, len(pool)) + 1)]
            # A query has one bound for all its receivers, so those with near neighbours go together.
            for block in np.array_split(np.argsort(distances[:, -1]), math.ceil(len(points) / 512)):
                # A neighbour exactly at the bound must be found in spite of rounding.
                within = distances[block[-1], -1] / scale * (1 + 1e-9) + 1e-300
                found, at = tree.query(points[block], k=order, distance_upper_bound=within)
                _merge(distances, rows, block, found * scale, members[np.where(np.isinf(found), 0, at)])
        if others:
            members = np.concatenate(others)
            scale, size = np.sqrt(len(observed)), math.ceil(PAIRS_AT_ONCE / len(members))
            for block in np.split(np.arange(len(receivers)), range(size, len(receivers), size)):
                found, at = self._nearest_of_all(receivers[block], observed, members, n_neighbors)
                _merge(distances, rows, block, found * scale, at)
        return distances, rows

    def _pools(self, observed: Mask, column: int, n_receivers: int) -> Iterator[tuple[Mask, Rows]]:
        """Donors that share the same columns with the receivers, as (columns, rows); largest pool first.

        For few receivers all donors that share any column are one pool.
        """
        if n_receivers * len(self.values) < PAIRS_PER_TREE:
            members = np.flatnonzero(self._known[column] * self._known[observed].any(axis=0))
            if len(members):
                yield observed, members
            return
        pools: dict[bytes, tuple[Mask, list[Rows]]] = {}
        for missing, rows in self.patterns:
            shared = observed & ~missing
            if not missing[column] and shared.any():
                pools.setdefault(shared.tobytes(), (shared, []))[1].append(rows)
        joined = [(shared, np.concatenate(rows)) for shared, rows in pools.values()]
        yield from sorted(joined, key=lambda pool: -len(pool[1]))

    def _nearest_of_all(self, receivers: Array, observed: Mask, members: Rows, n_neighbors: int) -> tuple[Array, Rows]:
        """Root mean squares of the differences from the nearest of some rows, in the columns that both have, and these
        rows."""
        places = np.ix_(np.flatnonzero(observed), members)
        known, pool = self._known[places], self._filled[places]
        points = (receivers - self._centre)[:, observed]
        n_known = known.sum(axis=0)
        squares = points**2 @ known - 2 * points @ pool + (pool**2).sum(axis=0)  # it loses digits, and only chooses
        k = min(n_neighbors, len(members))
        at = np.argpartition(squares / n_known, k - 1, axis=1)[:, :k]
        differences = known[:, at] * (points.T[:, :, np.newaxis] - pool[:, at])
        return np.sqrt((differences**2).sum(axis=0) / n_known[at]), members[at]


def _merge(distances: Array, rows: Rows, block: Rows, found: Array, found_rows: Rows) -> None:
    """Replace the nearest donors of a block of receivers where a new one is nearer, in place."""
    closer = (found < distances[block, -1:]).any(axis=1)
    block, found, found_rows = block[closer], found[closer], found_rows[closer]
    both = np.hstack([distances[block], found])
    nearest = np.argsort(both, axis=1, kind="stable")[:, : distances.shape[1]]
    distances[block] = np.take_along_axis(both, nearest, axis=1)
    rows[block] = np.take_along_axis(np.hstack([rows[block], found_rows]), nearest, axis=1)
