"""The page on a study: what its model learned, which damage its detector finds, and which detector is recommended."""

from __future__ import annotations

import copy
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from skthermo._core.arrays import Array, as_floats, spread_evenly
from skthermo._core.estimators import last_step
from skthermo._core.frames import column_names
from skthermo._core.text import period_text
from skthermo._core.warnings import collected
from skthermo.detection import MahalanobisDetector
from skthermo.fem import Structure
from skthermo.metrics import minimum_detectable_damage
from skthermo.plotting import PODCurveDisplay
from skthermo.reporting._drawings import Values, draw, draw_damage_indices, draw_groups, draw_mode, identified_facts
from skthermo.reporting._page import Html, Row, rows_of, settings_of, versions
from skthermo.studies import (
    DetectabilityStudy,
    IdentifiedDamage,
    PODCurve,
    ProgressiveDamage,
    Scenario,
    UncertainDamage,
)
from skthermo.surrogate import DataInformedFEM

RELIABLE = 0.9  # share of records in alarm from which on damage counts as detected reliably
State: TypeAlias = Scenario | ProgressiveDamage | UncertainDamage


def study_facts(
    study: DetectabilityStudy,
    identified: IdentifiedDamage | None,
    structure: Structure | None,
    detector: str | None,
    max_false_alarms: float,
) -> dict[str, Any]:
    """What the template of the page on a study is given."""
    choice = None
    if study.results_["detector"].nunique() > 1:
        choice = Choice.made(study, detector, max_false_alarms)
        study = choice.only()
    elif detector is not None:
        study.detector_name(detector)
    findings, results = findings_of(study), study.results_
    system = study.detectors_[study.detector_name()]
    parts = {"model": study.fem, "alarm system": system, "study": study}
    warned = [*getattr(study, "warnings_", [])]
    warned += [f"Identified damage: {text}" for text in ([] if identified is None else identified.warnings())]
    T, F = training_tables(study.fem)
    measured, predicted, temperature = over_temperature(study.fem, T, F)
    families = {found.family: found for found in findings}
    return {
        "written": pd.Timestamp.now(),
        "study": study,
        "choice": choice,
        "identified": None if identified is None else identified_facts(identified),
        "n_states": results["scenario"].nunique(),
        "n_repeats": int(results["n_repeats"].max()),
        "level": RELIABLE,
        "confidence": study.confidence_,
        "has_bands": study.uncertainty_ is not None,
        "families": {name: families.get(str(name)) for name in with_severities(results)["family"].unique()},
        "is_distance": isinstance(last_step(system), MahalanobisDetector),
        "records": records_of(T, F),
        "weather": study.indices_[next(key for key in study.indices_ if key[2] == "simulated")].index,
        "agreement": agreement(results),
        "draw": {one.__name__: one for one in (draw_curve, draw_damage_indices, draw_groups, draw_mode)},
        "structure": structure,
        "groups": [] if structure is None else [name for name in families if name in structure.groups],
        "measured": F,
        "over_temperature": {"measured": measured, "predicted": predicted, "temperature": temperature},
        "indices": indices_of(study, findings),
        "settings": settings_of(parts, but=("study: fem", "study: detectors", "study: scenarios")),
        "versions": versions(),
        "warned": warned,
        **alarms(study),
    }


def alarms(study: DetectabilityStudy) -> dict[str, Any]:
    """Rates of all scenarios, and how many records were evaluated."""
    scenarios = {scenario.name: scenario for scenario in study.scenarios_}
    unknown = {key: index.isna() for key, index in study.indices_.items()}
    simulated = [is_unknown for (*_, source), is_unknown in unknown.items() if source == "simulated"]
    states = [
        {
            **row,
            "change": change_of(scenarios.get(row["scenario"])),
            "unknown": float(unknown[row["detector"], row["scenario"], row["source"]].mean()),
        }
        for row in rows_of(study.results_)
    ]
    by_model = [state for state in states if state["source"] == "simulated"]
    damaged = [state for state in by_model if state["measure"] == "POD"]
    missed = [state for state in damaged if state["rate"] < RELIABLE]
    return {
        "states": states,
        "healthy": [state for state in by_model if state["measure"] == "PFA"],
        "damaged": damaged,
        "missed": sorted(missed, key=lambda state: state["rate"]),
        "n_not_evaluated": int(sum(is_unknown.sum() for is_unknown in simulated)),
        "n_simulated": sum(len(is_unknown) for is_unknown in simulated),
    }


