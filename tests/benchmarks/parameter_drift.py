"""Stiffness followed over four years in which one group loses some of it, by `track_parameters` and by simpler ways.

    OMP_NUM_THREADS=1 python tests/benchmarks/parameter_drift.py
    OMP_NUM_THREADS=1 python tests/benchmarks/parameter_drift.py --quiet --ways tracked filtered --rates 0.01 0.04

Groups take turns over the seeds. A chain learns from the first year; then all four years are followed. The simpler
ways, and the filter of a monitor, which knows at each day only what came before and is evaluated after the first year:

- filtered: `DriftFollower` without its delay, day by day; a drift is found where the end value of a group is beyond
  chance at 1 %.
- M1 - M2: parameters that M1 finds in the measured frequencies less those of M2, daily means smoothed over 60 days,
  with the standard error of those means as a band; a drift is found where a straight line has a slope at 1 % divided by
  the number of groups.
- regression: trends of the residuals of a regression on temperature that learned from the first year, turned into
  changes of all groups by least squares with the Jacobian; a drift is found where the trends of the modes together are
  beyond chance at 1 %.

Printed are, in percent: drifts found; right groups named first, by themselves or in a set that cannot be distinguished;
end values within two standard errors, of the group that drifts and of all; end values whose error is below half a
percent of the stiffness; days on which the band of 95 % holds the truth, over all groups; twice the standard error and
the error of the end value of the group that drifts. With ``--quiet`` the drift begins after the first year. The
exit code is 1 if `track_parameters` misses a target; there are none with ``--quiet``.
"""

import sys
import time

import numpy as np
import pandas as pd
from harness import arguments, shown, split
from scipy import stats
from structures import AGEING

from skthermo.detection import TemperatureCompensator
from skthermo.monitoring import track_parameters
from skthermo.monitoring.drift import DriftFollower
from skthermo.monitoring.drift._observations import GroupEffects, calendar, observation
from skthermo.preprocessing import residual_trend
from skthermo.surrogate import TemperatureMapper

YEARS, SMOOTHED, LEVEL, BAND = 4, 60, 0.01, 1.96
SMALL = 0.005  # error of an end value that is of no matter, in shares of the stiffness


def truth(times, rate, begin, zero):
    """Stiffness that is left by a drift, relative to that at a time, or to the mean of some."""

    def left(when):
        return 1 - rate * np.maximum(np.asarray((when - begin) / pd.Timedelta(days=365.25)), 0.0)

    return left(times) / np.mean(left(zero))


def tracked(fem, T, F):
    """Daily estimates and errors of ln stiffness by group, whether a drift is found, and which groups come first."""
    history = track_parameters(fem, T, F, random_state=0)
    table = history.table
    estimates = np.log(table.xs("estimate", axis=1, level=1))
    errors = np.log(table.xs("ci_high", axis=1, level=1)).sub(estimates) / BAND
    first = {group for alternatives in history.alternatives.values() for group in alternatives}
    return estimates, errors, history.has_drift, first, estimates.index[0]


def filtered(fem, T, F):
    """As `tracked`, for days after the first year and a filter that learned from it."""
    n_first = int((F.index < F.index[0] + pd.Timedelta(days=365)).sum())
    follower = DriftFollower.of(fem, T[:n_first], F[:n_first])
    days, start, known = calendar(F.index[n_first:], "1D"), follower.start(), {}
    daily, state = follower.records.means(T, F[n_first:], days, start.weather), start.known
    for row, day in enumerate(days):
        state = follower.next_day(state, observation(daily, row, follower.noise, follower.slopes))
        known[day] = follower.estimate(state)
    estimates, errors = (pd.DataFrame({d: e[c] for d, e in known.items()}).T for c in ("change", "standard_error"))
    scores = (estimates / errors).abs().iloc[-1]
    found = 2 * stats.norm.sf(scores.max()) * len(scores) <= LEVEL
    return estimates, errors, found, {scores.idxmax()}, F.index[:n_first]


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
    trends = residual_trend(pd.DataFrame(residuals, both.index, F.columns))
    usual = both[F.columns].mean()
    change, errors = trends["change"] / usual, trends["standard_error"] / usual
    found = stats.chi2.sf(((change / errors) ** 2).sum(), len(change)) <= LEVEL
    effects = GroupEffects.of(fem, T, F, None)
    weighted = effects.slopes / errors.to_numpy()[:, np.newaxis]
    inverse = np.linalg.pinv(weighted, rcond=1e-6)
    at_end, deviations = inverse @ (change / errors).to_numpy(), np.sqrt((inverse**2).sum(axis=1))
    share = np.linspace(0, 1, len(both))[:, np.newaxis]
    frames = (pd.DataFrame(share * row, both.index, effects.names) for row in (at_end, deviations))
    first = effects.names[int(np.argmax(np.abs(at_end) / deviations))]
    return *frames, found, {first}, both.index[0]


