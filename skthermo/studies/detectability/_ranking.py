"""Detectors of a study in the order of what they find."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from scipy.stats import t

from skthermo._core.arrays import Array
from skthermo.studies.detectability._pod_curve import families_of
from skthermo.studies.detectability._rates import EvaluatedRecords

LEVEL = 0.9  # probability of detection that counts as reliable


@dataclass(frozen=True, eq=False)
class Contender:
    """One detector's decisions on records of one source: of the healthy structure, of every damaged scenario, and of
    healthy records with other noise, by which a threshold is moved; each (n_repeats, n_records), or None."""

    healthy: Array
    damaged: Sequence[Array]
    calibration: Array | None

    def pod(self, limit: float | None = None, left_out: int | None = None) -> float:
        """Mean probability of detection over the damaged scenarios, without one of the repeats if asked.

        With a limit, the threshold is moved so that as many of the calibration's records are alarms; NaN without any.
        """
        threshold = 0.0 if limit is None else self._threshold(limit, left_out)
        parts = [_without(decisions, left_out) for decisions in self.damaged]
        shares = [(part < threshold).sum() / np.count_nonzero(~np.isnan(part)) for part in parts]
        return float("nan") if np.isnan(threshold) else float(np.mean(shares))

    def jackknife(self, limit: float | None = None) -> Array:
        """Pseudo-values of that probability, whose mean has its error and that of the moved threshold.

        Empty where there is one repeat, or repeats differ in number.
        """
        n = len(self.damaged[0])
        if n < 2 or any(len(one) != n for one in self.damaged):
            return np.empty(0)
        return n * self.pod(limit) - (n - 1) * np.array([self.pod(limit, number) for number in range(n)])

    def has_noise(self) -> bool:
        """Whether any decision differs from repeat to repeat."""
        return any(not np.array_equal(one, one[[0] * len(one)], equal_nan=True) for one in self.damaged)

    def auc(self) -> float:
        """Area under the ROC curve, the chance that a damaged record is further off than a healthy one; mean over the
        damaged scenarios."""
        healthy = np.sort(self.healthy[~np.isnan(self.healthy)])
        areas = []
        for decisions in self.damaged:
            evaluated = decisions[~np.isnan(decisions)]
            below = (healthy.searchsorted(evaluated, "left") + healthy.searchsorted(evaluated, "right")) / 2
            areas.append(1 - below.mean() / len(healthy))
        return float(np.mean(areas))

    def _threshold(self, limit: float, left_out: int | None) -> float:
        """Decision below which as many of the calibration's records lie as the limit allows."""
        if self.calibration is None:
            return float("nan")
        known = _without(self.calibration, left_out)
        known = known[~np.isnan(known)]
        place = int(limit * known.size + 1e-9)  # of products such as 0.29 * 100
        return float(np.partition(known, place)[place]) if known.size else float("nan")


def _without(decisions: Array, left_out: int | None) -> Array:
    return decisions if left_out is None else np.delete(decisions, left_out, axis=0)


def rank(
    records: Sequence[EvaluatedRecords],
    rows: pd.DataFrame,
    calibration: Mapping[str, Array],
    errors: Mapping[str, str],
    limit: float,
    confidence: float,
    by: Literal["pod", "pod_at_equal_pfa"],
) -> pd.DataFrame:
    """One row for each detector, best first, from its records of one source and their rows in the results.

    By NaN of the moved threshold, which measured records have, the order is that of the probability of detection.
    """
    names = list(dict.fromkeys(one.detector for one in records))
    contenders = {name: _contender(name, records, calibration.get(name)) for name in names}
    families = {key[:2]: family for key, family in families_of(rows, confidence).items()}
    table = pd.DataFrame.from_dict(
        {
            name: _rates(rows[rows["detector"] == name], limit)
            | {"pod_at_equal_pfa": contender.pod(limit), "auc": contender.auc()}
            | _by_family(name, rows[rows["detector"] == name], families)
            for name, contender in contenders.items()
        },
        orient="index",
    )
    table = table.infer_objects().rename_axis("detector")
    table["beyond"] = table["false_alarms"].where(~table["within_limit"], 0.0)
    keys = ["within_limit", "beyond", by, "auc", "false_alarms", "detector"]
    table = table.sort_values(keys, ascending=[False, True, False, False, True, True]).drop(columns="beyond")
    pseudo = {name: one.jackknife(None if by == "pod" else limit) for name, one in contenders.items()}
    table["pod_deficit"] = table[by].iloc[0] - table[by]
    margin = [_margin(pseudo[table.index[0]], pseudo[name], confidence, len(names) - 1) for name in table.index]
    if not any(one.has_noise() for one in contenders.values()):
        margin = [np.nan] * len(names)
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


