"""How often modes change their order."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._estimators.arguments import check_model, check_theta
from skthermo._tables.arrays import Array
from skthermo.fem._protocol import ModalModel
from skthermo.fem.modal._mac import mac
from skthermo.fem.modal._tracking import pair_modes

SAME_MODE = 0.5
"""MAC above which no other mode can have a higher one with the same reference: its MACs with all modes add up to 1."""

ROWS_AT_ONCE = 64  # samples whose shapes, at all degrees of freedom, are held at once


def share_reordered(model: ModalModel, theta: ArrayLike) -> float:
    """Share of some samples in which modes are not in their nominal order.

    Parameters
    ----------
    model : FE model
        With a method ``modes``.
    theta : array-like of shape (n_samples, n_parameters)
        Multipliers of the nominal parameters.

    Returns
    -------
    float
        Between 0 and 1. A sample counts if some column of ``model.modes(theta)`` is not the nominal mode of the same
        number: another column has the higher MAC with that mode, or the column's own MAC with it is below 0.5.

    Raises
    ------
    ValueError
        If the model is none or has no method ``modes``, or theta has no rows, the wrong width, or a value that is
        not finite and positive.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import sample, share_reordered
    >>> truss = make_truss()
    >>> drawn = sample(truss, bounds=0.3, n_samples=200, random_state=0)
    >>> share_reordered(truss, drawn.theta)
    0.065
    """
    check_model(model)
    if not hasattr(model, "modes"):
        raise ValueError(f"{model!r} has no method 'modes'; expected a model with one, such as AffineModel")
    rows = check_theta(theta, model.parameter_names)
    if not len(rows):
        raise ValueError(f"theta has shape {rows.shape}; expected at least one row")
    pieces = range(ROWS_AT_ONCE, len(rows), ROWS_AT_ONCE)
    return float(np.concatenate([_reordered(model, piece) for piece in np.split(rows, pieces)]).mean())


def _reordered(model: ModalModel, theta: Array) -> NDArray[np.bool_]:
    shapes = model.modes(theta)[1]
    if hasattr(model, "nominal_mac"):
        macs = model.nominal_mac(shapes)
    else:
        nominal = model.modes(np.ones((1, theta.shape[1])))[1][0]
        macs = np.stack([mac(nominal, phi) for phi in shapes])
    swapped = pair_modes(macs) != np.arange(macs.shape[1])
    replaced = np.diagonal(macs, axis1=1, axis2=2) < SAME_MODE
    return (swapped | replaced).any(axis=1)
