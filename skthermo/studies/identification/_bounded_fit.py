"""Bounded least squares for severities: fits, their errors, and tests."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.optimize import brentq, nnls

from skthermo._arrays import Array

HIGHEST_SEVERITY = 0.95  # upper bound of fitted severities
MOST_STEPS = 12  # largest number of Gauss-Newton steps
TOLERANCE = 1e-6  # change of the severities in one step below which the fit has converged

Effects = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class BoundedFit:
    """Severities between 0 and 0.95 that fit a shift best, and the sum of squares of the whitened differences.

    ``slopes`` (n_observed, n_groups) are whitened derivatives at the fit, and ``target`` (n_observed,) the whitened
    shift that they would explain in a linear fit; ``explained`` is the shift by the severities, not whitened.
    """

    severities: Array
    misfit: float
    slopes: Array
    target: Array
    explained: Array
    converged: bool


def fit_severities(effects: Effects, shift: Array, whitening: Array, n_groups: int) -> BoundedFit:
    """Gauss-Newton steps, each a non-negative least-squares fit."""
    severities, converged = np.zeros(n_groups), False
    for _ in range(MOST_STEPS):
        change, slopes = effects(severities)
        target = whitening @ (shift - change + slopes @ severities)
        found = solve(whitening @ slopes, target)
        converged = bool(np.abs(found - severities).max(initial=0.0) < TOLERANCE)
        if converged:
            break
        severities = found
    change, slopes = effects(severities)
    residual = whitening @ (shift - change)
    misfit, whitened = float(residual @ residual), whitening @ slopes
    return BoundedFit(severities, misfit, whitened, residual + whitened @ severities, change, converged)


def solve(slopes: Array, target: Array) -> Array:
    """Non-negative severities of a linear least-squares fit, with a zero-mean, unit-variance prior on each."""
    n_groups = slopes.shape[1]
    if n_groups == 0:
        return np.zeros(0)  # SciPy's nnls crashes without columns
    found = nnls(np.vstack([slopes, np.eye(n_groups)]), np.concatenate([target, np.zeros(n_groups)]))[0]
    return np.minimum(found, HIGHEST_SEVERITY)


def drawn_errors(shape: tuple[int, int], freedom: float, random: np.random.RandomState) -> Array:
    """Whitened errors by Student's law of several dimensions, one draw a row."""
    scale = np.sqrt(freedom / random.chisquare(freedom, size=shape[0])) if np.isfinite(freedom) else np.ones(shape[0])
    return random.standard_normal(shape) * scale[:, np.newaxis]


def redrawn(
    slopes: Array,
    around: Array,
    n_draws: int,
    random: np.random.RandomState,
    freedom: float = np.inf,
    widening: float = 1.0,
) -> Array:
    """Severities fitted to whitened shifts with redrawn errors, so many times as wide, (n_draws, n_groups)."""
    errors = widening * drawn_errors((n_draws, len(around)), freedom, random)
    return np.array([solve(slopes, around + error) for error in errors]).reshape(n_draws, slopes.shape[1])


def standard_errors(fit: BoundedFit, n_draws: int, random: np.random.RandomState) -> tuple[Array, Array]:
    """Standard errors of the bounded estimates, and their covariance, from fits to redrawn shifts.

    Where another group's severity could be traded for this one, the scatter of the fits understates the error. A
    standard error is therefore at least half of the increase at which the refitted misfit exceeds the best by 4.
    """
    errors = redrawn(fit.slopes, fit.slopes @ fit.severities, n_draws, random) - fit.severities
    covariance = errors.T @ errors / n_draws
    least = _misfit(fit.slopes, fit.target)
    highest = [likely_range(fit.slopes, fit.target, *found, least)[1] for found in enumerate(fit.severities)]
    return np.maximum(np.sqrt(np.diag(covariance)), (np.array(highest) - fit.severities) / 2), covariance


def error_beside(slopes: Array, severities: Array, column: int) -> float:
    """Half of the largest change of a severity, up or down, within its `likely_range`."""
    found = float(severities[column])
    lowest, highest = likely_range(slopes, slopes @ severities, column, found)
    return max(found - lowest, highest - found) / 2


def likely_range(slopes: Array, target: Array, column: int, found: float, least: float = 0.0) -> tuple[float, float]:
    """Range of a severity in which the misfit, with the other severities refitted, exceeds ``least`` by at most 4."""
    others = np.delete(slopes, column, axis=1)

    def excess(severity: float) -> float:
        return _misfit(others, target - severity * slopes[:, column]) - least - 4.0

    def end(bound: float) -> float:
        return float(brentq(excess, found, bound, xtol=1e-6)) if excess(bound) > 0 > excess(found) else bound

    return end(0.0), end(HIGHEST_SEVERITY)


def two_errors(freedom: float) -> float:
    """Half of what holds as much of Student's law as two standard deviations hold of the normal law."""
    return float(stats.t.isf(stats.norm.sf(2.0), freedom)) / 2


def p_of_damage(fit: BoundedFit, freedom: float, n_draws: int, random: np.random.RandomState) -> float:
    """Probability that damage explains as much of a healthy structure's shift as of this one."""
    gained = fit.target @ fit.target - _misfit(fit.slopes, fit.target)
    targets = drawn_errors((n_draws, len(fit.target)), freedom, random)
    healthy = np.array([target @ target - _misfit(fit.slopes, target) for target in targets])
    return float((1 + (healthy >= gained).sum()) / (1 + n_draws))


def p_of_group(fit: BoundedFit, without: BoundedFit, freedom: float, column: int, nominal: Array) -> float:
    """One-sided p-value (Student's t) of the misfit that an undamaged group would remove from a fit by chance.

    What the other groups could imitate at the nominal state does not count.
    """
    others = np.delete(nominal, column, axis=1)
    gained = min(without.misfit - fit.misfit, _misfit(others, nominal @ fit.severities))
    return float(stats.t.sf(np.sqrt(max(gained, 0.0)), freedom))


def p_of_misfit(fit: BoundedFit, freedom: float) -> float:
    """p-value (F) of the misfit if only these groups changed; NaN without more modes than damaged groups."""
    rest = n_left(fit)
    return float(stats.f.sf(fit.misfit / rest, rest, freedom)) if rest > 0 else float("nan")


def widening_of(fit: BoundedFit) -> float:
    """Birge's ratio: how many times as large errors would make such a misfit likely; at least 1."""
    rest = n_left(fit)
    return max(float(np.sqrt(fit.misfit / rest)), 1.0) if rest > 0 else 1.0


def n_left(fit: BoundedFit) -> int:
    """Number of observations that severities leave free."""
    return len(fit.target) - int(np.count_nonzero(fit.severities))


def _misfit(slopes: Array, target: Array) -> float:
    residual = target - slopes @ solve(slopes, target)
    return float(residual @ residual)
