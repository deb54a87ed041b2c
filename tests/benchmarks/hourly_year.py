"""One hourly year through the bridge KW51 at fifteen damage states, by the chain with its reduced model.

    python tests/benchmarks/hourly_year.py

The weather and the law of the parameters are made up; what counts is the time, on as many threads as BLAS may use, and
how far the reduced model is from the full one on random rows of every state.
"""

import argparse
import time

import numpy as np
import pandas as pd
from sklearn.linear_model import Ridge

from skthermo.datasets import make_kw51
from skthermo.fem import add_noise
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper

NOISE = 0.001
SEVERITIES = (0.05, 0.1, 0.2)


def hourly_year(model, n_hours):
    """Temperatures of a year, and frequencies of stiffnesses that fall as it warms."""
    random, hour = np.random.default_rng(0), np.arange(n_hours)
    season, day = np.sin(2 * np.pi * hour / 8760), np.sin(2 * np.pi * hour / 24)
    air = 10 + 10 * season + 5 * day + random.standard_normal(n_hours)
    stamps = pd.date_range("2025-01-01", periods=n_hours, freq="h")
    theta = 1 - 4e-4 * np.outer(air - 10, [1.0, 1.2, 0.8, 1.0, 0.9])
    frequencies = add_noise(model.reduced(0.05, random_state=0).frequencies(theta), NOISE, random_state=0)
    return pd.DataFrame({"T": air}, index=stamps), pd.DataFrame(frequencies, index=stamps).rename(
        columns=lambda mode: f"f{mode + 1}"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=int, default=8760)
    parser.add_argument("--checks", type=int, default=200, help="random rows that the full model solves too")
    options = parser.parse_args()
    model = make_kw51()
    T, F = hourly_year(model, options.hours)

    start = time.perf_counter()
    inverse = InverseSurrogate(noise=NOISE, reduce=True)
    fem = DataInformedFEM(model, inverse=inverse, mapper=TemperatureMapper(Ridge()), reduce=True, random_state=0)
    fem.fit(T, F)
    print(f"fit: {time.perf_counter() - start:.1f} s")

    states = [{group: severity} for group in [*model.groups][:5] for severity in SEVERITIES]
    start = time.perf_counter()
    simulated = [fem.simulate(T, damage=damage) for damage in states]
    print(f"{len(T)} rows at {len(states)} damage states: {time.perf_counter() - start:.1f} s")

    rows = np.array_split(np.random.default_rng(1).choice(len(T), options.checks, replace=False), len(states))
    theta = fem.predict_parameters(T)
    errors = [
        np.abs(frequencies.iloc[row] / model.damaged(damage).frequencies(theta.iloc[row]) - 1).to_numpy().max()
        for damage, frequencies, row in zip(states, simulated, rows, strict=True)
    ]
    print(f"largest relative difference from the full model on {options.checks} random rows: {max(errors):.1e}")


if __name__ == "__main__":
    main()
