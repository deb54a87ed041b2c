"""The model's modes paired with the measured ones, and the differences of their shapes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from skthermo._tables.arrays import Array, as_floats, central_differences
from skthermo.fem import FEModel, LocalModel
from skthermo.updating._measured import Measured

DIFFERENCE_STEP = 1e-3  # relative step of central differences for a model without ``jacobian``
NOMINAL_SHARE = 0.25
"""Weight of the MAC with the nominal modes beside the MAC with the measured shapes. It decides where sensors are so few
that several modes look the same at them."""


@dataclass
class PairedModes:
    """The model's modes at one theta, one for each measured mode and in their order."""

    frequencies: Array
    shapes: Array  # (n_dofs, n_measured) at the measured degrees of freedom
    ranks: NDArray[np.intp] | None  # among the model's modes; None where modes are paired column by column
    derivatives: Callable[[], tuple[Array, Array]]  # of frequencies and of shapes, by the parameters


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


def tangents(shapes: Array, measured: Array) -> Array:
    """Differences e = phi / (u' phi) - u between shapes phi and measured unit shapes u, (n_dofs, n_modes).

    Whatever the scale and sign of phi, e is orthogonal to u, and its length is the tangent of the angle between them:
    its square is 1 / MAC - 1.
    """
    return shapes / np.einsum("dm,dm->m", measured, shapes) - measured


def tangent_derivatives(shapes: Array, d_shapes: Array, measured: Array) -> Array:
    """Derivatives of `tangents`, from derivatives of the shapes (n_dofs, n_modes, n_parameters)."""
    along = np.einsum("dm,dm->m", measured, shapes)[:, np.newaxis]
    d_along = np.einsum("dm,dmp->mp", measured, d_shapes)
    return d_shapes / along - shapes[:, :, np.newaxis] * (d_along / along**2)


def _by_column(model: FEModel, measured: Measured, row: Array) -> PairedModes:
    def frequencies_at(rows: Array) -> Array:
        return as_floats(model.frequencies(rows))  # not `evaluate`, which warns of every theta without modes

    def derivatives() -> tuple[Array, Array]:
        exact = getattr(model, "jacobian", None)
        slopes = exact(row) if exact else central_differences(frequencies_at, row, frequencies, DIFFERENCE_STEP)
        return slopes[0, measured.columns], np.empty((0, len(measured.columns), row.shape[1]))

    frequencies = frequencies_at(row)
    return PairedModes(frequencies[0, measured.columns], np.empty((0, len(measured.columns))), None, derivatives)


def _by_shape(model: LocalModel, measured: Measured, theta: Array) -> PairedModes:
    modes = model.local_modes(theta)
    shapes = modes.shapes(measured.dofs)
    mac_sums = NOMINAL_SHARE * modes.nominal_mac[measured.columns]
    with_shape = measured.has_shape
    mac_sums[with_shape] += mac_table(shapes, measured.shapes[:, with_shape])
    ranks = linear_sum_assignment(np.nan_to_num(mac_sums), maximize=True)[1]
    wanted_dofs = measured.dofs if measured.shape_weights.any() else measured.dofs[:0]
    return PairedModes(modes.frequencies[ranks], shapes[:, ranks], ranks, lambda: modes.derivatives(ranks, wanted_dofs))
