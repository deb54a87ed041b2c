"""Regressors as inverse surrogate M1 and as temperature mapper M2, by the recipes of ``examples/plot_regressors.py``.

OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/regressors.py
"""

import numpy as np
import pandas as pd
from harness import DATA, arguments, recipes, shown

page = recipes("regressors")


def mean_of(tables, column):
    return pd.concat(tables).groupby(level="regressor", sort=False)[column].mean()


def main():
    options = arguments(__doc__, seeds=1)
    seeds, size = range(options.seeds), page.FULL
    models, inverse = page.structures(), {}
    for noise in (0.0, 0.005):
        for name, (model, bounds, network) in models.items():
            tables = [page.inverse_results(model, bounds, network, noise, seed, size) for seed in seeds]
            inverse[f"{name}, {noise:.1%} noise" if noise else f"{name}, no noise"] = mean_of(tables, "error")
    shown(f"M1: error of the parameters, %; seeds: {options.seeds}", pd.DataFrame(inverse), "3g")
    campaigns = {
        "truss": lambda seed: page.truss_campaign(seed, size),
        "KW51": lambda seed: page.kw51_campaign(models["KW51"][0], seed, size),
        "Z24": lambda seed: page.z24_campaign(models["Z24"][0], DATA / "z24" / "z24_monitoring.csv"),
    }
    chains, mappers, beyond = {}, {}, {}
    for name, campaign in campaigns.items():
        given = [campaign(seed) for seed in seeds]
        chains[name] = mean_of([page.chains_by_inverse(*pair) for pair in zip(given, seeds, strict=True)], "error")
        tables = [page.mapper_results(*pair) for pair in zip(given, seeds, strict=True)]
        for way in ("chain", "direct"):
            mappers[f"{name}, {way}"] = mean_of(tables, way)
        law = given[0].law
        for word, sign in (("hotter", 1), ("colder", -1)):
            truth = np.nan if law is None else page.beyond(law, given[0].train[0], sign)
            beyond[f"{name}, {word}"] = pd.concat([pd.Series({"truth": truth}), mean_of(tables, f"20 °C {word}")])
    shown(f"A chain by its M1: error of later frequencies, %; seeds: {options.seeds}", pd.DataFrame(chains), "3g")
    shown(
        f"A chain by its M2, and the same regressor direct: error of later frequencies, %; seeds: {options.seeds}",
        pd.DataFrame(mappers),
        "3g",
    )
    shown("Largest change of a frequency 20 °C beyond the training weather, %", pd.DataFrame(beyond), 1)


if __name__ == "__main__":
    main()
