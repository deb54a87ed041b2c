import numpy as np
import pandas as pd
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline

from skthermo import studies
from skthermo.datasets import make_truss, truss_structure
from skthermo.detection import DirectionalDetector, MahalanobisDetector, OutlierDetector, TemperatureCompensator
from skthermo.surrogate import TemperatureMapper
from tests.contract.truss import campaign, chain, fitted


def studies_compare_extensions():
    """What a further mode would gain."""
    fem, weather = chain(), campaign(1).temperatures
    options = {"n_repeats": 3, "uncertainty": "noise", "random_state": 0}
    study = studies.DetectabilityStudy(
        fem, MahalanobisDetector(), studies.sweep(fem, (0.1, 0.2, 0.3), ["top"]), **options
    )
    study.run(weather)
    table = studies.compare_extensions(study, weather, modes=[6, 8])
    return {
        "candidates": sorted(table["candidate"]),
        "now": table["mdd_now"].iloc[:1],
        "inside": bool(((table["ci_low"] <= table["gain"]) & (table["gain"] <= table["ci_high"])).all()),
    }, {"now": {"atol": 0.04}}


def studies_detection_task():
    """A detector is tuned by simulated damage in scikit-learn's search, and confirmed in other weather."""
    fem, weather, later = chain(), campaign(1), campaign(2)
    options = {"columns": fem.mode_names_, "n_repeats": 2, "random_state": 0}
    task = studies.detection_task(fem, weather.temperatures, [{}, {"bottom": 0.2}], **options)
    grid = {"threshold": ["conformal", "quantile"]}
    search = GridSearchCV(MahalanobisDetector(), grid, cv=task.cv, scoring=task.scoring, refit=False).fit(
        task.X, task.y
    )
    detector = task.refit(search)
    confirmed = task.confirm({"tuned": search}, later.temperatures, random_state=0)
    return {
        "shape": list(task.X.shape),
        "labels": task.y.value_counts().to_dict(),
        "states": task.states["scenario"].value_counts().to_dict(),
        "scores": search.cv_results_["mean_test_score"],
        "false alarms": float((detector.predict(later.frequencies) == -1).mean()),
        "fresh": confirmed[["tuned", "fresh"]],
    }, {"scores": {"atol": 0.05}, "false alarms": {"atol": 0.04}, "fresh": {"atol": 0.05}}


def studies_identify_damage():
    """Which damage explains shifted frequencies: groups, probabilities, severities with bands."""
    fem = chain()
    groups, found = ["bottom", "top", "diagonal"], {}
    for name, damage in {"bottom": {"bottom": 0.12}, "diagonal": {"diagonal": 0.1}, "healthy": None}.items():
        later = campaign(2, damage=damage)
        T, F = later.temperatures[:90], later.frequencies[:90]
        found[name] = studies.identify_damage(fem, T, F, groups, random_state=0)
    lowest, highest = found["bottom"].table.loc["bottom", ["ci_low", "ci_high"]]
    results = {name: {"causes": list(one.most_probable)} for name, one in found.items()}
    results |= {
        "severities": {name: one.severities for name, one in found.items()},
        "errors": found["bottom"].table["standard_error"],
        "damaged": [bool(one.probability_of_damage > 0.9) for one in found.values()],
        "inside": bool(lowest < 0.12 < highest),
        "scenario": found["bottom"].scenario().name,
        "summary": "bottom" in found["bottom"].summary(),
    }
    return results, {"severities": {"atol": 0.012}, "errors": {"atol": 0.005}}


def studies_identify_other_causes():
    """Causes that are no damage of a group: a stiffer part, one mode alone."""
    fem, truss, later = chain(), make_truss(), campaign(2)
    nominal = truss.frequencies([[1.0] * 4])
    stiffer = truss.damaged({"bottom": -0.15}).frequencies([[1.0] * 4]) / nominal
    T, F = later.temperatures[:120], later.frequencies[:120] * stiffer
    gain = studies.identify_damage(fem, T, F, ["bottom", "top"], stiffening=True, random_state=0)
    other = studies.identify_damage(
        fem, T, later.frequencies[:120] * [1, 1, 1, 1, 1, 0.93], ["bottom", "top"], random_state=0
    )
    loss = studies.identify_damage(
        fem, T, F, ["bottom", "top"], prior=studies.DamagePrior(severity=0.2), random_state=0
    )
    return {
        "gain": float(gain.table.loc["bottom stiffer", "severity"]),
        "other": [bool(other.probability_other > 0.5), bool(loss.probability_other > 0.5)],
        "law": studies.DamagePrior(severity=0.3).law,
    }, {"gain": {"atol": 0.02}}


def studies_locate_damage():
    """Which members of a group are damaged."""
    structure, model, fem, later = truss_structure(), make_truss(), chain(), campaign(1)
    divided = structure.divide(model, {"diagonal": {"two bays": ["10", "22"]}})
    healthy, damaged = (one.frequencies([[1.0] * 4]) for one in (divided, divided.damaged({"two bays": 0.4})))
    F = later.frequencies * damaged / healthy
    T, groups = later.temperatures, ["top", "diagonal"]
    located = studies.identify_damage(fem, T, F, groups, structure=structure, random_state=0)
    return {
        "members": sorted(located.likely_members()),
        "severity": located.table.loc[["10", "22"], "severity"],
        "damaged": bool(located.probability_of_damage > 0.9),
    }, {"severity": {"atol": 0.12}}


