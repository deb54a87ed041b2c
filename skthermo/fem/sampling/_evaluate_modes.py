"""Frequencies and mode shapes of many rows of theta, at some degrees of freedom."""

from collections.abc import Callable
from functools import partial
from typing import Any, cast

import numpy as np
from joblib import Parallel, delayed, effective_n_jobs
from numpy.typing import ArrayLike, NDArray

from skthermo._arguments import check_dofs, check_theta
from skthermo._arrays import Array
from skthermo._models import check_model
from skthermo._threads import map_on_blas_threads
from skthermo.fem._protocol import BatchModel, ModalModel
from skthermo.fem._theta import ROWS_PER_CHUNK, warn_of_failures
from skthermo.fem.sampling._evaluate import check_n_jobs, check_shape, solve_chunk


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
        If the model has no method ``modes``, theta has the wrong width or a value that is neither NaN nor finite and
        positive, or ``dofs`` are not different degrees of freedom of the model.

    Warns
    -----
    UserWarning
        Once, if rows have no solution.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import evaluate_modes
    >>> frequencies, shapes = evaluate_modes(make_truss(), [[1.0, 1.0, 1.0, 1.0]], dofs=[0, 3])
    >>> frequencies.shape, shapes.shape
    ((1, 6), (1, 2, 6))
    """
    check_model(model)
    check_n_jobs(n_jobs)
    if not hasattr(model, "modes"):
        raise ValueError(f"{model!r} has no method 'modes'; expected a model that gives mode shapes, as AffineModel")
    rows = check_theta(theta, model.parameter_names, allow_nan=True)
    places = check_dofs(dofs, np.shape(model.modes(np.ones((1, rows.shape[1])))[1])[1])
    frequencies = np.full((len(rows), model.n_modes), np.nan)
    shapes = np.full((len(rows), len(places), model.n_modes), np.nan)
    known = np.flatnonzero(~np.isnan(rows).any(axis=1))
    size = getattr(model, "rows_per_chunk", ROWS_PER_CHUNK)
    chunks = [known[i : i + size] for i in range(0, len(known), size)]
    solved = _solved(model, [rows[chunk] for chunk in chunks], places, n_jobs)
    for chunk, (there, found) in zip(chunks, solved, strict=True):
        frequencies[chunk] = check_shape(there, (len(chunk), model.n_modes), "the model's frequencies")
        shapes[chunk] = check_shape(found, (len(chunk), len(places), model.n_modes), "the model's shapes")
    getattr(model, "warn_of", warn_of_failures)(rows, frequencies)
    return frequencies, shapes


def _solved(model: ModalModel, chunks: list[Array], dofs: NDArray[np.intp], n_jobs: int | None) -> Any:
    thread_safe = getattr(model, "thread_safe", False)
    modes = cast(Any, cast(BatchModel, model).quiet()).modes if thread_safe else model.modes
    solve = partial(_at_dofs, modes, dofs)
    if effective_n_jobs(n_jobs) > 1:
        parallel = Parallel(n_jobs=n_jobs, prefer=getattr(model, "prefer", None))
        return parallel(delayed(solve_chunk)(solve, chunk) for chunk in chunks)
    return map_on_blas_threads(solve, chunks) if thread_safe else map(solve, chunks)


def _at_dofs(modes: Callable[[Array], Any], dofs: NDArray[np.intp], theta: Array) -> tuple[Array, Array]:
    frequencies, shapes = modes(theta)
    return np.asarray(frequencies), np.asarray(shapes)[:, dofs]
