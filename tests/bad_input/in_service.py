"""Monitoring, of one bridge and of many: valid calls, with bad values of their arguments."""

import copy

from sklearn.linear_model import LinearRegression, Ridge
from sklearn.pipeline import make_pipeline

from skthermo import monitoring, surrogate
from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from tests.bad_input.examples import BOTH, CHAIN, MODES, F, T
from tests.bad_input.registry import FOLDER, LEGAL, NOT_CALLED, methods, use
from tests.bad_input.values import NAN, bad, durations, flag, frequencies, instead, jobs, names, number, table, weather

DETECTOR = make_pipeline(TemperatureCompensator(Ridge(), targets=MODES), MahalanobisDetector())
SERVICE = make_truss_campaign(2, samples_per_year=120, damage={"bottom": 0.3}, damage_from="2025-06-10", random_state=0)
NEW = SERVICE.temperatures.join(SERVICE.frequencies)[120:]
MONITOR = monitoring.Monitor(DETECTOR, watch_per_year=12, sensors=False).fit(BOTH)
SERVED = copy.deepcopy(MONITOR)
SERVED.update(NEW)
SERVED.save(FOLDER / "monitor.joblib")
MOMENT = bad("soon", True, NAN, [], b"2026", str, "2026-01-01T00:00+01:00", 1j)


def monitored(X, **values):
    return monitoring.Monitor(**values).fit(X).update(X[:0])


def served(name, result=lambda monitor: monitor.evaluations_):
    """A method of a copy of the monitor in service, and what it has changed."""

    def call(**values):
        monitor = copy.deepcopy(SERVED)
        given = getattr(monitor, name)(**values)
        return result(monitor) if given is None else given

    return f"monitoring.Monitor.{name}", call


use(
    "monitoring.Monitor",
    monitored,
    usual="random_state sensors",
    detector=(DETECTOR, instead(DETECTOR.fit)),
    targets=(MODES, names(MODES, "None")),
    reference=(["T2"], names(["T2"], "None", "empty")),
    fem=(None, {cause: value for cause, value in instead().items() if cause != "None"}),
    false_alarms_per_year=(1.0, number(0, -1)),
    watch_per_year=(12.0, number(0, -1, 1.0, but=("None",))),
    persistence=((4, 6), number(0, -1, 1.5, (0, 3), (4, 3), (4.0, 6), (2, 3, 4), [3])),
    max_delay=("7D", durations("zero")),
    retention=("400D", durations()),
    units=("Hz", bad(3, True, ["Hz"], {"f1": 3}, {"no such name": "Hz"}, b"Hz", str)),
    lookback=("1D", durations("None")),
    X=(BOTH, frequencies(BOTH, in_hertz=False, fixed=False, rows=False, fitting=True)),
)
use(
    "monitoring.Monitor.update",
    lambda new, confirm: copy.deepcopy(MONITOR).update(new, confirm=confirm),
    new=(NEW[:40], frequencies(NEW[:40], in_hertz=False, rows=False, but=("no rows",))),
    usual="confirm",
)
methods(SERVED, "status", now=("2025-08-29", MOMENT), max_age=("3D", durations("None")))
methods(SERVED, "transitions", after=(1, number(-1, 1.5, 10**6)))
methods(SERVED, "years_watched", since=("2025-06-10", MOMENT))
use(
    *served("acknowledge", lambda monitor: monitor.events_),
    event=(1, number(0, -1, 1.5, 1000)),
    harmless=(True, flag()),
    note=("a special transport", bad(3, None, True, b"a", ["a"], str)),
)
use(*served("discard"), start=("2025-06-10", {**MOMENT, "None": None}), end=("2025-08-28", MOMENT))
use(
    *served("refit", lambda monitor: monitor.threshold_),
    records=(NEW[:50], frequencies(NEW[:50], in_hertz=False, rows=False)),
    until=("2025-06-01", MOMENT),
    usual="force",
)
use(*served("rebaseline"), since=("2025-06-10", {**MOMENT, "None": None}), until=("2025-08-20", MOMENT))
PATHS = bad(
    "no such folder/monitor.joblib", "monitor.txt", "monitor", 3, None, True, b"monitor.joblib", ["a.joblib"], str
)
methods(SERVED, "save", path=(FOLDER / "saved.joblib", PATHS))
use(
    "monitoring.load_monitor",
    lambda path: monitoring.load_monitor(path).summary(),
    path=(FOLDER / "monitor.joblib", PATHS),
)
HISTORY = monitoring.track_parameters(CHAIN, T, F, ["top"])
use(
    "monitoring.track_parameters",
    lambda **a: monitoring.track_parameters(**a).rates,
    fem=(CHAIN, instead()),
    T=(T, weather(T, rows=True)),
    F=(F, frequencies(F, rows=True)),
    groups=(["top"], names(["top"], "None")),
    freq=("1D", durations("half", "negative number")),
    significance=(0.01, number(0, 1, -0.1)),
)
methods(HISTORY, "reaches", limit=(-0.1, number(0, -1, -1.5)))
methods(HISTORY, "remove_drift", F=(F, frequencies(F, rows=False)))
NOT_CALLED |= {
    "monitoring.MonitorStatus": "made by a monitor's status",
    "monitoring.ParameterHistory": "made by track_parameters",
    "monitoring.Retraining": "made by a monitor's refit",
}

