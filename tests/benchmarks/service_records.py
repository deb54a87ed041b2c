"""Expected beside true rates of detectors on raw records, with outliers, gaps and noise that lasts.

    OMP_NUM_THREADS=1 python tests/benchmarks/service_records.py
    OMP_NUM_THREADS=1 python tests/benchmarks/service_records.py --structures truss --seeds 4

Structures whose truth is known are measured for a year: noise with a correlation of 0.5 from record to record, 10 % of
the values missing in runs, and 0.5 % of them outliers. A chain and four detectors learn these records as they are, and
a study says what the detectors will do in the weather of the next year. Beside it stands what they do with several
measurements of that year, each with noise, gaps and outliers of its own. The exit code is 1 if the mean difference
exceeds 1.5 points for the healthy structures or 2.5 for the damaged ones.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from harness import arguments, autoregression, compensated, shown
from sklearn.linear_model import LinearRegression
from structures import slow_soil

from skthermo.datasets import make_fleet, make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, WindowedAlarm
from skthermo.studies import DetectabilityStudy
from skthermo.surrogate import DataInformedFEM

MEMORY, OUTLIERS = 0.5, 0.005
OUTAGES, GAPS = (0.03, 5), (0.07, 3)
"""Share of the records, and of the values of each mode beside them, that are missing, and mean number in a row."""

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
    noise = autoregression(random, clean.shape, MEMORY)
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
    return {
        "raw frequencies": MahalanobisDetector(),
        "temperature removed": compensated(modes, None, LinearRegression()),
        f"means of {WINDOW} records": compensated(modes, WindowedAlarm(WINDOW), LinearRegression()),
        f"4 of {WINDOW} records": compensated(modes, WindowedAlarm(WINDOW, rule="m-of-n"), LinearRegression()),
    }


def one_study(structure, seed):
    """Expected and true rates by state and detector, in percent."""
    truth = STRUCTURES[structure](seed)
    learned, modes = measured(truth.learned, truth.level, [seed, 0])[0], list(truth.learned)
    T, later = truth.weather
    fem = chain_of(truth).fit(T, learned)
    damages = {" ".join(damage) or "healthy": name for name, (damage, _) in truth.states.items()}
    study = DetectabilityStudy(
        fem,
        detectors_of(modes),
        [damage for damage, _ in truth.states.values()],
        n_repeats=N_REPEATS,
        uncertainty="noise",
        random_state=seed,
    )

    def reference(scenario, number):
        name = damages[" ".join(scenario.damage or {}) or "healthy"]
        return measured(truth.states[name][1], truth.level, [seed, 1, number])[0]

    results = study.run(later, reference=reference)
    rates = 100 * results.pivot_table("rate", ["detector", "scenario"], "source", sort=False)
    rates = rates.rename(columns={"simulated": "expected", "reference": "true"})
    return rates.reset_index().assign(structure=structure, seed=seed)


def main():
    args = arguments(__doc__, structures=STRUCTURES, seeds=(1, "number of structures of each kind"))
    cases = [(structure, seed) for structure in args.structures for seed in range(args.seeds)]
    table = pd.concat([one_study(*case) for case in cases])
    table["state"] = np.where(table["scenario"] == "healthy", "healthy", "damaged")
    table["difference"] = table["expected"] - table["true"]
    table["absolute"] = table["difference"].abs()
    means = table.groupby(["state", "detector", "structure"], sort=False)[["expected", "true"]].mean().round(1)
    both = means["expected"].astype(str) + " / " + means["true"].astype(str)
    shown(f"Alarms, expected / true, %; {args.seeds} structures of each kind, 15 % damage", both.unstack(sort=False))
    overall = table.groupby("state", sort=False)[["difference", "absolute"]].mean()
    overall = overall.rename(columns={"difference": "mean", "absolute": "mean, without its sign"})
    shown("Expected less true, points", overall)
    return int(any(overall.loc[state].iloc[1] > most for state, most in LARGEST.items()))


if __name__ == "__main__":
    sys.exit(main())
