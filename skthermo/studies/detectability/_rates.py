"""Rates of alarms over serially dependent records, with confidence intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import beta, t

from skthermo._core.arrays import Array
from skthermo._core.frames import Table, correlation_times, row_times, time_of
from skthermo.studies._scenarios import BaseScenario

BLOCK = 10  # length of a block, in correlation times
LEAST_FREEDOM = 10  # fewest degrees of freedom of the variance; blocks are shortened to reach them
FEW_ALARMS = 10  # minimum number of alarms, and of records without one, to estimate their variance


@dataclass(frozen=True)
class Rate:
    """Rate of alarms over evaluated records (NaN without any), its bounds, and the number of independent records with
    the same error."""

    rate: float
    ci_low: float
    ci_high: float
    n_alarms: int
    n_records: int
    n_effective: float


def rate_of(decisions: Array, confidence: float = 0.95, whole_repeats: bool = False) -> Rate:
    """Rate of negative decisions, with Clopper-Pearson bounds of the effective number of records.

    Decisions, (n_repeats, n_records), are of the same records with different noise, in order of time, and NaN where
    there is none. With ``whole_repeats``, all records of a repeat depend on each other.
    """
    n_alarms, n_records = int((decisions < 0).sum()), int(np.count_nonzero(~np.isnan(decisions)))
    if not n_records:
        return Rate(float("nan"), 0.0, 1.0, 0, 0, 0.0)
    rate = n_alarms / n_records
    if np.array_equal(decisions, decisions[[0] * len(decisions)], equal_nan=True):
        decisions = decisions[:1]  # repeats without noise count once
    n_effective = _n_effective(decisions, confidence, whole_repeats and len(decisions) > 1)
    return Rate(rate, *clopper_pearson(rate * n_effective, n_effective, confidence), n_alarms, n_records, n_effective)


def clopper_pearson(n_alarms: float, n_records: float, confidence: float) -> tuple[float, float]:
    """Exact bounds of a binomial probability, by quantiles of the beta distribution, also for fractions."""
    tail = (1 - confidence) / 2
    lowest = beta.ppf(tail, n_alarms, n_records - n_alarms + 1) if n_alarms > 0 else 0.0
    highest = beta.isf(tail, n_alarms + 1, n_records - n_alarms) if n_alarms < n_records else 1.0
    return float(lowest), float(highest)


def _n_effective(decisions: Array, confidence: float, whole_repeats: bool) -> float:
    """Number of records over the design effect, for an interval whose variance is estimated (Korn & Graubard 1998)."""
    alarms, evaluated = (decisions < 0).astype(float), ~np.isnan(decisions)
    scatter, n_records = _scatter(decisions), evaluated.sum()
    starts = np.zeros(1, dtype=int) if whole_repeats else _blocks(scatter)
    n_repeats, rate, effects = len(decisions), alarms.sum() / n_records, [1.0]
    if 0 < rate < 1:
        effects.append(_variance_of_mean(alarms, evaluated, starts) / (rate * (1 - rate) / n_records))
    if min(rate, 1 - rate) * n_records < FEW_ALARMS:  # the decisions are correlated at least as much as their signs
        variance = np.nanmean(scatter**2)
        if variance > 0:
            effects.append(_variance_of_mean(np.nan_to_num(scatter), evaluated, starts) / (variance / n_records))
    freedom = max((n_repeats - 1) * len(starts) if n_repeats > 1 else len(starts) - 1, 1)
    tail = (1 - confidence) / 2
    return float(n_records / max(effects) * min((t.isf(tail, n_records - 1) / t.isf(tail, freedom)) ** 2, 1.0))


def _blocks(scatter: Array) -> NDArray[np.intp]:
    """First records of contiguous blocks of several correlation times, whose sums in different repeats are
    independent."""
    n_repeats, n_records = scatter.shape
    time = correlation_times(scatter.T).mean()
    number = max(n_records / (BLOCK * time), LEAST_FREEDOM / max(n_repeats - 1, 1) + (n_repeats == 1))
    number = int(np.clip(np.ceil(number), 1, n_records))
    return np.linspace(0, n_records, number, endpoint=False).astype(int)


def _variance_of_mean(values: Array, evaluated: NDArray[np.bool_], starts: NDArray[np.intp]) -> Array:
    """Variance of the mean of evaluated values, (n_repeats, n_records): between repeats within blocks or, of a single
    repeat, between blocks."""
    sums = np.add.reduceat(np.where(evaluated, values, 0.0), starts, axis=1)
    counts = np.add.reduceat(evaluated.astype(float), starts, axis=1)
    axis = 0 if len(sums) > 1 else 1
    number = sums.shape[axis]
    means = sums.sum(axis=axis, keepdims=True) / np.maximum(counts.sum(axis=axis, keepdims=True), 1)
    return number / max(number - 1, 1) * ((sums - means * counts) ** 2).sum() / counts.sum() ** 2


def _scatter(decisions: Array) -> Array:
    """Decisions less their mean: over the repeats, or over the records of a single one."""
    counts = np.maximum((~np.isnan(decisions)).sum(axis=0 if len(decisions) > 1 else 1, keepdims=True), 1)
    return decisions - np.nansum(decisions, axis=0 if len(decisions) > 1 else 1, keepdims=True) / counts


@dataclass(frozen=True, eq=False)
class EvaluatedRecords:
    """What a detector makes of the records of one scenario and source: decisions in each repeat, (n_repeats,
    n_records), NaN where there is none, and ``rows`` with the times of the records."""

    detector: str
    scenario: BaseScenario
    source: str
    rows: Table
    decisions: Array

    def from_onset(self) -> tuple[Array, Array]:
        """Decisions from the onset of the damage on, in order of time, and the times since then."""
        times, onset = row_times(self.rows), self.scenario.onset
        start = times.min() if onset is None else time_of(self.rows, onset, "onset")
        order = np.argsort(times, kind="stable")
        order = order[times[order] >= start]
        return self.decisions[:, order], times[order] - start

    def summary(self, confidence: float) -> dict[str, Any]:
        """Rates, bounds and time to detection, from the onset of the damage on."""
        scenario, (decisions, waits) = self.scenario, self.from_onset()
        rate = rate_of(decisions, confidence, whole_repeats=scenario.n_draws > 1)
        if not rate.n_records:
            raise ValueError(
                f"none of {len(self.rows)} records of scenario {scenario.name!r}, source {self.source!r}, can "
                "be evaluated: they lack what the detector needs, or are before the onset; expected complete records "
                "after the onset"
            )
        pi_low, pi_high = prediction_interval(decisions, confidence)
        return {
            "detector": self.detector,
            "scenario": scenario.name,
            "family": scenario.family,
            "severity": scenario.severity,
            "source": self.source,
            "measure": "PFA" if scenario.is_healthy else "POD",
            "rate": rate.rate,
            "ci_low": rate.ci_low,
            "ci_high": rate.ci_high,
            "pi_low": pi_low,
            "pi_high": pi_high,
            "n_alarms": rate.n_alarms,
            "n_records": rate.n_records,
            "n_not_evaluated": decisions.size - rate.n_records,
            "n_effective": rate.n_effective,
            "n_repeats": len(decisions),
            "time_to_detection": _mean_wait(decisions < 0, waits, self.rows),
            "error": "",
        }


def prediction_interval(decisions: Array, confidence: float) -> tuple[float, float]:
    """Range that holds the rate of one more repeat with this probability, or that of all repeats if they are too few.

    Of n rates, the k-th smallest exceeds that of one more repeat with probability k / (n + 1). One rate has no range.
    """
    evaluated = (~np.isnan(decisions)).sum(axis=1)
    rates = (decisions < 0).sum(axis=1)[evaluated > 0] / evaluated[evaluated > 0]
    if len(rates) < 2:
        return float("nan"), float("nan")
    lowest, highest = np.quantile(rates, [(1 - confidence) / 2, (1 + confidence) / 2], method="weibull")
    return float(lowest), float(highest)


def _mean_wait(alarms: NDArray[np.bool_], waits: Array, rows: Table) -> Any:
    """Mean time to the first alarm over the repeats that have one, in records or as a Timedelta."""
    detected = alarms[alarms.any(axis=1)].argmax(axis=1)
    if isinstance(getattr(rows, "index", None), pd.DatetimeIndex):
        return pd.Timedelta(int(waits[detected].mean()), "ns") if detected.size else pd.NaT
    return float(detected.mean()) if detected.size else float("nan")


def rates_by_scenario(
    decisions: Mapping[tuple[str, ...], Array], scenarios: Sequence[BaseScenario], T: Table
) -> dict[tuple[str, str], float]:
    """Rates of alarms of one repeat from the onset of the damage on, by detector and scenario."""
    by_name, rates = {one.name: one for one in scenarios}, {}
    for (name, scenario, source), values in decisions.items():
        kept = EvaluatedRecords(name, by_name[scenario], source, T, values[np.newaxis]).from_onset()[0]
        rates[name, scenario] = float((kept < 0).sum() / max(np.count_nonzero(~np.isnan(kept)), 1))
    return rates
