"""Measured shifts of frequencies from the healthy structure's in the same weather, and their errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from skthermo._core.arrays import Array, as_floats, check_noise, means_of_known, median, robust_deviation
from skthermo._core.estimators import check_array
from skthermo._core.text import counted, listed
from skthermo.exceptions import FewRecordsWarning, SkthermoWarning, UnevaluatedRowsWarning
from skthermo.preprocessing import set_aside
from skthermo.residuals.gaussian import Gaussian
from skthermo.residuals.numbers import independent_records


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
    deviations = stated_deviations(noise, len(fem.mode_names_), what="noise", mode_names=fem.mode_names_)
    frequencies = _checked(fem, T, F)
    residuals = fem.recorder_.residuals
    expected = residuals.expected(fem.weather(T).inputs)  # what the chain leaves in such weather
    shifts = np.log(frequencies / (as_floats(fem.predict(T)) * (1 + expected)))
    theta = as_floats(fem.predict_parameters(T))
    healthy = np.log1p(residuals.values)  # out of fold, in order of time
    healthy = np.where(np.abs(healthy - median(healthy)) > 6 * robust_deviation(healthy), np.nan, healthy)
    healthy[:, (~np.isnan(healthy)).sum(axis=0) < 20] = np.nan
    left_out = _left_out(fem, T, frequencies, shifts, np.nanstd(healthy, axis=0))
    rows = ~np.any(list(left_out.values()), axis=0)
    shifts = np.where(rows[:, np.newaxis] & ~np.isnan(healthy).all(axis=0), shifts, np.nan)
    _check_ratios(np.exp(means_of_known(shifts)), fem.mode_names_)
    n_records, n_healthy = ((~np.isnan(values)).sum(axis=0) for values in (shifts, healthy))
    factors = np.ones(len(n_healthy)) if deviations is not None else _records_for_one(healthy)
    n_independent, n_trained = (np.maximum(number / factors, 1.0) for number in (n_records, n_healthy))
    known = n_records > 0
    roots = np.sqrt(1 / n_independent + 1 / n_trained)[known]
    single = (
        np.diag(deviations[known] ** 2) if deviations is not None else Gaussian.fitted(healthy[:, known]).covariance
    )
    freedom = float(n_trained[known].mean() - 1)
    covariance = np.eye(len(known))
    covariance[np.ix_(known, known)] = single * np.outer(roots, roots)
    if deviations is None:  # Hotelling: the covariance of the modes is estimated, too
        remaining = max(freedom - known.sum() + 1, 3.0)
        covariance, freedom = covariance * max(freedom, 3.0) / remaining, remaining
    counts = {"given": len(rows), "compared": int(rows.sum())} | {
        reason: int(some.sum()) for reason, some in left_out.items() if some.any()
    }
    counts |= {"independent": n_independent[known].min(), "trained": len(healthy)}
    counts |= {"independent of trained": n_trained[known].min()}
    return FrequencyShift(
        means_of_known(shifts),
        covariance,
        freedom,
        n_records,
        np.where(known, n_independent, 0.0),
        theta[rows].mean(axis=0, keepdims=True),
        pd.Series(counts),
        _findings(counts, left_out),
    )


def stated_deviations(noise: Any, n_modes: int, *, what: str, **options: Any) -> Array | None:
    """Standard deviations above 0 as they are stated; None where they are fitted."""
    if isinstance(noise, str):
        if noise != "fitted":
            raise ValueError(f'{what} is {noise!r}; expected "fitted" or relative standard deviations')
        return None
    deviations = check_noise(noise, n_modes, what=what, **options)
    if (deviations == 0).any():
        raise ValueError(f"{what} is {noise!r}; expected standard deviations above 0, which errors are derived from")
    return deviations


def _records_for_one(residuals: Array) -> Array:
    """How many records in a row are worth one independent one, (n_modes,).

    From the variance of the means of a dozen parts or, if that gives more, from the correlation of neighbours.
    """
    number = (~np.isnan(residuals)).sum(axis=0)
    parts = number / [independent_records(column) for column in residuals.T]
    neighbours = [pd.Series(column).autocorr() if n > 2 else 0.0 for column, n in zip(residuals.T, number, strict=True)]
    neighbours = np.clip(np.nan_to_num(neighbours), 0, 0.98)
    return np.maximum(parts, (1 + neighbours) / (1 - neighbours))


def _left_out(fem: Any, T: Any, frequencies: Array, shifts: Array, deviations: Array) -> dict[str, Array]:
    """Rows that cannot be compared, by the first reason that holds; an error if none is left."""
    excess = as_floats(fem.extrapolation_distance(T))
    usual = median(shifts)
    scale = np.fmax(robust_deviation(shifts), np.hypot(deviations, 0.05 * usual))  # effects depend on the weather
    outlying = (np.nan_to_num(np.abs(shifts - usual)) > 6 * scale).any(axis=1)
    is_known = len(shifts) >= 8 and outlying.mean() < 0.5
    reasons = {
        "without a frequency": np.isnan(frequencies).all(axis=1),
        "without all temperatures and lagged ones": np.isnan(excess).any(axis=1) | np.isnan(shifts).all(axis=1),
        "in weather far outside that of the training records": (np.nan_to_num(excess) > 0.25).any(axis=1),
        "far from the other records": outlying & is_known,
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
        found.append(UnevaluatedRowsWarning(text, "not-compared"))
    if counts["independent"] < 3 or counts["independent of trained"] < 20:
        found.append(
            FewRecordsWarning(
                f"the records are worth {counts['independent']:.3g} independent ones (expected 3 or more), the "
                f"training records {counts['independent of trained']:.3g} (expected 20 or more). Probabilities and "
                "standard errors are rough. Take records over a longer time",
                "few-independent-records",
            )
        )
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
    names = getattr(F, "columns", None)
    if names is not None and list(names) != fem.mode_names_:
        raise ValueError(f"the frequencies have the columns {list(names)}; expected {fem.mode_names_}, as in fit")
    if frequencies.shape[1] != len(fem.mode_names_):
        raise ValueError(
            f"frequencies have shape {frequencies.shape}; expected {len(fem.mode_names_)} modes, as in fit"
        )
    kinds = {"no-rows", "missing-column", "constant"}
    return as_floats(set_aside(T, F, model=fem.model, exclude=kinds, needs_all=True, is_baseline=False).frequencies)
