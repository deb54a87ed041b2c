"""Central differences."""

from collections.abc import Callable

import numpy as np

from skthermo._arrays import Array


def central_differences(function: Callable[[Array], Array], theta: Array, values: Array, step: float) -> Array:
    """Derivatives of a function at many rows of theta, (n_samples, ..., n_parameters).

    Parameters
    ----------
    function : callable
        Turns rows of theta into values (n_rows, ...), NaN where it has none.
    theta : ndarray of shape (n_samples, n_parameters)
        Where to differentiate.
    values : ndarray of shape (n_samples, ...)
        The function's values at theta. They take the place of a side on which the function is NaN.
    step : float
        Relative step.
    """
    n_samples, n_parameters = theta.shape
    steps = step * theta[:, np.newaxis] * np.eye(n_parameters)  # (sample, perturbed parameter, parameter)
    moved = np.stack([theta[:, np.newaxis] + steps, theta[:, np.newaxis] - steps])
    sides = function(moved.reshape(-1, n_parameters)).reshape(2, n_samples, n_parameters, *values.shape[1:])
    known = ~np.isnan(sides)
    above, below = np.where(known, sides, values[:, np.newaxis])
    n_known = np.where(known.any(axis=0), known.sum(axis=0), np.nan)
    widths = n_known * (step * theta).reshape(n_samples, n_parameters, *[1] * (values.ndim - 1))
    return np.moveaxis((above - below) / widths, 1, -1)
