"""Frequencies, mode shapes and their derivatives at many rows of theta."""

from functools import partial
from typing import cast

import numpy as np
from joblib import Parallel, delayed, effective_n_jobs
from numpy.typing import ArrayLike

from skthermo._arguments import check_theta
from skthermo._arrays import Array
from skthermo._models import check_model
from skthermo.fem._protocol import ModalModel
from skthermo.fem._theta import ROWS_PER_CHUNK
from skthermo.fem.sampling._evaluate import check_n_jobs, solve_chunk
from skthermo.fem.sampling._evaluate_modes import evaluate_modes
from skthermo.fem.sampling._linearise import check_step, linearise

Linearised = tuple[Array, Array, Array, Array]


def linearise_modes(
    model: ModalModel, theta: ArrayLike, dofs: ArrayLike, *, step: float = 0.001, n_jobs: int | None = None
) -> Linearised:
    """Frequencies and mode shapes of many rows of parameters, and their derivatives.

    Parameters
    ----------
    model : FE model
        Exact derivatives come from its method ``linearised_modes``, if it has one; else those of the shapes are
        central differences of its method ``modes``, and those of the frequencies as from `linearise`.
    theta : array-like or DataFrame of shape (n_samples, n_parameters)
        Multipliers of the nominal parameters. NaN is allowed.
    dofs : array-like of int of shape (n_dofs,)
        Degrees of freedom, such as those of sensors; the first is 0.
    step : float, default=0.001
        Relative step of central differences.
    n_jobs : int, optional
        Number of parallel jobs (joblib); each takes chunks of rows.

    Returns
    -------
    frequencies : ndarray of shape (n_samples, n_modes)
        In Hz; NaN in rows with NaN, as are the others.
    jacobian : ndarray of shape (n_samples, n_modes, n_parameters)
        Derivatives d f / d theta in Hz.
    shapes : ndarray of shape (n_samples, n_dofs, n_modes)
        As the model scales them; signs are arbitrary.
    derivatives : ndarray of shape (n_samples, n_dofs, n_modes, n_parameters)
        Derivatives d phi / d theta of these shapes.

    Raises
    ------
    ValueError
        If the model has neither method, theta has the wrong width or a value that is neither NaN nor finite and
        positive, ``dofs`` are not different degrees of freedom of the model, or the step is not between 0 and 1.

    See Also
    --------
    shape_jacobian : Shapes and their derivatives at one theta.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import linearise_modes
    >>> rows = [[1.0, 1.0, 1.0, 1.0], [0.9, 1.0, 1.0, 1.0]]
    >>> [array.shape for array in linearise_modes(make_truss(), rows, dofs=[0, 3, 8])]
    [(2, 6), (2, 6, 4), (2, 3, 6), (2, 3, 6, 4)]
    """
    check_model(model)
    check_n_jobs(n_jobs)
    rows = check_theta(theta, model.parameter_names, allow_nan=True)
    if not hasattr(model, "linearised_modes"):
        frequencies, jacobian = linearise(model, rows, step=step, n_jobs=n_jobs)
        return frequencies, jacobian, *_differences(model, rows, dofs, step, n_jobs)
    solve, known = partial(model.linearised_modes, dofs=dofs), ~np.isnan(rows).any(axis=1)
    size = getattr(model, "rows_per_chunk", ROWS_PER_CHUNK)
    if effective_n_jobs(n_jobs) == 1 or known.sum() <= size:
        solved = solve(rows[known])
    else:
        chunks = np.split(rows[known], range(size, int(known.sum()), size))
        parallel = Parallel(n_jobs=n_jobs, prefer=getattr(model, "prefer", None))
        parts = parallel(delayed(solve_chunk)(solve, chunk) for chunk in chunks)
        solved = [np.concatenate(arrays) for arrays in zip(*parts, strict=True)]
    results = [np.full((len(rows), *np.shape(array)[1:]), np.nan) for array in solved]
    for result, array in zip(results, solved, strict=True):
        result[known] = array
    return cast(Linearised, tuple(results))


def _differences(
    model: ModalModel, theta: Array, dofs: ArrayLike, step: float, n_jobs: int | None
) -> tuple[Array, Array]:
    """Shapes, and their derivatives by central differences; shapes at either side are given the signs of these."""
    check_step(step)
    n_parameters = theta.shape[1]
    shapes = evaluate_modes(model, theta, dofs, n_jobs=n_jobs)[1]
    steps = step * theta[:, np.newaxis] * np.eye(n_parameters)  # (sample, perturbed parameter, parameter)
    sides = []
    for moved in (theta[:, np.newaxis] + steps, theta[:, np.newaxis] - steps):
        there = evaluate_modes(model, moved.reshape(-1, n_parameters), dofs, n_jobs=n_jobs)[1]
        there = there.reshape(len(theta), n_parameters, *shapes.shape[1:])
        sides.append(there * np.sign(np.einsum("spdm,sdm->spm", there, shapes))[:, :, np.newaxis])
    slopes = (sides[0] - sides[1]) / (2 * step * theta)[:, :, np.newaxis, np.newaxis]
    return shapes, np.moveaxis(slopes, 1, 3)
