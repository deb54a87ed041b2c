"""Noise, gaps and outliers as the training records have them, for records that monitoring would take."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from skthermo._core.arrays import Array, as_floats, as_random_state, check_noise, is_real, patterns
from skthermo._core.frames import check_same_rows, row_times
from skthermo._core.saved_frames import SavesFrames
from skthermo.residuals.baseline import BaselineResiduals
from skthermo.surrogate.chain._records import TrainingRecords
from skthermo.surrogate.chain._thermal import ThermalModel, Weather

TAKEN_FROM = 25  # number of records with the most similar weather, and the same faults, that take over


@dataclass(frozen=True, eq=False)
class ServiceRecords:
    """Gaps and outliers of training records in order of time, as `RecordSimulator.service_of` gives them.

    ``missing`` temperatures and frequencies, (n_records, n_sensors + n_modes); relative residuals of ``outliers``,
    (n_records, n_modes), NaN where a value is none; ``places``, (n_records, n_coordinates), near for similar weather.
    """

    missing: NDArray[np.bool_]
    outliers: Array
    places: Array

    @classmethod
    def learned(cls, records: TrainingRecords, residuals: BaselineResiduals) -> ServiceRecords:
        """Learn from training records; a value is an outlier if its residual is far from its neighbours' residuals."""
        outliers = np.full(np.shape(records.frequencies), np.nan)
        outliers[residuals.rows] = residuals.outliers
        return cls._in_order(records, residuals, as_floats(records.frequencies), outliers)

    @classmethod
    def learned_from_raw(
        cls, records: TrainingRecords, residuals: BaselineResiduals, raw: ArrayLike, predicted: Array
    ) -> ServiceRecords:
        """Learn from raw frequencies of the training records: what cleaning has changed or removed is an outlier."""
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
    def _in_order(
        cls, records: TrainingRecords, residuals: BaselineResiduals, measured: Array, outliers: Array
    ) -> ServiceRecords:
        order = np.argsort(row_times(records.temperatures), kind="stable")
        order = order[records.counted[order]]
        missing = np.isnan(np.hstack([as_floats(records.temperatures), measured]))
        places = pd.DataFrame(places_of(residuals, records.inputs[order])).ffill().bfill()
        return cls(missing[order], outliers[order], places.to_numpy())

    @property
    def has_faults(self) -> bool:
        """Whether there is a gap or an outlier."""
        return bool(self.missing.any() or not np.isnan(self.outliers).all())

    def draw(
        self, places: Array, random_state: np.random.RandomState, *, mean_length: float = 25, many: int = 10_000
    ) -> NDArray[np.intp]:
        """Positions, (n_rows,), of the records from which rows of weather in order of time take their faults.

        A row takes the record after the one that the row before it took, so that faults last as long as in training.
        Now and then, after a run of ``mean_length`` records in the mean, a record with the same faults and similar
        weather takes over: where a run of faults begins, or in records with the most usual faults, which are mostly
        none. All records are taken equally often. Of ``many`` records, searching a tree is faster than computing all
        distances.
        """
        n_records, n_rows = len(self.places), len(places)
        if not self.has_faults:
            return np.zeros(n_rows, dtype=np.intp)  # all records are alike
        passes = random_state.uniform(size=n_rows) < 1 / mean_length
        which = random_state.uniform(size=n_rows)
        taken = np.empty(n_rows, dtype=np.intp)
        trees = {joint: cKDTree(self.places[rows]) for joint, rows in self._joints.items() if len(rows) > many}
        record = self._similar(0, places[0], which[0], trees) if n_rows else 0
        for row in range(n_rows):
            if row:
                if passes[row] and self._joint_of[record]:
                    record = self._similar(self._joint_of[record], places[row - 1], which[row], trees)
                record = (record + 1) % n_records
            taken[row] = record
        return taken

    def drawn_outliers(self, taken: NDArray[np.intp], random_state: np.random.RandomState) -> Array:
        """Outliers of the records that rows took, (n_rows, n_modes), NaN where a value is none; sizes are smoothed
        run by run, with the bandwidth of Silverman's rule on logarithms."""
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


def places_of(residuals: BaselineResiduals, weather: Array) -> Array:
    """Coordinates of weather; NaN where it is unknown."""
    known = ~np.isnan(weather).any(axis=1)
    places = np.full((len(weather), residuals.places.shape[1]), np.nan)
    if known.any():
        places[known] = residuals.coordinates.transform(weather[known])
    return places


