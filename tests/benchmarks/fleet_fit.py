"""Many bridges fitted and monitored side by side: time, memory, disk, killed processes, the same bits on Dask.

    OMP_NUM_THREADS=1 python tests/benchmarks/fleet_fit.py
    OMP_NUM_THREADS=1 python tests/benchmarks/fleet_fit.py --quick

Bridges of ``make_fleet``, each with a year of daily records, an FE model that is a little wrong and a monitor; models
and records are made in the workers. Then the monitors evaluate half a year in which every tenth bridge loses 30 % of a
group. The largest memory of this process and of its workers is that of all times, as Linux counts it (VmHWM).

Some of the bridges are then fitted again with a worker killed by SIGKILL midway, beside a bridge whose maker always
kills its process and one whose records are broken, and on the workers of a Dask cluster. The folder is also used again:
nothing is fitted anew. The exit code is 1 if bridges are missing, if any bits differ, if the bridge that is always
killed is not reported, if a worker needs more than 2 GB, or if more healthy bridges are significant than damaged ones.
"""

import contextlib
import os
import signal
import sys
import tempfile
import threading
import time
from functools import partial
from pathlib import Path

import joblib
from harness import arguments, timed
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_fleet
from skthermo.detection import TemperatureCompensator, WindowedAlarm
from skthermo.fleet import fit_fleet
from skthermo.monitoring import Monitor
from skthermo.preprocessing import BiasAligner, HingeFeatures, SensorMeans
from skthermo.surrogate import DataInformedFEM, TemperatureMapper

YEAR, LATER = 365, 183  # days
EVERY, SEVERITY = 10, 0.3  # which bridges are damaged later, and how much
MOST_MEGABYTES = 2000


def make_chain(bridge):
    mapper = make_pipeline(SensorMeans(bridge.roles), TemperatureMapper())
    return DataInformedFEM(bridge.model, aligner=BiasAligner(bridge.model, method="scale"), mapper=mapper)


def baseline(bridge):
    records = bridge.records(YEAR)
    return records.temperatures, records.frequencies


def later(bridge, is_damaged):
    damage = {bridge.groups[0]: SEVERITY} if is_damaged else None
    records = bridge.records(YEAR + LATER, damage=damage)
    return records.temperatures.iloc[YEAR:], records.frequencies.iloc[YEAR:]


def watch(chain):
    weather = make_pipeline(HingeFeatures(), Ridge())
    compensator = TemperatureCompensator(weather, targets=list(chain.mode_names_))
    return Monitor(make_pipeline(compensator, WindowedAlarm("5D", rule="m-of-n")))


def end_process():
    os.kill(os.getpid(), signal.SIGKILL)


def no_records():
    raise FileNotFoundError("no file of this bridge")


def children():
    """Processes of this one, by their files in /proc."""
    found = [file.read_text().split() for file in Path("/proc/self/task").glob("*/children")]
    return [int(number) for numbers in found for number in numbers]