ESTIMATORS, RECORDS = {"a": LinearRegression()}, {"a": (T, F)}


def watch(chain):
    """A monitor of a bridge; whatever its chain is."""
    return monitoring.Monitor(DETECTOR, watch_per_year=12, sensors=False)


def tables(given):
    """What became of each bridge."""
    return [given.table.drop(columns=["seconds", "megabytes"]), given.errors]


WATCHED = monitoring.fit_fleet(ESTIMATORS, RECORDS, monitor=watch, folder=FOLDER / "fleet")
WATCHED.update({"a": NEW})
MAPPING = bad(3, None, True, "a", ["a"], {"no such name": 3}, str)
use(
    "monitoring.fit_fleet",
    lambda **a: tables(monitoring.fit_fleet(**a)),
    usual="random_state",
    estimators=(ESTIMATORS, MAPPING),
    records=(RECORDS, MAPPING),
    monitor=(watch, bad(3, True, "watch", [watch], MONITOR)),
    folder=(FOLDER / "another fleet", bad(3, True, ["a"], b"a", str)),
    n_jobs=(1, jobs()),
    progress=(False, flag("None")),
)
use(
    "monitoring.Fleet",
    lambda folder: tables(monitoring.Fleet(folder)),
    folder=(FOLDER / "fleet", bad("nowhere", 3, None, True, ["a"], b"a", str)),
)
methods(WATCHED, "status", now=("2025-05-01", MOMENT), max_age=("3D", durations("None")))
methods(WATCHED, "update", records=({}, MAPPING), n_jobs=(1, jobs()), progress=(False, flag("None")))
use(
    "monitoring.Fleet.discoveries",
    lambda **a: WATCHED.discoveries(**a).summary(),
    fdr=(0.1, number(0, 1, -0.1, 2)),
    days=(365.25, number(0, -1)),
)
use(
    "monitoring.Fleet.acknowledge",
    WATCHED.acknowledge,
    bridge=("a", bad("no such name", 3, None, ["a"], True)),
    event=(1, number(0, -1, 1.5, 1000)),
    harmless=(True, flag()),
    note=("", bad(3, None)),
)
FEW = F[["f1", "f2"]]
OTHERS = [surrogate.TemperatureMapper().fit(T, FEW * (1 + 0.01 * n)) for n in range(3)]
use(
    "surrogate.FleetMapper",
    lambda X, y, **a: surrogate.FleetMapper(**a).fit(X, y).predict(X),
    mappers=(OTHERS, bad(3, True, "a", ["a"], {"no such name": 3}, str)),
    X=(T, weather(T, rows=True, fixed=False, fitting=True)),
    y=(FEW, table(FEW, rows=True, fixed=False, fitting=True, but=("a number", "constant"))),
)
MAPPER = surrogate.FleetMapper(OTHERS).fit(T, FEW)
methods(MAPPER, "predict", X=(T, table(T, rows=False)), return_std=(False, flag()))
LEGAL |= {
    "lookback": {("zero", "monitoring.Monitor"): "the detector looks at single records"},
    "max_age": {("zero", f"monitoring.{one}.status"): "any age is too old" for one in ("Monitor", "Fleet")},
    "new": {
        (cause, "monitoring.Monitor.update"): "left out, with its reason in the row and in the counts"
        for cause in ("1e308 inside", "a slipped point", "infinite inside")
    },
    "records": {("no rows", "monitoring.Monitor.refit"): "the answer says that nothing may train"},
}
