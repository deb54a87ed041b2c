"""Structures that have nothing in common: does a fleet's prior decline to pool them, and what does it cost if asked?

    OMP_NUM_THREADS=1 python tests/benchmarks/fleet_real.py [FOLDER]
    OMP_NUM_THREADS=1 python tests/benchmarks/fleet_real.py --quick

FOLDER, by default the one that the environment variable SKTHERMO_DATA names, holds ``z24/z24_monitoring.csv`` and
``tower/tower.csv``. A masonry tower whose frequencies rise as it warms, the concrete bridge Z24 that froze (undamaged
records only) and the synthetic campaign of the steel bridge KW51 before its retrofit, every four hours, are given to
`FleetPrior` as bridges without FE models; the input is the mean of the thermometers.

1. The three as a fleet, modes by rank and all modes as one family: families that are pooled.
2. Each of the three as a new bridge of a generated fleet (30 bridges of `make_fleet`): error of its later records after
   its first days, with the prior and with the same regressor that never pools.

Errors are mean absolute percent of measured frequencies. Targets: nothing is pooled in 1; in 2 the prior's error is
at most 5 % above that of the regressor that never pools. The exit code is 1 if one is missed.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from harness import arguments, shown, tower_records, z24_records

from skthermo.datasets import make_fleet, make_kw51_campaign
from skthermo.fleet import FleetPrior
from skthermo.preprocessing import SensorMeans
from skthermo.surrogate import TemperatureMapper

FIRST_DAYS = {"tower": (5, 10), "Z24": (15, 30, 60), "KW51 (synthetic)": (15, 30, 60)}
LOSS = 1.05


def kw51():
    """The synthetic campaign before the retrofit, every four hours where there is a temperature."""
    data = make_kw51_campaign(random_state=0)
    rows = ((data.state == "before") & data.temperatures["tBD31A"].notna()).to_numpy()
    return data.temperatures[rows].iloc[::4], data.frequencies[rows].iloc[::4]


def pair(T, F):
    """Mean of the thermometers, and frequencies."""
    return SensorMeans().fit_transform(T), F


def never(modes):
    """Families of modes that are never pooled."""
    return dict.fromkeys(modes)


def errors(prior, X, F, days):
    """Errors of the records after the first days: the prior, the same without pooling, and the library's default."""
    early = X.index < X.index[0] + pd.Timedelta(days=days)
    later, measured = X[~early], F[~early].to_numpy()

    def error(predicted):
        return 100 * np.nanmean(np.abs(predicted / measured - 1))

    pooled = prior.mapper().fit(X[early], F[early])
    alone = prior.mapper(families=never(F)).fit(X[early], F[early])
    default = np.full(measured.shape, np.nan)
    for i, mode in enumerate(F):
        known = early & F[mode].notna().to_numpy() & X.notna().all(axis=1).to_numpy()
        complete = later.notna().all(axis=1).to_numpy()
        mapper = TemperatureMapper().fit(X[known], F.loc[known, mode])
        default[complete, i] = np.ravel(mapper.predict(later[complete]))
    follows = {mode: round(share, 2) for mode, share in pooled.pooling_probability_.items()}
    found = {"never pools": error(alone.predict(later)), "prior": error(pooled.predict(later))}
    return found | {"default mapper": error(default), "follows": follows}


def main():
    options = arguments(__doc__, folder=Path, bridges=30, quick=(False, "a generated fleet of 9 bridges"))
    folder = options.folder or Path()
    if not (folder / "tower" / "tower.csv").is_file() or not (folder / "z24" / "z24_monitoring.csv").is_file():
        sys.exit(f"no tower/tower.csv or z24/z24_monitoring.csv in {folder}: pass the folder, or set SKTHERMO_DATA")
    n_bridges = 9 if options.quick else options.bridges
    real = {"tower": tower_records(folder), "Z24": z24_records(folder)[0], "KW51 (synthetic)": kw51()}
    real = {name: pair(*tables) for name, tables in real.items()}
    for name, (X, F) in real.items():
        print(f"{name}: {len(X)} records of {F.shape[1]} modes, {X.min().item():.1f} to {X.max().item():.1f} C")
    missed = []

    modes = list(dict.fromkeys(mode for _, F in real.values() for mode in F))
    for title, families in (("modes by rank", None), ("all modes one family", dict.fromkeys(modes, "any mode"))):
        prior = FleetPrior(families=families).fit(real)
        print(f"\n1. Three of nothing, {title}\n{prior.comparison_.round(2).to_string()}\n{prior.summary()}")
        missed += [f"{title}: {family} is pooled" for family in prior.comparison_.index[prior.comparison_["is_pooled"]]]

    bridges = {name: bridge.records(365) for name, bridge in make_fleet(n_bridges, random_state=0).items()}
    prior = FleetPrior().fit({name: pair(one.temperatures, one.frequencies) for name, one in bridges.items()})
    rows = {(n, days): errors(prior, X, F, days) for n, (X, F) in real.items() for days in FIRST_DAYS[n]}
    shown("2. Errors of later records, %", pd.DataFrame(rows).T, 3)
    for case, row in rows.items():
        if row["prior"] > LOSS * row["never pools"]:
            missed.append(f"{case}: prior {row['prior']:.3f} %, without {row['never pools']:.3f} %")

    print("\nmissed:", *missed or ["nothing"], sep="\n")
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
