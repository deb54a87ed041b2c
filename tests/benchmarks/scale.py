"""Large sizes: years of ten-minute records through every step, a monitor in service, and fleets.

    OMP_NUM_THREADS=1 python tests/benchmarks/scale.py
    OMP_NUM_THREADS=1 python tests/benchmarks/scale.py --rows 5256 52560 525600 --bridges 10 100 1000

Frequencies of the truss follow made-up weather, with noise that is correlated in time, gaps and outliers. Each part and
size has a process of its own, whose peak memory is printed. In the part "chain", the inverse is a linear regression,
which costs the same for each record; the part "defaults" has the defaults of all. "service" is a monitor that is fitted
to the first tenth of the records, and then updated by each of the other days; "fleet" are bridges with a year of hourly
records each, whose files are updated by a day. The exit code is 1 if a step takes more than three times as long a
record or bridge as with the next smaller size, where a quadratic one takes ten times as long, a part more than 4 GB, an
update of the last days more than twice as long as one of the first.
"""

import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
from harness import arguments, autoregression, compensated, peak_megabytes, shown
from inside import KnownBridge
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_fleet, make_truss
from skthermo.monitoring import Fleet, Monitor
from skthermo.preprocessing import (
    BlockedKFold,
    HampelFilter,
    HingeFeatures,
    KNNGapImputer,
    LagFeatures,
    SensorMeans,
    check_records,
)
from skthermo.reporting import owner_report
from skthermo.studies import DetectabilityStudy
from skthermo.surrogate import DataInformedFEM, InverseSurrogate

MOST_GIGABYTES, MOST_RATIO, MOST_GROWTH = 4.0, 3.0, 2.0
LEAST_SECONDS = 0.5  # of a step, below which its ratio says nothing
PER_DAY = 144
LEAST_BASELINE = 30 * PER_DAY  # records
N_FITTED = 4  # monitors of different bridges, which all bridges of a fleet share


def records(n_rows, n_seasons=1):
    """Three temperatures, and frequencies that follow them, with noise that is correlated in time."""
    random, row = np.random.default_rng(0), np.arange(n_rows)
    season, day = 10 * np.sin(2 * np.pi * row * n_seasons / n_rows), np.sin(2 * np.pi * row / 144)
    slow = 3 * autoregression(random, (n_rows, 1), 0.99)
    T = 10 + season[:, np.newaxis] + day[:, np.newaxis] * [5, 2, 0] + slow + random.standard_normal((n_rows, 3))
    theta = 1 - 4e-4 * (T[:, [0, 1, 2, 0]] - 10)
    F = make_truss().reduced(0.05, random_state=0).frequencies(theta)
    F *= 1 + 0.005 * autoregression(random, F.shape, 0.5)
    times = pd.date_range("2000", periods=n_rows, freq="10min")
    return pd.DataFrame(T, times, columns=["T1", "T2", "T3"]), pd.DataFrame(F, times).add_prefix("f")


def with_faults(F):
    """The same with 5 % of the values missing, records missing for two hours, and outliers."""
    random = np.random.default_rng(1)
    off = np.convolve(random.uniform(size=len(F)) < 0.004, np.ones(12))[: len(F)] > 0
    missing = (random.uniform(size=F.shape) < 0.05) | off[:, np.newaxis]
    return (F * np.where(random.uniform(size=F.shape) < 0.002, 1.06, 1.0)).mask(missing)


def preprocessing(T, F):
    some = np.random.default_rng(2).uniform(size=len(T)) < 0.95
    yield "checks of the records (check_records)", lambda: check_records(T, F)
    yield "outliers removed (HampelFilter)", lambda: HampelFilter().fit(F).transform(F)
    yield "gaps filled (KNNGapImputer)", lambda: KNNGapImputer().fit_transform(T.join(F))
    yield "24 hourly lags (LagFeatures)", lambda: LagFeatures(24, freq="1h").fit_transform(T)
    yield "the same, 5 % of the stamps missing", lambda: LagFeatures(24, freq="1h").fit_transform(T[some])
    yield "folds of blocks (BlockedKFold)", lambda: list(BlockedKFold().split(T))


