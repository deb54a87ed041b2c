"""Standardisation of inputs and targets: logarithms, zero mean, unit variance."""

from dataclasses import dataclass

import numpy as np
from sklearn.preprocessing import StandardScaler

from skthermo._arrays import Array


@dataclass(frozen=True)
class Standardiser:
    """z = (x - mean) / scale for each column, of x or of log x, and the inverse.

    Attributes
    ----------
    mean, scale : ndarray of shape (n_columns,)
        Mean and standard deviation of the values, or of their logarithms.
    log : bool
        Whether logarithms are taken; the inverse then gives positive values.
    """

    mean: Array
    scale: Array
    log: bool

    @classmethod
    def fitted(cls, values: Array, *, log: bool) -> "Standardiser":
        """Mean and standard deviation of some values; the scale of a constant column is 1."""
        scaler = StandardScaler().fit(np.log(values) if log else values)
        return cls(scaler.mean_, scaler.scale_, log)

    def transform(self, values: Array) -> Array:
        """Standardised values."""
        return ((np.log(values) if self.log else values) - self.mean) / self.scale

    def inverse_transform(self, standardised: Array) -> Array:
        """Values from standardised values; a logarithm too large for a float becomes infinity."""
        values = standardised * self.scale + self.mean
        with np.errstate(over="ignore"):
            return np.exp(values) if self.log else values

    def inverse_deviations(self, deviations: Array, values: Array) -> Array:
        """Standard deviations of values from those of the standardised values, to first order."""
        return deviations * self.scale * (values if self.log else 1)


def is_positive(values: Array) -> bool:
    """Whether all values have a logarithm."""
    return bool((values > 0).all())
