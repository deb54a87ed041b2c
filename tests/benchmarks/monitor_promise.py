"""One false alarm a year was asked for: how many there are in simulated years, and how fast damage is found.

    OMP_NUM_THREADS=1 python tests/benchmarks/monitor_promise.py
    OMP_NUM_THREADS=1 python tests/benchmarks/monitor_promise.py --structures truss --correlations 0.5 --years 20

Years of daily records of the truss and of four-hourly ones of the bridge KW51 with its gaps, in weather that never comes
again, under noise of each correlation of neighbouring records. Every second year is a baseline, and the five that follow
it are judged (from the last one, the first ones). Thresholds of the library (tails of excursions) stand beside others:

order       the highest excursion of the year, which a new year exceeds once on average
bootstrap   years drawn from blocks of four weeks of the baseline have one event on average
pareto      a generalised Pareto tail, fitted to the excesses of the 40 highest excursions
e-values    Shiryaev and Roberts' sum of products of e-values (the mixture of p^(k - 1), from conformal p values of days
            or weeks): an alarm on average at most once a year without dependence, whatever the distribution

Damage begins at a day of a healthy year; found is the first event that opens then. The exit code is 1 if the mean number
of false events a year of one of the library's own rules is not .5 to 1.5.
"""

import argparse
import sys
import time
import warnings
from functools import cache

import numpy as np
import pandas as pd
from scipy.stats import genpareto
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.datasets._kw51_campaign import NOISE, missing_modes
from skthermo.datasets._kw51_truth import BOX, thermal_multipliers, truth_model
from skthermo.datasets._kw51_weather import draw_weather
from skthermo.detection import MahalanobisDetector, TemperatureCompensator, WindowedAlarm
from skthermo.fem import add_noise
from skthermo.monitoring._promise import EventRule, find_events, promised_rule
from skthermo.preprocessing import LagFeatures
from skthermo.surrogate import TemperatureMapper

DAY = pd.Timedelta("1D")
ASKED, LEAST, MOST = 1.0, 0.5, 1.5
SEVERITIES = (0.05, 0.10, 0.20)
N_JUDGED, N_STARTS, N_DAYS, N_BEFORE = 5, 2, 180, 16
N_RESAMPLED, BLOCK_DAYS, N_TAIL = 60, 28, 40
STATES = (0.0, *SEVERITIES)
KW51_HOURS, KW51_GROUP, TRUSS_GROUP, TRUSS_NOISE = 4, "connections", "bottom", 0.01


@cache
def truss(n_years):
    """Temperatures, and noise-free frequencies by severity, of daily records."""
    campaigns = {s: make_truss_campaign(n_years, damage={TRUSS_GROUP: s}, random_state=1) for s in STATES}
    T = campaigns[0.0].temperatures
    return (
        T,
        {s: c.clean_frequencies.to_numpy() for s, c in campaigns.items()},
        TRUSS_NOISE,
        np.zeros((len(T), 6), bool),
    )


@cache
def kw51(n_years):
    """The same of four-hourly ones, by a quadratic law of the logarithms that is fitted to the FE model."""
    random = np.random.RandomState(1)
    weather = draw_weather(n_years * 8766, random)
    gone = missing_modes(len(weather), random)[::KW51_HOURS]
    weather, theta = weather.iloc[::KW51_HOURS], np.log(thermal_multipliers(weather).iloc[::KW51_HOURS].to_numpy())
    terms = np.triu_indices(theta.shape[1])

    def basis(x):
        return np.hstack([np.ones((len(x), 1)), x, np.maximum(x[:, 6:8], 0) ** 3, x[:, terms[0]] * x[:, terms[1]]])

    few = np.random.default_rng(0).permutation(len(theta))[:900]
    clean, errors = {}, []
    for severity in STATES:
        model = truth_model().damaged({KW51_GROUP: severity}).reduced(BOX, tol=1e-4, random_state=0)
        exact = np.log(model.frequencies(np.exp(theta[few])))
        law = np.linalg.lstsq(basis(theta[few[:700]]), exact[:700], rcond=None)[0]
        errors.append(np.abs(basis(theta[few[700:]]) @ law - exact[700:]).max())
        clean[severity] = np.exp(basis(theta) @ law)
    print(f"kw51: quadratic law of the FE model's frequencies, largest relative error {max(errors):.1e}")
    return weather[["steel"]], clean, NOISE, gone


