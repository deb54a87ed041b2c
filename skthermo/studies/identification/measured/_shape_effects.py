"""Effects of changes of a structure on mode shapes at sensors."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._arrays import Array
from skthermo._changes import ChangedStructure
from skthermo._frequency_effects import central_differences


@dataclass(frozen=True)
class ShapeEffects:
    """Change of the mode shapes at sensors that amounts of change cause, at one theta.

    Scale, sign and phase of a shape mean nothing: each is turned to the ``reference``, (n_sensors, n_modes), and scaled
    to its length, and what remains are its components along the unit vectors ``across``, of each mode (n_sensors,
    n_known - 1), at right angles to the reference, where the mode is ``known``. The reference is the unchanged
    structure's, with a largest component of 1. Independent errors of the sensors, relative to the largest component,
    are independent errors of these components, of the same standard deviation.
    """

    structure: ChangedStructure
    theta: Array
    dofs: NDArray[np.intp]
    reference: Array
    known: NDArray[np.bool_]
    across: list[Array]

    @classmethod
    def of(cls, structure: ChangedStructure, theta: Array, dofs: ArrayLike) -> "ShapeEffects":
        """Effects at the mean of some rows of theta, on all sensors and modes."""
        model, mean = structure.fem.model, theta.mean(axis=0, keepdims=True)
        if not hasattr(model, "modes"):
            raise ValueError(f"{model!r} has no method 'modes'; expected a model with one, to compare mode shapes")
        shapes = model.modes(mean)[1][0]
        places = np.asarray(dofs)
        if places.ndim != 1 or not np.issubdtype(places.dtype, np.integer) or not places.size:
            raise ValueError(f"dofs is {dofs!r}; expected the degree of freedom of each sensor, counted from 0")
        if places.min() < 0 or places.max() >= len(shapes):
            raise ValueError(f"dofs reach from {places.min()} to {places.max()}; expected 0 to {len(shapes) - 1}")
        reference = shapes[places] / np.abs(shapes[places]).max(axis=0)
        known = np.ones(reference.shape, dtype=bool)
        return cls(structure, mean, places, reference, known, []).at(known)

    def at(self, known: NDArray[np.bool_]) -> "ShapeEffects":
        """The effects where sensors measured modes, (n_sensors, n_modes)."""
        across = []
        for column, sensors in zip(self.reference.T, known.T, strict=True):
            vectors = np.zeros((len(column), max(int(sensors.sum()) - 1, 0)))
            if sensors.any():
                vectors[sensors] = np.linalg.svd(column[np.newaxis, sensors])[2][1:].T
            across.append(vectors)
        return replace(self, known=known, across=across)

    @property
    def modes(self) -> NDArray[np.intp]:
        """The mode of each component, (n_observed,)."""
        return np.repeat(np.arange(len(self.across)), [vectors.shape[1] for vectors in self.across])

    def components(self, shapes: NDArray) -> Array:
        """Components of shapes (..., n_sensors, n_modes), real or complex, (..., n_observed)."""
        return self._across(self._turned(shapes))

    def __call__(self, amounts: Array) -> tuple[Array, Array]:
        """Change of every component, (..., n_observed), and derivatives, (..., n_observed, n_causes)."""
        sets = np.atleast_2d(amounts)
        if self.structure.is_exact:
            _, _, shapes, d_shapes = self.structure.linearise(self.theta, sets, self.dofs)
            turned = self._turned(shapes[:, 0])
            # turning and scaling leave derivatives along the shape out
            d_turned = np.moveaxis(d_shapes[:, 0] * self._factors(shapes[:, 0])[..., np.newaxis], -1, 0)
            along = (turned * d_turned).sum(axis=-2, keepdims=True, where=self.known)
            d_turned -= turned * along / self._lengths**2
            change, slopes = self._across(turned), np.moveaxis(self._across(d_turned), 0, -1)
        else:
            change = np.stack([self._changed(row) for row in sets])
            slopes = np.stack([central_differences(self._changed, row) for row in sets])
        return (change[0], slopes[0]) if np.ndim(amounts) == 1 else (change, slopes)

    def _changed(self, amounts: Array) -> Array:
        simulator, theta = self.structure.with_amounts(self.theta, amounts)
        return self.components(simulator.model.modes(theta)[1][0][self.dofs])

    def _factors(self, shapes: NDArray) -> NDArray:
        """What turns and scales each shape, (..., 1, n_modes)."""
        along = (shapes * self.reference).sum(axis=-2, keepdims=True, where=self.known)
        turns = np.where(along == 0, 1.0, np.conj(along) / np.where(along == 0, 1.0, np.abs(along)))
        sizes = (np.real(turns * shapes) ** 2).sum(axis=-2, keepdims=True, where=self.known)
        return turns * self._lengths / np.sqrt(np.where(sizes == 0, 1.0, sizes))

    def _turned(self, shapes: NDArray) -> Array:
        return np.where(self.known, np.real(self._factors(shapes) * shapes), 0.0)

    @property
    def _lengths(self) -> Array:
        lengths = np.sqrt((self.reference**2).sum(axis=0, where=self.known))
        return np.where(lengths == 0, 1.0, lengths)

    def _across(self, shapes: Array) -> Array:
        parts = [shapes[..., mode] @ vectors for mode, vectors in enumerate(self.across)]
        return np.concatenate(parts, axis=-1)
