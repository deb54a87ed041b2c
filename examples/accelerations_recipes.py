"""Ambient vibration of an FE model, as accelerometers record it; for ``plot_accelerations.py``."""

import numpy as np
from scipy.linalg import eigh
from scipy.signal import lfilter

RATE = 256.0  # samples per second
DURATION = 600.0  # s
DAMPING = 0.01
FORCE = 10.0  # standard deviation at every degree of freedom, N
SENSOR_NOISE = 0.03  # relative to the standard deviation of each sensor's accelerations
SETTLING = 10.0  # time constants of the slowest mode, until its vibration is stationary


def modes_below(model, theta, highest):
    """Frequencies in Hz (n_modes,) up to a highest one, and shapes of unit modal mass (n_dof, n_modes), of a model."""
    stiffness, mass = (matrix.toarray() for matrix in model.matrices(theta))
    squares, shapes = eigh(stiffness, mass)
    frequencies = np.sqrt(squares) / (2 * np.pi)
    return frequencies[frequencies < highest], shapes[:, frequencies < highest]


def acceleration_filter(frequency, damping=DAMPING, step=1 / RATE):
    """Numerator and denominator of the recursion from a mode's force to its acceleration, for unit modal mass.

    It is exact for a force that is constant within each step: the acceleration after a unit step of the force is
    exp(-a t) (cos b t - a / b sin b t), with a = 2 pi f xi and b = 2 pi f (1 - xi^2)^(1/2).
    """
    decay = 2 * np.pi * frequency * damping
    damped = 2 * np.pi * frequency * np.sqrt(1 - damping**2)
    shrinkage, angle = np.exp(-decay * step), damped * step
    zero = shrinkage * (np.cos(angle) + decay / damped * np.sin(angle))
    return np.array([1, -1 - zero, zero]), np.array([1, -2 * shrinkage * np.cos(angle), shrinkage**2])


def ambient_vibration(frequencies, shapes, sensors, random, *, n_samples=int(DURATION * RATE), noise=SENSOR_NOISE):
    """Accelerations in m/s2, (n_samples, n_sensors), under white noise at all degrees of freedom.

    Parameters
    ----------
    frequencies : ndarray of shape (n_modes,)
        In Hz.
    shapes : ndarray of shape (n_dof, n_modes)
        Of unit modal mass.
    sensors : array-like of int
        Degrees of freedom that have a sensor.
    random : numpy.random.Generator
        Source of forces and noise.
    n_samples : int
        Length of the record.
    noise : float
        Of the sensors, relative to the standard deviation of each.
    """
    n_before = int(SETTLING * RATE / (2 * np.pi * frequencies.min() * DAMPING))
    forces = FORCE * random.standard_normal((n_before + n_samples, len(shapes))) @ shapes
    modal = [lfilter(*acceleration_filter(f), force) for f, force in zip(frequencies, forces.T, strict=True)]
    accelerations = np.transpose(modal)[n_before:] @ shapes[sensors].T
    return accelerations + noise * accelerations.std(axis=0) * random.standard_normal(accelerations.shape)
