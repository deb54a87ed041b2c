"""
A report for the owner of a bridge
==================================

A truss was monitored for a year. The FE model learns how temperature moves its frequencies, a study simulates damage of
three groups of members, and sixty later days, on which the lower chord has lost a quarter of its stiffness, are
compared with what the healthy truss would do. One HTML file says in plain sentences what came out of it, for readers
who are not engineers.

Run it with ``python examples/plot_owner_report.py``; the report goes to the folder ``figures``.
"""

import argparse
from pathlib import Path

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.studies import DetectabilityStudy, identify_damage, report, sweep
from skthermo.surrogate import DataInformedFEM, InverseSurrogate

GROUPS = ["bottom", "top", "diagonal"]
SEVERITIES = (0.1, 0.15, 0.2, 0.25, 0.3)
TRUTH = {"bottom": 0.25}


def true_records(scenario, seed):
    """Records of the true truss in the same weather, with which simulations are compared."""
    return make_truss_campaign(damage=dict(scenario.damage), random_state=seed).frequencies.to_numpy()


def main():
    parser = argparse.ArgumentParser(description="A report for the owner of a bridge.")
    parser.add_argument("--figures", type=Path, default=Path("figures"), help="folder for the report")
    folder = parser.parse_args().figures

    year = make_truss_campaign(random_state=0)
    fem = DataInformedFEM(make_truss(), inverse=InverseSurrogate(noise=0.01), random_state=0)
    fem.fit(year.temperatures, year.frequencies)

    scenarios = sweep(fem, SEVERITIES, GROUPS)
    study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, n_repeats=10, random_state=0)
    study.run(year.temperatures, reference=true_records)
    print(study.minimum_detectable_damage())

    later = make_truss_campaign(damage=TRUTH, random_state=1)
    identified = identify_damage(fem, later.temperatures[:60], later.frequencies[:60], GROUPS, random_state=0)
    print(identified.summary())

    folder.mkdir(parents=True, exist_ok=True)
    path = report(study, folder / "truss_report.html", identified=identified, title="Monitoring of the truss bridge")
    print(f"Report: {path}")


if __name__ == "__main__":
    main()
