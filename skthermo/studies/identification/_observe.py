"""The shift of some records, ready to be explained, and what the records are worth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._estimators.warnings import warn_user, warnings_once
from skthermo._tables.arrays import Array, as_floats
from skthermo._tables.frames import has_stamps, row_times
from skthermo._tables.text import capital, counted, listed, significant
from skthermo._validation import check_array
from skthermo.exceptions import (
    FewRecordsWarning,
    RecordsWarning,
    ResultWarning,
    SkthermoWarning,
    UnevaluatedRowsWarning,
)
from skthermo.preprocessing import set_aside
from skthermo.residuals.weather import FAR_OUTSIDE
from skthermo.studies.identification._shift import FrequencyShift, measured_shift, outlying, record_shifts, scatter_of

IN_A_ROW = 3  # number of last records, all far from those before, that is no chance
FEW, FEW_TRAINED = 3.0, 20.0
"""Numbers of independent records, new ones and those of the training, below which a warning is given."""

POSSIBLE_RATIOS = 0.2, 3.0  # of measured to predicted frequencies; damage of 95 % everywhere gives 0.22
FAR_FROM_OTHERS = "far from the other records"


@dataclass(frozen=True)
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
    excess = as_floats(fem.extrapolation_distance(T).drop(columns="from_fleet", errors="ignore"))
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
