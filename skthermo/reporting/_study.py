"""What the page on a study is made of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from skthermo._core.estimators import last_step
from skthermo.detection import MahalanobisDetector
from skthermo.fem import Structure
from skthermo.reporting._choice import Choice
from skthermo.reporting._figures import draw_curve, draw_damage_indices, draw_groups, draw_mode, identified_facts
from skthermo.reporting._findings import LEVEL, REFERENCE, SIMULATED, Finding, findings_of, with_severities
from skthermo.reporting._model import over_temperature, records_of, training_tables
from skthermo.reporting._settings import settings_of, versions
from skthermo.reporting._templates import Row, rows_of
from skthermo.studies import DetectabilityStudy, IdentifiedDamage, ProgressiveDamage, Scenario, UncertainDamage

MOST_DRAWN = 12  # largest number of scenarios that are drawn
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
        choice = Choice.of(study, detector, max_false_alarms)
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
        "level": LEVEL,
        "confidence": study.confidence_,
        "has_bands": study.uncertainty_ is not None,
        "families": {name: families.get(str(name)) for name in with_severities(results)["family"].unique()},
        "is_distance": isinstance(last_step(system), MahalanobisDetector),
        "records": records_of(T, F),
        "weather": study.indices_[next(key for key in study.indices_ if key[2] == SIMULATED)].index,
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
    simulated = [is_unknown for (*_, source), is_unknown in unknown.items() if source == SIMULATED]
    states = [
        {
            **row,
            "change": change_of(scenarios.get(row["scenario"])),
            "unknown": float(unknown[row["detector"], row["scenario"], row["source"]].mean()),
        }
        for row in rows_of(study.results_)
    ]
    by_model = [state for state in states if state["source"] == SIMULATED]
    damaged = [state for state in by_model if state["measure"] == "POD"]
    missed = [state for state in damaged if state["rate"] < LEVEL]
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
    if REFERENCE not in rates:
        return None
    both = rates.dropna()
    gaps = 100 * (both[SIMULATED] - both[REFERENCE]).abs()
    single = results[(results["source"] == REFERENCE) & (results["n_repeats"] == 1)].set_index("scenario")["rate"]
    bands = results[results["source"] == SIMULATED].set_index("scenario").reindex(single.index)
    n_inside = int(single.between(bands["pi_low"], bands["pi_high"]).sum()) if len(single) else 0
    return {
        "n_scenarios": len(both),
        "mean": gaps.mean(),
        "largest": gaps.max(),
        "n_single": len(single),
        "n_inside": n_inside,
    }


def indices_of(study: DetectabilityStudy, findings: Sequence[Finding]) -> list[Row]:
    """Damage indices to draw, with those of the healthy structure: for each family, and each scenario without one."""
    detector = study.detector_name()
    threshold = study.thresholds_[detector]
    if threshold is None:
        return []
    onsets = {scenario.name: scenario.onset for scenario in study.scenarios_}
    rows = study.results_[study.results_["source"] == SIMULATED]
    healthy = rows.loc[rows["measure"] == "PFA", "scenario"].head(1).tolist()
    shown = []
    for found in findings:
        severity = found.smallest if found.is_found else found.severities[-1]
        shown += rows.loc[(rows["family"] == found.family) & (rows["severity"] == severity), "scenario"].tolist()
    shown += rows.loc[(rows["measure"] == "POD") & rows["family"].isna(), "scenario"].tolist()
    drawn = []
    for name in shown[:MOST_DRAWN]:
        indices = {scenario: study.indices_[detector, scenario, SIMULATED] for scenario in (*healthy, name)}
        above = {scenario: float((index.dropna() > threshold).mean()) for scenario, index in indices.items()}
        unknown = {scenario: int(index.isna().sum()) for scenario, index in indices.items()}
        one = {"indices": indices, "threshold": threshold, "onset": onsets.get(name)}
        drawn.append({**one, "above": above, "unknown": unknown})
    return drawn