def change_of(scenario: State | None) -> Row | None:
    """What a scenario changes, and from when until when."""
    if scenario is None:
        return None
    is_uncertain = hasattr(scenario, "draws")
    damage = scenario.draws.mean().round(3) if is_uncertain else getattr(scenario, "damage", None)
    return {
        "damage": dict(damage) if damage is not None else {},
        "kind": scenario.kind,
        "parameters": dict(getattr(scenario, "parameters", None) or {}),
        "added": [what for what in ("stiffness", "mass") if getattr(scenario, what, None) is not None],
        "is_uncertain": is_uncertain,
        "onset": _place(scenario.onset),
        "end": _place(getattr(scenario, "end", None)),
    }


def _place(onset: object) -> object:
    """A record by its number, or by its time."""
    return onset if onset is None or isinstance(onset, int | np.integer) else pd.Timestamp(onset)


def agreement(results: pd.DataFrame) -> Row | None:
    """How far rates of simulated and of reference records differ, in percentage points; None without the latter."""
    rates = results.pivot(index="scenario", columns="source", values="rate").reindex(results["scenario"].unique())
    if "reference" not in rates:
        return None
    both = rates.dropna()
    gaps = 100 * (both["simulated"] - both["reference"]).abs()
    single = results[(results["source"] == "reference") & (results["n_repeats"] == 1)].set_index("scenario")["rate"]
    bands = results[results["source"] == "simulated"].set_index("scenario").reindex(single.index)
    n_inside = int(single.between(bands["pi_low"], bands["pi_high"]).sum()) if len(single) else 0
    return {
        "n_scenarios": len(both),
        "mean": gaps.mean(),
        "largest": gaps.max(),
        "n_single": len(single),
        "n_inside": n_inside,
    }


def indices_of(study: DetectabilityStudy, findings: Sequence[FamilyFinding]) -> list[Row]:
    """Damage indices to draw, with those of the healthy structure: for each family, and each scenario without one."""
    detector = study.detector_name()
    threshold = study.thresholds_[detector]
    if threshold is None:
        return []
    onsets = {scenario.name: scenario.onset for scenario in study.scenarios_}
    rows = study.results_[study.results_["source"] == "simulated"]
    healthy = rows.loc[rows["measure"] == "PFA", "scenario"].head(1).tolist()
    shown = []
    for found in findings:
        severity = found.smallest if found.is_found else found.severities[-1]
        shown += rows.loc[(rows["family"] == found.family) & (rows["severity"] == severity), "scenario"].tolist()
    shown += rows.loc[(rows["measure"] == "POD") & rows["family"].isna(), "scenario"].tolist()
    drawn = []
    for name in shown[:12]:
        indices = {scenario: study.indices_[detector, scenario, "simulated"] for scenario in (*healthy, name)}
        above = {scenario: float((index.dropna() > threshold).mean()) for scenario, index in indices.items()}
        unknown = {scenario: int(index.isna().sum()) for scenario, index in indices.items()}
        one = {"indices": indices, "threshold": threshold, "onset": onsets.get(name)}
        drawn.append({**one, "above": above, "unknown": unknown})
    return drawn


@dataclass(frozen=True, eq=False)
class Choice:
    """Ranking of the detectors of a study with a limit of the share of false alarms, and the name of the one that the
    report is on."""

    study: DetectabilityStudy
    ranking: pd.DataFrame
    limit: float
    name: str

    @classmethod
    def made(cls, study: DetectabilityStudy, detector: str | None, limit: float) -> Choice:
        """The detector that is named, or the first of the ranking."""
        ranking = study.ranking(limit)
        return cls(study, ranking, limit, ranking.index[0] if detector is None else study.detector_name(detector))

    @property
    def best(self) -> str:
        """The recommended detector, or the one with the fewest false alarms."""
        return self.ranking.index[0]

    @property
    def best_row(self) -> pd.Series:
        return self.ranking.iloc[0]

    @property
    def n_damaged(self) -> int:
        """Number of damaged states that were simulated."""
        results = self.study.results_
        return results.loc[(results["measure"] == "POD") & (results["source"] == "simulated"), "scenario"].nunique()

    def only(self) -> DetectabilityStudy:
        """The study as if the detector of the report were its only one."""
        one, results = copy.copy(self.study), self.study.results_
        one.results_ = results[results["detector"] == self.name].reset_index(drop=True)
        one.indices_ = {key: index for key, index in self.study.indices_.items() if key[0] == self.name}
        return one

    @property
    def comparison(self) -> list[str]:
        """What the study's summary says of the ranking; bands are in another section."""
        elsewhere: set[str] = set()
        if self.study.uncertainty_ is not None:
            elsewhere = set(self.study.uncertainty_summary(self.best).splitlines())
        return [line for line in self.study.summary(self.limit).splitlines() if line not in elsewhere]


