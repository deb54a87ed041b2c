"""One false alarm a year was asked for: events a year in simulated years, and how fast damage is found.

    OMP_NUM_THREADS=1 python tests/benchmarks/false_alarm_rates.py
    OMP_NUM_THREADS=1 python tests/benchmarks/false_alarm_rates.py --laws t3 winter --structures truss --baselines 10

Daily records of the truss, of a girder of the synthetic fleet, and of six frequencies that are linear in one
temperature. Each baseline is a year; the three years after it are healthy, and from two days of the first of them on
damage is simulated: 5, 10 and 20 % of the stiffness of a group, and the shift of the truss for the linear frequencies.
It is found by the first event that is open within 180 days.

Laws of the noise, each with the same standard deviation before outliers: independent and normal, autoregressive with
correlations of .5 and .9 of neighbouring records, Student with three degrees of freedom, outliers of 5 to 20 standard
deviations in .1 and .5 % of the values, and twice as much noise in winter.

``persistence`` 3 is the default of ``Monitor``, 1 means alarms of single records; both by the same fitted detector. The
strongest simple competitor is a quadratic regression, and the Mahalanobis distance that its own year exceeds once. The
exit code is 1 if a mean over the structures is not .5 to 1.5 events a year with persistence 3.
"""

import sys
from functools import cache

import numpy as np
import pandas as pd
from harness import arguments, compensated, last_step, shown
from scipy.signal import lfilter
from sklearn.covariance import EmpiricalCovariance
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures

from skthermo.datasets import make_fleet, make_truss_campaign
from skthermo.detection import DirectionalDetector

LAWS = {
    "iid": "independent, normal",
    "ar .5": "correlated by 0.5",
    "ar .9": "correlated by 0.9",
    "t3": "Student, three degrees of freedom",
    "outliers .1 %": "outliers in 0.1 % of the values",
    "outliers .5 %": "outliers in 0.5 % of the values",
    "winter": "twice as large in winter",
}
YEARS, YEAR, N_DAYS, STARTS = 3, 365, 180, (20, 200)
BASELINE = 2 * YEAR  # days before the first record in service, the longest baseline
SEVERITIES, DAY = (0.05, 0.10, 0.20), pd.Timedelta("1D")
LEAST, MOST = 0.5, 1.5
APART = 5  # days between alarms of two events
WATCHES = 12.0  # events a year of the lower level
STAMPS = pd.date_range("2020-01-01", periods=BASELINE + YEARS * YEAR)


@cache
def truss():
    made = {s: make_truss_campaign(2 + YEARS, damage={"bottom": s}, random_state=1) for s in (0.0, *SEVERITIES)}
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


def series(detector, records):
    """Rounded damage indices, as those of ``update``."""
    return pd.Series(-detector.score_samples(records), records.index).round(6)


def waited(index, start, events_of):
    """Days from a date until an event is open; infinite if none is within `N_DAYS`."""
    first = index[0.0].index[start]

    def days(severity):
        values = pd.concat([index[0.0][start - 9 : start], index[severity][start : start + N_DAYS]])
        found = events_of(values)
        later = found[found["end"].isna() | (found["end"] > first)]["start"]
        return max((later.min() - first).days + 1, 1) if len(later) else np.inf

    return days


def measured(index, events_of):
    """Events a year without damage, days of each, and days until damages are found."""
    events = events_of(index[0.0])
    ends = events["end"].fillna(index[0.0].index[-1])
    found = {"a year": len(events) / YEARS, "events": len(events), "lasted": ((ends - events["start"]) / DAY).sum()}
    return found | {f"{s:.0%}": [waited(index, start, events_of)(s) for start in STARTS] for s in SEVERITIES}


def ruled(index, a_year, persistence):
    """Events of a series of indices, by the levels that a baseline's own indices give for so many a year."""
    try:
        from inside import EventLevels, followed
    except ImportError:  # in 0.2
        from inside import estimate_false_alarms, find_events

        rule = estimate_false_alarms(index, a_year, persistence=persistence).rule
        return lambda values: find_events(values.to_numpy(), values.index, rule)
    levels = EventLevels.learned(index, a_year, persistence)

    def events_of(values):
        limits = pd.DataFrame({"threshold": levels.threshold, "release": levels.release}, values.index)
        found = followed(values.to_numpy(), values.index.as_unit("ns").asi8, limits, persistence)[1]
        ends = [values.index[stop] if stop < len(values) else pd.NaT for _, stop in found]
        return pd.DataFrame({"start": values.index[[first for first, _ in found]], "end": pd.DatetimeIndex(ends)})

    return events_of


def above(limit):
    """Events of single records above a limit, at least some days apart."""

    def events_of(values):
        alarms = values.index[values > limit]
        is_first = np.diff(alarms, prepend=alarms[:1] - 2 * APART * DAY) > APART * DAY
        ends = np.append(alarms[:-1][is_first[1:]], alarms[-1:]) + DAY
        return pd.DataFrame({"start": alarms[is_first], "end": ends})

    return events_of


