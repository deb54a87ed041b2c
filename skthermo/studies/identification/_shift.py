"""Shift of measured frequencies from the healthy structure's in the same weather, and its error."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from skthermo._effects import healthy_frequencies
from skthermo._tables.arrays import Array, check_noise, means_of_known, median, robust_deviation
from skthermo._tables.frames import has_stamps, row_times
from skthermo.residuals.scatter import PSEUDO_RECORDS, Scatter

FEWEST_TO_COMPARE = 8  # records among which one may be called far from the others
OF_WEATHER = 0.05  # how much the effect of damage may differ from weather to weather, relative to it
FAR = 6.0  # standard deviations beyond which a record is far from the others
WIDER = 0.01  # p value below which new records count as scattering more widely than the training records


@dataclass(frozen=True)
class FrequencyShift:
    """Mean relative shift of each mode, and what it is based on; NaN for a mode that was not measured or is not known.

    It is the mean of ln(measured / predicted), less what the training records in similar weather show. Its errors have
    the given covariance, and Student's t law with the degrees of ``freedom``. ``n_records`` is the number of records
    of each mode, ``n_independent`` that of independent ones that would determine the mean as well, and ``wider`` how
    many times as widely they scatter as the training records, 1 unless clearly more. These are worth ``n_trained``
    independent ones.
    """

    mean: Array
    covariance: Array
    freedom: float
    n_records: NDArray[np.intp]
    n_independent: Array
    wider: Array
    n_trained: float
    modes: Sequence[Any]


def record_shifts(fem: Any, T: Any, theta: Array, F: Array) -> Array:
    """The shift of each record at temperatures T with parameters theta, (n_records, n_modes)."""
    residuals = fem.recorder_.residuals.expected(fem.weather(T).inputs)
    return np.log(F / (healthy_frequencies(fem, theta, warn=True) * (1 + residuals))) - fem.discrepancy_(T)


def outlying(shifts: Array, deviations: Array) -> NDArray[np.bool_]:
    """Records far from the others in a mode, in units of their scatter or of the known one where that is larger.

    None are if there are too few to tell, or if more than half of them would be.
    """
    if len(shifts) < FEWEST_TO_COMPARE or np.isnan(shifts).all():
        return np.zeros(len(shifts), dtype=bool)
    usual = median(shifts)
    away = np.abs(shifts - usual)
    scale = np.fmax(robust_deviation(shifts), np.hypot(deviations, OF_WEATHER * usual))
    rows = (np.nan_to_num(away) > FAR * scale).any(axis=1)
    return rows if rows.sum() < len(rows) / 2 else np.zeros(len(rows), dtype=bool)


def measured_shift(fem: Any, T: Any, shifts: Array, noise: ArrayLike | Literal["fitted"]) -> FrequencyShift:
    """The mean of shifts of records at temperatures T, and its covariance from the training records."""
    scatter = scatter_of(fem, noise)
    shifts = np.where(scatter.variances > 0, shifts, np.nan)
    order, places = _places(fem.records_.temperatures, T)
    n_records, mean = (~np.isnan(shifts)).sum(axis=0), means_of_known(shifts)
    new = scatter.of_sums(~np.isnan(shifts[order]) / np.maximum(n_records, 1), places)
    n_independent, variance_of_mean = scatter.n_independent(new), np.diag(new.sum(axis=0))
    within = np.maximum(scatter.variances - variance_of_mean, np.finfo(float).tiny)
    spread = np.sqrt(means_of_known((shifts - mean) ** 2) / within)
    inputs = fem.weather(T).inputs[(~np.isnan(shifts)).any(axis=1)]
    trained, measured, factor = fem.recorder_.residuals.prediction_weights(inputs), ~np.isnan(mean), 1.0
    wider = np.ones(len(mean))
    if isinstance(noise, str):
        limit = stats.f.isf(WIDER / len(mean), np.maximum(n_independent - 1, 1), np.maximum(scatter.numbers[1], 1))
        wider = np.where(spread**2 > limit, spread, 1.0)
        new = new * np.outer(wider, wider)
    parts = new + scatter.of_sums(trained, np.arange(len(trained)))
    freedom = scatter.freedom(parts)
    if isinstance(noise, str):  # Hotelling: the covariance is not known, either
        n_evaluated, of_correlations = measured.sum(), freedom + PSEUDO_RECORDS
        factor = of_correlations / max(of_correlations - n_evaluated + 1, 1.0)
        freedom = max(freedom - n_evaluated + 1, 1.0)
    covariance = np.where(np.outer(measured, measured), factor * parts.sum(axis=0), np.eye(len(mean)))
    return FrequencyShift(
        mean, covariance, freedom, n_records, n_independent, wider, scatter.n_trained, fem.mode_names_
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


def scatter_of(fem: Any, noise: ArrayLike | Literal["fitted"]) -> Any:
    """How records scatter: as in training, or as stated."""
    names, residuals = fem.mode_names_, fem.recorder_.residuals
    deviations = stated_deviations(noise, len(names), what="noise", mode_names=names)
    return residuals.scatter if deviations is None else Scatter.independent(deviations, len(residuals.values))


def _places(trained: Any, T: Any) -> tuple[NDArray[np.intp], Array]:
    """Order of rows in time, and their times in steps of the training records, or their numbers without stamps."""
    if not (has_stamps(trained) and has_stamps(T)):
        return np.arange(len(T)), np.arange(len(T), dtype=float)
    times, step = row_times(T), np.median(np.diff(np.unique(row_times(trained))))
    order = np.argsort(times, kind="stable")
    return order, times[order] / step