def _contender(name: str, records: Sequence[EvaluatedRecords], calibration: Array | None) -> Contender:
    mine = [one for one in records if one.detector == name]
    healthy = np.hstack([one.decisions.ravel() for one in mine if one.scenario.is_healthy])
    return Contender(healthy, [one.from_onset()[0] for one in mine if not one.scenario.is_healthy], calibration)


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


def _by_family(name: str, rows: pd.DataFrame, families: Mapping[Any, Any]) -> dict[str, float]:
    """Probability of detection of each family, and its smallest severity that is found reliably."""
    found = {}
    for family, some in rows[(rows["measure"] == "POD") & rows["family"].notna()].groupby("family", sort=False):
        rates = some[["rate", "ci_low", "ci_high"]].mean()
        found |= dict(zip(with_bounds(f"pod {family}", " "), rates, strict=True))
        try:
            found[f"mdd {family}"] = families[name, family].on_grid(LEVEL)[0]
        except (KeyError, ValueError):  # no severity, or one twice, or of both signs
            found[f"mdd {family}"] = np.nan
    return found


def _margin(best: Array, other: Array, confidence: float, n_comparisons: int) -> float:
    """Half the width of the interval of a mean difference of pseudo-values, one of several that hold together."""
    n = len(best)
    if n < 2 or len(other) != n:
        return float("nan")
    tail = (1 - confidence) / 2 / max(n_comparisons, 1)
    return float(t.isf(tail, n - 1) * (best - other).std(ddof=1) / np.sqrt(n))


def in_words(table: pd.DataFrame, limit: float, confidence: float) -> str:
    """A ranking in sentences."""
    failed, ranked = table[table["error"] != ""], table[table["error"] == ""]
    quiet, loud = ranked[ranked["within_limit"]], ranked[~ranked["within_limit"]]
    best = (quiet if len(quiet) else ranked).iloc[0]
    lines = [
        f"{best.name!r} detects {best['pod']:.1%} of the damaged records at a false-alarm rate of "
        f"{best['false_alarms']:.1%}."
    ]
    if not len(quiet):
        lines = [f"All false-alarm rates exceed the limit of {limit:.1%}. With the lowest one, {lines[0]}"]
    behind = quiet.drop(index=best.name, errors="ignore")
    if len(behind) and behind["pod_deficit_ci_low"].isna().all():
        lines.append("One repeat does not show which detectors are significantly worse; expected two or more.")
    else:
        is_worse = behind["significantly_worse"]
        for text, some in (("Not significantly worse", behind[~is_worse]), ("Significantly worse", behind[is_worse])):
            rates = [f"{name!r} ({row['pod']:.1%} at {row['false_alarms']:.1%})" for name, row in some.iterrows()]
            lines += [f"{text} at {confidence:.0%} confidence: {', '.join(rates)}."] if rates else []
        if len(behind):
            lines.append(
                "These comparisons include noise only: another year, baseline or FE model may change the order."
            )
    if len(quiet):
        shares = [f"{name!r} ({row['false_alarms']:.1%})" for name, row in loud.iterrows()]
        lines += [f"False-alarm rates above the limit of {limit:.1%}: {', '.join(shares)}."] if shares else []
    not_evaluated = ranked.loc[ranked["not_evaluated"] > 0, "not_evaluated"]
    shares = [f"{name!r} {share:.1%}" for name, share in not_evaluated.items()]
    lines += [f"Records not evaluated (neither healthy nor damaged): {', '.join(shares)}."] if shares else []
    lines += [f"Stopped by an error: {name!r} ({row['error']})." for name, row in failed.iterrows()]
    return "\n".join(lines)
