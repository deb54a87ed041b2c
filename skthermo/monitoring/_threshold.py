"""The threshold of a damage index: how many false events a healthy structure has, and which changes it detects."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import nbinom

from skthermo._core.arrays import Array
from skthermo._core.frames import DAY, YEAR
from skthermo._core.text import counted_number, duration_text, percent
from skthermo.exceptions import FewRecordsWarning, RecordsWarning, ResultWarning, SkthermoWarning
from skthermo.monitoring._events import levels, open_events, runs


def blocks_of(times: pd.DatetimeIndex, length: pd.Timedelta = 7 * DAY) -> NDArray[np.intp]:
    """Number of the block of each record, counted without gaps."""
    return np.unique((times - times[0]) // length, return_inverse=True)[1]


def level_exceeded(peaks: Array, times: float, n_highest: int = 16) -> float:
    """The level that a healthy structure exceeds so many times, in as long a time as that of the peaks, on average.

    Peaks are in descending order, of times that are independent of each other. The k-th highest peak is exceeded k
    times. The highest one is exceeded once, and the squares beyond it are taken as exponential, like the k highest
    ones, x_1 to x_k, over the next one, b: the level with the square

        b + ((x_1 - b) + ... + (x_k - b)) (((k + 1) / times)^(1 / k) - 1)

    is exceeded so many times on average over baselines, however few peaks there are.
    """
    if times >= 1:
        return float(np.interp(times, np.arange(1, len(peaks) + 1), peaks))
    k, base, excesses = highest_squares(peaks, n_highest)
    return float(np.sqrt(base + excesses.sum() * (((k + 1) / times) ** (1 / k) - 1)))


def times_exceeded(peaks: Array, level: float, n_highest: int = 16) -> float:
    """How often a healthy structure exceeds a level, in as long a time as that of the peaks, on average.

    The inverse of `level_exceeded`, at most once beyond the highest peak.
    """
    if level <= peaks[0]:
        return float(np.interp(-level, -peaks, np.arange(1, len(peaks) + 1)))
    k, base, excesses = highest_squares(peaks, n_highest)
    return float(min((k + 1) * (1 + (level**2 - base) / max(excesses.sum(), np.finfo(float).tiny)) ** -k, 1.0))


def highest_squares(peaks: Array, n_highest: int = 16) -> tuple[int, float, Array]:
    """Number of the highest peaks, the square of the next one, and by how much their squares exceed it."""
    k = min(n_highest, len(peaks) - 1)
    squares = peaks[: k + 1] ** 2
    return k, float(squares[k]), squares[:k] - squares[k]


@dataclass(frozen=True)
class FalseAlarmEstimate:
    """How many damage events a healthy structure is expected to have in a year, and by which baseline.

    ``expected`` is their number on average over baselines and years. In a single year there are ``lowest`` to
    ``highest`` of them with a probability of 90 %, by chance and because one baseline leaves the rate uncertain.
    ``n_years`` is the time that the baseline's evaluated records cover, ``missing_season`` the months without baseline
    records, for which there is no estimate ("" if there is none), ``method`` how the threshold was found, in words.
    """

    expected: float
    lowest: int
    highest: int
    n_years: float
    missing_season: str
    method: str

    def __str__(self) -> str:
        return (
            f"{counted_number(self.expected, 'false alarm')} a year on average, {self.lowest} to {self.highest} in a "
            f"single year with probability 90 %; {self.method}"
            + (f"; no estimate for {self.missing_season}" if self.missing_season else "")
        )


@dataclass(frozen=True)
class EventLevels:
    """Levels of the damage index at which events open and close, from the out-of-fold indices of a baseline.

    ``peaks`` are the highest levels of the times that begin above the level's 80 % quantile and end when it has been
    within it for a day, as many as there would be events at a lower threshold; of single days where they are fewer
    than six. They are independent of each other, and have their own times.
    """

    threshold: float
    release: float
    peaks: pd.Series
    estimate: FalseAlarmEstimate

    @classmethod
    def learned(cls, index: pd.Series, per_year: float, persistence: int) -> EventLevels:
        """The threshold that a healthy structure exceeds in so many events a year.

        Three of the baseline's peaks are enough. Events close within the level that it stays within for 95 % of time.
        """
        known = index.dropna()
        infinite = known.index[np.isinf(known)]
        if len(known) < 2 or len(infinite):
            raise ValueError(
                f"{len(known)} baseline records have a damage index, {len(infinite)} of them an infinite one"
                f"{f' (the first at {infinite[0]})' if len(infinite) else ''}; expected at least 2, all of them finite"
            )
        stamps = known.index.as_unit("ns").asi8
        level = pd.Series(levels(known.to_numpy(), persistence), known.index)
        usual, release = level.quantile([0.8, 0.95])
        spans = runs(open_events(level.to_numpy(), stamps, usual, usual))
        highest = [level.iloc[first:stop].idxmax() for first, stop in spans]
        if len(highest) < 6:
            highest = level.groupby(blocks_of(known.index, DAY)).idxmax().tolist()
        peaks = level[highest].sort_values(ascending=False)
        if len(peaks) < 3 or not peaks.iloc[0] > 0:
            raise ValueError(
                f"the baseline has only {counted_number(len(peaks), 'peak')} of its damage index, one a "
                "day; expected at least 3, better two weeks of records or more"
            )
        steps = np.diff(stamps)
        n_years = float(np.minimum(steps, max(DAY.value, np.median(steps))).sum() / YEAR.value)
        asked = per_year * n_years
        threshold = level_exceeded(peaks.to_numpy(), asked)
        k = max(asked, 1.0)  # peaks above the threshold, by which its rate is known
        fewest, most = nbinom.ppf([0.05, 0.95], k, k / (k + per_year)).astype(int)
        months = sorted({*range(1, 13)} - {*known.index.month})
        missing = ", ".join(pd.Timestamp(2001, month, 1).month_name() for month in months)
        method = (
            f"from {counted_number(len(peaks), 'peak')} of the damage index in {counted_number(n_years, 'year', 2)} of "
            "baseline" + (", extrapolated" if asked < 0.4 else "")
        )
        estimate = FalseAlarmEstimate(per_year, int(fewest), int(most), n_years, missing, method)
        return cls(threshold, min(float(release), threshold), peaks, estimate)

    def findings(self, seen: SmallestChanges) -> Iterator[SkthermoWarning]:
        """What is doubtful: a threshold from too short a time, that hides damage, or that a single peak raises."""
        estimate, highest, second = self.estimate, *self.peaks.iloc[:2]
        asked = estimate.expected * estimate.n_years
        if estimate.missing_season or asked < 0.4:
            without = f" and has no record of {estimate.missing_season}" if estimate.missing_season else ""
            yield FewRecordsWarning(
                f"the baseline has {counted_number(estimate.n_years, 'year', 2)} of records{without}: {asked:.2g} "
                f"events are expected in it (0.4 tell the threshold {self.threshold:.3g}), and other seasons may "
                f"have more. Now {seen}. Refit with a whole year, or allow more alarms a year",
                "short-baseline",
            )
        if asked >= 0.4 and seen.is_relative and seen.common > 0.025:  # 5 % of the stiffness of the structure
            yield ResultWarning(
                f"the threshold {self.threshold:.3g} is so high that {seen} (expected an alarm at 2.5 % of all "
                "responses). Smaller changes count as healthy. Use a longer window or a closer regression, or allow "
                "more alarms a year",
                "undetected-changes",
            )
        k, _, excesses = highest_squares(self.peaks.to_numpy())
        by_chance = 1.0 - (0.01 / k) ** (1 / (k - 1))  # share of the largest of k exponential excesses (Cochran)
        if excesses[0] > by_chance * excesses.sum():
            text = (
                f"the highest peak of the baseline, {self.peaks.index[0]}, has a damage index of {highest:.3g}, the "
                f"next {second:.3g}: chance explains that in fewer than 1 % of baselines. It raises the threshold to "
                f"{self.threshold:.3g}, which may hide damage. Put NaN there if it is a fault or another state"
            )
            yield RecordsWarning(text, "baseline-peak")


def whole_weeks(records: pd.DataFrame, most: int) -> pd.DataFrame:
    """Whole weeks, evenly spread, of at most some number of records, or one week."""
    if len(records) <= most:
        return records
    blocks = blocks_of(records.index)
    n_blocks = blocks.max() + 1
    chosen = np.unique(np.linspace(0, n_blocks - 1, max(n_blocks * most // len(records), 1)).astype(int))
    return records[np.isin(blocks, chosen)]


def lowered(records: pd.DataFrame, falls: Mapping[Any, Any]) -> pd.DataFrame:
    """Records in which some responses are lower."""
    changed = records.copy()
    for name, fall in falls.items():
        changed[name] -= fall
    return changed


def crossing(steps: Array, ratios: Array) -> float:
    """The step at which a ratio exceeds 1; NaN if it does so without any.

    Squared indices grow with squared steps, nearly on straight lines.
    """
    squares = ratios**2
    above = np.flatnonzero(squares > 1)
    if len(above) and above[0] == 0:
        return np.nan
    after = above[0] if len(above) else len(steps) - 1
    slope = (squares[after] - squares[after - 1]) / (steps[after] ** 2 - steps[after - 1] ** 2)
    return float(np.sqrt(steps[after - 1] ** 2 + (1 - squares[after - 1]) / slope)) if slope > 0 else np.nan


@dataclass(frozen=True)
class SmallestChanges:
    """Falls of responses that a threshold sees: half of the records are above it, and an alarm follows ``within`` days.

    ``common`` is that of all responses by one share, NaN where some are not positive throughout; ``single`` that of
    each alone, a share where ``is_relative``, else in its unit. ``groups`` are losses of stiffness of damage groups, of
    a detector that has their directions. NaN where no fall or loss is seen.
    """

    common: float
    single: dict[Any, float]
    is_relative: bool
    within: pd.Timedelta
    groups: dict[str, float] = field(default_factory=dict)

    @classmethod
    def measured(
        cls,
        index_of: Callable[[pd.DataFrame], Array],
        records: pd.DataFrame,
        names: Sequence[Any],
        threshold: float,
        within: pd.Timedelta,
        losses: pd.DataFrame | None = None,
        steps: Sequence[float] = (0.0, 0.5, 2.0, 5.0),
    ) -> SmallestChanges:
        """Falls by which the median of the indices, ``index_of`` records in order of time, exceeds a threshold.

        ``losses`` are relative changes of the responses, in their order, by the loss of each damage group that moves a
        record by one standard deviation; their column ``"loss"`` is that loss. ``steps`` are in standard deviations.
        """
        some = whole_weeks(records, 1000)
        responses = some[list(names)]
        deviations = records[list(names)].std(ddof=0).replace(0.0, 1.0)
        is_relative = bool((records[list(names)].min() > 0).all())
        shares = deviations / (responses.mean() if is_relative else 1.0)
        changes = {("single", name): (shares[name], {name: deviations[name]}) for name in names}
        if is_relative:
            share = float(np.median(shares))
            changes["common", ""] = share, {name: share * responses[name] for name in names}
        for group, row in (pd.DataFrame() if losses is None else losses).iterrows():
            falls = -row.drop("loss").to_numpy() * responses
            changes["groups", group] = float(row["loss"]), {name: falls[name] for name in names}
        start, found = index_of(some), {"single": {}, "common": {}, "groups": {}}
        for (kind, name), (size, falls) in changes.items():
            by_step = ({one: step * fall for one, fall in falls.items()} for step in steps[1:])
            indices = np.array([start, *(index_of(lowered(some, one)) for one in by_step)])
            known = indices[:, ~np.isnan(indices).any(axis=0)]
            fall = crossing(size * np.array(steps), np.median(known, axis=1) / threshold) if known.size else np.nan
            found[kind][name] = fall if fall < 1 or not (is_relative or kind == "groups") else np.nan
        return cls(found["common"].get("", np.nan), found["single"], is_relative, within, found["groups"])

    def as_dict(self) -> dict[str, Any]:
        """Plain values: NaN is None, ``within`` in seconds."""
        single, groups = (
            {str(name): _known(value) for name, value in some.items()} for some in (self.single, self.groups)
        )
        within = self.within.total_seconds()
        return {"common": _known(self.common), "single": single, "groups": groups, "within": within}

    def __str__(self) -> str:
        parts = [f"a fall of all responses by {percent(self.common, '.2g')}"] if np.isfinite(self.common) else []
        if single := _range_text(self.single, "{:.2g} %" if self.is_relative else "{:.2g}"):
            parts.append(f"{'of' if parts else 'a fall of'} one response alone {single}")
        if groups := _range_text(self.groups, "{:.2g} %"):
            parts.append(f"a loss of stiffness {groups}")
        if not parts:
            return "no fall of the responses raises an alarm"
        text = f"{', or '.join(parts)} raises an alarm within {duration_text(self.within)}"
        return text.replace("\N{NO-BREAK SPACE}", " ")


def _range_text(changes: Mapping[Any, float], form: str) -> str:
    """The smallest and the largest of some changes, with their names; "" where none is seen."""
    seen = {name: value for name, value in changes.items() if np.isfinite(value)}
    if not seen:
        return ""
    ends = dict.fromkeys((min(seen, key=seen.__getitem__), max(seen, key=seen.__getitem__)))
    factor = 100 if "%" in form else 1
    return "by " + " to ".join(f"{form.format(factor * seen[name])} ({name})" for name in ends)


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
