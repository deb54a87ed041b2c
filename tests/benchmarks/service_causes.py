"""Every alarm has a cause, and one cause is one event: outages, sensors that fail, sudden, slow and small damage.

    OMP_NUM_THREADS=1 python tests/benchmarks/service_causes.py --dates 8
    OMP_NUM_THREADS=1 python tests/benchmarks/service_causes.py --parts damage --against 43ba4fa4

Five bridges with three-hourly records of two years, thermometers to .1 degree: the frozen girder and the moist arch of
`structures.Site`, and a truss, a girder and an arch of the synthetic fleet. A `Monitor` with the directions of the
model's damage groups learns the first year.

``outages``: from each of some dates of the second year on, records are missing for 6 to 120 hours. False are damage
events within 12 days of the return that the same records without the outage do not have. ``faults``: a thermometer
holds its last value, is 3 degrees off or drifts by a degree a week, and two modes are exchanged or the first one holds
its value; the sensor works again after 15 days.

``damage``: a loss from one date on that lasts, one that grows from zero over 180 days, and a fifth of the former, in
each of three groups, on three of the bridges, one of them with moisture of 20 days that nobody measures. Days until the
state is alarm or drift, number of events that begin in 120 days, and whether the first one names the group.
``healthy``: the second year as it is, and events in it.

The exit code is 1 if an outage or a fault gives a false damage event in more than one of twenty cases.
"""

import copy
import sys

import numpy as np
import pandas as pd
from harness import arguments, is_missed, shown
from structures import Site

from skthermo.datasets import make_fleet
from skthermo.detection import CompensatedDetector, DirectionalDetector
from skthermo.monitoring import Monitor

YEAR = "2025"
HOURS = (6, 12, 24, 48, 120)
FAULTS = {
    "frozen thermometer": 15,
    "thermometer 3 degrees off": 15,
    "drifting thermometer": 25,
    "frozen frequency": 15,
    "exchanged frequencies": 15,
}
SUDDEN, WATCHED = 0.15, 120  # loss of stiffness, days
DAY = pd.Timedelta("1D")


class Fleet:
    """A bridge of the synthetic fleet, with the interface of `Site`."""

    def __init__(self, kind, seed=0):
        self.bridge = next(one for one in make_fleet(3, atypical=0.0, random_state=seed).values() if one.kind == kind)
        self.model = self.bridge.model

    def records(self, year, damage=None):
        made = self.bridge.records(365, f"{year}-01-01", samples_per_day=8, damage=damage)
        return made.temperatures.join(made.frequencies)


BRIDGES = {
    "frozen girder": lambda: Site("frozen girder"),
    "moist arch": lambda: Site("moist arch"),
    "truss": lambda: Fleet("truss", 1),
    "girder": lambda: Fleet("girder", 1),
    "arch": lambda: Fleet("arch", 1),
}
DAMAGED = ("moist arch", "frozen girder", "truss")


class Service:
    """A bridge, and its monitor after the first year."""

    def __init__(self, name):
        self.site, self.name = BRIDGES[name](), name
        self.baseline, self.healthy = (self.rounded(self.site.records(year)) for year in (2024, 2025))
        modes = [column for column in self.baseline if column.startswith("f")]
        self.modes, self.thermometers = modes, [one for one in self.baseline if one not in modes]
        directions = DirectionalDetector(self.site.model.damage_directions(kind="stiffness"))
        detector = CompensatedDetector(directions, targets=modes, window="1D")
        self.monitor = Monitor(detector, units="Hz").fit(self.baseline)

    def rounded(self, records):
        temperatures = [column for column in records if not column.startswith("f")]
        return records.assign(**records[temperatures].round(1))

    def dates(self, number):
        """Stamps that are spread over the second year."""
        return pd.DatetimeIndex([self.healthy.index[0] + (20 + 300 * n / number) * DAY for n in range(number)])

    def cases(self, number):
        """Monitors that have seen all records before some dates."""
        monitor, last = copy.deepcopy(self.monitor), self.healthy.index[0]
        for date in self.dates(number).floor("3h"):
            monitor.update(self.healthy[(self.healthy.index >= last) & (self.healthy.index < date)])
            last = date
            yield date, monitor


def damage_events(monitor, since):
    events = monitor.events_
    return int(((events["kind"] == "damage") & (events["start"] >= since)).sum())


def after(monitor, records):
    one = copy.deepcopy(monitor)
    one.update(records)
    return one


def with_fault(service, records, fault, until):
    """Records in which a sensor is at fault from the first one up to a time."""
    records, rows = records.copy(), records.index < until
    one, since = service.thermometers[0], (records.index - records.index[0]) / DAY
    first, second = service.modes[:2]
    if fault == "frozen thermometer":
        records.loc[rows, one] = records[one].dropna().iloc[0]
    elif fault == "thermometer 3 degrees off":
        records.loc[rows, one] += 3.0
    elif fault == "drifting thermometer":
        records.loc[rows, one] += since[rows] / 7
    elif fault == "frozen frequency":
        records.loc[rows, first] = records[first].dropna().iloc[0]
    else:
        records.loc[rows, [first, second]] = records.loc[rows, [second, first]].to_numpy()
    return records


