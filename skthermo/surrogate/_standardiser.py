"""Standardisation of inputs and targets: logarithms, coordinates of frequencies, zero mean, unit variance."""

from dataclasses import dataclass

import numpy as np
from sklearn.preprocessing import StandardScaler

from skthermo._arrays import Array


@dataclass(frozen=True)
class FrequencyCoordinates:
    """Coordinates z = A ln theta: the changes of ln f that belong to changes of ln theta, to first order.

    ``sensitivities`` is A, (n_modes, n_parameters): d ln f / d ln theta in units of any scale. ``damping``, a number or
    (n_parameters,), is what damped least squares adds to the diagonal of A'A to find ln theta again.
    """

    sensitivities: Array
    damping: Array | float = 0.0

    @property
    def inverse(self) -> Array:
        """(A'A + damping)^-1 A', the pseudo-inverse without damping, (n_parameters, n_modes)."""
        A = self.sensitivities
        damping = np.broadcast_to(self.damping, (A.shape[1],))
        return np.linalg.pinv(np.vstack([A, np.diag(np.sqrt(damping))]))[:, : len(A)]


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
    ) -> "Standardiser":
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
