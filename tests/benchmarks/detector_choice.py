"""The detector that simulated records choose beside the best by true ones, on structures whose truth is known.

    OMP_NUM_THREADS=1 python tests/benchmarks/detector_choice.py
    OMP_NUM_THREADS=1 python tests/benchmarks/detector_choice.py --seeds 5 --wrong stiffness missing both aligned damage
    OMP_NUM_THREADS=1 python tests/benchmarks/detector_choice.py --structure kw51 --repeats 3

For each seed, a chain and twelve detectors learn the same healthy records. The chain simulates damage in the weather
of another period, and the detectors are ranked by these records. Then they are ranked by true ones: of the truss, in
each repeat of a year with weather of its own; of KW51, of the period that was simulated. Two of the twelve have
thresholds of the records that they learned, and raise far too many false alarms: they must not be chosen.

The loss is the true share of damaged records that the best detector finds, of those that keep the limit of false
alarms in truth, less that of the chosen one, in points, mean over the states of damage. It is negative where the
chosen one finds more, by more false alarms than the limit allows; "both kept to the limit" is the loss after the
threshold of each detector is raised until it keeps the limit in truth. Where no detector keeps the limit in simulated
records, there is no choice; where none does in truth, only the second loss has a meaning. The exit code is 1 if a loss
is above 2 points in more than one seed of twenty where nothing is wrong, or the chosen detector raises more than 5 %
false alarms.
"""

import sys
import time
import warnings
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd
from harness import arguments, autoregression, compensated, recipes, shown
from joblib import Parallel, delayed
from kw51_recipes import DEFAULT, NOISE, RECIPES, TRAINED, Fitted, Records
from scipy.stats import spearmanr
from sklearn.ensemble import RandomForestRegressor
from sklearn.neighbors import KNeighborsRegressor, LocalOutlierFactor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from skthermo.datasets import make_kw51_campaign, make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, OutlierDetector, TemperatureCompensator
from skthermo.preprocessing import BiasAligner, LagFeatures
from skthermo.studies import DetectabilityStudy, sweep
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper

field_detectors = recipes("detector").field_detectors

ASKED = 0.02  # false alarms of each detector
MARGIN, SHARE = 2.0, 0.95  # points of the best by truth, and share of seeds within
TOO_MANY = 0.05  # false alarms in truth; by chance alone a threshold from 365 records has .8 to 3.6 % where 2 are asked
SEEN = (
    "raw, Mahalanobis",
    "raw, isolation forest",
    "raw, 20 neighbours",
    "raw, less 2 components",
    "raw, Gaussian mixture",
    "linear regression",
    "piecewise-linear",
    "piecewise-linear, 20 neighbours",
)


class InSample(TemperatureCompensator):
    """Residuals of the baseline by the regression that was fitted on it, which are too small for a threshold."""

    def fit_transform(self, X, y=None):
        return self.fit(X).transform(X)


def twelve(targets, **others):
    """Eight detectors of the field, two others, and two whose thresholds are of the records that they learned."""
    known = field_detectors(targets)
    neighbours = make_pipeline(StandardScaler(), KNeighborsRegressor(5))
    outliers = make_pipeline(StandardScaler(), LocalOutlierFactor(novelty=True))
    return {
        **{name: known[name] for name in SEEN},
        **{name: compensated(targets, MahalanobisDetector(ASKED), one) for name, one in others.items()},
        "in-sample, local outlier factor": OutlierDetector(outliers, ASKED, threshold="quantile"),
        "in-sample, 5 neighbours": make_pipeline(InSample(neighbours, targets=targets), MahalanobisDetector(ASKED)),
    }


@dataclass(frozen=True)
class Wrong:
    """What the simulation takes to be other than it is."""

    title: str
    model: object = make_truss
    aligned: bool = False
    assumed: tuple = ("bottom", "top", "diagonal")
    coming: tuple = ("bottom", "top", "diagonal")
    noise: object = "fitted"
    memory: float = 0.0
    later: float = 1.0


