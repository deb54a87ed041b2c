"""Changes, records and disks at the edges of what a monitor is made for: nothing of it may end as healthy.

    OMP_NUM_THREADS=1 python tests/benchmarks/monitor_edges.py [--patterns 40] [--only modes units clock targets disk]

A truss with six modes and four records a day is watched for a year after a baseline of a year, by records alone and by
windows of two days. Each line says what happens, what has to come of it, and what the monitor said: the share of the
records from the third day on that are healthy, the exit code of ``python -m skthermo update`` for the last day, and the
events. The exit code is 1 if a line is healthy where it must not be, or is not as it has to be.
"""

import argparse
import contextlib
import errno
import io
import os
import pickle
import sys
import tempfile
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.commands.main import main as command
from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator, WindowedAlarm
from skthermo.monitoring import Monitor, load_monitor

PER_DAY, N_BASELINE = 4, 4 * 365
SETTLED = 3 * PER_DAY
"""Records after which a change of any size has to be seen, also by a window of two days."""
CODES = ["healthy", "alarm", "not evaluated", "error"]


@cache
def records():
    campaign = make_truss_campaign(2, samples_per_year=4 * 365, samples_per_day=4, noise=0.003, random_state=0)
    return campaign.temperatures.join(campaign.frequencies)


def modes_of(table):
    return [name for name in table if str(name)[0] in "fde"]


def detector(targets, window=None):
    last = MahalanobisDetector() if window is None else WindowedAlarm(window)
    return make_pipeline(TemperatureCompensator(LinearRegression(), targets=targets), last)


@cache
def fitted(kind="truss", window=None, **options):
    table = TABLES[kind]()
    return pickle.dumps(Monitor(detector(modes_of(table), window), **options).fit(table[:N_BASELINE]))


def with_displacement():
    """Beside the modes a displacement about 0 mm, and two strains."""
    table, random = records().copy(), np.random.default_rng(1)
    weather = table["T1"] - table["T1"].mean()
    table["d"] = 0.02 * weather + random.normal(0, 0.5, len(table))
    table["e1"] = 80 + 3 * weather + random.normal(0, 4, len(table))
    table["e2"] = -60 - 2 * weather + random.normal(0, 4, len(table))
    return table


TABLES = {"truss": records, "displacement": with_displacement}


def said(monitor, new, skip=SETTLED):
    """Share of healthy records, exit code for the last day, kinds of events, and the answers."""
    answers = monitor.update(new[:-PER_DAY])
    code, text = by_command(monitor, new[-PER_DAY:])
    share = (answers["state"][skip:] == "healthy").mean() if len(answers) > skip else np.nan
    return share, code, sorted(set(monitor.events_["kind"])), answers, text


