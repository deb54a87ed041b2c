"""How much measurements tell about parameters, and derivatives of mode shapes for it."""

import numpy as np
from numpy.typing import ArrayLike

from skthermo._arrays import Array, real_array

NO_INFORMATION = 1e-12
"""Eigenvalue of a scaled information matrix, as a share of the largest, below which it counts as zero."""


def cramer_rao(information: ArrayLike) -> Array:
    """Smallest covariance of unbiased estimates: the inverse of a Fisher information matrix.

    Parameters
    ----------
    information : array-like of shape (n_parameters, n_parameters)
        Symmetric, perhaps singular.

    Returns
    -------
    ndarray of shape (n_parameters, n_parameters)
        Parameters that are not determined have infinite variances and NaN covariances. All NaN if the
        information has NaN.

    Raises
    ------
    ValueError
        If the information is not a symmetric matrix of numbers, or has a negative diagonal.

    Examples
    --------
    >>> from skthermo.updating import cramer_rao
    >>> cramer_rao([[4.0, 0.0], [0.0, 0.0]])
    array([[0.25,  nan],
           [ nan,  inf]])
    """
    information = real_array(information, "information")
    if information.ndim != 2 or information.shape[0] != information.shape[1] or not information.size:
        raise ValueError(f"information has shape {information.shape}; expected (n_parameters, n_parameters)")
    if not np.isfinite(information).all():
        return np.full_like(information, np.nan)
    diagonal = np.diagonal(information)
    if (diagonal < 0).any() or not np.allclose(information, information.T, rtol=1e-6, atol=1e-6 * diagonal.max()):
        raise ValueError(
            f"information is {information.tolist()!s:.200}; expected a symmetric matrix, none of its diagonal negative"
        )
    scale = np.sqrt(diagonal)
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
