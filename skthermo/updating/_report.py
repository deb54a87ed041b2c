"""Tables and warnings about the result of model updating."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo._frames import look_like_radians
from skthermo.fem import CallableModel, FEModel, ModalModel, share_reordered
from skthermo.updating._comparison import macs, paired_modes
from skthermo.updating._measured import Measured
from skthermo.updating._optimise import Outcome
from skthermo.updating._residuals import Residuals

UNLIKE = 0.5
"""MAC below which a measured shape is not that of the mode it is paired with."""

AT_BOUND = 1e-4
"""Distance from a bound, as a share of the box, at which a parameter counts as being there."""

LARGE_ERROR = 15.0
"""Percent by which an updated model misses a frequency that asks for an explanation."""

UNDETERMINED = 1e4
"""Times the smallest deviation of a parameter from which on another one is not determined."""

BEYOND_NOISE = 10.0
"""Standard deviations by which it misses a frequency that noise does not explain."""

SAME_OPTIMUM = 1e-3
"""Two starts whose multipliers differ by less have ended at the same optimum."""

GOOD_WEIGHT = 100
"""Weight of shapes below which the objective may be a narrow curved valley, slow to search."""


def modes_table(model: FEModel, measured: Measured, theta: Array) -> pd.DataFrame:
    """Measured modes and the model's at the nominal parameters and at theta: Hz, errors in percent, MAC."""
    table = pd.DataFrame({"measured": measured.frequencies}, index=measured.names)
    states = {
        "before": paired_modes(model, measured, np.ones_like(theta)),
        "after": paired_modes(model, measured, theta),
    }
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
    numbers = np.empty(len(outcomes), dtype=int)
    for i in np.argsort(table["objective"], kind="stable"):
        theta = outcomes[i].theta
        near = [number for number, known in enumerate(optima) if np.abs(theta - known).max() < SAME_OPTIMUM]
        if not near:
            near = [len(optima)]
            optima.append(theta)
        numbers[i] = near[0]
    return table.assign(optimum=numbers)


def rescaled(model: FEModel, theta: Array) -> FEModel:
    """A model whose nominal state is the given model at theta."""
    if hasattr(model, "rescaled"):
        return model.rescaled(theta)
    function = partial(_frequencies_from, model, theta)
    return CallableModel(function, model.parameter_names, model.n_modes, vectorized=True)


def _frequencies_from(model: FEModel, origin: Array, theta: Array) -> Array:
    return model.frequencies(origin * theta)


def unfinished(outcome: Outcome, residuals: Residuals) -> str:
    """The warning about a best start that has not converged."""
    failed = f", {outcome.n_failed} of them without modes" if outcome.n_failed else ""
    weights = residuals.measured.shape_weights[residuals.weighted]
    heavier = f", shape weights of {GOOD_WEIGHT} or more" if (weights < GOOD_WEIGHT).any() else ""
    return (
        f"the best start has not converged in {outcome.n_evaluations} evaluations{failed}, and theta_ may not be the "
        "optimum: "
        f"expected a higher max_iter{heavier}, or bounds within which the model has modes"
    )


def false_matches(model: FEModel, measured: Measured, theta: Array) -> Iterator[str]:
    """Warnings about measured modes that are not the modes in the updated model's columns of the same number."""
    names = np.array(measured.names)
    if not (measured.dofs.size and hasattr(model, "local_modes")):
        swapped = names[_swapped(model, theta)[measured.columns]]
        if swapped.size:
            yield (
                f"modes {swapped.tolist()} swap places between the nominal model and the optimum, and a sorted column "
                "fits another mode's frequency: expected a model with track=True, or shapes"
            )
        return
    modes = paired_modes(model, measured, theta)
    unlike = names[measured.has_shape & (macs(modes.shapes, measured.shapes) < UNLIKE)]
    if unlike.size:
        yield f"no mode of the optimum has the measured shapes of {unlike.tolist()} (MAC below {UNLIKE})"
    columns = model.local_modes(theta, follow=True).ranks if model.track else np.arange(model.n_modes)
    other = names[modes.ranks != columns[measured.columns]]
    if other.size:
        yield (
            f"modes {other.tolist()} are by their shapes other modes of the optimum than the columns of model_ with "
            "their numbers: expected measured modes in the model's order, or track=True where modes swap"
        )


def doubtful_fits(
    measured: Measured,
    table: pd.DataFrame,
    theta: Array,
    bounds: Array,
    covariance: Array | None,
    parameter_names: Sequence[str],
) -> Iterator[str]:
    """Warnings about parameters at their bounds and frequencies that noise cannot explain."""
    at_bound = np.abs(theta[:, np.newaxis] - bounds).min(axis=1) < AT_BOUND * np.diff(bounds, axis=1)[:, 0]
    if at_bound.any():
        listed = ", ".join(f"{name!r} ({theta[i]:.3g})" for i, name in enumerate(parameter_names) if at_bound[i])
        yield f"the optimum lies at the bounds of {listed}: expected wider bounds, or another model"
    if covariance is not None:
        deviations = np.sqrt(np.diagonal(covariance))
        undetermined = ~(deviations < UNDETERMINED * np.nanmin(deviations))
        if undetermined.any() and not undetermined.all():
            listed = [name for i, name in enumerate(parameter_names) if undetermined[i]]
            yield f"{listed} hardly move the measured modes and are not determined: leave them out, or give a prior"
    far = table["error_after"].abs() > LARGE_ERROR
    if far.any():
        ratios = table["measured"] / table["after"]
        units = " (rad/s instead of Hz?)" if look_like_radians(ratios, LARGE_ERROR / 100) else ""
        yield (
            f"the updated model misses {table.index[far].tolist()} by more than {LARGE_ERROR:g} %{units}: expected "
            "frequencies in Hz, in the order of the model's modes"
        )
    elif not np.array_equal(measured.deviations, measured.frequencies, equal_nan=True):
        residuals = np.abs(table["after"].to_numpy() - measured.frequencies) / measured.deviations
        if (beyond := residuals > BEYOND_NOISE).any():
            yield (
                f"the updated model misses {table.index[beyond].tolist()} by up to {np.nanmax(residuals):.0f} standard "
                "deviations of frequency_std: noise does not explain that, and covariance_ is too small"
            )


def _swapped(model: FEModel, theta: Array) -> NDArray[np.bool_]:
    """Columns that hold another mode at theta than at the nominal parameters."""
    if getattr(model, "track", True):
        return np.zeros(model.n_modes, bool)
    if hasattr(model, "local_modes"):
        return np.asarray(model.local_modes(theta, follow=True).ranks != np.arange(model.n_modes))
    has_shapes = hasattr(model, "modes")
    return np.full(model.n_modes, has_shapes and share_reordered(cast(ModalModel, model), theta[np.newaxis]) > 0)
