"""Records as monitoring would take them: noise, gaps and outliers as in training."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._estimators.arguments import check_noise
from skthermo._tables.arrays import Array, as_random_state, is_real
from skthermo._tables.saved_frames import SavesFrames
from skthermo._tables.times import row_times
from skthermo.residuals.baseline import BaselineResiduals
from skthermo.surrogate.chain._records import TrainingRecords
from skthermo.surrogate.chain._service import ServiceRecords, places_of
from skthermo.surrogate.chain._thermal_model import ThermalModel, Weather

TIMES_WIDER = 10.0  # noise of an outlier over that of other values, where the share of outliers is given
LARGEST_SEED = np.iinfo(np.int32).max


@dataclass(frozen=True, eq=False)
class RecordSimulator(SavesFrames):
    """Draws what monitoring adds to the frequencies of a thermal model, as its training records show it.

    ``gaps_and_outliers`` are those of other records, where these have been drawn themselves.
    """

    model: ThermalModel
    records: TrainingRecords
    gaps_and_outliers: ServiceRecords | None = None

    @cached_property
    def residuals(self) -> BaselineResiduals:
        """Out-of-fold residuals of the training records by weather."""
        model = self.model
        return self.records.out_of_fold(model.mapper, model.frequencies, model.discrepancy, propagated=model.propagated)

    @cached_property
    def service(self) -> ServiceRecords:
        """Gaps and outliers of the training records."""
        return self.gaps_and_outliers or ServiceRecords.of(self.records, self.residuals)

    def service_of(self, F: ArrayLike | None = None) -> ServiceRecords:
        """Gaps and outliers of the training records, the latter by their raw frequencies if these are given."""
        if F is None:
            return self.service
        expected = self.records.modelled * np.exp(self.model.discrepancy.at(self.records.inputs))
        return ServiceRecords.of_raw(self.records, self.residuals, F, expected)

    def noise(
        self,
        weather: Weather,
        noise: ArrayLike,
        gaps: Any,
        outliers: Any,
        random_state: int | np.random.RandomState | None,
    ) -> Array:
        """Relative noise, (n_rows, n_modes), NaN where a mode is missing."""
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
            values = values * np.where(streams[2].uniform(size=shape) < outliers, TIMES_WIDER, 1.0)
        if are_drawn(gaps):
            return np.where(service.missing[taken, -len(names) :], np.nan, values)
        return values if gaps is None else np.where(streams[1].uniform(size=shape) < gaps, np.nan, values)

    def gaps(
        self, weather: Weather, gaps: Any, outliers: Any, random_state: int | np.random.RandomState | None
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which temperatures and frequencies are missing."""
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
        """Gaps and outliers of the training records, and those of which records the rows have."""
        if isinstance(outliers, ServiceRecords):
            service = outliers
        else:
            service = self.service_of(outliers if np.ndim(outliers) else None)
        order = np.argsort(row_times(weather.given), kind="stable")
        taken = service.draw(places_of(self.residuals, weather.inputs[order]), stream)
        return service, taken[np.argsort(order)]


def fault_streams(random_state: np.random.RandomState) -> list[np.random.RandomState]:
    """Random states of the records drawn from, of gaps and of outliers, beside the one of the noise.

    They are the same whatever noise is drawn, and noise is the same without any faults.
    """
    return [np.random.RandomState(seed) for seed in deepcopy(random_state).randint(LARGEST_SEED, size=3)]


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