@dataclass(frozen=True, eq=False)
class FamilyFinding:
    """Smallest damage of one family that is detected reliably.

    Severities are in ascending order of their magnitude; the smallest and its bounds are NaN where none is detected.
    ``remark`` says why there is no curve, or why it is doubtful: "single" severity, "undetected", "falling" share of
    alarms, "gap" between the severities, or a curve "outside" the bounds of some.
    """

    family: str
    severities: Array
    rates: Array
    smallest: float
    lowest: float
    highest: float
    curve: PODCurve | None
    remark: str

    @property
    def is_found(self) -> bool:
        return bool(np.isfinite(self.smallest))

    @property
    def is_damage(self) -> bool:
        return bool(self.severities[0] > 0)

    @property
    def least(self) -> float:
        return float(abs(self.severities[0]))

    @property
    def largest(self) -> float:
        return float(abs(self.severities[-1]))

    @property
    def is_least(self) -> bool:
        """Whether the smallest tested severity is detected."""
        return bool(self.smallest == self.severities[0])

    @property
    def bounds(self) -> list[float]:
        """Bounds of the smallest severity without signs, once where they are equal."""
        ends = (float(abs(end)) if np.isfinite(end) else np.inf for end in (self.lowest, self.highest))
        return list(dict.fromkeys(ends))

    @property
    def on_curve(self) -> list[float]:
        """Severities that the curve gives without signs, a90 and a90/95; none without a curve."""
        has_curve = self.curve is not None and np.isfinite(self.curve.slope)
        return [abs(self.curve.a90), abs(self.curve.a90_95)] if has_curve else []


def with_severities(rows: pd.DataFrame) -> pd.DataFrame:
    """Results of simulated damage that belongs to a family and has a severity."""
    rows = rows[(rows["measure"] == "POD") & (rows["source"] == "simulated") & rows["family"].notna()]
    return rows[rows["severity"].fillna(0) != 0]


def findings_of(study: DetectabilityStudy) -> list[FamilyFinding]:
    """Findings for all families of simulated records; none for damage and strengthening, or a severity twice, in one
    family."""
    families = with_severities(study.results_).groupby("family", sort=False)
    return [found for name, some in families if (found := _finding(study, str(name), some)) is not None]


def _finding(study: DetectabilityStudy, family: str, rows: pd.DataFrame) -> FamilyFinding | None:
    rows = rows.iloc[np.argsort(rows["severity"].abs().to_numpy(), kind="stable")]
    severities, rates = rows["severity"].to_numpy(dtype=float), rows["rate"].to_numpy(dtype=float)
    try:
        smallest = [
            minimum_detectable_damage(severities, rows[name], RELIABLE) for name in ("rate", "ci_high", "ci_low")
        ]
    except ValueError:
        return None
    curve, remark = None, ""
    if len(rows) < 2:
        remark = "single"
    elif study.is_undetected(family):
        remark = "undetected"
    else:
        try:
            with collected():  # the remark says what is doubtful
                curve = study.pod_curve(family)
            remark = _doubt(curve)
        except ValueError:
            remark = "falling"
    return FamilyFinding(family, severities, rates, *smallest, curve, remark)


def _doubt(curve: PODCurve) -> str:
    """What a curve leaves open; nothing if it fits."""
    if np.isnan(curve.slope):
        low, high = curve.bracket
        return "gap" if np.isfinite(high) and low != 0 else ""
    return "outside" if curve.n_missed else ""


