"""Two years of a girder on slow soil: drift and steps, without and with the mean that `find_memory` gives.

    OMP_NUM_THREADS=1 python tests/benchmarks/slow_memory.py [--seeds 8]

Healthy records, records whose first soil spring loses a tenth of its stiffness a year, and records in which span 2
loses a fifth at once after 1.4 years. A chain learns from the first year of each. Steps and trends, as `check_records`
finds them, of the frequencies (with the mean, as it is; without, on records that have no stamps, where no mean is
looked for), and drift, as `track_parameters` finds it. The exit code is 1 if healthy records have a step or a drift
with the mean, or damaged ones have neither.
"""

import sys

import numpy as np
import pandas as pd
from harness import arguments
from sklearn.pipeline import make_pipeline
from structures import slow_soil

from skthermo.monitoring import track_parameters
from skthermo.preprocessing import check_records, find_memory
from skthermo.surrogate import DataInformedFEM, TemperatureMapper

EVERY, YEAR = 3, 365 * 4  # of the two-hourly records; records a year
STEP = int(1.4 * YEAR)


def states(seed):
    """Names, temperatures and frequencies."""
    healthy = slow_soil(seed, n_days=730)
    T, F = healthy.temperatures[::EVERY], healthy.frequencies[::EVERY]
    yield "healthy", healthy.model, T, F
    aged = slow_soil(seed, n_days=1, damage={"soil 1": 0.2}).clean_frequencies.mean()
    ratio = np.log(aged / slow_soil(seed, n_days=1).clean_frequencies.mean())
    share = np.arange(len(F))[:, np.newaxis] / len(F)
    yield "soil loses 10 % a year", healthy.model, T, F * np.exp(share * ratio.to_numpy())
    damaged = slow_soil(seed, n_days=730, damage={"span 2": 0.2}).frequencies[::EVERY]
    yield "span 2 loses 20 %", healthy.model, T, pd.concat([F[:STEP], damaged[STEP:]])


def rows(seed):
    """What is found, without and with the mean."""
    for name, model, T, F in states(seed):
        features = find_memory(T[:YEAR], F[:YEAR]).features
        for way in ("without", "with"):
            plain = way == "without"
            tables = (T.reset_index(drop=True), F.reset_index(drop=True)) if plain else (T, F)
            kinds = set(check_records(*tables).table["what"])
            mapper = TemperatureMapper() if plain or features is None else make_pipeline(features, TemperatureMapper())
            fem = DataInformedFEM(model, mapper=mapper, reduce=True, random_state=0).fit(T[:YEAR], F[:YEAR])
            history = track_parameters(fem, T, F, random_state=0)
            yield {
                "state": name,
                "mean": way,
                "seed": seed,
                "time constants": "" if features is None else " ".join(features.time_constants),
                "memory": "thermal-memory" in kinds,
                "step": "sudden-change" in kinds,
                "trend": "trend" in kinds,
                "drift": bool(history.has_drift),
            }


def main():
    options = arguments(__doc__, seeds=list(range(8)))
    found = []
    for seed in options.seeds:
        found += rows(seed)
        print(pd.DataFrame(found[-6:]).to_string(index=False, header=seed == options.seeds[0]), flush=True)
    table = pd.DataFrame(found)
    counts = table.groupby(["state", "mean"], sort=False)[["memory", "step", "trend", "drift"]].sum()
    print(f"\nrecords of {len(options.seeds)} with each finding\n{counts.to_string()}")
    ours = table[table["mean"] == "with"]
    healthy = ours["state"] == "healthy"
    false = (ours["step"] | ours["drift"])[healthy]
    missed = ~(ours["step"] | ours["trend"] | ours["drift"])[~healthy]
    print(
        f"healthy with a step or a drift: {false.sum()}, target 0; damaged without a finding: {missed.sum()}, target 0"
    )
    return int(false.any() or missed.any())


if __name__ == "__main__":
    sys.exit(main())
