"""The site of a bridge of a fleet: its climate, its thermal law and its thermometers."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import scipy  # which loads scipy.signal once it is used
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import norm

from skthermo._core.arrays import Array
from skthermo.datasets._kw51_campaign import memory


def stream(*key: int) -> np.random.RandomState:
    """Random numbers of a key of integers; other keys have independent ones."""
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
        """Hourly "air" temperature in C and "sun", its share of full sunshine on a horizontal deck, which depend on the
        date and the key alone. It begins with the year before the first record, so that parts with thermal inertia have
        settled."""
        years = range(first.year - 1, last.year + 1)
        index = pd.date_range(f"{years[0]}-01-01", f"{years[-1] + 1}-01-01", freq="h", inclusive="left", name="time")
        drawn = drawn_by_hour(years, 2, key)
        anomaly, cloud = persistent(drawn[:, 0], self.memory_hours), persistent(drawn[:, 1], 20.0)
        day, hour = index.day_of_year.to_numpy() - 1 + index.hour.to_numpy() / 24, index.hour.to_numpy()
        coldness = np.cos(2 * np.pi * (day - 20.0) / 365.25)
        clear = norm.cdf(cloud)
        air = (
            self.mean
            - self.season * coldness
            + self.scatter * (1 + 0.25 * coldness) * anomaly
            + self.swing * (0.5 + clear) * (1 - 0.4 * coldness) * np.cos(2 * np.pi * (hour - 15.0) / 24)
        )
        declination = -np.deg2rad(23.44) * np.cos(2 * np.pi * (day + 10) / 365.25)
        phi, angle = np.deg2rad(self.latitude), 2 * np.pi * (hour - 12) / 24
        height = np.sin(phi) * np.sin(declination) + np.cos(phi) * np.cos(declination) * np.cos(angle)  # of the sun
        sun = clear * np.maximum(height, 0.0)
        return pd.DataFrame({"air": air, "sun": sun}, index=index)


def drawn_by_hour(years: Iterable[int], n_columns: int, key: tuple[int, ...]) -> Array:
    """White noise of variance 1 for each hour of the years, which depends on the year and the key alone."""
    hours = [24 * (pd.Timestamp(year + 1, 1, 1) - pd.Timestamp(year, 1, 1)).days for year in years]
    drawn = [stream(*key, year).standard_normal((n, n_columns)) for year, n in zip(years, hours, strict=True)]
    return np.concatenate(drawn)


def persistent(noise: Array, hours: float) -> Array:
    """Stationary autoregressive process of first order and variance 1 from hourly white noise, along the first axis."""
    decay = np.exp(-1 / hours)
    noise = np.concatenate([noise[:1], np.sqrt(1 - decay**2) * noise[1:]])
    return scipy.signal.lfilter([1.0], [1.0, -decay], noise, axis=0)


@dataclass(frozen=True)
class Law:
    """Law of a stiffness over its temperature: an exponential, about 1 at 10 C, and a rise that levels off in frost."""

    slope: float  # change above the knee, in 1/K
    gain: float = 0.0  # further rise for each kelvin below the knee, in 1/K
    knee: float = 0.0  # temperature below which the part stiffens, in C
    width: float = 1.0  # how gradually it does, in K
    limit: float = 1.0  # largest rise by frost
    hours: float = 0.0  # thermal inertia of the part
    sun: float = 0.0  # warming by full sunshine in K

    def log_multiplier(self, temperature: Array) -> Array:
        """Logarithm of the multiplier at temperatures in C."""
        below = self.width * np.logaddexp(0.0, (self.knee - temperature) / self.width)
        return self.slope * (temperature - 10.0) + self.limit * np.tanh(self.gain * below / self.limit)


def part_temperature(weather: pd.DataFrame, hours: float, sun: float) -> Array:
    """Hourly temperature in C of a part with thermal inertia that full sunshine warms by ``sun`` K, from hourly "air"
    and "sun"."""
    return memory((weather["air"] + sun * weather["sun"]).to_numpy(), hours)


LAWS = {
    "steel": (Law(slope=-0.8e-3, hours=2.0, sun=3.0), 0.10),
    "concrete": (Law(slope=-2.6e-3, gain=4e-3, knee=0.0, width=1.5, limit=0.10, hours=15.0, sun=6.0), 0.15),
    "composite": (Law(slope=-1.6e-3, gain=2e-3, knee=0.0, width=1.5, limit=0.06, hours=8.0, sun=5.0), 0.15),
    "pavement": (Law(slope=-2.5e-2, gain=4e-2, knee=0.0, width=1.0, limit=0.5, hours=5.0, sun=10.0), 0.25),
    "bearings": (Law(slope=-3e-3, gain=1.2e-2, knee=-1.0, width=2.0, limit=0.15, hours=6.0), 0.30),
    "soil": (Law(slope=-0.5e-3, gain=2.5e-2, knee=0.0, width=1.0, limit=0.15, hours=96.0), 0.30),
}
"""Laws of materials, and how their slopes and gains scatter between bridges (standard deviation of the logarithm)."""
ATYPICAL_LAWS: dict[str, Callable[[Law], dict[str, float]]] = {
    "reversed": lambda law: {"slope": -law.slope, "gain": -law.gain},
    "doubled": lambda law: {"slope": 2 * law.slope, "gain": 2 * law.gain, "limit": 2 * law.limit},
    "knee elsewhere": lambda law: {"slope": law.slope / 4, "gain": law.gain + abs(law.slope), "knee": law.knee + 14.0},
}
"""How a law may differ from its family's."""


