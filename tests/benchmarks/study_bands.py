"""Coverage of a study's prediction intervals for a measured campaign, with the right FE model and with a wrong one.

    OMP_NUM_THREADS=1 python tests/benchmarks/study_bands.py

In each realisation a structure of known truth is monitored for a year. A user fits a chain and detectors to it, and
`DetectabilityStudy` predicts by state what share of records will be in alarm, with a band of 90 %. Then another year is
measured in each state, and the user's own detectors evaluate it. Structures:

- the truss of the thermo-mechanical law (four zones of temperature that no multiplier of a group follows exactly),
  with the right FE model, and with one of which two groups are 5 % too stiff or too soft;
- the footbridge, whose FE model has 16 beams for 44 and every stiffness 3 to 5 % off;
- girders of `make_fleet`, one in each realisation, with the user's model of each, whose stiffnesses are 2 to 5 % off.

Bands: of the noise alone; with other weather; with other training records too, of all replicates and of as many as a
study has by default; with an ensemble of models, too, ``models=updater.sample_models(20)``. The model is calibrated to
the mean of the records by `ModelUpdater`, or only its offset is removed ("aligned").

States of which the predicted share is between 5 and 95 % are counted apart: of the others, nearly every band holds.
States of such a measured share are counted, too, but they are a biased choice. Of the states predicted to be nearly
always or never detected, it takes only those in which the prediction was wrong. The exit code is 1 if intervals by
default, or those of the ensemble, cover less than 85 or more than 95 % of partly detected states, by more than twice
the sampling error of the share.
"""

import sys
import time
import warnings
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from harness import arguments, compensated, split
from joblib import Parallel, delayed
from structures import FOOTBRIDGE_GROUPS, footbridge
from structures import Footbridge as Measured

from skthermo.datasets import make_fleet, make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.preprocessing import BiasAligner
from skthermo.studies import DetectabilityStudy, Scenario
from skthermo.surrogate import DataInformedFEM, PosteriorInverse
from skthermo.updating import ModelUpdater

CONFIDENCE, WANTED = 0.9, (85, 95)
DEFAULT_REPLICATES = 10  # of a study
PARTLY = (0.05, 0.95)
PARTS = ("noise", "weather", "baseline", "model")
OFF = 0.05
DEVIATION = 0.005
"""Relative deviation of a mean measured frequency from that of a perfect model, as a user may state it."""

COARSE = [0.0, 3.75, 7.5, 11.25, 15.0, 19.5, 24.0, 28.5, 33.0, 37.5, 42.0, 46.5, 51.0, 54.75, 58.5, 62.25, 66.0]
"""Nodes of the deck in the user's model, m: those of the stays and of the supports, and one between."""

EVERY = Measured.per_day  # records of the footbridge: one a day
TRUSS_STATES = {
    "bottom": (0.06, 0.1, 0.14, 0.2),
    "top": (0.08, 0.14, 0.2, 0.26),
    "diagonal": (0.03, 0.05, 0.08, 0.11),
    "bottom and top": (0.04, 0.07, 0.1, 0.14),
}
FOOTBRIDGE_STATES = {
    "side span": (0.03, 0.05, 0.08, 0.12),
    "main stays": (0.01, 0.02, 0.03, 0.05),
    "bearings": (0.03, 0.05, 0.08, 0.12),
    "side span and backstays": (0.02, 0.04, 0.06, 0.1),
}


GIRDER_STATES = {
    "girder": (0.01, 0.02, 0.04, 0.07),
    "first span": (0.02, 0.04, 0.07, 0.12),
    "bearings": (0.05, 0.1, 0.2, 0.3),
    "soil": (0.02, 0.05, 0.1, 0.15),
}


def states(families):
    """Damage by name."""
    return {
        f"{family} {severity:.0%}": dict.fromkeys(family.split(" and "), severity)
        for family, severities in families.items()
        for severity in severities
    }


@dataclass
class Truss:
    """One realisation of the truss: a year to learn, and later years."""

    seed: int
    states = states(TRUSS_STATES)
    detectors = ("raw", "compensated")
    noise = 0.01

    def year(self):
        campaign = make_truss_campaign(random_state=self.seed)
        return campaign.temperatures, campaign.frequencies

    def later(self, number, damage):
        campaign = make_truss_campaign(damage=damage or None, random_state=10_000 + 100 * self.seed + number)
        return campaign.temperatures, campaign.frequencies

    def models(self):
        right, random = make_truss(), np.random.default_rng(self.seed)
        theta = np.ones(4)
        theta[random.choice(3, 2, replace=False)] += OFF * random.choice([-1, 1], 2)
        return {"right": right, "wrong": right.rescaled(theta)}


