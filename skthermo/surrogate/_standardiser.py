"""Standardisation of inputs and targets: logarithms, other coordinates, zero mean, unit variance."""

from dataclasses import dataclass

import numpy as np
from sklearn.preprocessing import StandardScaler

from skthermo._arrays import Array


@dataclass(frozen=True)
class Standardiser:
    """z = (A x - mean) / scale, of x or of log x, and the inverse.

    Attributes
    ----------
    mean, scale : ndarray of shape (n_coordinates,)
        Mean and standard deviation of A x.
    log : bool
        Whether logarithms are taken; the inverse then gives positive values.
    middle : ndarray of shape (n_columns,)
        Mean of x, which the inverse keeps in directions that A does not see.
    coordinates : ndarray of shape (n_coordinates, n_columns) or None
        The matrix A; None is the identity.
    damping : float or ndarray of shape (n_columns,)
        What damped least squares adds to the diagonal of A'A to find x again.
    """

    mean: Array
    scale: Array
    log: bool
    middle: Array
    coordinates: Array | None = None
    damping: Array | float = 0.0

    @classmethod
    def fitted(
        cls,
        values: Array,
        *,
        log: bool,
        coordinates: Array | None = None,
        damping: Array | float = 0.0,
        sample_weight: Array | None = None,
    ) -> "Standardiser":
        """Mean and standard deviation of some values; the scale of a constant column is 1."""
        x = np.log(values) if log else values
        z = x if coordinates is None else x @ coordinates.T
        scaler = StandardScaler().fit(z, sample_weight=sample_weight)
        middle = np.average(x, axis=0, weights=sample_weight)
        return cls(scaler.mean_, scaler.scale_, log, middle, coordinates, damping)

    def transform(self, values: Array) -> Array:
        """Standardised values."""
        x = np.log(values) if self.log else values
        return ((x if self.coordinates is None else x @ self.coordinates.T) - self.mean) / self.scale

    def inverse_transform(self, standardised: Array) -> Array:
        """Values from standardised values; a logarithm too large for a float becomes infinity."""
        deviation = standardised * self.scale
        x = self.mean + deviation if self.coordinates is None else self.middle + deviation @ self._inverse.T
        with np.errstate(over="ignore"):
            return np.exp(x) if self.log else x

    def inverse_deviations(self, deviations: Array, values: Array) -> Array:
        """Standard deviations of values from those of the standardised values, to first order.

        Errors of different coordinates count as independent.
        """
        std = deviations * self.scale
        if self.coordinates is not None:
            std = np.sqrt(std**2 @ self._inverse.T**2)
        return std * (values if self.log else 1)

    @property
    def _inverse(self) -> Array:
        return damped_inverse(self.coordinates, self.damping)


def damped_inverse(A: Array, damping: Array | float) -> Array:
    """(A'A + damping)^-1 A', the pseudo-inverse without damping."""
    damping = np.broadcast_to(damping, (A.shape[1],))
    return np.linalg.pinv(np.vstack([A, np.diag(np.sqrt(damping))]))[:, : len(A)]


def is_positive(values: Array) -> bool:
    """Whether all values have a logarithm."""
    return bool((values > 0).all())
