"""The watch on sensors: from day to day, which are at fault."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, as_floats
from skthermo._tables.frames import columns_by_sensor, frame_like
from skthermo._tables.times import DAY_NS
from skthermo.monitoring.sensors._changes import LEAST_DAYS, LONGEST, Change, Days, Departures
from skthermo.monitoring.sensors._faults import DEPARTURES, SensorFaults
from skthermo.monitoring.sensors._modes import CERTAIN, Modes
from skthermo.monitoring.sensors._thermometers import Thermometers, local_days
from skthermo.preprocessing.checks import Plausible, equal_runs

A_DEGREE = 1.0  # below which thermometers may depart without a fault
LEAST_OTHERS = 2  # thermometers that tell which one is at fault
CLEAR = 4.6  # logarithm of the odds that one thermometer is at fault, against each other one
ENDED = 7.0  # logarithm of the odds that an offset or a drift has ended
RECENT = 7  # days that may already be without a fault, or not tell yet which thermometer has it
Counts = NDArray[np.int64]
MISSING, REPEATED, ABSURD = range(3)
FEWEST = np.array([3, 5, 3])  # records of a run of each kind that may be a fault
USUAL_RANK = 3  # the usual run is the longest but so many: faults of the baseline are no rule
TIMES_LONGEST = (1.7, 4.0)  # times the longest run of the baseline that faults exceed
TIMES_USUAL = (3.0, 4.0)  # times its usual run
KINDS_OF_RUNS = {"implausible": ABSURD, "stuck": REPEATED, "dead": MISSING}


@dataclass(frozen=True)
class Runs:
    """Last value of each column, and number of records and first stamp (ns) of its current run of each kind."""

    last: Array
    counts: Counts
    since: Counts

    @classmethod
    def none(cls, last: Array) -> Runs:
        """No run yet, after these last values."""
        return cls(last, np.zeros((3, len(last)), dtype=np.int64), np.zeros((3, len(last)), dtype=np.int64))

    def after(self, stamps: Counts, values: Array, absurd: NDArray[np.bool_]) -> Runs:
        """Runs after more records; those without any value tell nothing of a single column."""
        runs = self
        for stamp, row, is_absurd in zip(stamps, values, absurd, strict=True):
            runs = runs._next(stamp, row, is_absurd)
        return runs

    def _next(self, stamp: np.int64, row: Array, absurd: NDArray[np.bool_]) -> Runs:
        """Runs after one more record."""
        seen = ~np.isnan(row)
        if not seen.any():
            return self
        begun = ~np.isnan(self.last)
        counts = np.array(
            [
                np.where(seen | ~begun, 0, self.counts[MISSING] + 1),
                np.where(seen, np.where(row == self.last, self.counts[REPEATED] + 1, 1), self.counts[REPEATED]),
                np.where(seen, np.where(absurd, self.counts[ABSURD] + 1, 0), self.counts[ABSURD]),
            ]
        )
        fresh = (counts == 1) & ((self.counts != 1) | np.array([~seen, seen, seen]))
        return Runs(np.where(seen, row, self.last), counts, np.where(fresh, stamp, self.since))


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
class SensorWatch:
    """Watches thermometers and modes in service, and tells faults of sensors from damage where the data can.

    Damage moves no thermometer: one that departs from what the others foretell is at fault, unless most depart at once,
    as in weather that the baseline does not have. A mode that moves may be damaged: it is left out only where no damage
    explains what it shows.

    Make one by `of`; the state is immutable and small, and what it says depends on complete days alone.
    """

    sensors: list[Hashable]
    columns: list[list[int]]
    modes: list[Hashable]
    zone: str
    weather: Plausible
    run_limits: RunLimits
    thermometers: Thermometers | None
    expected: Modes

    @classmethod
    def of(cls, T: pd.DataFrame, F: pd.DataFrame, *, per_year: float = 0.1) -> SensorWatch:
        """Learn from the baseline; lags of a sensor may have columns of their own.

        ``per_year`` offsets and drifts of healthy thermometers may be reported in a year, over all of them.
        """
        by_sensor = columns_by_sensor(T)
        order = np.argsort(T.index.asi8, kind="stable")
        stamps = T.index[order]
        columns = list(by_sensor.values())
        temperatures = as_floats(T)[order][:, [own[0] for own in columns]]
        frequencies = as_floats(F)[order]
        per_day = len(stamps) / max(len(np.unique(local_days(stamps))), 1)
        return cls(
            list(by_sensor),
            columns,
            list(F.columns),
            "" if stamps.tz is None else str(stamps.tz),
            Plausible.of_weather(temperatures),
            RunLimits.of(np.hstack([temperatures, frequencies]), per_day),
            Thermometers.of(stamps, temperatures, per_year),
            Modes.of(temperatures, frequencies, stamps),
        )

    def start(self) -> WatchState:
        """The state before the first day."""
        n_sensors, n_pairs = len(self.sensors), len(self.expected.pairs())
        return WatchState(
            Runs.none(self.run_limits.last),
            np.empty(0, dtype=np.int64),
            np.empty((0, n_sensors)),
            np.empty((4, 0, n_sensors)),
            np.zeros(n_pairs),
            np.zeros(n_pairs, dtype=np.int64),
            SensorFaults.none(),
        )

    def faults(self, state: WatchState) -> pd.DataFrame:
        """Faults so far: ``column``, ``kind``, ``since``, ``detected``, ``until`` (NaT while it lasts), ``detail``."""
        return state.faults.table([*self.sensors, *self.modes], self.zone)

    def masked(self, state: WatchState, T: pd.DataFrame, F: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Records without what sensors at fault show: NaN there, and exchanged modes back in place."""
        temperatures, frequencies = as_floats(T).copy(), self._in_place(state.faults, as_floats(F))
        own = [columns[0] for columns in self.columns]
        impossible, absurd, _, _ = self._evaluated(temperatures[:, own], frequencies)
        out = self._left_out(state.faults)
        for sensor, columns in enumerate(self.columns):
            temperatures[impossible[:, sensor], columns[0]] = np.nan
            if out[sensor]:
                temperatures[:, columns] = np.nan
        frequencies = np.where(absurd | out[len(self.sensors) :], np.nan, frequencies)
        return frame_like(T, temperatures), frame_like(F, frequencies)

    def advance(self, state: WatchState, T_day: pd.DataFrame, F_day: pd.DataFrame) -> WatchState:
        """The state after one complete day with these records, if any."""
        if not len(T_day):
            return state
        stamps = T_day.index
        day = int(local_days(stamps[:1])[0])
        moments = stamps.as_unit("ns").asi8
        temperatures = as_floats(T_day)[:, [own[0] for own in self.columns]]
        frequencies = self._in_place(state.faults, as_floats(F_day))
        impossible, absurd, rest, expected = self._evaluated(temperatures, frequencies)
        runs = state.runs.after(moments, np.hstack([temperatures, frequencies]), np.hstack([impossible, absurd]))
        midnight = int(self._midnight(day))
        before, state = state.faults, replace(state, runs=runs)
        state = self._with_exchanges(state, rest, expected, midnight)
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
        """Beginning of a day, in nanoseconds."""
        stamp = pd.Timestamp(day * DAY_NS)
        return np.int64(
            (stamp.tz_localize(self.zone, nonexistent="shift_forward", ambiguous=True) if self.zone else stamp).value
        )

    def _evaluated(
        self, temperatures: Array, frequencies: Array
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Array, Array]:
        """Impossible temperatures, absurd frequencies, and logarithms of frequencies beside expected ones and these."""
        impossible = self.weather.implausible(temperatures)
        rest, expected = self.expected.logarithms(np.where(impossible, np.nan, temperatures), frequencies)
        return impossible, self.expected.absurd(rest), rest, expected

    def _in_place(self, faults: SensorFaults, frequencies: Array) -> Array:
        """Frequencies with exchanged modes back in their columns."""
        frequencies = frequencies.copy()
        for fault in faults.lasting("swapped"):
            pair = np.array([faults.column[fault], faults.other[fault]]) - len(self.sensors)
            frequencies[:, pair] = frequencies[:, pair[::-1]]
        return frequencies

    def _with_exchanges(self, state: WatchState, rest: Array, expected: Array, midnight: int) -> WatchState:
        """Modes that are exchanged from now on, or no longer."""
        odds = self.expected.odds_of_exchange(rest, expected)
        evidence = np.maximum(state.exchanged + odds, 0.0)
        since = np.where((state.exchanged == 0) & (evidence > 0), midnight, state.exchanged_since)
        faults = state.faults
        for pair in np.flatnonzero(evidence > CERTAIN):
            first, second = (len(self.sensors) + mode for mode in self.expected.pairs()[pair])
            known = [
                fault
                for fault in faults.lasting("swapped")
                if {first, second} == {faults.column[fault], faults.other[fault]}
            ]
            if known:
                faults = faults.with_values(int(known[0]), until=since[pair])
            else:
                faults = faults.opened("swapped", first, since[pair], midnight, other=second)
            evidence[pair] = 0.0
        return replace(state, exchanged=evidence, exchanged_since=since, faults=faults)

    def _with_runs(self, state: WatchState, midnight: int) -> WatchState:
        """Columns that are dead, stuck or absurd, or no longer."""
        faults, runs = state.faults, state.runs
        is_run = runs.counts >= self.run_limits.limits
        out = faults.left_out(is_run.shape[1])
        for column in np.flatnonzero(is_run.any(axis=0) | (out >= 0)):
            fault = int(out[column])
            kind = next((name for name, row in KINDS_OF_RUNS.items() if is_run[row, column]), None)
            known = str(faults.kind[fault]) if fault >= 0 else None
            if known == kind:
                continue
            if known in KINDS_OF_RUNS:
                faults = faults.with_values(fault, until=midnight)
                state = self._forgotten(state, column, int(state.days[-1]) + 1 if len(state.days) else 0)
                known = None
            if kind is not None:
                if known is not None:  # an offset turns out to be something else
                    faults = faults.with_values(fault, until=midnight)
                since = int(runs.since[KINDS_OF_RUNS[kind], column])
                faults = faults.opened(kind, column, since, midnight, size=float(runs.last[column]))
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
        """Thermometers that are not left out."""
        return ~self._left_out(faults)[: len(self.sensors)]

    def _left_out(self, faults: SensorFaults) -> NDArray[np.bool_]:
        """Thermometers and modes that are left out."""
        return faults.left_out(len(self.sensors) + len(self.modes)) >= 0

    def _change(self, state: WatchState, sensor: int) -> Change | None:
        """The most likely offset or drift of a thermometer, whatever it amounts to; None with too few days."""
        departures = Departures(state.days, *state.departures[:, :, sensor])
        return self.thermometers.noises[sensor].change(departures)

    def _is_fault(self, sensor: int, change: Change | None) -> bool:
        """Whether noise does not explain a change, and it matters."""
        if change is None or change.n_days < LEAST_DAYS:
            return False
        return change.z > self.thermometers.noises[sensor].limit and abs(change.size) > A_DEGREE

    def _without_ended(self, state: WatchState, midnight: int) -> WatchState:
        """Offsets and drifts that have ended are closed; those that last are estimated again."""
        for fault in state.faults.lasting(*DEPARTURES):
            faults = state.faults
            sensor, detected = int(faults.column[fault]), int(faults.detected[fault])
            after = state.days * DAY_NS > detected
            departures = Departures(state.days, *state.departures[:, :, sensor])
            before = departures.rows(after & (state.days <= state.days[-1] - RECENT)).known()
            level = faults.size[fault] if len(before.days) < RECENT else np.median(before.values * before.deviations)
            noise = self.thermometers.noises[sensor]
            odds, end = noise.for_no_change(departures.rows(after), float(level))
            if odds > ENDED and state.days[-1] - end >= LEAST_DAYS - 1:
                until = int(self._midnight(end))
                state = replace(state, faults=faults.with_values(fault, until=until))
                state = self._departing(self._forgotten(state, sensor, end))
            elif midnight - detected < LONGEST * DAY_NS / 2 and faults.kind[fault] != "disagree":
                found = self._change(state, sensor)
                if found is not None and self._is_fault(sensor, found):
                    state = replace(state, faults=faults.with_values(fault, **self._described(found)))
        return state

    def _described(self, change: Change) -> dict[str, Any]:
        """A change in the words of `SensorFaults`."""
        kind = "drift" if change.rate else "offset"
        return {"kind": kind, "since": int(self._midnight(change.first)), "size": change.size, "rate": change.rate}

    def _with_departures(self, state: WatchState, midnight: int) -> WatchState:
        """A thermometer that departs from the others from now on, at most one a day; or that it is not known which."""
        changes = self._changes(state)
        detected = {sensor: found for sensor, found in changes.items() if self._is_fault(sensor, found)}
        if not detected or len(changes) < 2:
            return state
        worst = max(detected, key=lambda sensor: detected[sensor].weight)
        found = self._described(detected[worst])
        without = self._departing(replace(state, faults=state.faults.opened(column=worst, detected=midnight, **found)))
        left = self._changes(without)
        also = [sensor for sensor in left if self._is_fault(sensor, left[sensor])]
        rivals = [
            sensor
            for sensor in left
            if sensor not in also and changes[sensor].weight ** 2 + 2 * CLEAR > detected[worst].weight ** 2
        ]
        n_departing = 1 + len(also) + len(state.faults.lasting("offset", "drift"))
        is_clear = len(changes) > LEAST_OTHERS and 2 * n_departing < len(self.sensors)
        if is_clear and not rivals:
            faults = without.faults
            for fault in faults.lasting("disagree"):  # the one at fault has been found
                faults = faults.with_values(fault, until=midnight)
            return replace(without, faults=faults)
        if state.faults.lasting("disagree") or (is_clear and detected[worst].n_days < RECENT):
            return state
        other = max(set(changes) - {worst}, key=lambda sensor: changes[sensor].weight)
        found |= {"kind": "disagree", "rate": 0.0}
        return replace(state, faults=state.faults.opened(column=worst, other=other, detected=midnight, **found))

    def _changes(self, state: WatchState) -> dict[int, Change]:
        """The most likely change of each thermometer that is not left out and has a value."""
        free = np.flatnonzero(self._trusted(state.faults) & ~np.isnan(state.means[-1]))
        return {int(sensor): found for sensor in free if (found := self._change(state, sensor)) is not None}
