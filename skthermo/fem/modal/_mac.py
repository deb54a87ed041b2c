"""Modal assurance criterion."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._tables.arrays import shape_array


def mac(phi_a: ArrayLike, phi_b: ArrayLike) -> NDArray[np.float64]:
    """Modal assurance criterion of every pair of mode shapes.

    ``|phi_a^H phi_b|^2 / (phi_a^H phi_a * phi_b^H phi_b)``: 1 for the same shape whatever its
    scale, sign or phase, 0 for orthogonal ones.

    Parameters
    ----------
    phi_a : array-like of shape (n_dof, n_a) or (n_dof,)
        Mode shapes in columns, real or complex.
    phi_b : array-like of shape (n_dof, n_b) or (n_dof,)
        Mode shapes at the same degrees of freedom.

    Returns
    -------
    ndarray of shape (n_a, n_b)
        Between 0 and 1.

    Raises
    ------
    ValueError
        If the numbers of degrees of freedom differ, a shape is zero throughout, or a value is not a number.

    References
    ----------
    Allemang & Brown, A correlation coefficient for modal vector analysis, Proc. 1st IMAC, 1982 [AB82]_.

    Examples
    --------
    >>> mac([[1.0, 1.0], [2.0, -0.5]], [2.0, 4.0]).round(12)
    array([[1.],
           [0.]])
    """
    a, b = (_columns(phi, name) for phi, name in ((phi_a, "phi_a"), (phi_b, "phi_b")))
    if len(a) != len(b):
        raise ValueError(f"phi_a has {len(a)} degrees of freedom and phi_b {len(b)}; expected the same")
    cross = np.abs(a.conj().T @ b) ** 2
    return cross / np.outer(_squared_norms(a), _squared_norms(b))


def _columns(phi: ArrayLike, name: str) -> NDArray:
    array = shape_array(phi, name, any_size=True)
    array = array[:, np.newaxis] if array.ndim == 1 else array
    if array.ndim != 2:
        raise ValueError(f"{name} has shape {array.shape}; expected (n_dof, n_modes)")
    if np.isinf(array).any():
        raise ValueError(f"{name} holds infinite values; expected finite ones")
    empty = np.flatnonzero(~array.any(axis=0))
    if empty.size:
        raise ValueError(f"{name}: shape {empty[0]} is zero at every degree of freedom")
    return _scaled(array)


def _scaled(phi: NDArray) -> NDArray:
    """Shapes times powers of two, which change no digit, so that squares neither overflow nor vanish."""
    largest = np.maximum(abs(phi.real), abs(phi.imag)).max(axis=0)
    exponents = np.where(np.isfinite(largest), np.frexp(largest)[1], 0)
    half = exponents // 2
    return phi * np.ldexp(1.0, -half) * np.ldexp(1.0, half - exponents)


def _squared_norms(phi: NDArray) -> NDArray[np.float64]:
    return np.einsum("im,im->m", phi.conj(), phi).real
