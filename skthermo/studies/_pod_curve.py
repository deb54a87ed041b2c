"""Probability of detection (POD) as a function of severity, and families of scenarios, of which it is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.special import expit, log_expit, logit
from scipy.stats import norm

from skthermo._core.arrays import Array, check_flag, check_probability, is_auto, real_array
from skthermo._core.warnings import warn_each
from skthermo.exceptions import ResultWarning
from skthermo.metrics import minimum_detectable_damage
from skthermo.studies._rates import clopper_pearson


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
        counts = zip(self.n_detected, self.n_records, strict=True)
        bounds = [clopper_pearson(k, n, 1 - 0.01 / len(self.severities)) for k, n in counts]
        lowest, highest = np.transpose(bounds)
        pod = self.predict(self.severities)[0]
        return int(((pod < lowest - 0.03) | (pod > highest + 0.03)).sum())

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
        curves = [one.predict(severity)[0] for one in self.replicates] or [np.full(np.shape(severity), np.nan)]
        lowest, highest = np.quantile(curves, self._tails, axis=0)
        return lowest, highest

    @property
    def a90_prediction_interval(self) -> tuple[float, float]:
        """Band in which a90 of a measured campaign should lie, with the curve's confidence; NaN without replicates."""
        found = np.abs([one.a90 for one in self.replicates] or [np.nan])
        lowest, highest = np.sign(self.severities[0]) * np.quantile(found, self._tails)
        return float(lowest), float(highest)

    @property
    def _tails(self) -> tuple[float, float]:
        return (1 - self.confidence) / 2, (1 + self.confidence) / 2

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
    severities: ArrayLike,
    n_detected: ArrayLike,
    n_records: ArrayLike,
    *,
    log: bool | Literal["auto"] = "auto",
    confidence: float = 0.95,
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
    log : bool or "auto", default="auto"
        Whether the logit of the POD is linear in the logarithm of the severity, so that the POD is 0 where there is no
        damage, or in the severity itself. "auto" takes the likelier of these two laws.
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
    as logistic: confidence bounds hold neither serial correlation nor another shape of the curve. Both laws have two
    parameters. With 20 to 1,000 records at each of three to five severities, a90/95 of the likelier law was above the
    true a90 in 91 to 100 % of the simulated cases, whichever law was true.

    References
    ----------
    MIL-HDBK-1823A, Nondestructive evaluation system reliability assessment, US Department of Defense, 2009 [MIL09]_.

    Examples
    --------
    >>> from skthermo.studies import pod_curve
    >>> curve = pod_curve([0.1, 0.2, 0.3, 0.4], [3, 12, 19, 20], [20, 20, 20, 20])
    >>> print(f"{curve.a50:.2f} {curve.a90:.2f} {curve.a90_95:.2f}")
    0.18 0.27 0.33
    """
    curve, findings = fitted_curve(severities, n_detected, n_records, log=log, confidence=confidence)
    warn_each(findings)
    return curve


def fitted_curve(
    severities: ArrayLike, n_detected: ArrayLike, n_records: ArrayLike, *, log: Any = "auto", confidence: float = 0.95
) -> tuple[PODCurve, list[ResultWarning]]:
    """The curve, and what is doubtful about it."""
    laws = [True, False] if is_auto(log) else [check_flag(log, "log")]
    s, k, n = checked_counts(severities, n_detected, n_records)
    options = {"confidence": check_probability(confidence, "confidence"), "bracket": bracket_of(s, k / n, 0.9)}
    magnitudes, rates = np.abs(s), f"the severities {s.tolist()} have POD {(k / n).round(3).tolist()}"
    if not k.any() or not (n - k).any() or magnitudes[k < n].max() <= magnitudes[k > 0].min():
        nothing = {"intercept": np.nan, "slope": np.nan, "covariance": np.full((2, 2), np.nan), "log": laws[0]}
        curve = PODCurve(s, k, n, **nothing, **options)
        return curve, [ResultWarning(f"{rates}: no curve of finite slope fits, and {_placed(curve)}", "no-curve")]
    fits = {}
    if magnitudes[k > 0].max() > magnitudes[k < n].min():
        fits = {is_log: most_likely(np.log(magnitudes) if is_log else magnitudes, k, n) for is_log in laws}
    law = max(fits, key=lambda is_log: round(fits[is_log][2], 6), default=None)  # both fit two severities
    if law is None or fits[law][0][1] < 1e-6:
        raise ValueError(f"{rates}, which does not increase; expected one that increases with the severity's magnitude")
    curve = PODCurve(s, k, n, *fits[law][0].tolist(), fits[law][1], law, **options)
    if not curve.n_missed:
        return curve, []
    text = (
        f"the curve lies outside the bounds of {curve.n_missed} of {len(s)} tested severities. a50, a90 and a90/95 may "
        "be wrong. Test more severities near a90, and fit those alone"
    )
    return curve, [ResultWarning(text, "no-curve")]


def _placed(curve: PODCurve) -> str:
    """Where a90 is without a slope, and what to test."""
    lowest, highest = curve.bracket
    place = f"above {lowest:g}" if np.isnan(highest) else f"between {lowest:g} and {highest:g}"
    if curve.n_detected.any():
        return f"a90 is {place}. Test severities in between, with some misses and hits"
    return f"a90 is {place}. Test larger severities, and look whether outliers of the baseline raise the threshold"


def checked_counts(severities: ArrayLike, n_detected: ArrayLike, n_records: ArrayLike) -> tuple[Array, Array, Array]:
    """Severities with records, in ascending order of their magnitude, and their counts."""
    names = ("severities", "n_detected", "n_records")
    s, k, n = (real_array(v, name) for v, name in zip((severities, n_detected, n_records), names, strict=True))
    if s.ndim != 1 or not s.shape == k.shape == n.shape:
        raise ValueError(f"{names} have shapes {s.shape}, {k.shape}, {n.shape}; expected vectors of one length")
    if not (np.isfinite(s).all() and ((s > 0).all() or (s < 0).all()) and (s < 1).all()):
        raise ValueError(f"severities are {s.tolist()}; expected shares, all above 0 and below 1, or all negative")
    if not (np.isfinite(n).all() and (k >= 0).all() and (k <= n).all()):
        raise ValueError(f"n_detected is {k.tolist()}, n_records {n.tolist()}; expected 0 <= n_detected <= n_records")
    order = np.argsort(np.abs(s), kind="stable")
    s, k, n = (values[order][n[order] > 0] for values in (s, k, n))
    if len(np.unique(s)) < 2:
        raise ValueError(f"severities {np.unique(s).tolist()} have records; expected at least two severities")
    return s, k, n


def bracket_of(severities: Array, pod: Array, level: float) -> tuple[float, float]:
    """Magnitudes of the highest severity with a POD below a level, and of the next one."""
    order = np.argsort(np.abs(severities), kind="stable")
    magnitudes, below = np.abs(severities)[order], np.flatnonzero(pod[order] < level)
    lowest = float(magnitudes[below[-1]]) if below.size else 0.0
    return lowest, float(magnitudes[magnitudes > lowest].min(initial=np.inf)) if magnitudes[-1] > lowest else np.nan


def most_likely(x: Array, k: Array, n: Array) -> tuple[Array, Array, float]:
    """The most likely intercept and slope by Newton's method, their covariance, and the ln likelihood."""
    centre, width = np.average(x, weights=n), np.ptp(x)
    design = np.column_stack([np.ones_like(x), (x - centre) / width])

    def log_likelihood(b: Array) -> float:
        return float((k * log_expit(design @ b) + (n - k) * log_expit(-design @ b)).sum())

    coefficients, step = np.zeros(2), np.zeros(2)
    for _ in range(100):
        while log_likelihood(coefficients + step) < log_likelihood(coefficients):
            step = step / 2
        coefficients = coefficients + step
        pod = expit(design @ coefficients)
        information, gradient = (design.T * (n * pod * (1 - pod))) @ design, design.T @ (k - n * pod)
        step = np.linalg.solve(information, gradient)
        if gradient @ step < 1e-10:  # units of ln likelihood
            break
    scaled = np.array([[1.0, -centre / width], [0.0, 1 / width]])
    return scaled @ coefficients, scaled @ np.linalg.inv(information) @ scaled.T, log_likelihood(coefficients)


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

    def curve(self, log: bool | Literal["auto"] = "auto") -> tuple[PODCurve, list[ResultWarning]]:
        """Probability of detection over severity, with records as their effective numbers, and what is doubtful."""
        rows = self.tested
        detected, n_effective = rows["rate"] * rows["n_effective"], rows["n_effective"]
        try:
            return fitted_curve(rows["severity"], detected, n_effective, log=log, confidence=self.confidence)
        except ValueError as error:
            raise ValueError(f"family {self.name!r}: {error}") from error

    def on_grid(self, level: float) -> tuple[float, ...]:
        """Smallest tested severity from which the rate stays at or above a level, and that of its bounds."""
        severities, rates = self.tested["severity"], [self.tested[name] for name in ("rate", "ci_high", "ci_low")]
        try:
            return tuple(minimum_detectable_damage(severities, one, level) for one in rates)
        except ValueError as error:
            raise ValueError(f"family {self.name!r}: {error}") from error

    def on_curve(self, level: float) -> tuple[tuple[float, ...], list[ResultWarning]]:
        """Severity at which the curve and its bounds reach a level; without a finite slope, NaN and the bracket."""
        severities, rates = self.tested["severity"].to_numpy(), self.tested["rate"].to_numpy()
        bracket = float("nan"), *bracket_of(severities, rates, level)
        if len(severities) < 2:
            return bracket, []
        try:
            curve, findings = self.curve()
        except ValueError as error:
            if severities.min() < 0 < severities.max():
                raise
            action = ". Test larger severities, and look whether outliers of the baseline raise the threshold"
            text = f"no curve of source {self.source!r} for {error}{action if self.is_undetected else ''}"
            return bracket, [ResultWarning(text, "no-curve")]
        if np.isnan(curve.slope):
            return bracket, findings
        tail = (1 - self.confidence) / 2
        return tuple(curve.severity_at(level, one) for one in (None, tail, 1 - tail)), findings


def families_of(results: pd.DataFrame, confidence: float) -> dict[tuple[Any, ...], FamilyRates]:
    """Families by detector, name and source."""
    healthy = results[results["measure"] == "PFA"].groupby(["detector", "source"])["ci_high"].max()
    damaged = results[(results["measure"] == "POD") & results["family"].notna()]
    return {
        key: FamilyRates(key[1], key[2], rows, float(healthy.get((key[0], key[2]), np.nan)), confidence)
        for key, rows in damaged.groupby(["detector", "family", "source"], sort=False)
    }
