"""How often identified severities are within two standard errors of the truth.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=folder python tests/benchmarks/damage_identification.py

Damage of known severity is put into the truss, the bridge KW51 and the building frame (which needs
``building_frame/ConcreteBuildingFrame.mat`` in the folder), and `identify_damage` is asked for it. Designs:

- "one chain": a fitted chain simulates the records with ``noise="fitted"`` and identifies their damage itself. What it
  has learned from its own training records is then the truth, so that standard errors, which allow for errors of
  training, are too large where the new records are not much fewer than those.
- "own chain": a chain simulates healthy records too, to which other chains are fitted that identify the damage.
- "campaign" (truss): every repeat has its own healthy campaign, chain and damaged campaign, by the thermo-mechanical
  law.
"""

import argparse
import os
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from skthermo.datasets import make_kw51, make_truss, make_truss_campaign
from skthermo.fem import load_affine
from skthermo.studies import identify_damage
from skthermo.surrogate import DataInformedFEM, InverseSurrogate

NOISE, CORRELATION, TRAINING_DAYS = 0.003, 0.3, 1095


class Case(NamedTuple):
    """A chain to be damaged."""

    chain: object  # seed -> chain to be fitted
    records: object  # seed -> healthy temperatures and frequencies
    weather: object  # number of records, seed -> temperatures
    groups: list | None
    truths: list


def days(n_records, seed):
    """Daily temperatures: a season, and weather that lasts some days."""
    random = np.random.RandomState(seed)
    weather = lfilter([1.0], [1.0, -0.7], random.standard_normal(n_records + 50))[50:]
    day = np.arange(n_records) + random.randint(365)
    return pd.DataFrame({"T": 12 - 11 * np.cos(2 * np.pi * day / 365) + 2 * weather})


def smooth_law(T, n_parameters):
    """Multipliers that fall with temperature, each at another rate and with another curvature."""
    x = (T.to_numpy() - 12) / 10
    rates, bends = np.linspace(0.01, 0.03, n_parameters), np.linspace(0.004, -0.002, n_parameters)
    return 1 - rates * x + bends * x**2


def smooth_case(model, groups, truths):
    """A large model, with three years of records by the smooth law."""
    small = model.reduced(0.3, random_state=0)

    def chain(seed):
        inverse = InverseSurrogate(small, n_samples=300, noise=NOISE)
        return DataInformedFEM(model, inverse=inverse, reduce=True, random_state=seed)

    def records(seed):
        T = days(TRAINING_DAYS, 100 + seed)
        shocks = np.random.RandomState(seed).standard_normal((TRAINING_DAYS + 50, model.n_modes))
        noise = np.sqrt(1 - CORRELATION**2) * lfilter([1.0], [1.0, -CORRELATION], shocks, axis=0)[50:]
        return T, small.frequencies(smooth_law(T, len(model.parameter_names))) * (1 + NOISE * noise)

    return Case(chain, records, days, groups, truths)


def truss(_):
    def year(seed):
        campaign = make_truss_campaign(random_state=1000 + seed)
        return campaign.temperatures, campaign.frequencies

    def weather(n_records, seed):
        return make_truss_campaign(random_state=seed).temperatures[:n_records]

    truths = [{"top": 0.05}, {"bottom": 0.1}, {"diagonal": 0.2}, {"top": 0.3}, {"bottom": 0.1, "diagonal": 0.05}]
    return Case(lambda seed: DataInformedFEM(make_truss(), random_state=seed), year, weather, None, truths)


def kw51(_):
    groups = ["girders", "transverse_beams", "plate", "braces", "pipes"]
    truths = [{"girders": 0.1}, {"pipes": 0.05}, {"braces": 0.3}, {"transverse_beams": 0.2, "pipes": 0.1}]
    return smooth_case(make_kw51(["E_bot", "E_arc", "E_br"]), groups, truths)


def frame(folder):
    model = load_affine(Path(folder) / "building_frame" / "ConcreteBuildingFrame.mat")
    groups = ["E_2", "E_4", "E_7", "E_9", "E_11"]
    truths = [{"E_9": 0.1}, {"E_11": 0.05}, {"E_2": 0.3}, {"E_4": 0.2, "E_7": 0.1}]
    return smooth_case(model.with_parameters(["E_5", "E_11", "E_12"]), groups, truths)


DESIGNS = ["one chain", "own chain", "campaign"]
CASES = {"truss": truss, "kw51": kw51, "frame": frame}


