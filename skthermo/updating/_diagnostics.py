"""Tables and warnings about the result of an updating."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from skthermo._core.arrays import Array
from skthermo.exceptions import ModelWarning
from skthermo.fem import FEModel, mac
from skthermo.updating._residuals import Measured, Outcome, Residuals, macs, paired_modes

LOW_MAC = 0.5  # MAC below which a measured shape is not that of the mode it is paired with
DISTANCE_AT_BOUND = 1e-4
"""Distance from a bound, as a share of the box, below which a parameter counts as being at the bound."""

LARGE_ERROR = 15.0  # error of a frequency of the updated model, in percent, above which a warning is given
RAD_PER_S = 0.15  # error of frequencies over 2 pi, below which rad/s may have been given in place of Hz
LARGE_DEVIATION = 1e4  # multiple of the smallest standard deviation above which a parameter is not determined
NOISE_LIMIT = 10.0  # error of a frequency, in standard deviations, that noise does not explain
SAME_OPTIMUM = 1e-3  # difference of multipliers below which two starts have ended at the same optimum
SMALL_WEIGHT = 100  # weight of shapes below which the objective may be a narrow curved valley, slow to search


def modes_table(model: FEModel, measured: Measured, theta: Array) -> pd.DataFrame:
    """Measured modes and the model's at the nominal parameters and at theta: Hz, errors in percent, MAC."""
    table = pd.DataFrame({"measured": measured.frequencies}, index=measured.names)
    thetas = {"before": np.ones_like(theta), "after": theta}
    states = {name: paired_modes(model, measured, row) for name, row in thetas.items()}
    for name, modes in states.items():
        table[name] = modes.frequencies
    for name, modes in states.items():
        table[f"error_{name}"] = 100 * (modes.frequencies / measured.frequencies - 1)
    if measured.dofs.size:
        for name, modes in states.items():
            table[f"mac_{name}"] = macs(modes.shapes, measured.shapes)
    return table


def starts_table(outcomes: list[Outcome]) -> pd.DataFrame:
    """One row for each start, with the number of its optimum: 0 is the best, starts that ended together share one."""
    table = pd.DataFrame(outcomes)
    optima: list[Array] = []
    for i in np.argsort(table["objective"], kind="stable"):
        theta = outcomes[i].theta
        near = (number for number, known in enumerate(optima) if np.abs(theta - known).max() < SAME_OPTIMUM)
        table.loc[i, "optimum"] = number = next(near, len(optima))
        if number == len(optima):
            optima.append(theta)
    return table.astype({"optimum": int})


def unfinished(outcome: Outcome, residuals: Residuals) -> ModelWarning:
    """The warning about a best start that has not converged."""
    failed = f", {outcome.n_failed} of them without modes" if outcome.n_failed else ""
    weights = residuals.measured.shape_weights[residuals.weighted]
    heavier = f", shape weights of {SMALL_WEIGHT} or more" if (weights < SMALL_WEIGHT).any() else ""
    return ModelWarning(
        f"the best start has not converged in {outcome.n_evaluations} evaluations{failed}. theta_ may not be the "
        f"optimum. Raise max_iter{heavier}, or narrow bounds to where the model has modes",
        "not-converged",
    )


def false_matches(model: FEModel, measured: Measured, theta: Array) -> Iterator[ModelWarning]:
    """Warnings about measured modes that are not the modes in the updated model's columns of the same number."""
    names = np.array(measured.names)
    if not (measured.dofs.size and hasattr(model, "local_modes")):
        swapped = names[_swapped(model, theta)[measured.columns]]
        if swapped.size:
            yield ModelWarning(
                f"modes {swapped.tolist()} change their order between the nominal model and the optimum. Frequencies "
                "of other modes are fitted to theirs. Use a model with track=True, or give shapes",
                "modes-cross",
            )
        return
    modes = paired_modes(model, measured, theta)
    unlike = names[measured.has_shape & (macs(modes.shapes, measured.shapes) < LOW_MAC)]
    if unlike.size:
        yield ModelWarning(
            f"no mode of the updated model has the measured shapes of {unlike.tolist()} (MAC below {LOW_MAC}). Check "
            "the order and signs of the sensors (dofs), or leave these shapes out",
            "foreign-shapes",
        )
    columns = model.local_modes(theta, follow=True).ranks if model.track else np.arange(model.n_modes)
    other = names[modes.ranks != columns[measured.columns]]
    if other.size:
        yield ModelWarning(
            f"modes {other.tolist()} have the shapes of other modes of the updated model than those in their columns. "
            "Put the measured modes in the model's order, or use track=True where modes change their order",
            "mode-order",
        )


