"""Structures that can move without straining anything."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def check_supported(stiffness: NDArray[np.float64], names: Sequence[str]) -> None:
    """Refuse a stiffness matrix that leaves a motion free.

    Parameters
    ----------
    stiffness : ndarray of shape (n_dof, n_dof)
        Nominal stiffness.
    names : sequence of str
        What each degree of freedom is called in the error.

    Raises
    ------
    ValueError
        If the matrix is not positive definite; the error names the free motion's largest parts.
    """
    diagonal = stiffness.diagonal()
    if (diagonal <= 0).any():
        _refuse([name for name, stiff in zip(names, diagonal, strict=True) if stiff <= 0])
    scale = 1 / np.sqrt(diagonal)
    eigenvalues, vectors = np.linalg.eigh(scale[:, np.newaxis] * stiffness * scale)
    if eigenvalues[0] <= 50 * np.finfo(float).eps * eigenvalues[-1]:
        motion = np.abs(scale * vectors[:, 0])
        largest = np.argsort(-motion, kind="stable")
        _refuse([names[i] for i in largest if motion[i] > 0.5 * motion[largest[0]]])


def _refuse(free: list[str]) -> None:
    listed = ", ".join(free[:6]) + (f" and {len(free) - 6} more" if len(free) > 6 else "")
    raise ValueError(
        f"the structure is a mechanism: {listed} can move without straining anything; "
        "expected supports, springs or members that hold every motion (a positive definite stiffness)"
    )