def identified(found, truth):
    """One repeat: errors of the damaged groups, and which groups are within two standard errors."""
    table = found.table.assign(truth=pd.Series(truth, dtype=float)).fillna({"truth": 0.0})
    error = table["severity"] - table["truth"]
    held, damaged = error.abs() <= 2 * table["standard_error"], table["truth"] > 0
    return {
        "error": error[damaged].tolist(),
        "standard_error": table.loc[damaged, "standard_error"].tolist(),
        "held": held[damaged].tolist(),
        "held_all": held.tolist(),
        "quiet": not table["significant"].any(),
        "false": bool(table.loc[~damaged, "significant"].any()),
        "misfit": found.misfit_p_value < 0.05,
        "confused": "; ".join(" and ".join(group) for group in found.confused) or "-",
        "settled": found.converged,
    }


def row(repeats):
    """One line of the table."""
    error, errors, held, everything = (
        np.concatenate([each[name] for each in repeats]) for name in ("error", "standard_error", "held", "held_all")
    )
    quiet, false, misfit, settled = (
        100 * np.mean([each[name] for each in repeats]) for name in ("quiet", "false", "misfit", "settled")
    )
    sets = pd.Series([each["confused"] for each in repeats]).value_counts(normalize=True)
    percent = (
        {"bias": error.mean(), "rms": np.sqrt((error**2).mean()), "error": np.median(errors)} if error.size else {}
    )
    return {
        **{name: 100 * value for name, value in percent.items()},
        "held": 100 * held.mean() if held.size else np.nan,
        "held, all": 100 * everything.mean(),
        "none significant": quiet if not error.size else np.nan,
        "false group": false,
        "misfit": misfit,
        "settled": settled,
        "named most often": f"{sets.index[0]} ({sets.iloc[0]:.0%})",
    }


def pairs(case, design, n_chains):
    """Chains that simulate damage (None for true campaigns), each with the chain that identifies it."""
    worlds = [case.chain(seed).fit(*case.records(seed)) for seed in range(n_chains)]
    if design != "own chain":
        return [(world if design == "one chain" else None, world) for world in worlds]
    found = []
    for seed, world in enumerate(worlds):
        T = case.records(2000 + seed)[0]
        F = world.simulate(T, noise="fitted", random_state=2000 + seed)
        found.append((world, case.chain(seed).fit(T, F)))
    return found


def repeated(case, truth, n_records, chains, repeats):
    """Identifications of new records."""
    for repeat in range(repeats):
        world, fem = chains[repeat % len(chains)]
        if world is None:
            later = make_truss_campaign(damage=truth, random_state=5000 + repeat)
            T, F = later.temperatures[:n_records], later.frequencies[:n_records]
        else:
            T = case.weather(n_records, 5000 + repeat)
            F = world.simulate(T, damage=truth, noise="fitted", random_state=repeat)
        yield identified(identify_damage(fem, T, F, case.groups, random_state=repeat), truth)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--chains", type=int, default=10, help="chains that the repeats share, except in 'campaign'")
    parser.add_argument("--models", nargs="+", default=list(CASES), choices=list(CASES))
    parser.add_argument("--designs", nargs="+", default=DESIGNS, choices=DESIGNS)
    parser.add_argument("--records", type=int, nargs="+", default=[365, 60])
    parser.add_argument("--truths", type=int, nargs="+", help="which of the truths; 0 is the healthy structure")
    parser.add_argument("--data", default=os.environ.get("SKTHERMO_DATA"))
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    rows = {}
    for name in options.models:
        if name == "frame" and options.data is None:
            print("the frame is left out: SKTHERMO_DATA names no folder")
            continue
        case = CASES[name](options.data)
        truths = [{}, *case.truths]
        for design in [each for each in options.designs if name == "truss" or each != "campaign"]:
            chains = pairs(case, design, options.repeats if design == "campaign" else options.chains)
            T = case.weather(365, 1)
            F = chains[0][1].simulate(T, noise="fitted", random_state=1)
            print(f"{name}, healthy, all groups:\n{identify_damage(chains[0][1], T, F, random_state=0).summary()}\n")
            for truth in truths if options.truths is None else [truths[place] for place in options.truths]:
                for n_records in options.records:
                    label = ", ".join(f"{group} {100 * severity:g} %" for group, severity in truth.items()) or "healthy"
                    found = list(repeated(case, truth, n_records, chains, options.repeats))
                    rows[name, design, label, n_records] = row(found)
                    print(name, design, label, n_records, rows[name, design, label, n_records], flush=True)
    table = pd.DataFrame(rows).T
    table.index.names = ["model", "design", "truth", "records"]
    print(f"\nall in percent, of {options.repeats} repeats; held: within two standard errors, for the damaged groups\n")
    print(table.convert_dtypes().round(2).to_string())


if __name__ == "__main__":
    main()
