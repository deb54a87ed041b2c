"""Frequencies and mode shapes of many rows of theta."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._estimators.arguments import check_dofs
from skthermo._tables.arrays import Array
from skthermo.fem._protocol import FEModel, ModalModel
from skthermo.fem.sampling._chunks import checked_rows, solve_rows


def evaluate(model: FEModel, theta: ArrayLike, *, n_jobs: int | None = None, progress: bool | None = None) -> Array:
    """Frequencies of many rows of parameters.

    Parameters
    ----------
    model : FE model
        Anything with ``parameter_names``, ``n_modes`` and ``frequencies``.
    theta : array-like or DataFrame of shape (n_samples, n_parameters)
        Multipliers of the nominal parameters. NaN is allowed.
    n_jobs : int, optional
        Number of parallel jobs (joblib); each takes chunks of rows.
    progress : bool, optional
        Whether to show a progress bar on stderr. By default it appears on a terminal after one second.

    Returns
    -------
    ndarray of shape (n_samples, n_modes)
        In Hz; NaN in rows with NaN.

    Raises
    ------
    ValueError
        If ``model`` is not an FE model or returns another shape, or theta has the wrong width, or a value that is
        neither NaN nor finite and positive.

    Notes
    -----
    Rows without a solution give one warning. The chunks, of ``model.rows_per_chunk`` rows where it has that attribute,
    do not depend on ``n_jobs``, so that results are the same to the last bit. With one job, a model that is
    ``thread_safe`` runs on as many threads as BLAS may use.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import evaluate
    >>> evaluate(make_truss(), [[1.0, 1.0, 1.0, 1.0], [0.9, float("nan"), 1.0, 1.0]])[:, :2].round(2)
    array([[ 7.48, 27.5 ],
           [  nan,   nan]])
    """
    rows = checked_rows(model, theta, n_jobs)
    return solve_rows(model, _frequencies, rows, {"frequencies": (model.n_modes,)}, n_jobs, progress)[0]


def evaluate_modes(
    model: ModalModel, theta: ArrayLike, dofs: ArrayLike, *, n_jobs: int | None = None
) -> tuple[Array, Array]:
    """Frequencies and mode shapes of many rows of parameters, at some degrees of freedom.

    Parameters
    ----------
    model : FE model
        With a method ``modes``.
    theta : array-like or DataFrame of shape (n_samples, n_parameters)
        Multipliers of the nominal parameters. NaN is allowed.
    dofs : array-like of int of shape (n_dofs,)
        Degrees of freedom, such as those of sensors; the first is 0.
    n_jobs : int, optional
        Number of parallel jobs (joblib); each takes chunks of rows.

    Returns
    -------
    frequencies : ndarray of shape (n_samples, n_modes)
        In Hz; NaN in rows with NaN.
    shapes : ndarray of shape (n_samples, n_dofs, n_modes)
        As the model scales them; signs are arbitrary. NaN in rows with NaN.

    Raises
    ------
    ValueError
        If the model has no method ``modes``, theta is refused as by `evaluate`, or ``dofs`` are not different degrees
        of freedom of the model.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import evaluate_modes
    >>> frequencies, shapes = evaluate_modes(make_truss(), [[1.0, 1.0, 1.0, 1.0]], dofs=[0, 3])
    >>> frequencies.shape, shapes.shape
    ((1, 6), (1, 2, 6))
    """
    rows = checked_rows(model, theta, n_jobs)
    if not hasattr(model, "modes"):
        raise ValueError(f"{model!r} has no method 'modes'; expected a model that gives mode shapes, as AffineModel")
    places = check_dofs(dofs, np.shape(model.modes(np.ones((1, rows.shape[1])))[1])[1])
    expected = {"frequencies": (model.n_modes,), "shapes": (len(places), model.n_modes)}
    frequencies, shapes = solve_rows(model, partial(_modes, dofs=places), rows, expected, n_jobs)
    return frequencies, shapes


def _frequencies(model: FEModel, theta: Array) -> tuple[Array]:
    return (model.frequencies(theta),)


def _modes(model: ModalModel, theta: Array, dofs: NDArray[np.intp]) -> tuple[Array, Array]:
    frequencies, shapes = model.modes(theta)
    return frequencies, np.asarray(shapes)[:, dofs]
