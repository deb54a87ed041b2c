"""A bridge of known truth: what folds, a dead thermometer and batches of a day do to alarms, year after year.

    OMP_NUM_THREADS=1 python tests/benchmarks/compensator_year.py
    OMP_NUM_THREADS=1 python tests/benchmarks/compensator_year.py --only folds sensor --seeds 1

Two-hourly records of the 28-bar truss under a synthetic climate. Its bars follow the air with delays of hours, its
supports with one of days, and frost stiffens them. The detector learns the first year, with lags of 0, 6 and 24 hours,
and evaluates the second: healthy, and with two kinds of damage. The exit code is 1 if a target is missed.
"""

import argparse
import sys
import warnings

import numpy as np
import pandas as pd
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import LinearRegression
from sklearn.multioutput import MultiOutputRegressor
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.fem import add_noise
from skthermo.preprocessing import LagFeatures
from skthermo.surrogate import TemperatureMapper

HOURS, PER_DAY = 2, 12
NOISE = 0.0006
DAMAGES = {"healthy": {}, "bottom 1 %": {"bottom": 0.01}, "diagonal 1.5 %": {"diagonal": 0.015}}
ASKED, MOST_FALSE = 2.0, 3.0
REGRESSORS = {
    "piecewise-linear": lambda: TemperatureMapper(),
    "linear": lambda: LinearRegression(),
    "boosting": lambda: MultiOutputRegressor(HistGradientBoostingRegressor(random_state=0)),
}


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


def compensator(names, regressor="piecewise-linear", **options):
    lags = LagFeatures([0, 3, 12], freq="2h")
    return TemperatureCompensator(make_pipeline(lags, REGRESSORS[regressor]()), targets=names, **options)


def by_day(residuals):
    """Means of days."""
    return residuals.resample("1D").mean()


def alarm_rates(residuals, evaluated):
    """Alarms in percent, by record and by a day's mean."""
    rates = {}
    for kind, transform in (("record", lambda frame: frame), ("day", by_day)):
        detector = MahalanobisDetector(ASKED / 100).fit(transform(residuals))
        for name, found in evaluated.items():
            index = detector.damage_index(transform(found))
            rates[kind, name] = 100 * float((index > detector.threshold_).mean())
    return rates


def mean_table(rows, title):
    """Print the mean of alarm rates over seeds, and give it back."""
    table = pd.DataFrame({key: pd.DataFrame(found).mean() for key, found in rows.items()}).T
    print(f"{title}, %, {ASKED:g} asked\n\n{table.round(1).to_string()}\n")
    return table


def folds(seeds, regressors):
    """Contiguous folds beside the default, plain and whitened."""
    rows = {}
    for seed in seeds:
        baseline, states, names = campaign(seed)
        for regressor in regressors:
            for cv in ("contiguous", None):
                for whiten in (None, "local"):
                    learner = compensator(names, regressor, cv=cv, whiten=whiten)
                    residuals = learner.fit_transform(baseline)
                    evaluated = {name: learner.transform(records) for name, records in states.items()}
                    key = regressor, whiten or "plain", f"{cv or 'default'}"
                    rows.setdefault(key, []).append(pd.Series(alarm_rates(residuals, evaluated)))
    found = mean_table(rows, "Alarms in year 2").xs("default", level=2)
    return int((found["record", "healthy"] > MOST_FALSE).sum())


def sensor(seeds, regressors):
    """The girder's thermometer dies after the baseline."""
    rows = {}
    for seed in seeds:
        baseline, states, names = campaign(seed)
        for regressor in regressors:
            for whiten in (None, "local"):
                learner = compensator(names, regressor, whiten=whiten)
                residuals = learner.fit_transform(baseline)
                for what in ("alive", "dead"):
                    evaluated = {
                        name: learner.transform(records.assign(girder=np.nan) if what == "dead" else records)
                        for name, records in states.items()
                    }
                    key = regressor, whiten or "plain", what
                    rows.setdefault(key, []).append(pd.Series(alarm_rates(residuals, evaluated)))
    found = mean_table(rows, "Alarms in year 2 by the girder's thermometer").xs("dead", level=2)
    return int((found["record", "healthy"] > MOST_FALSE).sum())


def days(seeds, regressors):
    """Year 2 in batches of a day, alone and behind the 30 hours before; number of rows that are silently worse."""
    baseline, states, names = campaign(seeds[0])
    learner = compensator(names, regressors[0], whiten="local")
    detector = MahalanobisDetector(ASKED / 100).fit(learner.fit_transform(baseline))
    half = 180 * PER_DAY
    records = pd.concat([states["healthy"][:half], states["bottom 1 %"][half:]])
    expected = detector.damage_index(learner.transform(records))[2 * PER_DAY :]
    alone, behind, messages = [], [], {}
    for _, batch in records.iloc[2 * PER_DAY :].groupby(records.index[2 * PER_DAY :].floor("D")):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            alone.append(detector.damage_index(learner.transform(batch)))
        for warning in caught:
            messages.setdefault(str(warning.message)[:40], str(warning.message))
        some = records.loc[batch.index[0] - pd.Timedelta("30h") : batch.index[-1]]
        behind.append(detector.damage_index(learner.transform(some))[-len(batch) :])
    alone, behind, limit = pd.concat(alone), pd.concat(behind), detector.threshold_
    evaluated = alone.notna()
    silent = evaluated & ~np.isclose(alone, expected, rtol=1e-9) | ~evaluated & (not messages)
    otherwise = (behind > limit) != (expected > limit)
    print(f"Year 2 in batches of a day, {regressors[0]}: {len(expected)} rows, {(expected > limit).sum()} in alarm\n")
    print(f"alone: {(~evaluated).sum()} rows not evaluated, {silent.sum()} rows silently worse, at most 0")
    print(f"behind the 30 hours before: {otherwise.sum()} rows decided otherwise than in one pass, at most 0")
    print("what is said of the first day:", *messages.values(), sep="\n- ")
    return int(silent.sum() + otherwise.sum())


PARTS = {"folds": folds, "sensor": sensor, "days": days}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="*", default=[*PARTS], choices=[*PARTS])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--regressors", nargs="*", default=[*REGRESSORS], choices=[*REGRESSORS])
    options = parser.parse_args()
    missed = [PARTS[part](range(options.seeds), options.regressors) for part in options.only]
    return 1 if any(missed) else 0


if __name__ == "__main__":
    sys.exit(main())
