"""Effects of damage on mode shapes at sensors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skthermo._arguments import check_noise
from skthermo._arrays import Array, as_floats
from skthermo._frequency_effects import central_differences


@dataclass(frozen=True)
class ShapeEffects:
    """Change of the mode shapes at sensors that severities cause, at one theta.

    All shapes are scaled to the reference, those of the undamaged model, (n_sensors, n_modes).
    """

    model: Any
    theta: Array
    groups: Sequence[str]
    dofs: Array
    reference: Array

    @classmethod
    def of(cls, fem: Any, theta: Array, groups: Sequence[str], dofs: ArrayLike) -> "ShapeEffects":
        """Effects at the mean of some rows of theta."""
        if not hasattr(fem.model, "modes"):
            raise ValueError(f"{fem.model!r} has no method 'modes'; expected a model with one, to compare mode shapes")
        mean = theta.mean(axis=0, keepdims=True)
        shapes = fem.model.modes(mean)[1][0]
        places = np.asarray(dofs)
        if places.ndim != 1 or not np.issubdtype(places.dtype, np.integer) or not places.size:
            raise ValueError(f"dofs is {dofs!r}; expected the degree of freedom of each sensor, counted from 0")
        if places.min() < 0 or places.max() >= len(shapes):
            raise ValueError(f"dofs reach from {places.min()} to {places.max()}; expected 0 to {len(shapes) - 1}")
        return cls(fem.model, mean, groups, places, shapes[places])

    def __call__(self, severities: Array) -> tuple[Array, Array]:
        """Change of every component, (n_sensors * n_modes,), and its derivatives by the severities."""
        slopes = central_differences(self._shapes, severities)
        return self._shapes(severities) - self.reference.ravel(), slopes

    def _shapes(self, severities: Array) -> Array:
        damaged = self.model.damaged(dict(zip(self.groups, severities.tolist(), strict=True)))
        return self.scaled(damaged.modes(self.theta)[1][0][self.dofs]).ravel()

    def scaled(self, shapes: Array) -> Array:
        """Shapes rotated and scaled to the reference by least squares, which makes them real; NaN stays."""
        known = np.where(np.isnan(shapes), 0.0, shapes)
        sizes = (np.abs(known) ** 2).sum(axis=0)
        factors = (np.conj(known) * self.reference).sum(axis=0) / np.where(sizes > 0, sizes, 1.0)
        return np.where(np.isnan(shapes), np.nan, np.real(factors * known))

    def measured(self, shapes: Any, noise: ArrayLike) -> tuple[Array, Array]:
        """Change of every component from a healthy to a damaged shape, and its standard deviation."""
        if not isinstance(shapes, Sequence) or len(shapes) != 2:
            raise ValueError(
                "shapes is not a pair; expected measured shapes of the healthy and of the damaged structure"
            )
        pair = []
        for which, values in zip(("healthy", "damaged"), shapes, strict=True):
            array = np.asarray(values)
            array = array if np.iscomplexobj(array) else as_floats(values)
            if array.shape != self.reference.shape:
                raise ValueError(
                    f"the {which} shapes have shape {array.shape}; expected a row for each of {len(self.dofs)} sensors "
                    f"and a column for each of {self.reference.shape[1]} modes"
                )
            if np.isinf(array).any():
                raise ValueError(f"the {which} shapes hold infinite values; expected NaN where not measured")
            if (array == 0).all(axis=0).any():
                mode = int((array == 0).all(axis=0).argmax())
                raise ValueError(f"the {which} shape of mode {mode} is zero; expected NaN where it was not measured")
            pair.append(self.scaled(array))
        relative = check_noise(noise, self.reference.shape[1], what="shape_noise", most=1)
        if (relative == 0).any():
            raise ValueError(f"shape_noise is {noise!r}; expected standard deviations above 0")
        largest = np.abs(self.reference).max(axis=0)
        deviations = np.sqrt(2) * relative * largest
        return (pair[1] - pair[0]).ravel(), np.tile(deviations, len(self.dofs))
