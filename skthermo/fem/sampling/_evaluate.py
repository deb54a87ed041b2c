"""Frequencies and derivatives of many rows of theta."""

from collections.abc import Callable, Generator
from contextlib import closing
from numbers import Integral
from typing import Any, cast

import numpy as np
from joblib import Parallel, delayed, effective_n_jobs
from numpy.typing import ArrayLike, NDArray

from skthermo._arguments import check_theta
from skthermo._arrays import Array
from skthermo._models import check_model
from skthermo._threads import map_on_blas_threads, single_blas_thread
from skthermo.fem._protocol import BatchModel, FEModel
from skthermo.fem._theta import ROWS_PER_CHUNK, warn_of_failures
from skthermo.fem.sampling._progress import with_progress


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

    Warns
    -----
    UserWarning
        Once, if rows have no solution.

    Notes
    -----
    The chunks do not depend on ``n_jobs``, so that results are the same to the last bit. A chunk has
    ``rows_per_chunk`` rows if the model states that number. With one job, a model that is ``thread_safe`` runs on as
    many threads as BLAS may use.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import evaluate
    >>> evaluate(make_truss(), [[1.0, 1.0, 1.0, 1.0], [0.9, float("nan"), 1.0, 1.0]])[:, :2].round(2)
    array([[ 7.48, 27.5 ],
           [  nan,   nan]])
    """
    check_model(model)
    check_n_jobs(n_jobs)
    rows = check_theta(theta, model.parameter_names, allow_nan=True)
    frequencies = np.full((len(rows), model.n_modes), np.nan)
    known = np.flatnonzero(~np.isnan(rows).any(axis=1))
    if not known.size:
        return frequencies
    size = getattr(model, "rows_per_chunk", ROWS_PER_CHUNK)
    places = [known[i : i + size] for i in range(0, len(known), size)]
    with closing(_solved(model, rows, places, n_jobs)) as parts:
        for place, part in zip(places, with_progress(parts, len(known), progress), strict=True):
            frequencies[place] = check_shape(part, (len(place), model.n_modes), "the model's frequencies")
    getattr(model, "warn_of", warn_of_failures)(rows, frequencies)
    return frequencies


def check_n_jobs(n_jobs: int | None) -> None:
    """Raise an error for a number of jobs that joblib does not take."""
    if n_jobs is not None and (not isinstance(n_jobs, Integral) or isinstance(n_jobs, bool) or n_jobs == 0):
        raise ValueError(f"n_jobs is {n_jobs!r}; expected an integer, such as 2, or -1 for all processors, or None")


def check_shape(result: ArrayLike, expected: tuple[int, ...], what: str) -> Array:
    """Raise an error if a result has another shape, rather than broadcast it."""
    array = np.asarray(result)
    if array.shape != expected:
        raise ValueError(f"{what} have shape {array.shape}; expected {expected}, the first for the rows of theta")
    return array


def _solved(model: FEModel, rows: Array, places: list[NDArray], n_jobs: int | None) -> Generator[Array, None, None]:
    """Frequencies of each chunk of rows, in order; closing the generator stops the work."""
    thread_safe = getattr(model, "thread_safe", False)
    frequencies = cast(BatchModel, model).quiet().frequencies if thread_safe else model.frequencies
    if thread_safe and effective_n_jobs(n_jobs) == 1:
        yield from map_on_blas_threads(lambda place: frequencies(rows[place]), places)
    else:
        parallel = _parallel(n_jobs=n_jobs, prefer=getattr(model, "prefer", None))
        yield from parallel(delayed(solve_chunk)(frequencies, rows[place]) for place in places)


def _parallel(**options: Any) -> Parallel:
    """A joblib `Parallel` that yields results as they come, where the active backend can."""
    try:
        return Parallel(return_as="generator", **options)
    except ValueError:  # some backends, such as Ray's, return all results at the end
        return Parallel(**options)


def solve_chunk(solve: Callable[[Array], Any], theta: Array) -> Any:
    """What a model's method gives for some rows, on one thread."""
    with single_blas_thread():
        return solve(theta)
