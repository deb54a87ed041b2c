"""Defects of records and what is made of them: refused, as if the values were missing, named, or wrong without a word.

    OMP_NUM_THREADS=1 python tests/benchmarks/record_defects.py [--shares 5 50] [--seeds 1]

A year of six-hourly records of the truss, of which one column is wrong in a share of the rows: values of a broken
sensor (size), of the other sign, -999 (marker), one that repeats (stuck), or at another level. For each callable the
answer is compared with the one to records where the same values are missing:

- missing: equal to it, and a warning names the column;
- silently missing: equal to it without such a warning;
- named: another answer, as single records between wrong ones count as missing, too, or nothing is set aside, and a
  warning names the column (of a monitor in service: its faults, events or reasons);
- refused: an error;
- wrong: another answer, without a warning that names the column.

The exit code is 1 if an answer is wrong or silently missing.
"""

import copy
import sys
import warnings

import numpy as np
import pandas as pd
from harness import arguments, compensated, shown

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.monitoring import Monitor, track_parameters
from skthermo.surrogate import DataInformedFEM, FleetMapper, TemperatureMapper

PER_DAY = 4
SHARES = (20,)
DEFECTS = {
    "size": "far too large",
    "sign": "other sign",
    "marker": "-999",
    "stuck": "stuck",
    "level": "at another level",
}
OUTCOMES = {
    "missing": "counts as missing, and is named",
    "named": "named",
    "refused": "refused",
    "silently missing": "counts as missing, without a word",
    "wrong": "wrong without a word",
}
OF_ONE_TABLE = {
    "DataInformedFEM.predict": "temperature",
    "TemperatureMapper.fit": "temperature",
    "FleetMapper.fit": "temperature",
    "MahalanobisDetector.fit": "frequency",
}
OF_ALL = [
    *("DataInformedFEM.fit", "DataInformedFEM.predict", "TemperatureMapper.fit", "TemperatureCompensator.fit"),
    *("MahalanobisDetector.fit", "Monitor.fit", "Monitor.update", "track_parameters", "FleetMapper.fit"),
]
SAME = 1e-6  # relative difference of answers that are the same


def campaign(seed):
    year = make_truss_campaign(samples_per_year=365 * PER_DAY, samples_per_day=PER_DAY, noise=0.002, random_state=seed)
    return year.temperatures, year.frequencies


def spoiled(table, column, defect, share, random):
    """The table with a defect in a share of the rows of a column, and the same with these values missing."""
    values = table[column].to_numpy()
    n_wrong = max(round(share / 100 * len(values)), 3)
    rows = np.sort(random.choice(len(values), n_wrong, replace=False))
    if defect in ("stuck", "level"):  # these last
        first = random.integers(1, len(values) - n_wrong + 1) if n_wrong < 60 * PER_DAY else 1
        rows = np.arange(first, first + n_wrong)
    wrong = {
        "size": values[rows] * (100 if values.min() > 0 else 1) + (0 if values.min() > 0 else 484.0),
        "sign": -values[rows],
        "marker": np.full(n_wrong, -999.0),
        "stuck": np.full(n_wrong, values[rows[0]]),
        "level": values[rows] + 12 * np.ptp(values),
    }[defect]
    tables = []
    for new in (wrong, np.nan):
        changed = table.copy()
        changed.iloc[rows, table.columns.get_loc(column)] = new
        tables.append(changed)
    return tables


