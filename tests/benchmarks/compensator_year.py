"""A bridge of known truth: what folds and a dead thermometer do to alarms, year after year.

    OMP_NUM_THREADS=1 python tests/benchmarks/compensator_year.py
    OMP_NUM_THREADS=1 python tests/benchmarks/compensator_year.py --only folds sensor --seeds 1

Two-hourly records of the 28-bar truss under a synthetic climate. Its bars follow the air with delays of hours, its
supports with one of days, and frost stiffens them. The detector learns the first year, with lags of 0, 6 and 24 hours,
and evaluates the second: healthy, and with two kinds of damage. The exit code is 1 if a target is missed.
"""

import sys

import numpy as np
import pandas as pd
from harness import arguments, shown
from structures import lagged

from skthermo.datasets import make_truss
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.fem import add_noise
from skthermo.surrogate import TemperatureMapper

HOURS, PER_DAY = 2, 12
NOISE = 0.0006
DAMAGES = {"healthy": {}, "bottom 1 %": {"bottom": 0.01}, "diagonal 1.5 %": {"diagonal": 0.015}}
ASKED, MOST_FALSE = 2.0, 3.0


def smoothed(series, hours):
    """What a body of this time constant has of the temperature around it."""
    return pd.Series(series).ewm(alpha=1 - np.exp(-HOURS / hours)).mean().to_numpy()


def weather(random, n_years=2):
    """Temperatures as measured, and the true ones of bars and supports."""
    stamps = pd.date_range("2023-01-01", periods=n_years * 365 * PER_DAY, freq=f"{HOURS}h")
    day = np.arange(len(stamps)) / PER_DAY
    sky = smoothed(random.standard_normal(len(stamps)), 72) * 25
    clear = 1 / (1 + np.exp(-sky / 5))
    air = 9 - 10 * np.cos(2 * np.pi * day / 365.25) + sky - 4 * clear * np.cos(2 * np.pi * (day - 0.1))
    sun = 6 * clear * np.clip(-np.cos(2 * np.pi * day), 0, None)
    sun_on_bars = 1.5 * sun * smoothed(random.uniform(0, 2, len(stamps)), 24)
    bars, deck, supports = smoothed(air + sun_on_bars, 6), smoothed(air + 2 * sun, 12), smoothed(air, 100)
    measured = {"air": air, "girder": bars, "deck": deck}
    T = pd.DataFrame(measured, stamps) + random.normal(0, 0.3, (len(stamps), len(measured)))
    return T, bars, deck, supports


def campaign(seed):
    """Records of two years: a healthy one, and one in every state."""
    random, model = np.random.default_rng(seed), make_truss()
    T, bars, deck, supports = weather(random)
    frost = np.log1p(np.exp(-supports / 1.5)) * 0.01
    theta = np.column_stack(
        [1 - 1e-3 * bars, 1 - 1e-3 * deck + frost, 1 - 1e-3 * bars + 2 * frost, 1 - 5e-4 * supports]
    )
    half = len(T) // 2
    names = [f"f{mode + 1}" for mode in range(model.n_modes)]
    states = {}
    for name, damage in DAMAGES.items():
        F = add_noise(model.damaged(damage).frequencies(theta), NOISE, random_state=seed + 1)
        states[name] = T.join(pd.DataFrame(F, T.index, names))
    return states["healthy"][:half], {name: records[half:] for name, records in states.items()}, names


def compensator(names, **options):
    return TemperatureCompensator(lagged(TemperatureMapper()), targets=names, **options)


def alarm_rates(residuals, evaluated):
    """Alarms in percent, by record and by a day's mean."""
    rates = {}
    for kind, transform in (("record", lambda frame: frame), ("day", lambda frame: frame.resample("1D").mean())):
        detector = MahalanobisDetector(ASKED / 100).fit(transform(residuals))
        for name, found in evaluated.items():
            index = detector.damage_index(transform(found))
            rates[kind, name] = 100 * float((index > detector.threshold_).mean())
    return rates


def compared(seeds, title, ways, counted):
    """Alarms in year 2 by each way to learn, and whether the last of them has too many."""
    rows = {}
    for seed in seeds:
        baseline, states, names = campaign(seed)
        for whiten in (None, "local"):
            for way, (options, seen) in ways.items():
                learner = compensator(names, whiten=whiten, **options)
                residuals = learner.fit_transform(baseline)
                evaluated = {name: learner.transform(seen(records)) for name, records in states.items()}
                rows.setdefault((whiten or "plain", way), []).append(alarm_rates(residuals, evaluated))
    table = pd.DataFrame({key: pd.DataFrame(found).mean() for key, found in rows.items()}).T
    shown(f"Alarms in year 2{title}, %, {ASKED:g} asked", table, 1)
    return int((table.xs(counted, level=1)["record", "healthy"] > MOST_FALSE).sum())


def folds(seeds):
    """Contiguous folds beside the default, plain and whitened."""
    ways = {name: ({"cv": cv}, lambda table: table) for name, cv in (("contiguous", "contiguous"), ("default", None))}
    return compared(seeds, "", ways, "default")


def sensor(seeds):
    """The girder's thermometer dies after the baseline."""
    ways = {"alive": ({}, lambda table: table), "dead": ({}, lambda table: table.assign(girder=np.nan))}
    return compared(seeds, " by the girder's thermometer", ways, "dead")


PARTS = {"folds": folds, "sensor": sensor}


def main():
    options = arguments(__doc__, only=PARTS, seeds=2)
    missed = sum([PARTS[part](range(options.seeds)) for part in options.only])
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
