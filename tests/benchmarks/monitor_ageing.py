"""Alarms of a monitor on a bridge that ages for five years, with drift followed and without, and sudden damage on top.

    OMP_NUM_THREADS=1 python tests/benchmarks/monitor_ageing.py
    OMP_NUM_THREADS=1 python tests/benchmarks/monitor_ageing.py --bridges KW51 --seeds 2

Groups take turns over the seeds. Chain and detector learn from the first year; the detector is a regression on
temperature with means of a week (truss, a record a day) or of a day (KW51). Sudden damage of 12 % in the group that
drifts comes in the fifth year.

Printed are, by year: records in alarm in percent (without damage: false ones), and events that began in that year; with
damage: whether an event began within a week, in how many days, and by how much the drift that is reported has changed a
month and four months later, in percent of the damage (its own rate gives 0.7 and 2.7). Daily means are made once for
all days, which gives the follower the states of one day after the other. The exit code is 1 if a target is missed.
"""

import sys

import numpy as np
import pandas as pd
from harness import arguments, compensated, split
from sklearn.pipeline import make_pipeline
from structures import AGEING

from skthermo.detection import WindowedAlarm
from skthermo.monitoring import Monitor
from skthermo.monitoring.drift import DriftFollower
from skthermo.preprocessing import LagFeatures
from skthermo.surrogate import TemperatureMapper

YEARS, RATES, DAMAGE, AFTER = 5, (0.0, 0.01), 0.12, 0.3
WEEK, LATER = pd.Timedelta(days=7), (30, 120)
ABSORBED, FALSE, FOUND = 0.03, 1.5, 0.95
"""Targets: share of the damage in the drift a month later, events a year where drift is followed, found in a week."""


def detector(bridge, modes):
    lines = TemperatureMapper()
    regressor = lines if bridge.name == "truss" else make_pipeline(LagFeatures([0, 6, 24], freq="1h"), lines)
    window = "7D" if bridge.name == "truss" else "1D"
    return compensated(modes, WindowedAlarm(window), regressor, whiten="global")


def followed(follower, T, F, n_first):
    """Records after the first as the detector sees them, and what is known of the drift at the end of each day."""
    later = F[n_first:]
    days = pd.date_range(later.index[0].normalize(), later.index[-1], freq="D")
    daily = follower.records.means(T, later, days)
    state, corrected, states = follower.start(), [], {}
    of_day = later.groupby(later.index.normalize())
    for row, day in enumerate(days):
        if day in of_day.groups:
            records = of_day.get_group(day)
            corrected.append(follower.corrected(state, records))
        if day > state.day:
            state = follower._with_day(state, daily[row : row + 1])
        states[day] = state
    return pd.concat(corrected), states


def evaluated(monitor_of, T, F, n_first):
    """Answers to all records after the first, and events."""
    monitor = monitor_of(F[:n_first])
    answers = [monitor.update(T.loc[part.index].join(part)) for _, part in F[n_first:].groupby(F.index[n_first:].year)]
    return pd.concat([part[~part["revised"]] for part in answers]), monitor.events_


def by_year(answers, events, start):
    """Records in alarm, and events that began, in years of service 4 and 5."""
    found = {}
    for year in (4, 5):
        begin, end = (start + pd.DateOffset(years=n) for n in (year - 1, year))
        part = answers[(answers.index >= begin) & (answers.index < end)]
        known = part["state"] != "not evaluated"
        found[f"alarms {year}, %"] = 100 * (part["state"] == "alarm").sum() / max(known.sum(), 1)
        found[f"events {year}"] = ((events["start"] >= begin) & (events["start"] < end)).sum()
    return found


def run(bridge, seed, correlation):
    """Rows of one seed."""
    group, rows = bridge.groups[seed % len(bridge.groups)], []
    for rate in RATES:
        drift = {group: rate}
        records, n_first = bridge.campaign(YEARS, seed, correlation, drift=drift)
        T, F = split(records)
        fem = bridge.chain().fit(T[:n_first], F[:n_first])
        follower = DriftFollower.of(fem, T[:n_first], F[:n_first])

        def monitor_of(first, T=T):
            alarm = detector(bridge, list(first))
            return Monitor(alarm, sensors=False, retention="450D", random_state=0).fit(T[: len(first)].join(first))

        corrected, _ = followed(follower, T, F, n_first)
        of = {"bridge": bridge.name, "lost a year, %": 100 * rate, "seed": seed}
        for name, records in (("no", F), ("yes", pd.concat([F[:n_first], corrected]))):
            row = of | {"damage": "none", "followed": name}
            rows.append(row | by_year(*evaluated(monitor_of, T, records, n_first), F.index[0]))
        if not rate:
            continue
        onset = F.index[0] + pd.Timedelta(days=round(365.25 * (YEARS - 1 + AFTER)))
        changes = {"drift": drift, "damage": {group: DAMAGE}, "damage_from": onset}
        T, damaged = split(bridge.campaign(YEARS, seed, correlation, **changes)[0])
        corrected, with_damage = followed(follower, T, damaged, n_first)
        _, events = evaluated(monitor_of, T, pd.concat([F[:n_first], corrected]), n_first)
        waited = (events["start"] - onset)[events["start"] >= onset].min()
        row = of | {"damage": "12 %", "followed": "yes", "found": waited <= WEEK, "days": waited / pd.Timedelta(days=1)}
        at_onset, *later = (
            follower.report(with_damage[onset.normalize() + pd.Timedelta(days=days)])["change"].get(group, np.nan)
            for days in (0, *LATER)
        )
        for days, change in zip(LATER, later, strict=True):
            row[f"absorbed {days} d, %"] = 100 * (at_onset - change) / DAMAGE
        rows.append(row)
    return rows


def misses(table):
    """Targets that are not reached, as sentences."""
    for name, part in table.groupby("bridge"):
        healthy = part[(part["damage"] == "none") & (part["followed"] == "yes")]
        events = healthy[["events 4", "events 5"]].to_numpy().mean()
        damaged = part[part["damage"] != "none"]
        if events > FALSE:
            yield f"{name}: {events:.2f} false events a year with drift followed; at most {FALSE}"
        if damaged["found"].mean() < FOUND:
            yield f"{name}: {damaged['found'].sum()} of {len(damaged)} damages found within a week; {FOUND:.0%} wanted"
        if damaged["absorbed 30 d, %"].abs().max() > 100 * ABSORBED:
            worst = damaged["absorbed 30 d, %"].abs().max()
            yield f"{name}: {worst:.1f} % of a damage taken for drift; at most {100 * ABSORBED:.0f}"


def main():
    options = arguments(
        __doc__,
        bridges=(["truss"], None, list(AGEING)),
        seeds=20,
        correlation=(0.0, "of the noise of neighbouring records"),
        each=(False, "print every run"),
    )
    rows = []
    for name in options.bridges:
        bridge = AGEING[name]()
        for seed in range(options.seeds):
            rows += run(bridge, seed, options.correlation)
            if options.each:
                print(pd.DataFrame(rows[-5:]).round(2).to_string(), flush=True)
    table = pd.DataFrame(rows)
    keys = ["bridge", "lost a year, %", "damage", "followed"]
    print(f"\n{options.seeds} seeds, noise correlated by {options.correlation}; means\n")
    figures = table.drop(columns="seed").astype({"found": float})
    print(figures.groupby(keys, sort=False).mean().round(2).to_string())
    missed = list(misses(table))
    print("\n" + ("\n".join(f"missed: {line}" for line in missed) or "all targets reached"))
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
