"""Does the mode that `what_to_add` recommends lower the minimum detectable damage of the true truss as much as it says?

    OMP_NUM_THREADS=1 python tests/benchmarks/detectability_what_to_add.py

For every seed, a study of the chain predicts what one more mode, or a baseline twice as long, would gain. Fresh
campaigns of the thermo-mechanical law, with other seeds and one more mode, give the gain of one baseline and one year
that the prediction's bounds should hold.
"""

import argparse
import time

import numpy as np
import pandas as pd

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.fem import add_noise
from skthermo.studies import DetectabilityStudy, pod_curve, sweep, what_to_add
from skthermo.surrogate import DataInformedFEM

NOISE = 0.01
SEVERITIES = {"bottom": (0.1, 0.2, 0.3), "top": (0.2, 0.3, 0.4), "diagonal": (0.08, 0.14, 0.2)}
MEASURED = range(6)


def predicted(seed, noise):
    """The table of `what_to_add` for a chain that has learned one year."""
    year, later = (make_truss_campaign(noise=NOISE, random_state=1000 * seed + i) for i in range(2))
    fem = DataInformedFEM(make_truss(), random_state=seed).fit(year.temperatures, year.frequencies)
    scenarios = [s for g, severities in SEVERITIES.items() for s in sweep(fem, severities, [g])[1:]]
    study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, noise=noise, random_state=seed)
    study.run(later.temperatures)
    start = time.perf_counter()
    return what_to_add(study, later.temperatures), time.perf_counter() - start


def smallest(records, modes, n_years):
    """a90 of every family from fresh records, by a detector of some modes and so many years of baseline."""
    baseline, changed = records
    detector = MahalanobisDetector().fit(baseline[: 365 * n_years, modes])
    found = {}
    for group, tables in changed.items():
        alarms = [np.sum(detector.predict(table[:, modes]) == -1) for table in tables.values()]
        found[group] = pod_curve(list(tables), alarms, np.full(len(alarms), 365)).a90
    return pd.Series(found)


def fresh(seed, centres):
    """True records of nine modes: two healthy years, and one year at severities around some a90."""
    campaigns = [make_truss_campaign(n, random_state=1_000_000 + 1000 * seed + i) for i, n in enumerate((2, 1))]
    random = np.random.RandomState(seed)
    model = campaigns[0].model.with_modes(range(9))
    baseline = add_noise(model.frequencies(campaigns[0].theta), NOISE, random_state=random)
    seeds = int(random.randint(2**31 - 1))
    changed = {
        group: {
            s: add_noise(model.damaged({group: s}).frequencies(campaigns[1].theta), NOISE, random_state=seeds)
            for s in centre * np.linspace(0.35, 1.45, 12)
        }
        for group, centre in centres.items()
    }
    return baseline, changed


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    options = parser.parse_args()
    for noise in (NOISE, "fitted"):
        rows, seconds, best = [], [], []
        for seed in range(options.seeds):
            table, elapsed = predicted(seed, noise)
            seconds.append(elapsed)
            best.append(table["candidate"][0])
            records = fresh(seed, table.groupby("family")["mdd_now"].first())
            now = smallest(records, list(MEASURED), 1)
            for row in table.itertuples():
                modes = [*MEASURED, int(row.candidate.split()[1]) - 1] if row.kind == "mode" else list(MEASURED)
                then = smallest(records, modes, 2 if row.kind == "baseline" else 1)
                gain = now[row.family] - then[row.family]
                held = row.lowest <= gain <= row.highest
                rows.append((row.candidate, row.family, row.mdd_now, now[row.family], row.gain, gain, held))
        columns = ["candidate", "family", "mdd now", "true mdd now", "gain", "true gain", "held"]
        found = pd.DataFrame(rows, columns=columns)
        means = 100 * found.groupby(["candidate", "family"]).mean()
        means["error of true"] = 100 * found.groupby(["candidate", "family"])["true gain"].sem()
        print(f"noise={noise!r}: means of {options.seeds} seeds, in percent\n")
        print(means.sort_values("gain", ascending=False).round(2).to_string(), end="\n\n")
        print(f"recommended: {pd.Series(best).value_counts().to_dict()}")
        print(f"bounds of 95 % hold the true gain in {found['held'].mean():.1%} of {len(found)} cases;", end=" ")
        first = found[found["candidate"] == pd.Series(best).mode()[0]]
        print(f"of {first['candidate'].iloc[0]}, in {first['held'].mean():.1%} of {len(first)}")
        print(f"seconds for one table: {np.median(seconds):.1f}", end="\n\n")


if __name__ == "__main__":
    main()
