"""Probability of detection (POD) as a function of severity, and families of scenarios, of which it is known."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.special import expit, log_expit, logit
from scipy.stats import norm

from skthermo._core.arrays import Array, check_flag, check_probability, real_array
from skthermo._core.warnings import warn_user
from skthermo.exceptions import ResultWarning
from skthermo.metrics import minimum_detectable_damage
from skthermo.studies.detectability._rates import clopper_pearson

MISFIT_CHANCE = 0.01  # probability with which rates drawn from the curve itself lie outside the bounds at any severity
MISFIT_MARGIN = 0.03  # distance in POD beyond these bounds from which the curve is said to miss a severity
MOST_NEWTON_STEPS = 100
CONVERGED = 1e-10  # Newton's decrement, in units of log likelihood, at which the fit ends
FLAT = 1e-6  # increase of the logit over the tested severities up to which the curve counts as flat


@dataclass(frozen=True, eq=False, repr=False)
class PODCurve:
    """A fitted curve: logit POD = intercept + slope * severity, or its logarithm.

    Parameters
    ----------
    severities, n_detected, n_records : ndarray of shape (n_severities,)
        The data, in ascending order of the magnitude of the severity.
    intercept, slope : float
        NaN where the data determine no finite slope.
    covariance : ndarray of shape (2, 2)
        Of intercept and slope, from the expected information.
    log : bool
        Whether the curve is linear in the logarithm of the severity.
    confidence : float
        Of the bounds that `predict` gives.
    bracket : tuple of float
        Magnitudes of the highest tested severity with a POD below 0.9 (0 if there is none) and of the next one (NaN if
        there is none).
    replicates : tuple of PODCurve, default=()
        Curves of measured campaigns as a study expects them where more than the noise is uncertain; see
        `prediction_interval`.

    Examples
    --------
    >>> from skthermo.studies import pod_curve
    >>> curve = pod_curve([0.1, 0.2, 0.3], n_detected=[24, 94, 99], n_records=[100, 100, 100])
    >>> print(f"a90 {curve.a90:.3f}, with 95 % confidence {curve.a90_95:.3f}")
    a90 0.183, with 95 % confidence 0.205
    """

    severities: Array
    n_detected: Array
    n_records: Array
    intercept: float
    slope: float
    covariance: Array
    log: bool
    confidence: float
    bracket: tuple[float, float]
    replicates: tuple[PODCurve, ...] = ()

    @property
    def a50(self) -> float:
        """Severity that is detected in half of the records."""
        return self.severity_at(0.5)

    @property
    def a90(self) -> float:
        """Severity that is detected in 90 % of the records."""
        return self.severity_at(0.9)

    @property
    def a90_95(self) -> float:
        """Severity at which the lower 95 % confidence bound of the POD reaches 0.9."""
        return self.severity_at(0.9, confidence=0.95)

    @property
    def n_missed(self) -> int:
        """Number of severities whose POD the curve misses by more than 3 percentage points beyond its bounds.

        The bounds (Clopper-Pearson) hold the POD of all severities together with 99 % confidence.
        """
        if np.isnan(self.slope):
            return 0
        confidence = 1 - MISFIT_CHANCE / len(self.severities)
        counts = zip(self.n_detected, self.n_records, strict=True)
        lowest, highest = np.array([clopper_pearson(k, n, confidence) for k, n in counts]).T
        pod = self.predict(self.severities)[0]
        return int(((pod < lowest - MISFIT_MARGIN) | (pod > highest + MISFIT_MARGIN)).sum())

    def predict(self, severity: ArrayLike) -> tuple[Any, Any, Any]:
        """POD at some severities, with bounds.

        Parameters
        ----------
        severity : float or array-like
            Of the sign of the tested severities.

        Returns
        -------
        pod : float or ndarray
            Probability of detection.
        lowest, highest : float or ndarray
            Wald bounds on the scale of the logit; each holds the POD at one severity with the curve's confidence. NaN
            where the data determine no finite slope.

        Raises
        ------
        ValueError
            If a severity is not a number of this sign.
        """
        magnitudes = real_array(severity, "severity") * np.sign(self.severities[0])
        if not ((magnitudes >= 0) & np.isfinite(magnitudes)).all() or (real_array(severity, "severity") >= 1).any():
            raise ValueError(
                f"severity is {severity!r:.200}; expected shares below 1 of the sign of those tested, {self.severities}"
            )
        places = np.log(magnitudes) if self.log else magnitudes
        centre = self.intercept + self.slope * places
        deviation = np.sqrt(
            self.covariance[0, 0] + places * (2 * self.covariance[0, 1] + places * self.covariance[1, 1])
        )
        margin = norm.ppf((1 + self.confidence) / 2) * deviation
        return expit(centre), expit(centre - margin), expit(centre + margin)

    def prediction_interval(self, severity: ArrayLike) -> tuple[Any, Any]:
        """Band in which the curve of a measured campaign should lie, with all that was uncertain in the study.

        Parameters
        ----------
        severity : float or array-like
            Of the sign of the tested severities.

        Returns
        -------
        lowest : float or ndarray
            Quantile of ``replicates`` at each severity; NaN without replicates.
        highest : float or ndarray
            Likewise; the two hold such a curve with the curve's confidence.
        """
        places = real_array(severity, "severity")
        if not self.replicates:
            return np.full(places.shape, np.nan), np.full(places.shape, np.nan)
        tails = (1 - self.confidence) / 2, (1 + self.confidence) / 2
        lowest, highest = np.quantile([one.predict(severity)[0] for one in self.replicates], tails, axis=0)
        return lowest, highest

    @property
    def a90_prediction_interval(self) -> tuple[float, float]:
        """Band in which a90 of a measured campaign should lie, with the curve's confidence; NaN without replicates."""
        if not self.replicates:
            return float("nan"), float("nan")
        tail = (1 - self.confidence) / 2
        found = np.abs([one.a90 for one in self.replicates])
        sign = np.sign(self.severities[0])
        return float(sign * np.quantile(found, tail)), float(sign * np.quantile(found, 1 - tail))

    def severity_at(self, pod: float, confidence: float | None = None) -> float:
        """Severity at which the curve, or a confidence bound of it, reaches a POD.

        Parameters
        ----------
        pod : float
            Probability between 0 and 1.
        confidence : float, optional
            Of the one-sided lower Wald bound of the curve, so that 0.95 gives a severity that is sufficient with this
            confidence, as a90/95 in MIL-HDBK-1823A; 0.05 gives one that is not. By default the curve itself.

        Returns
        -------
        float
            0 or infinite where the bound reaches it at no severity, because the slope is too uncertain; NaN where the
            data determine no finite slope.

        Raises
        ------
        ValueError
            If a probability is not between 0 and 1.
        """
        z = norm.ppf(check_probability(0.5 if confidence is None else confidence, "confidence"))
        offset = self.intercept - logit(check_probability(pod, "pod"))
        if np.isnan(self.slope):
            return float("nan")
        # The bound reaches the level where (offset + slope x)^2 = z^2 (variance at x): a quadratic equation in x.
        (v0, v01), (_, v1) = self.covariance * z**2
        a, b, c = self.slope**2 - v1, self.slope * offset - v01, offset**2 - v0
        if a <= 0:
            magnitude = np.inf if z > 0 else 0.0
        else:
            place = (-b + np.sign(z) * np.sqrt(max(b**2 - a * c, 0.0))) / a
            magnitude = np.exp(place) if self.log else max(place, 0.0)
        return float(np.sign(self.severities[0]) * magnitude)

    def __repr__(self) -> str:
        return f"PODCurve(a50={self.a50:.3g}, a90={self.a90:.3g}, a90_95={self.a90_95:.3g}, log={self.log})"