WITHOUT_DIAGONAL = ["bottom", "top", "vertical"]
WRONG = {
    "nothing": Wrong("nothing"),
    "number": Wrong("nothing; the noise is given as a number", noise=0.01),
    "stiffness": Wrong("top members of the FE model 10 % too stiff", lambda: make_truss().damaged({"top": -0.1})),
    "missing": Wrong("diagonals are no parameter", lambda: make_truss().with_parameters(WITHOUT_DIAGONAL)),
    "both": Wrong(
        "diagonals are no parameter, and 10 % too stiff",
        lambda: make_truss().damaged({"diagonal": -0.1}).with_parameters(WITHOUT_DIAGONAL),
    ),
    "aligned": Wrong(
        "the same, frequencies aligned to the model's",
        lambda: make_truss().damaged({"diagonal": -0.1}).with_parameters(WITHOUT_DIAGONAL),
        aligned=True,
    ),
    "damage": Wrong("bottom assumed, top or diagonal comes", assumed=("bottom",), coming=("top", "diagonal")),
    "white": Wrong("white noise assumed, it lasts (correlation .9 from day to day)", noise=0.01, memory=0.9),
    "lasting": Wrong('the same, noise="fitted"', memory=0.9),
    "louder": Wrong("noise 1.5 times as large comes", later=1.5),
}


