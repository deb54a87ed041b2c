"""Monitors whose evaluations are given, and fleets whose bridges are."""

import functools
import inspect
import typing
import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd

from skthermo.detection import MahalanobisDetector
from skthermo.monitoring import Fleet, Monitor

NO_FAULTS = pd.DataFrame(columns=["column", "kind", "since", "detected", "until", "detail"])
SET_ASIDE = {
    "column": "T <1>",
    "n_rows": 31,
    "from": pd.Timestamp("2025-03-01"),
    "to": pd.Timestamp("2025-03-31"),
    "detail": "'T <1>' is 484.667 °C in 31 of 365 rows",
}


@functools.cache
def in_service():
    """A monitor that has evaluated a few records."""
    days = pd.date_range("2023-01-01", periods=70)
    values = np.random.default_rng(0).normal([10, 4, 9], [1, 0.01, 0.02], (len(days), 3))
    records = pd.DataFrame(values, days, ["T1", "f1", "f2"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # few records
        monitor = Monitor(MahalanobisDetector(), targets=["f1", "f2"], units="Hz").fit(records[:60])
        monitor.update(records[60:])
    return monitor


def event_row(start, end, kind="damage", modes="f1", groups="", acknowledged=False, harmless=False, note=""):
    """One event, as `FakeMonitor` takes them."""
    return {
        "kind": kind,
        "start": pd.Timestamp(start),
        "end": pd.NaT if end is None else pd.Timestamp(end),
        "peak": 7.5,
        "peak_time": pd.Timestamp(start),
        "modes": modes,
        "groups": groups,
        "size": np.nan,
        "n_alarms": 3,
        "n_times": 1,
        "acknowledged": acknowledged,
        "harmless": harmless,
        "note": note,
    }


def smallest_changes(common, single, is_relative, groups=()):
    """Falls that a threshold sees within three days."""
    changes = {"common": common, "single": single, "is_relative": is_relative, "groups": dict(groups)}
    return replace(in_service().smallest_changes_, **changes, within=pd.Timedelta("3D"))


class FakeMonitor(Monitor):
    """Records of 2025 to its July, or of so many days; the last ones not evaluated (None: all).

    What a `Monitor` computes is given, in its columns; all else is that of a monitor `in_service`.
    """

    events_ = evaluations_ = days_ = counts_ = faults_ = drift_ = last_ = None  # properties of a Monitor

    def __init__(
        self,
        *,
        n_days=180,
        n_not_evaluated=0,
        reason="",
        events=(),
        drift=None,
        faults=NO_FAULTS,
        sensors=True,
        zone=None,
        false_alarms_per_year=1.0,
        watch_per_year=None,
    ):
        real = in_service()
        vars(self).update(vars(real))
        self.false_alarms_per_year, self.watch_per_year, self.sensors = false_alarms_per_year, watch_per_year, sensors
        stamps = pd.date_range("2025-01-01", periods=n_days, tz=zone)
        index = 1 + np.abs(np.sin(np.arange(len(stamps))))
        index[len(index) - n_not_evaluated if n_not_evaluated is not None else 0 :] = np.nan
        known = ~np.isnan(index)
        evaluated = {"state": np.where(known, "healthy", "not evaluated"), "index": index, "threshold": 3.0}
        evaluated |= {"modes": "", "groups": "", "reason": np.where(known, "", reason), "event": 0}
        evaluated = pd.DataFrame(evaluated, stamps)
        self.evaluations_ = evaluated[evaluated.index > stamps[-1] - pd.Timedelta("400D")]
        self.events_ = pd.DataFrame(list(events), range(1, len(events) + 1), list(event_row(stamps[0], None)))
        for name in ("start", "end", "peak_time"):
            self.events_[name] = pd.to_datetime(self.events_[name]).dt.tz_localize(zone)
        groups = pd.Series(index, stamps.normalize()).groupby(level=0)
        counts = {"n_records": groups.size(), "n_evaluated": groups.count(), "n_alarms": 0, "n_left_out": 0}
        self.days_ = pd.DataFrame(counts).assign(index_median=groups.median(), index_max=groups.max())
        self.faults_ = faults
        for name in ("events_", "evaluations_", "days_", "faults_"):
            given, computed = (sorted(getattr(monitor, name)) for monitor in (self, real))
            assert given == computed, f"{__file__}: FakeMonitor has {name} with {given}; expected {computed} of Monitor"
        for group in () if drift is None else drift.index:
            self.days_[f"drift {group}"] = np.linspace(0, drift["change"][group], len(self.days_))
        self.drift_, self.last_ = drift, stamps[-1]
        self.set_aside_ = pd.DataFrame([SET_ASIDE]).reindex(columns=list(real.set_aside_))
        self.threshold_, self.clear_threshold_ = 3.0, 2.0
        self.watch_threshold_ = None if watch_per_year is None else 2.5
        self.baseline_ = pd.DataFrame(0.0, stamps - pd.Timedelta("730D"), ["T1", "f1", "f2"])
        self.trained_, self.corrected_ = self.baseline_, self.baseline_[:0]
        unknown = {"n_records": len(stamps), "n_not_evaluated": int((~known).sum()), "n_repeated": 2}
        self.counts_ = real.counts_ | unknown
        rate = {"expected": false_alarms_per_year, "lowest": 0, "highest": 3, "n_years": 2.0, "missing_season": ""}
        self.false_alarm_estimate_ = replace(real.false_alarm_estimate_, **rate)
        self.smallest_changes_ = smallest_changes(0.01, {"f1": 0.02, "f2": 0.03}, True)
        kinds = set(self.events_["kind"][self.events_["end"].isna()])
        states = {"damage": "alarm", "drift": "drift", "watch": "watch"}
        standing = next((state for kind, state in states.items() if kind in kinds), "")
        last = {"state": [standing], "event": [0], "is_unexplained": ["fault" in kinds]}
        self.known_events_ = SimpleNamespace(standing=pd.DataFrame(last), reached=real.known_events_.reached)

    def get_params(self, deep=True):
        return {name: getattr(self, name) for name in inspect.signature(Monitor).parameters}


class FakeFleet:
    """Monitors, chains and errors by bridge; a bridge is fitted if it has a chain or a monitor."""

    def __init__(self, monitors=(), chains=(), errors=(), warned=(), significant=()):
        self.monitors, self.chains = dict(monitors), dict(chains)
        names = list(dict.fromkeys([*self.monitors, *self.chains, *dict(errors)]))
        rows = [(name, "update" if name in self.monitors else "fit", text) for name, text in dict(errors).items()]
        self.errors = pd.DataFrame(rows, columns=["bridge", "stage", "error"])
        is_fitted = [name in self.monitors or name in self.chains for name in names]
        self.table = pd.DataFrame({"is_fitted": is_fitted}, pd.Index(names, name="bridge", dtype=object))
        self.warnings = pd.DataFrame(list(warned), columns=["bridge", "kind", "message"])
        self.significant = set(significant)

    def discoveries(self, fdr=0.1):
        rows = [
            {"bridge": name, "event": number, "p_value": 0.001 if (name, number) in self.significant else 0.5} | event
            for name, monitor in self.monitors.items()
            if monitor is not None
            for number, event in monitor.events_.to_dict("index").items()
            if event["kind"] == "damage"
        ]
        columns = ["bridge", "event", "start", "end", "peak", "modes", "p_value", "acknowledged", "is_discovery"]
        table = pd.DataFrame(rows, columns=columns)
        table["is_discovery"] = table["end"].isna() & (table["p_value"] < 0.01)
        p_values = pd.Series(1.0, list(self.monitors))
        kind = typing.get_type_hints(Fleet.discoveries)["return"]
        return kind(fdr, table, p_values, 0.01, [], 0.5, float(len(self.monitors)))
