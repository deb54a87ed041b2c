"""Standardisation of inputs and targets: logarithms, coordinates of frequencies, zero mean, unit variance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from sklearn.preprocessing import StandardScaler

from skthermo._arrays import Array, real_array


@dataclass(frozen=True, eq=False)
class FrequencyCoordinates:
    """Coordinates z = A ln theta in which errors of parameters count as much as they change the frequencies.

    Parameters
    ----------
    sensitivities : array-like of shape (n_modes, n_parameters)
        A: derivatives d ln f / d ln theta of an FE model, divided by the relative standard deviation of each mode.
    damping : float or array-like of shape (n_parameters,), default=0.0
        What damped least squares adds to the diagonal of A'A to find ln theta again. It keeps parameters that hardly
        change the frequencies near their means.

    Raises
    ------
    ValueError
        If the sensitivities are no table of finite numbers, or the damping is negative or of another length.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import linearise
    >>> from skthermo.surrogate import FrequencyCoordinates, TemperatureMapper
    >>> jacobian = linearise(make_truss(), np.ones((1, 4)), relative=True)[1][0]
    >>> mapper = TemperatureMapper(coordinates=FrequencyCoordinates(jacobian / 0.01, damping=1.0))
    """

    sensitivities: ArrayLike
    damping: ArrayLike = 0.0

    def __post_init__(self) -> None:
        A, damping = real_array(self.sensitivities, "sensitivities"), real_array(self.damping, "damping")
        if A.ndim != 2 or not np.isfinite(A).all():
            raise ValueError(f"sensitivities have shape {A.shape}; expected finite numbers, (n_modes, n_parameters)")
        if damping.shape not in ((), A.shape[1:]) or not ((damping >= 0) & np.isfinite(damping)).all():
            raise ValueError(f"damping is {damping}; expected one number from 0, or {A.shape[1]}, one a parameter")
        object.__setattr__(self, "sensitivities", A)
        object.__setattr__(self, "damping", np.broadcast_to(damping, A.shape[1:]))

    @property
    def inverse(self) -> Array:
        """(A'A + damping)^-1 A', the pseudo-inverse without damping, (n_parameters, n_modes)."""
        A = self.sensitivities
        return np.linalg.pinv(np.vstack([A, np.diag(np.sqrt(self.damping))]))[:, : len(A)]

    def check(self, theta: Array) -> None:
        """Refuse parameters that these coordinates are not of.

        Parameters
        ----------
        theta : ndarray of shape (n_samples, n_parameters)
            Multipliers; NaN is ignored.

        Raises
        ------
        ValueError
            If a multiplier is not positive, or their number is another one.
        """
        n_parameters = self.sensitivities.shape[1]
        if theta.shape[1] != n_parameters:
            raise ValueError(f"theta has {theta.shape[1]} columns; expected the {n_parameters} of the sensitivities")
        if (theta <= 0).any():
            raise ValueError(f"theta falls to {np.nanmin(theta):g}; expected positive multipliers with coordinates")


@dataclass(frozen=True)
class Standardiser:
    """z = (A x - mean) / scale, of x or of log x, and the inverse.

    ``coordinates`` hold the matrix A; without them it is the identity. ``middle`` is the mean of x, which the inverse
    keeps in directions that A does not see.
    """

    mean: Array
    scale: Array
    log: bool
    middle: Array
    coordinates: FrequencyCoordinates | None = None

    @classmethod
    def fitted(
        cls,
        values: Array,
        *,
        log: bool,
        coordinates: FrequencyCoordinates | None = None,
        sample_weight: Array | None = None,
    ) -> Standardiser:
        """Mean and standard deviation of some values; the scale of a constant column is 1."""
        x = np.log(values) if log else values
        z = x if coordinates is None else x @ coordinates.sensitivities.T
        scaler = StandardScaler().fit(z, sample_weight=sample_weight)
        return cls(scaler.mean_, scaler.scale_, log, np.average(x, axis=0, weights=sample_weight), coordinates)

    def transform(self, values: Array) -> Array:
        """Standardised values."""
        x = np.log(values) if self.log else values
        return ((x if self.coordinates is None else x @ self.coordinates.sensitivities.T) - self.mean) / self.scale

    def inverse_transform(self, standardised: Array) -> Array:
        """Values from standardised values; a logarithm too large for a float becomes infinity."""
        deviation, A = standardised * self.scale, self.coordinates
        x = self.mean + deviation if A is None else self.middle + deviation @ A.inverse.T
        with np.errstate(over="ignore"):
            return np.exp(x) if self.log else x

    def inverse_deviations(self, deviations: Array, values: Array) -> Array:
        """Standard deviations of values from those of the standardised values, to first order.

        Errors of different coordinates count as independent.
        """
        std = deviations * self.scale
        if self.coordinates is not None:
            std = np.sqrt(std**2 @ self.coordinates.inverse.T**2)
        return std * (values if self.log else 1)
