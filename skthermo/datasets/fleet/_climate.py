"""Weather of a place, hour by hour, as a function of the date."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd
import scipy  # which loads scipy.signal once it is used
from scipy.stats import norm

from skthermo._tables.arrays import Array

COLDEST_DAY = 20.0
WARMEST_HOUR = 15.0
TILT = np.deg2rad(23.44)  # of the Earth's axis
COLD_SCATTER = 0.25  # how much more the weather varies in winter than on average
CLOUD_HOURS = 20.0


def stream(*key: int) -> np.random.RandomState:
    """Random numbers that belong to a key of integers, independent of those of any other key."""
    return np.random.RandomState(np.random.MT19937(np.random.SeedSequence(key)))


@dataclass(frozen=True)
class SiteClimate:
    """Climate of a place."""

    latitude: float  # in degrees
    mean: float  # mean temperature of the year in C
    season: float  # amplitude of the seasonal cycle in C
    swing: float  # amplitude of the daily cycle in C, on average over the year
    scatter: float  # standard deviation of the weather about season and daily cycle in C
    memory_hours: float  # after which the correlation of the weather with itself has fallen to 1 / e

    @classmethod
    def draw(cls, random: np.random.RandomState) -> "SiteClimate":
        """Climate of a place between 43 and 60 degrees, near the sea or far from it."""
        latitude = random.uniform(43, 60)
        continental = random.uniform()
        return cls(
            latitude=latitude,
            mean=31.0 - 0.45 * latitude + random.normal(0, 1),
            season=4.0 + 0.1 * (latitude - 43) + 7.0 * continental + random.normal(0, 0.5),
            swing=random.uniform(1.5, 3.0) + 1.5 * continental,
            scatter=random.uniform(2.5, 4.0),
            memory_hours=random.uniform(48, 120),
        )

    def weather(self, first: pd.Timestamp, last: pd.Timestamp, key: tuple[int, ...]) -> pd.DataFrame:
        """Hourly "air" temperature in C and "sun", its share of full sunshine on a horizontal deck.

        The weather of an hour depends on its date and the key alone. The frame begins with the year before the
        first record, so that what remembers the weather has settled.
        """
        years = range(first.year - 1, last.year + 1)
        index = pd.date_range(f"{years[0]}-01-01", f"{years[-1] + 1}-01-01", freq="h", inclusive="left", name="time")
        drawn = drawn_by_hour(years, 2, key)
        anomaly, cloud = persistent(drawn[:, 0], self.memory_hours), persistent(drawn[:, 1], CLOUD_HOURS)
        day, hour = index.day_of_year.to_numpy() - 1 + index.hour.to_numpy() / 24, index.hour.to_numpy()
        coldness = np.cos(2 * np.pi * (day - COLDEST_DAY) / 365.25)
        clear = norm.cdf(cloud)
        air = (
            self.mean
            - self.season * coldness
            + self.scatter * (1 + COLD_SCATTER * coldness) * anomaly
            + self.swing * (0.5 + clear) * (1 - 0.4 * coldness) * np.cos(2 * np.pi * (hour - WARMEST_HOUR) / 24)
        )
        sun = clear * np.maximum(sine_of_elevation(self.latitude, day, hour), 0.0)
        return pd.DataFrame({"air": air, "sun": sun}, index=index)


def drawn_by_hour(years: Iterable[int], n_columns: int, key: tuple[int, ...]) -> Array:
    """White noise of variance 1 for each hour of the years, which depends on the year and the key alone."""
    hours = [24 * (pd.Timestamp(year + 1, 1, 1) - pd.Timestamp(year, 1, 1)).days for year in years]
    drawn = [stream(*key, year).standard_normal((n, n_columns)) for year, n in zip(years, hours, strict=True)]
    return np.concatenate(drawn)


def sine_of_elevation(latitude: float, day: Array, hour: Array) -> Array:
    """Sine of the sun's angle above the horizon, from latitude, day of the year and solar time."""
    declination = -TILT * np.cos(2 * np.pi * (day + 10) / 365.25)
    phi, angle = np.deg2rad(latitude), 2 * np.pi * (hour - 12) / 24
    return np.sin(phi) * np.sin(declination) + np.cos(phi) * np.cos(declination) * np.cos(angle)


def persistent(noise: Array, hours: float) -> Array:
    """Stationary autoregressive process of first order and variance 1 from hourly white noise, along the first axis."""
    decay = np.exp(-1 / hours)
    noise = np.concatenate([noise[:1], np.sqrt(1 - decay**2) * noise[1:]])
    return scipy.signal.lfilter([1.0], [1.0, -decay], noise, axis=0)
