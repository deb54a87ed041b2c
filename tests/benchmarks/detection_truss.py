"""Whitening by weather where the spread does not depend on weather: the truss, at equal rates of false alarms.

    OMP_NUM_THREADS=1 python tests/benchmarks/detection_truss.py

A baseline of two years teaches the compensator and the covariance. The threshold of both ways is set on one long
healthy campaign, so that they have the same rate of false alarms and only their detection differs.
"""

import argparse

import numpy as np
import pandas as pd

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.metrics import probability_of_detection, probability_of_false_alarm
from skthermo.surrogate import TemperatureMapper

ASKED = 0.02
DAMAGE = [("bottom", 0.1), ("bottom", 0.2), ("top", 0.1), ("top", 0.2), ("diagonal", 0.1)]
SCALES = {None: "one covariance", "local": "covariance by weather"}


def records(n_years, seed, damage=None):
    campaign = make_truss_campaign(n_years, damage=damage, random_state=seed)
    return campaign.temperatures.join(campaign.frequencies)


def rates(seed, years):
    """Alarms by scale, %, on new healthy and damaged years, and whether weather changed the covariance."""
    seeds = iter(np.random.SeedSequence(seed).generate_state(8) // 2)
    baseline, many, year = records(2, next(seeds), None), records(years, next(seeds)), records(1, next(seeds))
    damaged = {f"{group} {severity}": records(1, next(seeds), {group: severity}) for group, severity in DAMAGE}
    found, local = {}, False
    for scale, name in SCALES.items():
        compensator = TemperatureCompensator(TemperatureMapper(), targets=list(baseline)[3:], scale=scale)
        detector = MahalanobisDetector(ASKED).fit(compensator.fit_transform(baseline))

        def index(rows, compensator=compensator, detector=detector):
            return detector.damage_index(compensator.transform(rows))

        found[name, "healthy, own threshold"] = probability_of_false_alarm(index(year), detector.threshold_)
        threshold = np.quantile(index(many), 1 - ASKED)
        found[name, "healthy"] = probability_of_false_alarm(index(year), threshold)
        for state, rows in damaged.items():
            found[name, state] = probability_of_detection(index(rows), threshold)
        local |= scale == "local" and compensator.spread_.smoothing is not None
    return {key: 100 * value for key, value in found.items()}, local


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--years", type=int, default=20, help="of the healthy campaign that sets both thresholds")
    options = parser.parse_args()
    runs = [rates(seed, options.years) for seed in range(options.seeds)]
    table = pd.DataFrame([pd.Series(found) for found, _ in runs])
    means = table.mean().unstack(level=0)[[*SCALES.values()]]
    differences = table["covariance by weather"] - table["one covariance"]
    means["difference"] = differences.mean()
    means["standard error"] = differences.std() / np.sqrt(options.seeds)
    print(f"Records in alarm, %, means of {options.seeds} seeds, {ASKED:.0%} false alarms on {options.years} years\n")
    print(means.loc[list(differences)].round(2).to_string(), end="\n\n")
    detection = means["difference"].drop(["healthy", "healthy, own threshold"])
    print(f"largest change of a mean probability of detection, points, at most 2: {abs(detection).max():.2f}")
    changed = sum(local for _, local in runs)
    print(f"seeds in which whitening by weather chose one covariance for all weather: {options.seeds - changed}")
    print(f"  seeds in which it did not: {changed}")


if __name__ == "__main__":
    main()
