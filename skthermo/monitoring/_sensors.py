"""Faults of sensors in service: dead, stuck, drifting or exchanged thermometers, responses that no damage explains."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array, median, robust_deviation
from skthermo._core.frames import DAY, YEAR, as_index, days_later, midnight, midnights
from skthermo._core.saved_frames import SavesFrames
from skthermo.preprocessing.checks import Plausible, equal_runs
from skthermo.preprocessing.folds import out_of_fold
from skthermo.residuals.gaussian import Gaussian


@dataclass(frozen=True)
class Fault(SavesFrames):
    """A fault of a column, of thermometers with the ``size`` of the departure, or exchanged with an ``other`` one."""

    column: Hashable
    kind: str
    since: pd.Timestamp
    detected: pd.Timestamp
    detail: str
    until: pd.Timestamp | None = None
    size: float = 0.0
    other: Hashable = None

    def covers(self, stamps: pd.DatetimeIndex, once_found: bool = False) -> NDArray[np.bool_]:
        """Which records it concerns, or concerned once it was found."""
        begin = days_later(midnight(self.detected), 1) if once_found else self.since
        rows = np.asarray(stamps >= begin)
        return rows if self.until is None else rows & np.asarray(stamps < self.until)


@dataclass(frozen=True)
class WatchState(SavesFrames):
    """Records of the last days, daily means of thermometers over the last months, and all faults as they were found."""

    records: pd.DataFrame
    means: pd.DataFrame
    faults: tuple[Fault, ...] = ()

    def lasting(self, *kinds: str) -> dict[Hashable, Fault]:
        """By column, faults of some kinds that have not ended."""
        return {fault.column: fault for fault in self.faults if fault.until is None and fault.kind in kinds}

    def left_out(self) -> dict[Hashable, Fault]:
        """By column that is left out, the fault for which it is."""
        return self.lasting("dead", "stuck", "implausible", "offset", "drift")

    def updated(self, changes: Mapping[Fault, Fault], found: Sequence[Fault]) -> WatchState:
        """With faults in place of others, and more."""
        return replace(self, faults=(*(changes.get(fault, fault) for fault in self.faults), *found))


def in_place(records: pd.DataFrame, faults: Sequence[Fault], once_found: bool = False) -> pd.DataFrame:
    """Records with exchanged values back in their columns."""
    placed = records.copy()
    for fault in faults:
        if fault.kind == "swapped" and fault.column in placed:
            rows = fault.covers(records.index, once_found)
            placed.loc[rows, fault.column] = records.loc[rows, fault.other]
    return placed


def exchange(
    pair: Sequence[Hashable], since: pd.Timestamp, today: pd.Timestamp, lasting: Mapping[Hashable, Fault]
) -> tuple[dict[Fault, Fault], list[Fault]]:
    """Lasting faults that end as two columns are exchanged back, else the faults that begin as they are exchanged."""
    ended = {lasting[name]: replace(lasting[name], until=since) for name in pair if name in lasting}
    detail = "its values are in the column of {!r}; put back in place"
    begun = [Fault(a, "swapped", since, today, detail.format(b), other=b) for a, b in (pair, pair[::-1])]
    return ended, [] if ended else begun


def season_of(days: pd.DatetimeIndex) -> Array:
    """Two harmonics of the year."""
    angle = 2 * np.pi * days.day_of_year.to_numpy()[:, np.newaxis] * (DAY / YEAR)
    return np.hstack([np.sin(angle), np.cos(angle), np.sin(2 * angle), np.cos(2 * angle)])


def windows(rest: pd.DataFrame) -> Array:
    """Medians of departures over 3, 7 and 30 days, and steps from the month before to the last 3 and 7 days.

    For each day, (n_days, n_windows, n_thermometers); NaN where fewer than half of the days have a value.
    """
    last = {n: rest.rolling(n, min_periods=n // 2 + 1).median() for n in (3, 7, 30)}
    return np.stack([*last.values(), *(last[n] - last[30].shift(n) for n in (3, 7))], axis=1)


@dataclass(frozen=True)
class Thermometers:
    """Daily means of thermometers, each predicted from the others and, after a whole year, the season.

    ``known`` are the lowest and highest means of the baseline; ``limits`` are medians of departures that are beyond
    chance, (n_windows, n_thermometers), of the `windows`.
    """

    together: Gaussian
    known: Array
    limits: Array

    @classmethod
    def fitted(cls, means: pd.DataFrame, least: float = 1.0, sigmas: float = 5.0) -> Thermometers:
        """Limits are so many standard deviations of a median, as far as the baseline itself goes, and a degree."""
        values, number = means.to_numpy(), ((means.index - means.index[0]) / DAY).to_numpy().round().astype(int)
        has_season = number[-1] >= 330
        rows = np.hstack([values, season_of(means.index)]) if has_season else values

        def learned(train: NDArray[np.intp]) -> Thermometers:
            found = Gaussian.fitted(rows[train][~np.isnan(values[train]).all(axis=1)])
            own = np.diag(1e-6 * np.diag(found.covariance) + 0.05**2)  # thermometers are not better than that
            known = np.array([f.reduce(values[train]) for f in (np.fmin, np.fmax)])
            return cls(Gaussian(found.mean, found.covariance + own), known, np.empty(0))

        def departures(train: NDArray[np.intp]) -> Any:
            part = learned(train)
            return lambda test: part.departures(means.iloc[test]).to_numpy()

        folds = number // 15 % 5 if has_season else np.arange(len(means)) * 5 // len(means)
        found = windows(pd.DataFrame(out_of_fold(departures, folds)))
        largest = 1.2 * np.nanmax(np.abs(found), axis=0, initial=0.0)
        spread = robust_deviation(found.reshape(len(found), -1)).reshape(largest.shape)
        return replace(learned(np.arange(len(means))), limits=np.fmax(np.fmax(sigmas * spread, largest), least))

    def departures(self, means: pd.DataFrame, trusted: Sequence[Hashable] | None = None) -> pd.DataFrame:
        """Daily means less what the other trusted thermometers predict; NaN where either has no value.

        In weather that the baseline does not have, only what goes beyond the prediction's own change by it counts.
        """
        values, sensors = means.to_numpy(), list(means)
        season = season_of(means.index)[:, : len(self.together.mean) - len(sensors)]
        is_trusted = np.array([trusted is None or name in trusted for name in sensors])
        found = np.full(values.shape, np.nan)
        for place in range(len(sensors)):
            others = np.where(is_trusted & (np.arange(len(sensors)) != place), values, np.nan)
            known = ~np.isnan(others).all(axis=1)
            expected, within = (
                self.together.completed(np.hstack([one, season])[known])[0][:, place]
                for one in (others, np.clip(others, *self.known))
            )
            rest = values[known, place] - expected
            found[known, place] = np.sign(rest) * np.maximum(np.abs(rest) - np.abs(expected - within) / 2, 0.0)
        return pd.DataFrame(found, means.index, means.columns)

    def agree(self, means: pd.DataFrame, trusted: list[Hashable]) -> bool:
        """Whether no trusted thermometer departs from the other ones by more than its limits."""
        return bool(self.excess(self.departures(means, trusted))[trusted].max() <= 1)

    def exchanged(
        self, means: pd.DataFrame, pair: list[Hashable], trusted: list[Hashable], is_back: bool
    ) -> pd.Timestamp | None:
        """The day since which two thermometers are exchanged, if that explains all departures.

        Unless it takes them back to where they belong, they have to be less than half as far then from what the others
        alone and the season predict, which tells an exchange from an offset of one of them.
        """
        others, values, changed = [name for name in trusted if name not in pair], means[pair].to_numpy(), means.copy()
        rest = self.departures(means, others)[pair].to_numpy()
        here, there = (np.nan_to_num((some**2).sum(axis=1)) for some in (rest, rest + values[:, ::-1] - values))
        first = int(np.argmax((here - there)[::-1].cumsum()[::-1]))
        changed.loc[means.index[first] :, pair] = values[first:, ::-1]
        has_season = len(self.together.mean) > len(self.limits.T)
        is_nearer = is_back or (has_season and there[first:].sum() < here[first:].sum() / 4)
        return means.index[first] if is_nearer and self.agree(changed, trusted) else None

    def excess(self, rest: pd.DataFrame) -> pd.Series:
        """The largest median departure of each thermometer at the end, over its limit."""
        size = np.abs(windows(rest[-40:])[-1]) / self.limits
        return pd.Series(np.nan_to_num(size).max(axis=0), rest.columns)


@dataclass(frozen=True)
class Responses:
    """Responses in their own units beside what the weather predicts.

    ``together`` is the distribution of temperatures and responses, ``reach`` the lowest and highest responses.
    ``limits`` are departures from which a value that moves alone is implausible: more than 25 robust deviations, a
    quarter of its level, and three times the departure that one value in a thousand of the baseline exceeds.
    ``deviations`` are deviations of daily medians, and ``pairs`` positions of responses of the same unit and size,
    which may be exchanged.
    """

    together: Gaussian
    reach: Array
    limits: Array
    deviations: Array
    pairs: list[list[int]]

    @classmethod
    def fitted(cls, temperatures: Array, values: Array, days: pd.DatetimeIndex, units: Sequence[str]) -> Responses:
        centre, scatter = np.abs(median(values)), robust_deviation(values)
        least = 1e-4 * np.fmax(np.where(scatter > 0, scatter, centre), 1e-8)
        rows = np.hstack([temperatures, values])
        found = Gaussian.fitted(rows[~np.isnan(rows).all(axis=1)])
        own = np.diag(1e-6 * np.maximum(np.diag(found.covariance), 1e-8))
        reach = np.array([f.reduce(values) for f in (np.fmin, np.fmax)])
        bare = cls(Gaussian(found.mean, found.covariance + own), reach, centre, centre, [])
        rest = bare.residuals(temperatures, values)[0]
        limits = np.fmax(25 * robust_deviation(rest), np.fmax(0.25 * centre, 25 * least))
        limits = np.fmax(limits, 3 * np.nanquantile(np.abs(rest), 0.999, axis=0))
        deviations = np.fmax(robust_deviation(pd.DataFrame(rest).groupby(days).median().to_numpy()), least)
        sizes = np.fmax(centre, scatter), np.fmax(scatter, least)
        pairs = [
            [a, b]
            for a, b in combinations(range(len(centre)), 2)
            if units[a] == units[b] and all(max(size[a], size[b]) <= 10 * min(size[a], size[b]) for size in sizes)
        ]
        return replace(bare, limits=limits, deviations=deviations, pairs=pairs)

    def residuals(self, temperatures: Array, values: Array) -> tuple[Array, Array]:
        """Responses minus those that the weather predicts, and these."""
        n = temperatures.shape[1]
        expected = self.together.completed(np.hstack([temperatures, np.full(values.shape, np.nan)]))[0][:, n:]
        expected = np.clip(np.where(np.isnan(expected), self.together.mean[n:], expected), *self.reach)
        return values - expected, expected

    def implausible(self, values: Array, rest: Array) -> NDArray[np.bool_]:
        """Values farther from the prediction than damage explains while the others of their record stay.

        Whatever the others do, none is a thousand times as far, and none zero or below where the baseline is above.
        """
        size = np.abs(rest) / self.limits
        never = (size > 1000) | ((values <= 0) & (self.reach[0] > 0))
        is_alone = (rest.shape[1] >= 3) & (median(size.T) < 0.2)
        return never | ((size > 1) & is_alone[:, np.newaxis])

    def exchanged(
        self, rest: Array, expected: Array, stamps: pd.DatetimeIndex, certain: float = 20.0
    ) -> list[tuple[list[int], pd.Timestamp]]:
        """Pairs whose values of the last days are exchanged, and the first record that is.

        Both come much nearer to their places by it: one has risen and the other one fallen, by about their distance. No
        damage does that. A day adds at most 50 to the logarithm of the odds.
        """
        found, both = [], np.hstack([rest, expected])
        daily = pd.DataFrame(both).groupby(midnights(stamps)).median()[::-1]
        rests, places = np.split(daily.to_numpy(), 2, axis=1)
        for pair in self.pairs:

            def misfits(rests: Array, places: Array, pair: list[int] = pair) -> Array:
                """Squared departures of the pair where they are, and exchanged, (2, n_rows, 2)."""
                apart = places[:, pair] - places[:, pair[::-1]]
                there = rests[:, pair[::-1]] - apart
                return (np.stack([rests[:, pair], there]) / self.deviations[pair]) ** 2

            known = ~np.isnan(rests[:, pair]).any(axis=1)
            here, there = misfits(rests[known], places[known])
            nearer = np.logical_and.accumulate((there < here / 4).all(axis=1))
            odds = np.minimum((here - there).sum(axis=1) / 2, 50.0)[nearer].cumsum()
            if (odds > certain).any():
                first = daily.index[known][np.count_nonzero(nearer) - 1]
                own = np.flatnonzero(stamps >= days_later(first, -1))
                here, there = misfits(rest[own], expected[own])
                gains = np.nan_to_num((here - there).sum(axis=1))[::-1].cumsum()[::-1]
                found.append((pair, stamps[own[np.argmax(gains)]]))
        return found


@dataclass(frozen=True)
class SensorWatch:
    """Watches thermometers and responses in service, and distinguishes faults of sensors from damage where data can.

    Damage moves no thermometer: one that departs from the others' prediction is at fault if all others agree without
    it, and without no other one. A response that moves may be damaged: it is set aside only where no damage explains
    its values. References check thermometers and fill their gaps.

    The state is immutable, and what it says depends on complete days alone. ``runs`` are numbers of records from which
    missing or equal values of a column are a fault.
    """

    sensors: list[Hashable]
    reference: list[Hashable]
    modes: list[Hashable]
    units: dict[Hashable, str]
    weather: Plausible
    runs: dict[Hashable, tuple[int, int]]
    per_day: float
    thermometers: Thermometers | None
    expected: Responses
    start_: WatchState

    @classmethod
    def fitted(
        cls,
        T: pd.DataFrame,
        F: pd.DataFrame,
        reference: Sequence[Hashable],
        units: Mapping[Hashable, str],
    ) -> SensorWatch:
        """Learn from the baseline; ``reference`` names columns of T, ``units`` are texts by column."""
        records, days = T.join(F), midnights(T.index)
        per_day = len(days) / max(days.nunique(), 1)
        means, has_values = means_by_day(T, per_day), T.notna().any().all()
        can_compare = T.shape[1] > 1 and len(means) >= 3 * T.shape[1] + 5 and has_values
        filled = records.dropna(how="all")
        return cls(
            sensors=list(T),
            reference=[name for name in T if name in reference],
            modes=list(F),
            units={name: units[name] for name in records},
            weather=Plausible.of_weather(T.to_numpy()),
            runs={name: run_limits(filled[name].to_numpy(), per_day) for name in records},
            per_day=per_day,
            thermometers=Thermometers.fitted(means) if can_compare else None,
            expected=Responses.fitted(T.to_numpy(), F.to_numpy(), days, [units[name] for name in F]),
            start_=WatchState(records.iloc[:0], means.iloc[:0]),
        )

    def faults(self, state: WatchState) -> pd.DataFrame:
        """Faults so far: ``column``, ``kind``, ``since``, ``detected``, ``until`` (NaT while it lasts), ``detail``."""
        columns, zone = ["column", "kind", "since", "detected", "until", "detail"], state.records.index.tz
        table = pd.DataFrame([vars(fault) for fault in state.faults], columns=columns, dtype=object)
        times = {name: [None if pd.isna(time) else time.value for time in table[name]] for name in columns[2:5]}
        return table.assign(**{name: as_index(some, zone) for name, some in times.items()})

    def masked(
        self,
        faults: Sequence[Fault],
        T: pd.DataFrame,
        F: pd.DataFrame,
        acknowledged: Sequence[int] = (),
        *,
        once_found: bool = False,
    ) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
        """Records without what sensors showed since they were at fault: NaN there, and exchanged values in place.

        Or since they were found to be. Also, of each record, ``n_held`` responses that were set aside although the
        structure may have moved them, and their names ``held``; ``n_left_out`` values, columns ``at_fault``, and a
        ``note`` on them. What has been ``acknowledged`` as a fault of a sensor, at times in nanoseconds, is not held
        afterwards. No structure repeats a response to its last digit, so that one that is stuck is not held.
        """
        given, stamps = in_place(T.join(F), faults, once_found), T.index
        far = self._evaluated(given)[0]
        held, out = far[self.modes].copy(), pd.DataFrame(False, stamps, given.columns)
        notes, at_fault = [[] for _ in stamps], [[] for _ in stamps]
        for fault in faults:
            rows, name = fault.covers(stamps, once_found), fault.column
            text = f"{name} is left out ({fault.kind} since {fault.since:%Y-%m-%d})"
            if fault.kind == "swapped":
                is_first = given.columns.get_loc(name) < given.columns.get_loc(fault.other)
                text = f"{name} and {fault.other} are exchanged and were put back in place" if is_first else ""
            else:
                out.loc[rows, name] = True
            if name in self.modes and fault.kind in ("stuck", "implausible"):
                said = [time for time in acknowledged if time >= fault.since.value]
                is_open = stamps.as_unit("ns").asi8 <= min(said) if said else True
                held.loc[rows, name] = (fault.kind == "implausible") & np.broadcast_to(is_open, len(stamps))[rows]
            for place in np.flatnonzero(rows):
                notes[place].append(text)
                at_fault[place].append(str(name))
        removed = (far | out) & given.notna()
        kept = given.mask(removed)
        if self.reference:
            rows = kept[self.sensors].reindex(columns=kept.columns).to_numpy()
            kept[self.sensors] = self.expected.together.completed(rows)[0][:, : len(self.sensors)]
        values = values_text(given, (far & ~out).to_numpy(), self.units, "implausible, left out")
        about = {
            "n_held": held.sum(axis=1).astype(float),
            "held": [", ".join(map(str, held.columns[row])) for row in held.to_numpy()],
            "n_left_out": removed.sum(axis=1),
            "at_fault": list(map(", ".join, at_fault)),
            "note": ["; ".join(filter(None, [text, *own])) for text, own in zip(values, notes, strict=True)],
        }
        inputs = [name for name in self.sensors if name not in self.reference]
        return kept[inputs], kept[self.modes], pd.DataFrame(about, stamps)

    def advance(self, state: WatchState, T_day: pd.DataFrame, F_day: pd.DataFrame) -> WatchState:
        """The state after one complete day with these records, if any."""
        if not len(T_day):
            return state
        today = midnight(T_day.index[-1])
        means = means_by_day(T_day.mask(self.weather.implausible(T_day.to_numpy())), self.per_day)
        n_days = 5 + int(np.ceil(max(map(max, self.runs.values()), default=0) / self.per_day))
        records = pd.concat([state.records, T_day.join(F_day)]).loc[days_later(today, 1 - n_days) :]
        state = WatchState(records, pd.concat([state.means, means])[-120:], state.faults)
        state = self._with_runs(self._with_exchanges(state, today), today)
        return state if self.thermometers is None else self._with_departures(state, today)

    def _evaluated(self, records: pd.DataFrame) -> tuple[pd.DataFrame, Array, Array]:
        """Which values are implausible, responses minus the expected ones, and the expected ones."""
        temperatures, responses = np.split(records.to_numpy(), [len(self.sensors)], axis=1)
        impossible = self.weather.implausible(temperatures)
        rest, expected = self.expected.residuals(np.where(impossible, np.nan, temperatures), responses)
        far = np.hstack([impossible, self.expected.implausible(responses, rest)])
        return pd.DataFrame(far, records.index, records.columns), rest, expected

    def _with_exchanges(self, state: WatchState, today: pd.Timestamp) -> WatchState:
        """Modes that are exchanged from now on, or no longer."""
        begin = max([days_later(today, -4), *(one.detected for one in state.faults if one.other in self.modes)])
        recent, lasting = in_place(state.records.loc[begin:], state.faults), state.lasting("swapped")
        changes, found = {}, []
        for places, since in self.expected.exchanged(*self._evaluated(recent)[1:], recent.index):
            pair = [self.modes[place] for place in places]
            ended, begun = exchange(pair, since, today, lasting)
            changes, found = changes | ended, found + begun
        return state.updated(changes, found)

    def _with_runs(self, state: WatchState, today: pd.Timestamp) -> WatchState:
        """Columns that are dead, stuck or implausible from now on, or no longer."""
        records = in_place(state.records.dropna(how="all"), state.faults)  # empty records tell nothing
        far, out, changes, found = self._evaluated(records)[0], state.left_out(), {}, []
        for name, series in records.items():
            kind, first, value = run_of(series.to_numpy(), far[name].to_numpy(), *self.runs[name])
            fault, size = out.get(name), f"{value:.6g} {self.units[name]}".rstrip()
            is_run = fault is not None and fault.kind in ("dead", "stuck", "implausible")
            if kind == (fault.kind if is_run else ""):
                continue
            if is_run or (kind and fault is not None):
                changes[fault] = replace(fault, until=end_of_run(series, far[name], today))
            detail = {
                "dead": "has had no value for longer than gaps of the baseline",
                "stuck": f"repeats {size}; left out",
                "implausible": f"shows implausible values, such as {size}; left out",
            }
            found += [Fault(name, kind, records.index[first], today, detail[kind])] if kind else []
        return state.updated(changes, found)

    def _with_departures(self, state: WatchState, today: pd.Timestamp, n_days: int = 4) -> WatchState:
        """Thermometers that have come back to less than half of their departure for some days are used again.

        In its first two months, an offset that goes on may turn out to be a drift. Others begin to depart.
        """
        means, changes, lasting = in_place(state.means, state.faults), {}, state.lasting("offset", "drift")
        for fault in state.faults:
            if fault.column in self.sensors and fault not in lasting.values() and fault.kind != "swapped":
                is_in = (means.index >= midnight(fault.since)) & (means.index < (fault.until or days_later(today, 1)))
                means.loc[is_in, fault.column] = np.nan
        rest = self.thermometers.departures(means, self._trusted(state))
        for fault in lasting.values():
            own = rest[fault.column].dropna()
            last = own[own.index >= fault.detected][-n_days:]
            is_back = last.abs() < abs(fault.size) / 2
            if len(last) == n_days and is_back.all():
                changes[fault] = replace(fault, until=last.index[0])
            elif today - fault.detected < 60 * DAY and not is_back[-1:].any():
                again = replace(fault, **change_of(own))
                changes |= {fault: again} if again.since <= fault.detected else {}
        ended, begun = self._departing(state, today, means, rest, n_days)
        return state.updated(changes | ended, begun)

    def _trusted(self, state: WatchState) -> list[Any]:
        """Thermometers that are not left out."""
        return [name for name in self.sensors if name not in state.left_out()]

    def _departing(
        self, state: WatchState, today: pd.Timestamp, means: pd.DataFrame, rest: pd.DataFrame, n_days: int
    ) -> tuple[dict[Fault, Fault], list[Fault]]:
        """Faults that end and begin where daily means of thermometers that are trusted depart from each other.

        Two that are exchanged are put back in place, after some days, in which an offset of one may look alike. Else
        the thermometer that departs from the others is left out if without it, and without no other one, none does.
        """
        trusted = self._trusted(state)
        excess, n_left_out = self.thermometers.excess(rest)[trusted], len(self.sensors) - len(trusted)
        if not (excess > 1).any() or 2 * (1 + n_left_out) > len(self.sensors):
            return {}, []
        suspects = excess.index[excess > excess.max() / 2].difference(self.reference, sort=False)
        others = {name: [one for one in trusted if one != name] for name in suspects}
        resolved = [name for name in suspects if self.thermometers.agree(means, others[name])]
        swapped, exchanges = state.lasting("swapped"), []
        for pair in map(list, combinations([name for name in trusted if name not in self.reference], 2)):
            is_free = all(name not in swapped or swapped[name].other in pair for name in pair)
            if is_free and set(resolved) <= set(pair) and suspects.isin(pair).any():
                since = self.thermometers.exchanged(means, pair, trusted, pair[0] in swapped)
                exchanges += [] if since is None else [(pair, since)]
        if len(exchanges) == 1:
            pair, since = exchanges[0]
            return exchange(pair, since, today, swapped) if since <= days_later(today, 1 - n_days) else ({}, [])
        if len(resolved) == 1:
            return {}, [Fault(column=resolved[0], detected=today, **change_of(rest[resolved[0]].dropna()))]
        return {}, []


def values_text(records: pd.DataFrame, rows: Array, units: Mapping[Hashable, str], what: str) -> list[str]:
    """Some values of each record, and what is said of them; "" without any."""
    texts = [""] * len(records)
    for place in np.flatnonzero(rows.any(axis=1)):
        values = records.iloc[place][rows[place]]
        texts[place] = ", ".join(f"{name} is {value:.4g} {units[name]}".rstrip() for name, value in values.items())
        texts[place] += f": {what}"
    return texts


def means_by_day(T: pd.DataFrame, per_day: float) -> pd.DataFrame:
    """Means of the days that have records; NaN without three in ten of their values."""
    by_day = T.groupby(midnights(T.index))
    return by_day.mean().where(by_day.count() >= max(0.3 * per_day, 1.0))


def run_limits(values: Array, per_day: float) -> tuple[int, int]:
    """Numbers of records in a row from which missing and equal values are a fault.

    The third longest run of the baseline is its usual one: its own faults are no rule.
    """
    known = np.flatnonzero(~np.isnan(values))
    equal = equal_runs(values[known])[1]
    gaps, equal = (np.sort(np.append(runs, [0, 0, 0]))[::-1] for runs in (np.diff(known) - 1, equal[equal > 1]))
    least = max(3, round(per_day)) * (2 if gaps[0] else 1)
    return max(least, int(np.ceil(min(1.7 * gaps[0], 3.0 * gaps[2])))), max(5, 4 * int(equal[2]))


def run_of(series: Array, is_far: Array, most_missing: int, most_equal: int) -> tuple[str, int, float]:
    """Kind of the run of values with which a column ends if it is a fault, else "", its first place, and its value."""
    known = np.flatnonzero(~np.isnan(series))
    last = known[-1] if len(known) else -1
    if len(series) - 1 - last >= most_missing:
        return "dead", last + 1, 0.0
    if not len(known):
        return "", 0, 0.0
    far, equal = (rows[known[::-1]].cumprod().sum() for rows in (is_far, series == series[last]))
    if far >= 3:
        return "implausible", known[-far], series[last]
    return ("stuck", known[-equal], series[last]) if equal >= most_equal else ("", 0, 0.0)


def end_of_run(series: pd.Series, is_far: pd.Series, today: pd.Timestamp) -> pd.Timestamp:
    """The first record of a day whose value is neither implausible nor the one of the day before."""
    before = series[series.index < today].dropna()
    good = (series.index >= today) & series.notna() & ~is_far
    if len(before):
        good &= series != before.iloc[-1]
    return series.index[good][0] if good.any() else today


def change_of(rest: pd.Series) -> dict[str, Any]:
    """Offset or drift of a thermometer at fault: its first day, its size on the last one, and what to say of it.

    The one of least squares by day, a drift where it explains clearly more.
    """
    at = ((rest.index - rest.index[0]) / DAY).to_numpy().round()
    slow = at[: max(len(at) - 6, 0)]
    shapes = np.vstack([at >= at[:, np.newaxis], np.maximum(at - slow[:, np.newaxis] + 1.0, 0.0)])
    shapes = shapes / np.sqrt((shapes**2).sum(axis=1, keepdims=True))
    gains, is_drift = shapes @ rest.to_numpy(), np.arange(len(shapes)) >= len(at)
    best = int(np.argmax(np.abs(gains) * np.where(is_drift, 0.95, 1.0)))
    first, size = best % len(at), float(gains[best] * shapes[best, -1])
    kind, shown = "offset", f"{size:+.1f} degrees"
    if is_drift[best]:
        kind, shown = "drift", f"{size / (at[-1] - at[first] + 1) * (YEAR / DAY) / 12:+.2f} degrees a month"
    detail = f"{shown} beside the other thermometers; left out"
    since = rest.index[max(first - 1, 0)]  # it may have begun on the day before
    return {"kind": kind, "since": since, "size": size, "detail": detail}
