"""Structures that have nothing in common: does a fleet's prior decline to pool them, and what does it cost if asked?

    OMP_NUM_THREADS=1 python tests/benchmarks/fleet_real.py [FOLDER]
    OMP_NUM_THREADS=1 python tests/benchmarks/fleet_real.py --quick

FOLDER, by default the one that the environment variable SKTHERMO_DATA names, holds ``z24/z24_monitoring.csv`` and
``tower/tower.csv``. A masonry tower whose frequencies rise as it warms, the concrete bridge Z24 that froze (undamaged
records only) and the synthetic campaign of the steel bridge KW51 before its retrofit, every four hours, are given to
`FleetPrior` as bridges without FE models; the input is the mean of the thermometers.

1. The three as a fleet, modes by rank and all modes as one family: families that are pooled.
2. Each of the three as a new bridge of the other two: error of its later records after its first days, with the prior
   and with the same regressor that never pools.
3. The same as new bridges of generated fleets (30 bridges of `make_fleet`, all kinds, or girders alone), and how
   probable it is that they follow the fleet.
4. Each of the three as a further member of the generated fleet: the probability that it follows, and the median of
   the generated bridges.

Errors are mean absolute percent of measured frequencies. Targets: nothing is pooled in 1; in 2 and 3 the prior's error
is at most 5 % above that of the regressor that never pools. The exit code is 1 if one is missed.
"""

import argparse
import os
import sys
import warnings
from pathlib import Path

import numpy as np
import pandas as pd

from skthermo.datasets import load_z24, make_fleet, make_kw51_campaign
from skthermo.fleet import FleetPrior
from skthermo.preprocessing import SensorMeans
from skthermo.surrogate import TemperatureMapper

FIRST_DAYS = {"tower": (5, 10), "Z24": (15, 30, 60), "KW51 (synthetic)": (15, 30, 60)}
LOSS = 1.05


def tower(folder):
    """The log in order of time, no stamp twice."""
    log = pd.read_csv(folder / "tower" / "tower.csv", index_col=0, parse_dates=True).sort_index()
    log = log[~log.index.duplicated()]
    return log[["T1", "T2"]], log.filter(regex="^f")


def z24(folder):
    """Undamaged records."""
    data = load_z24(folder / "z24" / "z24_monitoring.csv")
    healthy = (data.state == "undamaged").to_numpy()
    return data.temperatures[healthy], data.frequencies[healthy]


def kw51(folder):
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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", default=os.environ.get("SKTHERMO_DATA"))
    parser.add_argument("--bridges", type=int, default=30)
    parser.add_argument("--quick", action="store_true", help="generated fleets of 9 bridges")
    options = parser.parse_args()
    folder = Path(options.folder or ".")
    if not (folder / "tower" / "tower.csv").is_file() or not (folder / "z24" / "z24_monitoring.csv").is_file():
        sys.exit(f"no tower/tower.csv or z24/z24_monitoring.csv in {folder}: pass the folder, or set SKTHERMO_DATA")
    n_bridges = 9 if options.quick else options.bridges
    warnings.simplefilter("ignore")  # few days, and extrapolation from them, are what this is about
    real = {"tower": pair(*tower(folder)), "Z24": pair(*z24(folder)), "KW51 (synthetic)": pair(*kw51(folder))}
    for name, (X, F) in real.items():
        print(f"{name}: {len(X)} records of {F.shape[1]} modes, {X.min().item():.1f} to {X.max().item():.1f} C")
    missed = []

    modes = list(dict.fromkeys(mode for _, F in real.values() for mode in F))
    for title, families in (("modes by rank", None), ("all modes one family", dict.fromkeys(modes, "any mode"))):
        prior = FleetPrior(families=families).fit(real)
        print(f"\n1. Three of nothing, {title}\n{prior.comparison_.round(2).to_string()}\n{prior.summary()}")
        missed += [f"{title}: {family} is pooled" for family in prior.comparison_.index[prior.comparison_["is_pooled"]]]

    generated = {}
    for title, kinds in (("generated fleet", ("truss", "girder", "arch")), ("generated girders", ("girder",))):
        bridges = make_fleet(n_bridges, kinds=kinds, random_state=0).items()
        given = {name: bridge.records(365) for name, bridge in bridges}
        generated[title] = {name: pair(one.temperatures, one.frequencies) for name, one in given.items()}
    priors = {title: FleetPrior().fit(fleet) for title, fleet in generated.items()}
    rows = []
    for name, (X, F) in real.items():
        others = {other: tables for other, tables in real.items() if other != name}
        for title, prior in ({"the other two": FleetPrior().fit(others)} | priors).items():
            for days in FIRST_DAYS[name]:
                rows.append({"new": name, "fleet": title, "days": days} | errors(prior, X, F, days))
    table = pd.DataFrame(rows).set_index(["new", "fleet", "days"])
    print(f"\n2, 3. Errors of later records, %\n{table.round(3).to_string()}")
    for row in table[table["prior"] > LOSS * table["never pools"]].itertuples():
        missed.append(f"{row.Index}: prior {row.prior:.3f} %, without {row._1:.3f} %")

    print("\n4. Probability that a member follows, median over its modes")
    for title, fleet in generated.items():
        for name, tables in real.items():
            joined = FleetPrior().fit(fleet | {name: tables})
            follows = joined.bridges_["pooling_probability"].unstack()
            others = follows.drop(index=name).median(axis=None) if name in follows.index else np.nan
            own = follows.loc[name].median() if name in follows.index else np.nan
            print(f"{name} in the {title}: {own:.2f} (generated bridges: {others:.2f})", flush=True)

    print("\nmissed:", *missed or ["nothing"], sep="\n")
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