def pod_curve(
    severities: ArrayLike, n_detected: ArrayLike, n_records: ArrayLike, *, log: bool = True, confidence: float = 0.95
) -> PODCurve:
    """Fit the probability of detection over severity, by maximum likelihood.

    Parameters
    ----------
    severities : array-like of shape (n_severities,)
        All positive (damage) or all negative (strengthening).
    n_detected : array-like of shape (n_severities,)
        Records in alarm. Fractions are allowed, so that serially correlated records can count less.
    n_records : array-like of shape (n_severities,)
        Records evaluated; severities without any are ignored.
    log : bool, default=True
        Whether the logit of the POD is linear in the logarithm of the severity, as it is with 0 where there is no
        damage, rather than in the severity.
    confidence : float, default=0.95
        Of the bounds of the curve.

    Returns
    -------
    PODCurve
        The curve, with a50, a90 and a90/95.

    Raises
    ------
    ValueError
        If counts are impossible, fewer than two severities have records, or the POD does not increase with severity.

    Warns
    -----
    UserWarning
        If the data determine no finite slope, because all records below one severity are missed and all above it
        detected. ``bracket`` then holds the two severities between which a90 lies. If the curve lies clearly outside
        the bounds of some severities (``n_missed``), so that a90 may be wrong.

    Notes
    -----
    Hit/miss analysis of MIL-HDBK-1823A with the logit link. Records at one severity count as independent, and the curve
    as logistic: confidence bounds hold neither serial correlation nor another shape of the curve.

    References
    ----------
    MIL-HDBK-1823A, Nondestructive evaluation system reliability assessment, US Department of Defense, 2009 [MIL09]_.

    Examples
    --------
    >>> from skthermo.studies import pod_curve
    >>> curve = pod_curve([0.1, 0.2, 0.3, 0.4], [3, 12, 19, 20], [20, 20, 20, 20])
    >>> print(f"{curve.a50:.2f} {curve.a90:.2f} {curve.a90_95:.2f}")
    0.17 0.28 0.36
    """
    check_flag(log, "log")
    s, k, n = checked_counts(severities, n_detected, n_records)
    check_probability(confidence, "confidence")
    x, bracket = np.log(np.abs(s)) if log else np.abs(s), bracket_of(s, k / n, 0.9)
    coefficients, covariance = np.full(2, np.nan), np.full((2, 2), np.nan)
    if not k.any() or not (n - k).any() or x[k < n].max() <= x[k > 0].min():
        action = "Test severities in between, with some misses and hits"
        if not k.any():
            action = "Test larger severities, and look whether outliers of the baseline raise the threshold"
        lowest, highest = bracket
        place = f"above {lowest:g}" if np.isnan(highest) else f"between {lowest:g} and {highest:g}"
        warn_user(
            f"the severities {s.tolist()} have POD {(k / n).round(3).tolist()}: no curve of finite slope fits, and a90 "
            f"is {place}. {action}",
            ResultWarning,
            "separated-severities",
        )
    else:
        increases = x[k > 0].max() > x[k < n].min()
        if increases:
            coefficients, covariance = most_likely(x, k, n)
        if not increases or coefficients[1] * np.ptp(x) < FLAT:
            raise ValueError(
                f"the severities {s.tolist()} have POD {(k / n).round(3).tolist()}, which does not increase; expected "
                "one that increases with the magnitude of the severity"
            )
    curve = PODCurve(
        s, k, n, float(coefficients[0]), float(coefficients[1]), covariance, log, float(confidence), bracket
    )
    if curve.n_missed:
        warn_user(
            f"the curve lies outside the bounds of {curve.n_missed} of {len(s)} tested severities. a50, a90 and a90/95 "
            f"may be wrong. Try log={not log}, or test more severities near a90 and fit those alone",
            ResultWarning,
            "poor-curve-fit",
        )
    return curve


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


