"""What mode shapes add to frequencies in telling girders, stiffeners, plate and ballast of KW51 apart.

    OMP_NUM_THREADS=1 python tests/benchmarks/explained_with_shapes.py
    OMP_NUM_THREADS=1 python tests/benchmarks/explained_with_shapes.py --seeds 4 --days 60

One or two things change, damage groups of the deck and its mass; records are daily, of 0.2 % of noise, and shapes are
means of some records at the bridge's twelve sensors, of 1 % of noise. For every case the probability of the true
explanation, without and with shapes, the mean error of the amounts, and the least standard errors (Cramer-Rao) of each
cause beside all others. The exit code is 1 if shapes do not lower the mean least error of the deck's causes to a half,
or if they make the true explanations less probable in the mean.
"""

import sys
import warnings
from functools import cache

import numpy as np
import pandas as pd
from harness import arguments

from skthermo.datasets import kw51_sensors, kw51_structure, make_kw51
from skthermo.studies import identify_damage
from skthermo.surrogate import DataInformedFEM, PosteriorInverse

NAMES = ["E_bot", "E_arc", "E_br"]
SLOPES = np.array([1e-3, 8e-4, 5e-4])  # of ln theta, 1/K
GROUPS = ["girders", "transverse_beams", "stiffeners", "plate", "ballast", "arch", "braces"]
NOISE, SHAPE_NOISE, N_SHAPES = 0.002, 0.01, 10
DECK = ["girders", "stiffeners", "plate", "ballast mass"]
CASES = {
    "girders 12 %, mass": ({"girders": 0.12}, 0.3),
    "stiffeners 25 %, mass": ({"stiffeners": 0.25}, 0.3),
    "mass": ({}, 0.3),
    "plate 10 %, girders 10 %": ({"plate": 0.1, "girders": 0.1}, 0.0),
}


@cache
def ballast():
    """A tenth of the ballast's mass."""
    bridge = kw51_structure().assemble({"E_bot": "bottom", "M_b": ("mass", "ballast")}, n_modes=6)
    return bridge.matrices([1.0, 1.1])[1] - bridge.matrices([1.0, 1.0])[1]


@cache
def bridge(case=None):
    """The bridge, healthy or changed, reduced for weather."""
    damage, mass = CASES.get(case, ({}, 0.0))
    model = make_kw51(NAMES).damaged(damage)
    return (model.with_added(mass=mass * ballast()) if mass else model).reduced(0.1, random_state=0)


def records(n_days, seed, case=None):
    """Daily temperatures and frequencies."""
    random, days = np.random.RandomState(seed), np.arange(n_days)
    T = 12 - 10 * np.cos(2 * np.pi * days / 365) + 3 * random.standard_normal(n_days)
    F = bridge(case).frequencies(np.exp(-np.outer(T - 12, SLOPES)))
    noisy = F * (1 + NOISE * random.standard_normal(F.shape))
    return pd.DataFrame({"T": T}), pd.DataFrame(noisy, columns=[f"f{i}" for i in range(1, 7)])


def shapes(seed, case=None):
    """Some measured shapes."""
    exact = bridge(case).modes(np.ones((1, len(NAMES))))[1][0][list(kw51_sensors().values())]
    noise = np.random.RandomState(seed).standard_normal((N_SHAPES, *exact.shape))
    return exact + SHAPE_NOISE * np.abs(exact).max(axis=0) * noise


def evaluated(fem, case, seed, n_days):
    """Probability of the true explanation, errors of its amounts, and least errors, without and with shapes."""
    damage, mass = CASES[case]
    truth = damage | ({"ballast mass": mass} if mass else {})
    options = {"added_mass": {"ballast mass": ballast()}, "random_state": 0}
    pair = (shapes(300 + seed), shapes(400 + seed, case))
    measured = {"shapes": pair, "dofs": list(kw51_sensors().values()), "shape_noise": "fitted"}
    row = {"case": case, "seed": seed}
    for name, more in (("", {}), (", shapes", measured)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = identify_damage(fem, *records(n_days, 200 + seed, case), GROUPS, **options, **more)
        sets = [set(index.split(" + ")) for index in found.explanations.index]
        row[f"probability{name}"] = sum(
            p for p, causes in zip(found.explanations["probability"], sets, strict=True) if causes == set(truth)
        )
        amounts = pd.Series(truth).reindex(found.table.index, fill_value=0.0)
        row[f"error, %{name}"] = 100 * np.abs(found.severities - amounts)[DECK].mean()
    return row, found.separability.precision


def main():
    options = arguments(__doc__, seeds=(2, "campaigns of each case"), days=(20, "daily records after the change"))
    inverse = PosteriorInverse(noise=NOISE)
    fem = DataInformedFEM(bridge(), inverse=inverse, random_state=0).fit(*records(365, 0))
    rows, precision = [], None
    for case in CASES:
        for seed in range(options.seeds):
            row, precision = evaluated(fem, case, seed, options.days)
            rows.append(row)
    table = pd.DataFrame(rows)
    print(table.groupby("case", sort=False).mean().drop(columns="seed").round(2).to_string(), "\n")
    print("least standard errors beside all other causes")
    print(precision[["together_without_shapes", "together"]].round(3).to_string(), "\n")
    deck = precision.loc[DECK]
    ratio = (deck["together"] / deck["together_without_shapes"]).mean()
    gain = (table["probability, shapes"] - table["probability"]).mean()
    print(f"mean least error of the deck's causes with shapes / without: {ratio:.2f} (target: at most 0.5)")
    print(f"mean gain in probability of the true explanation: {gain:+.2f} (target: above 0)")
    return int(ratio > 0.5 or gain <= 0)


if __name__ == "__main__":
    sys.exit(main())
