"""KNNGapImputer against KNNImputer, and its growth with the number of rows.

    OMP_NUM_THREADS=1 python tests/benchmarks/gap_imputer.py

Seven correlated columns with 10 % missing at random. Peak memory is what one call allocates beyond its input.
"""

import argparse

import numpy as np
from measure import median_seconds, peak_megabytes
from sklearn.impute import KNNImputer

from skthermo.preprocessing import KNNGapImputer


def gappy(n_rows):
    random = np.random.default_rng(0)
    values = random.standard_normal((n_rows, 7)) @ random.standard_normal((7, 7))
    return np.where(random.random(values.shape) < 0.1, np.nan, values)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=30_000, help="rows of the comparison")
    parser.add_argument("--most", type=int, default=240_000, help="rows up to which growth is measured")
    parser.add_argument("--rounds", type=int, default=1)
    options = parser.parse_args()
    data = gappy(options.rows)
    ways = {
        "KNNImputer": lambda: KNNImputer(n_neighbors=10).fit_transform(data),
        "KNNGapImputer": lambda: KNNGapImputer().fit_transform(data),
    }
    medians = median_seconds(ways, options.rounds)
    print(f"{options.rows} x 7, 10 % missing: " + ", ".join(f"{name} {s:.2f} s" for name, s in medians.items()))
    print(f"ratio {medians['KNNImputer'] / medians['KNNGapImputer']:.1f}")
    print(f"largest difference {np.abs(ways['KNNImputer']() - ways['KNNGapImputer']()).max():.1e}")
    print("\n   rows   seconds   microseconds / (n log n)   peak MB")
    n_rows = options.rows
    while n_rows <= options.most:
        larger = gappy(n_rows)
        way = {"fill": lambda larger=larger: KNNGapImputer().fit_transform(larger)}
        seconds = median_seconds(way, options.rounds)["fill"]
        peak = peak_megabytes(way["fill"])
        print(f"{n_rows:7d}   {seconds:7.2f}   {1e6 * seconds / (n_rows * np.log(n_rows)):24.2f}   {peak:7.1f}")
        n_rows *= 2


if __name__ == "__main__":
    main()
