"""Faults of sensors in service: dead, stuck, off or drifting thermometers, responses that no damage explains."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array, as_floats, median, robust_deviation
from skthermo._core.frames import DAY, DAY_NS, YEAR, as_index, columns_by_sensor, frame_like
from skthermo.preprocessing.checks import Plausible, equal_runs
from skthermo.preprocessing.folds import out_of_fold
from skthermo.residuals.gaussian import Gaussian

Counts = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Fault:
    """Position of its column, the other one where two are exchanged (else -1), times in nanoseconds, None as it lasts.

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
            "offset": f"{self.size:+.1f} degrees beside the other thermometers; left out",
            "drift": f"{self.rate * YEAR.days / 12:+.2f} degrees a month beside the other thermometers; left out",
            "swapped": f"its values are in the column of {other!r}; put back in place",
        }[self.kind]


@dataclass(frozen=True)
class WatchState:
    """Records of the last days, daily means of thermometers over the last months, and all faults as they were found."""

    stamps: Counts
    days: Counts
    values: Array
    days_of_means: Counts
    means: Array
    faults: tuple[Fault, ...] = ()

    def lasting(self, *kinds: str) -> list[Fault]:
        return [fault for fault in self.faults if fault.until is None and fault.kind in kinds]

    def left_out(self) -> dict[int, Fault]:
        """By position of each column that is left out, the fault for which it is."""
        return {fault.column: fault for fault in self.lasting("dead", "stuck", "implausible", "offset", "drift")}

    def opened(self, *args: Any, **values: Any) -> WatchState:
        return replace(self, faults=(*self.faults, Fault(*args, **values)))

    def changed(self, fault: Fault, **values: Any) -> WatchState:
        return replace(self, faults=tuple(replace(one, **values) if one is fault else one for one in self.faults))

    def in_place(self, values: Array) -> Array:
        """Values with exchanged ones back in their columns."""
        order = np.arange(values.shape[1])
        for fault in self.lasting("swapped"):
            order[[fault.column, fault.other]] = order[[fault.other, fault.column]]
        return values[:, order]


@dataclass(frozen=True)
class Watched:
    """Records without what sensors at fault show, and what became of their values.

    ``held`` are responses that were set aside although the structure may have moved them, (n_records, n_responses).
    ``notes`` say of each record what was left out, ``n_left_out`` how many of its values.
    """

    T: pd.DataFrame
    F: pd.DataFrame
    held: Mask
    notes: list[str]
    n_left_out: Counts


@dataclass(frozen=True)
class Thermometers:
    """Daily means of thermometers, each predicted from the others and, after a whole year, the season.

    ``known`` are the lowest and highest means of the baseline; ``limits``, (n_windows, n_thermometers), medians of
    departures that are beyond chance, of the `windows`.
    """

    together: Gaussian
    known: Array
    limits: Array

    @classmethod
    def fitted(cls, days: Counts, means: Array, least: float = 1.0, sigmas: float = 5.0) -> Thermometers:
        """Limits are so many standard deviations of a median, as far as the baseline itself goes, and a degree."""
        has_season = bool(days[-1] - days[0] >= 330)
        rows = np.hstack([means, harmonics(days)]) if has_season else means
        folds = days // 15 % 5 if has_season else np.arange(len(days)) * 5 // len(days)

        def learned(train: NDArray[np.intp]) -> Thermometers:
            found = Gaussian.fitted(rows[train][~np.isnan(means[train]).all(axis=1)])
            own = np.diag(1e-6 * np.diag(found.covariance) + 0.05**2)  # thermometers are not better than that
            known = np.array([f.reduce(means[train]) for f in (np.fmin, np.fmax)])
            return cls(Gaussian(found.mean, found.covariance + own), known, np.empty(0))

        def departures(train: NDArray[np.intp]) -> Any:
            part = learned(train)
            return lambda test: part.departures(days[test], means[test])

        rest = out_of_fold(departures, folds)
        found = np.array([windows(rest[max(stop - 40, 0) : stop]) for stop in range(1, len(rest) + 1)])
        spread = sigmas * robust_deviation(found.reshape(len(found), -1)).reshape(found.shape[1:])
        largest = 1.2 * np.nanmax(np.abs(found), axis=0, initial=0.0)
        return replace(learned(np.arange(len(days))), limits=np.fmax(np.fmax(spread, largest), least))

    def departures(self, days: Counts, means: Array, trusted: Mask | None = None) -> Array:
        """Daily means less what the other trusted thermometers predict; NaN where either has no value.

        In weather that the baseline does not have, only what goes beyond the prediction's own change by it counts.
        """
        n, found = means.shape[1], np.full(means.shape, np.nan)
        season = harmonics(days)[:, : len(self.together.mean) - n]
        for sensor in range(n):
            others = np.where(
                np.arange(n) == sensor, np.nan, means if trusted is None else np.where(trusted, means, np.nan)
            )
            has_others = ~np.isnan(others).all(axis=1)
            expected, within = (
                np.where(has_others, self.together.completed(np.hstack([one, season]))[0][:, sensor], np.nan)
                for one in (others, np.clip(others, *self.known))
            )
            rest, beyond = means[:, sensor] - expected, np.abs(expected - within) / 2
            found[:, sensor] = np.sign(rest) * np.maximum(np.abs(rest) - beyond, 0.0)
        return found