@dataclass
class Footbridge:
    """One realisation of the footbridge, and a coarse model of wrong stiffnesses."""

    seed: int
    states = states(FOOTBRIDGE_STATES)
    detectors = ("compensated",)
    noise = Measured.noise

    def __post_init__(self):
        self.bridge = Measured(self.seed)

    def year(self):
        records = self.bridge.training(False)[::EVERY]
        return split(records)

    def later(self, number, damage):
        records = self.bridge.evaluated(damage)[::EVERY]
        return split(records)

    def models(self):
        random = np.random.default_rng(self.seed)
        off = 1 + random.uniform(0.03, 0.05, len(FOOTBRIDGE_GROUPS)) * random.choice([-1, 1], len(FOOTBRIDGE_GROUPS))
        structure = footbridge(stations=COARSE, stiffness=dict(zip(FOOTBRIDGE_GROUPS, off, strict=True)))
        return {
            "wrong": structure.assemble(FOOTBRIDGE_GROUPS, n_modes=len(Measured.modes), track=True).reduced(
                0.7, random_state=0
            )
        }


@dataclass
class Girder:
    """One girder, and the model that its owner has."""

    seed: int
    states = states(GIRDER_STATES)
    detectors = ("compensated",)

    def __post_init__(self):
        fleet = make_fleet(self.seed + 1, kinds=("girder",), atypical=0, random_state=0)
        self.bridge = fleet[f"bridge {self.seed:03d}"]
        self.noise = self.bridge.noise

    def year(self):
        campaign = self.bridge.records(365, random_state=self.seed)
        return campaign.temperatures, campaign.frequencies

    def later(self, number, damage):
        campaign = self.bridge.records(365, damage=damage or None, random_state=10_000 + 100 * self.seed + number)
        return campaign.temperatures, campaign.frequencies

    def models(self):
        return {"wrong": self.bridge.model}


def chain(model, noise, T, F):
    """Defaults, with the frequencies' offset removed."""
    inverse = PosteriorInverse(model, noise=noise)
    aligner = BiasAligner(model, method="scale")
    return DataInformedFEM(model, inverse=inverse, aligner=aligner, random_state=0).fit(T, F)


def detector(name, columns):
    """Of raw frequencies, or of what temperature leaves unexplained of them."""
    if name == "raw":
        return MahalanobisDetector()
    return compensated(columns)


def predicted(fem, T, F, real, measured, models, options):
    """A study, and its bands by kind: (detector, state) -> (lowest, highest).

    The study evaluates measured records, too, so that a record without the modes that a detector needs counts in
    neither rate.
    """
    scenarios = [Scenario("healthy"), *(Scenario(name, damage) for name, damage in real.states.items())]
    study = DetectabilityStudy(
        fem,
        {name: detector(name, list(F.columns)) for name in real.detectors},
        scenarios,
        uncertainty=PARTS if models else PARTS[:-1],
        models=models,
        n_replicates=options.replicates,
        random_state=real.seed,
    )
    study.run(T, T.join(F), reference=measured, confidence=CONFIDENCE)
    keys = list(study.replicates_.rates)
    bands = {"noise": {}, "weather": {}, "weather, baseline": {}, "default": {}}
    found = study.replicates_

    def of_first(n_replicates, n_parts):
        rates = {key: steps[:n_replicates, :n_parts] for key, steps in found.rates.items()}
        return replace(found, parts=found.parts[:n_parts], rates=rates)

    for key in keys:
        draws = found.rates[key][:, -1]  # two in each replicate
        of_noise = found.own[key].mean() + np.sqrt(2) * (draws - draws.mean(axis=1, keepdims=True))
        bands["noise"][key] = np.quantile(of_noise, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2], method="weibull")
        bands["weather"][key] = of_first(options.replicates, 1).prediction_interval(key, CONFIDENCE)
        bands["weather, baseline"][key] = of_first(options.replicates, 2).prediction_interval(key, CONFIDENCE)
        bands["default"][key] = of_first(DEFAULT_REPLICATES, 2).prediction_interval(key, CONFIDENCE)
    if models:
        bands["all"] = {key: found.prediction_interval(key, CONFIDENCE) for key in keys}
    return study, bands


