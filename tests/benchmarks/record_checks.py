"""Faults that `check_records` names, findings on healthy records, outliers that `HampelFilter` removes, and time.

    OMP_NUM_THREADS=1 python tests/benchmarks/record_checks.py [FOLDER] [--seeds 20]

FOLDER, by default the one that the environment variable SKTHERMO_DATA names, holds ``z24/z24_monitoring.csv``,
``tower/tower.csv`` and ``kw51/kw51_mode6_daily.csv``; what is not there is left out. The exit code is 1 if a fault of a
campaign is missed in more than a tenth of the seeds, or healthy records have a finding.
"""

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd

from skthermo.datasets import load_z24, make_kw51_campaign, make_truss_campaign
from skthermo.preprocessing import HampelFilter, check_records

OUTLIERS = (0.8, 1.25)
"""Factors of a frequency of the wrong pole."""

Z24_BASELINE = 2240
"""First four fifths of the healthy records."""


def autocorrelated(random, shape, rho):
    """Normal noise of unit variance."""
    noise = random.standard_normal(shape)
    for row in range(1, len(noise)):
        noise[row] = rho * noise[row - 1] + np.sqrt(1 - rho**2) * noise[row]
    return noise


def healthy_campaigns(seeds):
    """Names and pairs of tables without any fault."""
    for seed in range(seeds):
        random = np.random.default_rng(seed)
        year = make_truss_campaign(random_state=seed)
        T, F = year.temperatures, year.frequencies
        yield "truss, a year of days", (T, F)
        yield "truss, 10 % gaps", (T.mask(random.random(T.shape) < 0.1), F.mask(random.random(F.shape) < 0.1))
        noise = 1 + 0.01 * autocorrelated(random, F.shape, 0.9)
        yield "truss, AR(1) .9", (T, year.clean_frequencies * noise)
        yield "truss, rounded to 1 degree", (T.round(0), F.round(2))
        yield "truss, arrays", (T.to_numpy(), F.to_numpy())
        two = make_truss_campaign(2, random_state=100 + seed)
        yield "truss, two years", (two.temperatures, two.frequencies)
    for seed in range(min(seeds, 5)):
        campaign = make_kw51_campaign(retrofit=False, random_state=seed)
        yield "KW51's campaigns, hourly", (campaign.temperatures, campaign.frequencies)


def real_records(folder):
    """Names and pairs of tables of healthy real structures."""
    if (folder / "z24").is_dir():
        bridge = load_z24(folder / "z24" / "z24_monitoring.csv")
        healthy = np.asarray(bridge.state) == "undamaged"
        yield "Z24, healthy", (bridge.temperatures[healthy], bridge.frequencies[healthy])
        first = slice(Z24_BASELINE)
        yield "Z24, baseline", (bridge.temperatures.iloc[first], bridge.frequencies.iloc[first])
        for digits in (1, 0):
            yield (
                f"Z24, rounded to {digits} digits",
                (bridge.temperatures[healthy].round(digits), bridge.frequencies[healthy]),
            )
    if (folder / "tower").is_dir():
        log = pd.read_csv(folder / "tower" / "tower.csv", index_col=0, parse_dates=True)
        yield "tower", (log[["T1", "T2"]], log.drop(columns=["T1", "T2"]))
    if (folder / "kw51").is_dir():
        daily = pd.read_csv(folder / "kw51" / "kw51_mode6_daily.csv", index_col=0, parse_dates=True)
        for name, part in (("before", slice("2019-05-14")), ("after", slice("2019-09-28", None))):
            yield f"KW51, daily, {name} the retrofit", (daily.loc[part, ["T"]], daily.loc[part, ["f"]])


