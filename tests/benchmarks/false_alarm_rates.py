"""One false alarm a year was asked for: events a year in simulated years, and how fast damage is found.

    OMP_NUM_THREADS=1 python tests/benchmarks/false_alarm_rates.py
    OMP_NUM_THREADS=1 python tests/benchmarks/false_alarm_rates.py --quick
    OMP_NUM_THREADS=1 python tests/benchmarks/false_alarm_rates.py --laws t3 winter --structures truss

Daily records of the truss, of a girder of the synthetic fleet, and of six frequencies that are linear in one
temperature. Each baseline is a year; the three years after it are healthy, and from two days of the first of them on
damage is simulated: 5, 10 and 20 % of the stiffness of a group, and the shift of the truss for the linear frequencies.
It is found by the first event that is open within 180 days.

Laws of the noise, each with the same standard deviation before outliers: independent and normal (iid), autoregressive
with correlations of .5 and .9 of neighbouring records, Student with three degrees of freedom, outliers of 5 to 20
standard deviations in .1 and .5 % of the values, and twice as much noise in winter. Baselines are raw, or cleaned by
``HampelFilter()`` on what a linear regression leaves of them.

``persistence`` 3 is the default of ``Monitor``, 1 means alarms of single records; both by the same fitted detector.
``watches`` are events a year of the lower level, of which 12 were asked for (``watch_per_year``). ``plain`` is
the strongest simple competitor: a regression, and the distance that its own year exceeds once. The exit
code is 1 if a mean over the structures is not .5 to 1.5 events a year with a raw baseline and persistence 3.
"""

import sys
import time
from functools import cache

import numpy as np
import pandas as pd
from harness import arguments, compensated, shown
from scipy.signal import lfilter
from sklearn.covariance import EmpiricalCovariance
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures

from skthermo.datasets import make_fleet, make_truss_campaign
from skthermo.detection import DirectionalDetector
from skthermo.monitoring import Monitor
from skthermo.monitoring._events import find_events
from skthermo.monitoring._threshold import estimate_false_alarms
from skthermo.preprocessing import HampelFilter

LAWS = ("iid", "ar .5", "ar .9", "t3", "outliers .1 %", "outliers .5 %", "winter")
YEARS, YEAR, N_DAYS, STARTS = 3, 365, 180, (20, 200)
SEVERITIES, PERSISTENCE = (0.05, 0.10, 0.20), (1, 3)
LEAST, MOST = 0.5, 1.5
APART = 5  # days between alarms of two events
WATCHES = 12.0  # events a year of the lower level
STAMPS = pd.date_range("2021-01-01", periods=(1 + YEARS) * YEAR)


@cache
def truss():
    made = {s: make_truss_campaign(1 + YEARS, damage={"bottom": s}, random_state=1) for s in (0.0, *SEVERITIES)}
    return made[0.0].temperatures.to_numpy(), {s: one.clean_frequencies.to_numpy() for s, one in made.items()}, 0.01


@cache
def girder():
    (bridge,) = make_fleet(1, kinds=("girder",), random_state=3).values()
    made = {
        s: bridge.records(len(STAMPS), STAMPS[0], damage={"first span": s}, gaps=0.0, outliers=0.0)
        for s in (0.0, *SEVERITIES)
    }
    return made[0.0].temperatures.to_numpy(), {s: one.clean_frequencies.to_numpy() for s, one in made.items()}, 0.003


@cache
def linear():
    T, clean, noise = truss()
    nominal, slopes = clean[0.0].mean(axis=0), np.array([-2, -1.5, -1, -0.5, -1, -2]) * 1e-3
    healthy = nominal * (1 + slopes * (T[:, :1] - T[:, :1].mean()))
    shift = {s: (F / clean[0.0]).mean(axis=0) for s, F in clean.items()}
    return T[:, :1], {s: healthy * shift[s] for s in shift}, noise


STRUCTURES = {"truss": truss, "girder": girder, "linear": linear}


def drawn(law, shape, random):
    """Noise of a law, of unit variance before outliers."""
    z = random.standard_t(3, shape) / np.sqrt(3) if law == "t3" else random.normal(size=shape)
    if law.startswith("ar"):
        a = float(law.split()[1])
        z[1:] *= np.sqrt(1 - a**2)
        z = lfilter([1], [1, -a], z, axis=0)
    if law == "winter":
        z[STAMPS.month.isin([12, 1, 2])] *= 2
    if law.startswith("outliers"):
        is_wrong = random.random(shape) < float(law.split()[1]) / 100
        z = z + is_wrong * random.choice([-1, 1], shape) * random.uniform(5, 20, shape)
    return z


