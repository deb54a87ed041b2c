"""The trend of residuals over time, with a standard error that allows for their correlation."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from skthermo._core.arrays import as_columns
from skthermo._core.estimators import check_array
from skthermo._core.frames import YEAR, column_names, correlation_time, has_stamps, row_times


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
    The line is fitted by least squares. Its variance is the variance for independent records times the correlation time
    of the rest beside the line, 1 + 2 * the sum of its autocorrelations.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.preprocessing import residual_trend
    >>> noise = np.random.default_rng(0).normal(0, 0.01, (1000, 1))
    >>> residual_trend(noise + np.linspace(0, 0.02, 1000)[:, np.newaxis])[["change", "standard_error"]].round(4)
        change  standard_error
    r1  0.0184          0.0011
    """
    values = as_columns(check_array(residuals, input_name="residuals", dtype=np.float64, ensure_2d=False))
    times = row_times(residuals)
    names = column_names(residuals, "r") if values.ndim == np.ndim(residuals) else ["r1"]
    order = np.argsort(times, kind="stable")
    span = np.ptp(times) if len(times) else 0.0
    places = (times[order] - times[order][:1]) / span if span > 0 else np.zeros(len(times))
    columns = ["change", "standard_error", "per_year", "first", "last", "n_independent"]
    table = pd.DataFrame(np.nan, list(names), columns)
    for row, column in enumerate(values[order].T):
        known = ~np.isnan(column)
        x, y = places[known], column[known]
        if len(y) < 12 or np.ptp(x) == 0:
            continue
        centred = x - x.mean()
        square = centred @ centred
        change = centred @ y / square
        scatter = y - y.mean() - change * centred
        time = min(
            correlation_time(np.where(known, column - y.mean() - change * (places - x.mean()), np.nan)), len(y) / 2
        )
        variance = scatter @ scatter / max(len(y) - 1 - 2 * time, 1.0)
        ends = [(y - y.mean())[part].mean() if part.any() else np.nan for part in (x <= 1 / 5, x >= 4 / 5)]
        per_year = change * YEAR.value / span if has_stamps(residuals) else np.nan
        table.iloc[row] = [change, np.sqrt(variance * time / square), per_year, *ends, len(y) / time]
    return table