def part_of_year(service, options):
    """Rows of outages and faults: cases, with a false damage event, share of records that were not evaluated."""
    rows = []
    for date, monitor in service.cases(options.dates):
        period = service.healthy[(service.healthy.index >= date) & (service.healthy.index < date + 30 * DAY)]
        known = damage_events(after(monitor, period), date)
        for hours in HOURS if "outages" in options.parts else ():
            back = date + pd.Timedelta(hours=hours)
            seen = after(monitor, period[(period.index >= back) & (period.index < back + 12 * DAY)])
            three = seen.evaluations_.loc[back : back + 10 * DAY, "state"] == "not evaluated"
            waited = 10.0 if three.all() else (three.to_numpy().argmin()) / 8
            rows.append((f"outage of {hours} h", damage_events(seen, date) > known, waited))
        for fault, days in FAULTS.items() if "faults" in options.parts else ():
            records = with_fault(service, period, fault, date + days * DAY)
            rows.append((fault, damage_events(after(monitor, records), date) > known, np.nan))
    return pd.DataFrame(rows, columns=["case", "false", "days"]).assign(bridge=service.name)


def losses(service, options):
    """Rows of damage: days to the first alarm or drift, number of events, and whether the group is right."""
    groups = list(service.site.model.damage_directions(kind="stiffness").index)[:3]
    (date, monitor), *_ = list(service.cases(1))
    period = service.healthy.index[(service.healthy.index >= date)][: 8 * 200]
    days = ((period - date) / DAY).to_numpy()
    healthy, rows = service.healthy.loc[period], []
    kinds = {"sudden": (1.0, 0), "creeping": (1.0, 180), "small": (0.2, 0)}
    for group in groups:
        whole = service.rounded(service.site.records(2025, {group: SUDDEN})).loc[period]
        for kind, (share, grows) in kinds.items():
            part = share * (np.minimum(days / grows, 1.0) if grows else np.ones(len(days)))
            records = healthy.copy()
            ratio = (whole[service.modes] / healthy[service.modes]).to_numpy()
            records[service.modes] = healthy[service.modes] * (1 + part[:, np.newaxis] * (ratio - 1))
            served = after(monitor, records)
            states, events = served.evaluations_["state"].loc[date:], served.events_
            found = states.index[states.isin(["alarm", "drift", "known damage"])]
            events = events[(events["start"] >= date) & events["kind"].isin(["damage", "drift"])]
            within = events[events["start"] <= date + max(WATCHED, grows) * DAY]
            days_to = (found[0] - date) / DAY if len(found) else np.inf
            named = group in within["groups"].iloc[-1] if len(within) else False
            rows.append((service.name, kind, group, days_to, len(within), named))
    return pd.DataFrame(rows, columns=["bridge", "loss", "group", "days", "events", "named"])


def main():
    parts = ["outages", "faults", "damage", "healthy"]
    options = arguments(__doc__, dates=4, parts=(parts, "what to measure", parts), bridges=(dict(BRIDGES), "which"))
    cases, lost, healthy = [], [], {}
    for name in options.bridges:
        service = Service(name)
        if {"outages", "faults"} & {*options.parts}:
            cases.append(part_of_year(service, options))
        if "damage" in options.parts and name in DAMAGED:
            lost.append(losses(service, options))
        if "healthy" in options.parts:
            kinds = after(service.monitor, service.healthy).events_["kind"].value_counts()
            healthy[name] = kinds.reindex(["damage", "drift", "fault"], fill_value=0)
    missed = False
    if cases:
        table = pd.concat(cases).groupby("case", sort=False)
        found = pd.DataFrame({"cases": table.size(), "false damage events": table["false"].sum()})
        shown("Outages and sensors that fail", found.assign(**{"days not evaluated": table["days"].max()}), 1)
        missed |= is_missed("share of false damage events", found.iloc[:, 1].sum() / found["cases"].sum(), "<= 0.05")
    if healthy:
        shown("Events of a healthy year, one asked", pd.DataFrame(healthy).T)
    if lost:
        table = pd.concat(lost).groupby(["bridge", "loss"], sort=False)
        days = table["days"].apply(lambda some: " ".join(f"{one:.0f}" for one in sorted(some)))
        events = table["events"].apply(lambda some: " ".join(map(str, sorted(some))))
        columns = {
            "days until alarm or drift, three groups": days,
            "events": events,
            "named rightly": table["named"].sum(),
        }
        shown("Losses of 15 %, creeping to 15 %, and of 3 %", pd.DataFrame(columns))
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