def draw_curve(finding: FamilyFinding, title: str, alt: str) -> Html:
    """Probability of detection of one family of scenarios."""
    fitted = finding.curve
    is_curve = bool(np.isfinite(fitted.slope))
    marks = is_curve and max(abs(fitted.a90), abs(fitted.a90_95)) <= finding.largest  # no extrapolation

    def make() -> PODCurveDisplay:
        display = PODCurveDisplay.from_predictions(fitted, label="fitted curve", marks=marks)
        if not is_curve:
            display.ax_.get_legend().remove()
        return display

    observed = 100 * np.asarray(fitted.n_detected) / np.asarray(fitted.n_records)
    columns = ["observed", "fitted", "lowest", "highest"] if is_curve else ["observed"]
    shares = [observed, *(100 * np.asarray(share) for share in fitted.predict(fitted.severities))][: len(columns)]
    index = pd.Index(100 * np.asarray(fitted.severities), name="severity (%)")
    table = pd.DataFrame({f"detected, {name} (%)": share for name, share in zip(columns, shares, strict=True)}, index)
    return draw(make, alt, title, height=3.2, values=Values(f"detection of {finding.family}", table))


def records_of(T: pd.DataFrame, F: pd.DataFrame) -> dict[str, Any]:
    """Number, period and usual distance of records, and ranges of their temperatures and frequencies."""
    has_times = isinstance(F.index, pd.DatetimeIndex) and len(F) > 1
    sensors = _sensors(T)
    return {
        "n": len(F),
        "period": period_text(F.index),
        "step": pd.Series(F.index).diff().abs().median() if has_times else None,
        "sensors": sensors,
        "has_lags": len(sensors) < len(T.columns),
        "modes": [_range(name, values) for name, values in F.items()],
    }


def training_tables(fem: DataInformedFEM) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Temperatures and frequencies that the chain learned from, as frames."""
    T, F = fem.records_.temperatures, fem.records_.frequencies
    index = next((table.index for table in (F, T) if isinstance(table, pd.DataFrame)), None)
    names = column_names(T, "T"), column_names(F, "f")
    first, second = (pd.DataFrame(as_floats(t), index, [str(n) for n in c]) for t, c in zip((T, F), names, strict=True))
    return first, second


def over_temperature(
    fem: DataInformedFEM, T: pd.DataFrame, F: pd.DataFrame
) -> tuple[pd.DataFrame, pd.DataFrame, pd.Series]:
    """Measured and predicted frequencies of some rows, evenly spread, and the temperature that they follow."""
    rows = spread_evenly(np.arange(len(T)), 1000)
    with collected():  # the report of the fit counts the gaps of these records
        frequencies = as_floats(fem.predict(fem.records_.temperatures))[rows]
    measured = F.iloc[rows]
    predicted = pd.DataFrame(frequencies, measured.index, measured.columns)
    return measured, predicted, chosen_sensor(T, F).iloc[rows]


def chosen_sensor(T: pd.DataFrame, F: pd.DataFrame) -> pd.Series:
    """The temperature that goes most closely with the frequencies."""
    X, y = as_floats(T), as_floats(F)
    both = pd.DataFrame(np.hstack([X, y])).corr().to_numpy()[: X.shape[1], X.shape[1] :]
    closeness = np.nan_to_num(np.abs(both)).mean(axis=1)
    return T.iloc[:, int(closeness.argmax())]


def _sensors(T: pd.DataFrame) -> list[Row]:
    """One row for each sensor: lags, which `~skthermo.preprocessing.LagFeatures` calls sensor_lag1, are counted."""
    columns: dict[str, list[tuple[int, str]]] = {}
    for name in T.columns:
        lagged = re.fullmatch(r"(.+)_lag(\d+)", name)
        sensor, lag = (lagged[1], int(lagged[2])) if lagged else (name, -1)
        columns.setdefault(sensor, []).append((lag, name))
    rows = []
    for sensor, found in columns.items():
        first = min(found)[1]
        n_lags = sum(lag > 0 for lag, _ in found) if len(found) > 1 else 0
        rows.append(_range(sensor if n_lags else first, T[first], n_lags))
    return rows


def _range(name: object, values: pd.Series, n_lags: int = 0) -> Row:
    """Lowest, mean and highest value, and the share that is missing."""
    return {
        "name": name,
        "lowest": values.min(),
        "mean": values.mean(),
        "highest": values.max(),
        "missing": values.isna().mean(),
        "n_lags": n_lags,
    }
