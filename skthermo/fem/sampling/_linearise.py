"""Frequencies and their derivatives at many rows of theta."""

from collections.abc import Callable
from numbers import Real
from typing import Any

import numpy as np
from joblib import Parallel, delayed, effective_n_jobs
from numpy.typing import ArrayLike

from skthermo._arguments import check_theta
from skthermo._arrays import Array
from skthermo._models import check_model
from skthermo.fem._protocol import FEModel
from skthermo.fem._theta import ROWS_PER_CHUNK
from skthermo.fem.sampling._evaluate import check_n_jobs, check_shape, evaluate, solve_chunk


def linearise(
    model: FEModel, theta: ArrayLike, *, relative: bool = False, step: float = 0.001, n_jobs: int | None = None
) -> tuple[Array, Array]:
    """Frequencies of many rows of parameters, and their derivatives.

    Parameters
    ----------
    model : FE model
        Exact derivatives come from its method ``linearised`` or ``jacobian``, if it has one; else from central
        differences.
    theta : array-like or DataFrame of shape (n_samples, n_parameters)
        Multipliers of the nominal parameters. NaN is allowed.
    relative : bool, default=False
        Whether to return d ln f / d ln theta in place of d f / d theta.
    step : float, default=0.001
        Relative step of central differences.
    n_jobs : int, optional
        Number of parallel jobs (joblib); each takes chunks of rows.

    Returns
    -------
    frequencies : ndarray of shape (n_samples, n_modes)
        In Hz; NaN in rows with NaN.
    jacobian : ndarray of shape (n_samples, n_modes, n_parameters)
        Derivatives d f / d theta in Hz or, if ``relative``, d ln f / d ln theta; NaN in rows with NaN.

    Raises
    ------
    ValueError
        If theta has the wrong width, or a value that is neither NaN nor finite and positive; if the step is not
        between 0 and 1.

    Examples
    --------
    The frequency of a mass on a spring is proportional to the square root of the stiffness:

    >>> from skthermo.fem import AffineModel, linearise
    >>> model = AffineModel({("k",): [[400.0]]}, [[1.0]], n_modes=1)
    >>> frequencies, jacobian = linearise(model, [[1.0], [4.0]], relative=True)
    >>> jacobian[:, 0, 0].round(6)
    array([0.5, 0.5])
    """
    check_model(model)
    rows = check_theta(theta, model.parameter_names, allow_nan=True)
    frequencies = np.full((len(rows), model.n_modes), np.nan)
    jacobian = np.full((len(rows), model.n_modes, rows.shape[1]), np.nan)
    known = ~np.isnan(rows).any(axis=1)
    if not known.any():
        return frequencies, jacobian
    check_n_jobs(n_jobs)
    if hasattr(model, "linearised"):
        solved, slopes = _in_jobs(model, model.linearised, rows[known], n_jobs)
    else:
        solved = evaluate(model, rows[known], n_jobs=n_jobs)
        exact = getattr(model, "jacobian", None)
        slopes = exact(rows[known]) if exact else central_differences(model, rows[known], step, n_jobs)
    frequencies[known] = check_shape(solved, frequencies[known].shape, "the model's frequencies")
    jacobian[known] = check_shape(slopes, jacobian[known].shape, "the model's derivatives")
    if relative:
        jacobian *= rows[:, np.newaxis] / frequencies[:, :, np.newaxis]
    return frequencies, jacobian


def _in_jobs(model: Any, linearised: Callable[[Array], tuple[Array, Array]], rows: Array, n_jobs: int | None) -> Any:
    """Frequencies and derivatives from chunks of rows, solved in parallel."""
    if effective_n_jobs(n_jobs) == 1:
        return linearised(rows)
    size = getattr(model, "rows_per_chunk", ROWS_PER_CHUNK)
    chunks = (rows[start : start + size] for start in range(0, len(rows), size))
    parallel = Parallel(n_jobs=n_jobs, prefer=getattr(model, "prefer", None))
    parts = parallel(delayed(solve_chunk)(linearised, chunk) for chunk in chunks)
    return tuple(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


def check_step(step: float) -> None:
    """Raise an error unless a relative step is between 0 and 1."""
    if not isinstance(step, Real) or not 0 < step < 1:
        raise ValueError(f"step is {step!r}; expected a relative step between 0 and 1, such as 0.001")


def central_differences(model: FEModel, theta: Array, step: float, n_jobs: int | None = None) -> Array:
    """d f / d theta by central differences of a relative step, (n_samples, n_modes, n_parameters).

    One-sided where one side has no frequencies.
    """
    check_step(step)
    n_samples, n_parameters = theta.shape
    steps = step * theta[:, np.newaxis] * np.eye(n_parameters)  # (sample, perturbed parameter, parameter)
    moved = np.stack([theta[:, np.newaxis] + steps, theta[:, np.newaxis] - steps])
    solved = evaluate(model, moved.reshape(-1, n_parameters), n_jobs=n_jobs)
    sides = solved.reshape(2, n_samples, n_parameters, -1)
    known = ~np.isnan(sides)
    if not known.all():
        sides = np.where(known, sides, evaluate(model, theta)[:, np.newaxis])
    widths = np.where(known.any(axis=0), known.sum(axis=0), np.nan) * (step * theta)[:, :, np.newaxis]
    return ((sides[0] - sides[1]) / widths).swapaxes(1, 2)