def by_command(monitor, new):
    """Exit code and output of an update from a file."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bridge.joblib"
        monitor.save(file)
        new.to_csv(Path(folder) / "new.csv", index_label="time")
        with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
            code = command(["update", str(file), str(Path(folder) / "new.csv")])
        return code, out.getvalue() + err.getvalue()


class Table:
    """Lines as they are printed, and the number of those that are wrong."""

    def __init__(self):
        self.wrong = 0

    def line(self, what, expected, got, is_right):
        self.wrong += not is_right
        print(f"{'ok   ' if is_right else 'WRONG'} {what:74} {expected:24} {got}", flush=True)

    def never_healthy(self, what, monitor, new):
        share, code, kinds, *_ = said(monitor, new)
        got = f"{100 * share:5.1f} % healthy, exit {code} ({CODES[code]}), events: {', '.join(kinds) or 'none'}"
        self.line(what, "never healthy", got, share == 0 and code in (1, 2) and bool(kinds))


def changed(table, factors, days, start=20 * PER_DAY):
    """Records from which modes are multiplied from a day on, up to the end of the change."""
    new = table[N_BASELINE + start : N_BASELINE + start + days * PER_DAY].copy()
    for name, factor in factors.items():
        new[name] *= factor
    return new


def quiet(monitor, table, n=20 * PER_DAY):
    """The monitor after healthy days."""
    monitor = pickle.loads(monitor)
    monitor.update(table[N_BASELINE : N_BASELINE + n])
    return monitor


def modes(table, n_patterns):
    """More damage is never less alarm."""
    T = records()
    for window in (None, "2D"):
        name = "records" if window is None else f"windows of {window}"
        monitor = pickle.dumps(quiet(fitted(window=window), T))
        for loss in (0.05, 0.2, 0.26, 0.3, 0.5, 0.9):
            table.never_healthy(
                f"{name}: f3 falls by {loss:.0%} for 110 days", pickle.loads(monitor), changed(T, {"f3": 1 - loss}, 110)
            )
        for others in (["f2", "f5"], ["f1", "f2", "f3"], modes_of(T)):
            what = f"{name}: {', '.join(others)} fall by 30 % for 40 days"
            table.never_healthy(what, pickle.loads(monitor), changed(T, dict.fromkeys(others, 0.7), 40))
        for factor in (0.0, -1.0, 1e3, 1e200):
            what = f"{name}: f4 times {factor:g} for 40 days"
            table.never_healthy(what, pickle.loads(monitor), changed(T, {"f4": factor}, 40))
    monitor = quiet(fitted(), T)
    new = T[N_BASELINE + 80 : N_BASELINE + 84].copy()
    new.iloc[1, new.columns.get_loc("f3")] = 1e6
    answer = monitor.update(new).iloc[1]
    n_left_out = monitor.counts_.get("n_left_out", monitor.counts_.get("n_implausible"))
    got = f"{answer['state']}, {n_left_out} value counted, reason: {answer['reason'] or 'none'}"
    is_right = answer["state"] != "healthy" and "f3" in answer["reason"] and n_left_out == 1
    table.line("records: a single value of f3 is 1e6", "reason, and counted", got, is_right)
    random, healthy = np.random.default_rng(0), []
    for _ in range(n_patterns):
        window, sensors = random.choice([None, "2D"]), bool(random.integers(2))
        some = random.choice(modes_of(T), random.integers(1, 7), replace=False)
        sizes = np.exp(random.choice([-1, 1]) * np.exp(random.uniform(np.log(0.05), np.log(8), len(some))))
        days, start = int(random.integers(4, 30)), int(random.integers(0, 300))
        monitor = pickle.loads(fitted(window=window, sensors=sensors))
        new = changed(T, dict(zip(some, sizes, strict=True)), days, start)
        share, code, *_ = said(monitor, new)
        if share > 0 or code == 0:
            healthy.append(f"{dict(zip(some, sizes.round(3), strict=True))} {days} days, {window}, sensors {sensors}")
    got = f"{len(healthy)} of {n_patterns} healthy{': ' if healthy else ''}{'; '.join(healthy[:3])}"
    table.line(f"{n_patterns} patterns by chance of modes, sizes, times, settings", "never healthy", got, not healthy)


class DropsOutliers(TransformerMixin, BaseEstimator):
    """A step that leaves out values far from the baseline's."""

    def fit(self, X, y=None):
        self.centre_, self.deviation_ = X.median(), X.std()
        return self

    def transform(self, X):
        return X.mask((X - self.centre_).abs() > 8 * self.deviation_)


def filters(table, _):
    """Detectors that drop large changes themselves."""
    T = records()
    last = make_pipeline(DropsOutliers(), *(step for _, step in detector(modes_of(T)).steps))
    try:
        monitor = Monitor(last, sensors=False).fit(T[:N_BASELINE])
    except ValueError as error:
        table.line("a step of the detector drops outliers", "refused, or never healthy", str(error)[:90], True)
        return
    table.never_healthy("a step of the detector drops outliers: f3 falls by 30 %", monitor, changed(T, {"f3": 0.7}, 40))


def units(table, _):
    """Responses of any sign and unit."""
    T = with_displacement()
    monitor = quiet(fitted("displacement"), T)
    new = T[N_BASELINE + 80 : N_BASELINE + 80 + 40 * PER_DAY].copy()
    shares = [(monitor_copy(monitor).update(new)["state"] == state).mean() for state in ("alarm", "healthy")]
    faults = sorted(set(monitor_after(monitor, new).faults_["kind"]))
    got = f"{shares[0]:.1%} in alarm, {shares[1]:.1%} healthy, faults: {', '.join(faults) or 'none'}"
    table.line(
        "healthy displacement and strains beside modes, 40 days", "healthy", got, shares[1] > 0.95 and not faults
    )
    for size in (5, 10, 20, 100):
        moved = new.assign(d=new["d"] + 0.5 * size)
        table.never_healthy(f"a displacement about 0 mm moves by {size} deviations", monitor_copy(monitor), moved)
    table.never_healthy("a strain changes its sign", monitor_copy(monitor), new.assign(e1=-new["e1"]))
    table.never_healthy("a displacement is 0 for ever", monitor_copy(monitor), new.assign(d=0.0))