def draw_law(material: str, atypical_law: str | None, random: np.random.RandomState) -> Law:
    """The law of one part of a bridge: its family's with its own coefficients, and perhaps of another kind."""
    family, scatter = LAWS[material]
    law = replace(
        family,
        slope=family.slope * np.exp(scatter * random.standard_normal()),
        gain=family.gain * np.exp(scatter * random.standard_normal()),
        knee=family.knee + 0.5 * random.standard_normal(),
        hours=family.hours * np.exp(0.2 * random.standard_normal()),
        sun=family.sun * np.exp(0.2 * random.standard_normal()),
    )
    return law if atypical_law is None else replace(law, **ATYPICAL_LAWS[atypical_law](law))


@dataclass(frozen=True)
class Thermometer:
    """A thermometer in the air or in the deck."""

    name: str  # of its column
    role: str  # "air" or "deck"
    offset: float  # in C
    noise: float  # in C
    hours: float  # thermal inertia of its place
    sun: float  # warming by full sunshine in K


def draw_thermometers(random: np.random.RandomState) -> list[Thermometer]:
    """One to three thermometers in the air and as many in the deck, under the names that this owner gives them."""
    styles = ("T{i}", "TH-{i:02d}", "{role}_{i}", "temperature {i}")
    inertias, suns = {"air": (0.0, 1.0), "deck": (3.0, 8.0)}, {"air": (0.0, 1.5), "deck": (5.0, 10.0)}
    style = styles[random.randint(len(styles))]
    roles = ["air"] * random.randint(1, 4) + ["deck"] * random.randint(1, 4)
    return [
        Thermometer(
            name=style.format(i=i, role=role),
            role=role,
            offset=random.normal(0, 0.7),
            noise=random.uniform(0.1, 0.4),
            hours=random.uniform(*inertias[role]),
            sun=random.uniform(*suns[role]),
        )
        for i, role in enumerate(roles, start=1)
    ]


def measured(clean: Array, level: Array, gaps: float, outliers: float, rows: NDArray[np.intp], drawn: Array) -> Array:
    """Frequencies with noise, outliers and gaps; ``rows`` are the places of the records in the hourly noise ``drawn``,
    which has five columns for each mode, and one for outages."""
    n_modes = clean.shape[1]
    white, lasting, missing, is_wrong, error = np.split(drawn[:, : 5 * n_modes], 5, axis=1)
    lasting, missing = persistent(lasting, 48.0)[rows], persistent(missing, 18.0)[rows]
    outage, share_of_outages = persistent(drawn[:, -1:], 18.0)[rows], 0.3  # of the gaps
    noise = np.sqrt(1 - 0.4) * white[rows] + np.sqrt(0.4) * lasting
    values = clean * (1 + level * noise)
    size = 0.03 + (0.10 - 0.03) * np.abs(np.tanh(error[rows]))
    values = np.where(is_wrong[rows] < ndtri(outliers), values * (1 + np.sign(error[rows]) * size), values)
    share = gaps * (1 - share_of_outages) / (1 - gaps * share_of_outages)  # of what is measured at all
    is_missing = (missing < ndtri(share)) | (outage < ndtri(gaps * share_of_outages))
    return np.where(is_missing, np.nan, values)
