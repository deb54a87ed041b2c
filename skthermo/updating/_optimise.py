"""One optimisation, from one start."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, OptimizeResult, least_squares, minimize

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


class Path:
    """The points that one optimisation has visited: the last, the best, and whether some had no modes."""

    def __init__(self, residuals: Residuals, start: Array):
        self._residuals = residuals
        self._theta = self.theta = start
        self._point = self.best = residuals.at(start)
        self.met_gaps = False
        self.n_evaluations = 1

    def at(self, theta: Array) -> Point:
        """Residuals at theta, found once while theta stays."""
        if np.array_equal(theta, self.theta):
            return self.best
        if not np.array_equal(theta, self._theta):
            self.n_evaluations += 1
            self._theta = theta.copy()
            self._point = self._residuals.at(self._theta)
            if not np.isfinite(self._point.objective):
                self.met_gaps = True
            elif self._point.objective < self.best.objective:
                self.theta, self.best = self._theta, self._point
        return self._point


class NoDerivatives(Exception):
    """Derivatives are not finite."""


def optimise(residuals: Residuals, bounds: Array, start: Array, method: str, max_iter: int) -> Outcome:
    """Minimise the residuals' loss within bounds.

    Steps cut short where the model has no modes look like convergence. A search that met such points therefore goes on
    from its best one, and has converged when it meets none.
    """
    search = {"lbfgs": _lbfgs, "least_squares": _least_squares}[method]
    success = False
    with single_blas_thread():
        path = Path(residuals, start)
        first, before = path.best.objective, np.inf
        while max_iter > 0 and path.best.objective < (1 - TOLERANCE) * before:
            before, path.met_gaps = path.best.objective, False
            try:
                result = search(path, residuals, bounds, max_iter, first)
            except NoDerivatives:
                break
            max_iter -= result.get("nit", result.nfev)
            success = bool(result.success) and not path.met_gaps
            if not path.met_gaps:
                break
    return Outcome(start, path.best.objective, success, path.n_evaluations, path.theta)


def _least_squares(path: Path, residuals: Residuals, bounds: Array, max_iter: int, first: float) -> OptimizeResult:
    def jacobian(theta: Array) -> Array:
        return _finite(path.at(theta).jacobian())

    return least_squares(
        lambda theta: path.at(theta).values.copy(),  # SciPy scales it in place
        path.theta,
        jacobian,
        bounds=(bounds[:, 0], bounds[:, 1]),
        loss=residuals.loss,
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=np.finfo(float).eps,
        max_nfev=max_iter,
    )


def _lbfgs(path: Path, residuals: Residuals, bounds: Array, max_iter: int, first: float) -> OptimizeResult:
    """L-BFGS-B on the objective as a share of the first one, since its tolerances are absolute below 1.

    Where there are no modes, it sees a parabola that rises from the best point's slope and makes it turn back.
    """

    def share(theta: Array) -> tuple[float, Array]:
        point = path.at(theta)
        if np.isfinite(point.objective):
            gradient = _finite(point.gradient()) / scale
            if point is path.best:
                uphill[:] = gradient
            return point.objective / scale, gradient
        step = theta - path.theta
        slope = abs(uphill @ step)
        return path.best.objective / scale + slope / 2, 2 * slope * step / (step @ step)

    scale = first or 1.0
    uphill = np.empty_like(path.theta)
    options = {"maxiter": max_iter, "maxfun": 10 * max_iter, "ftol": TOLERANCE, "gtol": TOLERANCE, "maxcor": 20}
    return minimize(share, path.theta, jac=True, method="L-BFGS-B", bounds=Bounds(*bounds.T), options=options)


def _finite(derivatives: Array) -> Array:
    if not np.isfinite(derivatives).all():
        raise NoDerivatives
    return derivatives
