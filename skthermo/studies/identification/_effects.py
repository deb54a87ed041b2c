"""Effects of causes on what is measured: frequencies, and mode shapes at sensors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag

from skthermo._core.arrays import Array, as_floats, check_dofs
from skthermo.exceptions import RecordsWarning, SkthermoWarning
from skthermo.studies.identification._causes import Cause, changed
from skthermo.studies.identification._shift import FrequencyShift, stated_deviations

N_STEPS = 400  # between 0 and the bound of an amount, for which effects are tabulated
Response = Callable[[Sequence[Cause], Sequence[float]], Array]
"""Change of what is observed by some amounts of causes, (n_observed,)."""


@dataclass(frozen=True)
class Observed:
    """Measured changes of what is observed, (n_observed,), the covariance of their errors, and the model's response."""

    change: Array
    covariance: Array
    response: Response
    findings: list[SkthermoWarning]


def observed(fem: Any, model: Any, shift: FrequencyShift, shapes: Any, dofs: Any, shape_noise: Any) -> Observed:
    """Shifts of the measured frequencies, and of mode shapes if there are any; ``model`` may be a divided one."""
    known = ~np.isnan(shift.mean)
    model = getattr(model, "full", model)

    def frequencies(causes: Sequence[Cause], amounts: Sequence[float]) -> Array:
        after, theta = changed(model, shift.theta, causes, amounts)
        solved = after.frequencies(theta)
        return np.log(as_floats(fem.aligner_.inverse_transform(solved)))[0, known]

    before = frequencies([], [])
    covariance = shift.covariance[np.ix_(known, known)]
    if shapes is None:
        return Observed(shift.mean[known], covariance, lambda *change: frequencies(*change) - before, [])
    of_shapes, theta, change, variances, findings = _shape_changes(
        model, shift.theta, shapes, dofs, shape_noise, fem.mode_names_
    )

    def both(causes: Sequence[Cause], amounts: Sequence[float]) -> Array:
        after, rows = changed(model, theta, causes, amounts)  # the model's own components are 0
        components = of_shapes.components(after.modes(rows)[1][0][of_shapes.dofs])
        return np.append(frequencies(causes, amounts) - before, components)

    covariance = block_diag(covariance, np.diag(variances))
    return Observed(np.append(shift.mean[known], change), covariance, both, findings)


@dataclass(frozen=True)
class ShapeComponents:
    """Components of mode shapes across a reference, (n_sensors, n_modes), where both states of a mode were measured.

    Scale, sign and phase of a shape mean nothing: each is turned to the reference and scaled to its length; what
    remains are its components along unit vectors at right angles to the reference. Independent errors of the sensors
    are independent errors of these components.
    """

    dofs: NDArray[np.intp]
    reference: Array
    known: NDArray[np.bool_]

    def components(self, shapes: NDArray) -> Array:
        """Components of real or complex shapes (..., n_sensors, n_modes), mode after mode, (..., n_observed)."""
        found = []
        for mode in np.flatnonzero(self.known.any(axis=0)):
            rows = self.known[:, mode]
            reference, shape = self.reference[rows, mode], shapes[..., rows, mode]
            turned = np.real(shape * np.exp(-1j * np.angle(shape @ reference))[..., np.newaxis])
            turned *= np.linalg.norm(reference) / np.linalg.norm(turned, axis=-1, keepdims=True)
            found.append(turned @ np.linalg.svd(reference[np.newaxis])[2][1:].T)
        return np.concatenate(found, axis=-1)

    @property
    def modes(self) -> NDArray[np.intp]:
        """The mode of each component, (n_observed,)."""
        return np.repeat(np.arange(self.known.shape[1]), np.maximum(self.known.sum(axis=0) - 1, 0))


def _shape_changes(
    model: Any, theta: Array, shapes: Any, dofs: ArrayLike | None, noise: Any, names: Sequence[Any]
) -> tuple[ShapeComponents, Array, Array, Array, list[SkthermoWarning]]:
    """Components of the model's shapes, its theta, and the measured change of the components with its variances.

    Of the records' parameters and the nominal ones, those count that give the measured healthy shapes better.
    """
    if dofs is None:
        raise ValueError("shapes came without dofs; expected the degree of freedom of each of their rows")
    if not hasattr(model, "modes"):
        raise ValueError(f"{model!r} has no method 'modes'; expected a model with one, to compare mode shapes")
    stated = stated_deviations(noise, len(names), what="shape_noise", most=1)
    candidates = []
    for state in (theta, np.ones_like(theta)):
        whole = model.modes(state)[1][0]
        places = check_dofs(dofs, len(whole), getattr(model, "dofs", ()))
        reference = whole[places] / np.abs(whole[places]).max(axis=0)
        records = read_shapes(shapes, reference.shape)
        known = np.logical_and(*((~np.isnan(one)).mean(axis=0) >= 0.5 * _share_of_mode(one) for one in records))
        alike = np.array([_mac(one, healthy) for one, healthy in zip(reference.T, records[0].T, strict=True)])
        candidates.append((alike, state, reference, known))
    alike, state, reference, known = max(candidates, key=lambda one: np.nansum(one[0]))
    foreign = (alike < 0.5) & known.any(axis=0)
    of_shapes = ShapeComponents(places, reference, known & ~foreign & (known.sum(axis=0) > 1))
    if not of_shapes.known.any():
        raise ValueError("no mode has shapes that can be compared; expected two sensors or more with both states")
    values = [of_shapes.components(one) for one in records]
    number = [(~np.isnan(one)).sum(axis=0) for one in values]
    means = [np.nanmean(one, axis=0) for one in values]
    squares = sum(np.nansum((one - mean) ** 2, axis=0) for one, mean in zip(values, means, strict=True))
    modes, freedom = of_shapes.modes, number[0] + number[1] - 2
    scatter = np.bincount(modes, squares) / np.maximum(np.bincount(modes, freedom) - 2, 1)
    if stated is None and (np.bincount(modes, freedom)[modes] < 3).any():
        raise ValueError(
            'shape_noise is "fitted", which needs several records of shapes in one of the states; expected a standard '
            f"deviation, such as 0.01, since there are {len(values[0])} and {len(values[1])} records"
        )
    variances = np.maximum(scatter[modes], 0.0 if stated is None else stated[modes] ** 2)
    findings: list[SkthermoWarning] = []
    if foreign.any():
        findings.append(
            RecordsWarning(
                f"measured healthy shapes of {foreign.sum()} of {len(foreign)} modes have a MAC below 0.5 with the "
                f"model's, {names[np.flatnonzero(foreign)[0]]} the first. They are left out. Give shapes of the same "
                "modes, with rows in the order of dofs",
                "foreign-shapes",
            )
        )
    return of_shapes, state, means[1] - means[0], variances * (1 / number[0] + 1 / number[1]), findings


