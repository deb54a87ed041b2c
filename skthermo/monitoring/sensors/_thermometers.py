"""What each thermometer shows beside what the others predict, day by day."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo._tables.frames import DAY, DAY_NS, YEAR
from skthermo.monitoring.sensors._changes import Days, Departures, ThermometerNoise
from skthermo.residuals.gaussian import Gaussian

WHOLE_YEAR = 330  # days from which a baseline shows the season of each thermometer
SEASONS = 2  # harmonics of the year, and of the day
OFTEN = 4  # records a day from which the time of the day counts
LEAST_OF_A_DAY = 0.3  # share of the usual number of records in a daily mean
N_FOLDS = 5
BLOCK = 15  # days in a block of a fold, where the baseline has whole years
LEAST_DEVIATION = 0.05  # degrees; thermometers are not better than that
JITTER = 1e-6  # share of its variance that each thermometer has of its own, also where two show the same


def local_days(stamps: pd.DatetimeIndex) -> Days:
    """Calendar day of each stamp in its own time zone, in days since 1970."""
    return stamps.tz_localize(None).as_unit("ns").asi8 // DAY_NS


@dataclass(frozen=True)
class UsualWeather:
    """Usual temperature of each thermometer by season and time of day."""

    coefficients: Array
    has_season: bool
    has_hours: bool

    @classmethod
    def of(cls, stamps: pd.DatetimeIndex, temperatures: Array, has_season: bool, has_hours: bool) -> UsualWeather:
        """Learn from records; NaN is passed over."""
        empty = cls(np.empty((0, 0)), has_season, has_hours)
        inputs = empty.inputs(stamps)
        found = np.zeros((inputs.shape[1], temperatures.shape[1]))
        for sensor, column in enumerate(temperatures.T):
            known = ~np.isnan(column)
            found[:, sensor] = np.linalg.lstsq(inputs[known], column[known], rcond=1e-8)[0]
        return cls(found, has_season, has_hours)

    def inputs(self, stamps: pd.DatetimeIndex) -> Array:
        """A constant and harmonics of the year and the day."""
        at = stamps.tz_localize(None).as_unit("ns").asi8 / DAY_NS
        periods = [YEAR / DAY] * self.has_season + [1.0] * self.has_hours
        waves = [2 * np.pi * k * at / period for period in periods for k in range(1, SEASONS + 1)]
        return np.column_stack([np.ones(len(at)), *(part for wave in waves for part in (np.sin(wave), np.cos(wave)))])

    def anomalies(self, stamps: pd.DatetimeIndex, temperatures: Array) -> Array:
        return temperatures - self.inputs(stamps) @ self.coefficients


@dataclass(frozen=True)
class Thermometers:
    """Daily anomalies of thermometers, and how they go together in the baseline."""

    climate: UsualWeather
    gaussian: Gaussian
    least: float
    n_days: int
    lowest: Array
    highest: Array
    noises: tuple[ThermometerNoise, ...]
    records: Gaussian

    @classmethod
    def of(cls, stamps: pd.DatetimeIndex, temperatures: Array, per_year: float) -> Thermometers | None:
        """Learn from the baseline; None where it has too few days, or fewer than two thermometers."""
        n_sensors = temperatures.shape[1]
        every_day = local_days(stamps)
        days = np.unique(every_day)
        if n_sensors < 2 or len(days) < 3 * n_sensors + N_FOLDS or np.isnan(temperatures).all(axis=0).any():
            return None
        has_season = bool(days[-1] - days[0] >= WHOLE_YEAR)
        least = LEAST_OF_A_DAY * len(stamps) / len(days)
        options = (has_season, len(stamps) / len(days) >= OFTEN)
        found = np.full((4, len(days), n_sensors), np.nan)
        fold_of = days // BLOCK % N_FOLDS if has_season else np.arange(len(days)) * N_FOLDS // len(days)
        for fold in range(N_FOLDS):
            test = np.isin(every_day, days[fold_of == fold])
            if test.all() or not test.any() or np.isnan(temperatures[~test]).all(axis=0).any():
                continue
            part = cls._learned(stamps[~test], temperatures[~test], options, least)
            means = part.daily_means(stamps[test], temperatures[test])
            found[:, fold_of == fold] = part.departures(means, np.ones(n_sensors, dtype=bool))
        noises = tuple(
            ThermometerNoise.of(Departures(days, *found[:, :, j]), per_year / n_sensors) for j in range(n_sensors)
        )
        whole = cls._learned(stamps, temperatures, options, least)
        return replace(whole, noises=noises)

    @classmethod
    def _learned(
        cls, stamps: pd.DatetimeIndex, temperatures: Array, options: tuple[bool, bool], least: float
    ) -> Thermometers:
        """Usual weather and covariance from some records."""
        climate = UsualWeather.of(stamps, temperatures, *options)
        gaussian = Gaussian(np.empty(0), np.empty((0, 0)))
        bare = cls(climate, gaussian, least, 0, np.empty(0), np.empty(0), (), gaussian)
        means = bare.daily_means(stamps, temperatures)
        found = Gaussian.of(means[~np.isnan(means).all(axis=1)])
        own = np.diag(JITTER * np.diag(found.covariance) + LEAST_DEVIATION**2)
        lowest, highest = np.fmin.reduce(means), np.fmax.reduce(means)
        gaussian = Gaussian(found.mean, found.covariance + own)
        anomalies = climate.anomalies(stamps, temperatures)
        together = Gaussian.of(anomalies[~np.isnan(anomalies).all(axis=1)])
        together = Gaussian(together.mean, together.covariance + own)
        return cls(climate, gaussian, least, len(means), lowest, highest, (), together)

    def daily_means(self, stamps: pd.DatetimeIndex, temperatures: Array) -> Array:
        """Mean anomaly of each day that has records, in order; NaN where a thermometer has few of them."""
        day = np.unique(local_days(stamps), return_inverse=True)[1].ravel()
        anomalies = self.climate.anomalies(stamps, temperatures)
        known = ~np.isnan(anomalies)
        counts, sums = (
            np.column_stack([np.bincount(day, column, minlength=day.max() + 1) for column in table.T])
            for table in (known.astype(float), np.where(known, anomalies, 0.0))
        )
        return np.where(counts >= max(self.least, 1.0), sums / np.maximum(counts, 1.0), np.nan)

    def filled(self, stamps: pd.DatetimeIndex, temperatures: Array) -> Array:
        """Temperatures whose gaps hold what the other thermometers of their record predict."""
        usual = self.climate.inputs(stamps) @ self.climate.coefficients
        return usual + self.records.completed(temperatures - usual)[0]

    def departures(self, means: Array, trusted: NDArray[np.bool_]) -> Array:
        """Values, deviations, errors and what lies beyond the baseline, of `Departures`, (4, n_days, n_thermometers).

        NaN where a thermometer, or each of the other trusted ones, has no value.
        """
        found = np.full((4, *means.shape), np.nan)
        n_learned = self.climate.inputs(pd.DatetimeIndex([0])).shape[1]
        for sensor in range(means.shape[1]):
            others = np.where(trusted, means, np.nan)
            others[:, sensor] = np.nan
            (expected, spread), (within, _) = (
                (part[:, sensor] for part in self.gaussian.completed(table))
                for table in (others, np.clip(others, self.lowest, self.highest))
            )
            unusual = (n_learned + self.gaussian.distances(others) ** 2) / self.n_days
            found[:, :, sensor] = (means[:, sensor] - expected) / spread, spread, unusual, expected - within
        return found
