"""The watch on sensors: from day to day, which are at fault, since when, and until when."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array, as_floats
from skthermo._core.frames import DAY_NS, as_index, columns_by_sensor, frame_like
from skthermo.monitoring.sensors._expected import (
    CERTAIN,
    LEAST_DAYS,
    LONGEST,
    Change,
    Days,
    Departures,
    Responses,
    Thermometers,
    local_days,
)
from skthermo.preprocessing.checks import Plausible, equal_runs

SOON = 7 * DAY_NS  # nanoseconds after its end in which a fault that comes again is the same
COLUMNS = ["column", "kind", "since", "detected", "until", "detail"]
LEFT_OUT = ("dead", "stuck", "implausible", "offset", "drift")
DEPARTURES = ("offset", "drift", "disagree")
MONTH = 30.4  # days
A_DEGREE = 1.0  # below which thermometers may depart without a fault
LEAST_OTHERS = 2  # thermometers that tell which one is at fault
CLEAR = 4.6  # logarithm of the odds that one thermometer is at fault, against each other one
ENDED = 7.0  # logarithm of the odds that an offset or a drift has ended
RECENT = 7  # days that may already be without a fault, or not tell yet which thermometer has it
Counts = NDArray[np.int64]
MISSING, REPEATED, IMPLAUSIBLE = range(3)
FEWEST = np.array([3, 5, 3])  # records of a run of each kind that may be a fault
USUAL_RANK = 3  # the usual run is the longest but so many: faults of the baseline are no rule
TIMES_LONGEST = (1.7, 4.0)  # times the longest run of the baseline that faults exceed
TIMES_USUAL = (3.0, 4.0)  # times its usual run
KINDS_OF_RUNS = {"implausible": IMPLAUSIBLE, "stuck": REPEATED, "dead": MISSING}
HELD = ("stuck", "implausible")  # faults of a response that may be a change of the structure
RARER = 3.0  # times, a healthy thermometer is called faulty where a reference alone can say so
REFERENCE = 2.0  # times `CLEAR`, the logarithm of the odds that a thermometer is at fault and not a reference


@dataclass(frozen=True)
class Fault:
    """Position of its column, the other one where two are concerned (else -1), times in nanoseconds, None as it lasts.

    ``size`` is the departure or the repeated value, ``rate`` that of a drift in a day.
    """

    kind: str
    column: int
    since: int
    detected: int
    other: int = -1
    size: float = 0.0
    rate: float = 0.0
    until: int | None = None

    def detail(self, other: Hashable, unit: str) -> str:
        value = f"{self.size:.6g} {unit}".rstrip()
        return {
            "dead": "has had no value for longer than gaps of the baseline",
            "stuck": f"repeats {value}; left out",
            "implausible": f"shows implausible values, such as {value}; left out",
            "offset": f"{self.size:+.1f} degrees beside what the other thermometers predict; left out",
            "drift": f"{self.rate * MONTH:+.2f} degrees a month, {self.size:+.1f} so far, beside what the other "
            "thermometers predict; left out",
            "disagree": f"{abs(self.size):.1f} degrees between what it, {other!r} and any others predict: which is "
            "wrong is not known; records are healthy only if they are so without either",
            "swapped": f"its values are in the column of {other!r}; put back in place",
        }[self.kind]


@dataclass(frozen=True)
class SensorFaults:
    """All faults in the order in which they were detected."""

    faults: tuple[Fault, ...] = ()

    def lasting(self, *kinds: str) -> list[Fault]:
        return [fault for fault in self.faults if fault.until is None and fault.kind in kinds]

    def left_out(self) -> dict[int, Fault]:
        """By position of each column that is left out, the fault for which it is."""
        return {fault.column: fault for fault in self.lasting(*LEFT_OUT)}

    def opened(self, fault: Fault) -> SensorFaults:
        """With one more fault, or with that one again which has just ended."""
        same = (fault.column, fault.other, fault.kind)
        for known in reversed(self.faults):
            lasts = known.until is None or known.until > fault.since - SOON
            if (known.column, known.other, known.kind) == same and lasts:
                return self.changed(known, until=None)
        return SensorFaults((*self.faults, fault))

    def changed(self, fault: Fault, **values: Any) -> SensorFaults:
        return SensorFaults(tuple(replace(one, **values) if one is fault else one for one in self.faults))

    def notes(self, names: Sequence[Hashable], zone: str) -> list[str]:
        """What is left out or put back in place for the faults that last."""
        return [
            f"{names[fault.column]} and {names[fault.other]} are exchanged and were put back in place"
            if fault.kind == "swapped"
            else f"{names[fault.column]} is left out ({fault.kind} since {as_index([fault.since], zone)[0]:%Y-%m-%d})"
            for fault in self.lasting(*LEFT_OUT, "swapped")
        ]

    def table(self, names: Sequence[Hashable], zone: str, units: Sequence[str]) -> pd.DataFrame:
        """One row a fault, two where two columns are concerned."""
        rows = [
            [names[own], fault.kind, fault.since, fault.detected, fault.until, fault.detail(names[other], units[own])]
            for fault in self.faults
            for own, other in [(fault.column, fault.other), (fault.other, fault.column)][: 1 if fault.other < 0 else 2]
        ]
        columns = dict(zip(COLUMNS, zip(*rows, strict=True) if rows else [()] * len(COLUMNS), strict=True))
        table = {name: pd.Series(list(values), dtype=object) for name, values in columns.items()}
        return pd.DataFrame(table | {name: as_index(columns[name], zone) for name in ("since", "detected", "until")})


@dataclass(frozen=True)
class Runs:
    """Last value of each column, and number of records and first stamp (ns) of its current run of each kind."""

    last: Array
    counts: Counts
    since: Counts

    @classmethod
    def none(cls, last: Array) -> Runs:
        return cls(last, np.zeros((3, len(last)), dtype=np.int64), np.zeros((3, len(last)), dtype=np.int64))

    def after(self, stamps: Counts, values: Array, implausible: NDArray[np.bool_]) -> Runs:
        """Runs after more records; those without any value tell nothing of a single column."""
        last, before, since = self.last, self.counts, self.since
        for stamp, row, is_implausible in zip(stamps, values, implausible, strict=True):
            seen = ~np.isnan(row)
            if not seen.any():
                continue
            counts = np.array(
                [
                    np.where(seen | np.isnan(last), 0, before[MISSING] + 1),
                    np.where(seen, np.where(row == last, before[REPEATED] + 1, 1), before[REPEATED]),
                    run_of(before[IMPLAUSIBLE], seen, is_implausible),
                ]
            )
            is_fresh = (counts == 1) & ((before != 1) | np.array([~seen, seen, seen]))
            last, before, since = np.where(seen, row, last), counts, np.where(is_fresh, stamp, since)
        return Runs(last, before, since)


def run_of(before: Counts, seen: NDArray[np.bool_], implausible: NDArray[np.bool_]) -> Counts:
    """Length of the run of implausible values of each column after one more record."""
    return np.where(seen, np.where(implausible, before + 1, 0), before)


@dataclass(frozen=True)
class RunLimits:
    """Number of records from which a run of each kind is a fault, (3, n_columns), and each column's last value."""

    limits: Counts
    last: Array

    @classmethod
    def of(cls, values: Array, per_day: float) -> RunLimits:
        """Learn from records of the baseline, in order of time."""
        limits = np.repeat(FEWEST[:, np.newaxis], values.shape[1], axis=1)
        seen = values[~np.isnan(values).all(axis=1)]
        last = np.full(values.shape[1], np.nan)
        for column, series in enumerate(seen.T):
            known = np.flatnonzero(~np.isnan(series))
            if not known.size:
                continue
            last[column] = series[known[-1]]
            lengths = [np.diff(known) - 1, equal_runs(series[known])[1]]
            least = [max(FEWEST[MISSING], round(per_day)), FEWEST[REPEATED]]
            for kind, runs in enumerate(lengths):
                runs = np.sort(runs[runs > kind])[::-1]
                longest, usual = runs[0] if len(runs) else 0, runs[USUAL_RANK - 1] if len(runs) >= USUAL_RANK else 0
                usually = min(TIMES_LONGEST[kind] * longest, TIMES_USUAL[kind] * usual)
                has_gaps = kind == MISSING and longest > 0
                limits[kind, column] = max((1 + has_gaps) * least[kind], int(np.ceil(usually)))
        return cls(limits, last)