def harmonics(days: Counts) -> Array:
    """Two harmonics of the year."""
    angle = 2 * np.pi * days[:, np.newaxis] / (YEAR / DAY)
    return np.hstack([np.sin(angle), np.cos(angle), np.sin(2 * angle), np.cos(2 * angle)])


def windows(rest: Array) -> Array:
    """Medians of departures in the last 3, 7 and 30 days, and steps from the month before to the last 3 and 7 days.

    NaN where fewer than half of the days have a value, (n_windows, n_thermometers).
    """

    def typical(rows: Array, n_days: int) -> Array:
        is_known = (~np.isnan(rows)).sum(axis=0) > n_days / 2
        return np.where(is_known, median(rows) if len(rows) else np.nan, np.nan)

    last = {n_days: typical(rest[-n_days:], n_days) for n_days in (3, 7, 30)}
    return np.array([*last.values(), *(last[n] - typical(rest[-30 - n : -n], 30) for n in (3, 7))])


@dataclass(frozen=True)
class Responses:
    """Responses in their own units beside what the weather predicts.

    ``together`` is the distribution of temperatures and of responses in robust deviations from their ``centre``.
    ``limits`` are departures from which a value that moves alone is implausible: more than 25 robust deviations, a
    quarter of its level, and three times the departure that one value in a thousand of the baseline exceeds.
    ``deviations`` are those of daily medians, and ``pairs`` positions of responses of the same unit and size, which may
    be exchanged.
    """

    together: Gaussian
    centre: Array
    scatter: Array
    reach: Array
    limits: Array
    deviations: Array
    pairs: list[tuple[int, int]]

    @classmethod
    def fitted(cls, temperatures: Array, values: Array, days: Counts, units: Sequence[str]) -> Responses:
        centre, scatter = median(values), robust_deviation(values)
        least = 1e-4 * np.fmax(np.where(scatter > 0, scatter, np.abs(centre)), 1e-8)
        scatter = np.fmax(scatter, least)
        rows = np.hstack([temperatures, (values - centre) / scatter])
        found = Gaussian.fitted(rows[~np.isnan(rows).all(axis=1)])
        own = np.diag(1e-6 * np.maximum(np.diag(found.covariance), 1e-8))
        reach = np.array([f.reduce(values) for f in (np.fmin, np.fmax)])
        together = Gaussian(found.mean, found.covariance + own)
        bare = cls(together, centre, scatter, reach, scatter, scatter, [])
        rest = bare.residuals(temperatures, values)[0]
        usual = np.fmax(25 * robust_deviation(rest), 0.25 * np.abs(centre))
        limits = np.fmax(usual, 3 * np.nanquantile(np.abs(rest), 0.999, axis=0))
        deviations = np.fmax(robust_deviation(pd.DataFrame(rest).groupby(days).median().to_numpy()), least)
        sizes = np.fmax(np.abs(centre), scatter), scatter
        pairs = [
            (a, b)
            for a, b in combinations(range(len(centre)), 2)
            if units[a] == units[b] and all(max(size[a], size[b]) <= 10 * min(size[a], size[b]) for size in sizes)
        ]
        return replace(bare, limits=limits, deviations=deviations, pairs=pairs)

    def residuals(self, temperatures: Array, values: Array) -> tuple[Array, Array]:
        """Responses minus those that the weather predicts, and these."""
        rows = np.hstack([temperatures, np.full(values.shape, np.nan)])
        expected = self.centre + self.scatter * self.together.completed(rows)[0][:, temperatures.shape[1] :]
        expected = np.clip(np.where(np.isnan(expected), self.centre, expected), *self.reach)
        return values - expected, expected

    def implausible(self, values: Array, rest: Array) -> Mask:
        """Values farther from the prediction than damage explains while the others of their record stay.

        Whatever the others do, none is a thousand times as far, and none zero or below where the baseline is above.
        """
        size = np.abs(rest) / self.limits
        far, never = size > 1, (size > 1000) | ((values <= 0) & (self.reach[0] > 0))
        rows = far.any(axis=1) & (rest.shape[1] >= 3)
        alone = np.zeros(far.shape, dtype=bool)
        alone[rows] = far[rows] & (median(size[rows].T) < 0.2)[:, np.newaxis]
        return alone | never

    def exchanged(
        self, rest: Array, expected: Array, days: Counts, certain: float = 20.0
    ) -> list[tuple[int, int, int]]:
        """Pairs whose values of the last days are exchanged, and the first of these days.

        Both come much nearer to their places by it: one has risen and the other one fallen, by about their distance. No
        damage does that. A day adds at most 50 to the logarithm of the odds.
        """
        found = []
        for first, second in self.pairs:
            both, total = [first, second], 0.0
            for day in np.unique(days)[::-1]:
                today, places = (median(table[days == day][:, both]) for table in (rest, expected))
                if np.isnan(today).any():
                    continue
                gap = places[1] - places[0]
                here = today / self.deviations[both]
                there = np.array([today[1] + gap, today[0] - gap]) / self.deviations[both]
                if not (np.abs(there) < np.abs(here) / 2).all():
                    break
                total += min((here @ here - there @ there) / 2, 50.0)
                if total > certain:
                    found.append((first, second, int(day)))
                    break
        return found


