"""Structures that have nothing in common: does a fleet's prior decline to pool them, and what does it cost if asked?

    OMP_NUM_THREADS=1 python tests/benchmarks/fleet_real.py [FOLDER]

FOLDER, by default the one that the environment variable SKTHERMO_DATA names, holds ``z24/z24_monitoring.csv`` and
``tower/tower.csv``. A masonry tower whose frequencies rise as it warms, the concrete bridge Z24 that froze (undamaged
records only) and the synthetic campaign of the steel bridge KW51 before its retrofit, every four hours, are given to
`FleetPrior` as bridges without FE models; the input is the mean of the thermometers. Each of the three is a new bridge
of a generated fleet, then the three are a fleet, all modes one family.

Errors are mean absolute percent of measured frequencies. Targets: nothing of the three is pooled; beside the generated
fleet, the prior's error is at most 5 % above that of the same regressor that never pools. The exit code is 1 if one is
missed.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from harness import arguments, is_missed, shown, tower_records, z24_records

from skthermo.datasets import make_fleet, make_kw51_campaign
from skthermo.fleet import FleetPrior
from skthermo.preprocessing import SensorMeans
from skthermo.surrogate import TemperatureMapper

FIRST_DAYS = {"masonry tower": (5, 10), "Z24": (15, 30, 60), "KW51, synthetic": (15, 30, 60)}
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
    found = {
        "default regression, own records": error(default),
        "prior's regression, nothing pooled": error(alone.predict(later)),
    }
    return found | {"prior from the fleet": error(pooled.predict(later))}


def main():
    options = arguments(__doc__, folder=Path, bridges=15)
    real = {
        "masonry tower": tower_records(options.folder),
        "Z24": z24_records(options.folder)[0],
        "KW51, synthetic": kw51(),
    }
    real = {name: pair(*tables) for name, tables in real.items()}
    bridges = {name: bridge.records(365) for name, bridge in make_fleet(options.bridges, random_state=0).items()}
    prior = FleetPrior().fit({name: pair(one.temperatures, one.frequencies) for name, one in bridges.items()})
    rows = {(n, days): errors(prior, X, F, days) for n, (X, F) in real.items() for days in FIRST_DAYS[n]}
    table = pd.DataFrame(rows).T.rename_axis(["new structure", "first days"])
    shown(f"Error of later frequencies, %, beside {options.bridges} synthetic bridges", table)
    missed = 0
    for case, row in rows.items():
        without, own = list(row.values())[1:]
        missed += is_missed(f"{case}: prior's error, %", own, f"<= {LOSS * without:.4f}")
    modes = list(dict.fromkeys(mode for _, F in real.values() for mode in F))
    pooled = FleetPrior(families=dict.fromkeys(modes, "any mode")).fit(real).comparison_["is_pooled"].sum()
    return int(missed + is_missed("families of the three that are pooled", pooled, "<= 0") > 0)


if __name__ == "__main__":
    sys.exit(main())