STRUCTURES = {"truss": (truss, 1), "kw51": (kw51, 24 // KW51_HOURS)}


def detectors(per_day, targets):
    """Detectors by name, with the time that an event has to be quiet to close."""
    regressor = (
        TemperatureMapper() if per_day == 1 else make_pipeline(LagFeatures([0, 1, 6], freq="4h"), TemperatureMapper())
    )
    compensator = TemperatureCompensator(regressor, targets=targets, scale="global")
    lasts = {"records": MahalanobisDetector(), "7 days": WindowedAlarm("7D")}
    if per_day > 1:
        lasts["1 day"] = WindowedAlarm("1D")
    return compensator, lasts


def order(index, hold):
    return promised_release(index, hold)[1][0]


def promised_release(index, hold):
    """The release level, and the peaks of the excursions above it, highest first."""
    release = promised_rule(index, ASKED, hold=hold).rule.release
    known = index.dropna()
    peaks = find_events(known.to_numpy(), known.index, EventRule(release, release, hold))["peak"]
    return release, np.sort(peaks.to_numpy())[::-1]


def bootstrap(index, hold):
    release, random = promised_release(index, hold)[0], np.random.default_rng(0)
    days = (index.index - index.index[0]) // DAY
    length = int(np.bincount(days).max() * BLOCK_DAYS)
    values, peaks = index.to_numpy(), []
    for _ in range(N_RESAMPLED):
        starts = random.integers(0, len(values) - length + 1, -(-len(values) // length))
        drawn = np.concatenate([values[start : start + length] for start in starts])[: len(values)]
        peaks.append(find_events(drawn, index.index, EventRule(release, release, hold))["peak"].to_numpy())
    return np.sort(np.concatenate(peaks))[::-1][N_RESAMPLED]


def pareto(index, hold):
    squares = promised_release(index, hold)[1] ** 2
    k = min(N_TAIL, len(squares) - 1)
    shape, _, scale = genpareto.fit(squares[:k] - squares[k], floc=0)
    return np.sqrt(squares[k] + genpareto.isf(1 / (k + 1), shape, 0, scale))


def e_alarms(baseline, index, step):
    """Stamps of alarms by Shiryaev and Roberts' procedure on the last index of each step of time."""
    ordered = np.sort(baseline.resample(step).last().dropna())
    series = index.resample(step).last().dropna()
    p = (len(ordered) - np.searchsorted(ordered, series) + 1) / (len(ordered) + 1)
    p = np.minimum(p, 1 - 1e-12)
    e = (1 - p + p * np.log(p)) / (p * np.log(p) ** 2)
    total, alarms, limit = 0.0, [], 365.25 * DAY / pd.Timedelta(step)
    for stamp, value in zip(series.index, e, strict=True):
        total = (total + 1) * value
        if total >= limit:
            alarms.append(stamp)
            total = 0.0
    return pd.DatetimeIndex(alarms)


def rules(index, hold):
    """Thresholds by name, all with the library's release level."""
    promise = promised_rule(index, ASKED, hold=hold)
    others = {"order": order, "bootstrap": bootstrap, "pareto": pareto}
    return {"library": promise.rule} | {
        name: EventRule(max(way(index, hold), promise.rule.release), promise.rule.release, hold)
        for name, way in others.items()
    }


def measure(name, correlation, n_years):
    """Rows of false events a year and days to detection, one for each baseline, detector and rule."""
    make, per_day = STRUCTURES[name]
    T, clean, noise, gone = make(n_years)
    targets = [f"f{mode + 1}" for mode in range(6)]
    measured = {
        s: pd.DataFrame(
            np.where(gone, np.nan, add_noise(F, noise, correlation=correlation, random_state=7)), T.index, targets
        )
        for s, F in clean.items()
    }
    measured = {s: T.join(F) for s, F in measured.items()}
    size, found = len(T) // n_years, []
    compensator, lasts = detectors(per_day, targets)
    for year in range(0, n_years, 2):
        fitted = compensator.fit(measured[0.0].iloc[year * size : (year + 1) * size])
        white = fitted.fit_transform(measured[0.0].iloc[year * size : (year + 1) * size])
        later = (year + 1 + np.arange(N_JUDGED)) % n_years
        residuals = [fitted.transform(measured[0.0].iloc[y * size : (y + 1) * size]) for y in later]
        onsets = [(y, 20 + start * 180) for y in later[:2] for start in range(N_STARTS)]
        broken = {s: [] for s in SEVERITIES}
        for y, day in onsets:
            first = y * size + day * per_day
            rows, before = slice(first, first + (N_DAYS + N_BEFORE) * per_day), N_BEFORE * per_day
            for s in SEVERITIES:
                both = pd.concat([measured[0.0].iloc[rows][:before], measured[s].iloc[rows][before:]])
                broken[s].append(fitted.transform(both))
        for detector_name, last in lasts.items():
            last.fit(white)
            index = pd.Series(last.baseline_index_, white.index)
            healthy = [last.damage_index(r) for r in residuals]
            damaged = {s: [last.damage_index(r) for r in rs] for s, rs in broken.items()}
            for hold in (DAY,) if detector_name != "7 days" else (DAY, 7 * DAY):
                for rule_name, rule in rules(index, hold).items():
                    number = [len(find_events(h.to_numpy(), h.index, rule)) for h in healthy]
                    row = {"detector": detector_name, "hold": hold.days, "rule": rule_name, "events": np.mean(number)}
                    row["inside"] = np.nan
                    if rule_name == "library":
                        promise = promised_rule(index, ASKED, hold=hold)
                        row["inside"] = np.mean([promise.lowest <= n <= promise.highest for n in number])
                    for s, series in damaged.items():
                        events = [find_events(d.to_numpy(), d.index, rule) for d in series]
                        row |= detection(s, [e["start"] for e in events], series, per_day)
                        row[f"n {s:.0%}"] = np.mean(
                            [
                                (e["start"] >= d.index[N_BEFORE * per_day]).sum()
                                for e, d in zip(events, series, strict=True)
                            ]
                        )
                    row["closes"] = closing(damaged[SEVERITIES[-1]], healthy, rule, per_day)
                    found.append(row)
            step = "7D" if detector_name == "7 days" else "1D"
            row = {"detector": detector_name, "hold": 0, "rule": "e-values"}
            row["events"] = np.mean([len(e_alarms(index, h, step)) for h in healthy])
            for s, series in damaged.items():
                row |= detection(s, [e_alarms(index, d, step) for d in series], series, per_day)
            found.append(row)
    return pd.DataFrame(found)


def detection(severity, starts, series, per_day):
    """Median days to the first alarm after the damage began, and the share that is found in time."""
    onsets = [d.index[N_BEFORE * per_day] for d in series]
    after = [pd.DatetimeIndex(s)[pd.DatetimeIndex(s) >= o] for s, o in zip(starts, onsets, strict=True)]
    days = [(a[0] - o) / DAY if len(a) else np.inf for a, o in zip(after, onsets, strict=True)]
    return {f"days {severity:.0%}": days}


def closing(damaged, healthy, rule, per_day):
    """Days from a repair to the end of the event."""
    days = []
    for d, h in zip(damaged, healthy, strict=False):
        repaired = np.concatenate([d.to_numpy()[: 60 * per_day], h.to_numpy()[20 * per_day : 110 * per_day]])
        at = pd.date_range(d.index[0], periods=len(repaired), freq=DAY / per_day)
        ends = find_events(repaired, at, rule)["end"]
        ends = ends[ends >= at[60 * per_day]]
        if len(ends):
            days.append((ends.iloc[0] - at[60 * per_day]) / DAY)
    return np.median(days) if days else np.nan


def report(name, correlation, table):
    """Prints what was found; whether the library's own rules keep their promise."""
    kept = True
    print(
        f"{name}, correlation of neighbours {correlation:g}: {len(table.groupby('detector').get_group('records')) // 5} "
        f"baselines, {N_JUDGED} years each; false events a year (asked {ASKED:g}): mean, deviation over baselines, 5 to 95 %"
    )
    print(
        f"  {'detector':9}{'hold':>5} {'rule':10}{'mean':>6}{'dev':>6}{'5 to 95 %':>12}{'inside':>8}   median days to 5, 10, 20 % (share in {N_DAYS} days); events of 20 %; days to close"
    )
    for (detector, hold, rule), group in table.groupby(["detector", "hold", "rule"], sort=False):
        events = group["events"]
        low, high = np.quantile(events, [0.05, 0.95])
        days = [np.concatenate(group[f"days {s:.0%}"].tolist()) for s in SEVERITIES]
        times = ", ".join(f"{np.median(d):5.1f} ({np.isfinite(d).mean():.0%})" for d in days)
        extra = "" if rule == "e-values" else f"; {group['n 20%'].mean():.1f}; {group['closes'].median():.1f}"
        print(
            f"  {detector:9}{hold:5d} {rule:10}{events.mean():6.2f}{events.std():6.2f}{low:6.1f}{high:6.1f}{group.get('inside').mean():8.2f}   {times}{extra}"
        )
        kept &= rule != "library" or LEAST <= events.mean() <= MOST
    return kept


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--structures", nargs="+", choices=list(STRUCTURES), default=list(STRUCTURES))
    parser.add_argument("--correlations", nargs="+", type=float, default=[0.0, 0.5, 0.9])
    parser.add_argument("--years", type=int, default=50, help="simulated years of each structure and correlation")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    kept = True
    for name in options.structures:
        for correlation in options.correlations:
            start = time.perf_counter()
            kept &= report(name, correlation, measure(name, correlation, options.years))
            print(f"  {time.perf_counter() - start:.0f} s", flush=True)
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
