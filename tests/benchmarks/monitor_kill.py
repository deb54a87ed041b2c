"""kill -9 at random points of nightly updates: whether the saved state is always whole and goes on as if undisturbed.

    OMP_NUM_THREADS=1 python tests/benchmarks/monitor_kill.py

The truss with a record every four hours, a baseline of a year, and 200 nights, each with a CSV file of a day: gaps,
records that come days late, a bottom chord that loses 30 % for a month. Each night's command,
``python -m skthermo.monitoring update``, is killed at a random point of the time that it takes, once or more often, and
then started again and left alone. Most nights, it runs in a process that has imported everything, so that the kill
meets its work and not the start of Python; every fortieth night it is a command of its own. After each kill the file is
read. An undisturbed monitor gets the same files. The exit code is 1 if a file cannot be read, if it is neither the
state before the night nor after it, or if events, days, judgements or records differ in the end.
"""

import argparse
import contextlib
import copy
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import TemperatureCompensator, WindowedAlarm
from skthermo.monitoring import Monitor, load_monitor
from skthermo.monitoring.__main__ import main as run_command
from skthermo.preprocessing import LagFeatures

YEAR, DAY = 2190, 6  # records
DAMAGED = slice(80, 110)  # nights
OWN_COMMAND = 40  # nights between those with a command of their own


def truss_nights(n_nights, random):
    """The baseline, and a table for each night: some records are missing, some of these come days later."""
    healthy, damaged = (
        make_truss_campaign(2, samples_per_year=YEAR, samples_per_day=DAY, damage=damage, random_state=0)
        for damage in (None, {"bottom": 0.3})
    )
    records, weak = (c.temperatures.join(c.frequencies) for c in (healthy, damaged))
    nights, owed = [], []
    for night in range(n_nights):
        source = weak if DAMAGED.start <= night < DAMAGED.stop else records
        table = source[YEAR + night * DAY :][:DAY]
        is_missing = random.random(DAY) < random.choice([0, 0.1, 1], p=[0.7, 0.25, 0.05])
        comes = [(due, late) for due, late in owed if due <= night]
        owed = [(due, late) for due, late in owed if due > night]
        if is_missing.any() and random.random() < 0.5:
            owed.append((night + random.integers(1, 9), table[is_missing]))  # within a week, or too late
        nights.append(pd.concat([late for _, late in comes] + [table[~is_missing]]))
    return records[:YEAR], list(healthy.frequencies), nights


def start(arguments, is_own):
    """A command as a process, of which both kinds have a pid."""
    if is_own:
        command = [sys.executable, "-m", "skthermo.monitoring", *arguments]
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    process = multiprocessing.get_context("fork").Process(target=quiet_command, args=(arguments,))
    process.start()
    return process


def quiet_command(arguments):
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
        sys.exit(run_command(arguments))


def ended(process):
    """Exit code of a process, negative for a signal."""
    if isinstance(process, subprocess.Popen):
        return process.wait()
    process.join()
    return process.exitcode


def differences(one, other):
    """What two monitors say differently, to the last bit; files that were read twice only count repeated records."""
    different = [] if one.state() == other.state() else ["state"]
    for name in ("judged_", "events_", "days_", "faults_", "records_"):
        try:
            pd.testing.assert_frame_equal(getattr(one, name), getattr(other, name), check_exact=True, check_freq=False)
        except AssertionError:
            different.append(name)
    return different


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nights", type=int, default=200)
    parser.add_argument("--ending", choices=["joblib", "skops"], default="joblib")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    random = np.random.default_rng(options.seed)
    baseline, targets, nights = truss_nights(options.nights, random)
    weather = make_pipeline(LagFeatures([0, 1, 6], freq="4h"), LinearRegression())
    monitor = Monitor(make_pipeline(TemperatureCompensator(weather, targets=targets), WindowedAlarm("24h")))
    monitor.fit(baseline)
    warnings.simplefilter("ignore", UserWarning)  # of windows that are not judged
    kills, found, seconds = Counter(), Counter(), {False: 0.5, True: 4.0}
    with tempfile.TemporaryDirectory() as folder:
        file, new = Path(folder) / f"bridge.{options.ending}", Path(folder) / "new.csv"
        monitor.save(file)
        for night, table in enumerate(nights):
            table.to_csv(new)
            before, is_own = copy.copy(monitor), night % OWN_COMMAND == 0
            if len(table):
                monitor.update(table)
            for left_to_kill in range(1 + random.poisson(0.3), -1, -1):
                begun, process = time.monotonic(), start(["update", str(file), str(new)], is_own)
                if left_to_kill:
                    time.sleep(random.uniform(0, seconds[is_own]))
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(process.pid, signal.SIGKILL)
                code = ended(process)
                kills["came too late" if code >= 0 else "own command" if is_own else "at work"] += left_to_kill > 0
                if not left_to_kill:
                    seconds[is_own] = time.monotonic() - begun
                    found["errors of a command"] += code not in (0, 1, 2)
                found[saved_state(file, before, monitor, must_be_new=not left_to_kill)] += 1
                found["half-written files left"] += len(list(file.parent.glob(".*.unfinished"))) * (not left_to_kill)
            if night % 50 == 49:
                print(f"{night + 1} nights: {dict(kills)}, {dict(found)}", flush=True)
        different = differences(load_monitor(file), monitor)
    print(f"{options.nights} nights, {len(monitor.events_)} events, {monitor.counts_}")
    print("kills: " + ", ".join(f"{number} {name}" for name, number in sorted(kills.items())))
    print("found afterwards: " + ", ".join(f"{number} {name}" for name, number in sorted(found.items())))
    print(f"different from the undisturbed monitor in the end: {', '.join(different) or 'nothing'}")
    is_good = sum(found[name] for name in ("old state", "new state")) == sum(kills.values()) + options.nights
    failures = ("errors of a command", "half-written files left")
    sys.exit(bool(different) or not is_good or any(found[name] for name in failures))


def saved_state(file, before, after, *, must_be_new):
    """Which state a file holds."""
    try:
        loaded = load_monitor(file)
    except ValueError:
        return "file that cannot be read"
    if not differences(loaded, after):
        return "new state"
    return "old state" if not must_be_new and not differences(loaded, before) else "another state"


if __name__ == "__main__":
    main()
