"""The paper's Table 3 from one study for each realisation of the truss, with Gaussian and with fitted noise.

    OMP_NUM_THREADS=1 python tests/benchmarks/detectability_truss.py

The chain and the detector (98th percentile, as in the paper) learn one healthy year. The truth is the
thermo-mechanical law with the same weather and 1 % noise. The studies and the tables are those of
``examples/plot_truss_study.py``. Intervals of a study hold the noise alone: the paper's year has other weather and
another baseline, which differ from seed to seed.
"""

import argparse
import time
import warnings

import numpy as np
import pandas as pd
from truss import NOISE, example


def differences(study):
    """Mean absolute difference of the rates from the truth, in points."""
    rates = study.results_.pivot(index="scenario", columns="source", values="rate")
    return 100 * (rates["simulated"] - rates["reference"]).abs().mean()


def by_curve(studies):
    """Severity in percent where the fitted curves reach 90 %, with the first study's interval."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*separated-severities")
        found = [100 * study.minimum_detectable_damage(0.9, "curve") for study in studies]
    each = pd.concat(found).groupby(level=[0, 1], sort=False)["mdd"]
    return found[0].assign(**{"mean of seeds": each.mean(), "lowest seed": each.min(), "highest seed": each.max()})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--repeats", type=int, default=20)
    options = parser.parse_args()
    realisations = [example.Realisation(seed) for seed in range(options.seeds)]
    for noise in (NOISE, "fitted"):
        start = time.perf_counter()
        studies = [one.study(noise=noise, n_repeats=options.repeats) for one in realisations]
        seconds = (time.perf_counter() - start) / options.seeds
        print(f"noise={noise!r}, {options.seeds} seeds, {options.repeats} repeats of 365 records, in percent\n")
        print(example.table_3(studies).to_string(na_rep=""), end="\n\n")
        gaps = [differences(study) for study in studies]
        print(
            f"mean absolute difference, points: {np.mean(gaps):.2f}, standard deviation over seeds {np.std(gaps):.2f}\n"
        )
        print(f"minimum detectable damage on the grid\n\n{example.smallest(studies).to_string()}\n")
        print(f"at a POD of 90 % by the curve, seed 0\n\n{by_curve(studies).round(1).to_string()}\n")
        print(f"a study takes {seconds:.1f} s", end="\n\n")


if __name__ == "__main__":
    main()
