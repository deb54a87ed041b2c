"""One optimisation, from one start."""

from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy.optimize import Bounds, OptimizeResult, least_squares, minimize

from skthermo._estimators.threads import single_blas_thread
from skthermo._tables.arrays import Array

TOLERANCE = 1e-9  # relative change of the objective and of theta below which a start has converged


class Searched(Protocol):
    """What a search minimises: residuals at each theta, and the loss of their squares."""

    def at(self, theta: Array) -> Any:
        """Residuals at one theta: ``values``, ``objective``, ``jacobian()`` and ``gradient()``."""

    def loss(self, squares: Array) -> Array:
        """Loss of squared residuals, its slope and its curvature, as `scipy.optimize.least_squares` asks."""


class Outcome(NamedTuple):
    """The result of one start; ``n_failed`` of its evaluations met theta without modes."""

    start: Array
    objective: float
    success: bool
    n_evaluations: int
    n_failed: int
    theta: Array


class SearchHistory:
    """Record of one optimisation: its last and its best point, and how many theta had no modes."""

    def __init__(self, residuals: Searched, start: Array):
        self._residuals = residuals
        self._theta = self.theta = start
        self._point = self.best = residuals.at(start)
        self.n_evaluations = 1
        self.n_failed = 0 if np.isfinite(self.best.objective) else 1

    def at(self, theta: Array) -> Any:
        """Residuals at theta. Those at the last and at the best theta are remembered."""
        if np.array_equal(theta, self.theta):
            return self.best
        if not np.array_equal(theta, self._theta):
            self.n_evaluations += 1
            self._theta = theta.copy()
            self._point = self._residuals.at(self._theta)
            if not np.isfinite(self._point.objective):
                self.n_failed += 1
            elif self._point.objective < self.best.objective:
                self.theta, self.best = self._theta, self._point
        return self._point


class NoDerivatives(Exception):
    """The model has no finite derivatives at some theta."""


def optimise(residuals: Searched, bounds: Array, start: Array, method: str, max_iter: int) -> Outcome:
    """Minimise the residuals' loss within bounds.

    Where the model has no modes, steps are cut short, which looks like convergence. A search that met such theta is
    therefore started again from its best point, and has converged when it meets none.
    """
    search = {"lbfgs": _lbfgs, "least_squares": _least_squares}[method]
    success = False
    with single_blas_thread():
        history = SearchHistory(residuals, start)
        first, before = history.best.objective, np.inf
        while max_iter > 0 and history.best.objective < (1 - TOLERANCE) * before:
            before, n_failed = history.best.objective, history.n_failed
            try:
                result = search(history, residuals, bounds, max_iter, first)
            except NoDerivatives:
                break
            max_iter -= result.get("nit", result.nfev)
            success = bool(result.success) and history.n_failed == n_failed
            if history.n_failed == n_failed:
                break
    return Outcome(start, history.best.objective, success, history.n_evaluations, history.n_failed, history.theta)


def _least_squares(
    history: SearchHistory, residuals: Searched, bounds: Array, max_iter: int, first: float
) -> OptimizeResult:
    def jacobian(theta: Array) -> Array:
        return _finite(history.at(theta).jacobian())

    return least_squares(
        lambda theta: history.at(theta).values.copy(),  # SciPy scales it in place
        history.theta,
        jacobian,
        bounds=(bounds[:, 0], bounds[:, 1]),
        loss=residuals.loss,
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=np.finfo(float).eps,
        max_nfev=max_iter,
    )


def _lbfgs(history: SearchHistory, residuals: Searched, bounds: Array, max_iter: int, first: float) -> OptimizeResult:
    """L-BFGS-B on the objective as a share of the first one, since its tolerances are absolute below 1.

    Where the model has no modes, it is given a parabola that rises from the best point, so that it turns back.
    """

    def share(theta: Array) -> tuple[float, Array]:
        point = history.at(theta)
        if np.isfinite(point.objective):
            gradient = _finite(point.gradient()) / scale
            if point is history.best:
                uphill[:] = gradient
            return point.objective / scale, gradient
        step = theta - history.theta
        slope = abs(uphill @ step)
        return history.best.objective / scale + slope / 2, 2 * slope * step / (step @ step)

    scale = first or 1.0
    uphill = np.empty_like(history.theta)
    options = {"maxiter": max_iter, "maxfun": 10 * max_iter, "ftol": TOLERANCE, "gtol": TOLERANCE, "maxcor": 20}
    return minimize(share, history.theta, jac=True, method="L-BFGS-B", bounds=Bounds(*bounds.T), options=options)


def _finite(derivatives: Array) -> Array:
    if not np.isfinite(derivatives).all():
        raise NoDerivatives
    return derivatives
