"""How soon damage is found: the chance to find it within a time, and the time within which it is found."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array, is_real
from skthermo._core.frames import Table, has_stamps, row_times, time_of
from skthermo._core.text import counted, duration_text
from skthermo.studies.detectability._rates import EvaluatedRecords, clopper_pearson, rate_of
from skthermo.studies.detectability._simulation import onsets_of

MOST_STEPS = 200_000  # into which the time of the records is divided
TIMES = ["median", "reliable", "reliable highest"]
FEW = 10  # number of cases found, or not found, below which their dependence is not estimated
WEAK_EVIDENCE = 0.3  # probability of a false alarm above which an alarm in the same time is weak evidence of damage


@dataclass(frozen=True, eq=False)
class Waits:
    """Number of steps from each onset of damage to the first alarm, (n_repeats, n_onsets), 1 for an alarm of the first
    record; infinite where there is none.

    A step is the usual time between records, ``length``, or one record where there are no stamps (None); ``n_steps``
    lead from the first record to the last. ``share_not_evaluated`` is of the steps, also those without any record.
    """

    steps: Array
    n_steps: int
    length: pd.Timedelta | None
    share_not_evaluated: float
    whole_repeats: bool

    @classmethod
    def of(cls, records: EvaluatedRecords, onset: Any = None, transitions: Array | None = None) -> "Waits":
        """Waits from onsets in every step, or from the onset of the scenario or another one alone.

        After the last record comes the first one again, so that each season has as many onsets as it has steps.
        Detectors with windows have ``transitions``, (n_repeats, n_onsets, n_window), decisions after some onsets while
        a window still holds healthy records.
        """
        places, length = _places_of(records.damage_index)
        n_steps = int(places.max()) + 1
        alarms = _any_in_step(places, records.decisions < 0)
        evaluated = _any_in_step(places, ~np.isnan(records.decisions))
        onset = records.scenario.onset if onset is None else onset
        whole = records.scenario.n_draws > 1
        if onset is not None:
            times, start = row_times(records.damage_index), time_of(records.damage_index, onset, "onset")
            first = int(places[times >= start].min())
            steps = np.where(alarms[:, first:].any(axis=1), alarms[:, first:].argmax(axis=1) + 1.0, np.inf)
            return cls(steps[:, np.newaxis], n_steps, length, float(1 - evaluated[:, first:].mean()), True)
        steps = _until_next(alarms)
        if transitions is not None:
            steps = _after_transitions(places, steps, transitions < 0)
        return cls(steps, n_steps, length, float(1 - evaluated.mean()), whole)

    def count(self, within: Any) -> int:
        """Number of steps within a time; 0 if that is shorter than a step."""
        return int(within) if self.length is None else int(np.floor(within / self.length + 0.05))

    def time(self, steps: float) -> Any:
        """A number of steps as a time, or as a number of records; missing if it is infinite."""
        if self.length is None:
            return float(steps) if np.isfinite(steps) else float("nan")
        return self.length * int(steps) if np.isfinite(steps) else pd.NaT

    def text(self, steps: float) -> str:
        """A number of steps in words."""
        return counted(int(steps), "record") if self.length is None else duration_text(self.length * int(steps))

    def found(self, number: int, confidence: float) -> tuple[float, float, float]:
        """Share of the onsets after which there is an alarm within a number of steps, and its bounds.

        NaN if there is no such step, or if the records are shorter.
        """
        if not 1 <= number <= self.n_steps:
            return float("nan"), float("nan"), float("nan")
        late = np.minimum(self.steps, 2.0 * number) - number - 0.5
        rate = rate_of(late, confidence, whole_repeats=self.whole_repeats)
        if FEW <= rate.n_alarms <= rate.n_records - FEW:
            return rate.rate, rate.ci_low, rate.ci_high
        n_apart = min(rate.n_effective, len(self.steps) * self.n_steps / number)  # times without a common record
        return rate.rate, *clopper_pearson(rate.rate * n_apart, n_apart, confidence)

    def within(self, probability: float) -> float:
        """Smallest number of steps within which this share of the onsets is found; infinite if none is."""
        return float(np.quantile(self.steps, probability, method="inverted_cdf"))

    def surely_within(self, probability: float, confidence: float) -> float:
        """The same with the lower bounds of the shares."""
        lowest, highest = 0, self.n_steps + 1
        while highest - lowest > 1:
            middle = (lowest + highest) // 2
            is_enough = self.found(middle, confidence)[1] >= probability
            lowest, highest = (lowest, middle) if is_enough else (middle, highest)
        return float(highest) if highest <= self.n_steps else float("inf")


def read_within(within: Sequence[str | int] | None, is_stamped: bool) -> dict[str, Any]:
    """Times by their names in a table: durations, or numbers of records where there are no stamps."""
    if within is None:
        within = ("1D", "7D", "30D") if is_stamped else (1, 7, 30)
    many = [within] if isinstance(within, str) or np.ndim(within) == 0 else list(within)
    times = {str(one): _time(one, is_stamped) for one in many}
    if not times or len(times) < len(many):
        raise ValueError(f"within is {within!r:.100}; expected one or more times, each once")
    return times


def _time(one: Any, is_stamped: bool) -> Any:
    expected = "times such as '7D'" if is_stamped else "numbers of records, as the weather has no stamps"
    try:
        is_number = is_real(one)
        time = (pd.NaT if is_number else pd.Timedelta(one)) if is_stamped else (one if is_number else np.nan)
        if (is_stamped and time > pd.Timedelta(0)) or (not is_stamped and time >= 1 and time == int(time)):
            return time
    except (TypeError, ValueError):
        pass
    raise ValueError(f"within has {one!r:.100}; expected {expected}")


def waits_table(
    records: Mapping[tuple[str, str, str], EvaluatedRecords],
    transitions: Mapping[tuple[str, str, str], Array],
    within: Sequence[str | int] | None,
    level: float,
    confidence: float,
) -> pd.DataFrame:
    """A row for each of the records by detector, scenario and source, beside the waits of the healthy structure."""
    healthy = {key[0]: one for key, one in reversed(records.items()) if one.scenario.is_healthy}
    rows, is_stamped = [], True
    for key, one in records.items():
        scenario, twin = one.scenario, healthy.get(one.detector)
        waits = Waits.of(one, transitions=transitions.get(key))
        false = None if twin is None else waits if twin is one else Waits.of(twin, scenario.onset)
        row = {
            "detector": one.detector,
            "scenario": scenario.name,
            "family": scenario.family,
            "severity": scenario.severity,
            "source": one.source,
        }
        is_stamped &= waits.length is not None
        times = read_within(within, waits.length is not None)
        numbers = [waits.count(time) for time in times.values()]
        for name, number in zip(times, numbers, strict=True):
            found = waits.found(number, confidence)
            row |= dict(zip([name, f"{name} ci_low", f"{name} ci_high"], found, strict=True))
            row[f"{name} healthy"] = np.nan if false is None else false.found(number, confidence)[0]
        row["median"] = waits.time(waits.within(0.5))
        row["reliable"] = waits.time(waits.within(level))
        row["reliable highest"] = waits.time(waits.surely_within(level, confidence))
        row["not_evaluated"] = waits.share_not_evaluated
        text = false_alarms_text(waits, numbers) if scenario.is_healthy else waits_text(waits, false, level)
        rows.append(row | {"text": text})
    table = pd.DataFrame(rows)
    if is_stamped:
        table[TIMES] = table[TIMES].astype(object).apply(pd.to_timedelta)  # also where none is known
    return table


def false_alarms_text(waits: Waits, numbers: Sequence[int]) -> str:
    """In how many of a hundred cases the healthy structure raises an alarm within some times."""
    chances = [(number, waits.found(number, 0.5)[0]) for number in numbers]
    texts = [
        f"{_cases(chance)}{' of 100 cases' * (place == 0)} within {waits.text(number)}"
        for place, (number, chance) in enumerate((number, chance) for number, chance in chances if chance == chance)
    ]
    return f"raises a false alarm in {', '.join(texts)}" if texts else "has too few records for these times"


def _cases(chance: float) -> str:
    return f"{round(100 * chance)}" if chance >= 0.005 else "fewer than 1"


def waits_text(waits: Waits, false: Waits | None, level: float) -> str:
    """How soon alarms come, beside those of the healthy structure in the same time."""
    number = waits.within(level)
    cases = f"{100 * level:g} of 100 cases"
    if not np.isfinite(number):
        return f"is detected in fewer than {cases} within the {waits.text(waits.n_steps)} of the records"
    text = f"is detected within {waits.text(number)} in {cases}"
    if false is None:
        return f"{text}; false alarms in that time: not known"
    by_chance = false.found(min(int(number), waits.n_steps), level)[0]
    text = f"{text}; false alarms in that time: {_cases(by_chance)} of 100"
    return f"{text}, so that such an alarm is weak evidence" if by_chance > WEAK_EVIDENCE else text


def soonest(table: pd.DataFrame, within: Sequence[str | int] | None) -> pd.DataFrame:
    """Of each detector and family, the row of the smallest severity that is found reliably, or of the largest.

    It is found within the longest of some times.
    """
    soon = table["reliable"] <= max(read_within(within, table["reliable"].dtype.kind == "m").values())
    chosen = []
    for _, rows in table.groupby(["detector", table["family"].fillna(table["scenario"])], sort=False):
        rows = rows.iloc[np.argsort(rows["severity"].abs().to_numpy(), kind="stable")]
        found = rows[soon[rows.index]]
        chosen.append((found if len(found) else rows.iloc[::-1]).iloc[0])
    return pd.DataFrame(chosen).reset_index(drop=True)


def _places_of(rows: Table) -> tuple[NDArray[np.intp], pd.Timedelta | None]:
    """The step of each record, from 0, and the length of a step."""
    times = row_times(rows)
    if not has_stamps(rows):
        return times.astype(np.intp), None
    since, apart = times - times.min(), np.diff(np.unique(times))
    length = max(float(np.median(apart)) if apart.size else 1.0, since.max() / MOST_STEPS)
    return np.rint(since / length).astype(np.intp), pd.Timedelta(int(length), "ns")


def _any_in_step(places: NDArray[np.intp], rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether any record of each step is marked, (n_repeats, n_steps)."""
    order = np.argsort(places, kind="stable")
    taken, first = np.unique(places[order], return_index=True)
    found = np.zeros((len(rows), int(places.max()) + 1), dtype=bool)
    found[:, taken] = np.logical_or.reduceat(rows[:, order], first, axis=1)
    return found


