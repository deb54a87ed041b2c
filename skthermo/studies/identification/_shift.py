"""Measured shifts of frequencies from the healthy structure's in the same weather, and what the records are worth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from skthermo._core.arrays import Array, as_floats, check_noise, means_of_known, median, robust_deviation
from skthermo._core.estimators import check_array
from skthermo._core.frames import has_stamps, row_times
from skthermo._core.text import capital, counted, listed, significant
from skthermo._core.warnings import warn_user, warnings_once
from skthermo.exceptions import (
    FewRecordsWarning,
    RecordsWarning,
    ResultWarning,
    SkthermoWarning,
    UnevaluatedRowsWarning,
)
from skthermo.preprocessing import set_aside
from skthermo.residuals.baseline import PSEUDO_RECORDS, Scatter
from skthermo.residuals.weather import FAR_OUTSIDE
from skthermo.surrogate.effects import healthy_frequencies

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
    return np.log(F / (healthy_frequencies(fem, theta) * (1 + residuals))) - fem.discrepancy_(T)


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


IN_A_ROW = 3  # number of last records, all far from those before, that is no chance
FEW, FEW_TRAINED = 3.0, 20.0
"""Numbers of independent records, new ones and those of the training, below which a warning is given."""

POSSIBLE_RATIOS = 0.2, 3.0  # of measured to predicted frequencies; damage of 95 % everywhere gives 0.22
FAR_FROM_OTHERS = "far from the other records"


@dataclass(frozen=True, repr=False)
class ComparedRecords:
    """Records that were compared with the healthy structure, and what they are worth.

    Parameters
    ----------
    n_given : int
        Number of records.
    left_out : mapping of str to int
        How many of them could not be compared, by reason.
    n_independent : float
        As many independent records as would determine the mean shift as well as those that were compared, in the mode
        where they are worth least.
    n_trained, n_trained_independent : float
        The same for the training records.
    wider : mapping of str to float
        Modes that scatter clearly more widely than in the training records, and how many times; their standard errors
        allow for it.
    n_latest : int, default=0
        Number of the last records that were all left out because they are far from those before.
    """

    n_given: int
    left_out: Mapping[str, int]
    n_independent: float
    n_trained: int
    n_trained_independent: float
    wider: Mapping[str, float]
    n_latest: int = 0

    @classmethod
    def of(
        cls, left_out: Mapping[str, NDArray[np.bool_]], shift: FrequencyShift, n_trained: int, n_latest: int = 0
    ) -> ComparedRecords:
        """The records of a shift, and rows that were left out of it by reason."""
        counts = {reason: int(rows.sum()) for reason, rows in left_out.items() if rows.any()}
        n_given = max(len(rows) for rows in left_out.values())
        measured = shift.n_independent[shift.n_records > 0]
        wider = {str(mode): float(f) for mode, f in zip(shift.modes, shift.wider, strict=True) if f > 1}
        return cls(n_given, counts, float(measured.min(initial=n_given)), n_trained, shift.n_trained, wider, n_latest)

    @property
    def n_compared(self) -> int:
        """Number of records that were compared."""
        return self.n_given - sum(self.left_out.values())

    def sentences(self) -> Iterator[str]:
        """How many records were compared, what they are worth, and what was left out."""
        new = _worth("record", self.n_compared, self.n_independent)
        known = _worth("training record", self.n_trained, self.n_trained_independent)
        yield f"{new} compared with {known}."
        if self.left_out:
            yield f"{self._left_out()}."
        if self.n_latest >= IN_A_ROW:
            yield f"{capital(self._latest())}."
        for mode, factor in self.wider.items():
            yield (
                f"Mode {mode} scatters {significant(factor)} times as widely as in the training records; its standard "
                "error includes this."
            )

    def warnings(self) -> Iterator[SkthermoWarning]:
        """What is doubtful."""
        if self.left_out:
            yield UnevaluatedRowsWarning(self._left_out(), "not-compared")
        if self.n_latest >= IN_A_ROW:
            yield ResultWarning(self._latest(), "last-records-differ")
        few = [(self.n_independent, self.n_compared, "record", FEW)]
        few += [(self.n_trained_independent, self.n_trained, "training record", FEW_TRAINED)]
        for independent, number, noun, least in few:
            if independent < least:
                yield FewRecordsWarning(
                    f"too few independent {noun}s: {_worth(noun, number, independent)} (expected {least:g} or more). "
                    "Probabilities and standard errors are rough. Take records over a longer time",
                    "few-independent-records",
                )

    def __repr__(self) -> str:
        return "\n".join(self.sentences())

    def _latest(self) -> str:
        return (
            f"the last {counted(self.n_latest, 'record')} are all far from those before and were left out. The "
            "structure may have just changed. Identify the last ones on their own"
        )

    def _left_out(self) -> str:
        n_left = sum(self.left_out.values())
        reasons = [f"{number:,} {reason}" for reason, number in self.left_out.items()]
        return f"{n_left:,} of {counted(self.n_given, 'record')} could not be compared: {listed(reasons)}"


def _worth(noun: str, number: int, independent: float) -> str:
    """A number of records and, if that is less, how many independent ones they are worth."""
    if independent > 0.95 * number:
        return counted(number, noun)
    said = significant(independent) if independent < 10 else f"{independent:,.0f}"
    return f"{counted(number, noun)} (worth {said} independent {'one' if said == '1.0' else 'ones'})"


def left_out_rows(fem: Any, T: Any, theta: Array, F: Array) -> dict[str, NDArray[np.bool_]]:
    """Rows that cannot be compared, by reason, each with the first reason that holds."""
    excess = as_floats(fem.extrapolation_distance(T))
    reasons = {
        "without a frequency": np.isnan(F).all(axis=1),
        "without all temperatures and lagged ones": np.isnan(theta).any(axis=1),
        "in weather far outside that of the training records": (np.nan_to_num(excess) > FAR_OUTSIDE).any(axis=1),
    }
    taken = np.zeros(len(F), dtype=bool)
    for reason, rows in reasons.items():
        reasons[reason], taken = rows & ~taken, taken | rows
    if taken.all():
        counts = [f"{rows.sum():,} {reason}" for reason, rows in reasons.items() if rows.any()]
        raise ValueError(
            f"none of {counted(len(F), 'record')} can be compared with the healthy structure: {listed(counts)}; "
            "expected frequencies, and temperatures like those of the training records"
        )
    return reasons


@dataclass(frozen=True)
class ObservedRecords:
    """Records that were compared: their shift, temperatures, parameters theta, and frequencies; NaN where left out."""

    shift: FrequencyShift
    records: ComparedRecords
    temperatures: Any
    theta: Array
    frequencies: Array


def observe(fem: Any, T: ArrayLike, F: ArrayLike, noise: ArrayLike | Literal["fitted"]) -> ObservedRecords:
    """The shift of records against a chain, less those that cannot be compared."""
    frequencies, T = _read_frequencies(fem, T, F), _named_as_in_fit(fem, T)
    with warnings_once():
        theta = as_floats(fem.predict_parameters(T))
    left_out = left_out_rows(fem, T, theta, frequencies)
    is_compared = ~np.any(list(left_out.values()), axis=0)
    frequencies = np.where(is_compared[:, np.newaxis], frequencies, np.nan)
    with warnings_once():
        shifts = record_shifts(fem, T, theta, frequencies)
        outliers = outlying(shifts, np.sqrt(scatter_of(fem, noise).variances))
        left_out[FAR_FROM_OTHERS] = outliers
        frequencies, shifts = (np.where(outliers[:, np.newaxis], np.nan, array) for array in (frequencies, shifts))
        shift = measured_shift(fem, T, shifts, noise)
    _check_ratios(np.exp(shift.mean), fem.mode_names_)
    records = ComparedRecords.of(left_out, shift, len(fem.recorder_.residuals.values), latest(T, outliers))
    return ObservedRecords(shift, records, T, theta, frequencies)


def _check_ratios(ratios: Array, names: Sequence[Any]) -> None:
    """Raise an error where no change of a structure gives these ratios of measured to predicted frequencies."""
    lowest, highest = POSSIBLE_RATIOS
    wrong = np.flatnonzero((ratios < lowest) | (ratios > highest))
    if len(wrong):
        raise ValueError(
            f"{len(wrong)} of {len(ratios)} modes are less than {lowest} times or more than {highest:.0f} times those "
            f"that are predicted, {names[wrong[0]]} {ratios[wrong[0]]:.3g} times; expected Hz, and modes in the "
            "order of fit"
        )


def latest(T: Any, rows: NDArray[np.bool_]) -> int:
    """Number of rows in a row at the end of the records, in their order in time."""
    order = np.argsort(row_times(T), kind="stable") if has_stamps(T) else np.arange(len(rows))
    others = np.flatnonzero(~rows[order])
    return len(rows) - 1 - int(others[-1]) if len(others) else len(rows)


def _read_frequencies(fem: Any, T: ArrayLike, F: ArrayLike) -> Array:
    """The frequencies as an array, after checks."""
    frequencies = as_floats(check_array(F, input_name="F", dtype=np.float64, allow_infinite=True))
    names = getattr(F, "columns", None)
    if names is not None and list(names) != fem.mode_names_:
        raise ValueError(f"the frequencies have the columns {list(names)}; expected {fem.mode_names_}, as in fit")
    if frequencies.shape[1] != len(fem.mode_names_):
        raise ValueError(
            f"frequencies have shape {frequencies.shape}; expected {len(fem.mode_names_)} modes, as in fit"
        )
    found = set_aside(
        T, F, model=fem.model, exclude={"no-rows", "missing-column", "constant"}, needs_all=True, is_baseline=False
    )
    return as_floats(found.frequencies)


def _named_as_in_fit(fem: Any, T: Any) -> Any:
    """Temperatures with column names where the chain was fitted with names, without where it was not.

    One warning says what was assumed, in place of one from every part of the chain.
    """
    names, columns = getattr(fem, "feature_names_in_", None), list(getattr(T, "columns", ()))
    is_named = any(isinstance(name, str) for name in columns)
    if is_named == (names is not None) or np.shape(T)[1:] != (fem.n_features_in_,):
        return T
    if names is None:
        warn_user(
            f"the temperatures have the feature names {columns}, but the chain was fitted without feature names. The "
            "columns are used in the order that they have. Fit the chain with a frame",
            RecordsWarning,
            "temperature-names",
        )
        return T.set_axis(range(len(columns)), axis=1)
    warn_user(
        f"the temperatures have no valid feature names. Their columns are used as {list(names)}, in the order of fit. "
        "Give a frame with these columns",
        RecordsWarning,
        "temperature-names",
    )
    return T.set_axis(names, axis=1) if columns else pd.DataFrame(as_floats(T), columns=names)