def evaluated(rate, group, begin, result):
    """One run's figures."""
    estimates, errors, found, first, zero = result
    known = estimates.notna().all(axis=1) & errors.notna().all(axis=1)
    estimates, errors = estimates[known], errors[known]
    true = pd.DataFrame(0.0, estimates.index, estimates.columns)
    if group not in true:
        return {"found": found, "right group": False}
    true[group] = np.log(truth(true.index, rate, begin, zero))
    off = (estimates - true).abs()
    inside = off.iloc[-1] <= 2 * errors.iloc[-1]
    return {
        "found": found,
        "right group": group in first,
        "end within 2 errors": inside[group],
        "all ends": inside.mean(),
        "error small": off.iloc[-1][group] <= SMALL,
        "in band": (off <= BAND * errors).to_numpy().mean(),
        "error, %": 100 * (estimates - true).iloc[-1][group],
        "2 errors, %": 200 * errors.iloc[-1][group],
    }


WAYS = {"tracked": tracked, "filtered": filtered, "M1 - M2": parameters_apart, "regression": regression}


def run(bridge, rate, seed, options):
    """All ways on one campaign."""
    group = bridge.groups[seed % len(bridge.groups)]
    changes = {"correlation": options.correlation, "drift": {group: rate}}
    records, n_first = (bridge.quiet_first if options.quiet else bridge.campaign)(YEARS, seed, **changes)
    T, F = split(records)
    begin = F.index[n_first if options.quiet else 0]
    fem = bridge.chain().fit(T[:n_first], F[:n_first])
    rows = []
    for name in options.ways:
        start = time.perf_counter()
        result = WAYS[name](fem, T, F)
        figures = evaluated(rate, group, begin, result) | {"seconds": time.perf_counter() - start}
        rows.append({"bridge": bridge.name, "rate, %": 100 * rate, "way": name, "group": group, "seed": seed} | figures)
    return rows


def misses(table):
    """Targets that `track_parameters` does not reach, as sentences."""
    own = table[table["way"] == "tracked"]
    for bridge, part in own.groupby("bridge"):
        still, ageing = part[part["rate, %"] == 0], part[part["rate, %"] == 1]
        band = 100 * part["in band"].mean()
        if len(still) and still["found"].sum() > max(len(still) / 20, 1):
            yield f"{bridge}: {still['found'].sum()} of {len(still)} without drift are found to drift; at most 1 of 20"
        for what in ("end within 2 errors", "right group"):
            if len(ageing) and ageing[what].mean() < 0.9:
                yield f"{bridge}, 1 % a year: {what} {100 * ageing[what].mean():.0f} %; at least 90"
        if not 90 <= band <= 97:
            yield f"{bridge}: intervals cover the truth on {band:.1f} % of days; 90 to 97"


def main():
    options = arguments(
        __doc__,
        seeds=20,
        rates=([0.0, 0.005, 0.01, 0.02], "lost a year"),
        ways=([way for way in WAYS if way != "filtered"], None, list(WAYS)),
        correlation=(0.0, "of the noise of neighbouring records"),
        quiet=(False, "the drift begins after the first year"),
        each=(False, "print every run"),
    )
    rows = []
    for rate in options.rates:
        for seed in range(options.seeds):
            rows += run(AGEING["truss"](), rate, seed, options)
            if options.each:
                print(rows[-len(options.ways)], flush=True)
    table = pd.DataFrame(rows)
    figures = table.drop(columns=["group", "seed"]).copy()
    for what in ("found", "right group", "end within 2 errors", "all ends", "error small", "in band"):
        figures[what] = 100 * figures[what].astype(float)
    figures["rms error, %"] = figures.pop("error, %") ** 2
    means = figures.groupby(["bridge", "way", "rate, %"], sort=False).mean()
    means["rms error, %"] **= 0.5
    model = ", drift begins after a year" if options.quiet else ""
    shown(f"{options.seeds} seeds, noise correlated by {options.correlation}{model}; in percent", means)
    missed = [] if options.quiet else list(misses(table))
    has_targets = "tracked" in options.ways and not options.quiet
    reached = "all targets reached" if has_targets else "no targets"
    print("\n" + ("\n".join(f"missed: {line}" for line in missed) or reached))
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