@dataclass(frozen=True)
class SensorWatch:
    """Watches thermometers and responses in service, and distinguishes faults of sensors from damage where data can.

    Damage moves no thermometer: one that departs from the others' prediction is at fault if all others agree without
    it, and without no other one. A response that moves may be damaged: it is set aside only where no damage explains
    its values. References check thermometers and fill their gaps.

    The state is immutable, and what it says depends on complete days alone. ``runs``, (2, n_columns), are numbers of
    records from which missing or equal values are a fault.
    """

    sensors: list[Hashable]
    columns: list[list[int]]
    is_reference: Mask
    modes: list[Hashable]
    units: list[str]
    zone: str
    weather: Plausible
    runs: Counts
    per_day: float
    thermometers: Thermometers | None
    expected: Responses

    @classmethod
    def fitted(
        cls,
        T: pd.DataFrame,
        F: pd.DataFrame,
        *,
        reference: Sequence[Hashable] = (),
        units: Mapping[Hashable, str] | None = None,
    ) -> SensorWatch:
        """Learn from the baseline; lags of a sensor may have columns of their own.

        ``reference`` names columns of T, ``units`` are texts by column.
        """
        by_sensor, T, F = columns_by_sensor(T), T.sort_index(kind="stable"), F.sort_index(kind="stable")
        columns, days, n_sensors = list(by_sensor.values()), local_days(T.index), len(by_sensor)
        temperatures, responses = as_floats(T)[:, [own[0] for own in columns]], as_floats(F)
        texts = [dict(units or {}).get(name, "") for name in (*by_sensor, *F.columns)]
        n_days = len(np.unique(days))
        per_day, thermometers = len(days) / max(n_days, 1), None
        if n_sensors > 1 and n_days >= 3 * n_sensors + 5 and not np.isnan(temperatures).all(axis=0).any():
            thermometers = Thermometers.fitted(*means_by_day(days, temperatures, 0.3 * per_day))
        return cls(
            sensors=list(by_sensor),
            columns=columns,
            is_reference=np.array([sensor in set(reference) for sensor in by_sensor], dtype=bool),
            modes=list(F.columns),
            units=texts,
            zone="" if T.index.tz is None else str(T.index.tz),
            weather=Plausible.of_weather(temperatures),
            runs=run_limits(np.hstack([temperatures, responses]), per_day),
            per_day=per_day,
            thermometers=thermometers,
            expected=Responses.fitted(temperatures, responses, days, texts[n_sensors:]),
        )

    def start(self) -> WatchState:
        none, n_sensors = np.empty(0, np.int64), len(self.sensors)
        return WatchState(none, none, np.empty((0, n_sensors + len(self.modes))), none, np.empty((0, n_sensors)))

    def faults(self, state: WatchState) -> pd.DataFrame:
        """Faults so far: ``column``, ``kind``, ``since``, ``detected``, ``until`` (NaT while it lasts), ``detail``.

        One row a fault, two where two columns are exchanged.
        """
        names = [*self.sensors, *self.modes]
        rows = [
            (names[own], one.kind, one.since, one.detected, one.until, one.detail(names[other], self.units[own]))
            for one in state.faults
            for own, other in [(one.column, one.other), (one.other, one.column)][: 1 if one.other < 0 else 2]
        ]
        table = pd.DataFrame(rows, columns=["column", "kind", "since", "detected", "until", "detail"], dtype=object)
        stamps = ("since", "detected", "until")
        return table.assign(**{name: as_index(table[name].tolist(), self.zone) for name in stamps})

    def masked(self, state: WatchState, T: pd.DataFrame, F: pd.DataFrame, acknowledged: Sequence[int] = ()) -> Watched:
        """Records without what sensors at fault show: NaN there, and exchanged responses back in place.

        What has been ``acknowledged`` as a fault of a sensor, at times in nanoseconds, is not held afterwards.
        """
        n, own = len(self.sensors), [columns[0] for columns in self.columns]
        values, out = as_floats(T).copy(), state.left_out()
        given = state.in_place(np.hstack([values[:, own], as_floats(F)]))
        is_far, is_out = self._evaluated(given)[0], np.isin(np.arange(given.shape[1]), list(out))
        removed, held = (is_far | is_out) & ~np.isnan(given), is_far[:, n:].copy()
        for column, fault in out.items():
            if column >= n and fault.kind in ("stuck", "implausible"):
                said = [time for time in acknowledged if time >= fault.since]
                held[:, column - n] = T.index.as_unit("ns").asi8 <= min(said) if said else True
        kept = np.where(removed, np.nan, given)
        for sensor in np.flatnonzero(is_out[:n]):
            values[:, self.columns[sensor]] = np.nan
        values[:, own] = kept[:, :n]
        if self.is_reference.any():
            rows = np.hstack([kept[:, :n], np.full((len(kept), len(self.modes)), np.nan)])
            values[:, own] = self.expected.together.completed(rows)[0][:, :n]
        references = [
            k for columns, is_one in zip(self.columns, self.is_reference, strict=True) if is_one for k in columns
        ]
        inputs = frame_like(T, values)[T.columns.delete(references)]
        notes = self._notes(state, given, is_far & ~is_out)
        return Watched(inputs, frame_like(F, kept[:, n:]), held, notes, removed.sum(axis=1))

    def _notes(self, state: WatchState, given: Array, far: Mask) -> list[str]:
        """What was left out of each record, and why."""
        names = [*map(str, self.sensors), *map(str, self.modes)]
        lasting = [
            f"{names[one.column]} is left out ({one.kind} since {as_index([one.since], self.zone)[0]:%Y-%m-%d})"
            for one in state.left_out().values()
        ]
        lasting += [
            f"{names[one.column]} and {names[one.other]} are exchanged and were put back in place"
            for one in state.lasting("swapped")
        ]
        notes = ["; ".join(lasting)] * len(given)
        for row in np.flatnonzero(far.any(axis=1)):
            values = [f"{names[k]} is {given[row, k]:.4g} {self.units[k]}".rstrip() for k in np.flatnonzero(far[row])]
            notes[row] = "; ".join([f"{', '.join(values)}: implausible, left out", *lasting])
        return notes

    def advance(self, state: WatchState, T_day: pd.DataFrame, F_day: pd.DataFrame) -> WatchState:
        """The state after one complete day with these records, if any."""
        if not len(T_day):
            return state
        days, n = local_days(T_day.index), len(self.sensors)
        values = np.hstack([as_floats(T_day)[:, [columns[0] for columns in self.columns]], as_floats(F_day)])
        known = np.where(self.weather.implausible(values[:, :n]), np.nan, values[:, :n])
        day, mean = means_by_day(days, known, 0.3 * self.per_day)
        span = 5 + int(np.ceil(self.runs.max(initial=0) / self.per_day))
        recent, recent_means = state.days > days[-1] - span, state.days_of_means > days[-1] - 120
        state = WatchState(
            stamps=np.r_[state.stamps[recent], T_day.index.as_unit("ns").asi8],
            days=np.r_[state.days[recent], days],
            values=np.vstack([state.values[recent], values]),
            days_of_means=np.r_[state.days_of_means[recent_means], day],
            means=np.vstack([state.means[recent_means], mean]),
            faults=state.faults,
        )
        state = self._with_runs(self._with_exchanges(state))
        return state if self.thermometers is None else self._with_departures(self._without_ended(state))

    def _evaluated(self, values: Array) -> tuple[Mask, Array, Array]:
        """Which values are implausible, responses minus the expected ones, and the expected ones."""
        temperatures, responses = np.split(values, [len(self.sensors)], axis=1)
        impossible = self.weather.implausible(temperatures)
        rest, expected = self.expected.residuals(np.where(impossible, np.nan, temperatures), responses)
        return np.hstack([impossible, self.expected.implausible(responses, rest)]), rest, expected

    def _with_exchanges(self, state: WatchState) -> WatchState:
        """Modes that are exchanged from now on, or no longer."""
        n, since = len(self.sensors), max((one.detected for one in state.faults if one.kind == "swapped"), default=0)
        recent = (state.days > state.days[-1] - 5) & (state.stamps >= since)
        _, rest, expected = self._evaluated(state.in_place(state.values[recent]))
        for first, second, day in self.expected.exchanged(rest, expected, state.days[recent]):
            known = [one for one in state.lasting("swapped") if {one.column, one.other} == {n + first, n + second}]
            if known:
                state = state.changed(known[0], until=self._midnight(day))
            else:
                today = self._midnight(state.days[-1])
                state = state.opened("swapped", n + first, self._midnight(day), today, n + second)
        return state

    def _with_runs(self, state: WatchState) -> WatchState:
        """Columns that are dead, stuck or implausible from now on, or no longer."""
        is_given, out = ~np.isnan(state.values).all(axis=1), state.left_out()  # empty records tell nothing of a column
        values, stamps, today = (
            state.in_place(state.values[is_given]),
            state.stamps[is_given],
            self._midnight(state.days[-1]),
        )
        far = self._evaluated(values)[0]
        for column, series in enumerate(values.T):
            kind, first, size = self._run(series, far[:, column], self.runs[:, column])
            fault = out.get(column)
            known = fault.kind if fault is not None and fault.kind in ("dead", "stuck", "implausible") else None
            if known == kind:
                continue
            if fault is not None and (known or kind):
                state = state.changed(fault, until=today)
            if kind:
                state = state.opened(kind, column, int(stamps[first]), today, size=size)
        return state

    def _run(self, series: Array, is_far: Mask, limits: Counts) -> tuple[str | None, int, float]:
        """Kind of the run of values with which a column ends if it is a fault, its first place, and the last value."""
        known = np.flatnonzero(~np.isnan(series))
        last = known[-1] if len(known) else -1
        if len(series) - 1 - last >= limits[0]:
            return "dead", last + 1, 0.0
        if not len(known):
            return None, 0, 0.0
        n_far, n_equal = (
            int(np.append(is_other[known][::-1], True).argmax()) for is_other in (~is_far, series != series[last])
        )
        if n_far >= 3:
            return "implausible", known[-n_far], float(series[last])
        return ("stuck" if n_equal >= limits[1] else None), known[-n_equal], float(series[last])

    def _departures(self, state: WatchState, trusted: Mask) -> Array:
        """Departures of thermometers from what the trusted ones predict, without values of other faults."""
        means, days = state.means.copy(), state.days_of_means
        for fault in state.faults:
            if fault.column < len(self.sensors) and (fault.until is not None or fault.kind not in ("offset", "drift")):
                first, stop = (
                    local_days(as_index([time], self.zone))[0] for time in (fault.since, fault.until or 2**62)
                )
                means[(days >= first) & (days < stop), fault.column] = np.nan
        return self.thermometers.departures(days, means, trusted)

    def _without_ended(self, state: WatchState, n_days: int = 4) -> WatchState:
        """Thermometers that have come back to less than half of their departure for some days are used again.

        In its first two months, an offset that goes on may turn out to be a drift.
        """
        days, rest = state.days_of_means, self._departures(state, self._trusted(state))
        for fault in state.lasting("offset", "drift"):
            own = rest[:, fault.column]
            known = np.flatnonzero(~np.isnan(own) & (days * DAY_NS > fault.detected - DAY_NS))[-n_days:]
            if len(known) == n_days and (np.abs(own[known]) < abs(fault.size) / 2).all():
                state = state.changed(fault, until=self._midnight(days[known[0]]))
            elif (days[-1] - 60) * DAY_NS < fault.detected:
                state = state.changed(fault, **self._change(days, own))
        return state

    def _change(self, days: Counts, rest: Array) -> dict[str, Any]:
        """Offset or drift of a thermometer at fault: its first day, its size on the last one, and its rate in a day.

        The one of least squares, a drift where it explains clearly more; the rate of an offset is 0.
        """
        known = ~np.isnan(rest)
        at, values = days[known].astype(float), rest[known]
        slow = at[: max(len(at) - 6, 0)]
        shapes = np.vstack([at >= at[:, np.newaxis], np.maximum(at - slow[:, np.newaxis] + 1.0, 0.0)])
        shapes = shapes / np.sqrt((shapes**2).sum(axis=1, keepdims=True))
        gains, is_drift = shapes @ values, np.arange(len(shapes)) >= len(at)
        best = int(np.argmax(np.abs(gains) * np.where(is_drift, 0.95, 1.0)))
        first, size = int(np.r_[at, slow][best]), float(gains[best] * shapes[best, -1])
        rate = float(size / (at[-1] - first + 1)) if is_drift[best] else 0.0
        return {"kind": "drift" if rate else "offset", "since": self._midnight(first), "size": size, "rate": rate}

    def _with_departures(self, state: WatchState) -> WatchState:
        """The thermometer that departs from the others, if without it, and without no other one, none does."""
        trusted = self._trusted(state)
        rest = self._departures(state, trusted)
        far = self._excess(rest, trusted)
        if not (far > 1).any() or 2 * (1 + len(state.lasting("offset", "drift"))) > len(self.sensors):
            return state
        resolved = []
        for sensor in np.flatnonzero((far > far.max() / 2) & ~self.is_reference):
            others = trusted & (np.arange(len(trusted)) != sensor)
            if not (self._excess(self._departures(state, others), others) > 1).any():
                resolved.append(int(sensor))
        if len(resolved) != 1:
            return state
        found = self._change(state.days_of_means, rest[:, resolved[0]])
        return state.opened(column=resolved[0], detected=self._midnight(state.days[-1]), **found)

    def _excess(self, rest: Array, trusted: Mask) -> Array:
        """The largest median departure of each trusted thermometer over its limit."""
        return np.where(trusted, np.nan_to_num(np.abs(windows(rest)) / self.thermometers.limits).max(axis=0), 0.0)

    def _trusted(self, state: WatchState) -> Mask:
        return ~np.isin(np.arange(len(self.sensors)), list(state.left_out()))

    def _midnight(self, day: int) -> int:
        stamp = pd.Timestamp(int(day) * DAY_NS)
        return (stamp.tz_localize(self.zone, nonexistent="shift_forward", ambiguous=True) if self.zone else stamp).value


