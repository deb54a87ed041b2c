import copy
import tempfile

import numpy as np
import pandas as pd

from skthermo.datasets import make_truss
from skthermo.detection import MahalanobisDetector
from skthermo.monitoring import Monitor, load_monitor, track_parameters
from skthermo.surrogate import DataInformedFEM
from tests.contract.truss import campaign, chain, next_year, records_of


def monitoring_batches():
    """Batches, late and repeated records: events and evaluations are those of one pass."""
    records = campaign(0, 2, damage={"bottom": 0.4}, damage_from="2026-09-01").frequencies
    monitor = Monitor(MahalanobisDetector(), targets=list(records), random_state=0).fit(records[:"2025"])
    once, by_parts = copy.deepcopy(monitor), copy.deepcopy(monitor)
    once.update(records["2026":])
    for start in range(365, 730, 73):
        part = records[start : start + 73]
        by_parts.update(part.drop(part.index[70]))
        by_parts.update(part[68:72])  # one late, three repeated
    indices = [one.evaluations_["index"].to_numpy(float) for one in (once, by_parts)]
    return {
        "events": bool(once.events_["start"].equals(by_parts.events_["start"])),
        "indices": bool(np.allclose(*indices, equal_nan=True)),
        "counts": {name: by_parts.counts_[name] for name in ("n_records", "n_repeated", "n_late")},
        "found": bool((once.events_["start"] >= pd.Timestamp("2026-09-01")).any()),
    }


def monitoring_damage():
    """A monitor without an FE model: healthy until March, then a loss of a tenth of the bottom chord."""
    year = campaign()
    monitor = Monitor(targets=list(year.frequencies), units="Hz").fit(records_of(year))
    healthy = monitor.update(next_year({})[:"2026-03-01"])
    states = [monitor.status(monitor.last_).state]
    damaged = monitor.update(next_year({"bottom": 0.1})["2026-03-02":"2026-03-31"])
    states.append(monitor.status(monitor.last_).state)
    damage = monitor.events_[monitor.events_["kind"] == "damage"]
    return {
        "states": states,
        "rows": [len(healthy), len(damaged)],
        "above": [float((one["index"] > one["threshold"]).mean()) for one in (healthy, damaged)],
        "begins": (damage["start"].iloc[-1] - pd.Timestamp("2026-03-02")).days,
        "open": bool(damage["end"].isna().iloc[-1]),
        "last": str(monitor.last_),
        "summary": "alarm" in str(monitor.status(monitor.last_)) or "alarm" in monitor.summary(),
    }, {"above": {"atol": 0.2}, "begins": {"atol": 5}}


def monitoring_decisions():
    """What an owner says: a harmless event, records taken back, a saved monitor that goes on."""
    year = campaign()
    monitor = Monitor(targets=list(year.frequencies)).fit(records_of(year))
    monitor.update(next_year({"bottom": 0.3})[:20])
    monitor.acknowledge(1, harmless=True, note="heavy transport")
    with tempfile.TemporaryDirectory() as folder:
        monitor.save(f"{folder}/truss.joblib")
        again = load_monitor(f"{folder}/truss.joblib")
    again.discard("2026-01-11")
    return {
        "event": [str(monitor.events_.loc[1, name]) for name in ("kind", "acknowledged", "harmless", "note")],
        "same": bool(again.threshold_ == monitor.threshold_),
        "left": [str(again.last_), len(again.evaluations_)],
        "transitions": len(list(monitor.transitions())) > 0,
        "status": sorted({"state", "reason", "now", "events", "faults"} & {*monitor.status(monitor.last_).as_dict()}),
    }


def monitoring_false_alarms():
    """A healthy year has about as many false events as were asked for."""
    years = campaign(3, 3)
    records = records_of(years)
    monitor = Monitor(targets=list(years.frequencies), false_alarms_per_year=1).fit(records.loc[:"2026"])
    monitor.update(records.loc["2027"])
    return {
        "events": int((monitor.events_["kind"] == "damage").sum()),
        "expected": monitor.false_alarm_estimate_.expected,
        "evaluated": float(monitor.evaluations_["index"].notna().mean()),
        "smallest": monitor.smallest_changes_.common,
    }, {"events": {"atol": 2}, "expected": {"atol": 0.3}, "evaluated": {"atol": 0.05}, "smallest": {"atol": 0.004}}


def monitoring_groups():
    """A monitor with an FE model names the damaged group."""
    monitor = Monitor(fem=chain(), random_state=0).fit(records_of(campaign()))
    monitor.update(next_year({"bottom": 0.15})[:30])
    damage = monitor.events_[monitor.events_["kind"] == "damage"]
    return {
        "state": monitor.status(monitor.last_).state,
        "groups": "bottom" in damage["groups"].iloc[-1],
        "begins": (damage["start"].iloc[0] - pd.Timestamp("2026-01-01")).days,
        "drift": list(monitor.drift_.index),
    }, {"begins": {"atol": 4}}


def monitoring_new_baseline():
    """After a repair a new baseline begins; a detector learns anew from what has come."""
    years = campaign(0, 2)
    records = records_of(years)
    records.loc["2026-03-01":, list(years.frequencies)] *= 1.03
    monitor = Monitor(targets=list(years.frequencies), random_state=0).fit(records[:"2025"])
    monitor.update(records["2026-01":"2026-04"])
    before = monitor.status(monitor.last_).state
    done = monitor.rebaseline("2026-03-01", until="2026-04-30")
    monitor.update(records["2026-05":"2026-06"])
    index = monitor.evaluations_.loc["2026-05":, "index"]
    return {"before": before, "accepted": bool(done.accepted), "after": float((index > monitor.threshold_).mean())}, {
        "after": {"atol": 0.1}
    }


def monitoring_sensors():
    """A thermometer that sticks and a frequency that dies are faults, and no damage."""
    years = campaign(0, 2)
    records = records_of(years)
    records.loc["2026-02-10":"2026-04-20", "T2"] = 12.5
    records.loc["2026-03-01":, "f4"] = float("nan")
    monitor = Monitor(targets=list(years.frequencies)).fit(records[:"2025"])
    monitor.update(records["2026-01":"2026-04"])
    faults = monitor.faults_
    since = {name: pd.Timestamp(faults.loc[faults["column"] == name, "since"].iloc[0]) for name in ("T2", "f4")}
    return {
        "columns": sorted(set(faults["column"])),
        "T2": (since["T2"] - pd.Timestamp("2026-02-10")).days,
        "f4": (since["f4"] - pd.Timestamp("2026-03-01")).days,
        "evaluated": float(monitor.evaluations_["index"].notna().mean()),
    }, {"T2": {"atol": 3}, "f4": {"atol": 3}, "evaluated": {"atol": 0.1}}


def monitoring_track_parameters():
    """A chord that loses 2 % a year, looked at after three years."""
    found = {}
    for name, one in {"ageing": campaign(0, 3, drift={"bottom": 0.02}), "healthy": campaign(0, 3)}.items():
        T, F = one.temperatures, one.frequencies
        fem = DataInformedFEM(make_truss(), random_state=0).fit(T[:365], F[:365])
        found[name] = track_parameters(fem, T, F, freq="7D")
    return {
        "drifts": {name: bool(one.has_drift) for name, one in found.items()},
        "rate": float(found["ageing"].rates.loc["bottom", "per_year"]),
        "fastest": found["ageing"].rates["per_year"].idxmin(),
        "change": float(found["ageing"].table["bottom", "estimate"].iloc[-1]),
        "summary": "bottom" in found["ageing"].summary(),
    }, {"rate": {"atol": 0.006}, "change": {"atol": 0.015}}
