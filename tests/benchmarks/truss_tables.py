"""Tables 2 and 3 of the paper over many seeds, beside their targets.

    OMP_NUM_THREADS=1 python tests/benchmarks/truss_tables.py

Each realisation has single noisy records, as the paper's, beside the best that any parameters can do ("oracle"), and
beside the strongest simple competitor ("ratio"): a regression of frequencies on temperatures, times the frequencies of
the nominal model, damaged over healthy.
"""

import sys
import warnings
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.base import clone

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.fem import add_noise, linearise
from skthermo.metrics import error_table, minimum_detectable_damage, probability_of_detection
from skthermo.studies import sweep
from skthermo.surrogate import DataInformedFEM, TemperatureMapper

sys.path.append(str(Path(__file__).parents[2] / "examples"))  # which tests that import this do not have

import truss_recipes as example

GROUPS, NOISE, SEVERITIES, HALVED = example.GROUPS, example.NOISE, example.SEVERITIES, example.HALVED
SCENARIOS = sweep(make_truss(), SEVERITIES, GROUPS)
NAMES = [scenario.name for scenario in SCENARIOS]
HALVED_NAMES = [scenario.name for scenario in HALVED]
PAPER_ERRORS = pd.DataFrame(example.PAPER_MAPE, HALVED_NAMES)
PAPER_ALARMS = pd.DataFrame(example.PAPER_RATES, NAMES)
SOURCES = {"informed": "skthermo", "oracle": "best parameters", "ratio": "regression times nominal damage"}
SEEDS_40 = pd.DataFrame(
    {"mean": [2.7, 23.9, 93.6, 100, 10.6, 57.2, 97.5, 65.5, 100], "std": [1.3, 6.7, 2.9, 0, 3.5, 7.3, 1.4, 6.7, 0]},
    index=[
        "healthy",
        "bottom 10 %",
        "bottom 20 %",
        "bottom 30 %",
        "top 10 %",
        "top 20 %",
        "top 30 %",
        "diagonal 10 %",
        "diagonal 20 %",
    ],
)  # thermo-mechanical reference rates over 40 seeds, in percent


