"""The paper's Table 3 from one call of a study: false alarms and detection of the truss, simulated and true.

    OMP_NUM_THREADS=1 python tests/benchmarks/detectability_truss.py

The chain and the detector (98th percentile, as in the paper) learn one healthy year. The truth is the
thermo-mechanical law with the same weather and 1 % noise. Bounds hold the noise alone: the paper's year has other
weather and another baseline, which differ from seed to seed.
"""

import argparse
import time
import warnings

import numpy as np
import pandas as pd

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.fem import add_noise
from skthermo.studies import DetectabilityStudy, sweep
from skthermo.surrogate import DataInformedFEM, InverseSurrogate

NOISE = 0.01
GROUPS = ["bottom", "top", "diagonal"]
SEVERITIES = (0.1, 0.2, 0.3, 0.4, 0.5)
PAPER = {
    "reference": [4.11, 26.03, 94.79, 100, 100, 100, 12.60, 59.73, 98.08, 100, 100, 66.30, 100, 100, 100, 100],
    "data-informed": [4.38, 21.64, 92.33, 100, 100, 100, 7.40, 53.97, 97.26, 100, 100, 66.30, 100, 100, 100, 100],
}
PAPER_MDD = {"bottom": 30, "top": 30, "diagonal": 20}


def study_of(seed, noise, n_jobs):
    """The fitted study of one realisation, its true records, the weather and the seconds that the study takes."""
    random = np.random.RandomState(seed)
    year, later = (make_truss_campaign(noise=NOISE, random_state=random) for _ in range(2))
    model = make_truss()
    with warnings.catch_warnings():  # a tenth of the records are far outside the paper's box of 20 %
        warnings.filterwarnings("ignore", message=r"\d+ of \d+ rows give parameters far outside")
        fem = DataInformedFEM(model, inverse=InverseSurrogate(model, bounds=0.2, noise=NOISE), random_state=seed)
        fem.fit(year.temperatures, year.frequencies)

    def truth(scenario, random_state):
        clean = later.model.damaged(scenario.damage).frequencies(later.theta)
        return add_noise(clean, NOISE, random_state=random_state)

    detector = MahalanobisDetector(threshold="quantile")
    study = DetectabilityStudy(
        fem, detector, sweep(model, SEVERITIES, GROUPS), noise=noise, n_jobs=n_jobs, random_state=seed
    )
    start = time.perf_counter()
    study.run(later.temperatures, year.frequencies, reference=truth)
    return study, time.perf_counter() - start


def table_3(results):
    """Rates and bounds by scenario and source beside the paper's, in percent."""
    rates = 100 * results.set_index(["scenario", "source"])[["rate", "lowest", "highest"]].unstack("source")
    rates = rates.swaplevel(axis=1).loc[results["scenario"].unique()]
    columns = {}
    for source, published in PAPER.items():
        columns[source, "paper"] = pd.Series(published, index=rates.index)
        for name in ("rate", "lowest", "highest"):
            columns[source, name] = rates[source, name]
    columns["difference", "paper"] = columns["data-informed", "paper"] - columns["reference", "paper"]
    columns["difference", "rate"] = columns["data-informed", "rate"] - columns["reference", "rate"]
    return pd.DataFrame(columns)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--n-jobs", type=int, default=None)
    options = parser.parse_args()
    for noise in (NOISE, "fitted"):
        studies = [study_of(seed, noise, options.n_jobs) for seed in range(options.seeds)]
        tables = [table_3(study.results_) for study, _ in studies]
        print(f"noise={noise!r}, seed 0, 20 repeats of 365 records, in percent\n")
        print(tables[0].round(2).to_string(), end="\n\n")
        gaps = pd.concat([table["difference"].abs().mean() for table in tables], axis=1).T
        print(
            f"mean absolute difference, points: paper {gaps['paper'][0]:.2f}, here {gaps['rate'].mean():.2f}", end=" "
        )
        print(f"(mean of {options.seeds} seeds, standard deviation {gaps['rate'].std():.2f})", end="\n\n")
        for method, level in (("grid", 0.9), ("grid", 0.95), ("curve", 0.9)):
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", message="the severities")
                found = [100 * study.minimum_detectable_damage(level, method) for study, _ in studies]
            first = found[0].assign(paper=[PAPER_MDD[family] for family, _ in found[0].index])
            each = pd.concat(found).groupby(level=[0, 1], sort=False)["mdd"]
            first["mean of seeds"], first["lowest seed"], first["highest seed"] = each.mean(), each.min(), each.max()
            print(f"minimum detectable damage at a POD of {level} by the {method}, seed 0, in percent")
            print(first.round(1).to_string(), end="\n\n")
        seconds = [seconds for _, seconds in studies]
        print(f"{len(tables[0])} scenarios x 365 records x 20 repeats, twice: {np.median(seconds):.1f} s", end="\n\n")


if __name__ == "__main__":
    main()
