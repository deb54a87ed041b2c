"""Maximum likelihood of a logistic curve through counts, and checks of these."""

from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import expit, log_expit

from skthermo._arrays import Array, real_array

MOST_NEWTON_STEPS = 100

CONVERGED = 1e-10
"""Newton's decrement, in units of log likelihood, at which the fit ends."""

FLAT = 1e-6
"""Increase of the logit over the tested severities up to which the curve counts as flat."""


def check_probability(value: Any, what: str) -> float:
    """A probability strictly between 0 and 1, or an error."""
    if not isinstance(value, Real) or isinstance(value, bool) or not 0 < float(value) < 1:
        raise ValueError(f"{what} is {value!r}; expected a probability between 0 and 1, such as 0.9")
    return float(value)


def checked_counts(severities: ArrayLike, n_detected: ArrayLike, n_records: ArrayLike) -> tuple[Array, Array, Array]:
    """Severities with records, in ascending order of their magnitude, and their counts."""
    names = ("severities", "n_detected", "n_records")
    s, k, n = (real_array(v, name) for v, name in zip((severities, n_detected, n_records), names, strict=True))
    if s.ndim != 1 or not s.shape == k.shape == n.shape:
        raise ValueError(
            f"severities, n_detected and n_records have shapes {s.shape}, {k.shape}, {n.shape}; expected "
            "vectors of one length"
        )
    if not (np.isfinite(s).all() and ((s > 0).all() or (s < 0).all()) and (s < 1).all()):
        raise ValueError(
            f"severities are {s.tolist()}; expected shares of the stiffness, all above 0 and below 1, or all negative"
        )
    if not (np.isfinite(n).all() and (k >= 0).all() and (k <= n).all()):
        raise ValueError(
            f"n_detected is {k.tolist()} and n_records {n.tolist()}; expected 0 <= n_detected <= n_records"
        )
    order = np.argsort(np.abs(s), kind="stable")
    s, k, n = (values[order][n[order] > 0] for values in (s, k, n))
    if len(np.unique(s)) < 2:
        raise ValueError(f"severities {np.unique(s).tolist()} have records; expected at least two severities")
    return s, k, n


def places_of(magnitudes: Array, log: bool) -> Array:
    """Places on the axis along which the logit is linear: magnitudes of severities, or their logarithms."""
    return np.log(magnitudes) if log else magnitudes


def bracket_of(severities: Array, pod: Array, level: float) -> tuple[float, float]:
    """Magnitudes of the highest severity with a POD below a level, and of the next one."""
    magnitudes = np.abs(severities)
    below = np.flatnonzero(pod < level)
    if not below.size:
        return 0.0, float(magnitudes[0])
    above = magnitudes[magnitudes > magnitudes[below[-1]]]
    return float(magnitudes[below[-1]]), float(above[0]) if above.size else float("nan")


def within(bracket: tuple[float, float]) -> str:
    """Text of a bracket, whose upper end may be unknown (NaN)."""
    lowest, highest = bracket
    return f"above {lowest:g}" if np.isnan(highest) else f"between {lowest:g} and {highest:g}"


def most_likely(x: Array, k: Array, n: Array) -> tuple[Array, Array]:
    """Intercept and slope by Newton's method, and their covariance."""
    centre, width = np.average(x, weights=n), np.ptp(x)
    design = np.column_stack([np.ones_like(x), (x - centre) / width])

    def log_likelihood(b: Array) -> float:
        return float((k * log_expit(design @ b) + (n - k) * log_expit(-design @ b)).sum())

    coefficients = np.zeros(2)
    for _ in range(MOST_NEWTON_STEPS):
        pod = expit(design @ coefficients)
        information = (design.T * (n * pod * (1 - pod))) @ design
        gradient = design.T @ (k - n * pod)
        step, now = np.linalg.solve(information, gradient), log_likelihood(coefficients)
        if gradient @ step < CONVERGED:
            break
        while log_likelihood(coefficients + step) < now:
            step = step / 2
        coefficients = coefficients + step
    to_severities = np.array([[1.0, -centre / width], [0.0, 1 / width]])
    return to_severities @ coefficients, to_severities @ np.linalg.inv(information) @ to_severities.T
