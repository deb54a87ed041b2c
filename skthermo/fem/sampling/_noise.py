"""Measurement noise on frequencies."""

from __future__ import annotations

import numpy as np
import scipy  # which loads scipy.signal once it is used
from numpy.typing import ArrayLike, NDArray

from skthermo._estimators.arguments import check_noise, check_size
from skthermo._tables.arrays import RandomState, as_random_state, real_array


def add_noise(
    frequencies: ArrayLike, noise: ArrayLike, *, correlation: float = 0.0, random_state: RandomState = None
) -> NDArray[np.float64]:
    """Frequencies times (1 + noise * standard Gaussian).

    Parameters
    ----------
    frequencies : array-like of shape (n_samples, n_modes)
        In Hz.
    noise : float or array-like of shape (n_modes,)
        Relative standard deviation; 0 leaves the frequencies as they are.
    correlation : float, default=0.0
        Correlation of the noise of neighbouring rows, above -1 and below 1. Noise k rows apart is correlated by its
        k-th power: a stationary autoregressive process of first order.
    random_state : int, RandomState or None, default=None
        Seed.

    Returns
    -------
    ndarray of shape (n_samples, n_modes)
        In Hz.

    Raises
    ------
    ValueError
        If the noise is negative, 1 or more, or of another length, the correlation is not between -1 and 1, or a number
        is not real.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.fem import add_noise
    >>> noisy = add_noise(np.full((10_000, 2), 4.0), [0.0, 0.01], random_state=0)
    >>> noisy.std(axis=0).round(2)
    array([0.  , 0.04])
    """
    clean, names = real_array(frequencies, "frequencies"), getattr(frequencies, "columns", None)
    if np.isinf(clean).any():
        raise ValueError("frequencies hold infinite values; expected finite ones, or NaN")
    if clean.ndim != 2:
        raise ValueError(f"frequencies have shape {clean.shape}; expected (n_samples, n_modes)")
    deviation = check_noise(noise, clean.shape[1], names)
    memory = check_size(correlation, "correlation", -1, 1, "a number between -1 and 1, such as 0.9")
    relative = as_random_state(random_state).standard_normal(clean.shape)
    if memory:
        relative[1:] *= np.sqrt(1 - memory**2)
        relative = scipy.signal.lfilter([1.0], [1.0, -memory], relative, axis=0)
    return clean * (1 + deviation * relative)