def doubtful_parameters(
    names: Sequence[str], theta: Array, bounds: Array, covariance: Array | None
) -> Iterator[ModelWarning]:
    """Warnings about parameters at their bounds and, without a prior, those that the modes do not determine."""
    at_bound = at_bounds(theta, bounds)
    if at_bound.any():
        listed = ", ".join(f"{names[i]!r} ({theta[i]:.3g})" for i in np.flatnonzero(at_bound))
        yield ModelWarning(
            f"the optimum lies at the bounds of {listed}. The best value may be outside. Widen bounds, or correct what "
            "the model lacks",
            "at-bounds",
        )
    if covariance is not None:
        deviations = np.sqrt(np.diagonal(covariance))
        undetermined = ~(deviations < LARGE_DEVIATION * np.nanmin(deviations))
        if undetermined.any() and not undetermined.all():
            listed = [names[i] for i in np.flatnonzero(undetermined)]
            yield ModelWarning(
                f"the parameters {listed} hardly move the measured modes and are not determined. Leave them out, or "
                "give a prior",
                "undetermined-parameters",
            )


def at_bounds(theta: Array, bounds: Array) -> NDArray[np.bool_]:
    """Which parameters are at their bounds."""
    return np.abs(theta[:, np.newaxis] - bounds).min(axis=1) < DISTANCE_AT_BOUND * np.diff(bounds, axis=1)[:, 0]


def doubtful_frequencies(measured: Measured, table: pd.DataFrame) -> Iterator[ModelWarning]:
    """Warnings about frequencies of the updated model that noise cannot explain."""
    far = table["error_after"].abs() > LARGE_ERROR
    if far.any():
        off = (table["measured"] / table["after"] / (2 * np.pi) - 1).abs().dropna()
        units = " (rad/s instead of Hz?)" if len(off) and (off < RAD_PER_S).all() else ""
        yield ModelWarning(
            f"the updated model misses the frequencies {table.index[far].tolist()} by more than {LARGE_ERROR:g} "
            f"%{units}. Give frequencies in Hz, in the order of the model's modes, or correct the model",
            "poor-fit",
        )
    elif not np.array_equal(measured.deviations, measured.frequencies, equal_nan=True):
        residuals = np.abs(table["after"].to_numpy() - measured.frequencies) / measured.deviations
        if (beyond := residuals > NOISE_LIMIT).any():
            yield ModelWarning(
                f"the updated model misses the frequencies {table.index[beyond].tolist()} by up to "
                f"{np.nanmax(residuals):.0f} times frequency_std (expected at most {NOISE_LIMIT:g}): covariance_ is "
                "too small. Give a larger frequency_std, or correct the model",
                "poor-fit",
            )


def _swapped(model: Any, theta: Array) -> NDArray[np.bool_]:
    """Columns that hold another mode at theta than at the nominal parameters."""
    if getattr(model, "track", True):
        return np.zeros(model.n_modes, bool)
    if hasattr(model, "local_modes"):
        return np.asarray(model.local_modes(theta, follow=True).ranks != np.arange(model.n_modes))
    if not hasattr(model, "modes"):
        return np.zeros(model.n_modes, bool)
    nominal, now = (model.modes(row[np.newaxis])[1][0] for row in (np.ones_like(theta), theta))
    similar = mac(nominal, now)
    is_another = linear_sum_assignment(similar, maximize=True)[1] != np.arange(len(similar))
    return is_another | (np.diagonal(similar) < LOW_MAC)