def cleaned(T, F):
    rest = F - LinearRegression().fit(T, F).predict(T)
    return F.where(HampelFilter().fit(rest).transform(rest).notna())


def series(monitor, records):
    """Rounded damage indices, as those of ``update``."""
    values = -monitor.detector_.score_samples(records[monitor.active_.columns])
    return pd.Series(values, records.index).round(6)


def rows_of(name, law, is_cleaned, seed):
    """A row for each persistence."""
    T, clean, noise = STRUCTURES[name]()
    z = drawn(law, clean[0.0].shape, np.random.default_rng(seed))
    modes, sensors = ([f"{letter}{i + 1}" for i in range(table.shape[1])] for letter, table in (("f", z), ("T", T)))
    T = pd.DataFrame(T, STAMPS, sensors)
    F = {s: pd.DataFrame(one * (1 + noise * z), STAMPS, modes) for s, one in clean.items()}
    baseline = F[0.0][:YEAR]
    baseline = T[:YEAR].join(cleaned(T[:YEAR], baseline) if is_cleaned else baseline)
    monitor = Monitor(compensated(modes, DirectionalDetector()), sensors=False).fit(baseline)
    plain = of_plain_regression(T.to_numpy(), F[0.0].to_numpy())
    index = {s: series(monitor, T[YEAR:].join(one[YEAR:])) for s, one in F.items()}
    for persistence in PERSISTENCE:
        rule = estimate_false_alarms(monitor.active_.baseline_index, persistence=persistence).rule
        events = find_events(index[0.0].to_numpy(), index[0.0].index, rule)
        row = {"structure": name, "law": law, "cleaned": is_cleaned, "persistence": persistence, "plain": plain}
        watch = estimate_false_alarms(monitor.active_.baseline_index, WATCHES, persistence=persistence).rule
        watches = find_events(index[0.0].to_numpy(), index[0.0].index, watch)
        row |= {
            "events": len(events) / YEARS,
            "watches": len(watches) / YEARS,
            "plain": plain,
            "threshold": rule.threshold,
        }
        for severity in SEVERITIES:
            days = []
            for start in STARTS:
                values = np.append(index[0.0][start - 9 : start], index[severity][start : start + N_DAYS])
                found = find_events(values, index[0.0].index[start - 9 : start + N_DAYS], rule)
                open_after = found[found["end"].isna() | (found["end"] > index[0.0].index[start])]["start"]
                wait = (open_after.min() - index[0.0].index[start]).days + 1 if len(open_after) else np.inf
                days.append(max(wait, 1))
            row[f"days {severity:.0%}"] = days
        yield row


def of_plain_regression(T, F):
    """False alarms a year of a quadratic regression and the Mahalanobis distance that its own year exceeds once."""
    residuals = F - make_pipeline(PolynomialFeatures(2), LinearRegression()).fit(T[:YEAR], F[:YEAR]).predict(T)
    distance = EmpiricalCovariance().fit(residuals[:YEAR]).mahalanobis(residuals)
    alarms = np.flatnonzero(distance[YEAR:] > np.quantile(distance[:YEAR], 1 - 1 / YEAR))
    return (np.diff(alarms, prepend=-YEAR) > APART).sum() / YEARS


def median(days):
    return np.median(np.concatenate(days.tolist()))


def main():
    options = arguments(
        __doc__,
        structures=STRUCTURES,
        laws=dict.fromkeys(LAWS),
        baselines=(30, "of each law, divided among the structures"),
        seed=1000,
        quick=(False, "six baselines of each law"),
    )
    start, rows = time.perf_counter(), []
    for law in options.laws:
        for is_cleaned in (False, True):
            for n in range(6 if options.quick else options.baselines):
                name = options.structures[n % len(options.structures)]
                rows += rows_of(name, law, is_cleaned, options.seed + n)
    table = pd.DataFrame(rows)
    by = ["persistence", "cleaned", "law"]
    days = {column: (column, median) for column in table if column.startswith("days")}
    summary = table.groupby(by, sort=False).agg(
        events=("events", "mean"),
        error=("events", "sem"),
        watches=("watches", "mean"),
        watches_error=("watches", "sem"),
        plain=("plain", "mean"),
        threshold=("threshold", "mean"),
        **days,
    )
    by_structure = table.pivot_table(index=by, columns="structure", values="events", sort=False)
    shown(
        f"days: median to the first event within {N_DAYS} days; columns of structures: events a year",
        summary.join(by_structure),
    )
    print(f"{time.perf_counter() - start:.0f} s")
    return 0 if summary.loc[(3, False), "events"].between(LEAST, MOST).all() else 1


if __name__ == "__main__":
    sys.exit(main())
