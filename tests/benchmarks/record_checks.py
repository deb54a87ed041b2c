"""Faults and gross errors that `check_records` names, findings on healthy records, what `HampelFilter` removes.

    OMP_NUM_THREADS=1 python tests/benchmarks/record_checks.py [FOLDER] [--seeds 20] [--gross]

FOLDER, by default the one that the environment variable SKTHERMO_DATA names, holds ``z24/z24_monitoring.csv``,
``tower/tower.csv`` and ``kw51/kw51_mode6_daily.csv``; what is not there is left out. The exit code is 1 if a fault of a
campaign is missed in more than a tenth of the seeds, gross errors in more than a fiftieth, or healthy records have a
finding. ``--gross`` tries only gross errors.
"""

import collections
import sys
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from harness import arguments, autoregression, z24_records
from structures import slow_soil

from skthermo.datasets import load_z24, make_fleet, make_kw51_campaign, make_truss_campaign
from skthermo.preprocessing import HampelFilter, check_records, set_aside
from skthermo.preprocessing.checks._findings import SET_ASIDE

OUTLIERS = (0.8, 1.25)
"""Factors of a frequency of the wrong pole."""

ALSO = {"no-rows", "few-rows", "unsorted-stamps"}
"""Findings that are right beside others."""

Z24_BASELINE = 2240
"""First four fifths of the healthy records."""


def healthy_campaigns(seeds):
    """Names and pairs of tables without any fault."""
    for seed in range(seeds):
        random = np.random.default_rng(seed)
        year = make_truss_campaign(random_state=seed)
        T, F = year.temperatures, year.frequencies
        yield "truss, a year of days", (T, F)
        yield "truss, 10 % gaps", (T.mask(random.random(T.shape) < 0.1), F.mask(random.random(F.shape) < 0.1))
        noise = 1 + 0.01 * autoregression(random, F.shape, 0.9)
        yield "truss, AR(1) .9", (T, year.clean_frequencies * noise)
        yield "truss, rounded to 1 degree", (T.round(0), F.round(2))
        yield "truss, arrays", (T.to_numpy(), F.to_numpy())
        two = make_truss_campaign(2, random_state=100 + seed)
        yield "truss, two years", (two.temperatures, two.frequencies)
    for seed in range(min(seeds, 5)):
        campaign = make_kw51_campaign(retrofit=False, random_state=seed)
        yield "KW51's campaigns, hourly", (campaign.temperatures, campaign.frequencies)


def more_healthy_records(seeds):
    """Names and pairs of tables without a gross error; some have memory, a drift, gaps or outliers by design."""
    for seed in range(seeds):
        year = make_truss_campaign(samples_per_year=8760, samples_per_day=24, correlation=0.9, random_state=seed)
        T, F = year.temperatures, year.frequencies
        yield "truss, hourly, AR(1) .9", (T, F)
        yield "truss, a winter by the hour", (T[-2000:], F[-2000:])
        yield "truss, two-hourly, rounded to 1 degree", (T[::2].round(), F[::2].round(1))
        bridge = slow_soil(seed)
        yield "slow soil, two-hourly", (bridge.temperatures, bridge.frequencies)
        hourly = make_kw51_campaign(random_state=seed)
        yield "KW51's campaign with its retrofit", (hourly.temperatures, hourly.frequencies)
    for bridge in make_fleet(3 * seeds, random_state=0).values():
        records = bridge.records(365)
        yield f"fleet, {bridge.kind}", (records.temperatures, records.frequencies)


