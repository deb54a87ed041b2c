"""Thermometers, and what measuring and identification add to frequencies: noise that lasts, gaps, outliers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import ndtri

from skthermo._tables.arrays import Array
from skthermo.datasets.fleet._climate import persistent
from skthermo.datasets.fleet._laws import part_temperature

STYLES = ("T{i}", "TH-{i:02d}", "{role}_{i}", "temperature {i}")
OFFSET, READING_NOISE = 0.7, (0.1, 0.4)  # C
INERTIA = {"air": (0.0, 1.0), "deck": (3.0, 8.0)}  # hours
SUN = {"air": (0.0, 1.5), "deck": (5.0, 10.0)}  # K
LASTING, LASTING_HOURS = 0.4, 48.0  # share of the noise's variance that lasts, and how long it does
GAP_HOURS = 18.0
OUTAGES = 0.3  # share of the gaps in which nothing was measured
ERROR = (0.03, 0.10)  # of an outlier


@dataclass(frozen=True)
class Thermometer:
    """A thermometer in the air or in the deck."""

    name: str  # of its column
    role: str  # "air" or "deck"
    offset: float  # in C
    noise: float  # in C
    hours: float  # thermal inertia of its place
    sun: float  # warming by full sunshine in K

    def temperature(self, weather: pd.DataFrame) -> Array:
        """Hourly temperature of its place in C, as it would read it without noise."""
        return self.offset + part_temperature(weather, self.hours, self.sun)


def draw_thermometers(random: np.random.RandomState) -> list[Thermometer]:
    """One to three thermometers in the air and as many in the deck, under the names that this owner gives them."""
    style = STYLES[random.randint(len(STYLES))]
    roles = ["air"] * random.randint(1, 4) + ["deck"] * random.randint(1, 4)
    return [
        Thermometer(
            name=style.format(i=i, role=role),
            role=role,
            offset=random.normal(0, OFFSET),
            noise=random.uniform(*READING_NOISE),
            hours=random.uniform(*INERTIA[role]),
            sun=random.uniform(*SUN[role]),
        )
        for i, role in enumerate(roles, start=1)
    ]


def measured(clean: Array, level: Array, gaps: float, outliers: float, rows: NDArray[np.intp], drawn: Array) -> Array:
    """Frequencies with noise, outliers and gaps; ``rows`` are those of the records among the hourly noise ``drawn``.

    The columns of ``drawn`` are those of `columns_for`.
    """
    n_modes = clean.shape[1]
    white, lasting, missing, is_wrong, error = np.split(drawn[:, : 5 * n_modes], 5, axis=1)
    lasting, missing = persistent(lasting, LASTING_HOURS)[rows], persistent(missing, GAP_HOURS)[rows]
    outage = persistent(drawn[:, -1:], GAP_HOURS)[rows]
    noise = np.sqrt(1 - LASTING) * white[rows] + np.sqrt(LASTING) * lasting
    values = clean * (1 + level * noise)
    size = ERROR[0] + (ERROR[1] - ERROR[0]) * np.abs(np.tanh(error[rows]))
    values = np.where(is_wrong[rows] < ndtri(outliers), values * (1 + np.sign(error[rows]) * size), values)
    share = gaps * (1 - OUTAGES) / (1 - gaps * OUTAGES)  # of what is measured at all
    is_missing = (missing < ndtri(share)) | (outage < ndtri(gaps * OUTAGES))
    return np.where(is_missing, np.nan, values)


def columns_for(n_modes: int) -> int:
    """Columns of hourly noise that `measured` needs: five for each mode, and one for outages."""
    return 5 * n_modes + 1


def readings(
    thermometers: Sequence[Thermometer],
    weather: pd.DataFrame,
    means: Callable[[Array], Array],
    gaps: float,
    rows: NDArray[np.intp],
    drawn: Array,
) -> dict[str, Array]:
    """What the thermometers read: ``means`` of hourly temperatures over each record, with noise and gaps.

    ``drawn`` is hourly noise with two columns for each thermometer.
    """
    noise, missing = np.split(drawn, 2, axis=1)
    is_missing = persistent(missing, GAP_HOURS)[rows] < ndtri(gaps)
    return {
        thermometer.name: np.where(
            is_missing[:, i], np.nan, means(thermometer.temperature(weather)) + thermometer.noise * noise[rows, i]
        )
        for i, thermometer in enumerate(thermometers)
    }