def read_shapes(shapes: Any, expected: tuple[int, ...]) -> list[NDArray]:
    """Records of both states, (n_records, n_sensors, n_modes) each."""
    if not isinstance(shapes, Sequence) or len(shapes) != 2:
        raise ValueError("shapes is not a pair; expected measured shapes of the healthy and of the damaged structure")
    states = []
    for which, values in zip(("healthy", "damaged"), shapes, strict=True):
        array = np.asarray(values)
        array = array if np.iscomplexobj(array) else as_floats(values)
        if array.shape[-2:] != expected or array.ndim > 3 or not len(array):
            raise ValueError(
                f"the {which} shapes have shape {array.shape}; expected a row for each of {expected[0]} sensors "
                f"and a column for each of {expected[1]} modes, or several records of these"
            )
        records = array.reshape(-1, *expected)
        if np.isinf(records).any() or (records == 0).all(axis=1).any():
            raise ValueError(
                f"the {which} shapes hold infinite values, or a shape that is zero; expected NaN where not measured"
            )
        states.append(records)
    return states


def _share_of_mode(records: NDArray) -> Array:
    """Share of the records that have a mode, (n_modes,); above 0."""
    return np.maximum((~np.isnan(records)).any(axis=1).mean(axis=0), 1e-9)


def _mac(reference: Array, records: NDArray) -> float:
    """Mean MAC of the records of a shape, (n_sensors, n_records), with a reference; NaN without any."""
    found = []
    for shape in records.T:
        known = ~np.isnan(shape)
        if known.sum() > 1:
            along = np.abs(np.vdot(shape[known], reference[known])) ** 2
            found.append(along / (np.vdot(shape[known], shape[known]).real * (reference[known] ** 2).sum()))
    return float(np.mean(found)) if found else np.nan


@dataclass(frozen=True)
class Curves:
    """Effects of single causes at equal steps of their amounts, (n_causes, N_STEPS + 1, n_observed), and slopes."""

    bounds: Array
    values: Array
    slopes: Array

    @classmethod
    def tabulated(cls, response: Response, causes: Sequence[Cause], n_solved: int = 9) -> Curves:
        """Cubic splines over the logarithm of what changes, through effects at a few amounts."""
        values, slopes = [], []
        for cause in causes:
            ends = np.linspace(0, 1, n_solved) ** 2 * np.log1p(cause.direction * cause.bound)  # small amounts are usual
            changes = [response([cause], [cause.direction * np.expm1(end)]) for end in ends[1:]]
            curve = CubicSpline(np.abs(ends), np.vstack([0 * changes[0], *changes]))
            factors = 1 + cause.direction * np.linspace(0, cause.bound, N_STEPS + 1)
            places = np.abs(np.log(factors))
            values.append(curve(places))
            slopes.append(curve(places, 1) * (np.sign(ends[-1]) * cause.direction / factors)[:, np.newaxis])
        return cls(np.array([cause.bound for cause in causes]), np.array(values), np.array(slopes))

    def summed(self, incidence: NDArray, causes: Sequence[Cause]) -> Curves:
        """Effects of causes that are sums of others, by one amount; incidence is (n_causes, n_others)."""
        values, slopes = (np.tensordot(incidence, table, 1) for table in (self.values, self.slopes))
        return Curves(np.array([cause.bound for cause in causes]), values, slopes)

    def beside(self, other: Curves) -> Curves:
        """These causes, and those of others after them."""
        return Curves(*(np.concatenate([a, b]) for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))

    def rotated(self, rotation: Array) -> Curves:
        """The same in other coordinates."""
        return Curves(self.bounds, self.values @ rotation, self.slopes @ rotation)

    def at(self, sets: NDArray[np.intp], amounts: Array) -> tuple[Array, Array, Array]:
        """Effects of sets (n_sets, k) at the steps next to amounts (n_sets, n_errors, k), added over their causes.

        The amounts there, the change (n_sets, n_errors, n_observed), and its slopes with an axis more.
        """
        columns = sets[:, np.newaxis]
        places = np.rint(amounts / self.bounds[columns] * N_STEPS).astype(int)
        change = self.values[columns, places].sum(axis=2)
        return places * self.bounds[columns] / N_STEPS, change, np.moveaxis(self.slopes[columns, places], 2, 3)
