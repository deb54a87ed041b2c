"""Frequencies, mode shapes and their derivatives at many rows of theta."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skthermo._estimators.arguments import check_flag
from skthermo._tables.arrays import Array, central_differences, is_real
from skthermo.fem._protocol import FEModel, ModalModel
from skthermo.fem.sampling._chunks import checked_rows, solve_rows
from skthermo.fem.sampling._evaluate import evaluate, evaluate_modes


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
        If theta is refused as by `evaluate`, or the step is not between 0 and 1.

    Examples
    --------
    The frequency of a mass on a spring is proportional to the square root of the stiffness:

    >>> from skthermo.fem import AffineModel, linearise
    >>> model = AffineModel({("k",): [[400.0]]}, [[1.0]], n_modes=1)
    >>> frequencies, jacobian = linearise(model, [[1.0], [4.0]], relative=True)
    >>> jacobian[:, 0, 0].round(6)
    array([0.5, 0.5])
    """
    rows = checked_rows(model, theta, n_jobs)
    _check_step(step)
    if hasattr(model, "linearised") or hasattr(model, "jacobian"):
        expected = {"frequencies": (model.n_modes,), "derivatives": (model.n_modes, rows.shape[1])}
        frequencies, jacobian = solve_rows(model, _linearised, rows, expected, n_jobs)
    else:
        frequencies = evaluate(model, rows, n_jobs=n_jobs)
        jacobian = central_differences(partial(evaluate, model, n_jobs=n_jobs), rows, frequencies, step)
    if check_flag(relative, "relative"):
        jacobian = jacobian * rows[:, np.newaxis] / frequencies[:, :, np.newaxis]
    return frequencies, jacobian


def linearise_modes(
    model: ModalModel, theta: ArrayLike, dofs: ArrayLike, *, step: float = 0.001, n_jobs: int | None = None
) -> tuple[Array, Array, Array, Array]:
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
        If the model has neither method, ``dofs`` are not different degrees of freedom of the model, theta is refused
        as by `evaluate`, or the step is not between 0 and 1.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import linearise_modes
    >>> [array.shape for array in linearise_modes(make_truss(), [[1.0, 1.0, 1.0, 1.0]], dofs=[0, 3, 8])]
    [(1, 6), (1, 6, 4), (1, 3, 6), (1, 3, 6, 4)]
    """
    rows = checked_rows(model, theta, n_jobs)
    _check_step(step)
    if hasattr(model, "linearised_modes"):
        n_modes, n_parameters, n_dofs = model.n_modes, rows.shape[1], np.size(dofs)
        expected = {
            "frequencies": (n_modes,),
            "derivatives": (n_modes, n_parameters),
            "shapes": (n_dofs, n_modes),
            "derivatives of shapes": (n_dofs, n_modes, n_parameters),
        }
        solve = partial(_linearised_modes, dofs=dofs)
        return tuple(solve_rows(model, solve, rows, expected, n_jobs))  # type: ignore[return-value]
    frequencies, jacobian = linearise(model, rows, step=step, n_jobs=n_jobs)
    shapes = evaluate_modes(model, rows, dofs, n_jobs=n_jobs)[1]

    def with_the_same_signs(moved: Array) -> Array:
        there = evaluate_modes(model, moved, dofs, n_jobs=n_jobs)[1]
        reference = np.tile(np.repeat(shapes, rows.shape[1], axis=0), (2, 1, 1))  # both sides of every parameter
        return there * np.sign(np.einsum("sdm,sdm->sm", there, reference))[:, np.newaxis]

    return frequencies, jacobian, shapes, central_differences(with_the_same_signs, rows, shapes, step)


def _linearised(model: Any, theta: Array) -> tuple[Array, Array]:
    if hasattr(model, "linearised"):
        return model.linearised(theta)
    return model.frequencies(theta), model.jacobian(theta)


def _linearised_modes(model: Any, theta: Array, dofs: ArrayLike) -> tuple[Array, Array, Array, Array]:
    return model.linearised_modes(theta, dofs)


def _check_step(step: float) -> None:
    if not is_real(step) or not 0 < step < 1:
        raise ValueError(f"step is {step!r}; expected a relative step between 0 and 1, such as 0.001")
