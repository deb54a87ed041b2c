"""LagFeatures against pandas' shift and concat.

    OMP_NUM_THREADS=1 python tests/benchmarks/lag_features.py

Medians of several rounds in one run. Peak memory is what one call allocates beyond its input.
"""

import argparse

import numpy as np
import pandas as pd
from measure import median_seconds, peak_megabytes

from skthermo.preprocessing import LagFeatures


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=100_000)
    parser.add_argument("--sensors", type=int, default=7)
    parser.add_argument("--lags", type=int, default=24)
    parser.add_argument("--rounds", type=int, default=7)
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
    medians = median_seconds(ways, options.rounds)
    reference = medians["pandas shift and concat"]
    output = values.nbytes * lags / 1e6
    print(f"{options.rows} x {options.sensors}, {lags} lags ({output:.0f} MB out), median of {options.rounds} rounds")
    print(f"{'':40s} seconds   over pandas   peak MB")
    for name, way in ways.items():
        print(f"{name:40s} {medians[name]:7.3f}   {medians[name] / reference:11.2f}   {peak_megabytes(way):7.1f}")


if __name__ == "__main__":
    main()
