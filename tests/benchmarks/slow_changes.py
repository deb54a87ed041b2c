"""Slow changes: false events of healthy years, and how soon a loss that grows is found.

    OMP_NUM_THREADS=1 python tests/benchmarks/slow_changes.py
    OMP_NUM_THREADS=1 python tests/benchmarks/slow_changes.py --structures soil --seeds 3

Six-hourly records of five years: bridges of the synthetic fleet, girders whose soil follows the air with 40 days, and
arches with moisture of 20 days and soil of 30; no sensor measures soil or moisture. A `Monitor` learns the first year
and sees the four others, healthy and, from a day of the second year on, with a loss of stiffness that grows by 5 % a
year; each of two groups in turn lowers the frequencies as the model says. It is asked for one false alarm a year, a
quarter of it for the mean of 30 days: drifts.

Simple competitors are charts of means of 30 days, each week: residuals of a ridge regression on squares of temperatures
of now and of six hours, one, three and twelve days ago, months out of fold. ``largest`` is the largest mean of a mode,
in standard deviations of the baseline's means, ``distance`` their Mahalanobis distance by a shrunk covariance (Ledoit
and Wolf). A chart has an event above the largest value of its baseline.

The exit code is 1 if drifts are more than half an event a year on average.
"""

import copy
import sys

import numpy as np
import pandas as pd
from forward import RidgeWithLags
from harness import arguments, is_missed, joined, modes_of, shown, split
from sklearn.covariance import ledoit_wolf
from structures import Site, slow_soil, user_model

from skthermo.datasets import make_fleet
from skthermo.detection import CompensatedDetector
from skthermo.monitoring import Monitor
from skthermo.preprocessing import BlockedKFold

DAY, YEARS, GROWS = pd.Timedelta("1D"), 5, 0.05
HEALTHY, WATCHED = 300, 500  # days in service before the loss begins, and days in which it grows


def fleet(seed):
    bridge = list(make_fleet(6, atypical=0.0, random_state=5).values())[seed]
    made = bridge.records(YEARS * 365, "2021-01-01", samples_per_day=4)
    return made.temperatures.join(made.frequencies), bridge.model


def soil(seed):
    return joined(slow_soil(seed + 10, n_days=YEARS * 365))[::3], user_model(seed + 10)


def arch(seed):
    site = Site("moist arch", seed + 10, YEARS)
    return pd.concat([site.records(2024 + year) for year in range(YEARS)])[::2], site.model


STRUCTURES = {"fleet": fleet, "soil": soil, "moist arch": arch}


class Charts:
    """Means of 30 days of the residuals of a regression with lags, each week, and levels of the baseline."""

    def __init__(self, baseline):
        self.regression = RidgeWithLags(None).fit(baseline)
        T, F = split(baseline)
        X, ratios = self.regression.inputs(T), np.log(F / self.regression.centre)
        rest = pd.DataFrame(np.nan, F.index, F.columns)
        for train, test in BlockedKFold(block="30D").split(T):
            for place, mode in enumerate(F):
                known = train[ratios[mode].notna().to_numpy()[train]]
                line = RidgeWithLags.line().fit(X[known], ratios[mode].iloc[known])
                rest.iloc[test, place] = ratios[mode].iloc[test] - line.predict(X[test])
        means = self.means(rest)
        self.deviations = means.std()
        self.precision = np.linalg.inv(ledoit_wolf(means / self.deviations)[0])
        self.levels = self.values(means).max()

    @staticmethod
    def means(rest):
        return rest.resample("1D").mean().rolling("30D", min_periods=15).mean()[29::7].dropna()

    def values(self, means):
        scaled = means / self.deviations
        squares = np.einsum("ij,jk,ik->i", scaled, self.precision, scaled)
        return pd.DataFrame({"largest": scaled.abs().max(axis=1), "distance": np.sqrt(squares)})

    def are_open(self, records):
        """By the week and chart."""
        T, F = split(records)
        X, ratios = self.regression.inputs(T), np.log(F / self.regression.centre)
        rest = {mode: ratios[mode] - line.predict(X) for mode, line in self.regression.lines.items()}
        return self.values(self.means(pd.DataFrame(rest))) > self.levels


def beginnings(is_open):
    """Number of runs; one that follows another within four weeks goes on with it."""
    times = is_open.index[is_open]
    return int((np.diff(times, prepend=times[:1] - 99 * DAY) > 28 * DAY).sum())


def days_until(is_open, healthy, since):
    """Days until it is open where it is not without the loss."""
    found = is_open.index[is_open & ~healthy.reindex(is_open.index, fill_value=False) & (is_open.index >= since)]
    return (found[0] - since) / DAY if len(found) else np.inf


def measured(name, seed):
    """A row of false events, and rows of days until a loss is found."""
    records, model = STRUCTURES[name](seed)
    end = records.index[0] + 365 * DAY
    baseline, service, modes = records[records.index < end], records[records.index >= end], modes_of(records)
    monitor = Monitor(CompensatedDetector(targets=modes, window="1D"), units="Hz").fit(baseline)
    charts, since = Charts(baseline), end + HEALTHY * DAY

    def served(records):
        one = copy.deepcopy(monitor)
        states = one.update(records)["state"]
        return one.events_["kind"], states.isin(["alarm", "drift", "known damage"])

    kinds, healthy = served(service)
    charted = charts.are_open(service)
    false = {"damage": (kinds == "damage").sum(), "drift": (kinds == "drift").sum()}
    false |= {f"chart, {name}": beginnings(is_open) for name, is_open in charted.items()}
    lost, part = [], service[service.index < since + WATCHED * DAY]
    loss = GROWS * np.clip((part.index - since) / DAY / 365, 0, None).to_numpy()
    directions = model.damage_directions(kind="stiffness")
    for group in directions.index[:2]:
        changed = part.copy()
        changed[modes] *= 1 + np.outer(loss, directions.loc[group])
        lost.append({"monitor": days_until(served(changed)[1], healthy, since)})
        for name, is_open in charts.are_open(changed).items():
            lost[-1][f"chart, {name}"] = days_until(is_open, charted[name], since)
    return false, lost


def main():
    options = arguments(__doc__, structures=(dict(STRUCTURES), "which"), seeds=6)
    rows, lost = {}, {}
    for name in options.structures:
        cases = [measured(name, seed) for seed in range(options.seeds)]
        rows[name] = pd.DataFrame([false for false, _ in cases]).mean() / (YEARS - 1)
        lost[name] = pd.DataFrame([row for _, found in cases for row in found]).median()
    table = pd.DataFrame(rows).T
    shown("False events a year, 1 asked for: damage .75, drift .25; charts of means of 30 days", table)
    shown(f"Median days until a loss that grows by {100 * GROWS:.0f} % a year is found", pd.DataFrame(lost).T, 0)
    return int(is_missed("drifts a year", float(table["drift"].mean()), "<= 0.5"))


if __name__ == "__main__":
    sys.exit(main())
