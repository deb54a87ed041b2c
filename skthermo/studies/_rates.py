"""Rates of alarms over serially dependent records, with confidence intervals, and detectors in the order of rates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import beta, mannwhitneyu, t

from skthermo._core.arrays import Array
from skthermo._core.frames import Table, correlation_times, row_times, time_of
from skthermo.studies._scenarios import BaseScenario


def rate_of(decisions: Array, confidence: float = 0.95, whole_repeats: bool = False) -> dict[str, Any]:
    """Rate of negative decisions (NaN without any), with Clopper-Pearson bounds of the effective number of records, the
    range of one more repeat, and counts, among them the number of independent records with the same error.

    Decisions, (n_repeats, n_records), are of the same records with different noise, in order of time, and NaN where
    there is none. With ``whole_repeats``, all records of a repeat depend on each other.
    """
    n_alarms, n_records = int((decisions < 0).sum()), int(np.count_nonzero(~np.isnan(decisions)))
    rate, n_effective = n_alarms / n_records if n_records else float("nan"), 0.0
    if n_records:
        once = 1 if is_constant(decisions) else len(decisions)  # repeats without noise count once
        n_effective = _n_effective(decisions[:once], confidence, whole_repeats and once > 1)
    bounds = clopper_pearson(np.nan_to_num(rate) * n_effective, n_effective, confidence)
    return {
        "rate": rate,
        **dict(zip(("ci_low", "ci_high"), bounds, strict=True)),
        **dict(zip(("pi_low", "pi_high"), prediction_interval(decisions, confidence), strict=True)),
        "n_alarms": n_alarms,
        "n_records": n_records,
        "n_not_evaluated": decisions.size - n_records,
        "n_effective": n_effective,
        "n_repeats": len(decisions),
    }


def is_constant(decisions: Array) -> bool:
    """Whether all repeats have the same decisions."""
    return np.array_equal(decisions, decisions[[0] * len(decisions)], equal_nan=True)


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
    if min(rate, 1 - rate) * n_records < 10:  # too few; the decisions are correlated at least as much as their signs
        variance = np.nanmean(scatter**2)
        if variance > 0:
            effects.append(_variance_of_mean(np.nan_to_num(scatter), evaluated, starts) / (variance / n_records))
    freedom = max((n_repeats - 1) * len(starts) if n_repeats > 1 else len(starts) - 1, 1)
    tail = (1 - confidence) / 2
    return float(n_records / max(effects) * min((t.isf(tail, n_records - 1) / t.isf(tail, freedom)) ** 2, 1.0))


def _blocks(scatter: Array, *, length: int = 10, least_freedom: int = 10) -> NDArray[np.intp]:
    """First records of contiguous blocks of several correlation times, whose sums in different repeats are
    independent; they are shortened until the variance of the sums has its least degrees of freedom."""
    n_repeats, n_records = scatter.shape
    time = correlation_times(scatter.T).mean()
    number = max(n_records / (length * time), least_freedom / max(n_repeats - 1, 1) + (n_repeats == 1))
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
        if not rate["n_records"]:
            raise ValueError(
                f"none of {len(self.rows)} records of scenario {scenario.name!r}, source {self.source!r}, can "
                "be evaluated: they lack what the detector needs, or are before the onset; expected complete records "
                "after the onset"
            )
        return {
            "detector": self.detector,
            "scenario": scenario.name,
            "family": scenario.family,
            "severity": scenario.severity,
            "source": self.source,
            "measure": "PFA" if scenario.is_healthy else "POD",
            **rate,
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


def evaluated(
    detector: str, decisions: Mapping[Any, Array], indices: Mapping[Any, pd.Series], scenarios: Sequence[BaseScenario]
) -> list[EvaluatedRecords]:
    """What a detector has evaluated, in the order of the scenarios."""
    return [
        EvaluatedRecords(detector, one, source, indices[key], decisions[key])
        for one in scenarios
        for source in ("simulated", "reference")
        if (key := (detector, one.name, source)) in decisions
    ]


def pod_of(damaged: Sequence[Array], calibration: Array, limit: float | None = None) -> float:
    """Mean probability of detection over damaged scenarios, each (n_repeats, n_records).

    With a limit, the threshold is moved so that as many records of the calibration are alarms; NaN without any.
    """
    threshold, known = 0.0, calibration[~np.isnan(calibration)]
    if limit is not None:
        place = int(limit * known.size + 1e-9)  # of products such as 0.29 * 100
        threshold = float(np.partition(known, place)[place]) if known.size else float("nan")
    shares = [(part < threshold).sum() / np.count_nonzero(~np.isnan(part)) for part in damaged]
    return float("nan") if np.isnan(threshold) else float(np.mean(shares))


def jackknife(damaged: Sequence[Array], calibration: Array, limit: float | None = None) -> Array:
    """Pseudo-values of that probability, whose mean has its error and that of the moved threshold.

    Empty where there is one repeat, or repeats differ in number.
    """
    n = len(damaged[0])
    if n < 2 or any(len(one) != n for one in damaged):
        return np.empty(0)
    whole = pod_of(damaged, calibration, limit)
    without = ([np.delete(one, number, axis=0) for one in (calibration, *damaged)] for number in range(n))
    return n * whole - (n - 1) * np.array([pod_of(others, known, limit) for known, *others in without])


def area_under_curve(healthy: Array, damaged: Sequence[Array]) -> float:
    """Area under the ROC curve, the chance that a damaged record is further off than a healthy one; mean over the
    damaged scenarios."""
    healthy = healthy[~np.isnan(healthy)].astype(float)
    known = [one[~np.isnan(one)] for one in damaged]
    chances = [mannwhitneyu(healthy, one, method="asymptotic").statistic / len(one) for one in known]
    return float(np.mean(chances)) / len(healthy)


def rank(
    records: Sequence[EvaluatedRecords],
    rows: pd.DataFrame,
    families: Mapping[Any, Any],
    calibration: Mapping[str, Array],
    errors: Mapping[str, str],
    limit: float,
    confidence: float,
    by: Literal["pod", "pod_at_equal_pfa"],
) -> pd.DataFrame:
    """One row for each detector, best first, from its records of one source, their rows in the results, and families.

    By NaN of the moved threshold, which measured records have, the order is that of the probability of detection.
    """
    names = list(dict.fromkeys(one.detector for one in records))
    found, pseudo, varies = {}, {}, False
    for name in names:
        mine = [one for one in records if one.detector == name]
        healthy = np.hstack([one.decisions.ravel() for one in mine if one.scenario.is_healthy])
        damaged = [one.from_onset()[0] for one in mine if not one.scenario.is_healthy]
        moving = calibration.get(name, np.empty((len(damaged[0]), 0)))
        found[name] = _rates(rows[rows["detector"] == name], limit)
        found[name] |= {"pod_at_equal_pfa": pod_of(damaged, moving, limit), "auc": area_under_curve(healthy, damaged)}
        found[name] |= _by_family({family: one for (detector, family), one in families.items() if detector == name})
        pseudo[name] = jackknife(damaged, moving, None if by == "pod" else limit)
        varies |= not all(map(is_constant, damaged))
    table = pd.DataFrame.from_dict(found, orient="index")
    table = table.infer_objects().rename_axis("detector")
    table["beyond"] = table["false_alarms"].where(~table["within_limit"], 0.0)
    keys = ["within_limit", "beyond", by, "auc", "false_alarms", "detector"]
    table = table.sort_values(keys, ascending=[False, True, False, False, True, True]).drop(columns="beyond")
    table["pod_deficit"] = table[by].iloc[0] - table[by]
    margin = [_margin(pseudo[table.index[0]], pseudo[name], confidence, len(names) - 1) for name in table.index]
    margin = margin if varies else [np.nan] * len(names)
    table["pod_deficit_ci_low"] = table["pod_deficit"] - margin
    table["pod_deficit_ci_high"] = table["pod_deficit"] + margin
    table["significantly_worse"] = table["pod_deficit_ci_low"] > 0
    first = [*with_bounds("false_alarms"), "within_limit", *with_bounds("pod"), "pod_at_equal_pfa"]
    first += [*with_bounds("pod_deficit"), "significantly_worse", "auc", "time_to_detection", "not_evaluated"]
    table = table[[*first, *(name for name in table if name not in first)]].assign(error="")
    failed = {"within_limit": False, "significantly_worse": False, "error": list(errors.values())}
    return pd.concat([table, pd.DataFrame(failed, index=list(errors))]).rename_axis("detector") if errors else table


def with_bounds(name: str, before: str = "_") -> list[str]:
    """Columns of a rate and its bounds."""
    return [name, f"{name}{before}ci_low", f"{name}{before}ci_high"]


def _rates(rows: pd.DataFrame, limit: float) -> dict[str, Any]:
    """Means over the scenarios; means of bounds hold however much the scenarios have in common."""
    means = rows.groupby("measure")[["rate", "ci_low", "ci_high"]].mean()
    waits = rows.loc[rows["measure"] == "POD", "time_to_detection"].tolist()
    is_known = len({type(wait) for wait in waits}) == 1 and not any(pd.isna(wait) for wait in waits)
    return {
        **dict(zip(with_bounds("false_alarms"), means.loc["PFA"], strict=True)),
        "within_limit": bool(means.loc["PFA", "ci_low"] <= limit),
        **dict(zip(with_bounds("pod"), means.loc["POD"], strict=True)),
        "time_to_detection": pd.Series(waits).mean() if is_known else np.nan,
        "not_evaluated": rows["n_not_evaluated"].sum() / (rows["n_not_evaluated"] + rows["n_records"]).sum(),
    }


def _by_family(families: Mapping[str, Any]) -> dict[str, float]:
    """Probability of detection of each family, and its smallest severity that is found reliably."""
    found = {}
    for name, family in families.items():
        rates = family.rows[["rate", "ci_low", "ci_high"]].mean()
        found |= dict(zip(with_bounds(f"pod {name}", " "), rates, strict=True))
        try:
            found[f"mdd {name}"] = family.on_grid(0.9)[0]
        except ValueError:  # no severity, or one twice, or of both signs
            found[f"mdd {name}"] = np.nan
    return found


def _margin(best: Array, other: Array, confidence: float, n_comparisons: int) -> float:
    """Half the width of the interval of a mean difference of pseudo-values, one of several that hold together.

    Two differences may lie near each other by chance, so that an interval of theirs says next to nothing.
    """
    n = len(best)
    if n < 3 or len(other) != n:
        return float("nan")
    tail = (1 - confidence) / 2 / max(n_comparisons, 1)
    return float(t.isf(tail, n - 1) * (best - other).std(ddof=1) / np.sqrt(n))


def in_words(table: pd.DataFrame, limit: float, confidence: float) -> str:
    """A ranking in sentences."""
    failed, ranked = table[table["error"] != ""], table[table["error"] == ""]
    quiet, loud = ranked[ranked["within_limit"]], ranked[~ranked["within_limit"]]
    best = (quiet if len(quiet) else ranked).iloc[0]

    def named(text: str, rows: pd.DataFrame, form: str) -> list[str]:
        found = [f"{name!r} {form.format(**row)}" for name, row in rows.iterrows()]
        return [f"{text}: {', '.join(found)}."] if found else []

    text = f"{best.name!r} detects {best['pod']:.1%} of the damaged records at a false-alarm rate of"
    lines = [f"{text} {best['false_alarms']:.1%}."]
    if not len(quiet):
        lines = [f"All false-alarm rates exceed the limit of {limit:.1%}. With the lowest one, {lines[0]}"]
    behind, both = quiet.drop(index=best.name, errors="ignore"), "({pod:.1%} at {false_alarms:.1%})"
    if len(behind) and behind["pod_deficit_ci_low"].isna().all():
        lines.append("Fewer than three repeats do not show which detectors are significantly worse; expected more.")
    elif len(behind):
        is_worse = behind["significantly_worse"]
        lines += named(f"Not significantly worse at {confidence:.0%} confidence", behind[~is_worse], both)
        lines += named(f"Significantly worse at {confidence:.0%} confidence", behind[is_worse], both)
        lines.append("These comparisons include noise only: another year, baseline or FE model may change the order.")
    if len(quiet):
        lines += named(f"False-alarm rates above the limit of {limit:.1%}", loud, "({false_alarms:.1%})")
    silent = ranked[ranked["not_evaluated"] > 0]
    lines += named("Records not evaluated (neither healthy nor damaged)", silent, "{not_evaluated:.1%}")
    return "\n".join(lines + [f"Stopped by an error: {name!r} ({text})." for name, text in failed["error"].items()])
