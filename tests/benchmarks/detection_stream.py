"""Years of records at once: time and memory of whitening, damage index and windows, and the index beside its formula.

OMP_NUM_THREADS=1 python tests/benchmarks/detection_stream.py
OMP_NUM_THREADS=1 python tests/benchmarks/detection_stream.py --records 1_000_000 --missing 0.3
OMP_NUM_THREADS=1 python tests/benchmarks/detection_stream.py --baselines 20_000 500_000

The last one learns from long baselines instead: fit_transform and transform with scale="local" take time in proportion
to the records, and less than 4 GB. The exit code is 1 if they do not.
"""

import argparse
import resource
import sys
import time
from functools import partial

import numpy as np
from measure import median_seconds
from sklearn.linear_model import LinearRegression

from skthermo.detection import MahalanobisDetector, TemperatureCompensator, WindowedAlarm

N_TEMPERATURES, N_MODES = 7, 6
TARGETS = [*range(N_TEMPERATURES, N_TEMPERATURES + N_MODES)]
BASELINE = 8760
"""A year of hourly records."""


def records(random, n, missing):
    """Temperatures and frequencies side by side; frequencies scatter more in the cold."""
    air = 10 + 12 * np.sin(2 * np.pi * np.arange(n) / 8760) + random.normal(0, 4, n)
    X = np.empty((n, N_TEMPERATURES + N_MODES))
    X[:, :N_TEMPERATURES] = air[:, np.newaxis] + random.standard_normal((n, N_TEMPERATURES))
    scatter = 0.02 * (1 + np.clip(5 - air, 0, None) / 5)
    X[:, N_TEMPERATURES:] = [4, 5, 10, 11, 13, 17] - 0.01 * air[:, np.newaxis]
    X[:, N_TEMPERATURES:] += scatter[:, np.newaxis] * random.standard_normal((n, N_MODES))
    if missing:
        X[:, N_TEMPERATURES:][random.random((n, N_MODES)) < missing] = np.nan
    return X


def peak_gigabytes():
    """Most memory of the process so far."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e9 if sys.platform == "darwin" else peak * 1024 / 1e9


def timed(name, way):
    """What a way returns; prints its time, and the process's peak of memory."""
    start = time.perf_counter()
    result = way()
    print(f"  {name}: {time.perf_counter() - start:.1f} s, peak so far {peak_gigabytes():.2f} GB", flush=True)
    return result


def long_baselines(lengths, missing):
    """Whether time is linear in the records of baselines, and memory bounded."""
    seconds = {}
    for n in lengths:
        X = records(np.random.default_rng(0), n, missing)
        compensator = TemperatureCompensator(LinearRegression(), targets=TARGETS, scale="local")
        print(f"baseline of {n} records of {N_TEMPERATURES} temperatures and {N_MODES} modes")
        start = time.perf_counter()
        timed("fit_transform", partial(compensator.fit_transform, X))
        timed("transform", partial(compensator.transform, X))
        seconds[n] = time.perf_counter() - start
    growth = seconds[lengths[-1]] / seconds[lengths[0]] * lengths[0] / lengths[-1]
    print(f"seconds a record, last over first baseline, at most 2: {growth:.2f}")
    print(f"peak of memory, GB, at most 4: {peak_gigabytes():.2f}")
    return 1 if growth > 2 or peak_gigabytes() > 4 else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=10_000_000)
    parser.add_argument("--missing", type=float, default=0.0, help="share of frequencies that are missing")
    parser.add_argument("--rounds", type=int, default=7, help="of which the ratio takes medians")
    parser.add_argument("--baselines", type=int, nargs="*", help="lengths of long baselines, in place of a stream")
    options = parser.parse_args()
    if options.baselines:
        return long_baselines(options.baselines, options.missing)
    random = np.random.default_rng(0)
    baseline = records(random, BASELINE, options.missing)
    compensator = TemperatureCompensator(LinearRegression(), targets=TARGETS, scale="local")
    print(f"fitted to {BASELINE} records of {N_TEMPERATURES} temperatures and {N_MODES} modes")
    white = timed("compensator", lambda: compensator.fit_transform(baseline))
    print(f"    covariance by weather: {compensator.spread_.smoothing}")
    detector = timed("MahalanobisDetector", lambda: MahalanobisDetector().fit(white))
    mean = timed("WindowedAlarm, mean of 24", lambda: WindowedAlarm(24).fit(white))
    count = timed("WindowedAlarm, 12 of 24", lambda: WindowedAlarm(24, rule="m-of-n").fit(white))

    before = peak_gigabytes()
    X = records(random, options.records, options.missing)
    print(f"{options.records} new records, {options.missing:.0%} of frequencies missing: {X.nbytes / 1e9:.2f} GB")
    residuals = timed("transform", partial(compensator.transform, X))
    n_bytes = X.nbytes
    del X
    rates = {"damage_index": detector, "windows, mean of 24": mean, "windows, 12 of 24": count}
    for name, alarm in rates.items():
        index = timed(name, lambda alarm=alarm: alarm.damage_index(residuals))
        rates[name] = 100 * np.mean(index > alarm.threshold_)
        del index
    print(f"false alarms, %, 2 asked: {', '.join(f'{name} {rate:.2f}' for name, rate in rates.items())}")
    beyond = (peak_gigabytes() - before) * 1e9 / n_bytes - 1
    print(f"peak beyond the records themselves, in sizes of the records: {beyond:.1f}")

    if options.missing:
        return 0
    centre, precision = detector.covariance_.location_, detector.covariance_.precision_
    seconds = median_seconds(
        {
            "bare": lambda: np.sqrt(((residuals - centre) @ precision * (residuals - centre)).sum(axis=1)),
            "index": lambda: detector.damage_index(residuals),
        },
        options.rounds,
    )
    print(f"matrix product and root: {seconds['bare']:.2f} s, damage_index {seconds['index']:.2f} s (medians)")
    print(f"ratio of times, at most 2: {seconds['index'] / seconds['bare']:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
