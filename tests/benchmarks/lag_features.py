"""LagFeatures against pandas' shift and concat.

    OMP_NUM_THREADS=1 python tests/benchmarks/lag_features.py
    OMP_NUM_THREADS=1 python tests/benchmarks/lag_features.py --rows 8760 --most 1.5

Medians of processor time over several rounds in one run; each result is kept until the next one is there. Both write
the result once, which takes about half of the time of many rows; checks of the input are most of that of few. Peak
memory is what one call allocates beyond its input. The exit code is 1 if LagFeatures takes more than ``--most`` of what
pandas takes, by time.
"""

import argparse
import sys
import time
from functools import partial

import numpy as np
import pandas as pd
from measure import median_seconds, peak_megabytes

from skthermo.preprocessing import LagFeatures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=100_000)
    parser.add_argument("--sensors", type=int, default=7)
    parser.add_argument("--lags", type=int, default=24)
    parser.add_argument("--rounds", type=int, default=25)
    parser.add_argument("--most", type=float, default=0.8, help="largest ratio to pandas")
    options = parser.parse_args()
    values = np.random.default_rng(0).standard_normal((options.rows, options.sensors))
    names = [f"T{i + 1}" for i in range(options.sensors)]
    stamped = pd.DataFrame(values, columns=names, index=pd.date_range("2020", periods=options.rows, freq="h"))
    plain = stamped.reset_index(drop=True)
    lags = options.lags
    ways = {
        "pandas shift and concat": lambda: pd.concat([plain.shift(k) for k in range(lags)], axis=1),
        "pandas shift by time and concat": lambda: pd.concat(
            [stamped.shift(k, freq="h").reindex(stamped.index) for k in range(lags)], axis=1
        ),
        "LagFeatures, array": lambda: LagFeatures(lags).fit_transform(values),
        "LagFeatures, frame": lambda: LagFeatures(lags).fit_transform(plain),
        "LagFeatures, by time": lambda: LagFeatures(lags, freq="1h").fit_transform(stamped),
    }
    kept = {}
    ways = {name: partial(lambda way: kept.update(result=way()), way) for name, way in ways.items()}
    medians = median_seconds(ways, options.rounds, time.process_time)
    ratios = {name: seconds / medians["pandas shift and concat"] for name, seconds in medians.items()}
    output = values.nbytes * lags / 1e6
    print(f"{options.rows} x {options.sensors}, {lags} lags ({output:.0f} MB out), median of {options.rounds} rounds")
    print(f"{'':40s} processor s   over pandas   peak MB")
    for name, way in ways.items():
        print(f"{name:40s} {medians[name]:11.4f}   {ratios[name]:11.2f}   {peak_megabytes(way):7.1f}")
    ratio = ratios["LagFeatures, by time"]
    print(f"by time over pandas, at most {options.most:g}: {ratio:.2f}")
    return int(ratio > options.most)


if __name__ == "__main__":
    sys.exit(main())
