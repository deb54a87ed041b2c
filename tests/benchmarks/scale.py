"""Large sizes: records of a month to ten years at ten minutes through every step, and fleets of ten to 1000 bridges.

    OMP_NUM_THREADS=1 python tests/benchmarks/scale.py
    OMP_NUM_THREADS=1 python tests/benchmarks/scale.py --rows 5256 52560 525600 --bridges 10 100 1000
    OMP_NUM_THREADS=1 python tests/benchmarks/scale.py --rows 5256 --bridges 4

Frequencies of the truss follow made-up weather, with noise that is correlated in time, gaps and outliers. Each part and
size has a process of its own, whose peak memory, without that of its workers, is printed. In the part
"chain", the inverse is a linear regression, which costs the same for each row and is not measured here; the part
"defaults" has the defaults of all. "service" is a monitor that is fitted to the first tenth of the
records, a year of ten, and then updated by each of the other days; "fleet" are bridges with a year of hourly records
each, whose files are updated by a day, in seconds by the clock. The exit code is 1 if a step takes more than three
times as many seconds a row or bridge as with the next smaller size, where a quadratic one takes ten times as many, a
part more than 4 GB, an update of the last days more than twice as long as one of the first.
"""

import json
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
from harness import arguments, autoregression, compensated, peak_megabytes, shown
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_fleet, make_truss
from skthermo.detection import WindowedAlarm
from skthermo.fleet import Fleet
from skthermo.fleet._fleet import Storage
from skthermo.fleet._workers import BridgeOutcome, known_of, pickled
from skthermo.monitoring import Monitor
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
    yield "check_records", lambda: check_records(T, F)
    yield "HampelFilter", lambda: HampelFilter().fit(F).transform(F)
    yield "KNNGapImputer", lambda: KNNGapImputer().fit_transform(T.join(F))
    yield "LagFeatures, 24 h", lambda: LagFeatures(24, freq="1h").fit_transform(T)
    yield "LagFeatures, rows missing", lambda: LagFeatures(24, freq="1h").fit_transform(T[some])
    yield "BlockedKFold", lambda: list(BlockedKFold().split(T))


def chain(T, F):
    fem = quick_chain()
    yield "fit", lambda: fem.fit(T, F)
    yield "residuals", lambda: fem.recorder_.residuals
    yield "predict", lambda: fem.predict(T)
    yield "predict_interval", lambda: fem.predict_interval(T)
    yield "simulate, fitted noise", lambda: fem.simulate(T, noise="fitted", random_state=0)
    fitted = dict.fromkeys(("noise", "gaps", "outliers"), "fitted")
    yield "simulate, gaps and outliers", lambda: fem.simulate(T, **fitted, random_state=0)


def quick_chain():
    inverse = InverseSurrogate(regressor=LinearRegression(), n_samples=200, noise=0.005)
    return DataInformedFEM(make_truss(), inverse=inverse, imputer=KNNGapImputer(), reduce=True, random_state=0)


def defaults(T, F, n_replicates=10):
    fem = DataInformedFEM(make_truss(), random_state=0)
    options = {"n_replicates": n_replicates, "random_state": 0}
    yield "fit", lambda: fem.fit(T, F)
    yield "DetectabilityStudy", lambda: DetectabilityStudy(fem, detector_of(F), [{"bottom": 0.1}], **options).run(T)


def detector_of(F):
    return compensated(F, WindowedAlarm("24h"), make_pipeline(HingeFeatures(), Ridge()))


