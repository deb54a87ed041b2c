"""Stiffness that falls over the years: how it is followed by `track_parameters`, by simpler ways.

    OMP_NUM_THREADS=1 python tests/benchmarks/parameter_drift.py

The truss, daily records with 1 % of noise. Groups take turns over the seeds. ``tracked``: a chain learns from the first
year; then all four years are followed. The simpler ways:

- M1 - M2: parameters that M1 finds in the measured frequencies less those of M2, daily means smoothed over 60 days,
  with the standard error of those means as a band; a drift is found where a straight line has a slope at 1 % divided by
  the number of groups.
- regression: trends of the residuals of a regression on temperature that learned from the first year, turned into
  changes of all groups by least squares with the Jacobian; a drift is found where the trends of the modes together are
  beyond chance at 1 %.

The exit code is 1 if a target is missed.
"""

import sys

import numpy as np
import pandas as pd
from harness import arguments, is_missed, shown, split
from scipy import stats
from structures import AgeingTruss

from skthermo.detection import TemperatureCompensator
from skthermo.monitoring import track_parameters
from skthermo.surrogate import TemperatureMapper

YEARS, SMOOTHED, LEVEL, BAND = 4, 60, 0.01, 1.96
CASES = {
    "none": (0.0, {}),
    "1 % a year": (0.01, {}),
    "1 %, noise of neighbouring days correlated by 0.9": (0.01, {"correlation": 0.9}),
    "1 %, after a quiet first year": (0.01, {}),
}
QUIET = "1 %, after a quiet first year"


def truth(times, rate, begin, zero):
    """Stiffness that is left by a drift, relative to that at a time, or to the mean of some."""

    def left(when):
        return 1 - rate * np.maximum(np.asarray((when - begin) / pd.Timedelta(days=365.25)), 0.0)

    return left(times) / np.mean(left(zero))


def tracked(fem, T, F):
    """Daily estimates and errors of ln stiffness by group, whether a drift is found, and which groups come first."""
    history = track_parameters(fem, T, F)
    table = history.table
    estimates = np.log(table.xs("estimate", axis=1, level=1))
    errors = np.log(table.xs("ci_high", axis=1, level=1)).sub(estimates) / BAND
    first = {group for alternatives in history.alternatives.values() for group in alternatives}
    return estimates, errors, history.has_drift, first, estimates.index[0]


def parameters_apart(fem, T, F):
    """M1's parameters less M2's; a group is the parameter that bears its name."""
    apart = np.log(fem.estimate_parameters(F)) - np.log(fem.predict_parameters(T))
    daily = apart.groupby(apart.index.floor("D")).mean().dropna()
    usual = daily.rolling(f"{SMOOTHED}D", min_periods=10)
    estimates, errors = usual.mean(), usual.std() / np.sqrt(usual.count())
    year = daily.index < daily.index[0] + pd.Timedelta(days=365)
    days = (daily.index - daily.index[0]).days
    chances = {group: stats.linregress(days, daily[group]).pvalue for group in daily}
    found = min(chances.values()) <= LEVEL / len(chances)
    return estimates - daily[year].mean(), errors, found, {min(chances, key=chances.get)}, daily.index[year].mean()


def regression(fem, T, F):
    """Trends of residuals of daily means, turned into changes of groups."""
    days = F.index.floor("D")
    both = pd.concat([T, F], axis=1).groupby(days).mean().dropna()
    year = both.index < both.index[0] + pd.Timedelta(days=365)
    compensator = TemperatureCompensator(TemperatureMapper(), targets=list(F))
    residuals = np.vstack([compensator.fit_transform(both[year]), compensator.transform(both[~year])])
    share = np.linspace(0, 1, len(both))
    trends = [stats.linregress(share, column) for column in residuals.T]
    change = np.array([trend.slope for trend in trends])  # relative, as the residuals
    beside = residuals - residuals.mean(axis=0) - np.outer(share - share.mean(), change)
    means = [part.mean(axis=0) for part in np.array_split(beside, 12)]
    memory = np.maximum(len(beside) / 12 * np.var(means, axis=0, ddof=1) / beside.var(axis=0), 1.0)
    errors = np.array([trend.stderr for trend in trends]) * np.sqrt(memory)
    found = stats.chi2.sf(((change / errors) ** 2).sum(), len(change)) <= LEVEL
    groups = list(AgeingTruss.groups)  # the others hardly move these frequencies
    slopes = -fem.damage_directions(groups, kind="stiffness").to_numpy().T
    inverse = np.linalg.pinv(slopes / errors[:, np.newaxis])
    at_end, deviations = inverse @ (change / errors), np.sqrt((inverse**2).sum(axis=1))
    frames = (pd.DataFrame(np.outer(share, row), both.index, groups) for row in (at_end, deviations))
    first = groups[int(np.argmax(np.abs(at_end) / deviations))]
    return *frames, found, {first}, both.index[0]


def evaluated(rate, group, begin, result):
    """One run's figures."""
    estimates, errors, found, first, zero = result
    known = estimates.notna().all(axis=1) & errors.notna().all(axis=1)
    estimates, errors = estimates[known], errors[known]
    true = pd.DataFrame(0.0, estimates.index, estimates.columns)
    true[group] = np.log(truth(true.index, rate, begin, zero))
    off = estimates - true
    return {
        "drift found, %": 100.0 * found,
        "right group, %": 100.0 * (group in first) if rate else np.nan,
        "end value within two standard errors, %": 100.0 * (abs(off) <= 2 * errors).iloc[-1][group],
        "days in the 95 % band, %": 100 * (off.abs() <= BAND * errors).to_numpy().mean(),
        "error of the end value, %": (100 * off.iloc[-1][group]) ** 2,
    }


WAYS = {"track_parameters": tracked, "M1 less M2, smoothed": parameters_apart, "regression and Jacobian": regression}


def tracked_table(seeds):
    """Figures of all ways in all cases, and how many targets are missed."""
    truss, rows = AgeingTruss(), []
    for case, (rate, changes) in CASES.items():
        for seed in range(seeds):
            group = truss.groups[seed % len(truss.groups)]
            campaign = truss.quiet_first if case == QUIET else truss.campaign
            records, n_first = campaign(YEARS, seed, **changes, drift={group: rate})
            T, F = split(records)
            begin = F.index[n_first if case == QUIET else 0]
            fem = truss.chain().fit(T[:n_first], F[:n_first])
            for name, way in WAYS.items():
                rows.append({"lost": case, "method": name} | evaluated(rate, group, begin, way(fem, T, F)))
    means = pd.DataFrame(rows).groupby(["lost", "method"], sort=False).mean()
    means["error of the end value, %"] **= 0.5
    text = means.astype(float).round(2)
    shown(f"Stiffness of one group of the truss, four years of daily records, {seeds} campaigns each", text, "3g")
    found, right, inside, band, _ = means.columns
    own = means.xs("track_parameters", level="method")
    missed = is_missed("found without drift, %", own.loc["none", found], f"<= {100 * max(1 / 20, 1 / seeds)}")
    missed += is_missed("right group, %", own.loc["1 % a year", right], ">= 90")
    missed += is_missed("end values, %", own.loc["1 % a year", inside], ">= 90")
    return missed + is_missed("days in the band, %", own.loc["1 % a year", band], ">= 90")


PARTS = {"tracked": tracked_table}


def main():
    options = arguments(__doc__, parts=PARTS, seeds=6)
    missed = [PARTS[part](options.seeds) for part in options.parts]
    return int(any(missed))


if __name__ == "__main__":
    sys.exit(main())
