"""Means of days: what the chain does not explain, and the weather behind it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo._tables.frames import DAY, midnight, midnights_between
from skthermo.residuals.weather import WeatherFunctions


@dataclass(frozen=True)
class DailyMeans:
    """Daily means of the logarithm of measured over predicted frequencies.

    ``values`` and ``counts``, (n_days, n_modes), are means and numbers of records; ``basis``, (n_days, n_modes, size),
    is the mean of the `WeatherFunctions` over the records of each mode, and last the first weather coordinate of the
    day before.
    """

    values: Array
    counts: Array
    basis: Array

    @classmethod
    def of(
        cls,
        ratios: Array,
        temperatures: Array,
        times: pd.DatetimeIndex,
        basis: WeatherFunctions,
        days: pd.DatetimeIndex,
        before: float = np.nan,
    ) -> DailyMeans:
        """Means of ln(measured / predicted), (n_records, n_modes), over days that begin at ``days``.

        ``before`` is the `weather` of the day before the first, if it is known.
        """
        of_day = days.searchsorted(times, side="right") - 1
        n_days, n_modes = len(days), ratios.shape[1]
        functions = basis.values(temperatures)
        known = ~np.isnan(functions).any(axis=1)
        usual = _means(functions[known, 1], of_day[known], n_days)
        earlier = np.append(before, usual[:-1])
        earlier = np.where(np.isnan(earlier), np.where(np.isnan(usual), 0.0, usual), earlier)
        values, counts = np.full((n_days, n_modes), np.nan), np.zeros((n_days, n_modes))
        means = np.zeros((n_days, n_modes, basis.size + 1))
        for mode in range(n_modes):
            rows = known & ~np.isnan(ratios[:, mode])
            counts[:, mode] = np.bincount(of_day[rows], minlength=n_days)
            values[:, mode] = _means(ratios[rows, mode], of_day[rows], n_days)
            for column in range(basis.size):
                means[:, mode, column] = _means(functions[rows, column], of_day[rows], n_days)
            means[:, mode, -1] = earlier
        return cls(values, counts, np.nan_to_num(means))

    @property
    def known(self) -> NDArray[np.bool_]:
        return ~np.isnan(self.values)

    @property
    def weather(self) -> float:
        """First coordinate of the last day's mean weather, NaN if it is not known."""
        there = self.basis[-1, self.known[-1], 1]
        return float(there[0]) if len(there) else np.nan

    def __getitem__(self, days: slice) -> DailyMeans:
        return DailyMeans(self.values[days], self.counts[days], self.basis[days])

    def followed_by(self, later: DailyMeans) -> DailyMeans:
        parts = ((getattr(one, name) for one in (self, later)) for name in ("values", "counts", "basis"))
        return DailyMeans(*(np.concatenate(list(part)) for part in parts))


def _means(values: Array, of_day: NDArray[np.intp], n_days: int) -> Array:
    """Mean of the values of each day, NaN where there is none."""
    number = np.bincount(of_day, minlength=n_days)
    sums = np.bincount(of_day, weights=values, minlength=n_days)
    return np.divide(sums, number, out=np.full(n_days, np.nan), where=number > 0)


def calendar(times: pd.DatetimeIndex, freq: Any) -> pd.DatetimeIndex:
    """Beginnings of the days from the first record to the last."""
    length = pd.Timedelta(freq)
    if length >= DAY and not length % DAY:
        return midnights_between(times.min(), times.max())[:: length // DAY].rename(times.name)
    first = midnight(times.min()) if length >= DAY else times.min().tz_convert("UTC").floor(freq).tz_convert(times.tz)
    return pd.date_range(first, times.max(), freq=freq, name=times.name)
