"""Tables and warnings about the result of an updating."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from skthermo._core.arrays import Array
from skthermo.exceptions import ModelWarning, RecordsWarning, ResultWarning, SkthermoWarning
from skthermo.fem import FEModel, mac
from skthermo.updating._residuals import Measured, Outcome, Residuals, macs, paired_modes

LOW_MAC = 0.5  # MAC below which a measured shape is not that of the mode it is paired with


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
        near = (number for number, known in enumerate(optima) if np.abs(theta - known).max() < 1e-3)
        table.loc[i, "optimum"] = number = next(near, len(optima))
        if number == len(optima):
            optima.append(theta)
    return table.astype({"optimum": int})


def unfinished(outcome: Outcome, residuals: Residuals) -> ModelWarning:
    """The warning about a best start that has not converged."""
    failed = ", and met theta without modes" if outcome.n_failed else ""
    weights = residuals.measured.shape_weights[residuals.weighted]
    heavier = ", shape weights of 100 or more" if (weights < 100).any() else ""  # lighter ones make curved valleys
    return ModelWarning(
        f"the best start has not converged{failed}. theta_ may not be the optimum (starts_ lists evaluations). Raise "
        f"max_iter{heavier}, or narrow bounds to where the model has modes",
        "poor-fit",
    )


def false_matches(model: FEModel, measured: Measured, theta: Array) -> Iterator[RecordsWarning]:
    """Warnings about measured modes that are not the modes in the updated model's columns of the same number."""
    names = np.array(measured.names)
    if measured.dofs.size and hasattr(model, "local_modes"):
        modes = paired_modes(model, measured, theta)
        unlike = names[measured.has_shape & (macs(modes.shapes, measured.shapes) < LOW_MAC)]
        if unlike.size:
            yield RecordsWarning(
                f"no mode of the updated model has the measured shapes of {unlike.tolist()} (MAC below {LOW_MAC}). "
                "Check the order and signs of the sensors (dofs), or leave these shapes out",
                "doubtful-shapes",
            )
        columns = model.local_modes(theta, follow=True).ranks if model.track else np.arange(model.n_modes)
        other = names[modes.ranks != columns[measured.columns]]
        what = "have the shapes of other modes of the updated model than those in their columns"
    else:
        other = names[_swapped(model, theta)[measured.columns]]
        what = "change their order between the nominal model and the optimum, and are fitted to other modes"
    if other.size:
        yield RecordsWarning(
            f"modes {other.tolist()} {what}. Put the measured modes in the model's order, give shapes, or use "
            "track=True where modes change their order",
            "mode-order",
        )


def undetermined(names: Sequence[str], n_residuals: int, covariance: Array) -> list[ResultWarning]:
    """The finding, without a prior, that the measured modes do not determine some parameters."""
    deviations = np.sqrt(np.diagonal(covariance))
    hardly = ~(deviations < 1e4 * np.fmin.reduce(deviations))
    if len(names) > n_residuals:
        text = f"{len(names)} parameters are to be found from {n_residuals} residuals. Many theta fit equally well"
    elif hardly.any() and not hardly.all():
        listed = [names[i] for i in np.flatnonzero(hardly)]
        text = f"the parameters {listed} hardly move the measured modes, and are not determined"
    else:
        return []
    return [ResultWarning(f"{text}. Use fewer parameters, shapes, or a prior", "undetermined")]


def at_bounds(theta: Array, bounds: Array) -> NDArray[np.bool_]:
    """Which parameters are at their bounds, within 1e-4 of the box."""
    return np.abs(theta[:, np.newaxis] - bounds).min(axis=1) < 1e-4 * np.diff(bounds, axis=1)[:, 0]


def doubtful_optimum(
    names: Sequence[str], theta: Array, bounds: Array, measured: Measured, table: pd.DataFrame
) -> Iterator[ModelWarning]:
    """The warning about parameters at their bounds, and frequencies that noise cannot explain."""
    doubts = []
    at_bound = at_bounds(theta, bounds)
    if at_bound.any():
        listed = [names[i] for i in np.flatnonzero(at_bound)]
        doubts.append(
            f"the optimum lies at the bounds of {listed}. The best value may be outside. Widen bounds, or correct what "
            "the model lacks"
        )
    far = table["error_after"].abs() > 15
    beyond = np.abs(table["after"] - measured.frequencies) > 10 * measured.deviations  # only with frequency_std
    if far.any():
        off = (table["measured"] / table["after"] / (2 * np.pi) - 1).abs().dropna()
        units = " (rad/s instead of Hz?)" if len(off) and (off < 0.15).all() else ""
        doubts.append(
            f"the updated model misses the frequencies {table.index[far].tolist()} by more than 15 %{units}. Give "
            "frequencies in Hz, in the order of the model's modes, or correct the model"
        )
    elif beyond.any():
        doubts.append(
            f"the updated model misses the frequencies {table.index[beyond].tolist()} by more than 10 times "
            "frequency_std: covariance_ is too small. Give a larger frequency_std, or correct the model"
        )
    if doubts:
        yield ModelWarning(". ".join(doubts), "poor-fit")


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


def doubtful_draws(
    outcomes: Sequence[Outcome], names: Sequence[str], bounds: Array, residuals: Residuals
) -> Iterator[SkthermoWarning]:
    """Warnings about models that were drawn."""
    n = len(outcomes)
    if unconverged := sum(not outcome.success for outcome in outcomes):
        yield ModelWarning(
            f"the search has not converged for {unconverged} of {n} drawn models. They may be improbable. Raise "
            "max_iter, or narrow the bounds to where the model has modes",
            "poor-fit",
        )
    at_bound = np.sum([at_bounds(one.theta, bounds) for one in outcomes], axis=0)
    if (at_bound > 0.1 * n).any():  # 5 % are at a bound of two standard deviations
        listed = ", ".join(f"{name!r} ({count} of {n})" for name, count in zip(names, at_bound, strict=True) if count)
        yield ModelWarning(
            f"drawn models lie at the bounds of {listed}. They differ less than is unknown. Widen the bounds, or "
            "give a narrower prior",
            "poor-fit",
        )
    mismatched = sum(any(false_matches(residuals.model, residuals.measured, one.theta)) for one in outcomes)
    if mismatched:
        yield RecordsWarning(
            f"modes change their order in {mismatched} of {n} drawn models. A measured mode is fitted with another "
            "one there. Use a model with track=True, or give shapes",
            "mode-order",
        )