def realisation(kind, seed, options):
    """One row for each model, calibration, band, detector and state."""
    warnings.simplefilter("ignore")
    real, rows, began = kind(seed), [], time.process_time()
    if options.quick:
        real.states = dict(list(real.states.items())[1::2])
        real.detectors = real.detectors[:1]
    T, F = real.year()
    damages = {"healthy": {}, **real.states}
    years = {state: real.later(number, damage) for number, (state, damage) in enumerate(damages.items())}
    measured = {state: new_T.join(new_F) for state, (new_T, new_F) in years.items()}
    for name, model in real.models().items():
        own_models = [] if options.calibrated else [(False, model, None)]
        if not options.aligned:
            updater = ModelUpdater(model, bounds=0.6, prior=0.15).fit(F, frequency_std=DEVIATION * F.mean())
            number = 0 if options.without_ensemble else options.replicates
            ensemble = updater.sample_models(number, random_state=seed) if number else None
            own_models.append((True, updater.model_, ensemble))
        for calibrated, own, models in own_models:
            if name == "right" and not (calibrated or options.aligned):
                continue
            study, kinds = predicted(chain(own, real.noise, T, F), T, F, real, measured, models, options)
            rates = study.results_.set_index(["source", "detector", "scenario"])["rate"]
            for band, found in kinds.items():
                for key, (lowest, highest) in found.items():
                    row = {"model": name, "calibrated": calibrated, "band": band, "detector": key[0], "state": key[1]}
                    predicted_rate, truth = rates["simulated"][key], rates["reference"][key]
                    rows.append(row | {"rate": predicted_rate, "low": lowest, "high": highest, "truth": truth})
    coldest = [f"{one.min().mean():.1f}" for one in (T, years["healthy"][0])]
    spent = f"{time.process_time() - began:.0f} s of one core"
    print(f"  {kind.__name__}, seed {seed}: coldest {coldest[0]} C, {coldest[1]} C when measured; {spent}", flush=True)
    return pd.DataFrame(rows).assign(seed=seed)


def table(found):
    """Shares that intervals cover, in percent, by model, calibration and kind of band."""
    rows = {}
    for key, part in found.groupby(["model", "calibrated", "band"], sort=False):
        damaged = part[part["state"] != "healthy"]
        partly = damaged[damaged["rate"].between(*PARTLY)]
        by_seed = held(partly).groupby(partly["seed"]).mean()
        rows[(key[0], "calibrated" if key[1] else "aligned", key[2])] = {
            "partly detected": len(partly),
            "held": 100 * held(partly).mean(),
            "+-": 100 * by_seed.std() / np.sqrt(len(by_seed)),
            "too high": 100 * (partly["truth"] < partly["low"] - 1e-9).mean(),
            "too low": 100 * (partly["truth"] > partly["high"] + 1e-9).mean(),
            "width": 100 * (partly["high"] - partly["low"]).mean(),
            "error of the rate": 100 * np.sqrt(((partly["rate"] - partly["truth"]) ** 2).mean()),
            "partly, as measured": 100 * held(damaged[damaged["truth"].between(*PARTLY)]).mean(),
            "all states": 100 * held(damaged).mean(),
            "false alarms": 100 * held(part[part["state"] == "healthy"]).mean(),
        }
    return pd.DataFrame(rows).T


def held(rows):
    """Whether each band holds the truth."""
    return (rows["low"] - 1e-9 <= rows["truth"]) & (rows["truth"] <= rows["high"] + 1e-9)


STRUCTURES = {"truss": Truss, "footbridge": Footbridge, "girder": Girder}


def main():
    options = arguments(
        __doc__,
        structures=STRUCTURES,
        realisations=(20, "of each structure"),
        replicates=(20, "of each study, and models of each ensemble"),
        first_seed=0,
        jobs=1,
        quick=(False, "half of the states, and one detector"),
        aligned=(False, "models as they are, without an ensemble"),
        calibrated=(False, "calibrated models alone"),
        without_ensemble=(False, "and no bands of all uncertainty"),
    )
    numbers = range(options.first_seed, options.first_seed + options.realisations)
    missed = 0
    for name in options.structures:
        began, kind = time.perf_counter(), STRUCTURES[name]
        jobs = (delayed(realisation)(kind, seed, options) for seed in numbers)
        found = pd.concat(Parallel(n_jobs=options.jobs)(jobs), ignore_index=True)
        print(
            f"\n{name}: {len(numbers)} realisations, {found['state'].nunique() - 1} states, bands of 90 %; in percent"
        )
        shares = table(found)
        print(shares.round(1).to_string())
        print(f"  {time.perf_counter() - began:.0f} s in all")
        for key, row in shares[shares.index.get_level_values(2).isin(["default", "all"])].iterrows():
            of_independent = 100 * np.sqrt(CONFIDENCE * (1 - CONFIDENCE) / row["partly detected"])
            margin = 2 * np.nanmax([row["+-"], of_independent])
            met = WANTED[0] - margin <= row["held"] <= WANTED[1] + margin
            missed += not met
            print(f"{'met' if met else 'MISSED':7} {', '.join(key)}: {row['held']:.0f} % held, target {WANTED}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