class SingleRecords:
    """One realisation: a year to learn from, four to verify, one to detect damage in, each a single noisy record.

    ``chains`` are unfitted, by name; the default one is the only one where none are given.
    """

    def __init__(self, seed, chains=None):
        self.model = make_truss()
        self.random, self.apart = np.random.RandomState(seed), np.random.RandomState((seed, 1))
        self.baseline = self.campaign(n_years=1)
        given = {"informed": DataInformedFEM(self.model)} if chains is None else chains
        self.fems = {name: clone(chain).set_params(random_state=seed) for name, chain in given.items()}
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".*(other-weather|uncalibrated-model|outside-bounds|poor-fit)")
            for fem in self.fems.values():
                fem.fit(self.baseline.temperatures, self.baseline.frequencies)
        self.regression = TemperatureMapper().fit(self.baseline.temperatures, self.baseline.frequencies)
        self.detector = MahalanobisDetector(contamination=0.02, threshold="quantile").fit(self.baseline.frequencies)
        self.verification = self.campaign(n_years=len(HALVED))
        self.later = self.campaign(n_years=1)

    def campaign(self, n_years):
        return make_truss_campaign(n_years, noise=NOISE, random_state=self.random)

    def sources(self, campaign):
        """Clean frequencies for a damage by the thermo-mechanical law, by the fitted chains, and by the oracle."""
        best = best_theta(self.model, campaign.clean_frequencies.to_numpy())

        def simulated(fem, damage):
            return np.asarray(fem.simulate(campaign.temperatures, damage=damage))

        return {
            "thermo": lambda damage: campaign.model.damaged(damage).frequencies(campaign.theta),
            **{name: partial(simulated, fem) for name, fem in self.fems.items()},
            "oracle": lambda damage: self.model.damaged(damage).frequencies(best),
        }

    def records(self, sources, damage):
        """Noisy frequencies of the damaged structure by every source."""
        return {name: self.noisy(frequencies(damage)) for name, frequencies in sources.items()}

    def ratio(self, campaign, damage):
        """Noisy frequencies by the regression alone, times those of the nominal model, damaged over healthy."""
        nominal = np.ones((1, len(self.model.parameter_names)))
        factors = self.model.damaged(damage).frequencies(nominal) / self.model.frequencies(nominal)
        clean = np.asarray(self.regression.predict(campaign.temperatures)) * factors
        return add_noise(clean, NOISE, random_state=self.apart)

    def noisy(self, frequencies):
        return add_noise(frequencies, NOISE, random_state=self.random)

    def errors(self):
        """MAPE of four years, each in another state, by source, scenario and mode (Table 2), in percent."""
        years = np.repeat(HALVED_NAMES, 365)
        sources = self.sources(self.verification)
        records = {name: np.empty((len(years), 6)) for name in [*sources, "ratio"]}
        for scenario in HALVED:
            found = self.records(sources, scenario.damage) | {"ratio": self.ratio(self.verification, scenario.damage)}
            for name, values in found.items():
                records[name][years == scenario.name] = values[years == scenario.name]
        names = [name for name in records if name != "thermo"]
        tables = {name: error_table(records["thermo"], records[name], scenarios=years) for name in names}
        return {name: table.drop(columns="Average").loc[HALVED_NAMES] for name, table in tables.items()}

    def rates(self):
        """Share of records in alarm by scenario and source (Table 3), in percent."""
        sources = self.sources(self.later)
        found = {}
        for scenario in SCENARIOS:
            records = self.records(sources, scenario.damage) | {"ratio": self.ratio(self.later, scenario.damage)}
            found[scenario.name] = {name: self.rate(values) for name, values in records.items()}
        return pd.DataFrame(found).T

    def rate(self, frequencies):
        frame = pd.DataFrame(np.asarray(frequencies), columns=self.baseline.frequencies.columns)
        return 100 * probability_of_detection(self.detector.damage_index(frame), self.detector.threshold_)

    def false_alarms(self, n_draws):
        """PFA of the later healthy year in percent, mean of some draws: true, simulated in two ways, oracle."""
        T, clean, fem = self.later.temperatures, self.later.clean_frequencies.to_numpy(), self.fems["informed"]
        fitted = self.model.frequencies(best_theta(self.model, clean))
        sources = {
            "true": lambda: self.noisy(clean),
            "Gaussian": lambda: fem.simulate(T, noise=NOISE, random_state=self.random),
            "fitted": lambda: fem.simulate(T, noise="fitted", random_state=self.random),
            "oracle": lambda: self.noisy(fitted),
        }
        return {name: np.mean([self.rate(draw()) for _ in range(n_draws)]) for name, draw in sources.items()}


def best_theta(model, frequencies, steps=20, damping=1e-4):
    """Damped Gauss-Newton fit of ln theta to noise-free frequencies, row by row.

    The zones of temperature cut across the parameters' groups, so that no theta is exact and no
    theta(T) does better. The damping limits the stiffness of the vertical members, which hardly affects the modes.
    """
    theta = np.ones((len(frequencies), len(model.parameter_names)))
    for _ in range(steps):
        fitted, jacobian = linearise(model, theta)
        residual = (frequencies / fitted - 1)[:, :, np.newaxis]
        slope = jacobian / fitted[:, :, np.newaxis] * theta[:, np.newaxis]
        transposed = slope.swapaxes(1, 2)
        step = np.linalg.solve(transposed @ slope + damping * np.eye(theta.shape[1]), transposed @ residual)
        theta *= np.exp(np.clip(step[:, :, 0], -0.1, 0.1))
    return theta