def rows_of(name, law, seed, days, asked):
    """A row for each way, length of the baseline and number of events that is asked for."""
    T, clean, noise = STRUCTURES[name]()
    z = drawn(law, clean[0.0].shape, np.random.default_rng(seed))
    modes, sensors = ([f"{letter}{i + 1}" for i in range(table.shape[1])] for letter, table in (("f", z), ("T", T)))
    T = pd.DataFrame(T, STAMPS, sensors)
    F = {s: pd.DataFrame(one * (1 + noise * z), STAMPS, modes) for s, one in clean.items()}
    for length in days:
        before = slice(BASELINE - length, BASELINE)
        detector = compensated(modes, DirectionalDetector()).fit(T[before].join(F[0.0][before]))
        own = pd.Series(last_step(detector).baseline_index_, STAMPS[before])
        index = {s: series(detector, T[BASELINE:].join(one[BASELINE:])) for s, one in F.items()}
        of = {"structure": name, "law": LAWS[law], "days": length}
        for number in asked:
            yield of | {"way": "monitor", "asked": number} | measured(index, ruled(own, number, 3))
        if length == YEAR:
            of |= {"asked": 1.0}
            distance = plain_distance(T, F)
            limit = np.quantile(distance(0.0)[before], 1 - 1 / YEAR)
            yield of | {"way": "single records"} | measured(index, ruled(own, 1.0, 1))
            yield of | {"way": "watch"} | measured(index, ruled(own, WATCHES, 3))
            yield of | {"way": "plain"} | measured({s: distance(s)[BASELINE:] for s in F}, above(limit))


def plain_distance(T, F):
    """Mahalanobis distance of what a quadratic regression leaves, learned from the healthy first year."""
    year = slice(BASELINE - YEAR, BASELINE)
    regression = make_pipeline(PolynomialFeatures(2), LinearRegression()).fit(T[year], F[0.0][year])
    covariance = EmpiricalCovariance().fit(F[0.0][year] - regression.predict(T[year]))
    return lambda s: pd.Series(covariance.mahalanobis(F[s] - regression.predict(T)), STAMPS)


def medians(rows):
    """Median days to the first event at each severity, as one text."""
    found = [np.median(np.concatenate(rows[f"{s:.0%}"].tolist())) for s in SEVERITIES]
    return " / ".join(f"{days:.3g}" if np.isfinite(days) else "never" for days in found)


def main():
    options = arguments(
        __doc__,
        structures=STRUCTURES,
        laws=dict.fromkeys(LAWS),
        baselines=(30, "of each law, divided among the structures"),
        days=([14, 60, 365, 730], "of a baseline"),
        asked=([0.2, 1.0, 4.0], "false events a year"),
        seed=1000,
    )
    rows = []
    for law in options.laws:
        for n in range(options.baselines):
            name = options.structures[n % len(options.structures)]
            rows += rows_of(name, law, options.seed + n, options.days, options.asked)
    table = pd.DataFrame(rows)
    own = table[table["way"] == "monitor"]
    by_law = {"index": "law", "values": "a year", "sort": False}
    for number in options.asked:
        shown(
            f"False alarms a year where {number:g} was asked for, by days of the baseline; {options.baselines} "
            "baselines of daily records for each noise",
            own[own["asked"] == number].pivot_table(columns="days", **by_law).rename_axis("noise"),
            2,
        )
    table = table[(table["days"] == YEAR) & (table["asked"] == 1.0)]
    if not len(table):
        return 0
    a_year = table.pivot_table(columns="way", **by_law)
    own = table[table["way"] == "monitor"].groupby("law", sort=False)
    error, sums = own["a year"].sem(), own[["lasted", "events"]].sum()
    columns = {
        "monitor, by default": a_year["monitor"],
        "its standard error": error,
        "days of each": sums["lasted"] / sums["events"],
        "alarms of single records": a_year["single records"],
        "plain regression": a_year["plain"],
        "watches, 12 asked for": a_year["watch"],
    }
    settings = f"{options.baselines} baselines of a year of daily records for each noise"
    shown(f"False alarms a year where one was asked for; {settings}", pd.DataFrame(columns).rename_axis("noise"), 1)
    by_structure = table[table["way"] == "monitor"].pivot_table(columns="structure", **by_law)
    shown("The same by structure, monitor by default", by_structure.rename_axis("noise"), 1)
    names = {
        "monitor": "monitor, by default",
        "single records": "alarms of single records",
        "plain": "plain regression",
    }
    days = table.groupby(["law", "way"], sort=False).apply(medians).unstack().loc[list(a_year.index), list(names)]
    shown("Median days until a loss of 5 / 10 / 20 % is found", days.rename(columns=names).rename_axis("noise"))
    return 0 if a_year["monitor"].between(LEAST, MOST).all() else 1


if __name__ == "__main__":
    sys.exit(main())