def real_records(folder):
    """Names and pairs of tables of healthy real structures."""
    if (folder / "z24").is_dir():
        (T, F), _ = z24_records(folder)
        yield "Z24, healthy", (T, F)
        yield "Z24, baseline", (T[:Z24_BASELINE], F[:Z24_BASELINE])
        for digits in (1, 0):
            yield f"Z24, rounded to {digits} digits", (T.round(digits), F)
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
    yield "stuck-sensor", "thermometer stuck at 20 degrees for a month", (at_20, F)
    yield "stuck-mode", "mode stuck for a month", (T, stuck)
    yield "time-shift", "temperatures 60 rows late", (T, F.shift(-60))
    yield "time-shift", "temperatures 60 rows early", (T, F.shift(60))
    shuffled = T.iloc[random.permutation(n_rows)].set_axis(T.index)
    yield "no-thermal-effect", "temperatures shuffled", (shuffled, F)
    if F.shape[1] > 3:
        for share in (0.5, 0.1, 0.02):
            rows, swapped = random.random(n_rows) < share, F.to_numpy().copy()
            swapped[np.ix_(rows, [2, 3])] = swapped[np.ix_(rows, [3, 2])]
            yield "exchanged-modes", f"modes 3 and 4 exchanged in {share:.0%}", (T, table_like(F, swapped))
    for share in (0.01, 0.003):
        wrong = random.random(F.shape) < share
        wrong[n_rows // 2, 0] = True
        yield (
            "frequency-outliers",
            f"outliers, {share:.1%}",
            (T, F * np.where(wrong, random.choice(OUTLIERS, F.shape), 1.0)),
        )
    drift = 1 + 0.03 * np.linspace(0, 1, n_rows)[:, np.newaxis]
    yield "trend", "frequencies drift by 3 %", (T, F * drift)


def with_values(table, rows, column, values):
    """A copy of a table with other values in some rows of a column."""
    changed = table.copy()
    changed.iloc[rows, column] = values
    return changed


def gross_errors(T, F, seed):
    """Name of each gross error, kinds of findings that are right, columns that are wrong, and tables."""
    random, n_rows = np.random.default_rng(seed), len(T)
    sensor, mode = random.integers(T.shape[1]), random.integers(F.shape[1])
    some = np.flatnonzero(random.random(n_rows) < 0.02)
    some = some if len(some) > 1 else np.array([3, 9])
    third = np.arange(n_rows // 3, 2 * n_rows // 3)
    in_T, in_F, both = {T.columns[sensor]}, {F.columns[mode]}, slice(None)

    def of_sensor(rows, values):
        return with_values(T, rows, sensor, values), F

    def of_mode(rows, values):
        return T, with_values(F, rows, mode, values)

    for value in (-999.0, 9999.0, 484.667, 1e6):
        yield f"thermometer is {value:g} in 2 % of the rows", {"placeholders"}, in_T, of_sensor(some, value)
        yield f"thermometer is {value:g} in a third of the rows", {"placeholders"}, in_T, of_sensor(third, value)
    yield "thermometer is 1e6 in one row", {"placeholders"}, in_T, of_sensor([n_rows // 2], 1e6)
    garbage = random.uniform(-300, 900, len(third))
    yield (
        "thermometer is random, -300 to 900, in a third",
        {"placeholders", "implausible-values"},
        in_T,
        of_sensor(third, garbage),
    )
    for value in (-999.0, 9999.0):
        yield f"mode is {value:g} in 2 % of the rows", {"placeholders"}, in_F, of_mode(some, value)
    for value, share, rows in ((0.0, "2 %", some), (0.0, "a third", third), (-1.0, "2 %", some)):
        yield f"mode is {value:g} in {share} of the rows", {"not-positive"}, in_F, of_mode(rows, value)
    here = T.iloc[:, sensor]
    yield "kelvin", {"kelvin"}, set(T), (T + 273.15, F)
    yield "kelvin in one sensor", {"kelvin"}, in_T, of_sensor(both, here + 273.15)
    yield "kelvin in a third of the rows", {"kelvin"}, in_T, of_sensor(third, here.iloc[third] + 273.15)
    yield "Fahrenheit", {"fahrenheit"}, set(T), (1.8 * T + 32, F)
    yield "tenths of a degree", {"scaled-temperatures"}, set(T), ((10 * T).round(), F)
    if T.shape[1] > 1:
        yield "Fahrenheit in one sensor", {"fahrenheit"}, in_T, of_sensor(both, 1.8 * here + 32)
        yield "tenths of a degree in one sensor", {"scaled-temperatures"}, in_T, of_sensor(both, 10 * here)
        either = in_T if T.shape[1] > 2 else set(T)
        yield "one sensor of opposite sign", {"opposite-signs"}, either, of_sensor(both, -here)
        yield "equal sensors", {"equal-columns"}, set(T), of_sensor(both, T.iloc[:, sensor - 1])
    yield "constant sensor", {"constant"}, in_T, of_sensor(both, 12.5)
    yield "sensor without a value", {"missing-column"}, in_T, of_sensor(both, np.nan)
    yield "constant mode", {"constant"}, in_F, of_mode(both, 5.0)
    yield "mode without a value", {"missing-column"}, in_F, of_mode(both, np.nan)
    middle = F.iloc[:, mode].median()
    coarse = middle * (1 + 0.02 * (F.iloc[:, mode] > middle)).where(F.iloc[:, mode].notna())
    yield "mode of two values", {"few-values"}, in_F, of_mode(both, coarse)
    if F.shape[1] > 1:
        yield "equal modes", {"equal-columns"}, set(F), of_mode(both, F.iloc[:, mode - 1])
    yield "exchanged tables", {"exchanged-tables"}, {""}, (F, T)
    yield "frequencies as temperatures", {"temperatures-are-frequencies"}, set(F), (F, F)
    yield "infinite values", {"infinite-values"}, in_T, of_sensor(some, np.inf)
    yield "no rows", {"no-rows"}, {""}, (T[:0], F[:0])
    yield "one row", {"no-rows"}, {""}, (T[:1], F[:1])
    yield from wrong_rows(T, F, random)
    yield from no_tables(T, F)


def wrong_rows(T, F, random):
    """Gross errors of times, rows and names."""
    n_rows, stamps = len(T), T.index
    again = np.sort(np.append(np.arange(n_rows), random.integers(n_rows, size=5)))
    unsorted = random.permutation(n_rows)
    text = stamps.strftime("%Y-%m-%d %H:%M")
    yield "stamps twice", {"repeated-stamps"}, {""}, (T.iloc[again], F.iloc[again])
    yield "stamps in disorder", {"unsorted-stamps"}, {""}, (T.iloc[unsorted], F.iloc[unsorted])
    for name, kind, index in (
        ("equal-stamps", "equal-stamps", pd.DatetimeIndex([stamps[0]] * n_rows)),
        ("a missing stamp", "missing-stamps", stamps.where(np.arange(n_rows) != 7)),
        ("seconds read as nanoseconds", "stamps-from-numbers", pd.to_datetime(stamps.as_unit("s").asi8)),
        ("20230101 read as nanoseconds", "stamps-from-numbers", pd.to_datetime(stamps.strftime("%Y%m%d").astype(int))),
        ("stamps-as-text", "stamps-as-text", text),
    ):
        yield name, {kind, "equal-stamps"}, {""}, (T.set_axis(index), F.set_axis(index))
    late = T.set_axis(stamps + pd.Timedelta("1D"))
    yield "tables of other times", {"different-rows"}, {""}, (late, F)
    yield "tables of other lengths", {"different-rows"}, {""}, (T[:-3], F)
    if T.shape[1] > 1:
        names = [T.columns[0], *T.columns[:-1]]
        yield "a name twice", {"column-names"}, {T.columns[0]}, (T.set_axis(names, axis=1), F)
    yield "tuples as names", {"column-names"}, {""}, (T.set_axis(pd.MultiIndex.from_product([["a"], T]), axis=1), F)


def no_tables(T, F):
    """What is no table of numbers."""
    texts, mixed = T.astype(str), T.astype(object)
    mixed.iloc[3, 0] = "error"
    yield "values as text", {"no-numbers"}, set(T), (texts, F)
    yield "one text", {"no-numbers"}, {T.columns[0]}, (mixed, F)
    for name, table in (
        ("a dict", dict(T)),
        ("three dimensions", np.stack([T, T])),
        ("None", None),
        ("a Series", T.iloc[:, 0]),
        ("a text", "T.csv"),
    ):
        yield f"{name} as temperatures", {"no-table"}, {""}, (table, F)


def print_all_gross_errors(folder, seeds):
    """Gross errors in campaigns and in real records; the smallest share of them that is named."""
    truss = [make_truss_campaign(random_state=seed) for seed in range(seeds)]
    pairs = {"Truss, a year of days": [(year.temperatures, year.frequencies) for year in truss]}
    hourly = make_kw51_campaign(retrofit=False, random_state=0)
    pairs["KW51's campaign, every six hours"] = [(hourly.temperatures[::6], hourly.frequencies[::6])]
    if folder is not None:
        pairs |= {name: [tables] for name, tables in real_records(folder) if "rounded" not in name}
    shares = []
    for name, tables in pairs.items():
        errors = (error for seed, pair in enumerate(tables) for error in gross_errors(*pair, seed))
        shares.append(print_gross_errors(f"{name}, gross errors that are not always named alone:", errors))
    return min(shares)


def print_gross_errors(title, errors):
    """How often each gross error is named with its columns, and what happens else; shares named and misnamed."""
    counts = {}
    for name, kinds, columns, tables in errors:
        try:
            table = check_records(*tables).table
            rows = [(what, column) for what, column in table[["what", "column"]].to_numpy()]
            right = {column for what, column in rows if what in kinds}
            wrong = {what for what, _ in rows if what not in kinds | ALSO}
            outcome = "named" if right and right <= columns else "misnamed" if rows else "missed"
        except Exception as error:
            outcome, wrong = f"error ({type(error).__name__})", set()
        counts.setdefault(name, []).append((outcome, wrong))
    print(title)
    for name, results in counts.items():
        outcomes = collections.Counter(outcome for outcome, _ in results)
        others = collections.Counter(what for _, wrong in results for what in wrong)
        also = f"; also {dict(others)}" if others else ""
        if outcomes["named"] < len(results) or others:
            print(f"  {name}: {dict(outcomes)}{also}", flush=True)
    every = [outcome for results in counts.values() for outcome, _ in results]
    n_alone = sum(outcome == "named" and not wrong for results in counts.values() for outcome, wrong in results)
    outcomes = dict(collections.Counter(every))
    print(f"  {len(counts)} errors, {len(every)} trials: {outcomes}, named and nothing else {n_alone}")
    return every.count("named") / max(len(every), 1)


def table_like(table, values):
    return pd.DataFrame(values, index=table.index, columns=table.columns)


def found(T, F):
    """Kinds of findings."""
    return set(check_records(T, F).table["what"])


def gross_found(T, F):
    """Kinds of gross errors that are found in two tables, or in either alone."""
    tables = [(T, F), (T, None), (None, F)]
    return {what for pair in tables for what in check_records(*pair).table["what"]}


def print_set_aside(records):
    """Values set aside in healthy records, and columns left out; returns the number of those columns."""
    rows = {}
    for name, (T, F) in records:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            cleaned = set_aside(T, F, exclude={"no-rows"})
        n_values = cleaned.table["n_rows"].where(cleaned.table["what"].isin(SET_ASIDE), 0).sum()
        rows.setdefault(name, []).append((n_values, len(cleaned.left_out), np.size(T) + np.size(F)))
    for name, counts in rows.items():
        n_values, n_left_out, n_all = np.sum(counts, axis=0)
        print(f"  {name}: {n_values} of {n_all:,} values set aside; columns left out: {n_left_out}", flush=True)
    return sum(n_left_out for counts in rows.values() for _, n_left_out, _ in counts)


def print_false_findings(records, find=found):
    """Share of healthy records with a finding, by kind of records; returns the number of those that are false."""
    rows = {}
    for name, tables in records:
        rows.setdefault(name, []).append(find(*tables))
    for name, results in rows.items():
        kinds = sorted(set().union(*results))
        share = np.mean([bool(result) for result in results])
        print(f"  {name}: {100 * share:.0f} % of {len(results)}{': ' + ', '.join(kinds) if kinds else ''}", flush=True)
    return sum(bool(result - ALSO) for results in rows.values() for result in results)


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


def main():
    options = arguments(__doc__, folder=Path, seeds=20, gross=(False, "only gross errors"))
    folder = options.folder
    named = print_all_gross_errors(folder, options.seeds)
    print(f"worst share of gross errors named: {named:.3f}, target 0.98")
    print("Gross errors found in healthy records:")
    n_false = print_false_findings(more_healthy_records(options.seeds), gross_found)
    if options.gross:
        print(f"gross errors found in healthy records: {n_false}, target 0")
        return 1 if n_false or named < 0.98 else 0
    print("Values set aside in healthy records:")
    n_false += print_set_aside(more_healthy_records(options.seeds))
    print("Findings on healthy records:")
    n_false += print_false_findings(healthy_campaigns(options.seeds))
    campaigns = (make_truss_campaign(random_state=seed) for seed in range(options.seeds))
    worst = print_hits("Truss, a year of days:", ((year.temperatures, year.frequencies) for year in campaigns))
    if folder is not None:
        real = list(real_records(folder))
        n_false += print_false_findings(real)
        for name, tables in real:
            print_hits(f"{name}:", [tables])
        if (folder / "z24").is_dir():
            print_outliers(folder)
    print(f"findings on healthy records: {n_false}, target 0; worst share of faults named: {worst:.2f}, target 0.9")
    return 1 if n_false or worst < 0.9 or named < 0.98 else 0


if __name__ == "__main__":
    sys.exit(main())
