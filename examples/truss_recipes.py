"""Realisations of the truss study, and the paper's Tables 2 and 3 beside ours; for ``plot_truss_study.py``."""

from functools import partial

import numpy as np
import pandas as pd

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.fem import add_noise
from skthermo.metrics import error_table
from skthermo.studies import DetectabilityStudy, Scenario, sweep
from skthermo.surrogate import DataInformedFEM

NOISE = 0.01
GROUPS = ["bottom", "top", "diagonal"]
SEVERITIES = (0.1, 0.2, 0.3, 0.4, 0.5)
HALVED = [Scenario("healthy"), *(Scenario(f"{group} 50 %", {group: 0.5}) for group in GROUPS)]

# The paper's Tables 2 and 3, and its minimum detectable damage, in percent.
PAPER_MAPE = [
    [1.17, 1.21, 1.13, 1.25, 1.20, 1.19],
    [1.30, 1.29, 1.36, 1.28, 1.41, 1.34],
    [1.32, 1.39, 1.34, 1.25, 1.35, 1.24],
    [1.41, 1.50, 1.29, 1.64, 1.57, 1.37],
]
PAPER_RATES = {
    "reference": [4.11, 26.03, 94.79, 100, 100, 100, 12.60, 59.73, 98.08, 100, 100, 66.30, 100, 100, 100, 100],
    "simulated": [4.38, 21.64, 92.33, 100, 100, 100, 7.40, 53.97, 97.26, 100, 100, 66.30, 100, 100, 100, 100],
}
PAPER_SMALLEST = {"bottom": 30, "top": 30, "diagonal": 20}  # as its text says; by its rates, bottom is 20
LETTERS = {"bottom": "SB", "top": "ST", "diagonal": "SD"}
SOURCES = {"reference": "measured", "simulated": "simulated"}  # "thermo-mechanical", "data-informed" of the paper


def papers_name(scenario):
    """The paper's name of a scenario: SB-50 for "bottom 50 %", SH-0 for "healthy"."""
    group, *severity = scenario.split()
    return f"{LETTERS[group]}-{severity[0]}" if severity else "SH-0"


class Realisation:
    """A healthy year to learn from, four years to verify, and a year in which damage is to be found."""

    def __init__(self, seed):
        self.seed, self.random = seed, np.random.RandomState(seed)
        campaign = partial(make_truss_campaign, noise=NOISE, random_state=self.random)
        self.year = campaign()
        self.fem = DataInformedFEM(make_truss(), random_state=seed)
        self.fem.fit(self.year.temperatures, self.year.frequencies)
        years = [campaign(damage=scenario.damage) for scenario in HALVED]
        simulate = partial(self.fem.simulate, noise=NOISE, random_state=self.random)
        simulated = [simulate(year.temperatures, damage=one.damage) for year, one in zip(years, HALVED, strict=True)]
        self.true = pd.concat([year.frequencies for year in years], ignore_index=True)
        self.simulated = pd.concat(simulated, ignore_index=True)
        self.later = campaign()

    def study(self, severities=SEVERITIES, noise=NOISE, n_repeats=10):
        """Alarms of the paper's detector in simulated years, and in years by the thermo-mechanical law (Table 3)."""
        scenarios = sweep(self.fem, severities, GROUPS)
        clean = {one.name: self.later.model.damaged(one.damage).frequencies(self.later.theta) for one in scenarios}
        options = {"noise": noise, "n_repeats": n_repeats, "random_state": self.seed}
        study = DetectabilityStudy(
            self.fem, MahalanobisDetector(threshold="quantile"), scenarios, uncertainty="noise", **options
        )
        truth = {"reference": lambda one, seed: add_noise(clean[one.name], NOISE, random_state=seed)}
        study.run(self.later.temperatures, self.year.frequencies, **truth)
        return study


def table_2(realisations):
    """MAPE in percent: mean of the realisations beside the paper's."""
    names = [scenario.name for scenario in HALVED]
    tables = [error_table(one.true, one.simulated, scenarios=np.repeat(names, 365)) for one in realisations]
    paper = pd.DataFrame(PAPER_MAPE, names, [f"f{mode}" for mode in range(1, 7)])
    paper = pd.concat([paper, paper.mean().to_frame("Average").T]).assign(Average=lambda table: table.mean(axis=1))
    table = pd.concat({"here": sum(tables) / len(tables), "paper": paper}, axis=1).loc[paper.index].round(2)
    return table.rename({name: papers_name(name) for name in names})


def table_3(studies):
    """Alarms in percent: the paper's, mean of the realisations, and bounds that hold 95 % of the years of each."""
    results = pd.concat([study.results_.replace({"source": SOURCES}) for study in studies])
    results = results.set_index(["scenario", "source"])
    columns = {"here": ("rate", "mean"), "lowest": ("pi_low", "min"), "highest": ("pi_high", "max")}
    table = 100 * results.groupby(level=[0, 1], sort=False).agg(**columns)
    paper = pd.DataFrame(PAPER_RATES, results.index.unique(0)).rename(columns=SOURCES)
    table.insert(0, "paper", paper.T.unstack())
    table = table.unstack("source").swaplevel(axis=1)[list(paper)].loc[results.index.unique(0)]
    gaps = [study.results_.pivot(index="scenario", columns="source", values="rate") for study in studies]
    table["difference", "paper"] = (table["simulated", "paper"] - table["measured", "paper"]).abs()
    table["difference", "here"] = sum(100 * (gap["simulated"] - gap["reference"]).abs() for gap in gaps) / len(gaps)
    table = table.rename(index=papers_name)
    table.loc["Average"] = table[["difference"]].mean()
    return table.round(2)


def smallest(studies):
    """Minimum detectable damage in percent: the paper's, median of the realisations, and bounds that hold each."""
    columns = {"here": ("mdd", "median"), "lowest": ("ci_low", "min"), "highest": ("ci_high", "max")}
    found = {level: pd.concat([study.minimum_detectable_damage(level) for study in studies]) for level in (0.9, 0.95)}
    by_level = {f"POD {level:.0%}": 100 * each.groupby(level=[0, 1]).agg(**columns) for level, each in found.items()}
    table = pd.concat(by_level, axis=1).loc[GROUPS]
    table.insert(0, ("", "paper"), table.index.get_level_values("family").map(PAPER_SMALLEST))
    return table.rename(index=SOURCES, level="source").rename_axis(["group", "years"]).round(2)
