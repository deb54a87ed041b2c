"""What measurements can tell about parameters."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

NO_INFORMATION = 1e-12
"""Share of the largest (scaled) eigenvalue below which an information matrix tells nothing."""


def cramer_rao(information: ArrayLike) -> Array:
    """Smallest covariance of unbiased estimates: the inverse of a Fisher information matrix.

    Parameters
    ----------
    information : array-like of shape (n_parameters, n_parameters)
        Symmetric, perhaps singular.

    Returns
    -------
    ndarray of shape (n_parameters, n_parameters)
        Infinite variances and NaN covariances of parameters that cannot be told; all NaN where information is.

    Examples
    --------
    >>> from skthermo.updating import cramer_rao
    >>> cramer_rao([[4.0, 0.0], [0.0, 0.0]])
    array([[0.25,  nan],
           [ nan,  inf]])
    """
    information = np.asarray(information, dtype=float)
    if not np.isfinite(information).all():
        return np.full_like(information, np.nan)
    scale = np.sqrt(np.diagonal(information))
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    known = values > NO_INFORMATION * max(values[-1], np.finfo(float).tiny)
    covariance = (vectors[:, known] / values[known]) @ vectors[:, known].T / np.outer(scale, scale)
    unknown = (vectors[:, ~known] ** 2).sum(axis=1) > np.sqrt(NO_INFORMATION)
    covariance[unknown] = covariance[:, unknown] = np.nan
    covariance[unknown, unknown] = np.inf
    return covariance


def shape_directions(shapes: Array) -> Array:
    """Shapes (n_dofs, n_modes) of unit length at these degrees of freedom."""
    return shapes / np.linalg.norm(shapes, axis=0)


def tangents(shapes: Array, measured: Array) -> Array:
    """How far shapes lie from measured unit shapes, tan of their angle, as vectors (n_dofs, n_modes).

    e = phi / (u' phi) - u is orthogonal to the unit shape u, and its squared length is 1 / MAC - 1, whatever
    the scale and sign of phi.
    """
    return shapes / np.einsum("dm,dm->m", measured, shapes) - measured


def tangent_derivatives(shapes: Array, d_shapes: Array, measured: Array) -> Array:
    """Derivatives of `tangents` where those of the shapes are (n_dofs, n_modes, n_parameters)."""
    along = np.einsum("dm,dm->m", measured, shapes)[:, np.newaxis]
    d_along = np.einsum("dm,dmp->mp", measured, d_shapes)
    return d_shapes / along - shapes[:, :, np.newaxis] * (d_along / along**2)