def monitor_copy(monitor):
    return pickle.loads(pickle.dumps(monitor))


def monitor_after(monitor, new):
    monitor = monitor_copy(monitor)
    monitor.update(new)
    return monitor


def clock(table, _):
    """Stamps of a wrong clock."""
    T = records()
    monitor = quiet(fitted(), T)
    ahead = T[N_BASELINE + 80 : N_BASELINE + 84].copy()
    ahead.index = ahead.index + pd.Timedelta("3653D")
    answers = monitor.update(ahead)
    reasons = ", ".join(sorted(set(answers["reason"])))[:60]
    got = f"{sorted(set(answers['state']))}, {reasons or 'no reason'}"
    is_right = set(answers["state"]) == {"not evaluated"}
    table.line("4 records are stamped ten years ahead", "not evaluated, explained", got, is_right)
    true = monitor.update(T[N_BASELINE + 80 : N_BASELINE + 120])
    got = f"{(true['state'] == 'healthy').sum()} of {len(true)} healthy, {monitor.counts_['n_too_late']} too late"
    table.line("true records after them", "evaluated", got, monitor.counts_["n_too_late"] == 0)
    monitor = quiet(fitted(), T)
    answers = monitor.update(T[N_BASELINE + 600 : N_BASELINE + 700])
    got = f"{(answers['state'] == 'healthy').sum()} of {len(answers)} healthy"
    table.line("a logger was silent for 130 days", "evaluated", got, (answers["state"] == "healthy").mean() > 0.9)


def targets(table, _):
    """Targets of the monitor that are not those of the compensator."""
    T = records()
    names = modes_of(T)
    for what, own in {
        "a part of them": names[:4],
        "more of them": [*names, "T1"],
        "in another order": names[::-1],
    }.items():
        try:
            monitor = Monitor(detector(names), targets=own, sensors=False).fit(T[:N_BASELINE])
            monitor.update(changed(T, {"f6": 0.85}, 10))
            got = f"worst mode named: {monitor.events_['modes'].iloc[-1]}"
            is_right = got.split(": ")[1].split(",")[0] == "f6"
        except ValueError as error:
            got, is_right = f"refused: {str(error)[:110]}", True
        except IndexError as error:
            got, is_right = f"IndexError at the alarm: {error}", False
        table.line(f"targets are {what}, f6 falls", "refused, or f6 named", got, is_right)
    order = [names[2], *names[:2], *names[3:]]
    monitor = Monitor(detector(order), sensors=False).fit(T[:N_BASELINE])
    monitor.update(changed(T, {"f6": 0.85, "f3": 0.99}, 10))
    worst = monitor.events_["modes"].iloc[-1].split(",")[0]
    table.line("targets of the compensator in another order, f6 falls", "f6 named", f"{worst} named", worst == "f6")


def disk(table, _):
    """A disk without space."""
    T = records()
    monitor = quiet(fitted(), T)
    flush = os.fsync

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    for what, new in {
        "healthy records": T[N_BASELINE + 80 : N_BASELINE + 84],
        "records in alarm": changed(T, {"f3": 0.8}, 2),
    }.items():
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "bridge.joblib"
            monitor.save(file)
            new.to_csv(Path(folder) / "new.csv", index_label="time")
            os.fsync = full
            try:
                with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
                    code = command(["update", str(file), str(Path(folder) / "new.csv")])
            finally:
                os.fsync = flush
            is_kept = load_monitor(file).last_ == monitor.last_
            text = next((line for line in out.getvalue().splitlines() if line.lower().startswith("state")), "no state")
            names = "bridge.joblib" in err.getvalue()
            got = f"exit {code}, prints {text!r}, file {'named' if names else 'not named'}"
            is_right = code == 3 and text == "no state" and names and is_kept
            table.line(f"the disk is full: {what}", "exit 3, no state, named", got, is_right)


PARTS = {"modes": modes, "filters": filters, "units": units, "clock": clock, "targets": targets, "disk": disk}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--patterns", type=int, default=40)
    parser.add_argument("--only", nargs="*", choices=PARTS, default=list(PARTS))
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    table = Table()
    for part in options.only:
        PARTS[part](table, options.patterns)
    print(f"{table.wrong} lines are wrong")
    sys.exit(table.wrong > 0)


if __name__ == "__main__":
    main()
