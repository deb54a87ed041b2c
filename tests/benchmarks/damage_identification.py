"""How often identified severities are within two standard errors of the truth.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=folder python tests/benchmarks/damage_identification.py

Damage of known severity is put into the truss, the bridge KW51 and the building frame (which needs
``building_frame/ConcreteBuildingFrame.mat`` in the folder), and `identify_damage` is asked for it. In the design "one
chain", all repeats share a fitted chain, which simulates the records with ``noise="fitted"``; the number of chains, each
with its own training records, is an option. In the design "own chain", every repeat has its own healthy campaign, chain
and damaged campaign, by the thermo-mechanical law of the truss.
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

    fit: object  # seed -> fitted chain
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


def fit_smooth(model, seed):
    """A chain of a large model, fitted to three years that the smooth law gives."""
    T = days(TRAINING_DAYS, 100 + seed)
    shocks = np.random.RandomState(seed).standard_normal((TRAINING_DAYS + 50, model.n_modes))
    noise = np.sqrt(1 - CORRELATION**2) * lfilter([1.0], [1.0, -CORRELATION], shocks, axis=0)[50:]
    small = model.reduced(0.3, random_state=0)
    F = small.frequencies(smooth_law(T, len(model.parameter_names))) * (1 + NOISE * noise)
    inverse = InverseSurrogate(small, n_samples=300, noise=NOISE)
    return DataInformedFEM(model, inverse=inverse, reduce=True, random_state=seed).fit(T, F)


def fit_truss(seed):
    year = make_truss_campaign(random_state=1000 + seed)
    return DataInformedFEM(make_truss(), random_state=seed).fit(year.temperatures, year.frequencies)


def truss(_):
    truths = [{"top": 0.05}, {"bottom": 0.1}, {"diagonal": 0.2}, {"top": 0.3}, {"bottom": 0.1, "diagonal": 0.05}]
    return Case(fit_truss, lambda n, seed: make_truss_campaign(random_state=seed).temperatures[:n], None, truths)


def kw51(_):
    model = make_kw51(["E_bot", "E_arc", "E_br"])
    groups = ["girders", "transverse_beams", "plate", "braces", "pipes"]
    truths = [{"girders": 0.1}, {"pipes": 0.05}, {"braces": 0.3}, {"transverse_beams": 0.2, "pipes": 0.1}]
    return Case(lambda seed: fit_smooth(model, seed), days, groups, truths)


def frame(folder):
    model = load_affine(Path(folder) / "building_frame" / "ConcreteBuildingFrame.mat")
    groups = ["E_2", "E_4", "E_7", "E_9", "E_11"]
    truths = [{"E_9": 0.1}, {"E_11": 0.05}, {"E_2": 0.3}, {"E_4": 0.2, "E_7": 0.1}]
    return Case(lambda seed: fit_smooth(model.with_parameters(["E_5", "E_11", "E_12"]), seed), days, groups, truths)


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
        np.concatenate([each[name] for each in repeats])
        for name in ("error", "standard_error", "held", "held_all")
    )
    quiet, false, misfit, settled = (
        100 * np.mean([each[name] for each in repeats]) for name in ("quiet", "false", "misfit", "settled")
    )
    sets = pd.Series([each["confused"] for each in repeats]).value_counts(normalize=True)
    percent = {"bias": error.mean(), "rms": np.sqrt((error**2).mean()), "error": np.median(errors)} if error.size else {}
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


def one_chain(case, truth, n_records, chains, repeats):
    """Records that a fitted chain simulates."""
    for repeat in range(repeats):
        fem = chains[repeat % len(chains)]
        T = case.weather(n_records, 5000 + repeat)
        F = fem.simulate(T, damage=truth, noise="fitted", random_state=repeat)
        yield identified(identify_damage(fem, T, F, case.groups, random_state=repeat), truth)


def own_chain(case, truth, n_records, chains, repeats):
    """Independent campaigns of the true truss; a chain for each healthy one."""
    for repeat in range(repeats):
        later = make_truss_campaign(damage=truth, random_state=5000 + repeat)
        T, F = later.temperatures[:n_records], later.frequencies[:n_records]
        yield identified(identify_damage(chains[repeat], T, F, case.groups, random_state=repeat), truth)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--chains", type=int, default=5, help="chains that the repeats of the design 'one chain' share")
    parser.add_argument("--models", nargs="+", default=list(CASES), choices=list(CASES))
    parser.add_argument("--designs", nargs="+", default=["one chain", "own chain"])
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
        designs = {"one chain": (one_chain, options.chains), "own chain": (own_chain, options.repeats)}
        for design in [each for each in options.designs if name == "truss" or each == "one chain"]:
            run, n_chains = designs[design]
            chains = [case.fit(seed) for seed in range(n_chains)]
            if name != "truss":
                T = case.weather(365, 1)
                F = chains[0].simulate(T, noise="fitted", random_state=1)
                print(f"{name}, healthy, all groups:\n{identify_damage(chains[0], T, F, random_state=0).summary()}\n")
            for truth in truths if options.truths is None else [truths[place] for place in options.truths]:
                for n_records in options.records:
                    label = ", ".join(f"{group} {100 * severity:g} %" for group, severity in truth.items()) or "healthy"
                    found = list(run(case, truth, n_records, chains, options.repeats))
                    rows[name, design, label, n_records] = row(found)
                    print(name, design, label, n_records, rows[name, design, label, n_records], flush=True)
    table = pd.DataFrame(rows).T
    table.index.names = ["model", "design", "truth", "records"]
    print(f"\nall in percent, of {options.repeats} repeats; held: within two standard errors, for the damaged groups\n")
    print(table.convert_dtypes().round(2).to_string())


if __name__ == "__main__":
    main()
