"""Rows of theta in chunks, solved on threads or in joblib's workers."""

from collections.abc import Callable, Generator, Mapping
from contextlib import closing
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from joblib import delayed, effective_n_jobs
from numpy.typing import ArrayLike

from skthermo._estimators.arguments import check_jobs, check_model, check_theta
from skthermo._estimators.threads import map_on_blas_threads, single_blas_thread
from skthermo._io import as_they_come, with_progress
from skthermo._tables.arrays import Array
from skthermo.fem._protocol import FEModel
from skthermo.fem._theta import ROWS_PER_CHUNK, warn_of_failures

Solve: TypeAlias = Callable[[Any, Array], tuple[Array, ...]]


def checked_rows(model: FEModel, theta: ArrayLike, n_jobs: int | None) -> Array:
    """Rows of theta, in which NaN is allowed, after checks of the model and the number of jobs."""
    check_model(model)
    check_jobs(n_jobs)
    return check_theta(theta, model.parameter_names, allow_nan=True)


def solve_rows(
    model: FEModel,
    solve: Solve,
    rows: Array,
    shapes: Mapping[str, tuple[int, ...]],
    n_jobs: int | None,
    progress: bool | None = False,
) -> list[Array]:
    """What ``solve(model, chunk)`` gives for every row, NaN where theta has NaN; failures are one warning.

    ``shapes`` names the results and gives the shape of each for one row; frequencies are the first.
    """
    results = [np.full((len(rows), *shape), np.nan) for shape in shapes.values()]
    known = np.flatnonzero(~np.isnan(rows).any(axis=1))
    if not known.size:
        return results
    size = getattr(model, "rows_per_chunk", ROWS_PER_CHUNK)
    places = [known[i : i + size] for i in range(0, len(known), size)]
    with closing(_solved(model, solve, [rows[place] for place in places], n_jobs)) as parts:
        shown = with_progress(parts, len(known), progress, count=lambda part: len(part[0]))
        for place, part in zip(places, shown, strict=True):
            for result, array, what in zip(results, part, shapes, strict=True):
                expected = (len(place), *shapes[what])
                if np.shape(array) != expected:
                    raise ValueError(
                        f"the model's {what} have shape {np.shape(array)}; expected {expected}, the first for the rows "
                        "of theta"
                    )
                result[place] = array
    getattr(model, "warn_of", warn_of_failures)(rows, results[0])
    return results


def _solved(
    model: Any, solve: Solve, chunks: list[Array], n_jobs: int | None
) -> Generator[tuple[Array, ...], None, None]:
    """Results of each chunk, in order; closing the generator stops the work."""
    thread_safe = getattr(model, "thread_safe", False)
    task = partial(solve, model.quiet() if thread_safe else model)
    if thread_safe and effective_n_jobs(n_jobs) == 1:
        yield from map_on_blas_threads(task, chunks)
    else:
        parallel = as_they_come(n_jobs=n_jobs, prefer=getattr(model, "prefer", None))
        job = _Job(task)
        yield from parallel(delayed(_on_one_thread)(job, chunk) for chunk in chunks)


class _Job:
    """What is done with every chunk; Dask sends it to a worker once, because it says that it is large."""

    def __init__(self, task: Callable[[Array], tuple[Array, ...]]):
        self.task = task

    def __sizeof__(self) -> int:
        return 2**20


def _on_one_thread(job: _Job, chunk: Array) -> tuple[Array, ...]:
    with single_blas_thread():
        return job.task(chunk)
