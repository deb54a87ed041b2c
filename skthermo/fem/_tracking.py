"""Which mode is which: modal assurance criterion, pairing, order."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

if TYPE_CHECKING:
    from skthermo.fem._protocol import ModalModel

SAME_MODE = 0.5
"""MAC above which no other mode can be more like the reference, since shapes are orthogonal."""

ROWS_AT_ONCE = 64
"""Samples whose shapes, at all degrees of freedom, are held at once."""

REPEATED = 1e-6
"""Relative distance of eigenvalues below which rounding decides which shapes they have."""


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

    Raises
    ------
    ValueError
        If the numbers of degrees of freedom differ, or a shape is zero throughout.

    References
    ----------
    Allemang & Brown, A correlation coefficient for modal vector analysis, Proc. 1st IMAC, 1982.

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


def pair_modes(likeness: NDArray[np.float64], together: NDArray[np.bool_] | None = None) -> NDArray[np.intp]:
    """Assign to every reference mode the candidate that keeps the summed likeness highest.

    Parameters
    ----------
    likeness : ndarray of shape (n_samples, n_modes, n_candidates)
        MAC of reference modes and candidates.
    together : ndarray of bool of shape (n_modes, n_modes), optional
        Which reference modes share a repeated frequency. Their shapes are an arbitrary basis, so that a
        candidate is compared with the space they span, and those assigned go in ascending order.

    Returns
    -------
    ndarray of shape (n_samples, n_modes)
        Candidate of each reference mode; no candidate serves twice.
    """
    spans = np.nan_to_num(likeness if together is None else together @ likeness)
    best = spans.argmax(axis=2)
    clear = np.take_along_axis(spans, best[:, :, np.newaxis], axis=2).min(axis=(1, 2)) > SAME_MODE
    distinct = (np.diff(np.sort(best, axis=1), axis=1) > 0).all(axis=1)
    for sample in np.flatnonzero(~(clear & distinct)):
        best[sample] = linear_sum_assignment(spans[sample], maximize=True)[1]
    for cluster in () if together is None else np.unique(together, axis=0):
        best[:, cluster] = np.sort(best[:, cluster], axis=1)
    return best


def may_be_missed(
    likeness: NDArray[np.float64], order: NDArray[np.intp], together: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Samples in which a mode that is no candidate could be more like a reference than the one assigned.

    Orthogonal candidates share at most a likeness of 1, and what they leave of it is all others can have.
    """
    spans = together @ likeness
    assigned = np.take_along_axis(spans, order[:, :, np.newaxis], axis=2)[:, :, 0]
    left = together.sum(axis=1) - spans.sum(axis=2)
    return (assigned < left).any(axis=1)


def repeated(eigenvalues: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which of some ascending eigenvalues are the same but for rounding, (n_modes, n_modes)."""
    cluster = np.cumsum(np.diff(eigenvalues, prepend=0) > REPEATED * eigenvalues)
    return cluster[:, np.newaxis] == cluster


def share_reordered(model: "ModalModel", theta: NDArray[np.float64]) -> float:
    """Share of the rows of theta at which some column is not its nominal mode any more."""
    pieces = range(ROWS_AT_ONCE, len(theta), ROWS_AT_ONCE)
    return float(np.concatenate([_reordered(model, rows) for rows in np.split(theta, pieces)]).mean())


def _reordered(model: "ModalModel", theta: NDArray[np.float64]) -> NDArray[np.bool_]:
    shapes = model.modes(theta)[1]
    if hasattr(model, "likeness"):
        likeness = model.likeness(shapes)
    else:
        nominal = model.modes(np.ones((1, theta.shape[1])))[1][0]
        likeness = np.stack([mac(nominal, phi) for phi in shapes])
    swapped = pair_modes(likeness) != np.arange(likeness.shape[1])
    replaced = np.diagonal(likeness, axis1=1, axis2=2) < SAME_MODE
    return (swapped | replaced).any(axis=1)


def _columns(phi: ArrayLike, name: str) -> NDArray:
    array = np.asarray(phi)
    array = array[:, np.newaxis] if array.ndim == 1 else array
    if array.ndim != 2:
        raise ValueError(f"{name} has shape {array.shape}; expected (n_dof, n_modes)")
    empty = np.flatnonzero(~array.any(axis=0))
    if empty.size:
        raise ValueError(f"{name}: shape {empty[0]} is zero at every degree of freedom")
    return array


def _squared_norms(phi: NDArray) -> NDArray[np.float64]:
    return np.einsum("im,im->m", phi.conj(), phi).real