def bracket_of(severities: Array, pod: Array, level: float) -> tuple[float, float]:
    """Magnitudes of the highest severity with a POD below a level, and of the next one."""
    magnitudes = np.abs(severities)
    below = np.flatnonzero(pod < level)
    if not below.size:
        return 0.0, float(magnitudes[0])
    above = magnitudes[magnitudes > magnitudes[below[-1]]]
    return float(magnitudes[below[-1]]), float(above[0]) if above.size else float("nan")


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


@dataclass(frozen=True, eq=False)
class FamilyRates:
    """Results of one detector for one family and source, with the highest upper bound of its false alarms there."""

    name: str
    source: str
    rows: pd.DataFrame
    false_alarms: float
    confidence: float

    @property
    def tested(self) -> pd.DataFrame:
        """Rows with a severity, which have a place on a curve."""
        return self.rows[self.rows["severity"].notna()]

    @property
    def is_undetected(self) -> bool:
        """Whether no rate is above that bound."""
        return bool((self.rows["rate"] <= self.false_alarms).all())

    def curve(self, log: bool = True) -> PODCurve:
        """Probability of detection over severity, with records as their effective numbers."""
        rows = self.tested
        detected, n_effective = rows["rate"] * rows["n_effective"], rows["n_effective"]
        with self._named():
            return pod_curve(rows["severity"], detected, n_effective, log=log, confidence=self.confidence)

    def on_grid(self, level: float) -> tuple[float, float, float]:
        """Smallest tested severity from which the rate stays at or above a level, and that of its bounds."""
        with self._named():
            mdd, lowest, highest = (
                minimum_detectable_damage(self.tested["severity"], self.tested[rate], level)
                for rate in ("rate", "ci_high", "ci_low")
            )
        return mdd, lowest, highest

    def on_curve(self, level: float) -> tuple[float, float, float]:
        """Severity at which the curve and its bounds reach a level; without a finite slope, NaN and the bracket."""
        severities, rates = self.tested["severity"], self.tested["rate"]
        bracket = float("nan"), *bracket_of(severities.abs().to_numpy(), rates.to_numpy(), level)
        if len(severities) < 2:
            return bracket
        try:
            curve = self.curve()
        except ValueError as error:
            if severities.min() < 0 < severities.max():
                raise
            rare = (
                ". Alarms are as rare as for the healthy structure. Test larger severities, and look whether outliers "
            )
            cause = f"{rare}of the baseline raise the threshold" if self.is_undetected else ""
            warn_user(f"no curve of source {self.source!r} for {error}{cause}", ResultWarning, "no-curve")
            return bracket
        if np.isnan(curve.slope):
            return float("nan"), *bracket_of(curve.severities, curve.n_detected / curve.n_records, level)
        tail = (1 - self.confidence) / 2
        return curve.severity_at(level), curve.severity_at(level, tail), curve.severity_at(level, 1 - tail)

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Begin the text of errors with the family's name."""
        try:
            yield
        except ValueError as error:
            raise ValueError(f"family {self.name!r}: {error}") from error


def families_of(results: pd.DataFrame, confidence: float) -> dict[tuple[Any, ...], FamilyRates]:
    """Families by detector, name and source."""
    healthy = results[results["measure"] == "PFA"].groupby(["detector", "source"])["ci_high"].max()
    damaged = results[(results["measure"] == "POD") & results["family"].notna()]
    return {
        key: FamilyRates(key[1], key[2], rows, float(healthy.get((key[0], key[2]), np.nan)), confidence)
        for key, rows in damaged.groupby(["detector", "family", "source"], sort=False)
    }
