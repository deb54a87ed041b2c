"""Measured mode shapes beside frequencies: their columns, and their misfits to the shapes of an FE model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import Array, by_mode, check_dofs, real_array
from skthermo.fem import FEModel, evaluate_modes, shape_components


@dataclass(frozen=True)
class ShapeInputs:
    """Columns of frequencies, and of the components of mode shapes, mode by mode.

    ``dofs`` are the sensors' degrees of freedom, ``reference`` the nominal shapes there, (n_sensors, n_modes), which
    set the signs, and ``noise`` standard deviations of components as a share of their shape's root mean square.
    """

    dofs: NDArray[np.intp]
    reference: Array
    noise: Array

    @classmethod
    def read(cls, model: FEModel, dofs: ArrayLike, noise: ArrayLike) -> ShapeInputs:
        """The columns for a model and sensors, each mode of which must move a sensor."""
        if not hasattr(model, "modes"):
            raise ValueError(f"dofs are given, but {model!r} has no method 'modes'; expected a model that gives shapes")
        shapes = np.asarray(model.modes(np.ones((1, len(model.parameter_names))))[1])[0]
        places = check_dofs(dofs, len(shapes), getattr(model, "dofs", ()))
        largest = np.abs(shapes[places]).max(axis=0) / np.abs(shapes).max(axis=0)
        if (largest < 1e-6).any():  # rounding errors at a node
            raise ValueError(
                f"mode {largest.argmin()} does not move the degrees of freedom {places.tolist()}; expected one that "
                "it moves, or model.with_modes without this mode"
            )
        deviations = real_array(by_mode(noise, model.n_modes, None, "shape_noise"), "shape_noise")
        if deviations.shape not in ((), (model.n_modes,)) or not ((deviations > 0) & (deviations < 1)).all():
            raise ValueError(
                f"shape_noise is {deviations}; expected standard deviations between 0 and 1, one number or "
                f"{model.n_modes}. 0.01 means 1 % of the root mean square of a shape"
            )
        return cls(places, shapes[places], np.broadcast_to(deviations, (model.n_modes,)))

    @property
    def n_sensors(self) -> int:
        return len(self.dofs)

    @property
    def n_modes(self) -> int:
        return self.reference.shape[1]

    @property
    def n_columns(self) -> int:
        return self.n_modes * (1 + self.n_sensors)

    @property
    def deviations(self) -> Array:
        """Standard deviations of the components of shapes of unit length, mode by mode, (n_modes * n_sensors,)."""
        return np.repeat(self.noise / np.sqrt(self.n_sensors), self.n_sensors)

    def normalised(self, inputs: Array) -> Array:
        """Inputs with components of a root mean square of 1 and the signs of the nominal shapes."""
        shapes = inputs[:, self.n_modes :].reshape(len(inputs), self.n_modes, self.n_sensors)
        return np.hstack([inputs[:, : self.n_modes], shape_components(shapes, self.reference)])

    def unit_shapes(self, inputs: Array) -> Array:
        """Measured shapes of unit length from normalised inputs, (n_samples, n_modes, n_sensors)."""
        shapes = inputs[:, self.n_modes :].reshape(len(inputs), self.n_modes, self.n_sensors)
        return shapes / np.sqrt(self.n_sensors)

    def simulated(self, model: FEModel, theta: Array, n_jobs: int | None = None) -> Array:
        """Inputs that the model gives for rows of theta, without noise."""
        frequencies, shapes = evaluate_modes(model, theta, self.dofs, n_jobs=n_jobs)
        return np.hstack([frequencies, shape_components(shapes.swapaxes(1, 2), self.reference)])


def shape_misfit(units: Array, shapes: Array, slopes: Array) -> tuple[Array, Array]:
    """Differences u - v of measured shapes u, (n_samples, n_modes, n_sensors), and computed shapes v of unit length,
    and the derivatives of v.

    Computed shapes, (n_samples, n_sensors, n_modes), get the signs of the measured ones. Where a mode is missing, the
    difference is 0.
    """
    phi, d_phi = shapes.swapaxes(1, 2), slopes.swapaxes(1, 2)
    length = np.linalg.norm(phi, axis=2, keepdims=True)
    v = phi / length
    along = np.einsum("smd,smdp->smp", v, d_phi)
    dv = (d_phi - v[:, :, :, np.newaxis] * along[:, :, np.newaxis]) / length[:, :, :, np.newaxis]
    u = np.where(np.isnan(units), v, units)
    signs = np.where(np.einsum("smd,smd->sm", u, v) < 0, -1.0, 1.0)[:, :, np.newaxis]
    n_samples, n_parameters = len(u), slopes.shape[3]
    residual = (u - signs * v).reshape(n_samples, -1)
    return residual, (signs[:, :, :, np.newaxis] * dv).reshape(n_samples, -1, n_parameters)