def megabytes(process):
    """Largest memory that a process has had; 0 if it has ended."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        status = Path(f"/proc/{process}/status").read_text()
        return int(status.partition("VmHWM:")[2].split()[0]) / 1e3
    return 0.0


class Watched(threading.Thread):
    """Watches the memory of workers, and kills one of them after so many seconds."""

    def __init__(self, kill_after=None):
        super().__init__(daemon=True)
        self.kill_after, self.most, self.killed, self.is_over = kill_after, 0.0, None, threading.Event()

    def run(self):
        start = time.monotonic()
        while not self.is_over.wait(0.2):
            workers = [process for process in children() if megabytes(process) > 100]  # not loky's tracker
            self.most = max([self.most, *map(megabytes, workers)])
            if self.kill_after and not self.killed and workers and time.monotonic() - start > self.kill_after:
                self.killed = workers[0]
                os.kill(self.killed, signal.SIGKILL)

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.is_over.set()
        self.join()


def bits(fleet, names, campaign):
    """What each bridge predicts and by which threshold it evaluates, as one text."""
    found = {}
    for name in names:
        if name in fleet.chains:
            weather = campaign[name].records(30).temperatures
            monitor = fleet.monitors[name]
            found[name] = joblib.hash(
                (fleet.chains[name].predict(weather), monitor.threshold_, monitor.clear_threshold_)
            )
    return found


def main():
    options = arguments(
        __doc__,
        bridges=200,
        again=(24, "bridges of the runs with killed workers and with Dask"),
        jobs=2,
        kill_after=(20.0, "seconds until a worker is killed"),
        quick=(False, "8 bridges, 4 of them again"),
    )
    if options.quick:
        options.bridges, options.again, options.kill_after = 8, 4, 10.0
    campaign = make_fleet(options.bridges, random_state=0)
    makers = {name: partial(make_chain, bridge) for name, bridge in campaign.items()}
    records = {name: partial(baseline, bridge) for name, bridge in campaign.items()}
    again = list(campaign)[: options.again]
    good = True

    with tempfile.TemporaryDirectory() as folder:
        given = {"monitor": watch, "folder": folder, "n_jobs": options.jobs}
        with Watched() as watched:
            seconds, fleet = timed(lambda: fit_fleet(makers, records, **given), time.perf_counter)
        own = fleet.table["seconds"].sum()
        size = sum(file.stat().st_size for file in Path(folder).iterdir()) / 1e6
        print(f"{options.bridges} bridges, {options.jobs} jobs: {seconds:.0f} s ({own:.0f} s in the workers)")
        print(f"memory at most: this process {megabytes('self'):.0f} MB, a worker {watched.most:.0f} MB")
        print(f"on disk: {size:.1f} MB, {1e3 * size / options.bridges:.0f} kB a bridge")
        good &= bool(fleet.table["is_fitted"].all()) and watched.most < MOST_MEGABYTES
        reference = bits(fleet, again, campaign)

        damaged = set(list(campaign)[::EVERY])
        new = {name: partial(later, bridge, name in damaged) for name, bridge in campaign.items()}
        seconds, answers = timed(lambda: fleet.update(new, options.jobs), time.perf_counter)
        print(f"{len(answers)} records of {LATER} days evaluated in {seconds:.0f} s")
        print(fleet.summary())
        found = fleet.discoveries()
        print(found.summary())
        false = [name for name in found.bridges if name not in damaged]
        alarmed = set(fleet.table.index[fleet.table["n_events"] > 0])
        n_found, n_called = len(damaged & alarmed), len(damaged & set(found.bridges))
        print(f"damaged: {len(damaged)}, of which {n_found} had an event and {n_called} are significant")
        print(f"healthy: {len(alarmed - damaged)} had an event, {len(false)} are significant")
        good &= len(false) <= len(damaged)

        seconds, same = timed(lambda: fit_fleet(makers, records, **given), time.perf_counter)
        print(f"the same call again: {seconds:.0f} s")
        good &= same.table["n_evaluated"].equals(fleet.table["n_evaluated"])

    some = ({n: makers[n] for n in again} | {"killer": end_process}, {n: records[n] for n in again})
    some[0]["broken"], some[1]["broken"], some[1]["killer"] = makers[again[0]], no_records, records[again[0]]
    with Watched(options.kill_after) as watched:
        disturbed = fit_fleet(*some, monitor=watch, n_jobs=options.jobs)
    print(f"{len(again)} of them, one worker killed and two bad bridges")
    print(disturbed.errors[["bridge", "stage", "error"]].to_string(index=False))
    is_same = bits(disturbed, again, campaign) == reference
    print(f"killed worker: {watched.killed}; all others are there with the same bits: {is_same}")
    said = "its process was killed" in disturbed.table.loc["killer", "error"]
    good &= is_same and said and bool(watched.killed)

    try:
        from dask.distributed import Client
    except ImportError:
        print("Dask is not installed")
        return 0 if good else 1
    with Client(n_workers=2, threads_per_worker=1, dashboard_address=None), joblib.parallel_config("dask"):
        there = fit_fleet({n: makers[n] for n in again}, {n: records[n] for n in again}, monitor=watch)
    is_same = bits(there, again, campaign) == reference
    print(f"{len(again)} of them on a Dask cluster of two workers, same: {is_same}")
    return 0 if good and is_same else 1


if __name__ == "__main__":
    sys.exit(main())
