"""Errors of a regression on the weather in a later period, with and without means of earlier temperatures.

    OMP_NUM_THREADS=1 python tests/benchmarks/earlier_weather.py [--parts truss fleet soil footbridge z24 kw51]

A year is learned and another one evaluated: of the truss, of eight bridges of a fleet, of a girder whose soil follows
the air with 40 days, and of a footbridge with frost; of Z24, whose data are in the folder that SKTHERMO_DATA names, the
records after the first 50, 65 and 80 %; of KW51, the last third of a campaign. Errors are medians of absolute relative
differences to the true frequencies, where these are known, in percent, on average over the modes. A last part counts in
how many years with a drift or a step, and no memory, means are chosen.
"""

import numpy as np
import pandas as pd
from harness import arguments, shown, z24_records
from sklearn.base import clone
from sklearn.pipeline import Pipeline
from structures import Footbridge, slow_soil

from skthermo.datasets import make_fleet, make_kw51_campaign, make_truss_campaign
from skthermo.surrogate import TemperatureMapper


def truss():
    for seed in range(4):
        two = make_truss_campaign(2, random_state=seed)
        yield f"truss {seed}", two.temperatures, two.frequencies[:365], two.clean_frequencies[365:]


def fleet():
    for name, bridge in make_fleet(8, random_state=100).items():
        year, later = (bridge.records(365, start, samples_per_day=8, random_state=1) for start in ("2023", "2024"))
        T = pd.concat([year.temperatures, later.temperatures])
        yield f"fleet, {name}", T, year.frequencies, later.clean_frequencies


def soil():
    for seed in range(3):
        year, later = (
            slow_soil(seed, start, n_days=days) for start, days in (("2024-01-01", 366), ("2025-01-01", 365))
        )
        T = pd.concat([year.temperatures, later.temperatures])
        yield f"girder on slow soil {seed}", T, year.frequencies, later.clean_frequencies


def footbridge():
    bridge = Footbridge(3)
    year, later = bridge.training(True), bridge.evaluated({})
    T = pd.concat([year, later])[list(bridge.T)]
    yield "footbridge with frost", T, year[bridge.modes], later[bridge.modes]


def z24():
    (T, F), _ = z24_records()
    for share in (0.5, 0.65, 0.8):
        n = int(share * len(T))
        yield f"Z24 after {share:.0%}", T, F[:n], F[n:]


def kw51():
    records = make_kw51_campaign(random_state=0)
    n = 2 * len(records.temperatures) // 3
    yield "KW51, a campaign", records.temperatures, records.frequencies[:n], records.clean_frequencies[n:]


def error(mapper, T, F, truth):
    """Of a mapper that learns each mode, twice, the second time without what is far from the first."""
    errors = []
    for name in F:
        known = F[[name]]
        for _ in range(2):
            mapper = clone(mapper).fit(T.loc[F.index], known)
            left = np.log(F[[name]] / np.asarray(mapper.predict(T.loc[F.index])).reshape(-1, 1))
            left -= left.median()
            known = F[[name]].mask(left.abs() > 5 * 1.48 * left.abs().median())
        predicted = np.asarray(mapper.predict(T.loc[truth.index])).ravel()
        errors.append(100 * np.nanmedian(np.abs(predicted / truth[name] - 1)))
    return np.mean(errors)


def measured(part):
    rows = []
    for name, T, F, truth in PARTS[part]():
        T = T.ffill().bfill()
        together = TemperatureMapper().behind_means(T.loc[F.index], F)  # means that suit all modes
        row = {"structure": name, "half-lives": ""}
        if isinstance(together, Pipeline):
            row["half-lives"] = ", ".join(together[0].half_lives)
        ways = {"without": TemperatureMapper(means=None), "chosen by all modes": together}
        ways["chosen by each mode"] = TemperatureMapper()
        rows.append(row | {way: error(mapper, T, F, truth) for way, mapper in ways.items()})
    return pd.DataFrame(rows).set_index("structure")


def changed():
    """Years of six-hourly records with a change, in which the frequencies follow the air at once."""
    rows = []
    for name, step, trend in (("none", 0, 0), ("a step of 2 %", -0.02, 0), ("2 % a year", 0, -0.02)):
        counts = {"change": name}
        for days in (365, 400, 730):
            chosen = 0
            for seed in range(8):
                random, stamps = np.random.default_rng(seed), pd.date_range("2023-10-28", periods=4 * days, freq="6h")
                spells = pd.Series(random.normal(0, 1, len(stamps))).ewm(alpha=0.08).mean() * 18
                day, place = np.arange(len(stamps)) / 4, np.arange(len(stamps)) / len(stamps)
                T = pd.DataFrame({"air": 10 - 10 * np.cos(2 * np.pi * (day - 65) / 365.25) + spells.to_numpy()}, stamps)
                logs = -np.outer(T["air"], [2e-3, 1e-3]) + (step * (place > 0.5) + trend * day / 365)[:, np.newaxis]
                F = [4.0, 6.0] * np.exp(logs + 2e-3 * random.standard_normal(logs.shape))
                chosen += TemperatureMapper().fit(T, pd.DataFrame(F, stamps)).means_ is not None
            counts[f"{days} days"] = chosen
        rows.append(counts)
    return pd.DataFrame(rows).set_index("change")


PARTS = {"truss": truss, "fleet": fleet, "soil": soil, "footbridge": footbridge, "z24": z24, "kw51": kw51}


def main():
    options = arguments(__doc__, parts=PARTS)
    table = pd.concat([measured(part) for part in options.parts])
    shown("Error of the frequencies of later records, %, and the half-lives that are chosen", table, 3)
    shown("Years of eight in which means are chosen although nothing remembers the weather", changed(), 0)


if __name__ == "__main__":
    main()
