"""What the monitoring of KW51 makes of frequencies: noise, gaps, damping ratios, mode shapes at sensors."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import ndtri

from skthermo._arrays import Array
from skthermo.datasets._kw51_weather import REFERENCE, smooth_noise

NOISE = (0.003, 0.0017, 0.0016, 0.0026, 0.00115, 0.0015)
COVERAGE = np.array([0.30, 0.344, 0.950, 0.503, 0.879, 0.965])
WIND = np.array([0.55, 0.55, 0.0, 0.55, 0.0, 0.0])
OUTAGE = 0.02
BLOCK_HOURS = 4.0

FIRST_TEMPERATURE = pd.Timestamp("2018-11-21 12:00")
TEMPERATURE_GAPS = 0.0122

DAMPING = np.array([0.009, 0.007, 0.008, 0.006, 0.005, 0.004])
DAMPING_BY_KELVIN, DAMPING_SCATTER = 0.006, 0.25

SHAPE_NOISE = 0.01


def missing_temperatures(index: pd.DatetimeIndex, random: np.random.RandomState) -> NDArray[np.bool_]:
    """Hours without temperature: until the sensor was installed, and a few blocks later."""
    block = smooth_noise(len(index), 1, 2 * BLOCK_HOURS, random)[:, 0] < ndtri(TEMPERATURE_GAPS)
    return block | (index < FIRST_TEMPERATURE)


def missing_modes(n_hours: int, random: np.random.RandomState) -> NDArray[np.bool_]:
    """Hours (n_hours, 6) in which a mode was not identified: in blocks, lateral modes of the arches together."""
    wind, outage, *own = smooth_noise(n_hours, 2 + len(COVERAGE), BLOCK_HOURS, random).T
    excitation = np.sqrt(WIND) * wind[:, np.newaxis] + np.sqrt(1 - WIND) * np.array(own).T
    return (excitation < ndtri(1 - COVERAGE / (1 - OUTAGE))) | (outage < ndtri(OUTAGE))[:, np.newaxis]


def draw_damping(steel: Array, random: np.random.RandomState) -> Array:
    """Damping ratios (n_hours, 6), lower when it is warm, with the scatter of an identification."""
    mean = DAMPING * (1 - DAMPING_BY_KELVIN * (steel[:, np.newaxis] - REFERENCE))
    scatter = DAMPING_SCATTER * random.standard_normal(mean.shape)
    return mean * np.exp(scatter - DAMPING_SCATTER**2 / 2)


def measured_shapes(clean: Array, random: np.random.RandomState) -> NDArray[np.complex128]:
    """Shapes (n, 6, n_sensors) of unit length and random phase, with complex noise."""
    noise = random.standard_normal((2, *clean.shape)) / np.sqrt(2)
    phase = np.exp(2j * np.pi * random.uniform(size=(*clean.shape[:2], 1)))
    level = SHAPE_NOISE * np.sqrt((clean**2).mean(axis=2, keepdims=True))
    noisy = (clean + level * (noise[0] + 1j * noise[1])) * phase
    return noisy / np.linalg.norm(noisy, axis=2, keepdims=True)