def _until_next(alarms: NDArray[np.bool_]) -> Array:
    """Steps from the beginning of each step to the end of the next one with an alarm; the first follows the last."""
    n_steps = alarms.shape[1]
    places = np.where(np.hstack([alarms, alarms]), np.arange(2 * n_steps), np.inf)
    following = np.minimum.accumulate(places[:, ::-1], axis=1)[:, ::-1][:, :n_steps]
    return following - np.arange(n_steps) + 1


def _after_transitions(places: NDArray[np.intp], steps: Array, alarms: NDArray[np.bool_]) -> Array:
    """Waits from the onsets of transitions: to an alarm there, or else to one after, (n_repeats, n_onsets)."""
    n_records, n_window = len(places), alarms.shape[2]
    onsets = onsets_of(n_records, n_window)
    first, after = places[onsets], places[(onsets + n_window) % n_records]
    rows = np.minimum(onsets[:, np.newaxis] + np.arange(n_window), n_records - 1)
    during = np.broadcast_to(places[rows] - first[:, np.newaxis] + 1.0, alarms.shape)
    found = np.take_along_axis(during, alarms.argmax(axis=2)[:, :, np.newaxis], axis=2)[:, :, 0]
    return np.where(alarms.any(axis=2), found, (after - first) % (int(places.max()) + 1) + steps[:, after])