def callables(T, F):
    """By name, a function of temperatures and frequencies that gives numbers."""
    model, months = make_truss(), slice(0, 60 * PER_DAY)
    targets = list(F)
    healthy_T, healthy_F = campaign(99)
    healthy = healthy_T.join(healthy_F)
    healthy.index += pd.Timedelta(366, "D")
    half = slice(0, len(T) // 2)

    def monitor():
        return Monitor(compensated(targets), targets=targets)

    fitted = monitor().fit(T.join(F))
    chain = DataInformedFEM(model, random_state=0).fit(T[half], F[half])
    others = [TemperatureMapper().fit(T, F * (1 + 0.01 * k)) for k in range(2)]
    later = pd.Timedelta(366, "D")

    def updated(T, F):
        one, monitor = T.join(F), copy.deepcopy(fitted)
        answers = monitor.update(one.set_axis(one.index + later))
        named = [*monitor.faults_["column"], *answers["modes"], *answers["reason"], *monitor.events_["modes"]]
        warnings.warn(" ".join(map(repr, " ".join(named).replace(",", " ").split())), stacklevel=1)
        return answers["index"]

    return {
        "DataInformedFEM.fit": lambda T, F: DataInformedFEM(model, random_state=0).fit(T, F).predict(healthy_T),
        "DataInformedFEM.predict": lambda T, F: chain.predict(T),
        "TemperatureMapper.fit": lambda T, F: TemperatureMapper().fit(T, F).predict(healthy_T),
        "TemperatureCompensator.fit": lambda T, F: (
            TemperatureCompensator(TemperatureMapper(), targets=targets).fit(T.join(F)).transform(healthy)
        ),
        "MahalanobisDetector.fit": lambda T, F: MahalanobisDetector().fit(F).score_samples(healthy_F),
        "Monitor.fit": lambda T, F: monitor().fit(T.join(F)).update(healthy[months])["index"],
        "Monitor.update": updated,
        "track_parameters": lambda T, F: track_parameters(chain, T, F).rates["per_year"],
        "FleetMapper.fit": lambda T, F: FleetMapper(others).fit(T, F).predict(healthy_T),
    }


def answer(function, T, F):
    """What a callable gives, and the texts of its warnings; an error instead of the first if it refuses."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            given = np.asarray(function(T, F), dtype=float)
        except ValueError as error:
            given = error
    return given, " ".join(str(one.message) for one in caught)


def outcome(function, wrong, missing, column):
    given, said = answer(function, *wrong)
    if isinstance(given, ValueError):
        return "refused"
    expected, _ = answer(function, *missing)
    is_named = repr(column) in said
    if isinstance(expected, ValueError) or expected.shape != given.shape:
        return "named" if is_named else "wrong"
    scale = np.nanstd(expected) or 1.0
    if np.allclose(given, expected, rtol=0, atol=SAME * scale, equal_nan=True):
        return "missing" if is_named else "silently missing"
    return "named" if is_named else "wrong"


def main():
    options = arguments(__doc__, shares=(list(SHARES), "of the rows, in %%"), seeds=1, only=(list(OF_ALL), "callables"))
    rows = []
    for seed in range(options.seeds):
        T, F = campaign(seed)
        functions = callables(T, F)
        random = np.random.default_rng(seed)
        for name, function in functions.items():
            if name not in options.only:
                continue
            for what, table in (("temperature", T), ("frequency", F)):
                if OF_ONE_TABLE.get(name, what) != what:
                    continue
                column = table.columns[1]
                for defect in DEFECTS:
                    for share in options.shares:
                        pair = spoiled(table, column, defect, share, random)
                        tables = [(one, F) if what == "temperature" else (T, one) for one in pair]
                        rows.append((name, what, defect, share, outcome(function, *tables, column)))
    table = pd.DataFrame(rows, columns=["call", "column", "defect", "share", "outcome"])
    counts = table.groupby("defect", sort=False)["outcome"].value_counts().unstack(fill_value=0)
    counts = counts.reindex(columns=list(OUTCOMES), fill_value=0).rename(DEFECTS).rename(columns=OUTCOMES)
    counts.loc["all"] = counts.sum()
    shares = ", ".join(f"{share:g}" for share in options.shares)
    shown(f"One wrong column in {shares} % of the rows: trials by what is made of it", counts)
    silent = table[table["outcome"].isin(("wrong", "silently missing"))].replace({"defect": DEFECTS})
    silent = silent.groupby(["call", "column", "defect"], sort=False)["share"]
    silent = silent.agg(lambda some: ", ".join(map(str, some)))
    shown("Without a word", silent.rename("at these shares of the rows, %").to_frame())
    return int(len(silent) > 0)


if __name__ == "__main__":
    sys.exit(main())
