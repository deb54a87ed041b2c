"""Records as they come in service: gaps and outliers in runs, as the training records have them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from skthermo._tables.arrays import Array, as_floats, patterns
from skthermo._tables.frames import check_same_rows
from skthermo._tables.times import row_times

MEAN_LENGTH = 25  # of runs of consecutive training records, before records of similar weather take over
TAKEN_FROM = 25  # number of records with the most similar weather, and the same faults, that take over
FEW = 10_000  # records at a joint, up to which computing all distances is about as fast as searching a tree


@dataclass(frozen=True, eq=False)
class ServiceRecords:
    """Gaps and outliers of training records in order of time, as `DataInformedFEM.service_records` gives them.

    Parameters
    ----------
    missing : ndarray of bool of shape (n_records, n_sensors + n_modes)
        Which temperatures and frequencies are not there.
    outliers : ndarray of shape (n_records, n_modes)
        Relative residuals of outliers, NaN where a value is none.
    places : ndarray of shape (n_records, n_coordinates)
        Weather of the records, in coordinates in which similar weather is near.
    """

    missing: NDArray[np.bool_]
    outliers: Array
    places: Array

    @classmethod
    def of(cls, records: Any, residuals: Any) -> ServiceRecords:
        """Learn from training records; a value is an outlier if its residual is far from those of its neighbours."""
        outliers = np.full(np.shape(records.frequencies), np.nan)
        outliers[residuals.rows] = residuals.outliers
        return cls._in_order(records, residuals, as_floats(records.frequencies), outliers)

    @classmethod
    def of_raw(cls, records: Any, residuals: Any, raw: Any, predicted: Array) -> ServiceRecords:
        """Learn from the training records before they were cleaned: what cleaning has changed or removed is an outlier.

        Given are these frequencies, and those that are predicted for the rows.
        """
        measured = as_floats(raw)
        if measured.shape != np.shape(records.frequencies):
            raise ValueError(
                f"outliers has shape {measured.shape}; expected the frequencies that the chain was fitted on before "
                f"they were cleaned, {np.shape(records.frequencies)}, or 'fitted', or the share of outliers"
            )
        check_same_rows(records.frequencies, raw, ("the frequencies of fit", "outliers"))
        is_outlier = ~np.isnan(measured) & (measured != as_floats(records.frequencies))
        outliers = np.where(is_outlier, measured / predicted - 1, np.nan)
        return cls._in_order(records, residuals, measured, outliers)

    @classmethod
    def _in_order(cls, records: Any, residuals: Any, measured: Array, outliers: Array) -> ServiceRecords:
        order = np.argsort(row_times(records.temperatures), kind="stable")
        order = order[records.counted[order]]
        missing = np.isnan(np.hstack([as_floats(records.temperatures), measured]))
        places = pd.DataFrame(places_of(residuals, records.inputs[order])).ffill().bfill()
        return cls(missing[order], outliers[order], places.to_numpy())

    def draw(self, places: Array, random_state: np.random.RandomState) -> NDArray[np.intp]:
        """Positions of the records whose faults rows of weather in order of time have, (n_rows,).

        A row takes the record after the one that the row before it took, so that faults last as long as in training.
        Now and then, a record with the same faults and similar weather takes over before: where a run of faults
        begins, or in records with the most usual faults, which are mostly none. All records are taken equally often.
        """
        n_records, n_rows = len(self.places), len(places)
        if not self.missing.any() and np.isnan(self.outliers).all():
            return np.zeros(n_rows, dtype=np.intp)  # all records are alike
        passes = random_state.uniform(size=n_rows) < 1 / MEAN_LENGTH
        which = random_state.uniform(size=n_rows)
        taken = np.empty(n_rows, dtype=np.intp)
        trees = {joint: cKDTree(self.places[rows]) for joint, rows in self._joints.items() if len(rows) > FEW}
        record = self._similar(0, places[0], which[0], trees) if n_rows else 0
        for row in range(n_rows):
            if row:
                if passes[row] and self._joint_of[record]:
                    record = self._similar(self._joint_of[record], places[row - 1], which[row], trees)
                record = (record + 1) % n_records
            taken[row] = record
        return taken

    def drawn_outliers(self, taken: NDArray[np.intp], random_state: np.random.RandomState) -> Array:
        """Outliers of the records that rows took, (n_rows, n_modes), NaN where a value is none.

        Their sizes are smoothed run by run, with the bandwidth of Silverman's rule on logarithms: the largest of a few
        is not the largest of all that come.
        """
        drawn, logs = self.outliers[taken], np.log(np.abs(self.outliers))
        n_runs = _begins(self.outliers).sum()
        if n_runs < 2:
            return drawn
        mean, deviation, bandwidth = np.nanmean(logs), np.nanstd(logs), (4 / (3 * n_runs)) ** 0.2
        run = np.cumsum(_begins(drawn), axis=0)
        normal = np.take_along_axis(random_state.standard_normal((run.max() + 1, run.shape[1])), run, axis=0)
        smoothed = (np.log(np.abs(drawn)) - mean + bandwidth * deviation * normal) / np.hypot(1, bandwidth)
        return np.sign(drawn) * np.exp(mean + smoothed)

    def _similar(self, joint: int, place: Array, share: float, trees: Mapping[int, cKDTree]) -> int:
        """One of the records at a joint whose weather is most similar, or any where it is unknown."""
        rows = self._joints[joint]
        if len(rows) > TAKEN_FROM and not np.isnan(place).any():
            if joint in trees:
                near = trees[joint].query(place, TAKEN_FROM)[1]
            else:
                distances = ((self.places[rows] - place) ** 2).sum(axis=1)
                near = np.argpartition(distances, TAKEN_FROM)[:TAKEN_FROM]
            rows = rows[near]
        return int(rows[int(share * len(rows))])

    @cached_property
    def _joint_of(self) -> NDArray[np.intp]:
        """From 1 on, the number of the faults of records at which others may take over; 0 for the rest."""
        of_row = patterns(np.hstack([self.missing, ~np.isnan(self.outliers)]))[1]
        begins = np.diff(of_row, prepend=of_row[-1:]) != 0
        return np.where(begins | (of_row == np.bincount(of_row).argmax()), of_row + 1, 0)

    @cached_property
    def _joints(self) -> dict[int, NDArray[np.intp]]:
        """Records by these numbers, and all of them for 0."""
        order = np.argsort(self._joint_of, kind="stable")
        joints, first = np.unique(self._joint_of[order], return_index=True)
        found = dict(zip(joints.tolist(), np.split(order, first[1:]), strict=True))
        return found | {0: np.arange(len(self.places))}


def _begins(outliers: Array) -> NDArray[np.bool_]:
    """Where a run of outliers of a mode begins."""
    is_outlier = ~np.isnan(outliers)
    return is_outlier & ~np.vstack([np.zeros((1, outliers.shape[1]), dtype=bool), is_outlier[:-1]])


def places_of(residuals: Any, weather: Array) -> Array:
    """Coordinates of weather; NaN where it is unknown."""
    known = ~np.isnan(weather).any(axis=1)
    places = np.full((len(weather), residuals.places.shape[1]), np.nan)
    if known.any():
        places[known] = residuals.coordinates.transform(weather[known])
    return places
