"""Measured or computed mode shapes as rows of real numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from skthermo._tables.arrays import Array, real_array, shape_array, without_mask


def shape_components(shapes: ArrayLike, reference: ArrayLike) -> Array:
    """Real components of mode shapes, with the scale, sign and phase of the shapes taken out.

    Parameters
    ----------
    shapes : array-like of shape (n_samples, n_modes, n_sensors)
        Mode shapes, real or complex, of any scale, sign and phase. For the shapes (n_samples, n_dofs, n_modes) of an
        FE model, swap the last two axes.
    reference : array-like of shape (n_sensors, n_modes)
        Shapes that set the signs, such as the nominal ones of an FE model.

    Returns
    -------
    ndarray of shape (n_samples, n_modes * n_sensors)
        All components of the first mode, then those of the second, and so on. Each shape is turned by the phase that
        makes its scalar product with the reference real and positive, its imaginary part is left out, and it is scaled
        to a root mean square of 1. All components of a mode are NaN where one of them is missing, or where its shape is
        zero.

    Raises
    ------
    ValueError
        If the numbers of modes or sensors differ, or a reference is zero at all sensors.

    Examples
    --------
    >>> from skthermo.fem import shape_components
    >>> shape_components([[[2.0, 4.0]], [[-1j, -2j]], [[1.0, float("nan")]]], [[1.0], [1.0]]).round(3)
    array([[0.632, 1.265],
           [0.632, 1.265],
           [  nan,   nan]])
    """
    shapes = without_mask(shapes)
    measured, expected = shape_array(shapes, "shapes"), real_array(reference, "reference")
    if measured.ndim != 3 or measured.shape[:0:-1] != expected.shape:
        raise ValueError(
            f"shapes are {measured.shape} and reference {expected.shape}; expected (n_samples, n_modes, n_sensors) and "
            "(n_sensors, n_modes)"
        )
    if np.isinf(measured).any() or np.isinf(expected).any():
        raise ValueError("shapes or reference hold infinite values; expected finite ones, or NaN")
    if not expected.any(axis=0).all():
        mode = np.flatnonzero(~expected.any(axis=0))[0]
        raise ValueError(f"reference is zero at all sensors in mode {mode}; expected a mode that moves them")
    along = np.einsum("smd,dm->sm", measured, expected)
    length = np.abs(along)
    turns = np.where(length > 0, along.conj() / np.where(length > 0, length, 1.0), 1.0)
    real = (measured * turns[:, :, np.newaxis]).real
    size = np.sqrt((real**2).mean(axis=2, keepdims=True))
    return (real / np.where(size > 0, size, np.nan)).reshape(len(real), -1)
