"""How long false events last, and how often the event of a damage ends and begins anew.

    OMP_NUM_THREADS=1 python tests/benchmarks/event_lengths.py [--seeds 100 200] [--per-day 1 4 24]

Truss, three bridges of the fleet and the footbridge of `structures.py`: a default monitor learns a year, and another
healthy year is evaluated. So that there are events enough, their lengths are also those at six false alarms a year.
Damage lowers all frequencies by 1.2 times the smallest change that the monitor states; an event that opens after the
first one is a reopening. Prints, by structure and records a day: events a year and their days in the mean, for one and
for six asked for, the longest, reopenings a month and the share of the time in which an event is open. The exit code
is 1 if false events of several records a day last more than two days in the mean, or damage reopens more than twice a
month.
"""

import sys

import pandas as pd
from harness import arguments, joined, modes_of
from structures import Footbridge

from skthermo.datasets import make_fleet, make_truss_campaign
from skthermo.monitoring import Monitor
from skthermo.monitoring._events import find_events
from skthermo.monitoring._threshold import estimate_false_alarms

DAY = pd.Timedelta("1D")
ABOVE = 1.2  # times the smallest change
LONGEST, REOPENED = 2.0, 2.0


def structures(seed, per_day):
    """Name, baseline and another healthy year."""
    options = {"samples_per_year": 365 * per_day, "samples_per_day": per_day}
    baseline, later = (joined(make_truss_campaign(**options, random_state=s)) for s in (seed, seed + 1))
    yield "truss", baseline, later.set_index(later.index + pd.Timedelta("365D"))
    for bridge in make_fleet(3, atypical=0.0, random_state=seed).values():
        years = (bridge.records(365, start, samples_per_day=per_day) for start in ("2024-01-01", "2025-01-01"))
        yield "bridge", *map(joined, years)
    bridge = Footbridge(seed)
    yield "footbridge", bridge.training(True), bridge.evaluated({})


def index_of(monitor, records):
    return pd.Series(-monitor.detector_.score_samples(records[monitor.active_.columns]), records.index)


def days_of(events, end):
    return (events["end"].fillna(end) - events["start"]) / DAY


def measured(monitor, later, targets):
    """Events of a healthy year and of a damaged one."""
    healthy, damaged = later, later.copy()
    damaged[targets] *= 1 - ABOVE * monitor.smallest_changes_.common
    healthy, damaged = (index_of(monitor, records) for records in (healthy, damaged))
    more = estimate_false_alarms(monitor.active_.baseline_index, 6.0, persistence=monitor.persistence).rule
    (one, six), of_damage = (
        [find_events(healthy.to_numpy(), healthy.index, rule) for rule in (monitor.active_.estimate.rule, more)],
        find_events(damaged.to_numpy(), damaged.index, monitor.active_.estimate.rule),
    )
    end = later.index[-1]
    return {
        "events": len(one),
        "days": days_of(one, end).sum(),
        "events of six": len(six),
        "days of six": days_of(six, end).sum(),
        "longest": days_of(six, end).max() if len(six) else 0.0,
        "reopened": max(len(of_damage) - 1, 0) / 12,
        "open": days_of(of_damage, end).sum() * DAY / (end - later.index[0]),
    }


def summarised(table, by):
    groups = table.groupby(by, sort=False)
    sums, means = groups.sum(numeric_only=True), groups.mean(numeric_only=True)
    return pd.DataFrame(
        {
            "events a year": means["events"],
            "days each": sums["days"] / sums["events"],
            "at six a year": means["events of six"],
            "days each ": sums["days of six"] / sums["events of six"],
            "longest": groups["longest"].max(),
            "reopened a month": means["reopened"],
            "open": means["open"],
        }
    )


def main():
    options = arguments(__doc__, seeds=[100, 200], per_day=[1, 4, 24])
    rows = []
    for seed in options.seeds:
        for per_day in options.per_day:
            for name, baseline, later in structures(seed, per_day):
                targets = modes_of(baseline)
                monitor = Monitor(targets=targets, sensors=False).fit(baseline)
                found = measured(monitor, later, targets)
                rows.append({"structure": name, "records a day": per_day} | found)
    table = pd.DataFrame(rows)
    print(summarised(table, ["records a day", "structure"]).round(2).to_string())
    every = summarised(table, ["records a day"])
    print(every.round(2).to_string())
    lengths = every.loc[every.index > 1, "days each "]
    return 1 if (lengths > LONGEST).any() or (every["reopened a month"] > REOPENED).any() else 0


if __name__ == "__main__":
    sys.exit(main())
