"""Checks of degrees of freedom given by users."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def check_dofs(dofs: ArrayLike, n_dof: int) -> NDArray[np.intp]:
    """Different degrees of freedom of a model.

    Parameters
    ----------
    dofs : array-like of int of shape (n_dofs,)
        The first degree of freedom is 0.
    n_dof : int
        How many the model has.

    Returns
    -------
    ndarray of int of shape (n_dofs,)
        The same numbers.

    Raises
    ------
    ValueError
        If ``dofs`` is not a vector of integers, or a value is negative, not below ``n_dof``, or repeated.

    Examples
    --------
    >>> from skthermo.fem import check_dofs
    >>> check_dofs([0, 4, 7], 23)
    array([0, 4, 7])
    >>> check_dofs([0, 23], 23)
    Traceback (most recent call last):
    ...
    ValueError: dofs holds 23; expected 0 to 22, the model's degrees of freedom
    """
    try:
        array = np.asarray(dofs)
    except ValueError as error:  # rows of different length
        raise ValueError(f"dofs is {dofs!r:.200}; expected integers in one row") from error
    if array.ndim != 1 or not array.size or not np.issubdtype(array.dtype, np.integer):
        raise ValueError(f"dofs has shape {array.shape} and type {array.dtype}; expected integers in one row")
    outside = array[(array < 0) | (array >= n_dof)]
    if outside.size:
        raise ValueError(f"dofs holds {outside[0]}; expected 0 to {n_dof - 1}, the model's degrees of freedom")
    values, counts = np.unique(array, return_counts=True)
    if (counts > 1).any():
        raise ValueError(f"dofs holds {values[counts > 1][0]} more than once; expected each degree of freedom once")
    return array.astype(np.intp)
