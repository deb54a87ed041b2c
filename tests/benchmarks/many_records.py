"""Records of a month to ten years at ten minutes through every step: microseconds a row, and memory.

    OMP_NUM_THREADS=1 python tests/benchmarks/many_records.py
    OMP_NUM_THREADS=1 python tests/benchmarks/many_records.py --rows 5256 52560 525600
    OMP_NUM_THREADS=1 python tests/benchmarks/many_records.py --rows 52560 525600 --parts detection

Frequencies of the truss follow made-up weather, with noise that is correlated in time, gaps and outliers. Each part and
number of rows has a process of its own, whose peak memory is printed. The inverse is a linear regression without
refinement, which costs the same for each row and is not measured here. A study of half a million rows is left out: it
is as many simulations, one after the other. The exit code is 1 if a step takes more than three times as many seconds a
row as with the next smaller number of rows, where a quadratic one takes ten times as many, or a part more than 4 GB.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
import warnings

import numpy as np
import pandas as pd
from scipy.signal import lfilter
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss
from skthermo.detection import MahalanobisDetector, TemperatureCompensator, WindowedAlarm
from skthermo.monitoring import Monitor
from skthermo.preprocessing import BlockedKFold, HampelFilter, KNNGapImputer, LagFeatures, check_records
from skthermo.studies import DetectabilityStudy
from skthermo.surrogate import DataInformedFEM, InverseSurrogate

MOST_GIGABYTES, MOST_RATIO = 4.0, 3.0
LEAST_SECONDS = 0.5  # of a step, below which its ratio says nothing
MOST_STUDIED = 100_000  # rows


def memory(rows, correlation, random):
    """Stationary series of unit variance whose columns remember what was before."""
    return lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], random.standard_normal(rows), axis=0)


def records(n_rows):
    """Three temperatures, and frequencies that follow them, with noise that is correlated in time."""
    random, row = np.random.default_rng(0), np.arange(n_rows)
    season, day = 10 * np.sin(2 * np.pi * row / n_rows), np.sin(2 * np.pi * row / 144)
    slow = 3 * memory((n_rows, 1), 0.99, random)
    T = 10 + season[:, np.newaxis] + day[:, np.newaxis] * [5, 2, 0] + slow + random.standard_normal((n_rows, 3))
    theta = 1 - 4e-4 * (T[:, [0, 1, 2, 0]] - 10)
    F = make_truss().reduced(0.05, random_state=0).frequencies(theta)
    F *= 1 + 0.005 * memory(F.shape, 0.5, random)
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
    yield "residuals()", lambda: fem.residuals()
    yield "predict", lambda: fem.predict(T)
    yield "predict_interval", lambda: fem.predict_interval(T)
    yield "simulate, fitted noise", lambda: fem.simulate(T, noise="fitted", random_state=0)
    fitted = dict.fromkeys(("noise", "gaps", "outliers"), "fitted")
    yield "simulate, gaps and outliers", lambda: fem.simulate(T, **fitted, random_state=0)


def quick_chain():
    inverse = InverseSurrogate(regressor=LinearRegression(), n_samples=200, noise=0.005, refine=0, reduce=True)
    return DataInformedFEM(make_truss(), inverse=inverse, imputer=KNNGapImputer(), reduce=True, random_state=0)


def compensator(F):
    lags = LagFeatures([0, 1, 6], freq="1h")
    return TemperatureCompensator(make_pipeline(lags, LinearRegression()), targets=list(F), whiten="local")


def detection(T, F):
    X, whitening, found = T.join(F), compensator(F), {}
    detector, windows, counts = MahalanobisDetector(), WindowedAlarm("24h"), WindowedAlarm("24h", rule="m-of-n")
    yield "whitening, fit_transform", lambda: found.update(white=whitening.fit_transform(X))
    yield "whitening, transform", lambda: whitening.transform(X)
    yield "MahalanobisDetector, gaps", lambda: detector.fit(found["white"])
    yield "MahalanobisDetector, complete", lambda: MahalanobisDetector().fit(found["white"].fillna(0.0))
    yield "MahalanobisDetector, predict", lambda: detector.predict(found["white"])
    yield "WindowedAlarm, mean", lambda: windows.fit(found["white"])
    yield "WindowedAlarm, m of n", lambda: counts.fit(found["white"])
    yield "WindowedAlarm, predict", lambda: windows.predict(found["white"])


def monitoring(T, F):
    X, half = T.join(F), len(T) // 2
    monitor = Monitor(make_pipeline(compensator(F), WindowedAlarm("24h")))
    yield "Monitor, fit to half", lambda: monitor.fit(X[:half])
    yield "Monitor, update with half", lambda: monitor.update(X[half:])


def study(T, F):
    fem, names = quick_chain().fit(T, F), list(F)
    whole = make_pipeline(TemperatureCompensator(LinearRegression(), targets=names), MahalanobisDetector())
    scenarios = [{"bottom": 0.1}]
    options = {"n_repeats": 2, "uncertainty": ("noise",), "random_state": 0}
    yield "DetectabilityStudy", lambda: DetectabilityStudy(fem, whole, scenarios, **options).run(T, baseline=T.join(F))


PARTS = {part.__name__: part for part in (preprocessing, chain, detection, monitoring, study)}


def one(part, n_rows):
    """Print seconds of each step of a part, and gigabytes, as JSON."""
    T, F = records(n_rows)
    seconds = {}
    for step, way in PARTS[part](T, with_faults(F)):
        start = time.process_time()
        way()
        seconds[step] = time.process_time() - start
    gigabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(json.dumps({"seconds": seconds, "gigabytes": gigabytes}))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, nargs="+", default=[5_256, 52_560])
    parser.add_argument("--parts", nargs="+", default=[*PARTS], choices=[*PARTS])
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    if options.one:
        one(options.parts[0], options.rows[0])
        return 0
    missed = 0
    for part in options.parts:
        sizes = [n_rows for n_rows in options.rows if part != "study" or n_rows <= MOST_STUDIED]
        seconds, gigabytes = {}, {}
        for n_rows in sizes:
            command = [sys.executable, __file__, "--one", "--rows", str(n_rows), "--parts", part]
            found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            seconds[n_rows], gigabytes[n_rows] = found["seconds"], found["gigabytes"]
        table = pd.DataFrame(seconds)
        a_row = table / table.columns.to_numpy()
        ratios = (a_row / a_row.shift(axis=1)).where(table >= LEAST_SECONDS)
        shown = pd.concat({"processor s": table.round(2), "us a row": (1e6 * a_row).round(1)}, axis=1)
        shown["ratio"] = ratios.iloc[:, -1].round(2)
        memory_used = ", ".join(f"{gigabytes[n_rows]:.2f} GB of {n_rows} rows" for n_rows in sizes)
        print(f"{part}: at most {memory_used}\n\n{shown.to_string()}\n", flush=True)
        missed += int((ratios > MOST_RATIO).to_numpy().sum() + (max(gigabytes.values(), default=0.0) > MOST_GIGABYTES))
    print(f"steps that take over {MOST_RATIO:g} times as long a row, parts of over {MOST_GIGABYTES:g} GB: {missed}")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
