"""The shift of some records, ready to be explained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._arguments import seem_rad_per_s
from skthermo._arrays import Array, as_floats
from skthermo._frames import check_same_rows
from skthermo._times import has_stamps, row_times
from skthermo._validation import check_array
from skthermo._warnings import warn_user, warnings_once
from skthermo.studies.identification.measured._compared import ComparedRecords, left_out_rows
from skthermo.studies.identification.measured._shift import Shift, measured_shift, outlying, record_shifts, scatter_of

NEAR_2_PI = 0.25  # relative distance from 2 pi up to which ratios of frequencies suggest rad/s
POSSIBLE_RATIOS = 0.2, 3.0  # of measured to predicted frequencies; damage of 95 % everywhere gives 0.22

FAR_FROM_OTHERS = "far from the other records"


@dataclass(frozen=True)
class Observation:
    """Records that were compared: their shift, temperatures, parameters theta, and frequencies; NaN where left out."""

    shift: Shift
    records: ComparedRecords
    temperatures: Any
    theta: Array
    frequencies: Array


def observe(fem: Any, T: ArrayLike, F: ArrayLike, noise: ArrayLike | Literal["fitted"]) -> Observation:
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
    records = ComparedRecords.of(left_out, shift, len(fem.residuals_.values), latest(T, outliers))
    return Observation(shift, records, T, theta, frequencies)


def _check_ratios(ratios: Array, names: Sequence[Any]) -> None:
    """Raise an error where no change of a structure gives these ratios of measured to predicted frequencies."""
    lowest, highest = POSSIBLE_RATIOS
    wrong = np.flatnonzero((ratios < lowest) | (ratios > highest))
    if len(wrong):
        units = " (rad/s instead of Hz?)" if seem_rad_per_s(ratios, NEAR_2_PI) else ""
        raise ValueError(
            f"{len(wrong)} of {len(ratios)} modes are less than {lowest} times or more than {highest:.0f} times those "
            f"that are predicted, {names[wrong[0]]} {ratios[wrong[0]]:.3g} times{units}; expected Hz, and modes in the "
            "order of fit"
        )


def latest(T: Any, rows: NDArray[np.bool_]) -> int:
    """Number of rows in a row at the end of the records, in their order in time."""
    order = np.argsort(row_times(T), kind="stable") if has_stamps(T) else np.arange(len(rows))
    others = np.flatnonzero(~rows[order])
    return len(rows) - 1 - int(others[-1]) if len(others) else len(rows)


def _read_frequencies(fem: Any, T: ArrayLike, F: ArrayLike) -> Array:
    """The frequencies as an array, after checks."""
    check_same_rows(T, F, ("temperatures", "frequencies"))
    names = getattr(F, "columns", None)
    if names is not None and list(names) != fem.mode_names_:
        raise ValueError(f"the frequencies have the columns {list(names)}; expected {fem.mode_names_}, as in fit")
    frequencies = as_floats(check_array(F, dtype=np.float64, ensure_all_finite="allow-nan"))
    if frequencies.shape[1] != len(fem.mode_names_):
        raise ValueError(
            f"frequencies have shape {frequencies.shape}; expected {len(fem.mode_names_)} modes, as in fit"
        )
    if (frequencies <= 0).any():
        row = np.flatnonzero((frequencies <= 0).any(axis=1))[0]
        raise ValueError(f"row {row} of the frequencies has a value of 0 or less; expected Hz, and NaN where missing")
    return frequencies


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
            f"the temperatures have the feature names {columns}, but the chain was fitted without feature names; the "
            "columns are taken in the order that they have",
            "names of temperatures",
        )
        return T.set_axis(range(len(columns)), axis=1)
    warn_user(
        f"the temperatures have no valid feature names; their columns are taken for {list(names)}, as in fit",
        "names of temperatures",
    )
    return T.set_axis(names, axis=1) if columns else pd.DataFrame(as_floats(T), columns=names)
