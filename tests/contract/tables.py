"""Columns of public tables and keys of results, of a small study, monitor, updating and fleet."""

import contextlib
import importlib.util
import re
import tempfile
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.utils import Bunch

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import DirectionalDetector, MahalanobisDetector, TemperatureCompensator
from skthermo.fem import match_modes
from skthermo.metrics import error_table
from skthermo.monitoring import Monitor, track_parameters
from skthermo.preprocessing import check_records
from skthermo.studies import DetectabilityStudy, compare_extensions, detection_task, identify_damage, pod_curve, sweep
from skthermo.surrogate import DataInformedFEM
from skthermo.updating import ModelUpdater, identifiability, sensitivity

GROUPS = ["bottom", "top", "diagonal", "vertical"]
A_GROUP = re.compile(rf"\b({'|'.join(GROUPS)})\b")
OF_THE_RECORDS = re.compile(r"[Tf]\d+|time|all groups|.* and .*|warnings .*|" + "|".join(GROUPS))


def tables(named):
    """Columns of what methods give, and of each table that is an attribute among the names."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for item, thing in results():
            yield from columns(item, thing)
            for name in (name for name in dir(thing) if f"{item}.{name}" in named):
                with contextlib.suppress(AttributeError, ValueError, TypeError):
                    yield from columns(f"{item}.{name}", getattr(thing, name))


def columns(item, thing):
    """Names of columns and of the index, without those that the records gave; "*" is the name of a group."""
    found = []
    if isinstance(thing, pd.DataFrame):
        found = [*thing.columns.names, *thing.columns.to_frame().to_numpy().ravel(), *thing.index.names]
    elif isinstance(thing, pd.Series):
        found = [*thing.index.names]
    elif isinstance(thing, Bunch):
        found = list(thing)
    for name in found:
        if isinstance(name, str) and not OF_THE_RECORDS.fullmatch(name):
            yield f"{item}[{A_GROUP.sub('*', name)}]"


def results():
    """Results by name; an object is followed by what its methods give."""
    yield from results_of_records()
    model, year, later = make_truss(), *(make_truss_campaign(samples_per_year=120, random_state=n) for n in (0, 1))
    T, F = year.temperatures, year.frequencies
    fem = DataInformedFEM(model, random_state=0).fit(T, F)
    yield "surrogate.DataInformedFEM", fem
    yield "surrogate.FitReport", fem.report_
    yield "surrogate.DataInformedFEM.extrapolation_distance", fem.extrapolation_distance(T)
    yield from results_of_updating(model)
    yield from results_of_detection(model, T, F)
    yield from results_of_studies(fem, later)
    yield from results_of_monitoring(fem, year, later)
    yield from results_of_a_fleet()


def results_of_records():
    year = make_truss_campaign(samples_per_year=120, random_state=0)
    yield "datasets.make_truss_campaign", year
    T, F = year.temperatures.copy(), year.frequencies.copy()
    T.iloc[3, 0], F.iloc[5, 1] = -999.0, 900.0
    yield "preprocessing.RecordFindings", check_records(T, F)
    yield "metrics.error_table", error_table(F, F * 1.01)


def results_of_updating(model):
    nominal, shapes = (values[0] for values in model.modes(np.ones((1, 4))))
    yield "fem.match_modes", match_modes(model, nominal, shapes=shapes, dofs=range(len(shapes)))
    yield "updating.sensitivity", sensitivity(model)
    yield "updating.identifiability", identifiability(model, noise=0.001)
    yield "updating.ModelUpdater", ModelUpdater(model, random_state=0).fit(0.99 * nominal)


def results_of_detection(model, T, F):
    compensator = TemperatureCompensator(Ridge(), targets=list(F))
    directional = make_pipeline(compensator, DirectionalDetector(model)).fit(T.join(F))[-1]
    yield "detection.DirectionalDetector", directional
    yield "detection.DirectionalDetector.pod", directional.pod([0.1])
    yield "detection.DirectionalDetector.minimum_detectable_damage", directional.minimum_detectable_damage()


def results_of_studies(fem, later):
    T, options = later.temperatures, {"uncertainty": "noise", "random_state": 0}
    scenarios = sweep(fem, (0.1, 0.3), ["bottom"])
    study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, n_repeats=1, **options)
    yield "studies.DetectabilityStudy.run", study.run(T, later.frequencies)
    yield "studies.DetectabilityStudy", study
    yield "studies.DetectabilityStudy.ranking", study.ranking()
    yield "studies.DetectabilityStudy.minimum_detectable_damage", study.minimum_detectable_damage()
    yield "studies.DetectabilityStudy.labelled_scores", study.labelled_scores()
    yield "studies.compare_extensions", compare_extensions(study, T, modes=[6])
    task = detection_task(fem, T, scenarios, columns=fem.mode_names_, n_repeats=2, random_state=0)
    yield "studies.DetectionTask", task
    yield "studies.DetectionTask.confirm", task.confirm({"one": MahalanobisDetector()}, T, random_state=0)
    yield "studies.pod_curve", pod_curve([0.1, 0.2, 0.3], [3, 10, 19], [20, 20, 20])
    damaged = make_truss_campaign(samples_per_year=120, damage={"bottom": 0.2}, random_state=1)
    identified = identify_damage(fem, damaged.temperatures, damaged.frequencies, GROUPS[:2], random_state=0)
    yield "studies.IdentifiedDamage", identified


def results_of_monitoring(fem, year, later):
    records, new = (one.temperatures.join(one.frequencies * factor) for one, factor in ((year, 1), (later, 0.95)))
    new = new[:10].set_index(new.index[:10] + pd.Timedelta("365D"))
    new.iloc[3:, 0] = 25.0  # a sensor that is stuck
    monitor = monitor_of(fem, fem=fem).fit(records)
    yield "monitoring.Monitor.update", monitor.update(new)
    yield "monitoring.Monitor", monitor
    yield "monitoring.MonitorStatus", monitor.status(monitor.last_)
    yield "monitoring.Monitor.transitions", monitor.transitions()
    yield "monitoring.Retraining", monitor.refit(force=True)
    both = pd.concat([records, new])
    history = track_parameters(fem, both.filter(regex="^T"), both[fem.mode_names_])
    yield "monitoring.ParameterHistory", history
    yield "monitoring.ParameterHistory.reaches", history.reaches()


def monitor_of(_, **options):
    modes = [f"f{n}" for n in range(1, 7)]
    detector = make_pipeline(TemperatureCompensator(Ridge(), targets=modes), MahalanobisDetector())
    return Monitor(detector, targets=modes, watch_per_year=12, random_state=0, **options)


def results_of_a_fleet():
    room = "fleet" if importlib.util.find_spec("skthermo.fleet") else "monitoring"
    fit_fleet = importlib.import_module(f"skthermo.{room}").fit_fleet
    year = make_truss_campaign(samples_per_year=120, random_state=0)
    records = {"a": (year.temperatures, year.frequencies)}
    with tempfile.TemporaryDirectory() as folder:
        fleet = fit_fleet(dict.fromkeys(records, Ridge()), records, monitor=monitor_of, folder=Path(folder))
        yield f"{room}.Fleet", fleet
        yield f"{room}.Fleet.discoveries", fleet.discoveries()
