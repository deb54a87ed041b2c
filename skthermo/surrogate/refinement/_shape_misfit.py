"""Differences between measured and computed mode shapes, all rows at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array


@dataclass(frozen=True)
class MeasuredShapes:
    """Measured shapes u of unit length, (n_samples, n_modes, n_sensors), NaN where a mode is missing."""

    units: Array

    @property
    def missing(self) -> NDArray[np.bool_]:
        """Which components are missing, (n_samples, n_modes * n_sensors)."""
        return np.isnan(self.units).reshape(len(self.units), -1)

    def of(self, rows: NDArray) -> "MeasuredShapes":
        """Some rows."""
        return MeasuredShapes(self.units[rows])

    def with_modes(self, order: NDArray) -> "MeasuredShapes":
        """The modes in another order."""
        return MeasuredShapes(self.units[:, order])

    def misfit(self, shapes: Array, slopes: Array) -> tuple[Array, Array]:
        """Differences u - v between measured and computed shapes v of unit length, and the derivatives of v.

        Computed shapes get the signs of the measured ones. Where a mode is missing, the difference is 0.

        Parameters
        ----------
        shapes : ndarray of shape (n_samples, n_sensors, n_modes)
            Computed, of any scale and sign.
        slopes : ndarray of shape (n_samples, n_sensors, n_modes, n_parameters)
            Their derivatives.

        Returns
        -------
        residual : ndarray of shape (n_samples, n_modes * n_sensors)
        sensitivity : ndarray of shape (n_samples, n_modes * n_sensors, n_parameters)
        """
        phi, d_phi = shapes.swapaxes(1, 2), slopes.swapaxes(1, 2)
        length = np.linalg.norm(phi, axis=2, keepdims=True)
        v = phi / length
        along = np.einsum("smd,smdp->smp", v, d_phi)
        dv = (d_phi - v[:, :, :, np.newaxis] * along[:, :, np.newaxis]) / length[:, :, :, np.newaxis]
        u = np.where(np.isnan(self.units), v, self.units)
        signs = np.where(np.einsum("smd,smd->sm", u, v) < 0, -1.0, 1.0)[:, :, np.newaxis]
        n_samples, n_parameters = len(u), slopes.shape[3]
        residual = (u - signs * v).reshape(n_samples, -1)
        return residual, (signs[:, :, :, np.newaxis] * dv).reshape(n_samples, -1, n_parameters)
