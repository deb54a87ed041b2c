"""The threshold of a damage index: how many false events a healthy structure has, and which changes it detects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import gamma, nbinom

from skthermo._core.arrays import Array
from skthermo._core.frames import DAY, YEAR, correlation_time
from skthermo._core.text import counted_number, duration_text, percent
from skthermo._core.warnings import warn_user
from skthermo.exceptions import FewRecordsWarning, RecordsWarning, ResultWarning, WeatherWarning
from skthermo.monitoring._events import EventRule, find_events, levels

WEEK = pd.Timedelta("7D")
STEPS = (0.0, 0.5, 2.0, 5.0)  # standard deviations of a response, by which it is lowered
MOST_PROBED = 1000  # records of the baseline that are lowered, whole weeks of them
LARGE = 0.025  # fall of all natural frequencies that a monitor should see: 5 % of the stiffness of the structure
N_PEAKS = 16  # highest excursions of the baseline from which the tail is learned
N_SCALES = 50  # quantiles of the seasonal scale over which the tail is averaged
COVERAGE = 0.9  # share of the numbers of false alarms in a year that lie between `lowest` and `highest`
NEAR = 15  # days of the year, up to which a record stands for the season around it
SEASON = 30  # days of the year, before and after each, whose records give its scale
LEAST_INDEX = 0.1  # share of the median index above 0, as which smaller ones count for the scale of a season
FEWEST_PEAKS = 3
FEW_PEAKS = 6  # excursions below which days count in their place
USUALLY, NEARLY_ALWAYS = 0.5, 0.98
"""Shares of the days of a baseline that stay within a level: an excursion goes on beyond the first, an event beyond the
second."""
DOUBTFUL = 0.01  # share of healthy baselines whose highest excursion is said to be far beyond the others
HEAVY = 0.2  # the same share, from which on probabilities are those of a heavier tail
FAR = 0.4  # events asked for in the time of the baseline, below which the threshold is far beyond its excursions
N_NODES = 400  # at which that distribution is averaged over what the baseline leaves open


def blocks_of(times: pd.DatetimeIndex, length: pd.Timedelta = WEEK) -> NDArray[np.intp]:
    """Number of the block of each record, counted without gaps."""
    numbers = (times - times[0]) // length
    return np.unique(numbers, return_inverse=True)[1]


def whole_weeks(records: pd.DataFrame, most: int) -> pd.DataFrame:
    """Whole weeks, evenly spread, of at most some number of records, or one week."""
    if len(records) <= most:
        return records
    blocks = blocks_of(records.index)
    n_blocks = blocks.max() + 1
    chosen = np.unique(np.linspace(0, n_blocks - 1, max(n_blocks * most // len(records), 1)).astype(int))
    return records[np.isin(blocks, chosen)]


def lowered(records: pd.DataFrame, falls: Mapping[Any, Any]) -> pd.DataFrame:
    """Records of which some responses are lower."""
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

    @property
    def is_large(self) -> bool:
        """Whether a large fall of all responses is not detected, and a larger one is."""
        return self.is_relative and self.common > LARGE

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


def smallest_by_threshold(
    index_of: Callable[[pd.DataFrame], Array],
    records: pd.DataFrame,
    names: Sequence[Any],
    deviations: Array,
    within: pd.Timedelta,
    losses: pd.DataFrame | None = None,
) -> Callable[[float], SmallestChanges]:
    """By a threshold, the falls of responses by which the median index of a baseline exceeds it.

    ``index_of`` are a detector's indices of records in order of time; ``deviations`` are those of the responses.
    ``losses`` are relative changes of the responses, in their order, by the loss of each damage group that moves a
    record by one standard deviation; their column ``"loss"`` is that loss.
    """
    some = whole_weeks(records, MOST_PROBED)
    responses = some[list(names)]
    is_relative = bool((records[list(names)].min() > 0).all())
    shares = deviations / (responses.mean().to_numpy() if is_relative else 1.0)
    changes = [
        ("single", name, share, {name: size}) for name, share, size in zip(names, shares, deviations, strict=True)
    ]
    if is_relative:
        share = float(np.median(shares))
        changes.append(("common", "", share, dict((share * responses).items())))
    for group, row in (pd.DataFrame() if losses is None else losses).iterrows():
        falls = -row.drop("loss").to_numpy() * responses
        changes.append(("groups", group, float(row["loss"]), dict(falls.items())))
    start, medians = index_of(some), []
    for *_, falls in changes:
        by_step = ({name: step * size for name, size in falls.items()} for step in STEPS[1:])
        medians.append(_medians(np.array([start, *(index_of(lowered(some, one)) for one in by_step)])))

    def at(threshold: float) -> SmallestChanges:
        found: dict[str, dict[Any, float]] = {"single": {}, "common": {}, "groups": {}}
        for (kind, name, size, _), of_steps in zip(changes, medians, strict=True):
            fall = crossing(size * np.array(STEPS), of_steps / threshold)
            found[kind][name] = fall if fall < 1 or not (is_relative or kind == "groups") else np.nan
        return SmallestChanges(found["common"].get("", np.nan), found["single"], is_relative, within, found["groups"])

    return at


def _medians(indices: Array) -> Array:
    """Median over the records that have an index at each step."""
    known = indices[:, ~np.isnan(indices).any(axis=0)]
    return np.median(known, axis=1) if known.size else np.full(len(indices), np.nan)


@dataclass(frozen=True)
class Tail:
    """The highest excursions of a baseline: k squared peaks above a ``base``, the (k + 1)-th, and their ``excesses``.

    A time as long as the baseline has k + 1 peaks above the base, on average. Taken as exponential, n of them exceed
    the square

        base + sum of excesses (((k + 1) / n)^(1 / k) - 1),

    on average over baselines: exact for an exponential tail, however few peaks there are. Squares are over their scale
    in the season, and those of all seasons are exceeded as often as the mean over ``scales`` says.
    """

    base: float
    excesses: tuple[float, ...]
    scales: tuple[float, ...] = (1.0,)

    @classmethod
    def of(cls, squares: Array, asked: float, scales: tuple[float, ...] = (1.0,)) -> Tail:
        """That of squared peaks, highest first, from which as many as are asked for are to be exceeded."""
        k = int(min(max(N_PEAKS, np.ceil(asked)), len(squares) - 1))
        return cls(float(squares[k]), tuple((squares[:k] - squares[k]).tolist()), scales)

    @property
    def k(self) -> int:
        """Number of peaks above the base."""
        return len(self.excesses)

    @cached_property
    def excess(self) -> float:
        return sum(self.excesses)

    def has_outlier(self, probability: float) -> bool:
        """Whether the highest excess is as large beside the others as that of so few healthy baselines."""
        return max(self.excesses) > _largest_share(self.k, probability) * self.excess

    def factor(self, asked: float) -> float:
        """The excess that so many peaks exceed, in sums of all excesses."""
        return ((self.k + 1) / asked) ** (1 / self.k) - 1

    def height(self, square: float) -> float:
        """The excess over its scale that is exceeded as often as a square, in sums of all excesses; 0 below all."""
        excess = np.maximum(square / np.array(self.scales) - self.base, 0.0) / self.excess
        return float(((1 + excess) ** -self.k).mean() ** (-1 / self.k) - 1)

    def threshold(self, asked: float) -> float:
        height = self.factor(asked)
        square = self.base + height * self.excess
        if len(self.scales) > 1:
            ends = square * min(self.scales) * (1 - 1e-9), square * max(self.scales) * (1 + 1e-9)
            square = brentq(lambda one: self.height(one) - height, *ends)
        return float(np.sqrt(square))

    def p_value(self, square: float, ratio: float, shape: float | None = None) -> float:
        """Probability that a time so many times as long as the baseline has a squared peak as high.

        The number of peaks above the base in that time is negative binomial, as is that of the baseline's own; each
        exceeds the square with the probability exp(-x g), where x is its height above the base in sums of excesses, and
        g what these leave open of the tail, gamma distributed: so that p values of a healthy structure are uniformly
        distributed. Integrated at the quantiles of g where exp(-x g) counts.

        Outliers make tails that are not exponential. A ``shape`` is that of a generalised Pareto tail, 0 that of an
        exponential one. Without it, where the highest excess of the baseline is as far beyond the others as in one
        healthy baseline of five, the logarithms of the squares over the base are taken in place of the excesses: a
        Pareto tail, by which probabilities are larger.
        """
        x = self.height(square)
        if x <= 0:
            return 1.0
        if shape:
            x = np.log1p(shape / (1 - shape) * self.k * x) / (shape * self.k)
        elif shape is None and self.has_outlier(HEAVY):
            logs = np.log1p(np.array(self.excesses) / self.base).sum()
            x = min(x, np.log1p(x * self.excess / self.base) / logs)
        g = _quantiles(self.k) / (1 + x)
        some = -np.expm1(-(self.k + 1) * np.log1p(ratio * np.exp(-x * g)))
        return float((some * np.exp(x * g)).mean() * (1 + x) ** -self.k)

    def numbers(self, asked: float, n_years: float) -> tuple[int, int]:
        """Between which numbers events in one year lie, given what the excesses tell of the tail and of its rate."""
        share = np.exp(-self.factor(asked) * _quantiles(self.k)) / n_years

        def at_most(number: int) -> float:
            return float(nbinom.cdf(number, self.k + 1, 1 / (1 + share)).mean())

        tail, numbers = (1 - COVERAGE) / 2, range(1_000_000)
        lowest, highest = (next(n for n in numbers if at_most(n) >= level) for level in (tail, 1 - tail))
        return lowest, highest


@dataclass(frozen=True)
class FalseAlarmEstimate:
    """A rule for events, and how many of them a healthy structure is expected to have in a year.

    ``expected`` is their number on average over baselines and years. In a single year there are ``lowest`` to
    ``highest`` of them with a probability of 90 %, by chance and because one baseline leaves the rate uncertain.
    ``n_years`` is the time that the baseline's evaluated records cover, ``missing_season`` the seasons without baseline
    records, for which there is no estimate ("" if there is none), ``method`` how the threshold was found, in words.
    """

    rule: EventRule
    expected: float
    lowest: int
    highest: int
    n_years: float
    missing_season: str
    method: str
    tail: Tail

    def __str__(self) -> str:
        expected = counted_number(self.expected, "false alarm")
        return (
            f"{expected} a year on average, {self.lowest} to {self.highest} in a single year with probability 90 %; "
            f"{self.method}" + (f"; no estimate for {self.missing_season}" if self.missing_season else "")
        )

    def p_value(self, peak: float, n_years: float, shape: float | None = None) -> float:
        """Probability that a healthy structure has an event as high in so many years."""
        return self.tail.p_value(peak**2, n_years / self.n_years, shape)


@cache
def _quantiles(k: int) -> Array:
    """Values of a gamma distribution at which what depends on it is averaged."""
    return np.asarray(gamma.ppf((np.arange(N_NODES) + 0.5) / N_NODES, k))


def quiet_levels(index: pd.Series, hold: str | pd.Timedelta = "1D", persistence: int = 1) -> tuple[float, float]:
    """The levels that a healthy structure stays within for the time of ``hold``, usually and nearly always."""
    hold, known = pd.Timedelta(hold), index.dropna()
    stamps = known.index.as_unit("ns").asi8
    whole = stamps - stamps[:1] >= hold.value
    level = pd.Series(levels(known.to_numpy(), persistence)[0], known.index)
    highest = level.rolling(hold, closed="both").max().to_numpy()
    usual, release = np.quantile(highest[whole] if whole.any() else highest, [USUALLY, NEARLY_ALWAYS])
    return float(usual), float(release)


def seasonal_scale(index: pd.Series) -> pd.Series:
    """Scale of the squared indices in the season of each record, from the mean of their logarithms around it.

    It is drawn to 1, the scale of the whole baseline, by as much of its variance as independent seasons would have by
    chance, which the correlation time of what it leaves tells.
    """
    positive = index[index > 0]
    if positive.empty:
        return pd.Series(1.0, index.index)
    logs = 2 * np.log(index.clip(lower=LEAST_INDEX * positive.median()))
    logs -= logs.mean()
    day = np.minimum(index.index.day_of_year, 365) - 1
    around = (np.arange(365)[:, np.newaxis] + np.arange(-SEASON, SEASON + 1)) % 365
    sums, numbers = (np.bincount(day, weights, 365)[around].sum(axis=1) for weights in (logs, None))
    season = (sums / np.maximum(numbers, 1))[day]
    rest = logs - season
    noise = rest.var() * correlation_time(rest.to_numpy()) / numbers[day].mean()
    share = max(1 - noise / season.var(), 0.0) if season.var() > 0 else 0.0
    return pd.Series(np.exp(share * season), index.index)


def estimate_false_alarms(
    index: pd.Series,
    per_year: float = 1.0,
    *,
    hold: str | pd.Timedelta = "1D",
    persistence: int = 1,
    smallest_at: Callable[[float], SmallestChanges] | None = None,
    name: str = "false_alarms_per_year",
) -> FalseAlarmEstimate:
    """The rule by which a healthy structure has so many events in a year, from a baseline's out-of-fold indices.

    An excursion lasts from the first level above the usual one until all levels of ``hold`` have stayed within it. As
    that does not depend on the threshold, the number of events is the number of excursions whose peak exceeds it, and
    the threshold comes from the `Tail` of the squared peaks, each over the `seasonal_scale`. An excursion may be
    several events, as these end at a higher level: in the mean, as many as the highest excursions are. Of a baseline
    with fewer than six excursions, each time of ``hold``, or day if that is longer, counts as one. ``smallest_at``
    gives the smallest changes that a threshold sees, for warnings, ``name`` is what errors call ``per_year``.
    """
    hold, known = pd.Timedelta(hold), index.dropna()
    infinite = known.index[np.isinf(known)]
    if len(known) < 2 or len(infinite):
        raise ValueError(
            f"{len(known)} baseline records have a damage index, {len(infinite)} of them an infinite one"
            f"{f' (the first at {infinite[0]})' if len(infinite) else ''}; expected at least 2, all of them finite"
        )
    found = Excursions.of(known, hold, persistence)
    n_peaks = len(found.squares)
    seen = (
        f"{name} is {per_year:g}, but the baseline of {found.years} has only {counted_number(n_peaks, 'peak')} of "
        "its damage index"
    )
    if n_peaks < FEWEST_PEAKS:
        raise ValueError(f"{seen}; expected at least {FEWEST_PEAKS}")
    if per_year * found.n_years > n_peaks:
        per_year = n_peaks / found.n_years
        warn_user(f"{seen}. The threshold is that of {per_year:.2g} a year", FewRecordsWarning, "few-peaks")
    asked = per_year * found.n_years
    tail = Tail.of(found.squares, asked, found.scales)
    usual, release = quiet_levels(known, hold, persistence)
    half = max(tail.threshold((tail.k + 1) / 2), usual)
    n_events = len(find_events(known.to_numpy(), known.index, EventRule(half, min(release, half), hold, persistence)))
    per_excursion = max(n_events / max((found.table["index"] > half).sum(), 1), 1.0)
    threshold = max(tail.threshold(asked / per_excursion), usual)
    rule = EventRule(threshold, min(release, threshold), hold, persistence)
    lowest, highest = tail.numbers(asked, found.n_years)
    method = (
        f"from the {tail.k + 1} highest of {len(found.squares)} peaks of the damage index in {found.years} of "
        "baseline" + (", extrapolated" if asked < FAR else "")
    )
    found.warn(tail, rule, per_year, None if smallest_at is None else smallest_at(rule.threshold))
    return FalseAlarmEstimate(rule, per_year, lowest, highest, found.n_years, found.missing_season, method, tail)


@dataclass(frozen=True)
class Excursions:
    """Excursions of a baseline's indices beyond the level that they stay within, or its days if they are few, the
    highest first.

    ``table`` has ``peak``, over the root of the seasonal scale, ``index`` and ``peak_time``; ``scales`` are quantiles
    of that scale. ``n_years`` is the time that the records cover, ``missing_season`` what they do not, in words.
    """

    table: pd.DataFrame
    scales: tuple[float, ...]
    n_years: float
    missing_season: str

    @classmethod
    def of(cls, known: pd.Series, hold: pd.Timedelta, persistence: int) -> Excursions:
        """Of indices in order of time, all of them finite."""
        scale = seasonal_scale(known)
        standard = known / np.sqrt(scale)
        quiet, _ = quiet_levels(standard, hold, persistence)
        table = find_events(standard.to_numpy(), known.index, EventRule(quiet, quiet, hold, persistence))
        if len(table) < FEW_PEAKS:
            level = pd.Series(levels(standard.to_numpy(), persistence)[0], known.index)
            at = level.groupby(blocks_of(known.index, max(hold, DAY))).idxmax()
            table = pd.DataFrame({"peak": level[at].to_numpy(), "peak_time": at.to_numpy()}).query("peak > 0")
        table["index"] = table["peak"] * np.sqrt(scale[table["peak_time"]].to_numpy())
        scales = np.quantile(scale, (np.arange(N_SCALES) + 0.5) / N_SCALES) if np.ptp(scale) > 0 else np.ones(1)
        table = table.sort_values("peak", ascending=False)
        return cls(table, tuple(scales.tolist()), _years(known.index, hold), _days_without_records(known.index))

    @property
    def squares(self) -> Array:
        """Squared peaks."""
        return self.table["peak"].to_numpy() ** 2

    @property
    def years(self) -> str:
        """The time that the records cover, in words."""
        return counted_number(self.n_years, "year", 2)

    def warn(self, tail: Tail, rule: EventRule, per_year: float, seen: SmallestChanges | None) -> None:
        """Warn of a threshold without some seasons, from too short a time, or raised by a single excursion."""
        highest, second = self.table["index"].iloc[:2]
        asked = per_year * self.n_years
        if self.missing_season:
            warn_user(
                f"the baseline has no record of {self.missing_season}. The number of false alarms is that of the other "
                "seasons, and unknown for these. Refit with a whole year",
                WeatherWarning,
                "missing-seasons",
            )
        if asked < FAR:
            now = "" if seen is None else f" Now {seen}."
            warn_user(
                f"at {counted_number(per_year, 'false alarm')} a year, {asked:.2g} events are expected in the "
                f"{self.years} of the baseline; it should be {FAR} or more. The threshold {rule.threshold:.3g} is "
                f"extrapolated from the peaks of its damage index, the highest of them {highest:.3g}.{now} Use a "
                "longer baseline, or allow more alarms a year",
                FewRecordsWarning,
                "extrapolated-threshold",
            )
        elif seen is not None and seen.is_large:
            warn_user(
                f"the threshold {rule.threshold:.3g} is so high that {seen} (expected an alarm at {100 * LARGE:g} % of "
                "all responses). Smaller changes count as healthy. Use a longer window or a closer regression, or "
                "allow more alarms a year",
                ResultWarning,
                "undetected-changes",
            )
        if tail.has_outlier(DOUBTFUL):
            others = Tail.of(self.squares[1:], asked, self.scales).threshold(asked)
            warn_user(
                f"the highest peak of the baseline, {self.table['peak_time'].iloc[0]}, has a damage index of "
                f"{highest:.3g}, the next {second:.3g}: chance explains that in fewer than {DOUBTFUL:.0%} of "
                f"baselines. It raises the threshold from {others:.3g} to {rule.threshold:.3g}, which may hide damage. "
                "Put NaN there if it is a fault or another state",
                RecordsWarning,
                "baseline-peak",
            )


def _years(stamps: pd.DatetimeIndex, hold: pd.Timedelta) -> float:
    """Time that records cover; of a gap, only the time that ends an event, or the usual step."""
    steps = np.diff(stamps.as_unit("ns").asi8).astype(float)
    return float(np.minimum(steps, max(hold.value, np.median(steps))).sum() / YEAR.value) if len(steps) else 0.0


def _largest_share(k: int, probability: float) -> float:
    """Share that the largest of k exponential excesses has of their sum with a probability (Fisher, Cochran)."""
    return 1.0 - (probability / k) ** (1 / (k - 1)) if k > 1 else 1.0


def _days_without_records(stamps: pd.DatetimeIndex) -> str:
    """Days of the year that no record is near, as their number and the longest stretch of them; "" if there is none."""
    seen = np.zeros(365, dtype=bool)
    days = np.unique(np.minimum(stamps.day_of_year, 365) - 1)
    seen[(days[:, np.newaxis] + np.arange(-NEAR, NEAR + 1)) % 365] = True
    if seen.all():
        return ""
    at = np.flatnonzero(np.tile(seen, 2))
    longest = int(np.diff(at).argmax())
    ends = [
        pd.Timestamp("2001-01-01") + pd.Timedelta(days=int(day % 365)) for day in at[[longest, longest + 1]] + [1, -1]
    ]
    return f"{(~seen).sum()} days of the year ({' to '.join(f'{day.day} {day.month_name()}' for day in ends)})"