def studies_pod_curve():
    """A curve of detection over severity, with the 90 % severity and its bound."""
    curves = {
        log: studies.pod_curve([0.1, 0.2, 0.3, 0.4], [3, 12, 19, 20], [20, 20, 20, 20], log=log)
        for log in (False, True)
    }
    return {
        "a50": [curve.a50 for curve in curves.values()],
        "a90": [curve.a90 for curve in curves.values()],
        "a90/95": [curve.a90_95 for curve in curves.values()],
        "curve": curves[True].predict([0.1, 0.2, 0.3])[0],
        "severity": curves[True].severity_at(0.8),
    }, {"*": {"rtol": 1e-3}}


def studies_readme():
    """README's study in a small form: which of four detectors to take for the truss.

    The rate of the directions is of 0.3, which looks for losses of section too, and so finds those of stiffness less
    often.
    """
    fem = chain()
    regression = TemperatureCompensator(TemperatureMapper(), targets=fem.mode_names_)
    detectors = {
        "raw frequencies": MahalanobisDetector(),
        "raw, isolation forest": OutlierDetector(IsolationForest(n_estimators=20, random_state=0)),
        "temperature removed": make_pipeline(regression, MahalanobisDetector()),
        "directions of damage": make_pipeline(regression, DirectionalDetector(fem)),
    }
    damage = [{}, {"bottom": 0.1}, {"top": 0.1}]
    study = studies.DetectabilityStudy(fem, detectors, damage, n_repeats=5, random_state=0, uncertainty="noise")
    results = study.run(campaign(1).temperatures)
    ranking = study.ranking()
    return {
        "order": list(ranking.index[:2]),
        "pod": ranking["pod"],
        "false alarms": ranking["false_alarms"],
        "worse": ranking["significantly_worse"],
        "rows": len(results),
        "measures": sorted(set(results["measure"])),
    }, {"pod": {"atol": 0.05}, "false alarms": {"atol": 0.015}}


def studies_scenarios():
    """Kinds of damage: sudden, growing, uncertain, and a series of severities."""
    crack = studies.ProgressiveDamage("growing crack", {"bottom": 0.2}, onset=2, end=4)
    settled = studies.UncertainDamage("settled pier", pd.DataFrame({"pier": [0.24, 0.31, 0.28]}))
    chord = studies.Scenario("lower chord, a fifth", {"bottom": 0.2})
    year = campaign(0, samples_per_year=120)
    fem = fitted(year)
    cracked = fem.simulate(year.temperatures, **crack.changes(year.temperatures)) / fem.predict(year.temperatures)
    return {
        "growth": crack.changes(np.zeros((6, 3)))["damage"]["bottom"],
        "draw": settled.changes(None, repeat=1),
        "chord": [chord.family, chord.severity, chord.is_healthy, studies.Scenario("healthy").is_healthy],
        "names": [one.name for one in studies.sweep(make_truss(), (0.1, 0.2), ["bottom", "top"])],
        "families": [one.family for one in studies.sweep(make_truss(), (-0.1, 0.2), ["bottom"])],
        "falls": cracked["f1"].iloc[[0, 1, 3, 4, 60]].to_numpy(),
    }, {"falls": {"rtol": 2e-3}}


def studies_smallest_damage():
    """How small a loss is found: rates by severity, the smallest damage, a curve."""
    fem, later = chain(), campaign(1)
    detector = make_pipeline(TemperatureCompensator(Ridge(), targets=fem.mode_names_), MahalanobisDetector())
    scenarios = studies.sweep(fem, (0.05, 0.1, 0.15, 0.2), ["bottom"])
    study = studies.DetectabilityStudy(
        fem, {"ridge": detector}, scenarios, n_repeats=4, uncertainty="noise", random_state=0
    )
    results = study.run(later.temperatures)
    smallest = study.minimum_detectable_damage()
    return {
        "scenarios": list(results["scenario"]),
        "rates": results["rate"],
        "inside": bool(((results["ci_low"] <= results["rate"]) & (results["rate"] <= results["ci_high"])).all()),
        "smallest": float(smallest["mdd"].iloc[0]),
        "a90": study.pod_curve("bottom", log=True).a90,
        "found": [study.is_undetected("bottom"), study.detector_name()],
    }, {"rates": {"atol": 0.05}, "smallest": {"atol": 0.055}, "a90": {"atol": 0.015}}


def studies_uncertainty():
    """Bands that hold the error of the baseline, the weather and the model."""
    fem, later = chain(), campaign(1)
    options = {"n_repeats": 3, "n_replicates": 4, "random_state": 0}
    study = studies.DetectabilityStudy(fem, MahalanobisDetector(), [{}, {"bottom": 0.3}], **options)
    results = study.run(later.temperatures)
    return {
        "rates": results["rate"],
        "wider": bool((results["pi_high"] - results["pi_low"] >= 0).all()),
        "parts": bool(study.uncertainty_.loc[:, "together"].ge(0).all()),
    }, {"rates": {"atol": 0.05}}
