"""Measured changes: mean shifts of frequencies from the healthy structure's in the same weather, and of mode shapes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag

from skthermo._core.arrays import Array, as_floats, check_dofs, check_noise, means_of_known, median, robust_deviation
from skthermo._core.estimators import check_array
from skthermo._core.text import counted, listed
from skthermo.exceptions import FewRecordsWarning, RecordsWarning, SkthermoWarning, UnevaluatedRowsWarning
from skthermo.fem.damage import LossKind
from skthermo.preprocessing.checks import set_aside
from skthermo.residuals.mean_errors import MeanErrors
from skthermo.studies._causes import Cause, changed


@dataclass(frozen=True)
class FrequencyShift:
    """Mean of ln(measured / expected) of each mode, NaN where it is not known, and its covariance.

    Errors follow Student's law with some degrees of ``freedom``. ``n_records`` and ``n_independent`` are numbers of
    records by mode, ``theta`` (1, n_parameters) the mean parameters of the records. ``counts`` says how many records
    were given and compared, how many were left out for which reason, and how many independent ones they are worth.
    """

    mean: Array
    covariance: Array
    freedom: float
    n_records: Array
    n_independent: Array
    theta: Array
    counts: pd.Series
    findings: list[SkthermoWarning]


def measured_shift(fem: Any, T: ArrayLike, F: ArrayLike, noise: Any) -> FrequencyShift:
    """The shift of records against what a chain expects in their weather."""
    deviations = _stated(noise, len(fem.mode_names_), what="noise", mode_names=fem.mode_names_)
    frequencies = _checked(fem, T, F)
    expected = fem.recorder_.residuals.expected(fem.weather(T).inputs)  # what the chain leaves in such weather
    shifts = np.log(frequencies / (as_floats(fem.predict(T)) * (1 + expected)))
    healthy = np.log1p(fem.recorder_.residuals_of_long_blocks.values)  # in order of time
    errors = MeanErrors.learned(healthy)
    left_out = _left_out(fem, T, frequencies, shifts, errors.deviations)
    rows = ~np.any(list(left_out.values()), axis=0)
    shifts = np.where(rows[:, np.newaxis] & errors.known, shifts, np.nan)
    mean = means_of_known(shifts)
    _check_ratios(np.exp(mean), fem.mode_names_)

    if deviations is not None:
        errors = errors.stated(deviations)
    n_records = (~np.isnan(shifts)).sum(axis=0)
    known = n_records > 0
    n_independent = np.maximum(n_records / errors.for_one, 1.0)
    covariance, freedom = errors.of_mean(n_records)
    counts = {"given": len(rows), "compared": int(rows.sum())}
    counts |= {reason: int(some.sum()) for reason, some in left_out.items() if some.any()}
    counts |= {"independent": n_independent[known].min(), "trained": len(healthy)}
    counts |= {"independent of trained": errors.n_trained[known].min()}
    numbers = n_records, np.where(known, n_independent, 0.0)
    theta = as_floats(fem.predict_parameters(T))[rows].mean(axis=0, keepdims=True)
    return FrequencyShift(mean, covariance, freedom, *numbers, theta, pd.Series(counts), _findings(counts, left_out))


def _stated(noise: Any, n_modes: int, *, what: str, **options: Any) -> Array | None:
    """Standard deviations above 0 as they are stated; None where they are fitted."""
    if isinstance(noise, str):
        if noise != "fitted":
            raise ValueError(f'{what} is {noise!r}; expected "fitted" or relative standard deviations')
        return None
    deviations = check_noise(noise, n_modes, what=what, **options)
    if (deviations == 0).any():
        raise ValueError(f"{what} is {noise!r}; expected standard deviations above 0, which errors are derived from")
    return deviations


def _left_out(fem: Any, T: Any, frequencies: Array, shifts: Array, deviations: Array) -> dict[str, Array]:
    """Rows that cannot be compared, by the first reason that holds; an error if none is left."""
    excess = as_floats(fem.extrapolation_distance(T))
    usual = median(shifts)
    scale = np.fmax(robust_deviation(shifts), np.hypot(deviations, 0.05 * usual))  # effects depend on the weather
    outlying = (np.nan_to_num(np.abs(shifts - usual)) > 6 * scale).any(axis=1)
    reasons = {
        "without a frequency": np.isnan(frequencies).all(axis=1),
        "without all temperatures and lagged ones": np.isnan(excess).any(axis=1) | np.isnan(shifts).all(axis=1),
        "in weather far outside that of the training records": (np.nan_to_num(excess) > 0.25).any(axis=1),
        "far from the other records": outlying & (len(shifts) >= 8 and outlying.mean() < 0.5),
    }
    taken = np.zeros(len(shifts), dtype=bool)
    for reason, rows in reasons.items():
        reasons[reason], taken = rows & ~taken, taken | rows
    if taken.all():
        raise ValueError(
            f"none of {counted(len(shifts), 'record')} can be compared with the healthy structure: "
            f"{_reasons(reasons)}; expected frequencies, and temperatures like those of the training records"
        )
    return reasons


def _reasons(left_out: dict[str, Array]) -> str:
    return listed([f"{rows.sum():,} {reason}" for reason, rows in left_out.items() if rows.any()])


def _findings(counts: dict[str, Any], left_out: dict[str, Array]) -> list[SkthermoWarning]:
    """What is doubtful about the records."""
    found: list[SkthermoWarning] = []
    if n_left := counts["given"] - counts["compared"]:
        text = f"{n_left:,} of {counted(counts['given'], 'record')} could not be compared: {_reasons(left_out)}"
        if left_out["far from the other records"][-3:].all():
            text += ". The last records are among them: the structure may have just changed. Identify these alone"
        found.append(UnevaluatedRowsWarning(text, "not-evaluated"))
    if counts["independent"] < 3 or counts["independent of trained"] < 20:
        text = (
            f"the records are worth {counts['independent']:.3g} independent ones (expected 3 or more), the training "
            f"records {counts['independent of trained']:.3g} (expected 20 or more). Probabilities and standard errors "
            "are rough. Take records over a longer time"
        )
        found.append(FewRecordsWarning(text, "few-records"))
    return found


def _check_ratios(ratios: Array, names: Any) -> None:
    """Raise an error where no change of a structure gives these ratios of measured to predicted frequencies."""
    wrong = np.flatnonzero((ratios < 0.2) | (ratios > 3))
    if len(wrong):
        raise ValueError(
            f"{len(wrong)} of {len(ratios)} modes are less than 0.2 times or more than 3 times those that are "
            f"predicted, {names[wrong[0]]} {ratios[wrong[0]]:.3g} times; expected Hz, and modes in the order of fit"
        )


def _checked(fem: Any, T: ArrayLike, F: ArrayLike) -> Array:
    """The frequencies as an array, with NaN for values that cannot be."""
    frequencies = as_floats(check_array(F, input_name="F", dtype=np.float64, allow_infinite=True))
    names = list(getattr(F, "columns", range(frequencies.shape[1])))
    if len(names) != len(fem.mode_names_) or (hasattr(F, "columns") and names != fem.mode_names_):
        raise ValueError(f"the frequencies have the columns {names}; expected {fem.mode_names_}, as in fit")
    kinds = {"few-records", "useless-column"}
    found, _ = set_aside(T, F, model=fem.model, exclude=kinds, needs_all=True, is_baseline=False)
    return as_floats(found.frequencies)


@dataclass(frozen=True)
class ObservedChange:
    """Measured changes of what is observed, (n_observed,), the covariance of their errors, and the model's response:
    changes by some amounts of causes."""

    change: Array
    covariance: Array
    response: Callable[[Sequence[Cause], Sequence[float]], Array]
    findings: list[SkthermoWarning]


def observed(
    fem: Any, model: Any, shift: FrequencyShift, kind: LossKind, shapes: Any, dofs: Any, shape_noise: Any
) -> ObservedChange:
    """Shifts of the measured frequencies, and of mode shapes if there are any; ``model`` may be a divided one."""
    known = ~np.isnan(shift.mean)
    model = getattr(model, "full", model)
    change, covariance, findings = shift.mean[known], shift.covariance[np.ix_(known, known)], []
    if shapes is not None:
        compared, moved, variances, findings = _shape_changes(
            model, shift.theta, shapes, dofs, shape_noise, fem.mode_names_
        )
        change, covariance = np.append(change, moved), block_diag(covariance, np.diag(variances))

    def state(causes: Sequence[Cause], amounts: Sequence[float]) -> Array:
        after, theta = changed(model, shift.theta, causes, amounts, kind)
        solved = [after.frequencies(theta)] if shapes is None else after.modes(theta)
        logs = np.log(as_floats(fem.aligner_.inverse_transform(solved[0])))[0, known]
        return logs if shapes is None else np.append(logs, compared(solved[1][0]))

    before = state([], [])
    return ObservedChange(change, covariance, lambda *causes: state(*causes) - before, findings)


def components_of(shapes: NDArray, reference: Array, known: NDArray[np.bool_]) -> Array:
    """Components of real or complex shapes (..., n_sensors, n_modes), mode after mode, (..., n_observed), beside a
    reference (n_sensors, n_modes), where both are ``known``.

    Scale, sign and phase of a shape mean nothing: each is turned to the reference and scaled to its length; what
    remains are its components along unit vectors at right angles to the reference. Independent errors of the sensors
    are independent errors of these components.
    """
    found = []
    for mode in np.flatnonzero(known.any(axis=0)):
        along, shape = reference[known[:, mode], mode], shapes[..., known[:, mode], mode]
        turned = np.real(shape * np.exp(-1j * np.angle(shape @ along))[..., np.newaxis])
        turned *= np.linalg.norm(along) / np.linalg.norm(turned, axis=-1, keepdims=True)
        found.append(turned @ np.linalg.svd(along[np.newaxis])[2][1:].T)
    return np.concatenate(found, axis=-1)


def similarity(shapes: NDArray, reference: Array) -> Array:
    """Mean MAC of records (n_records, n_sensors, n_modes) with a reference, (n_modes,); NaN without any."""
    filled, squares = np.nan_to_num(shapes), np.where(np.isnan(shapes), 0.0, reference**2)
    along = np.abs((filled.conj() * reference).sum(axis=1)) ** 2
    lengths = (np.abs(filled) ** 2).sum(axis=1) * squares.sum(axis=1)
    return means_of_known(np.divide(along, lengths, out=np.full(along.shape, np.nan), where=lengths > 0))


def _shape_changes(
    model: Any, theta: Array, shapes: Any, dofs: ArrayLike | None, noise: Any, names: Sequence[Any]
) -> tuple[Callable[[NDArray], Array], Array, Array, list[SkthermoWarning]]:
    """Components of a model's shapes, the measured change of these, and its variances."""
    if not hasattr(model, "modes"):
        raise ValueError(f"{model!r} has no method 'modes'; expected a model with one, to compare mode shapes")
    stated, whole = _stated(noise, len(names), what="shape_noise", most=1), model.modes(theta)[1][0]
    places = check_dofs(dofs, len(whole), getattr(model, "dofs", ()))
    reference = whole[places] / np.abs(whole[places]).max(axis=0)
    healthy, later = records = read_shapes(shapes, reference.shape)
    present = [(~np.isnan(one)).mean(axis=0) for one in records]  # at least in half of the records of its mode
    known = np.logical_and(*(share >= np.maximum(share.max(axis=0) / 2, 1e-9) for share in present))
    foreign = (similarity(healthy, reference) < 0.5) & known.any(axis=0)
    known = known & ~foreign & (known.sum(axis=0) > 1)
    if not known.any():
        raise ValueError("no mode has shapes that can be compared; expected two sensors or more with both states")
    modes = np.repeat(np.arange(len(names)), np.maximum(known.sum(axis=0) - 1, 0))  # of each component
    states = [pd.DataFrame(components_of(one, reference, known)) for one in (healthy, later)]
    number = np.array([one.count() for one in states])
    squares = sum(((one - one.mean()) ** 2).sum().to_numpy() for one in states)
    freedom = np.bincount(modes, number.sum(axis=0) - 2)
    if stated is None and (freedom[modes] < 3).any():
        text = f'shape_noise is "fitted" for {len(healthy)} and {len(later)} records of shapes'
        raise ValueError(f"{text}; expected several of one state, or a standard deviation, such as 0.01")
    scatter = (np.bincount(modes, squares) / np.maximum(freedom - 2, 1))[modes]
    variances = np.maximum(scatter, 0.0 if stated is None else stated[modes] ** 2) * (1 / number).sum(axis=0)
    findings: list[SkthermoWarning] = []
    if foreign.any():
        text = (
            f"measured healthy shapes of {foreign.sum()} of {len(foreign)} modes have a MAC below 0.5 with the "
            f"model's, {names[np.flatnonzero(foreign)[0]]} the first. They are left out. Give shapes of the same "
            "modes, with rows in the order of dofs"
        )
        findings.append(RecordsWarning(text, "doubtful-shapes"))
    change = (states[1].mean() - states[0].mean()).to_numpy()
    return lambda shapes: components_of(shapes[places], reference, known), change, variances, findings


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
