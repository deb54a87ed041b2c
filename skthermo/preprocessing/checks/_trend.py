"""Trend and steps of residuals over time, with a standard error that holds under serial dependence."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._tables.arrays import Array, as_columns
from skthermo._tables.frames import column_names
from skthermo._tables.times import YEAR, correlation_time, has_stamps, row_times

Rows = NDArray[np.intp]
PARTS = 5  # into which the records are divided, to compare the first with the last
LEAST_RECORDS = 10
N_PLACES = 100  # at which a step is sought
SHARPER = 0.9  # ratio of what a step leaves to what a line leaves, below which the change is a step
ESTIMATES = ["change", "standard_error", "first", "last", "n_independent"]


def residual_trend(residuals: ArrayLike) -> pd.DataFrame:
    """Trend of residuals over time, by mode: an estimate and its standard error.

    Residuals of a healthy structure that its weather explains have none. A drift of a sensor, a structure that ages, or
    another season of the weather than the regression knows gives one.

    Parameters
    ----------
    residuals : array-like or DataFrame of shape (n_samples, n_modes)
        Measured minus predicted frequencies, best out of fold, as
        `~skthermo.detection.TemperatureCompensator.fit_transform` gives them; NaN is ignored. The index of a frame
        tells their times; without a ``DatetimeIndex``, rows are equally spaced.

    Returns
    -------
    DataFrame of shape (n_modes, 6)
        In the unit of the residuals, by mode: ``change``, by which a straight line changes from the first record to the
        last; its ``standard_error``; the same ``per_year`` (NaN without a ``DatetimeIndex``); ``first`` and ``last``,
        the means of the first and the last fifth of the period, beside the mean of all; and ``n_independent``, as how
        many independent records the residuals count. NaN for a mode with fewer than a dozen residuals.

    Notes
    -----
    The line is that of least squares. Its variance is that of independent records times the correlation time, 1 + 2 *
    the sum of the autocorrelations, of what remains beside the line.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.preprocessing import residual_trend
    >>> noise = np.random.default_rng(0).normal(0, 0.01, (1000, 1))
    >>> residual_trend(noise + np.linspace(0, 0.02, 1000)[:, np.newaxis])[["change", "standard_error"]].round(4)
        change  standard_error
    r1  0.0184          0.0011
    """
    values, times = as_columns(residuals), row_times(residuals)
    names = column_names(residuals, "r") if values.ndim == np.ndim(residuals) else ["r1"]
    order = np.argsort(times, kind="stable")
    return trend_table(np.ones((len(values), 1)), values[order], times[order], names, has_stamps(residuals))


def trend_table(inputs: Array, values: Array, times: Array, names: Sequence[Hashable], is_timed: bool) -> pd.DataFrame:
    """Trend of each column beside what inputs, (n_samples, n_inputs), explain of it; rows in order of time."""
    span = np.ptp(times) if len(times) else 0.0
    places = (times - times[:1]) / span if span > 0 else np.zeros(len(times))
    rows = [_trend(inputs, places, column) for column in values.T]
    table = pd.DataFrame(rows, index=list(names), columns=ESTIMATES)
    table.insert(2, "per_year", table["change"] * (YEAR.value / span if is_timed and span > 0 else np.nan))
    return table


def _trend(inputs: Array, places: Array, column: Array) -> list[float]:
    """Change from place 0 to 1, its standard error, means of the first and last part, and the effective number."""
    known = np.flatnonzero(~np.isnan(column) & ~np.isnan(inputs).any(axis=1))
    x, y, beside = places[known], column[known], inputs[known]
    if len(y) < LEAST_RECORDS + 2 * inputs.shape[1] or np.ptp(x) == 0:
        return [np.nan] * 5
    # Frisch-Waugh: the trend of what the inputs leave of values, over what they leave of time
    alone, rest = _beside(beside, np.column_stack([x, y])).T
    change = alone @ rest / (alone @ alone)
    scatter = rest - change * alone
    error, time = _standard_error(scatter, known, len(column), alone @ alone, inputs.shape[1])
    at = scatter + change * (x - x.mean())
    ends = [at[part].mean() if part.any() else np.nan for part in (x <= 1 / PARTS, x >= 1 - 1 / PARTS)]
    return [change, error, *ends, len(y) / time]


def _beside(inputs: Array, columns: Array) -> Array:
    """What inputs leave of columns."""
    return columns - inputs @ np.linalg.lstsq(inputs, columns, rcond=1e-8)[0]


def _standard_error(scatter: Array, known: Rows, n_rows: int, square: float, n_inputs: int) -> tuple[float, float]:
    """Of the coefficient of a regressor with this sum of squares, and the correlation time of what it leaves."""
    in_time = np.full(n_rows, np.nan)
    in_time[known] = scatter
    time = min(correlation_time(in_time), len(known) / 2)
    variance = np.sum(scatter**2) / max(len(known) - n_inputs - 2 * time, 1.0)
    return float(np.sqrt(variance * time / square)), time


class Step(NamedTuple):
    """Row from which a level is another one, the change and its standard error."""

    row: int
    change: float
    standard_error: float


def largest_step(inputs: Array, column: Array) -> Step | None:
    """The step that explains most of a column beside inputs; None where a straight line does nearly as well.

    Rows are in order of time. As for a trend, the standard error holds if what remains depends on what was before.
    """
    known = np.flatnonzero(~np.isnan(column) & ~np.isnan(inputs).any(axis=1))
    n_places = min(N_PLACES, len(known) // LEAST_RECORDS)
    if len(known) < LEAST_RECORDS + 2 * inputs.shape[1] or n_places < 2:
        return None
    at = np.arange(1, n_places) * len(known) // n_places
    order, beside = np.arange(len(known)), inputs[known]
    left = np.column_stack([order / len(known), order[:, np.newaxis] >= at, column[known]])
    left = _beside(beside, left)
    shapes, rest = left[:, :-1], left[:, -1]
    squares = np.maximum((shapes**2).sum(axis=0), 1e-12 * len(known))
    changes = shapes.T @ rest / squares
    remaining = rest @ rest - changes**2 * squares
    best = 1 + int(remaining[1:].argmin())
    if remaining[best] > SHARPER * remaining[0]:
        return None
    scatter = rest - changes[best] * shapes[:, best]
    error, _ = _standard_error(scatter, known, len(column), squares[best], inputs.shape[1])
    return Step(int(known[at[best - 1]]), float(changes[best]), error)