def run(seeds, n_draws=20):
    """Tables of every seed: MAPE by seed, source and scenario; rates by seed and scenario; false alarms by seed."""
    mapes, rates, alarms = {}, {}, {}
    for seed in seeds:
        one = SingleRecords(seed)
        mapes |= {(seed, source): table for source, table in one.errors().items()}
        rates[seed] = one.rates()
        alarms[seed] = one.false_alarms(n_draws)
    names = ["seed", "source", "scenario"]
    return pd.concat(mapes, names=names), pd.concat(rates, names=["seed", "scenario"]), pd.DataFrame(alarms).T


def detectable(rates, source, level=0.9):
    """Minimum detectable damage of each group at this mean POD, in percent."""
    mean = rates.groupby("scenario")[source].mean() / 100
    pods = {group: [mean[f"{group} {100 * s:g} %"] for s in SEVERITIES] for group in GROUPS}
    return {group: 100 * minimum_detectable_damage(SEVERITIES, pod, level) for group, pod in pods.items()}


def summary(mapes, rates):
    """What is measured, by target."""
    reference = rates["thermo"].groupby("scenario").mean().loc[SEEDS_40.index]
    distance = (reference - SEEDS_40["mean"]).abs() / SEEDS_40["std"].where(SEEDS_40["std"] > 0, 1.0)
    gaps = rates["informed"] - rates["thermo"]
    return {
        "Table 2, mean MAPE (%), at most 1.21": mapes.xs("informed", level="source").mean().mean(),
        "Table 3, mean absolute difference (points), at most 1.2": gaps.abs().mean(),
        "Table 3, mean PFA difference (points), at most 1.7": gaps.xs("healthy", level="scenario").abs().mean(),
        "thermo-mechanical rates, largest distance (standard deviations), at most 2": distance.max(),
    }


def beside_the_paper(mapes, rates, alarms):
    """Means over seeds by source, and of the chain less the regression, with standard errors."""
    gaps = rates.sub(rates["thermo"], axis=0).abs()
    of_seed = {
        "error of frequencies, 4 states, %": mapes.groupby(["seed", "source"]).mean().mean(axis=1).unstack(),
        "false alarms: difference from the truth, points": gaps.xs("healthy", level="scenario"),
        "rates of alarms in 16 states: mean difference, points": gaps.groupby("seed").mean(),
    }
    paper = (PAPER_ALARMS["simulated"] - PAPER_ALARMS["reference"]).abs()
    of_paper = [PAPER_ERRORS.mean().mean(), paper["healthy"], paper.mean()]
    rows = {}
    for (name, table), value in zip(of_seed.items(), of_paper, strict=True):
        less = table["informed"] - table["ratio"]
        rows[name] = {"paper, one realisation": value} | {SOURCES[key]: table[key].mean() for key in SOURCES}
        rows[name]["skthermo less regression"] = f"{less.mean():.3f} ± {less.sem():.3f}"
    by_state = gaps.groupby("scenario").mean()
    largest = {SOURCES[key]: by_state[key].max() for key in SOURCES}
    rows["the largest difference of a state, points"] = {"paper, one realisation": paper.max()} | largest
    drawn = {"informed": "fitted", "oracle": "oracle"}
    rows["false alarms: mean of 20 draws, less the truth, points"] = {
        SOURCES[source]: (alarms[name] - alarms["true"]).mean() for source, name in drawn.items()
    }
    return pd.DataFrame(rows).T


def main():
    from harness import arguments, shown  # which tests that import this do not have

    seeds = arguments(__doc__, seeds=20).seeds
    mapes, rates, alarms = run(range(seeds))
    shown(f"Truss, {seeds} realisations", beside_the_paper(mapes, rates, alarms), 3)
    smallest = {
        f"{name}, found in {level:.0%}": detectable(rates, source, level)
        for level in (0.9, 0.95)
        for name, source in (("truth", "thermo"), ("skthermo", "informed"))
    }
    shown("Smallest loss found, % of the stiffness of a group", pd.DataFrame(smallest).T, 0)
    for what, value in summary(mapes, rates).items():
        print(f"{what}: {value:.3g}")


if __name__ == "__main__":
    main()
