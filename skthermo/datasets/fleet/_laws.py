"""How stiffness depends on temperature, by material, and how bridges differ from their family."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from skthermo._tables.arrays import Array
from skthermo.datasets._kw51_weather import memory

REFERENCE = 10.0  # C, where the logarithm of the multiplier of a family's law is about 0
ELSEWHERE = 14.0  # K, how far the knee of an alien law is moved


@dataclass(frozen=True)
class Law:
    """Law of a stiffness over its temperature: an exponential, and a rise that levels off in frost."""

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
        return self.slope * (temperature - REFERENCE) + self.limit * np.tanh(self.gain * below / self.limit)

    def temperature(self, weather: pd.DataFrame) -> Array:
        """Hourly temperature of the part in C, from hourly "air" and "sun"."""
        return part_temperature(weather, self.hours, self.sun)


def part_temperature(weather: pd.DataFrame, hours: float, sun: float) -> Array:
    """Hourly temperature in C of a part with thermal inertia that full sunshine warms by ``sun`` K."""
    return memory((weather["air"] + sun * weather["sun"]).to_numpy(), hours)


LAWS = {
    "steel": Law(slope=-0.8e-3, hours=2.0, sun=3.0),
    "concrete": Law(slope=-2.6e-3, gain=4e-3, knee=0.0, width=1.5, limit=0.10, hours=15.0, sun=6.0),
    "composite": Law(slope=-1.6e-3, gain=2e-3, knee=0.0, width=1.5, limit=0.06, hours=8.0, sun=5.0),
    "pavement": Law(slope=-2.5e-2, gain=4e-2, knee=0.0, width=1.0, limit=0.5, hours=5.0, sun=10.0),
    "bearings": Law(slope=-3e-3, gain=1.2e-2, knee=-1.0, width=2.0, limit=0.15, hours=6.0),
    "soil": Law(slope=-0.5e-3, gain=2.5e-2, knee=0.0, width=1.0, limit=0.15, hours=96.0),
}
SCATTER = {"steel": 0.10, "concrete": 0.15, "composite": 0.15, "pavement": 0.25, "bearings": 0.30, "soil": 0.30}
KNEE_SCATTER = 0.5  # K
INERTIA_SCATTER = 0.2
ALIENS = ("reversed", "doubled", "knee elsewhere")


def draw_law(material: str, alien: str | None, random: np.random.RandomState) -> Law:
    """The law of one part of a bridge: its family's with its own coefficients."""
    family, scatter = LAWS[material], SCATTER[material]
    law = replace(
        family,
        slope=family.slope * np.exp(scatter * random.standard_normal()),
        gain=family.gain * np.exp(scatter * random.standard_normal()),
        knee=family.knee + KNEE_SCATTER * random.standard_normal(),
        hours=family.hours * np.exp(INERTIA_SCATTER * random.standard_normal()),
        sun=family.sun * np.exp(INERTIA_SCATTER * random.standard_normal()),
    )
    return law if alien is None else estranged(law, alien)


def estranged(law: Law, how: str) -> Law:
    """A law that is not the family's: reversed, doubled, or with its knee elsewhere."""
    if how == "reversed":
        return replace(law, slope=-law.slope, gain=-law.gain)
    if how == "doubled":
        return replace(law, slope=2 * law.slope, gain=2 * law.gain, limit=2 * law.limit)
    return replace(law, slope=law.slope / 4, gain=law.gain + abs(law.slope), knee=law.knee + ELSEWHERE)
