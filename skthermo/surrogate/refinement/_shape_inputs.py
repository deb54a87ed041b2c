"""Mode shapes as inputs of the inverse surrogate, beside frequencies."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from skthermo._arguments import check_dofs
from skthermo._arrays import Array, real_array
from skthermo.fem import evaluate_modes, shape_components

NODE = 1e-6
"""Largest component at the sensors, as a share of the largest of the shape, below which a mode does not move them."""


@dataclass(frozen=True)
class ShapeInputs:
    """Columns of frequencies, and of the components of mode shapes, mode by mode.

    Attributes
    ----------
    dofs : ndarray of int of shape (n_sensors,)
        Degrees of freedom of the sensors.
    reference : ndarray of shape (n_sensors, n_modes)
        Nominal shapes there, which set the signs.
    noise : ndarray of shape (n_modes,)
        Standard deviations of a component as a share of the root mean square of its shape's.
    """

    dofs: NDArray[np.intp]
    reference: Array
    noise: Array

    @classmethod
    def of(cls, model: Any, dofs: ArrayLike, noise: ArrayLike) -> "ShapeInputs":
        """For a model and sensors.

        Raises
        ------
        ValueError
            If the model gives no shapes, ``dofs`` are not different degrees of freedom of it, a mode does not move
            them, or the noise is not positive.
        """
        if not hasattr(model, "modes"):
            raise ValueError(f"dofs are given, but {model!r} has no method 'modes'; expected a model that gives shapes")
        shapes = np.asarray(model.modes(np.ones((1, len(model.parameter_names))))[1])[0]
        places = check_dofs(dofs, len(shapes))
        largest = np.abs(shapes[places]).max(axis=0) / np.abs(shapes).max(axis=0)
        if (largest < NODE).any():
            raise ValueError(
                f"mode {largest.argmin()} does not move the degrees of freedom {places.tolist()}; expected one that "
                "it moves, or model.with_modes without this mode"
            )
        deviations = real_array(noise, "shape_noise")
        if deviations.shape not in ((), (model.n_modes,)) or not ((deviations > 0) & (deviations < 1)).all():
            raise ValueError(
                f"shape_noise is {deviations}; expected a standard deviation between 0 and 1 (0.01 means 1 % of the "
                f"root mean square of a shape), a number or one for each of the {model.n_modes} modes"
            )
        return cls(places, shapes[places], np.broadcast_to(deviations, (model.n_modes,)))

    @property
    def n_sensors(self) -> int:
        """Number of sensors."""
        return len(self.dofs)

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return self.reference.shape[1]

    @property
    def n_columns(self) -> int:
        """Number of columns of inputs."""
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

    def of_parameters(self, model: Any, theta: Array, n_jobs: int | None = None) -> Array:
        """Inputs that the model gives for rows of theta, without noise."""
        frequencies, shapes = evaluate_modes(model, theta, self.dofs, n_jobs=n_jobs)
        return np.hstack([frequencies, shape_components(shapes.swapaxes(1, 2), self.reference)])

    def with_noise(self, inputs: Array, random_state: np.random.RandomState) -> Array:
        """Normalised inputs with noise on the components, normalised again."""
        noise = np.repeat(self.noise, self.n_sensors) * random_state.standard_normal(
            (len(inputs), len(self.deviations))
        )
        return self.normalised(np.hstack([inputs[:, : self.n_modes], inputs[:, self.n_modes :] + noise]))


class ShapeScores:
    """A few positive scores in place of many components: linear estimates of the parameters.

    Ridge regression of ln theta on ln f and the components learns from noisy simulations which combinations of
    components tell about the parameters. A regressor then has n_modes + n_parameters inputs, however many sensors there
    are.
    """

    def __init__(self, n_modes: int, inputs: Array, theta: Array):
        self._n_modes = n_modes
        complete = ~(np.isnan(inputs).any(axis=1) | np.isnan(theta).any(axis=1))
        self._linear = make_pipeline(StandardScaler(), Ridge())
        self._linear.fit(self._columns(inputs[complete]), np.log(theta[complete]))

    def transform(self, inputs: Array) -> Array:
        """Frequencies and scores, (n_samples, n_modes + n_parameters); NaN in rows that are not complete."""
        scores = np.full((len(inputs), self._linear[-1].coef_.shape[0]), np.nan)
        complete = ~np.isnan(inputs).any(axis=1)
        if complete.any():
            scores[complete] = np.exp(self._linear.predict(self._columns(inputs[complete])))
        return np.hstack([inputs[:, : self._n_modes], scores])

    def _columns(self, inputs: Array) -> Array:
        return np.hstack([np.log(inputs[:, : self._n_modes]), inputs[:, self._n_modes :]])