def faults(T, F, seed):
    """Expected finding, name, and tables of each fault."""
    random, n_rows = np.random.default_rng(seed), len(T)
    month = slice(n_rows - max(n_rows // 12, 10), None)
    at_20, stuck = T.copy(), F.copy()
    at_20.iloc[month, 0] = 20.0
    stuck.iloc[month, 0] = float(F.iloc[:, 0].mean())
    yield "stuck sensor", "thermometer stuck at 20 degrees for a month", (at_20, F)
    yield "stuck mode", "mode stuck for a month", (T, stuck)
    yield "time shift", "temperatures 60 rows late", (T, F.shift(-60))
    yield "time shift", "temperatures 60 rows early", (T, F.shift(60))
    shuffled = T.iloc[random.permutation(n_rows)].set_axis(T.index)
    yield "weather", "temperatures shuffled", (shuffled, F)
    if F.shape[1] > 3:
        for share in (0.5, 0.1, 0.02):
            rows, swapped = random.random(n_rows) < share, F.to_numpy().copy()
            swapped[np.ix_(rows, [2, 3])] = swapped[np.ix_(rows, [3, 2])]
            yield "exchanged modes", f"modes 3 and 4 exchanged in {share:.0%}", (T, table_like(F, swapped))
    for share in (0.01, 0.003):
        wrong = random.random(F.shape) < share
        wrong[n_rows // 2, 0] = True
        yield "outliers", f"outliers, {share:.1%}", (T, F * np.where(wrong, random.choice(OUTLIERS, F.shape), 1.0))
    drift = 1 + 0.03 * np.linspace(0, 1, n_rows)[:, np.newaxis]
    yield "trend", "frequencies drift by 3 %", (T, F * drift)


def table_like(table, values):
    return pd.DataFrame(values, index=table.index, columns=table.columns)


def found(T, F):
    """Kinds of findings."""
    return set(check_records(T, F).table["what"])


def print_false_findings(records):
    """Share of healthy records with a finding, by kind of records; returns their number."""
    rows = {}
    for name, tables in records:
        rows.setdefault(name, []).append(found(*tables))
    for name, results in rows.items():
        kinds = sorted(set().union(*results))
        share = np.mean([bool(result) for result in results])
        print(f"  {name}: {100 * share:.0f} % of {len(results)}{': ' + ', '.join(kinds) if kinds else ''}", flush=True)
    return sum(bool(result) for results in rows.values() for result in results)


def print_hits(title, pairs):
    """Share of records in which each fault is named, and of those with another finding; the smallest share."""
    hits = {}
    for seed, (T, F) in enumerate(pairs):
        for expected, name, tables in faults(T, F, seed):
            result = found(*tables)
            hits.setdefault(name, []).append((expected in result, bool(result - {expected})))
    print(title)
    for name, results in hits.items():
        hit, other = 100 * np.mean(results, axis=0)
        print(f"  {name}: named in {hit:.0f} % of {len(results)}, another finding in {other:.0f} %", flush=True)
    return min(np.mean([hit for hit, _ in results]) for results in hits.values())


def print_outliers(folder):
    """What the filter removes of Z24, with and without outliers added."""
    bridge = load_z24(folder / "z24" / "z24_monitoring.csv")
    T, F = bridge.temperatures, bridge.frequencies
    damaged, frost = np.asarray(bridge.state) != "undamaged", (T["TP"] < 0).to_numpy()
    wrong = np.random.default_rng(0).random(F.shape) < 0.01
    factors = np.random.default_rng(1).choice(OUTLIERS, F.shape)
    for label, targets in (("neighbours and weather", list(F)), ("neighbours only", None)):
        tables = {
            name: T.join(values) if targets else values
            for name, values in (("as measured", F), ("spoiled", F * np.where(wrong, factors, 1)))
        }
        hampel = HampelFilter(targets=targets).fit(tables["as measured"][:Z24_BASELINE])
        removed = {
            name: (hampel.transform(table)[list(F)].isna() & F.notna()).to_numpy() for name, table in tables.items()
        }
        healthy = removed["as measured"][~damaged].mean(), removed["as measured"][~damaged & frost].mean()
        print(
            f"Z24, HampelFilter by {label}: removed {100 * healthy[0]:.2f} % of healthy values, in frost "
            f"{100 * healthy[1]:.2f} %, of damaged {100 * removed['as measured'][damaged].mean():.2f} %; of 1 % "
            f"outliers added {100 * removed['spoiled'][wrong].mean():.0f} %"
        )


def print_seconds():
    """Time for many records."""
    for n_rows in (20_000, 500_000):
        random = np.random.default_rng(0)
        air = (
            10 + 12 * np.sin(2 * np.pi * np.arange(n_rows) / 8760) + 4 * autocorrelated(random, (n_rows, 1), 0.95)[:, 0]
        )
        T = air[:, np.newaxis] + random.standard_normal((n_rows, 5))
        F = [4, 5, 10, 11, 15, 16] - 0.01 * air[:, np.newaxis] + 0.03 * random.standard_normal((n_rows, 6))
        start = time.perf_counter()
        kinds = found(T, F)
        print(f"{n_rows} rows of 5 sensors and 6 modes: {time.perf_counter() - start:.1f} s, findings {sorted(kinds)}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=os.environ.get("SKTHERMO_DATA"))
    parser.add_argument("--seeds", type=int, default=20)
    options = parser.parse_args()
    print("Findings on healthy records:")
    n_false = print_false_findings(healthy_campaigns(options.seeds))
    campaigns = (make_truss_campaign(random_state=seed) for seed in range(options.seeds))
    worst = print_hits("Truss, a year of days:", ((year.temperatures, year.frequencies) for year in campaigns))
    if options.folder is not None:
        folder = Path(options.folder)
        real = list(real_records(folder))
        n_false += print_false_findings(real)
        for name, tables in real:
            print_hits(f"{name}:", [tables])
        if (folder / "z24").is_dir():
            print_outliers(folder)
    print_seconds()
    print(f"findings on healthy records: {n_false}, target 0; worst share of faults named: {worst:.2f}, target 0.9")
    return 1 if n_false or worst < 0.9 else 0


if __name__ == "__main__":
    sys.exit(main())
