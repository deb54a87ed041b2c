"""Mode shapes at sensors: effects of changes on them, and what was measured of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import Array, as_floats, check_dofs
from skthermo._core.warnings import warn_user
from skthermo.exceptions import RecordsWarning
from skthermo.studies.identification._curves import Part
from skthermo.studies.identification._shift import stated_deviations
from skthermo.surrogate.effects import ChangedStructure, amount_slopes

STATES = ("healthy", "damaged")
ALIKE = 0.5  # MAC of a measured healthy shape with the model's below which it counts as another mode
MEASURED = 0.5  # share of a mode's records that must have a sensor's component for it to count


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
        places = check_dofs(dofs, len(shapes), getattr(model, "dofs", ()))
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
            slopes = np.stack([amount_slopes(self._changed, row) for row in sets])
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


def shape_shift(
    candidates: Sequence[ShapeEffects], shapes: Any, noise: ArrayLike | Literal["fitted"], modes: Sequence[Any]
) -> Part:
    """Change of the components of measured shapes, with independent errors.

    From one or several records of each state, as `identify_damage` takes them. Of effects at different theta, those
    count whose unchanged shapes are most like the measured healthy ones: frequencies alone may have led theta astray
    where they hardly depend on it.
    """
    stated = stated_deviations(noise, len(modes), what="shape_noise", most=1)
    records = read_records(shapes, candidates[0].reference.shape)
    known = np.logical_and(*(measured_sensors(state) for state in records))
    known &= known.sum(axis=0) > 1
    complete = np.logical_and(*((~np.isnan(state) | ~known).all(axis=1).any(axis=0) for state in records))
    effects = max((one.at(known & complete) for one in candidates), key=lambda one: mac_of(one, records[0]).sum())
    foreign = (mac_of(effects, records[0]) < ALIKE) & effects.known.any(axis=0)
    if foreign.any():
        warn_user(
            f"measured healthy shapes of {foreign.sum()} of {len(foreign)} modes have a MAC below {ALIKE} with the "
            f"model's, {modes[np.flatnonzero(foreign)[0]]} the first. They are left out. Give shapes of the same "
            "modes, with rows in the order of dofs",
            RecordsWarning,
            "foreign-shapes",
        )
    effects = effects.at(effects.known & ~foreign)
    if not len(effects.modes):
        raise ValueError("no mode has shapes that can be compared; expected two sensors or more with both states")
    components = [effects.components(state) for state in records]
    number = [(~np.isnan(values)).sum(axis=0) for values in components]
    healthy, changed = (np.nanmean(values, axis=0) for values in components)
    variance = scatter(components, effects.modes, len(modes), is_needed=stated is None)
    variance = np.maximum(variance, 0.0 if stated is None else stated**2)[effects.modes]
    return Part(effects, changed - healthy, np.diag(variance * (1 / number[0] + 1 / number[1])))


def read_records(shapes: Any, expected: tuple[int, ...]) -> list[NDArray]:
    """Records of both states, (n_records, n_sensors, n_modes) each."""
    if not isinstance(shapes, Sequence) or len(shapes) != 2:
        raise ValueError("shapes is not a pair; expected measured shapes of the healthy and of the damaged structure")
    states = []
    for which, values in zip(STATES, shapes, strict=True):
        array = np.asarray(values)
        array = array if np.iscomplexobj(array) else as_floats(values)
        if array.shape[-2:] != expected or array.ndim > 3 or not len(array):
            raise ValueError(
                f"the {which} shapes have shape {array.shape}; expected a row for each of {expected[0]} sensors "
                f"and a column for each of {expected[1]} modes, or several records of these"
            )
        if np.isinf(array).any():
            raise ValueError(f"the {which} shapes hold infinite values; expected NaN where not measured")
        records = array.reshape(-1, *expected)
        if (records == 0).all(axis=1).any():
            mode = int(np.argwhere((records == 0).all(axis=1))[0, 1])
            raise ValueError(f"the {which} shape of mode {mode} is zero; expected NaN where it was not measured")
        states.append(records)
    return states


def measured_sensors(records: NDArray) -> NDArray[np.bool_]:
    """Sensors with a component of a mode in most of the records that have the mode, (n_sensors, n_modes)."""
    present = ~np.isnan(records)
    n_with_mode = present.any(axis=1).sum(axis=0)
    return present.sum(axis=0) >= np.maximum(MEASURED * n_with_mode, 1)


def mac_of(effects: ShapeEffects, records: NDArray) -> Array:
    """MAC of the mean measured shape of each mode with the reference, (n_modes,); 0 without a measured shape."""
    squares = np.nanmean(effects.components(records), axis=0) ** 2
    across = np.bincount(effects.modes, squares, minlength=len(effects.across))
    lengths = (effects.known * effects.reference**2).sum(axis=0)
    return np.where(lengths > 0, 1 - across / np.where(lengths > 0, lengths, 1.0), 0.0)


def scatter(components: list[Array], modes: NDArray[np.intp], n_modes: int, *, is_needed: bool) -> Array:
    """Variance of each mode's components about their state's mean, (n_modes,); 0 where all records are alone."""
    squares, freedom = np.zeros(n_modes), np.zeros(n_modes)
    for values in components:
        rest = np.nan_to_num(values - np.nanmean(values, axis=0))
        n_free = np.maximum((~np.isnan(values)).sum(axis=0) - 1, 0)
        squares += np.bincount(modes, (rest**2).sum(axis=0), minlength=n_modes)
        freedom += np.bincount(modes, n_free, minlength=n_modes)
    if is_needed and (freedom[modes] < 3).any():
        raise ValueError(
            'shape_noise is "fitted", which needs several records of shapes in one of the states; expected a standard '
            f"deviation, such as 0.01, since there are {len(components[0])} and {len(components[1])} records"
        )
    return squares / np.maximum(freedom - 2, 1)  # the mean variance of a normal law that is known so well
