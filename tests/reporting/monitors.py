"""A monitor whose evaluations are given, and a fleet whose bridges are, with the attributes of fitted ones."""

from types import SimpleNamespace

import numpy as np
import pandas as pd

from skthermo.monitoring._events import SmallestChanges
from skthermo.monitoring._fleet import Discoveries
from skthermo.monitoring._status import status_of

NO_FAULTS = pd.DataFrame(columns=["column", "kind", "since", "detected", "until", "detail"])


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
        "n_alarms": 3,
        "acknowledged": acknowledged,
        "harmless": harmless,
        "note": note,
    }


def smallest_changes(common, single, is_relative, groups=()):
    """Falls that a threshold sees within three days."""
    return SmallestChanges(common, single, is_relative, pd.Timedelta("3D"), dict(groups))


SET_ASIDE = {
    "column": ["T <1>"],
    "n_rows": [31],
    "from": [pd.Timestamp("2025-03-01")],
    "to": [pd.Timestamp("2025-03-31")],
    "detail": ["'T <1>' is 484.667 °C in 31 of 365 rows"],
}


class FakeMonitor:
    """Records of 2025 to its July, or of so many days; the last ones not evaluated (None: all)."""

    def __init__(
        self,
        *,
        freq="1D",
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
        self.false_alarms_per_year, self.sensors, self.fem = false_alarms_per_year, sensors, None
        stamps = pd.date_range("2025-01-01", periods=n_days, freq=freq, tz=zone)
        index = 1 + np.abs(np.sin(np.arange(len(stamps))))
        index[len(index) - n_not_evaluated if n_not_evaluated is not None else 0 :] = np.nan
        known = ~np.isnan(index)
        evaluated = {"state": np.where(known, "healthy", "not evaluated"), "index": index, "threshold": 3.0}
        evaluated = pd.DataFrame(evaluated, stamps).assign(
            reason=np.where(known, "", reason), modes="", groups="", event=0
        )
        columns = [
            "kind",
            "start",
            "end",
            "peak",
            "peak_time",
            "modes",
            "groups",
            "n_alarms",
            "acknowledged",
            "harmless",
            "note",
        ]
        self.events_ = pd.DataFrame(list(events), range(1, len(events) + 1), columns)
        for name in ("start", "end", "peak_time"):
            self.events_[name] = pd.to_datetime(self.events_[name]).dt.tz_localize(zone)
        groups = pd.Series(index, stamps.normalize()).groupby(level=0)
        self.days_ = pd.DataFrame({"n_records": groups.size(), "n_evaluated": groups.count(), "n_alarms": 0})
        self.days_ = self.days_.assign(index_median=groups.median(), index_max=groups.max())
        for group in () if drift is None else drift.index:
            self.days_[f"drift {group}"] = np.linspace(0, drift["change"][group], len(self.days_))
        self.evaluations_ = evaluated[evaluated.index > stamps[-1] - pd.Timedelta("400D")]
        self.faults_, self.drift_, self.last_ = faults, drift, stamps[-1]
        self.set_aside_ = pd.DataFrame(SET_ASIDE)
        self.targets_, self.threshold_, self.clear_threshold_ = ["f1", "f2"], 3.0, 2.0
        self.units_ = {"T1": "°C", "f1": "Hz", "f2": "Hz"}
        self.baseline_ = pd.DataFrame(0.0, stamps - pd.Timedelta("730D"), ["T1", "f1", "f2"])
        self.trained_, self.since_ = self.baseline_, None
        self.corrected_ = self.baseline_[:0]
        self.counts_ = {"n_records": len(stamps), "n_not_evaluated": int((~known).sum()), "n_repeated": 2}
        self.false_alarm_estimate_ = SimpleNamespace(
            expected=false_alarms_per_year,
            lowest=0,
            highest=3,
            n_years=2.0,
            method="by hand",
            missing_season="",
        )
        self.watch_per_year, self.watch_threshold_ = watch_per_year, None if watch_per_year is None else 2.5
        self.smallest_changes_ = smallest_changes(0.01, {"f1": 0.02, "f2": 0.03}, True)
        self.detector_ = SimpleNamespace()

    def transitions(self, after=0):
        return []

    def status(self, now=None):
        return status_of(self).at(now)

    def update(self, new):
        raise NotImplementedError

    def acknowledge(self, event, **said):
        raise NotImplementedError


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
        return Discoveries(fdr, table, p_values, 0.01, [], 0.5, float(len(self.monitors)))