@dataclass(frozen=True)
class WatchState:
    """What the watch remembers: current runs, daily means of the last months, evidence, faults."""

    runs: Runs
    days: Days
    means: Array
    departures: Array
    exchanged: Array
    exchanged_since: NDArray[np.int64]
    faults: SensorFaults


@dataclass(frozen=True)
class Watched:
    """Records without what sensors at fault show, and what became of their values.

    ``held`` are responses that were set aside although the structure may have moved them, (n_records, n_responses).
    ``notes`` say of each record what was left out, ``n_left_out`` how many of its values.
    """

    T: pd.DataFrame
    F: pd.DataFrame
    held: NDArray[np.bool_]
    notes: list[str]
    n_left_out: Counts


@dataclass(frozen=True)
class Dispute:
    """Thermometers of which one is wrong, it is not known which, by their columns; and since when, in nanoseconds."""

    rivals: tuple[tuple[Hashable, ...], ...]
    since: int


@dataclass(frozen=True)
class SensorWatch:
    """Watches thermometers and responses in service, and distinguishes faults of sensors from damage where data can.

    Damage moves no thermometer: one that departs from what the others predict is at fault, unless most depart at once,
    as in weather that the baseline does not have. A response that moves may be damaged: it is set aside only where no
    damage explains what it shows. References check thermometers and fill their gaps.

    Make one by `of`; the state is immutable and small, and what it says depends on complete days alone.
    """

    sensors: list[Hashable]
    columns: list[list[int]]
    is_reference: NDArray[np.bool_]
    modes: list[Hashable]
    units: list[str]
    zone: str
    weather: Plausible
    run_limits: RunLimits
    thermometers: Thermometers | None
    expected: Responses

    @classmethod
    def of(
        cls,
        T: pd.DataFrame,
        F: pd.DataFrame,
        *,
        reference: Sequence[Hashable] = (),
        units: Mapping[Hashable, str] | None = None,
        per_year: float = 0.1,
    ) -> SensorWatch:
        """Learn from the baseline; lags of a sensor may have columns of their own.

        ``reference`` names columns of T, ``units`` are texts by column. ``per_year`` offsets and drifts of healthy
        thermometers may be reported in a year, over all of them, and a
        third of it with references.
        """
        by_sensor = columns_by_sensor(T)
        order = np.argsort(T.index.asi8, kind="stable")
        stamps = T.index[order]
        columns = list(by_sensor.values())
        temperatures = as_floats(T)[order][:, [own[0] for own in columns]]
        responses = as_floats(F)[order]
        is_reference = np.array([sensor in set(reference) for sensor in by_sensor], dtype=bool)
        texts = [dict(units or {}).get(name, "") for name in (*by_sensor, *F.columns)]
        per_day = len(stamps) / max(len(np.unique(local_days(stamps))), 1)
        return cls(
            list(by_sensor),
            columns,
            is_reference,
            list(F.columns),
            texts,
            "" if stamps.tz is None else str(stamps.tz),
            Plausible.of_weather(temperatures),
            RunLimits.of(np.hstack([temperatures, responses]), per_day),
            Thermometers.of(stamps, temperatures, per_year / (RARER if is_reference.any() else 1.0)),
            Responses.of(temperatures, responses, stamps, texts[len(by_sensor) :]),
        )

    def start(self) -> WatchState:
        n_sensors, n_pairs = len(self.sensors), len(self.expected.pairs)
        return WatchState(
            Runs.none(self.run_limits.last),
            np.empty(0, dtype=np.int64),
            np.empty((0, n_sensors)),
            np.empty((4, 0, n_sensors)),
            np.zeros(n_pairs),
            np.zeros(n_pairs, dtype=np.int64),
            SensorFaults(),
        )

    def faults(self, state: WatchState) -> pd.DataFrame:
        """Faults so far: ``column``, ``kind``, ``since``, ``detected``, ``until`` (NaT while it lasts), ``detail``."""
        return state.faults.table([*self.sensors, *self.modes], self.zone, self.units)

    def dispute(self, state: WatchState, names: Sequence[Hashable]) -> Dispute | None:
        """The thermometers that contradict each other, by the names of all columns of T."""
        for fault in state.faults.lasting("disagree"):
            rivals = (fault.column, fault.other)
            return Dispute(tuple(tuple(names[k] for k in self.columns[one]) for one in rivals), fault.since)
        return None

    def masked(self, state: WatchState, T: pd.DataFrame, F: pd.DataFrame, acknowledged: Sequence[int] = ()) -> Watched:
        """Records without what sensors at fault show: NaN there, and exchanged responses back in place.

        What has been ``acknowledged`` as a fault of a sensor, at times in nanoseconds, is not held afterwards.
        """
        n_sensors, own = len(self.sensors), list(map(itemgetter(0), self.columns))
        temperatures, responses = as_floats(T).copy(), self._in_place(state.faults, as_floats(F))
        impossible, far, _, expected = self._evaluated(temperatures[:, own], responses)
        given = np.hstack([temperatures[:, own], responses])
        out = self._left_out(state.faults)
        removed = (np.hstack([impossible, far]) | out) & ~np.isnan(given)
        held = self._held(state, ~np.isnan(responses), far, T.index.as_unit("ns").asi8, acknowledged)
        notes = self._notes(state.faults, given, np.hstack([impossible, far]), held, expected)
        for sensor, columns in enumerate(self.columns):
            temperatures[removed[:, sensor], columns[0]] = np.nan
            if out[sensor]:
                temperatures[:, columns] = np.nan
        if self.thermometers is not None and self.is_reference.any():
            filled = self.thermometers.filled(T.index, temperatures[:, own])
            temperatures[:, own] = np.where(np.isnan(temperatures[:, own]), filled, temperatures[:, own])
        kept = T.columns[~np.isin(np.arange(T.shape[1]), [own[n] for n in np.flatnonzero(self.is_reference)])]
        responses = np.where(removed[:, n_sensors:], np.nan, responses)
        return Watched(frame_like(T, temperatures)[kept], frame_like(F, responses), held, notes, removed.sum(1))

    def _held(
        self,
        state: WatchState,
        seen: NDArray[np.bool_],
        far: NDArray[np.bool_],
        moments: Counts,
        acknowledged: Sequence[int],
    ) -> NDArray[np.bool_]:
        n_sensors, of_mode = len(self.sensors), {}
        for column, fault in state.faults.left_out().items():
            if column >= n_sensors and fault.kind in HELD:
                of_mode[column - n_sensors] = fault
        is_fault = np.isin(np.arange(len(self.modes)), list(of_mode))
        run, lengths = state.runs.counts[IMPLAUSIBLE, n_sensors:], np.zeros(far.shape, dtype=np.int64)
        if far.any() or run.any():
            for row in range(len(far)):
                run = lengths[row] = run_of(run, seen[row], far[row])
        held = (lengths > 0) | is_fault
        for mode, fault in of_mode.items():
            said = [time for time in acknowledged if time >= fault.since]
            if said:
                held[moments > min(said), mode] = False
        return held

    def _notes(
        self,
        faults: SensorFaults,
        given: Array,
        far: NDArray[np.bool_],
        held: NDArray[np.bool_],
        expected: Array,
    ) -> list[str]:
        """What was left out of each record, and why."""
        names, n_sensors = list(map(str, (*self.sensors, *self.modes))), len(self.sensors)
        out = self._left_out(faults)
        lasting = faults.notes(names, self.zone)
        notes = ["; ".join(lasting)] * len(given)
        went_missing = np.isnan(given[:, n_sensors:]) & held & ~out[n_sensors:]
        for row in np.flatnonzero((far & ~out).any(axis=1) | went_missing.any(axis=1)):
            parts = [
                f"{names[k]} is {_quantity(given[row, k], self.units[k])}"
                + (
                    f", expected about {_quantity(expected[row, k - n_sensors], self.units[k])}"
                    if k >= n_sensors
                    else ""
                )
                + ": implausible, left out"
                for k in np.flatnonzero(far[row] & ~out)
            ]
            parts += [
                f"{names[n_sensors + k]} was implausible before it went missing"
                for k in np.flatnonzero(went_missing[row])
            ]
            notes[row] = "; ".join([*parts, *lasting])
        return notes

    def advance(self, state: WatchState, T_day: pd.DataFrame, F_day: pd.DataFrame) -> WatchState:
        """The state after one complete day with these records, if any."""
        if not len(T_day):
            return state
        stamps = T_day.index
        day = int(local_days(stamps[:1])[0])
        moments = stamps.as_unit("ns").asi8
        temperatures = as_floats(T_day)[:, list(map(itemgetter(0), self.columns))]
        midnight, before = int(self._midnight(day)), state.faults
        impossible, _, rest, expected = self._evaluated(temperatures, self._in_place(before, as_floats(F_day)))
        state = self._with_exchanges(state, rest, expected, midnight)
        responses = self._in_place(state.faults, as_floats(F_day))
        far = np.hstack([impossible, self._evaluated(temperatures, responses)[1]])
        state = replace(state, runs=state.runs.after(moments, np.hstack([temperatures, responses]), far))
        state = self._with_runs(state, midnight)
        if self.thermometers is None:
            return state
        means = self.thermometers.daily_means(stamps, np.where(impossible, np.nan, temperatures))
        kept = state.days > day - LONGEST
        departures = self.thermometers.departures(means, self._trusted(state.faults))
        state = replace(
            state,
            days=np.append(state.days[kept], day),
            means=np.vstack([state.means[kept], means]),
            departures=np.concatenate([state.departures[:, kept], departures], axis=1),
        )
        if not np.array_equal(self._trusted(state.faults), self._trusted(before)):
            state = self._departing(state)
        return self._with_departures(self._without_ended(state, midnight), midnight)

    def _midnight(self, day: int) -> np.int64:
        stamp = pd.Timestamp(day * DAY_NS)
        return np.int64(
            (stamp.tz_localize(self.zone, nonexistent="shift_forward", ambiguous=True) if self.zone else stamp).value
        )

    def _evaluated(
        self, temperatures: Array, responses: Array
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Array, Array]:
        """Impossible temperatures, implausible responses, these minus the expected ones, and the expected ones."""
        impossible = self.weather.implausible(temperatures)
        rest, expected = self.expected.residuals(np.where(impossible, np.nan, temperatures), responses)
        return impossible, self.expected.implausible(responses, rest), rest, expected

    def _in_place(self, faults: SensorFaults, responses: Array) -> Array:
        """Responses with exchanged ones back in their columns."""
        responses = responses.copy()
        for fault in faults.lasting("swapped"):
            pair = np.array([fault.column, fault.other]) - len(self.sensors)
            responses[:, pair] = responses[:, pair[::-1]]
        return responses

    def _with_exchanges(self, state: WatchState, rest: Array, expected: Array, midnight: int) -> WatchState:
        """Modes that are exchanged from now on, or no longer."""
        odds = self.expected.odds_of_exchange(rest, expected)
        evidence = np.maximum(state.exchanged + odds, 0.0)
        since = np.where((state.exchanged == 0) & (evidence > 0), midnight, state.exchanged_since)
        faults = state.faults
        for pair in np.flatnonzero(evidence > CERTAIN):
            first, second = (len(self.sensors) + mode for mode in self.expected.pairs[pair])
            known = [one for one in faults.lasting("swapped") if {first, second} == {one.column, one.other}]
            if known:
                faults = faults.changed(known[0], until=int(since[pair]))
            else:
                faults = faults.opened(Fault("swapped", first, int(since[pair]), midnight, second))
            evidence[pair] = 0.0
        return replace(state, exchanged=evidence, exchanged_since=since, faults=faults)

    def _with_runs(self, state: WatchState, midnight: int) -> WatchState:
        faults, runs = state.faults, state.runs
        is_run = runs.counts >= self.run_limits.limits
        out = faults.left_out()
        for column in sorted({*np.flatnonzero(is_run.any(axis=0)).tolist(), *out}):
            fault = out.get(column)
            kind = next((name for name, row in KINDS_OF_RUNS.items() if is_run[row, column]), None)
            known = None if fault is None else fault.kind
            if known == kind:
                continue
            if known in KINDS_OF_RUNS:
                faults = faults.changed(fault, until=midnight)
                state = self._forgotten(state, column, int(state.days[-1]) + 1 if len(state.days) else 0)
                known = None
            if kind is not None:
                if known is not None:  # an offset turns out to be something else
                    faults = faults.changed(fault, until=midnight)
                since = int(runs.since[KINDS_OF_RUNS[kind], column])
                faults = faults.opened(Fault(kind, column, since, midnight, size=float(runs.last[column])))
        return replace(state, faults=faults)

    def _forgotten(self, state: WatchState, column: int, before: int) -> WatchState:
        """Without a thermometer's daily means before a day, on which its fault ended."""
        if column >= len(self.sensors):
            return state
        means = state.means.copy()
        means[state.days < before, column] = np.nan
        return replace(state, means=means)

    def _departing(self, state: WatchState) -> WatchState:
        """With what each thermometer shows beside those that can be trusted."""
        return replace(state, departures=self.thermometers.departures(state.means, self._trusted(state.faults)))

    def _trusted(self, faults: SensorFaults) -> NDArray[np.bool_]:
        return ~self._left_out(faults)[: len(self.sensors)]

    def _left_out(self, faults: SensorFaults) -> NDArray[np.bool_]:
        return np.isin(np.arange(len(self.sensors) + len(self.modes)), list(faults.left_out()))

    def _change(self, state: WatchState, sensor: int) -> Change | None:
        """The most likely offset or drift of a thermometer, whatever it amounts to; None with too few days."""
        departures = Departures(state.days, *state.departures[:, :, sensor])
        return self.thermometers.noises[sensor].change(departures)

    def _is_fault(self, sensor: int, change: Change | None) -> bool:
        if change is None or change.n_days < LEAST_DAYS:
            return False
        return change.z > self.thermometers.noises[sensor].limit and abs(change.size) > A_DEGREE

    def _without_ended(self, state: WatchState, midnight: int) -> WatchState:
        """Offsets and drifts that have ended are closed; those that last are estimated again."""
        for fault in state.faults.lasting(*DEPARTURES):
            faults = state.faults
            sensor, detected = fault.column, fault.detected
            after = state.days * DAY_NS > detected
            departures = Departures(state.days, *state.departures[:, :, sensor])
            before = departures.rows(after & (state.days <= state.days[-1] - RECENT)).known()
            level = fault.size if len(before.days) < RECENT else np.median(before.values * before.deviations)
            noise = self.thermometers.noises[sensor]
            odds, end = noise.for_no_change(departures.rows(after), float(level))
            if odds > ENDED and state.days[-1] - end >= LEAST_DAYS - 1:
                until = int(self._midnight(end))
                state = replace(state, faults=faults.changed(fault, until=until))
                state = self._departing(self._forgotten(state, sensor, end))
            elif midnight - detected < LONGEST * DAY_NS / 2 and fault.kind != "disagree":
                found = self._change(state, sensor)
                if found is not None and self._is_fault(sensor, found):
                    state = replace(state, faults=faults.changed(fault, **self._described(found)))
        return state

    def _described(self, change: Change) -> dict[str, Any]:
        kind = "drift" if change.rate else "offset"
        return {"kind": kind, "since": int(self._midnight(change.first)), "size": change.size, "rate": change.rate}

    def _with_departures(self, state: WatchState, midnight: int) -> WatchState:
        """A thermometer that departs from the others from now on, at most one a day; or that it is not known which."""
        changes = self._changes(state)
        detected = {sensor: found for sensor, found in changes.items() if self._is_fault(sensor, found)}
        if not detected or len(changes) < 2:
            return state
        worst = max(detected, key=lambda sensor: self._blame(sensor, detected[sensor]))
        found = self._described(detected[worst])
        without = self._departing(
            replace(state, faults=state.faults.opened(Fault(column=worst, detected=midnight, **found)))
        )
        left = self._changes(without)
        also = [sensor for sensor in left if self._is_fault(sensor, left[sensor])]
        blame = self._blame(worst, detected[worst])
        rivals = [s for s in left if s not in also and self._blame(s, changes[s]) + 2 * CLEAR > blame]
        n_departing = 1 + len(also) + len(state.faults.lasting("offset", "drift"))
        is_clear = len(changes) > LEAST_OTHERS and 2 * n_departing < len(self.sensors)
        if not self.is_reference[worst] and any(self.is_reference[sensor] for sensor in set(changes) - {worst, *also}):
            is_clear |= n_departing == 1
        if is_clear and not rivals:
            faults = without.faults
            for fault in faults.lasting("disagree"):  # the one at fault has been found
                faults = faults.changed(fault, until=midnight)
            return replace(without, faults=faults)
        if state.faults.lasting("disagree") or (is_clear and detected[worst].n_days < RECENT):
            return state
        other = max(set(changes) - {worst}, key=lambda sensor: changes[sensor].weight)
        found |= {"kind": "disagree", "rate": 0.0}
        return replace(state, faults=state.faults.opened(Fault(column=worst, other=other, detected=midnight, **found)))

    def _blame(self, sensor: int, change: Change) -> float:
        """Twice the logarithm of the odds of a change; a reference is less likely at fault than a thermometer."""
        return change.weight**2 - 2 * REFERENCE * CLEAR * float(self.is_reference[sensor])

    def _changes(self, state: WatchState) -> dict[int, Change]:
        """The most likely change of each thermometer that is not left out and has a value."""
        free = np.flatnonzero(self._trusted(state.faults) & ~np.isnan(state.means[-1]))
        return {int(sensor): found for sensor in free if (found := self._change(state, sensor)) is not None}


def _quantity(value: float, unit: str) -> str:
    return f"{value:.2g} {unit}".rstrip()