def service(T, F):
    X, first = T.join(F), max(len(T) // 10, LEAST_BASELINE)
    days = [X[row : row + PER_DAY] for row in range(first, len(X), PER_DAY)]
    monitor, file, seconds = Monitor(detector_of(F)), Path(tempfile.mkdtemp()) / "monitor.joblib", []

    def by_day():
        for day in days:
            start = time.process_time()
            monitor.update(day)
            seconds.append(time.process_time() - start)

    yield "Monitor, fit to a tenth", lambda: monitor.fit(X[:first])
    yield "Monitor, all days", by_day
    n_compared = min(len(days) // 2, 365)
    early, late = (np.median(seconds[part]) for part in (slice(n_compared), slice(-n_compared, None)))
    yield "save", lambda: monitor.save(file)
    yield "status", lambda: monitor.status("2026-01-01")
    yield "summary", lambda: monitor.summary()
    yield "owner_report", lambda: owner_report(monitor, file.with_suffix(".html"))
    megabytes, of_page = (one.stat().st_size / 1e6 for one in (file, file.with_suffix(".html")))
    says(
        f"an update by a day takes {1e3 * early:.0f} ms at first and {1e3 * late:.0f} ms at last, {len(days)} days; "
        f"the file has {megabytes:.1f} MB, the page {of_page:.1f} MB",
        is_missed=late > MOST_GROWTH * early,
    )


def says(text, *, is_missed=False):
    """Note something that is no time of a step."""
    print(json.dumps({"text": text, "is_missed": bool(is_missed)}))


def fleet(n_bridges):
    """Bridges with files of their own, of a few fitted monitors, and new records of two days."""
    folder, many = Path(tempfile.mkdtemp()), range(n_bridges)
    fitted, days = [], {}
    for bridge in list(make_fleet(N_FITTED, kinds=["girder"], random_state=0).values()):
        records = bridge.records(372, "2025-01-01", samples_per_day=24)
        X = SensorMeans(bridge.roles).fit_transform(records.temperatures).join(records.frequencies)
        monitor = Monitor(detector_of(records.frequencies)).fit(X[:"2025-12-31"])
        fitted.append((BridgeOutcome("", is_fitted=True, **known_of(monitor)), pickled((None, monitor))))
        days[len(fitted) - 1] = [own for _, own in X["2026-01-01":].groupby(X["2026-01-01":].index.normalize())]
    storage = Storage(folder)
    with storage.alone():
        for number in many:
            outcome, content = fitted[number % N_FITTED]
            storage.put(replace(outcome, name=f"bridge {number:04}"), content)

    def new(day):
        found = {}
        for number in many:
            own, random = days[number % N_FITTED][day], np.random.default_rng([number, day])
            found[f"bridge {number:04}"] = own * (1 + 1e-4 * random.standard_normal(own.shape))
        return found

    processor = []

    def alone():
        start = time.process_time()
        Fleet(folder).update(new(0))
        processor.append(time.process_time() - start)

    yield "Fleet(folder)", lambda: Fleet(folder)
    yield "update, one process", alone
    yield "update, n_jobs=2", lambda: Fleet(folder).update(new(1), n_jobs=2)
    yield "update, two workers of Dask", lambda: by_dask(lambda: Fleet(folder).update(new(2)))
    yield "table and summary", lambda: (Fleet(folder).table, Fleet(folder).summary())
    yield "status", lambda: Fleet(folder).status()
    yield "discoveries", lambda: Fleet(folder).discoveries()
    yield "owner_report", lambda: owner_report(Fleet(folder), folder / "fleet.html", now="2026-01-05")
    megabytes = next(folder.glob("*.bridge")).stat().st_size / 1e6
    says(f"{1e3 * processor[0] / n_bridges:.0f} ms of a processor a bridge, whose file has {megabytes:.2f} MB")
    shutil.rmtree(folder)


def by_dask(way):
    import dask
    from dask.distributed import Client

    dask.config.set({"distributed.admin.low-level-log-length": 10})  # messages, in which monitors travel
    with Client(n_workers=2, threads_per_worker=1, dashboard_address=None), joblib.parallel_config("dask"):
        return way()


OF_RECORDS = (preprocessing, chain, defaults, service)
PARTS = {part.__name__: part for part in (*OF_RECORDS, fleet)}


def one(part, size, **options):
    """Print seconds of each step of a part, and gigabytes, as lines of JSON."""
    if part is fleet:
        steps, clock = fleet(size), time.perf_counter
    else:
        T, F = records(size, 10 if part is service else 1)
        steps, clock = part(T, with_faults(F), **options), time.process_time
    for step, way in steps:
        start = clock()
        way()
        print(json.dumps({"step": step, "seconds": clock() - start}), flush=True)
    print(json.dumps({"gigabytes": peak_megabytes() / 1e3}))


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
        what, sizes = ("bridge", options.bridges) if part == "fleet" else ("row", options.rows)
        seconds, peaks, texts = {}, {}, []
        for size in sizes:
            command = [sys.executable, __file__, "--one", f"--{what}s", str(size), "--parts", part]
            command += ["--replicates", str(options.replicates)]
            done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
            found = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
            seconds[size] = {line["step"]: line["seconds"] for line in found if "step" in line}
            peaks[size] = found[-1]["gigabytes"]
            texts += [f"{size} {what}s: {line['text']}" for line in found if "text" in line]
            missed += sum(line.get("is_missed", False) for line in found)
        table = pd.DataFrame(seconds)
        each = table / table.columns.to_numpy()
        ratios = (each / each.shift(axis=1)).where(table >= LEAST_SECONDS)
        table = pd.concat({"seconds": table, f"us a {what}": 1e6 * each}, axis=1)
        table["ratio"] = ratios.iloc[:, -1]
        memory_used = ", ".join(f"{peak:.2f} GB of {size} {what}s" for size, peak in peaks.items())
        shown("\n".join([f"{part}: at most {memory_used}", *texts]), table)
        missed += int((ratios > MOST_RATIO).to_numpy().sum() + (max(peaks.values(), default=0.0) > MOST_GIGABYTES))
    print(f"steps that take over {MOST_RATIO:g} times as long a row, parts of over {MOST_GIGABYTES:g} GB: {missed}")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
