"""The model's modes paired with the measured ones."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from skthermo._arrays import Array, as_floats
from skthermo.fem import FEModel, LocalModel
from skthermo.updating._measured import Measured
from skthermo.updating._sensitivity import central_jacobian

DIFFERENCE_STEP = 1e-3
"""Relative step of central differences for a model without ``jacobian``."""

NOMINAL_SHARE = 0.25
"""Weight of the MAC with the nominal modes beside the MAC with the measured shapes. It decides where sensors are so few
that several modes look the same at them."""


@dataclass
class PairedModes:
    """The model's modes at one theta, one for each measured mode and in their order.

    Attributes
    ----------
    frequencies : ndarray of shape (n_measured,)
        In Hz.
    shapes : ndarray of shape (n_dofs, n_measured)
        At the measured degrees of freedom, of unit modal mass.
    ranks : ndarray of int of shape (n_measured,) or None
        Which of the model's modes they are, the lowest being 0. None where modes are paired column by column.
    derivatives : callable
        Returns the derivatives of frequencies (n_measured, n_parameters) and shapes (n_dofs, n_measured, n_parameters).
    """

    frequencies: Array
    shapes: Array
    ranks: NDArray[np.intp] | None
    derivatives: Callable[[], tuple[Array, Array]]


def paired_modes(model: FEModel, measured: Measured, theta: Array) -> PairedModes:
    """Pair modes by their shapes where shapes were measured, else column by column."""
    if measured.dofs.size and hasattr(model, "local_modes"):
        return _by_shape(model, measured, theta)
    return _by_column(model, measured, theta[np.newaxis])


def macs(shapes: Array, measured: Array) -> Array:
    """MAC of each shape with the measured unit shape in the same column, (n_measured,)."""
    return np.diagonal(mac_table(shapes, measured))


def mac_table(shapes: Array, measured: Array) -> Array:
    """MAC of measured unit shapes and all shapes, (n_measured, n_shapes); 0 for a shape that is zero at all sensors."""
    squares = (shapes**2).sum(axis=0)
    return (measured.T @ shapes) ** 2 / np.where(squares > 0, squares, np.inf)


def _by_column(model: FEModel, measured: Measured, row: Array) -> PairedModes:
    def frequencies_at(rows: Array) -> Array:
        return as_floats(model.frequencies(rows))  # not `evaluate`, which warns of every theta without modes

    def derivatives() -> tuple[Array, Array]:
        jacobian = getattr(model, "jacobian", None)
        gradient = jacobian(row)[0] if jacobian else central_jacobian(frequencies_at, row, DIFFERENCE_STEP)
        return gradient[measured.columns], np.empty((0, len(measured.columns), row.shape[1]))

    frequencies = frequencies_at(row)[0, measured.columns]
    return PairedModes(frequencies, np.empty((0, len(frequencies))), None, derivatives)


def _by_shape(model: LocalModel, measured: Measured, theta: Array) -> PairedModes:
    modes = model.local_modes(theta)
    shapes = modes.shapes(measured.dofs)
    mac_sums = NOMINAL_SHARE * modes.nominal_mac[measured.columns]
    with_shape = measured.has_shape
    mac_sums[with_shape] += mac_table(shapes, measured.shapes[:, with_shape])
    ranks = linear_sum_assignment(np.nan_to_num(mac_sums), maximize=True)[1]
    wanted_dofs = measured.dofs if measured.shape_weights.any() else measured.dofs[:0]
    return PairedModes(modes.frequencies[ranks], shapes[:, ranks], ranks, lambda: modes.derivatives(ranks, wanted_dofs))
