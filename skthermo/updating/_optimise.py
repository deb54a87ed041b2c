"""One optimisation, from one start."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, least_squares, minimize

from skthermo._threads import single_blas_thread
from skthermo.updating._residuals import Point, Residuals

Array = NDArray[np.float64]

TOLERANCE = 1e-9
"""Relative change of the objective and of theta below which a start has converged."""


class Outcome(NamedTuple):
    """Where one start has ended."""

    start: Array
    objective: float
    success: bool
    n_evaluations: int
    theta: Array


def optimise(residuals: Residuals, bounds: Array, start: Array, method: str, max_iter: int) -> Outcome:
    """Minimise the residuals' loss within bounds."""

    @lru_cache(maxsize=1)
    def at_bytes(theta: bytes) -> Point:
        return residuals.at(np.frombuffer(theta))

    def at(theta: Array) -> Point:
        return at_bytes(np.ascontiguousarray(theta).tobytes())

    search = {"lbfgs": _lbfgs, "least_squares": _least_squares}[method]
    with single_blas_thread():
        first = at(start).objective
        if not np.isfinite(first):
            return Outcome(start, first, False, 1, start)
        result = search(at, residuals, bounds, start, max_iter, first)
        objective = at(result.x).objective
    return Outcome(start, objective, bool(result.success), int(result.nfev), result.x)


def _least_squares(at, residuals: Residuals, bounds: Array, start: Array, max_iter: int, first: float):
    return least_squares(
        lambda theta: at(theta).values.copy(),  # SciPy scales it in place
        start,
        lambda theta: at(theta).jacobian(),
        bounds=(bounds[:, 0], bounds[:, 1]),
        loss=residuals.loss,
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=np.finfo(float).eps,
        max_nfev=max_iter,
    )


def _lbfgs(at, residuals: Residuals, bounds: Array, start: Array, max_iter: int, first: float):
    """L-BFGS-B on the objective as a share of the first one, since its tolerances are absolute below 1."""

    def share(theta: Array) -> tuple[float, Array]:
        point = at(theta)
        if not np.isfinite(point.objective):
            return np.inf, np.zeros_like(theta)
        return point.objective / scale, point.gradient() / scale

    scale = first or 1.0
    options = {"maxiter": max_iter, "maxfun": 10 * max_iter, "ftol": TOLERANCE, "gtol": TOLERANCE, "maxcor": 20}
    return minimize(share, start, jac=True, method="L-BFGS-B", bounds=Bounds(*bounds.T), options=options)
