"""Weather at KW51, drawn hour by hour: temperatures of its members, frost, moisture of the ballast."""

import numpy as np
import pandas as pd
import scipy  # which loads scipy.signal once it is used
from scipy.stats import norm

from skthermo._tables.arrays import Array

START = pd.Timestamp("2018-10-01")
N_HOURS = 11328
REFERENCE = 10.0  # C, near the mean before the retrofit

MEAN, SEASON, COLDEST_DAY = 13.2, 7.75, 18.0  # C, C, day of the year
ANOMALY, ANOMALY_SEASON, ANOMALY_HOURS, LIMIT = 3.5, 0.9, 30.0, 2.5
SCATTER, SCALES, FIRST_WINTER = 4.2, (0.7, 1.3), slice(1236, 5424)  # C; from the first temperature to the retrofit
SWING_WINTER, SWING_SUMMER, CLOUDED, CLOUD_HOURS = 1.0, 5.0, 0.4, 18.0
WARMEST_HOUR = 16.0
SUN_SWING, SUN_LEAD = 1.4, 2.0
SLAB_HOURS = 24.0
COLD_SPELL, COLD_SPELL_SCATTER, COLD_SPELL_HOURS = -2.9, 0.3, 60.0
FROST_BELOW, FROST_HOURS = 1.5, 24.0
MOISTURE_HOURS = 36.0


def draw_weather(n_hours: int, random: np.random.RandomState) -> pd.DataFrame:
    """Hourly weather: "steel", "sun" and "slab" in C, "frost" in K below freezing, "moisture" (standard deviation 1).

    "steel" is the temperature below the deck, "sun" that of the members above it, "slab" that of the plate and the
    ballast. A longer record begins with the same hours as a shorter one.
    """
    index = pd.date_range(START, periods=max(n_hours, N_HOURS), freq="h", name="time")
    *streams, for_spell = map(np.random.RandomState, random.randint(2**31 - 1, size=4))
    memories = (ANOMALY_HOURS, CLOUD_HOURS, MOISTURE_HOURS)
    anomaly, cloud, moisture = (
        smooth_noise(len(index), 1, hours, stream)[:, 0] for hours, stream in zip(memories, streams, strict=True)
    )
    day = index.day_of_year.to_numpy() - 1 + index.hour.to_numpy() / 24
    season = -np.cos(2 * np.pi * (day - COLDEST_DAY) / 365.25)
    steady = MEAN + SEASON * season
    anomaly = (ANOMALY + ANOMALY_SEASON * season) * LIMIT * np.tanh(anomaly / LIMIT)
    steady += anomaly * scale_for_scatter(steady[FIRST_WINTER], anomaly[FIRST_WINTER])
    clear = CLOUDED + 2 * (1 - CLOUDED) * norm.cdf(cloud)
    swing = clear * (SWING_WINTER + (SWING_SUMMER - SWING_WINTER) * (1 + season) / 2)
    hour = index.hour.to_numpy()
    steel = steady + swing * cycle(hour)
    spell = cold_spell(index, steel, for_spell)
    steel += spell
    sun = steady + spell + SUN_SWING * swing * cycle(hour + SUN_LEAD)
    weather = {
        "steel": steel,
        "sun": sun,
        "slab": memory(steel, SLAB_HOURS),
        "frost": memory(np.maximum(FROST_BELOW - steel, 0.0), FROST_HOURS),
        "moisture": moisture,
    }
    return pd.DataFrame(weather, index=index).iloc[:n_hours]


def cycle(hour: Array) -> Array:
    """Daily cycle of mean 0, which is higher in the afternoon (1.25) than low at night (-0.75)."""
    angle = 2 * np.pi * (hour - WARMEST_HOUR) / 24
    return np.cos(angle) + np.cos(2 * angle) / 4


def scale_for_scatter(season: Array, anomaly: Array) -> float:
    """What to multiply anomalies with so that season and anomalies together scatter by ``SCATTER``, within limits."""
    (a, b), (_, c) = np.cov(season, anomaly)
    scale = (np.sqrt(max(b**2 + c * (SCATTER**2 - a), 0.0)) - b) / c
    return float(np.clip(scale, *SCALES))


def cold_spell(index: pd.DatetimeIndex, steel: Array, random: np.random.RandomState) -> Array:
    """What brings the coldest hour of the first January to about -3 C, fading over days before and after it."""
    january = np.flatnonzero((index.month == 1) & (index.year == START.year + 1))
    coldest = january[steel[january].argmin()]
    wanted = COLD_SPELL + COLD_SPELL_SCATTER * random.standard_normal()
    hours = np.arange(len(index)) - coldest
    return (wanted - steel[coldest]) * np.exp(-((hours / COLD_SPELL_HOURS) ** 2))


def smooth_noise(n_hours: int, n_columns: int, hours: float, random: np.random.RandomState) -> Array:
    """Stationary Gaussian columns of variance 1, twice smoothed: correlation (1 + t / hours) exp(-t / hours)."""
    decay = np.exp(-1 / hours)
    settled = int(10 * hours)
    noise = random.standard_normal((settled + n_hours, n_columns))
    once = scipy.signal.lfilter([1 - decay], [1, -decay], noise, axis=0)
    twice = scipy.signal.lfilter([1 - decay], [1, -decay], once, axis=0)[settled:]
    variance = (1 - decay) ** 4 * (1 + decay**2) / (1 - decay**2) ** 3
    return twice / np.sqrt(variance)


def memory(values: Array, hours: float) -> Array:
    """Exponentially weighted mean of the past, which starts settled at the first value."""
    if hours == 0:
        return values
    decay = np.exp(-1 / hours)
    return scipy.signal.lfilter([1 - decay], [1, -decay], values, zi=decay * values[:1])[0]