def local_days(stamps: pd.DatetimeIndex) -> Counts:
    """Calendar day of each stamp in its own time zone, in days since 1970."""
    return stamps.tz_localize(None).as_unit("ns").asi8 // DAY_NS


def means_by_day(days: Counts, values: Array, least: float) -> tuple[Counts, Array]:
    """Days that have records, and means of those that have enough values; else NaN."""
    by_day = pd.DataFrame(values).groupby(days)
    means = by_day.mean().where(by_day.count() >= max(least, 1.0))
    return means.index.to_numpy(), means.to_numpy()


def run_limits(values: Array, per_day: float) -> Counts:
    """Numbers of records in a row from which missing and equal values are a fault, (2, n_columns).

    The third longest run of the baseline is its usual one: its own faults are no rule.
    """
    limits = np.empty((2, values.shape[1]), dtype=np.int64)
    for column, series in enumerate(values[~np.isnan(values).all(axis=1)].T):
        known = np.flatnonzero(~np.isnan(series))
        equal = equal_runs(series[known])[1]
        gaps, equal = (np.sort(np.append(runs, [0, 0, 0]))[::-1] for runs in (np.diff(known) - 1, equal[equal > 1]))
        least = max(3, round(per_day)) * (2 if gaps[0] else 1)
        limits[0, column] = max(least, np.ceil(min(1.7 * gaps[0], 3.0 * gaps[2])))
        limits[1, column] = max(5, 4 * equal[2])
    return limits
