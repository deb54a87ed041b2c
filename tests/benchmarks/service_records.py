"""Expected beside true rates of detectors on raw records, with outliers, gaps and noise that lasts.

    OMP_NUM_THREADS=1 python tests/benchmarks/service_records.py
    OMP_NUM_THREADS=1 python tests/benchmarks/service_records.py --structures truss --seeds 4
    OMP_NUM_THREADS=1 python tests/benchmarks/service_records.py --cleaned
    OMP_NUM_THREADS=1 python tests/benchmarks/service_records.py --faults

Structures whose truth is known are measured for a year: noise with a correlation of 0.5 from record to record, 10 % of
the values missing in runs, and 0.5 % of them outliers. A chain and four detectors learn these records as they are, and
a study says what the detectors will do in the weather of the next year. Beside it stands what they do with several
measurements of that year, each with noise, gaps and outliers of its own. The exit code is 1 if the mean difference
exceeds 1.5 points for the healthy structures or 2.5 for the damaged ones. With --cleaned, chain and detectors learn the
records without the outliers that `HampelFilter` finds, and the study knows of none. With --faults, no study is made:
the table says how many of the outliers the chain finds among its training records, how many values it takes for
outliers that are none, and how gaps and outliers of simulated records compare with those of the training records.
"""

import argparse
import sys
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from slow_soil import slow_soil

from skthermo._tables.arrays import robust_deviation
from skthermo.datasets import make_fleet, make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator, WindowedAlarm
from skthermo.preprocessing import HampelFilter
from skthermo.studies import DetectabilityStudy
from skthermo.surrogate import DataInformedFEM

MEMORY, OUTLIERS = 0.5, 0.005
OUTAGES, GAPS = (0.03, 5), (0.07, 3)
"""Share of the records, and of the values of each mode beside them, that are missing, and mean number in a row."""

TOO_FAR = 6.0  # robust standard deviations of the residuals, from which a simulated value counts as an outlier
FAR = (8.0, 20.0)  # distance of an outlier, in standard deviations of the noise
WINDOW, N_REPEATS = 7, 8
LARGE = 100  # degrees of freedom, from which on a reduced model is much faster
SETTLING = 60  # days until soil has forgotten where it began
LARGEST = {"healthy": 1.5, "damaged": 2.5}


@dataclass(frozen=True)
class Truth:
    """A structure in two years of weather: frequencies without noise of the first, and of the second by state."""

    model: Any
    weather: tuple[pd.DataFrame, pd.DataFrame]
    learned: pd.DataFrame
    states: Mapping[str, tuple[Mapping[str, float], pd.DataFrame]]
    level: Any


def truss(seed):
    """A truss, once a day."""
    states = {"healthy": {}, "bottom": {"bottom": 0.15}, "top": {"top": 0.15}}
    first = make_truss_campaign(random_state=seed)
    later = {
        name: make_truss_campaign(damage=damage or None, random_state=seed + 500) for name, damage in states.items()
    }
    return Truth(
        make_truss(),
        (first.temperatures, later["healthy"].temperatures),
        first.clean_frequencies,
        {name: (states[name], one.clean_frequencies) for name, one in later.items()},
        0.01,
    )


def of_fleet(kind, samples_per_day):
    """A bridge of a kind, so many times a day."""

    def build(seed):
        bridge = next(iter(make_fleet(1, kinds=[kind], random_state=seed).values()))
        options = {"samples_per_day": samples_per_day, "noise": 0, "gaps": 0, "outliers": 0}
        first = bridge.records(365, "2025-01-01", **options)
        states = {"healthy": {}} | {group: {group: 0.15} for group in list(bridge.groups)[:2]}
        later = {name: bridge.records(365, "2026-01-01", damage=damage, **options) for name, damage in states.items()}
        return Truth(
            bridge.model,
            (first.temperatures, later["healthy"].temperatures),
            first.frequencies,
            {name: (states[name], one.frequencies) for name, one in later.items()},
            bridge.noise,
        )

    return build


def soil(seed):
    """A girder on soil that follows the air slowly, twice a day; its weather holds a mean of the air over 30 days."""
    states = {"healthy": {}, "span 2": {"span 2": 0.15}, "soil 2": {"soil 2": 0.15}}
    records = {}
    for name, damage in states.items():
        one = slow_soil(seed, n_days=SETTLING + 730, damage=damage, noise=0, gaps=0, outliers=0)
        T = one.temperatures.assign(month=one.temperatures["air"].rolling("30D").mean())
        records[name] = [table.iloc[12 * SETTLING :: 6] for table in (T, one.clean_frequencies)]
    weather, clean = records["healthy"]
    return Truth(
        one.model,
        (weather.iloc[:730], weather.iloc[730:]),
        clean.iloc[:730],
        {name: (states[name], records[name][1].iloc[730:]) for name in states},
        0.003,
    )


STRUCTURES: Mapping[str, Callable[[int], Truth]] = {
    "truss": truss,
    "girder": of_fleet("girder", 4),
    "arch": of_fleet("arch", 1),
    "soil": soil,
}


def lasting(n_records, share, length, random):
    """A Markov chain that is true for this share of the records, for so many on the average."""
    states, chances = np.zeros(n_records, dtype=bool), random.random(n_records)
    begins = share / (1 - share) / length
    for row in range(1, n_records):
        states[row] = chances[row] < (1 - 1 / length if states[row - 1] else begins)
    return states