class Truss:
    """A healthy year of the truss, the chain that has learned it, and true years to come."""

    noise = 0.01
    targets = tuple(f"f{mode}" for mode in range(1, 7))

    def __init__(self, seed, wrong, records, severities):
        self.wrong, self.records, self.severities = wrong, records, severities
        first, other = (int(number) // 2 for number in np.random.SeedSequence(seed).generate_state(2))
        self.T, self.F = self.campaign(first)
        self.weather = self.campaign(other)[0]
        model = wrong.model()
        inverse = PosteriorInverse(noise=self.noise)
        aligner = BiasAligner(model, method="scale") if wrong.aligned else "passthrough"
        self.fem = DataInformedFEM(model, inverse=inverse, aligner=aligner, random_state=seed)
        self.fem.fit(self.T, self.F)
        forest = RandomForestRegressor(50, min_samples_leaf=3, random_state=0)
        self.detectors = twelve(self.targets, **{"random forest": forest, "chain": self.fem})
        self.baseline = self.T.join(self.F)
        self.assumed, self.coming = (sweep(model, severities, groups) for groups in (wrong.assumed, wrong.coming))

    def campaign(self, seed, damage=None, louder=1.0):
        """Temperatures and frequencies of a year."""
        year = make_truss_campaign(samples_per_year=self.records, noise=0.0, damage=damage, random_state=seed)
        lasting = autoregression(np.random.RandomState((seed, 1)), year.frequencies.shape, self.wrong.memory, 1000)
        return year.temperatures, year.frequencies * (1 + louder * self.noise * lasting)

    def truth(self, scenario, seed):
        """A true year with weather and noise of its own."""
        T, F = self.campaign(seed, scenario.damage, self.wrong.later)
        return T.join(F)


class KW51:
    """Synthetic hours of the bridge KW51 in winter, whose law the chain's model cannot follow exactly.

    Of its modes, f3, f5 and f6 are used, which are identified in most records.
    """

    targets = ("f3", "f5", "f6")

    def __init__(self, seed, wrong, records, severities):
        self.wrong = wrong
        self.campaign = partial(make_kw51_campaign, n_hours=records, retrofit=False)
        year, self.later = self.campaign(random_state=2 * seed), self.campaign(random_state=2 * seed + 1)
        learned = Records("KW51", year.temperatures, year.frequencies, year.state, year.retrofit)
        self.fem = Fitted.by(learned, RECIPES[DEFAULT], seed=seed).fem
        self.later_seed, self.clean = 2 * seed + 1, {}
        self.baseline = self.records_of(year.temperatures, year.frequencies)[:TRAINED]
        self.weather = self.later.temperatures[self.later.temperatures.notna().all(axis=1)]
        lagged = make_pipeline(LagFeatures(24, freq="h"), TemperatureMapper())
        forest = RandomForestRegressor(50, min_samples_leaf=10, random_state=0)
        self.detectors = twelve(self.targets, **{"random forest": forest, "piecewise-linear, 24 lags": lagged})
        self.assumed = self.coming = sweep(self.fem.model, severities, ["connections", "girders", "arch"])

    def records_of(self, T, F):
        """Temperatures and these modes side by side, where there is a temperature."""
        return T.join(F[list(self.targets)])[T.notna().all(axis=1)]

    def truth(self, scenario, seed):
        """True frequencies in the same weather, with noise of their own and the same gaps."""
        if scenario.name not in self.clean:
            damaged = self.campaign(damage=scenario.damage, random_state=self.later_seed)
            self.clean[scenario.name] = damaged.clean_frequencies
        clean = self.clean[scenario.name]
        drawn = np.random.RandomState(seed).standard_normal(clean.shape)
        noisy = (clean * (1 + np.array(NOISE) * drawn)).where(self.later.frequencies.notna())
        return noisy.loc[self.weather.index, list(self.targets)]


STRUCTURES = {"truss": (Truss, (0.1, 0.2, 0.3), 365, 20), "kw51": (KW51, (0.05, 0.1, 0.2), 4000, 10)}
RULES = {  # what is compared, and whether of those only that keep the limit of false alarms
    "found at the own threshold": ("pod", True),
    "found, threshold moved to the limit": ("pod_at_equal_pfa", True),
    "found, threshold raised where needed": ("pod_raised", True),
    "area under the ROC curve": ("auc", True),
    "found at the own threshold, no limit": ("pod", False),
}
LOSSES = ["loss", "loss, both kept to the limit"]
SHIPPED = next(iter(RULES))  # the order of `DetectabilityStudy.ranking`


def ranking(study, source, limit):
    """One row for each detector, the best first, with what it finds where its threshold is raised to keep the limit."""
    table = study.ranking(limit, source)
    damaged = [scenario.name for scenario in study.scenarios_ if not scenario.is_healthy]
    for name in table.index:
        threshold = min(np.nanquantile(study.calibration_[name, source], limit), 0.0)
        decisions = [study.decisions_[name, scenario, source] for scenario in damaged]
        shares = [(some < threshold).sum() / np.count_nonzero(~np.isnan(some)) for some in decisions]
        table.loc[name, "pod_raised"] = np.mean(shares)
    return table[["false_alarms", "within_limit", "pod", "pod_at_equal_pfa", "pod_raised", "auc"]]


def both_studies(structure, n_repeats, seed):
    """The study of the damage that is assumed, and that of the damage that comes, beside the truth."""
    wrong = structure.wrong

    def study_of(scenarios, **truth):
        options = {"n_repeats": n_repeats, "noise": wrong.noise, "random_state": seed}
        study = DetectabilityStudy(structure.fem, structure.detectors, scenarios, uncertainty="noise", **options)
        study.run(structure.weather, structure.baseline, **truth)
        return study

    coming = study_of(structure.coming, reference=structure.truth)
    return coming if wrong.assumed == wrong.coming else study_of(structure.assumed), coming


def outcome(simulated, true, rule):
    """What a rule chooses from simulated records, and what that is worth in truth; NaN where none keeps the limit."""
    measure, limited = RULES[rule]
    found = {"rule": rule, "Spearman": spearmanr(simulated[measure], true[measure].loc[simulated.index]).statistic}
    candidates = simulated[simulated["within_limit"]] if limited else simulated
    if candidates.empty:
        return found | dict.fromkeys(["chosen", *LOSSES, "true false alarms"], np.nan)
    chosen = candidates[measure].astype(float).idxmax()
    best = true["pod"][true["within_limit"]].max()  # NaN if none does
    losses = best - true["pod"][chosen], true["pod_raised"].max() - true["pod_raised"][chosen]
    found |= {name: 100 * loss for name, loss in zip(LOSSES, losses, strict=True)}
    return found | {"chosen": chosen, "true false alarms": 100 * true["false_alarms"][chosen]}


def one_seed(options, kind, seed):
    """Rankings and outcomes of one seed."""
    structure, severities, records, _ = STRUCTURES[options.structure]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of models that are wrong on purpose, and of parameters outside the box
        made = structure(seed, WRONG[kind], options.records or records, severities)
        assumed, coming = both_studies(made, options.repeats, seed)
    tables, outcomes = [], []
    for limit in options.limits:
        simulated, true = ranking(assumed, "simulated", limit), ranking(coming, "reference", limit)
        spearman = spearmanr(simulated["false_alarms"], true["false_alarms"].loc[simulated.index]).statistic
        common = {"limit": limit, "Spearman, false alarms": spearman}
        outcomes += [outcome(simulated, true, rule) | common for rule in RULES]
        tables.append(pd.concat({"simulated": simulated, "true": true}, axis=1))
    return tables[0], pd.DataFrame(outcomes)


def under_first(outcomes):
    """Outcomes of the shipped rule under the first limit."""
    return outcomes[(outcomes["rule"] == SHIPPED) & (outcomes["limit"] == outcomes["limit"].iloc[0])]


def by_detector(tables, outcomes):
    """Means over the seeds in percent, and in how many a detector was chosen under the first limit."""
    means = 100 * sum(table.astype(float) for table in tables) / len(tables)
    columns = [(source, name) for name in ("false_alarms", "pod") for source in ("simulated", "true")]
    means = means[columns].set_axis(["false alarms, simulated", "true", "found, simulated", "true"], axis=1).round(1)
    means["chosen"] = under_first(outcomes)["chosen"].value_counts().reindex(means.index).fillna(0)
    return means.astype({"chosen": int}).sort_values("found, simulated", ascending=False)


def by_rule(outcomes):
    """What the rules are worth, over the seeds."""

    def summary(rows):
        spearman, false_alarms = rows["Spearman"], rows["true false alarms"]
        found = {("Spearman of", "measure"): spearman.mean(), ("Spearman of", "lowest"): spearman.min()}
        found["Spearman of", "false alarms"] = rows["Spearman, false alarms"].mean()
        for name in LOSSES:
            loss = rows[name]
            found |= {(name, "mean"): loss.mean(), (name, "highest"): loss.max()}
            found[name, f"within {MARGIN:g}"] = (loss <= MARGIN).sum()
        found |= {
            ("true false alarms", "mean"): false_alarms.mean(),
            ("true false alarms", "highest"): false_alarms.max(),
        }
        return found | {("seeds", "no choice"): rows["chosen"].isna().sum()}

    groups = outcomes.groupby(["limit", "rule"], sort=False)
    return pd.DataFrame({key: summary(rows) for key, rows in groups}).T.round(2).rename_axis(["limit", "rule"])


def is_missed(outcomes):
    """Whether the shipped rule loses too much in too many seeds, or chooses a detector with too many false alarms."""
    rows = under_first(outcomes)
    within = (rows[LOSSES] <= MARGIN).all(axis=1)
    return bool(within.mean() < SHARE or (rows["true false alarms"] > 100 * TOO_MANY).any())


def main():
    options = arguments(
        __doc__,
        structure=("truss", None, list(STRUCTURES)),
        seeds=(int, "20 of the truss, 10 of KW51 by default"),
        first=(0, "first seed"),
        repeats=(5, "of the noise and, in truth, of the truss' weather"),
        records=(int, "in a year of the truss (365), hours of KW51 (4000)"),
        wrong=(["nothing"], "of the truss only", list(WRONG)),
        limits=([0.02, 0.03], "of false alarms; .02 is asked"),
        jobs=1,
    )
    seeds = range(options.first, options.first + (options.seeds or STRUCTURES[options.structure][-1]))
    shipped, began = {}, time.perf_counter()
    for kind in options.wrong:
        found = Parallel(n_jobs=options.jobs)(delayed(one_seed)(options, kind, seed) for seed in seeds)
        tables, outcomes = [table for table, _ in found], pd.concat([each for _, each in found], ignore_index=True)
        shown(
            f"{options.structure}, {len(seeds)} seeds; wrong: {WRONG[kind].title}. Percent of records:",
            by_detector(tables, outcomes),
        )
        print(f"\nwhat the choice loses, points of {len(seeds)} seeds:\n\n{by_rule(outcomes).to_string()}", flush=True)
        shipped[kind] = by_rule(outcomes).iloc[0].rename(WRONG[kind].title), is_missed(outcomes)
    print(f"\nordered by what is {SHIPPED}:\n\n{pd.DataFrame([row for row, _ in shipped.values()]).to_string()}")
    print(f"\n{(time.perf_counter() - began) / len(seeds) / len(shipped):.0f} s for each seed")
    missed = [kind for kind, (_, is_missed) in shipped.items() if is_missed and kind == "nothing"]
    print("missed: within 2 points of the best, at less than 5 % false alarms" if missed else "all targets met")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
