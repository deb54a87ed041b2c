"""The model's modes beside the measured ones."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from skthermo.fem import FEModel, LocalModel, evaluate
from skthermo.updating._measured import Measured
from skthermo.updating._sensitivity import central_jacobian

Array = NDArray[np.float64]

DIFFERENCE_STEP = 1e-3
"""Relative step of central differences where a model has no derivatives."""

NOMINAL_SHARE = 0.25
"""What likeness to the nominal modes counts beside the MAC: it decides where sensors cannot tell shapes apart."""


@dataclass
class Counterparts:
    """The model's modes at one theta that are compared with the measured ones, in their order.

    Attributes
    ----------
    frequencies : ndarray of shape (n_measured,)
        In Hz.
    shapes : ndarray of shape (n_dofs, n_measured)
        At the measured degrees of freedom.
    ranks : ndarray of int of shape (n_measured,) or None
        Which of the lowest modes they are, where shapes have told.
    derivatives : callable
        Gives those of frequencies (n_measured, n_parameters) and shapes (n_dofs, n_measured, n_parameters).
    """

    frequencies: Array
    shapes: Array
    ranks: NDArray[np.intp] | None
    derivatives: Callable[[], tuple[Array, Array]]


def counterparts(model: FEModel, measured: Measured, theta: Array) -> Counterparts:
    """Modes paired by their shapes where some were measured, else column by column."""
    if measured.dofs.size and hasattr(model, "local_modes"):
        return _by_shape(model, measured, theta)
    return _by_column(model, measured, theta[np.newaxis])


def macs(shapes: Array, measured: Array) -> Array:
    """MAC of measured unit shapes with as many shapes, one by one, (n_measured,)."""
    return np.diagonal(mac_table(shapes, measured))


def mac_table(shapes: Array, measured: Array) -> Array:
    """MAC of measured unit shapes and all shapes, (n_measured, n_shapes); zero for shapes that no sensor feels."""
    squares = (shapes**2).sum(axis=0)
    return (measured.T @ shapes) ** 2 / np.where(squares > 0, squares, np.inf)


def _by_column(model: FEModel, measured: Measured, row: Array) -> Counterparts:
    def derivatives() -> tuple[Array, Array]:
        jacobian = getattr(model, "jacobian", None)
        gradient = jacobian(row)[0] if jacobian else central_jacobian(model, row, DIFFERENCE_STEP)
        return gradient[measured.columns], np.empty((0, len(measured.columns), row.shape[1]))

    frequencies = evaluate(model, row)[0, measured.columns]
    return Counterparts(frequencies, np.empty((0, len(frequencies))), None, derivatives)


def _by_shape(model: LocalModel, measured: Measured, theta: Array) -> Counterparts:
    modes = model.local_modes(theta)
    shapes = modes.shapes(measured.dofs)
    alike = NOMINAL_SHARE * modes.nominal_mac[measured.columns]
    with_shape = measured.has_shape
    alike[with_shape] += mac_table(shapes, measured.shapes[:, with_shape])
    ranks = linear_sum_assignment(np.nan_to_num(alike), maximize=True)[1]
    felt = measured.dofs if measured.shape_weights.any() else measured.dofs[:0]
    return Counterparts(modes.frequencies[ranks], shapes[:, ranks], ranks, lambda: modes.derivatives(ranks, felt))
