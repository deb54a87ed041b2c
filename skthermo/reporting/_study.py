"""The page on a study: what its model learned, which damage its detector finds, and which detector is recommended."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from skthermo._core.arrays import as_floats, spread_evenly
from skthermo._core.estimators import last_step
from skthermo._core.frames import column_names, columns_by_sensor
from skthermo._core.text import period_text
from skthermo._core.warnings import collected
from skthermo.detection import MahalanobisDetector
from skthermo.fem import Structure
from skthermo.metrics import minimum_detectable_damage
from skthermo.plotting import DamageIndexDisplay, PODCurveDisplay, PredictionDisplay
from skthermo.reporting._page import Drawing, Row, draw, draw_structure, identified_facts, rows_of, settings_of
from skthermo.studies import DetectabilityStudy, IdentifiedDamage
from skthermo.surrogate import DataInformedFEM

RELIABLE = 0.9  # share of records in alarm from which on damage counts as detected reliably


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
        ranking, comparison = study.ranking(max_false_alarms), study.summary(max_false_alarms).splitlines()
        name = ranking.index[0] if detector is None else study.detector_name(detector)
        choice = {"ranking": rows_of(ranking), "name": name, "limit": max_false_alarms, "comparison": comparison}
        study = with_one_detector(study, name)
    elif detector is not None:
        study.detector_name(detector)
    simulated = study.results_[study.results_["source"] == "simulated"]
    damaged = simulated[(simulated["measure"] == "POD") & simulated["family"].notna()]
    families = {
        str(name): finding_of(study, str(name), rows)
        for name, rows in damaged[damaged["severity"].fillna(0) != 0].groupby("family", sort=False)
    }
    system = study.detectors_[study.detector_name()]
    warned = [*getattr(study, "warnings_", [])]
    warned += [f"Identified damage: {text}" for text in ([] if identified is None else identified.warnings())]
    T, F = training_tables(study.fem)
    groups = [] if structure is None else [name for name in families if name in structure.groups]
    parts = {"model": study.fem, "alarm system": system, "study": study}
    return {
        "written": pd.Timestamp.now(),
        "study": study,
        "choice": choice,
        "identified": None if identified is None else identified_facts(identified),
        "level": RELIABLE,
        "confidence": study.confidence_,
        "families": families,
        "states": states_of(study),
        "is_distance": isinstance(last_step(system), MahalanobisDetector),
        "records": records_of(T, F),
        "weather": study.indices_[next(key for key in study.indices_ if key[2] == "simulated")].index,
        "agreement": agreement(study.results_),
        "draw": {one.__name__: one for one in (draw_curve, draw_damage_indices, draw_mode)},
        "draw_groups": None if structure is None else partial(draw_structure, structure, groups=groups),
        "groups": groups,
        "measured": F,
        "over_temperature": over_temperature(study.fem, T, F),
        "indices": indices_of(study, families),
        "settings": settings_of(parts, but=("study: fem", "study: detectors", "study: scenarios")),
        "warned": warned,
    }


def with_one_detector(study: DetectabilityStudy, name: str) -> DetectabilityStudy:
    """A study as if one of its detectors were the only one."""
    one = copy.copy(study)
    one.results_ = study.results_[study.results_["detector"] == name].reset_index(drop=True)
    one.indices_ = {key: index for key, index in study.indices_.items() if key[0] == name}
    return one


def states_of(study: DetectabilityStudy) -> list[Row]:
    """Rates of all scenarios, what each changes, and how many records of the first simulation were not evaluated."""
    scenarios = {scenario.name: scenario for scenario in study.scenarios_}
    states = rows_of(study.results_)
    for state in states:
        index = study.indices_[state["detector"], state["scenario"], state["source"]]
        state |= {"change": scenarios.get(state["scenario"]), "n_first": len(index)}
        state |= {"n_unknown": int(index.isna().sum())}
    return states


def agreement(results: pd.DataFrame) -> Row | None:
    """How far rates of simulated and of reference records differ, in percentage points; None without the latter."""
    simulated, reference = (results[results["source"] == name] for name in ("simulated", "reference"))
    both = reference.merge(simulated, on="scenario", suffixes=("", "_simulated"))
    if not len(both):
        return None
    gaps, single = 100 * (both["rate_simulated"] - both["rate"]).abs(), both[both["n_repeats"] == 1]
    n_inside = single["rate"].between(single["pi_low_simulated"], single["pi_high_simulated"]).sum()
    counts = {"n_scenarios": len(both), "n_single": len(single), "n_inside": int(n_inside)}
    return counts | {"mean": gaps.mean(), "largest": gaps.max()}


def indices_of(study: DetectabilityStudy, families: dict[str, Row | None]) -> list[Row]:
    """Damage indices to draw, with those of the healthy structure: for each family, and each scenario without one."""
    detector = study.detector_name()
    threshold = study.thresholds_[detector]
    if threshold is None:
        return []
    rows = study.results_[study.results_["source"] == "simulated"]
    healthy = rows.loc[rows["measure"] == "PFA", "scenario"].head(1).tolist()
    shown = []
    for found in filter(None, families.values()):
        severity = found["smallest"] if np.isfinite(found["smallest"]) else found["severities"][-1]
        shown += rows.loc[(rows["family"] == found["family"]) & (rows["severity"] == severity), "scenario"].tolist()
    shown += rows.loc[(rows["measure"] == "POD") & rows["family"].isna(), "scenario"].tolist()
    onsets, drawn = {scenario.name: scenario.onset for scenario in study.scenarios_}, []
    for name in shown[:12]:
        indices = {scenario: study.indices_[detector, scenario, "simulated"] for scenario in (*healthy, name)}
        above = {scenario: float((index.dropna() > threshold).mean()) for scenario, index in indices.items()}
        unknown = {scenario: int(index.isna().sum()) for scenario, index in indices.items()}
        one = {"indices": indices, "threshold": threshold, "onset": onsets.get(name)}
        drawn.append({**one, "above": above, "unknown": unknown})
    return drawn


def finding_of(study: DetectabilityStudy, family: str, rows: pd.DataFrame) -> Row | None:
    """Smallest damage of one family that is detected reliably; None for damage and strengthening, or a severity twice,
    in one family.

    Severities are in ascending order of their magnitude; the smallest and its bounds are NaN where none is detected.
    ``remark`` says why there is no curve, or why it is doubtful: "single" severity, "undetected", "falling" share of
    alarms, "gap" between the severities, or a curve "outside" the bounds of some.
    """
    rows = rows.sort_values("severity", key=abs, kind="stable")
    severities, curve, remark = rows["severity"].to_numpy(dtype=float), None, ""
    try:
        limits = [minimum_detectable_damage(severities, rows[name], RELIABLE) for name in ("rate", "ci_high", "ci_low")]
    except ValueError:
        return None
    if len(rows) < 2 or study.is_undetected(family):
        remark = "single" if len(rows) < 2 else "undetected"
    else:
        try:
            with collected():  # the remark says what is doubtful
                curve = study.pod_curve(family)
            is_gap = np.isnan(curve.slope) and np.isfinite(curve.bracket[1]) and curve.bracket[0] != 0
            remark = "gap" if is_gap else "outside" if np.isfinite(curve.slope) and curve.n_missed else ""
        except ValueError:
            remark = "falling"
    ends = (float(abs(end)) if np.isfinite(end) else np.inf for end in limits[1:])
    return {
        "family": family,
        "severities": severities,
        "rates": rows["rate"].to_numpy(dtype=float),
        "smallest": limits[0],
        "bounds": list(dict.fromkeys(ends)),
        "curve": curve,
        "has_slope": curve is not None and np.isfinite(curve.slope),
        "remark": remark,
    }


def draw_mode(
    measured: pd.Series, alt: str, predicted: pd.Series | None = None, temperature: pd.Series | None = None
) -> Drawing:
    """A measured frequency over time, or a measured and a predicted one over a temperature."""
    name, tables = str(measured.name), [None if one is None else one.to_frame() for one in (measured, predicted)]
    make = partial(PredictionDisplay.from_predictions, *tables, temperature=temperature)
    if predicted is None or temperature is None:
        table = measured.to_frame(f"{name} (Hz)").rename_axis(measured.index.name or "date")
        return draw(make, alt, height=2.2, name=f"frequency {name} over time", table=table)
    both = pd.DataFrame({f"{name} measured (Hz)": measured, f"{name} predicted (Hz)": predicted})
    both = both.set_axis(pd.Index(temperature, name=f"{temperature.name} (°C)"))
    return draw(make, alt, name=f"frequency {name} over temperature", table=both, is_scatter=True)


def draw_damage_indices(shown: Mapping[str, pd.Series], threshold: float, onset: object, alt: str) -> Drawing:
    """Damage index of some scenarios over time, and the threshold of the alarm."""
    make = partial(DamageIndexDisplay.from_predictions, shown, threshold, onset=onset, label="damage index")
    table = pd.DataFrame(dict(shown)).assign(threshold=threshold).rename_axis("date")
    return draw(make, alt, height=3.2, name=f"damage index {list(shown)[-1]}", table=table)


def draw_curve(finding: Row, title: str, alt: str) -> Drawing:
    """Probability of detection of one family of scenarios."""
    fitted, is_curve = finding["curve"], finding["has_slope"]
    marks = is_curve and max(abs(fitted.a90), abs(fitted.a90_95)) <= abs(finding["severities"][-1])  # no extrapolation
    make = partial(PODCurveDisplay.from_predictions, fitted, label="fitted curve", marks=marks)
    names = ["observed", "fitted", "lowest", "highest"] if is_curve else ["observed"]
    shares = [np.asarray(fitted.n_detected) / np.asarray(fitted.n_records), *fitted.predict(fitted.severities)]
    index = pd.Index(100 * np.asarray(fitted.severities), name="severity (%)")
    columns = {f"detected, {name} (%)": 100 * np.asarray(share) for name, share in zip(names, shares, strict=False)}
    options = {"name": f"detection of {finding['family']}", "table": pd.DataFrame(columns, index)}
    return draw(make, alt, title, height=3.8, legend="outside lower center" if is_curve else None, **options)


def records_of(T: pd.DataFrame, F: pd.DataFrame) -> dict[str, Any]:
    """Number, period and usual distance of records, and ranges of their temperatures and frequencies."""
    columns = columns_by_sensor(T)
    names = [name if len(found) > 1 else T.columns[found[0]] for name, found in columns.items()]
    sensors = T.iloc[:, [found[0] for found in columns.values()]].set_axis(names, axis=1)
    has_times = isinstance(F.index, pd.DatetimeIndex) and len(F) > 1
    return {
        "n": len(F),
        "period": period_text(F.index),
        "step": pd.Series(F.index).diff().abs().median() if has_times else None,
        "sensors": ranges_of(sensors, [len(found) - 1 for found in columns.values()]),
        "modes": ranges_of(F),
    }


def ranges_of(table: pd.DataFrame, n_lags: Sequence[int] | int = 0) -> list[Row]:
    """Lowest, mean and highest value of each column, and the share that is missing."""
    ends = table.agg(["min", "mean", "max"]).T.set_axis(["lowest", "mean", "highest"], axis=1)
    return rows_of(ends.assign(missing=table.isna().mean(), n_lags=n_lags))


def training_tables(fem: DataInformedFEM) -> list[pd.DataFrame]:
    """Temperatures and frequencies that the chain learned from, as frames."""
    given = {"T": fem.records_.temperatures, "f": fem.records_.frequencies}
    index = next((table.index for table in given.values() if isinstance(table, pd.DataFrame)), None)
    return [pd.DataFrame(as_floats(t), index, [str(n) for n in column_names(t, name)]) for name, t in given.items()]


def over_temperature(fem: DataInformedFEM, T: pd.DataFrame, F: pd.DataFrame) -> dict[str, Any]:
    """Measured and predicted frequencies of some rows, evenly spread, and the temperature that goes most closely with
    them."""
    rows = spread_evenly(np.arange(len(T)), 1000)
    with collected():  # the report of the fit counts the gaps of these records
        predicted = as_floats(fem.predict(fem.records_.temperatures))[rows]
    both = pd.DataFrame(np.hstack([T, F])).corr().to_numpy()[: T.shape[1], T.shape[1] :]
    sensor = T.iloc[rows, int(np.nan_to_num(np.abs(both)).mean(axis=1).argmax())]
    measured = F.iloc[rows]
    predicted = pd.DataFrame(predicted, measured.index, measured.columns)
    return {"measured": measured, "predicted": predicted, "temperature": sensor}