def measured(clean, level, seed):
    """Raw records of clean frequencies, and which of their values are outliers."""
    random = np.random.default_rng(seed)
    n_records, n_modes = clean.shape
    noise = random.standard_normal(clean.shape)
    for row in range(1, n_records):
        noise[row] = MEMORY * noise[row - 1] + np.sqrt(1 - MEMORY**2) * noise[row]
    is_outlier = random.random(clean.shape) < OUTLIERS
    far = random.uniform(*FAR, clean.shape) * random.choice([-1, 1], clean.shape)
    missing = np.column_stack([lasting(n_records, *GAPS, random) for _ in range(n_modes)])
    missing |= lasting(n_records, *OUTAGES, random)[:, np.newaxis]
    raw = clean * (1 + level * np.where(is_outlier, far, noise))
    return raw.mask(missing), is_outlier & ~missing


def chain_of(truth):
    """The chain that learns the records."""
    return DataInformedFEM(truth.model, reduce=truth.model.n_dof > LARGE, random_state=0)


def detectors_of(modes):
    """Detectors by name."""

    def compensated(last):
        return make_pipeline(TemperatureCompensator(LinearRegression(), targets=modes), last)

    return {
        "raw frequencies": MahalanobisDetector(),
        "temperature removed": compensated(MahalanobisDetector()),
        f"mean of {WINDOW}": compensated(WindowedAlarm(WINDOW)),
        f"m of {WINDOW}": compensated(WindowedAlarm(WINDOW, rule="m-of-n")),
    }


def one_study(structure, seed, is_cleaned):
    """Expected and true rates by state and detector, in percent."""
    truth = STRUCTURES[structure](seed)
    learned, modes = measured(truth.learned, truth.level, [seed, 0])[0], list(truth.learned)
    T, later = truth.weather
    options = {}
    if is_cleaned:
        learned = HampelFilter(targets=modes).fit_transform(T.join(learned))[modes]
        options = {"gaps": "fitted", "outliers": 0}
    fem = chain_of(truth).fit(T, learned)
    damages = {" ".join(damage) or "healthy": name for name, (damage, _) in truth.states.items()}
    study = DetectabilityStudy(
        fem,
        detectors_of(modes),
        [damage for damage, _ in truth.states.values()],
        n_repeats=N_REPEATS,
        uncertainty="noise",
        random_state=seed,
        **options,
    )

    def reference(scenario, number):
        name = damages[" ".join(scenario.damage or {}) or "healthy"]
        return measured(truth.states[name][1], truth.level, [seed, 1, number])[0]

    results = study.run(later, reference=reference)
    rates = 100 * results.pivot_table("rate", ["detector", "scenario"], "source", sort=False)
    rates = rates.rename(columns={"simulated": "expected", "reference": "true"})
    return rates.reset_index().assign(structure=structure, seed=seed)


def faults(structure, seed):
    """How many outliers are found among training records, and how often simulated records have faults."""
    truth = STRUCTURES[structure](seed)
    learned, later = truth.weather
    raw, is_outlier = measured(truth.learned, truth.level, [seed, 0])
    fem = chain_of(truth).fit(learned, raw)
    found, options = ~np.isnan(fem.recorder_.service.outliers), {"noise": "fitted", "gaps": "fitted"}
    drawn = [fem.simulate(later, outliers="fitted", random_state=number, **options) for number in range(N_REPEATS)]
    noise = np.stack([(one / fem.simulate(later) - 1).to_numpy() for one in drawn])
    is_far = np.abs(noise) > TOO_FAR * robust_deviation(fem.recorder_.residuals.values)
    n_values = raw.notna().to_numpy().sum()
    return {
        "structure": structure,
        "seed": seed,
        "outliers %": 100 * is_outlier.sum() / n_values,
        "found %": 100 * (found & is_outlier).sum() / is_outlier.sum(),
        "false %": 100 * (found & ~is_outlier).sum() / n_values,
        "simulated %": 100 * is_far.sum() / (~np.isnan(noise)).sum(),
        "missing %": 100 * raw.isna().to_numpy().mean(),
        "simulated missing %": 100 * np.isnan(noise).mean(),
        "in a row": _mean_length(raw.isna().to_numpy()),
        "simulated in a row": np.mean([_mean_length(np.isnan(one)) for one in noise]),
    }


def _mean_length(missing):
    begins = np.diff(missing.astype(int), axis=0, prepend=0) == 1
    return missing.sum() / max(begins.sum(), 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--structures", nargs="+", choices=list(STRUCTURES), default=list(STRUCTURES))
    parser.add_argument("--seeds", type=int, default=3, help="number of structures of each kind")
    parser.add_argument("--cleaned", action="store_true", help="learn records without outliers, and expect none")
    parser.add_argument("--faults", action="store_true", help="gaps and outliers alone")
    args = parser.parse_args()
    warnings.simplefilter("ignore")  # of gaps and outliers, which are meant
    start = time.perf_counter()
    cases = [(structure, seed) for structure in args.structures for seed in range(args.seeds)]
    if args.faults:
        table = pd.DataFrame([faults(*case) for case in cases])
        print(table.groupby("structure", sort=False).mean().drop(columns="seed").round(2).to_string())
        return 0
    table = pd.concat([one_study(*case, args.cleaned) for case in cases])
    table["state"] = np.where(table["scenario"] == "healthy", "healthy", "damaged")
    table["difference"] = table["expected"] - table["true"]
    table["absolute"] = table["difference"].abs()
    means = table.groupby(["structure", "state", "detector"], sort=False)[
        ["expected", "true", "difference", "absolute"]
    ]
    print(f"{args.seeds} seeds; percent\n{means.mean().round(1).to_string()}")
    overall = table.groupby("state", sort=False)[["difference", "absolute"]].mean()
    print(f"\n{overall.round(2).to_string()}\n{time.perf_counter() - start:.0f} s")
    return int(any(overall.loc[state, "absolute"] > most for state, most in LARGEST.items()))


if __name__ == "__main__":
    sys.exit(main())