def chain(T, F):
    fem = quick_chain()
    yield "fit, gaps filled", lambda: fem.fit(T, F)
    yield "residuals", lambda: fem.recorder_.residuals
    yield "predict", lambda: fem.predict(T)
    yield "predict_interval", lambda: fem.predict_interval(T)
    yield "simulate, noise fitted", lambda: fem.simulate(T, noise="fitted", random_state=0)
    fitted = dict.fromkeys(("noise", "gaps", "outliers"), "fitted")
    yield "simulate, noise, gaps and outliers fitted", lambda: fem.simulate(T, **fitted, random_state=0)


def quick_chain():
    inverse = InverseSurrogate(regressor=LinearRegression(), n_samples=200, noise=0.005)
    return DataInformedFEM(make_truss(), inverse=inverse, imputer=KNNGapImputer(), reduce=True, random_state=0)


def defaults(T, F, n_replicates=10):
    fem = DataInformedFEM(make_truss(), random_state=0)
    options = {"n_replicates": n_replicates, "random_state": 0}
    yield "fit of a chain", lambda: fem.fit(T, F)
    study = DetectabilityStudy(fem, detector_of(F), [{"bottom": 0.1}], **options)
    yield f"study of one detector and one state, {n_replicates} replicates", lambda: study.run(T)


def detector_of(F):
    return compensated(F, None, make_pipeline(HingeFeatures(), Ridge()), window="24h")


