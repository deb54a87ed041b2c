"""Fitted noise and intervals of many records: seconds and memory for each number of rows, trained and simulated.

    OMP_NUM_THREADS=1 python tests/benchmarks/many_records.py

A chain of the truss learns from so many records at ten minutes of made-up weather, predicts intervals for all of them,
and simulates them with noise="fitted". Each number of rows has a process of its own; memory is the most that it took.
The exit code is 1 if half a million rows take more than 4 GB, or more than twice as many seconds a row as the fewest.
"""

import argparse
import resource
import subprocess
import sys
import time

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from skthermo.datasets import make_truss
from skthermo.surrogate import DataInformedFEM, InverseSurrogate

MOST_GIGABYTES, MOST_RATIO = 4.0, 2.0
STEPS = ("fit", "residuals", "predict_interval", "simulate")


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


def one_size(n_rows):
    """Print seconds of each step, and gigabytes."""
    T, F = records(n_rows)
    inverse = InverseSurrogate(noise=0.005, reduce=True)
    fem = DataInformedFEM(make_truss(), inverse=inverse, reduce=True, random_state=0)
    ways = [
        lambda: fem.fit(T, F),
        lambda: fem.residuals_,
        lambda: fem.predict_interval(T),
        lambda: fem.simulate(T, noise="fitted", random_state=0),
    ]
    for way in ways:
        start = time.process_time()
        way()
        print(f"{time.process_time() - start:.2f}", end=" ")
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, nargs="+", default=[20_000, 500_000])
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        one_size(options.one)
        return
    sizes = {}
    for n_rows in options.rows:
        command = [sys.executable, __file__, "--one", str(n_rows)]
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        sizes[n_rows] = [float(word) for word in output.split()]
    table = pd.DataFrame(sizes, [*(f"{step}, processor s" for step in STEPS), "memory, GB"]).T
    print(table.round(2).to_string(), end="\n\n")
    first, last = table.iloc[0], table.iloc[-1]
    ratio = (last.iloc[2:4] / first.iloc[2:4]).max() / (table.index[-1] / table.index[0])
    print(f"seconds a row of intervals and noise, most over fewest rows, at most {MOST_RATIO:g}: {ratio:.2f}")
    print(f"memory of {table.index[-1]} rows, GB, at most {MOST_GIGABYTES:g}: {last.iloc[-1]:.2f}")
    sys.exit(int(ratio > MOST_RATIO or last.iloc[-1] > MOST_GIGABYTES))


if __name__ == "__main__":
    main()