@dataclass(frozen=True, eq=False)
class RecordSimulator(SavesFrames):
    """Draws what monitoring adds to the frequencies of a thermal model, as its training records show it.

    Records that were drawn themselves have the ``gaps_and_outliers`` of other records. `DataInformedFEM.simulate`
    describes the arguments ``noise``, ``gaps``, ``outliers`` and ``random_state``; weather comes from
    `DataInformedFEM.weather`.
    """

    model: ThermalModel
    records: TrainingRecords
    gaps_and_outliers: ServiceRecords | None = None

    @cached_property
    def residuals(self) -> BaselineResiduals:
        """Out-of-fold residuals of the training records by weather, for which the mapper is fitted in each fold."""
        return self.records.residuals(self.model)

    @cached_property
    def service(self) -> ServiceRecords:
        """Gaps and outliers of the training records."""
        return self.gaps_and_outliers or ServiceRecords.learned(self.records, self.residuals)

    def service_of(self, F: ArrayLike | None = None) -> ServiceRecords:
        """Gaps and outliers of the training records.

        With their frequencies before cleaning, outliers are what cleaning has changed or removed.
        """
        if F is None:
            return self.service
        expected = self.records.modelled * np.exp(self.model.discrepancy.at(self.records.inputs))
        return ServiceRecords.learned_from_raw(self.records, self.residuals, F, expected)

    def noise(
        self,
        weather: Weather,
        noise: ArrayLike | Literal["fitted"] = "fitted",
        gaps: float | Literal["fitted"] | None = None,
        outliers: ArrayLike | Literal["fitted"] | ServiceRecords | None = None,
        random_state: int | np.random.RandomState | None = None,
    ) -> Array:
        """Relative noise, (n_rows, n_modes), which is added to 1; NaN where a mode is missing."""
        check_faults(gaps, outliers)
        random, names = as_random_state(random_state), self.model.mode_names
        streams, shape = fault_streams(random), (len(weather), len(names))
        is_fitted = isinstance(noise, str)
        if is_fitted and noise != "fitted":
            raise ValueError(f'noise is {noise!r}; expected "fitted" or relative standard deviations')
        if not is_fitted:
            values = check_noise(noise, len(names), names) * random.standard_normal(shape)
        else:
            order = np.argsort(row_times(weather.given), kind="stable")
            inputs, residuals = weather.inputs[order], self.residuals
            if gaps is None and outliers is None:
                values = residuals.draw(inputs, random)[np.argsort(order)]
            else:
                values = residuals.draw_complete(inputs, random, outliers is not None)[np.argsort(order)]
            if gaps is None and outliers is not None:
                gaps = "fitted"  # of the records that the noise, which was completed for the outliers, is of
        if are_drawn(gaps) or are_drawn(outliers):
            service, taken = self._taken(weather, outliers, streams[0])
        if are_drawn(outliers):
            drawn = service.drawn_outliers(taken, streams[2])
            values = np.where(np.isnan(drawn), values, drawn)
        elif outliers is not None:
            values = values * np.where(streams[2].uniform(size=shape) < outliers, 10.0, 1.0)
        if are_drawn(gaps):
            return np.where(service.missing[taken, -len(names) :], np.nan, values)
        return values if gaps is None else np.where(streams[1].uniform(size=shape) < gaps, np.nan, values)

    def gaps(
        self,
        weather: Weather,
        gaps: float | Literal["fitted"] | None = "fitted",
        outliers: ArrayLike | Literal["fitted"] | ServiceRecords | None = None,
        random_state: int | np.random.RandomState | None = None,
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which temperatures, (n_rows, n_sensors), and frequencies, (n_rows, n_modes), are missing.

        `noise` leaves out the same modes if gaps, outliers and the seed, an integer, are the same. Sensors have gaps
        with "fitted" only.
        """
        if gaps is None:
            raise ValueError("gaps is None; expected 'fitted', or the share of the values that are missing")
        check_faults(gaps, outliers)
        streams = fault_streams(as_random_state(random_state))
        n_sensors, n_modes = np.shape(weather.filled)[1], len(self.model.mode_names)
        if are_drawn(gaps):
            service, taken = self._taken(weather, outliers, streams[0])
            return service.missing[taken, :n_sensors], service.missing[taken, n_sensors:]
        if np.ndim(outliers):
            self.service_of(outliers)  # which refuses what is not of the training records
        single = streams[1].uniform(size=(len(weather), n_modes)) < gaps
        return np.zeros((len(weather), n_sensors), dtype=bool), single

    def _taken(
        self, weather: Weather, outliers: Any, stream: np.random.RandomState
    ) -> tuple[ServiceRecords, NDArray[np.intp]]:
        """Gaps and outliers of the training records, and the position of the record that each row takes them from."""
        if isinstance(outliers, ServiceRecords):
            service = outliers
        else:
            service = self.service_of(outliers if np.ndim(outliers) else None)
        order = np.argsort(row_times(weather.given), kind="stable")
        taken = service.draw(places_of(self.residuals, weather.inputs[order]), stream)
        return service, taken[np.argsort(order)]


def fault_streams(random_state: np.random.RandomState) -> list[np.random.RandomState]:
    """Random states of the records drawn from, of gaps and of outliers, the same whatever noise is drawn."""
    return [np.random.RandomState(seed) for seed in deepcopy(random_state).randint(np.iinfo(np.int32).max, size=3)]


def are_drawn(faults: Any) -> bool:
    """Whether gaps or outliers come from records: they are "fitted", known ones, or a table of raw frequencies."""
    return isinstance(faults, str | ServiceRecords) or np.ndim(faults) > 0


def check_faults(gaps: Any, outliers: Any) -> None:
    """Raise an error for gaps or outliers that are neither None nor "fitted" nor a share, nor outliers of records."""
    expected = {
        "gaps": "'fitted', the share of the values that are missing, such as 0.1, or None",
        "outliers": "'fitted', the share of the values that are outliers, such as 0.01, the frequencies that the chain "
        "was fitted on before they were cleaned, or None",
    }
    for what, value in (("gaps", gaps), ("outliers", outliers)):
        is_of_records = what == "outliers" and not isinstance(value, str) and are_drawn(value)
        is_share = is_real(value) and 0 <= value < 1
        is_fitted = isinstance(value, str) and value == "fitted"
        if not (value is None or is_of_records or is_share or is_fitted):
            raise ValueError(f"{what} is {value!r:.100}; expected {expected[what]}")