def service(T, F):
    X, first = T.join(F), max(len(T) // 10, LEAST_BASELINE)
    days = [X[row : row + PER_DAY] for row in range(first, len(X), PER_DAY)]
    monitor, file, seconds = Monitor(detector_of(F)), Path(tempfile.mkdtemp()) / "monitor.joblib", []

    def by_day():
        for day in days:
            start = time.process_time()
            monitor.update(day)
            seconds.append(time.process_time() - start)

    yield "fit to the first tenth", lambda: monitor.fit(X[:first])
    yield f"updates by {len(days)} days", by_day
    n_compared = min(len(days) // 2, 365)
    early, late = (np.median(seconds[part]) for part in (slice(n_compared), slice(-n_compared, None)))
    yield "save", lambda: monitor.save(file)
    yield "status", lambda: monitor.status("2026-01-01")
    yield "summary", lambda: monitor.summary()
    yield "owner's page", lambda: owner_report(monitor, file.with_suffix(".html"))
    grown = late > MOST_GROWTH * early
    says("an update, first year, ms", 1e3 * early)
    says("an update, last year, ms", 1e3 * late, is_missed=grown)
    for name, one in {"file, MB": file, "owner's page, MB": file.with_suffix(".html")}.items():
        says(name, one.stat().st_size / 1e6)


def says(name, value, *, is_missed=False):
    """Note something that is no time of a step."""
    print(json.dumps({"name": name, "value": float(value), "is_missed": bool(is_missed)}))


def made_fleet(n_bridges):
    """A folder of bridges with files of their own, of a few fitted monitors, and their new records of a day."""
    folder, many = Path(tempfile.mkdtemp()), range(n_bridges)
    fitted, days, fleet = [], [], Fleet._in(folder)
    for bridge in list(make_fleet(N_FITTED, kinds=["girder"], random_state=0).values()):
        records = bridge.records(372, "2025-01-01", samples_per_day=24)
        X = SensorMeans(bridge.roles).fit_transform(records.temperatures).join(records.frequencies)
        fitted.append(Monitor(detector_of(records.frequencies)).fit(X[:"2025-12-31"]))
        later = X["2026-01-01":]
        days.append([own for _, own in later.groupby(later.index.normalize())])
    for number in many:
        monitor = fitted[number % N_FITTED]
        fleet._put(KnownBridge(f"bridge {number:04}", is_fitted=True).after(monitor), (None, monitor))

    def new(day):
        found = {}
        for number in many:
            own, random = days[number % N_FITTED][day], np.random.default_rng([number, day])
            found[f"bridge {number:04}"] = own * (1 + 1e-4 * random.standard_normal(own.shape))
        return found

    return folder, new


def fleet(n_bridges):
    folder, new = made_fleet(n_bridges)
    yield "reading the folder", lambda: Fleet(folder)
    yield "update by a day", lambda: Fleet(folder).update(new(0))
    yield "table and summary", lambda: (Fleet(folder).table, Fleet(folder).summary())
    yield "status", lambda: Fleet(folder).status()
    yield "discoveries", lambda: Fleet(folder).discoveries()
    yield "owner's page", lambda: owner_report(Fleet(folder), folder / "fleet.html", now="2026-01-05")
    says("file of a bridge, MB", next(folder.glob("*.bridge")).stat().st_size / 1e6)
    shutil.rmtree(folder)


OF_RECORDS = (preprocessing, chain, defaults, service)
PARTS = {part.__name__: part for part in (*OF_RECORDS, fleet)}
TEN_MINUTES = "ten-minute records of the truss (3 temperatures, 6 frequencies, 5 % missing); processor seconds"
TITLES = {
    "preprocessing": f"Preparing {TEN_MINUTES}",
    "chain": f"A chain with a linear regression as M1, {TEN_MINUTES}",
    "defaults": f"Chain and study by default, {TEN_MINUTES}",
    "service": f"A monitor in service, {TEN_MINUTES}",
    "fleet": "A fleet with baselines of a year of hourly records; processor seconds",
}


def one(part, size, **options):
    """Print seconds of each step of a part, and gigabytes, as lines of JSON."""
    if part is fleet:
        steps = part(size)
    else:
        T, F = records(size, 10 if part is service else 1)
        steps = part(T, with_faults(F), **options)
    for step, way in steps:
        start = time.process_time()
        way()
        print(json.dumps({"name": step, "seconds": time.process_time() - start}), flush=True)
    says("peak memory of the process, GB", peak_megabytes() / 1e3, is_missed=peak_megabytes() > 1e3 * MOST_GIGABYTES)


def main():
    options = arguments(
        __doc__,
        rows=[5_256, 52_560],
        bridges=[10, 100],
        parts=PARTS,
        replicates=(10, "of the study of the part defaults"),
        one=(False, "in this process, for the script itself"),
    )
    if options.one:
        part = PARTS[options.parts[0]]
        more = {"n_replicates": options.replicates} if part is defaults else {}
        one(part, (options.bridges if part is fleet else options.rows)[0], **more)
        return 0
    missed = 0
    for part in options.parts:
        option, what, sizes = "rows", "record", options.rows
        if PARTS[part] is fleet:
            option, what, sizes = "bridges", "bridge", options.bridges
        seconds, others = {}, {}
        for size in sizes:
            command = [sys.executable, __file__, "--one", f"--{option}", str(size), "--parts", part]
            command += ["--replicates", str(options.replicates)]
            done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
            found = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
            seconds[size] = {line["name"]: line["seconds"] for line in found if "seconds" in line}
            others[size] = {line["name"]: line["value"] for line in found if "value" in line}
            missed += sum(line.get("is_missed", False) for line in found)
        times, last = pd.DataFrame(seconds), sizes[-1]
        each = times / times.columns.to_numpy()
        table = pd.concat([times, pd.DataFrame(others)])
        table.columns = [f"{size:,} {what}s" for size in sizes]
        if len(sizes) > 1:
            ratios = (each / each.shift(axis=1)).where(times >= LEAST_SECONDS)
            missed += int((ratios > MOST_RATIO).to_numpy().sum())
            grown = last / sizes[-2]
            table[f"times as long for {grown:g} times the {what}s"] = grown * ratios[last]
        shown(TITLES[part], table, "3g")
    print(f"steps that take over {MOST_RATIO:g} times as long a row, parts of over {MOST_GIGABYTES:g} GB: {missed}")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
