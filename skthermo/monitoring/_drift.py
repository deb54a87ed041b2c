"""Slow change of stiffness in daily means of frequencies: how it is followed in service, and its history over years."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from skthermo._core.arrays import Array, as_floats, check_probability, is_real, means_of_known, refuse_no_table
from skthermo._core.estimators import check_is_fitted
from skthermo._core.frames import DAY, YEAR, days_later, frame_like, has_stamps, midnights, midnights_between
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.text import SPACE, Sentences, counted, listed, percent, probability_text, significant
from skthermo._core.warnings import warn_each
from skthermo.fem.damage import ALL_GROUPS, read_groups
from skthermo.preprocessing.checks import set_aside
from skthermo.residuals.gaussian import Gaussian


def read_slopes(fem: Any, groups: Sequence[str] | Mapping[str, Sequence[str]] | None) -> tuple[list[str], Array]:
    """Names of damage groups, last "all groups" alike, and d ln f / d ln stiffness, (n_modes, n_groups)."""
    members = read_groups(fem.model, groups)
    if len(members) > 1:
        members[ALL_GROUPS] = list(dict.fromkeys(name for joined in members.values() for name in joined))
    asked = list(dict.fromkeys(name for joined in members.values() for name in joined))
    directions = fem.damage_directions(asked, kind="stiffness")
    slopes = [-directions.reindex(joined).fillna(0.0).sum().to_numpy() for joined in members.values()]
    return list(members), np.column_stack(slopes)


def daily_means(T: pd.DataFrame, y: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Means of two tables over each calendar day from the first record to the last, NaN without any."""
    days, calendar = midnights(y.index), midnights_between(y.index.min(), y.index.max())
    return T.groupby(days).mean().reindex(calendar), y.groupby(days).mean().reindex(calendar)


@dataclass(frozen=True)
class DailyWeather:
    """Columns of a regression on daily mean temperatures: a cubic of their principal components, and exponential
    means of the first one, which stand for what follows the weather slowly.

    ``usual`` is the distribution of daily means, by which a missing thermometer is filled from the others.
    """

    usual: Gaussian
    axes: Array
    half_lives: tuple[float, ...]

    @classmethod
    def fitted(
        cls, T: Array, most: int = 3, share: float = 0.02, half_lives: tuple[float, ...] = (5.0, 30.0)
    ) -> DailyWeather:
        """Axes with more than a share of the largest one's variance, ``most`` of them or fewer."""
        usual = Gaussian.fitted(T[~np.isnan(T).all(axis=1)])
        scale = np.sqrt(np.maximum(np.diag(usual.covariance), 1e-6))
        sizes, axes = np.linalg.eigh(usual.covariance / np.outer(scale, scale))
        kept = np.flatnonzero(sizes > share * sizes[-1])[-most:][::-1]
        own = np.diag(1e-9 * scale**2)  # so that a thermometer may repeat another one
        usual = replace(usual, covariance=usual.covariance + own)
        return cls(usual, axes[:, kept] / scale[:, np.newaxis] / np.sqrt(sizes[kept]), half_lives)

    def of_days(self, T: Array, start: Array | None = None) -> tuple[Array, Array]:
        """Columns of successive days, and the exponential means on the last one, which stay where a day is unknown."""
        coordinates = (self.usual.completed(T)[0] - self.usual.mean) @ self.axes
        share, first = 1 - 0.5 ** (1 / np.array(self.half_lives)), coordinates[:, 0]
        known = first[~np.isnan(first)][:10]
        last = np.full(len(share), known.mean() if len(known) else 0.0) if start is None else start
        earlier = np.empty((len(T), len(share)))
        for day, value in enumerate(first):
            last = last if np.isnan(value) else last + share * (value - last)
            earlier[day] = last
        one, other = np.triu_indices(coordinates.shape[1])
        products, constant = coordinates[:, one] * coordinates[:, other], 1 + 0 * coordinates[:, :1]
        return np.hstack([constant, coordinates, products, coordinates**3, earlier]), last


def whitened(X: Array, y: Array, correlation: float, n_before: int = 0) -> tuple[Array, Array]:
    """Rows of one mode less their prediction from the day before; those after gaps are scaled to equal variances.

    Without the first days, ``n_before``, which only predict.
    """
    days = np.flatnonzero(~np.isnan(y) & ~np.isnan(X).any(axis=1))
    kept = np.r_[0.0, correlation ** np.diff(days).astype(float)][: len(days)]
    scale = np.sqrt((1 - correlation**2) / (1 - kept**2))
    table = np.column_stack([X, y])[days]
    before = np.vstack([0 * table[:1], table[:-1]])
    rows = (scale[:, np.newaxis] * (table - kept[:, np.newaxis] * before))[days >= n_before]
    return rows[:, :-1], rows[:, -1]


def lasting_covariance(rows: Array, lags: int) -> Array:
    """Sum of products of rows, and of those up to so many lags apart with weights that fall to zero (Newey, West)."""
    total = rows.T @ rows
    for lag in range(1, lags + 1):
        product = rows[lag:].T @ rows[:-lag]
        total += (1 - lag / (lags + 1)) * (product + product.T)
    return total


def slow_squares(rows: Array, n_waves: int = 12, n_fitted: int = 4) -> Array:
    """Squares that each column would sum up to if it were as large at all frequencies as at the lowest.

    From its products with some waves over all rows, as many as half of their number; a regression on the season and on
    time has taken a few of these.
    """
    share = (np.arange(len(rows)) + 0.5) / len(rows)
    waves = np.sqrt(2) * np.cos(np.pi * np.outer(np.arange(1, n_waves + 1), share))
    return ((waves @ rows) ** 2).sum(axis=0) / (n_waves - n_fitted)


@dataclass(frozen=True)
class DailyNoise:
    """Correlation of residuals of neighbouring days, and covariance of what each day adds to them.

    The covariance is that of a day times the number of days for which additions last.
    """

    correlation: float
    covariance: Array

    @classmethod
    def fitted(cls, residuals: Array, n_columns: int, lags: int = 10, *, lasts_for_months: bool = True) -> DailyNoise:
        """From residuals by day, NaN where a mode is missing, of a regression on so many columns.

        Additions that last for some days show in their products; those that last for months, such as moisture, in
        waves over all days. The larger variance counts.
        """
        known = ~np.isnan(residuals)
        pairs, rest = known[1:] & known[:-1], np.nan_to_num(residuals)
        products, squares = np.where(pairs, rest[1:] * rest[:-1], 0).sum(), np.where(pairs, rest[1:] ** 2, 0).sum()
        correlation = float(np.clip(products / max(squares, 1e-300), 1e-6, 0.98))
        added, n_days = np.zeros(residuals.shape), known.sum(axis=0)
        for mode, column in enumerate(residuals.T):
            added[known[:, mode], mode] = whitened(np.zeros((len(column), 0)), column, correlation)[1]
        total = lasting_covariance(added, min(lags, len(added) // 5))
        larger = np.ones(len(total))
        if lasts_for_months:
            larger = np.sqrt(np.fmax(slow_squares(added) / np.maximum(np.diag(total), 1e-300), 1.0))
        lost = n_days.max() / max(n_days.max() - n_columns, 1)
        covariance = lost * total * np.outer(larger, larger) / np.sqrt(np.outer(n_days, n_days)).clip(1)
        return cls(correlation, covariance + 1e-16 * np.eye(len(covariance)))

    @property
    def deviations(self) -> Array:
        return np.sqrt(np.diag(self.covariance))

    def independent(self, n_days: float) -> float:
        """As how many independent days so many count."""
        return n_days * (1 - self.correlation) / (1 + self.correlation)


def bending_line(years: Array, bends: Array) -> Array:
    """A line through zero, and ramps from each bend on, (n_days, 1 + n_bends)."""
    return np.column_stack([years, np.maximum(years[:, np.newaxis] - bends, 0.0)])


@dataclass(frozen=True)
class NormalEquations:
    """Those of a regression of each mode on the same columns, of days that have the mode."""

    information: Array
    moments: Array

    @classmethod
    def summed(cls, X: Array, y: Array, correlation: float, n_before: int = 0) -> NormalEquations:
        """Those of successive days, whose noise is correlated; the first ones may only predict."""
        parts = [whitened(X, column, correlation, n_before) for column in y.T]
        return cls(np.array([rows.T @ rows for rows, _ in parts]), np.array([rows.T @ own for rows, own in parts]))

    def first(self, size: int) -> NormalEquations:
        """Without later columns."""
        return NormalEquations(self.information[:, :size, :size], self.moments[:, :size])

    def __add__(self, later: NormalEquations) -> NormalEquations:
        """With those of other days, in whose regression there may be more columns."""
        more = later.moments.shape[1] - self.moments.shape[1]
        information = np.pad(self.information, [(0, 0), (0, more), (0, more)]) + later.information
        return NormalEquations(information, np.pad(self.moments, [(0, 0), (0, more)]) + later.moments)

    def solved(self, noise: Array, deviations: Array) -> tuple[Array, Array]:
        """Coefficients, (n_modes, n_columns), and roots of their covariances.

        ``noise`` are standard deviations by mode, ``deviations`` those that the coefficients have beforehand.
        """
        weight = noise[:, np.newaxis, np.newaxis] ** -2.0
        covariance = np.linalg.inv(self.information * weight + np.diag(deviations**-2.0))
        coefficients = np.einsum("mpq,mq->mp", covariance, self.moments * weight[:, 0])
        return coefficients, np.linalg.cholesky((covariance + covariance.swapaxes(1, 2)) / 2)


def prior_deviations(n_weather: int, n_times: int, mislearned: float = 0.3, trend: float = 0.3) -> Array:
    """Prior standard deviations of the coefficients of ln f: a wide one of the constant, then weather and time."""
    return np.r_[10.0, np.full(n_weather - 1, mislearned), np.full(n_times, trend)]


@dataclass(frozen=True)
class ModeTrends:
    """Coefficients of the bending line of each mode, mode by mode, and their covariance, and what groups move them.

    ``freedom`` is that of the noise's covariance.
    """

    mean: Array
    covariance: Array
    slopes: Array
    freedom: float

    @classmethod
    def fitted(
        cls, equations: NormalEquations, noise: DailyNoise, slopes: Array, n_times: int, freedom: float
    ) -> ModeTrends:
        size = equations.moments.shape[1]
        coefficients, roots = equations.solved(noise.deviations, prior_deviations(size - n_times, n_times))
        rows, correlation = roots[:, -n_times:], noise.covariance / np.outer(noise.deviations, noise.deviations)
        covariance = np.einsum("mn,mip,njp->minj", correlation, rows, rows, optimize=True)
        covariance = covariance.reshape(2 * [rows.shape[0] * n_times])
        covariance += 1e-9 * np.diag(np.diag(covariance))  # of modes that are copies of each other
        return cls(coefficients[:, -n_times:].ravel(), covariance, slopes, freedom)

    @property
    def n_times(self) -> int:
        return len(self.mean) // len(self.slopes)

    def p_value(self) -> float:
        """Probability that one of the groups would seem to change as clearly by chance, of a line that does not bend.

        Student's law of the largest change in its standard errors, times the number of groups (Bonferroni).
        """
        weighted = np.linalg.solve(self.covariance, np.column_stack([self.slopes, self.mean]))
        products = self.slopes.T @ weighted
        scores = np.abs(products[:, -1]) / np.sqrt(np.maximum(np.diag(products), 1e-300))
        return float(min(2 * len(scores) * stats.t.sf(scores.max(), max(self.freedom, 3.0)), 1.0))

    def design(self, groups: Sequence[int]) -> Array:
        return np.kron(self.slopes[:, list(groups)], np.eye(self.n_times))

    def evidence(self, groups: Sequence[int], deviations: Array) -> float:
        """Logarithm of how many times likelier these are with drift of some groups than without any."""
        design = self.design(groups) * np.tile(deviations, len(groups))
        laws = (self.covariance, self.covariance + design @ design.T)
        none, drift = (stats.multivariate_normal.logpdf(self.mean, cov=law, allow_singular=True) for law in laws)
        return float(drift - none)

    def of_groups(self, groups: Sequence[int], deviations: Array) -> tuple[Array, Array]:
        """Coefficients of ln stiffness, group by group, if no others drift, and their covariance."""
        design = self.design(groups)
        weighted = np.linalg.solve(self.covariance, design)
        prior = np.tile(np.maximum(deviations, 1e-7) ** -2.0, len(groups))
        covariance = np.linalg.inv(design.T @ weighted + np.diag(prior))
        return covariance @ weighted.T @ self.mean, covariance


@dataclass(frozen=True)
class DriftExplanation:
    """Sets of groups that may drift, by decreasing evidence, beside the trends of the modes.

    ``bend`` is the standard deviation of a yearly bend by which the best set explains the trends.
    """

    trends: ModeTrends
    names: list[str]
    sets: list[tuple[int, ...]]
    evidence: Array
    bend: float

    @classmethod
    def weighed(cls, trends: ModeTrends, names: list[str], rate: float = 0.03) -> DriftExplanation:
        """All sets of one or two groups, and a change of all alike; most often one group drifts, and steadily."""
        apart = [place for place, name in enumerate(names) if name != ALL_GROUPS]
        sets = [*((place,) for place in range(len(names))), *combinations(apart, 2)]
        shares = {1: 0.8 / len(names), 2: 0.2 / max(len(sets) - len(names), 1)}
        bends = (0.0, 0.005, 0.02)[: trends.n_times + 1 if trends.n_times > 1 else 1]
        table = [
            [
                trends.evidence(one, np.r_[rate, np.full(trends.n_times - 1, bend)]) + np.log(shares[len(one)])
                for bend in bends
            ]
            for one in sets
        ]
        evidence = np.logaddexp.reduce(table, axis=1) - np.log(len(bends))
        order = np.argsort(-evidence, kind="stable")
        bend = bends[int(np.argmax(table[order[0]]))]
        return cls(trends, names, [sets[place] for place in order], evidence[order], bend)

    @property
    def probabilities(self) -> Array:
        weights = np.exp(self.evidence - self.evidence[0])
        return weights / weights.sum()

    def alternatives(self, as_likely: float = 3.0) -> dict[str, list[str]]:
        """For each group of the best set, those that explain the trends about as well in its place."""
        best = set(self.sets[0])
        likely = [set(one) for one in np.array(self.sets, dtype=object)[self.evidence[0] - self.evidence <= as_likely]]
        found = {}
        for group in sorted(best):
            others = best - {group}
            rivals = {place for one in likely if len(one) == len(best) and others < one for place in one - others}
            found[self.names[group]] = [self.names[place] for place in sorted(rivals)]
        return found

    def change(self, group: int, beside: Sequence[int], line: Array) -> tuple[Array, Array]:
        """Ln stiffness of a group by day, and its standard deviation, if some others drift as well.

        Three per cent of it may be an error of the FE model's effects.
        """
        deviations = np.r_[0.1, np.full(self.trends.n_times - 1, self.bend)]
        coefficients, covariance = self.trends.of_groups([group, *beside], deviations)
        size = self.trends.n_times
        mean = line @ coefficients[:size]
        spread = np.sqrt(np.einsum("ti,ij,tj->t", line, covariance[:size, :size], line))
        return mean, np.hypot(spread, 0.03 * mean)


def regressed(X: Array, y: Array, n_times: int, **noise_options: bool) -> tuple[NormalEquations, DailyNoise]:
    """Normal equations of the modes on columns, the last ones of time, and the noise beside them."""
    size, noise = X.shape[1], DailyNoise(1e-6, np.diag(np.nanvar(y, axis=0)))
    prior = prior_deviations(size - n_times, n_times)
    for _ in range(2):  # the first time as if days were independent
        equations = NormalEquations.summed(X, y, noise.correlation)
        rest = y - X @ equations.solved(noise.deviations, prior)[0].T
        noise = DailyNoise.fitted(rest, size, **noise_options)
    return NormalEquations.summed(X, y, noise.correlation), noise


def rate_errors(steady: ModeTrends) -> Array:
    """Standard error of the yearly change of each group if no other drifts; infinite where no mode moves."""
    information = steady.slopes.T @ np.linalg.solve(steady.covariance, steady.slopes)
    with np.errstate(divide="ignore"):
        return 1 / np.sqrt(np.diag(information))


@dataclass(frozen=True)
class DriftState(SavesFrames):
    """What a `DriftFollower` knows at the end of a day.

    ``number`` counts days since the baseline. ``equations`` hold the days that are learned, ``waiting`` are the last of
    these and the days since, a row each: columns of the weather, then the modes. ``sudden`` marks days of a time that
    departs from the prediction: these are never learned.
    """

    day: pd.Timestamp
    number: int
    equations: NormalEquations
    earlier: Array
    waiting: Array
    sudden: Array


@dataclass(frozen=True)
class DriftFollower:
    """Takes slow drift out of measured frequencies, and leaves sudden changes in.

    The regression of `track_parameters` grows day by day, a month behind: a day is learned when it has waited for
    ``delay`` days, if in all that time the mean of the waiting days agreed with the prediction. So a sudden change is
    never learned as drift, however long it lasts; one that the mean of a month does not show is learned in time, and
    reported as the drift that it looks like. The correction is the drift since the middle of the baseline, times a
    share that is 0 as long as it may be chance and goes to 1 as it becomes clear.
    """

    temperatures: list[Any]
    modes: list[Any]
    groups: list[str]
    slopes: Array
    weather: DailyWeather
    noise: DailyNoise
    years: float
    start_: DriftState
    delay: int = 30
    chance: float = 1e-3

    @classmethod
    def fitted(cls, fem: Any, T: pd.DataFrame, F: pd.DataFrame, groups: Any = None) -> DriftFollower:
        """Learn from the temperatures and frequencies of a baseline, for a fitted chain; by default for all groups."""
        check_is_fitted(fem)
        inputs = list(getattr(fem, "feature_names_in_", ["named temperatures"]))
        missing = [one for one in inputs if one not in T] + [one for one in fem.mode_names_ if one not in F]
        if missing:
            raise ValueError(
                f"the baseline lacks {missing}, to which the chain fem was fitted; expected "
                f"their names among the temperatures {list(T.columns)} and the frequencies {list(F.columns)}"
            )
        names, slopes = read_slopes(fem, groups)
        daily_T, daily_F = daily_means(T[inputs], np.log(F[list(fem.mode_names_)]))
        weather, y = DailyWeather.fitted(daily_T.to_numpy()), daily_F.to_numpy()
        columns, earlier = weather.of_days(daily_T.to_numpy())
        years = len(y) * (DAY / YEAR)
        line = bending_line((np.arange(len(y)) + 1) * (DAY / YEAR) - years / 2, np.empty(0))
        equations, noise = regressed(np.hstack([columns, line]), y, 1)
        state = DriftState(daily_F.index[-1], 0, equations, earlier, np.hstack([columns, y])[-1:], np.array([False]))
        return cls(inputs, list(fem.mode_names_), names, slopes, weather, noise, years, state)

    def start(self) -> DriftState:
        return self.start_

    def advance(self, state: DriftState, T: pd.DataFrame, F: pd.DataFrame) -> DriftState:
        """The state at the end of one complete day; as it is without records, or if that day is known already."""
        if not len(F) or F.index[-1] < days_later(state.day, 1):
            return state
        for _ in midnights_between(state.day, F.index[-1])[1:-1]:
            state = self._with_day(state, np.full(len(self.temperatures), np.nan), np.full(len(self.modes), np.nan))
        means = (means_of_known(as_floats(one)) for one in (T[self.temperatures], np.log(F[self.modes])))
        return self._with_day(state, *means)

    def corrected(self, state: DriftState, F: pd.DataFrame) -> pd.DataFrame:
        """Measured frequencies of the day after a state without the drift that is taken out."""
        shift = dict(zip(self.modes, self.slopes @ np.log1p(self._change(state)), strict=True))
        return F * np.exp([-shift.get(mode, 0.0) for mode in F])

    def taken_out(self, state: DriftState) -> pd.Series:
        """Relative change of each group's stiffness that is taken out of the frequencies."""
        found = pd.Series(self._change(state), pd.Index(self.groups, name="group"), name="change")
        return found.drop(ALL_GROUPS, errors="ignore")

    def _change(self, state: DriftState, rate: float = 0.02, bend: float = 0.01) -> Array:
        """Change that is taken out of each group; 0 for all groups alike, whose change is that of each."""
        trends, line = self._trends(state)
        apart = [place for place, name in enumerate(self.groups) if name != ALL_GROUPS]
        coefficients, covariance = trends.of_groups(apart, np.r_[rate, np.full(trends.n_times - 1, bend)])
        at_day, slopes = np.kron(np.eye(len(apart)), line), self.slopes[:, apart]
        change = at_day @ coefficients
        sizes, axes = np.linalg.eigh(slopes @ at_day @ covariance @ at_day.T @ slopes.T)
        clear = sizes > 1e-8 * sizes[-1]
        distance = float(((slopes @ change @ axes[:, clear]) ** 2 / sizes[clear]).sum())
        by_chance = float(stats.chi2.isf(0.05, clear.sum()))
        found = np.zeros(len(self.groups))
        found[apart] = np.expm1(max(1 - (by_chance / distance) ** 2, 0.0) * change) if distance > 0 else 0.0
        return found

    def report(self, state: DriftState, significance: float = 0.01, limit: float = 0.05) -> pd.DataFrame:
        """Drift of each group since the middle of the baseline, as `track_parameters` finds it.

        Of its stiffness: relative ``change`` and ``standard_error``, the same a year (``per_year``,
        ``per_year_error``), the ``p_value`` of the structure's drift, by which groups it is explained best
        (``significant``, none if that may be chance), and whether such a change is ``beyond_limit``.
        """
        trends, line = self._trends(state)
        p_value = self._trends(state, is_straight=True)[0].p_value()
        explanation = DriftExplanation.weighed(trends, self.groups)
        best = explanation.sets[0] if p_value <= significance else ()
        years, rows = self.years / 2 + state.number * (DAY / YEAR), {}
        for group, name in enumerate(self.groups):
            if name == ALL_GROUPS and group not in best:
                continue
            beside = [one for one in best if one != group]
            (mean,), (deviation,) = explanation.change(group, beside, line[np.newaxis])
            change, error = np.expm1(mean), np.exp(mean) * deviation
            found = group in best, group in best and abs(change) > limit
            rows[name] = change, error, change / years, error / years, p_value, *found
        columns = ["change", "standard_error", "per_year", "per_year_error", "p_value", "significant", "beyond_limit"]
        return pd.DataFrame.from_dict(rows, "index", columns=columns).rename_axis("group")

    def _lines(self, numbers: Array, n_bends: int) -> Array:
        """The bending line on days of service: zero in the middle of the baseline, which bends as each year begins."""
        return bending_line(numbers * (DAY / YEAR) + self.years / 2, np.arange(n_bends) + self.years / 2)

    def _trends(self, state: DriftState, *, is_straight: bool = False) -> tuple[ModeTrends, Array]:
        """Trends of the modes by the days that are learned, and the line on the last day."""
        n_weather = self.start_.equations.moments.shape[1] - 1
        n_times = 1 if is_straight else state.equations.moments.shape[1] - n_weather
        n_days = self.years * (YEAR / DAY) + state.number - len(state.sudden)
        freedom = self.noise.independent(n_days) - n_weather
        equations = state.equations.first(n_weather + n_times)
        trends = ModeTrends.fitted(equations, self.noise, self.slopes, n_times, freedom)
        return trends, self._lines(np.array([state.number]), n_times - 1)[0]

    def _with_day(self, state: DriftState, T: Array, y: Array) -> DriftState:
        """The state after one more day; the day that has waited longest is learned, in a year that may bend."""
        columns, earlier = self.weather.of_days(T[np.newaxis], state.earlier)
        waiting, number = np.vstack([state.waiting, np.r_[columns[0], y]]), state.number + 1
        sudden, equations = np.append(state.sudden, False), state.equations
        sudden[1:] |= self._departs(equations, waiting[1:], number)
        if len(waiting) > self.delay + 1:
            two, y = np.split(waiting[:2], [columns.shape[1]], axis=1)
            numbers = number - self.delay + np.array([-1, 0])
            X = np.hstack([two, self._lines(numbers, 1 + int(numbers[1] * (DAY / YEAR)))])
            y = np.where(sudden[:2, np.newaxis], np.nan, y)
            equations += NormalEquations.summed(X, y, self.noise.correlation, n_before=1)
            waiting, sudden = waiting[1:], sudden[1:]
        return DriftState(days_later(state.day, 1), number, equations, earlier, waiting, sudden)

    def _departs(self, equations: NormalEquations, waiting: Array, number: int, trend: float = 0.01) -> bool:
        """Whether the mean of the days that wait is too far from the prediction."""
        n_modes = len(self.modes)
        n_weather, size = waiting.shape[1] - n_modes, equations.moments.shape[1]
        lines = self._lines(number - np.arange(len(waiting))[::-1], size - n_weather - 1)
        X, y = np.hstack([waiting[:, :n_weather], lines]), waiting[:, n_weather:]
        known = ~np.isnan(y) & ~np.isnan(X).any(axis=1, keepdims=True)
        modes = np.flatnonzero(known.any(axis=0))
        if not len(modes):
            return False
        prior = prior_deviations(n_weather, size - n_weather, trend=trend)
        coefficients, roots = equations.solved(self.noise.deviations, prior)
        weights = known / np.maximum(known.sum(axis=0), 1)
        usual = weights.T @ np.nan_to_num(X)
        apart = np.einsum("tm,tm->m", weights, np.nan_to_num(y)) - np.einsum("mp,mp->m", usual, coefficients)
        rows = np.einsum("mp,mpq->mq", usual, roots)
        n_days = self.noise.independent(1.0) * known.sum(axis=0)
        correlation = self.noise.covariance / np.outer(self.noise.deviations, self.noise.deviations)
        own = self.noise.deviations / np.sqrt((1 - self.noise.correlation**2) * np.maximum(n_days, 1e-9))
        spread = correlation * (rows @ rows.T + np.outer(own, own))
        apart, spread = apart[modes], spread[np.ix_(modes, modes)]
        freedom = max(self.noise.independent(self.years * (YEAR / DAY)) - n_weather, 4.0)
        distance = float(apart @ np.linalg.solve(spread, apart))
        return distance > len(modes) * stats.f.isf(self.chance, len(modes), freedom)


def track_parameters(
    fem: Any,
    T: pd.DataFrame,
    F: pd.DataFrame,
    groups: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
    freq: str = "1D",
    *,
    significance: float = 0.01,
) -> ParameterHistory:
    """Stiffness of damage groups over years, apart from weather and noise.

    Parameters
    ----------
    fem : DataInformedFEM
        Fitted to records of this structure, also to some of these; its model can be damaged.
    T : DataFrame of shape (n_samples, n_sensors)
        Temperatures in degrees Celsius on a ``DatetimeIndex``.
    F : DataFrame of shape (n_samples, n_modes)
        Measured frequencies in Hz on the same index; NaN is allowed.
    groups : sequence of str, or mapping of str to sequence of str, optional
        Damage groups of the model; a mapping joins several under a new name, with one change. By default all groups of
        the model, without those that other groups make up.
    freq : str, default="1D"
        Step of the table: a day or some days, such as "7D".
    significance : float, default=0.01
        Probability with which a structure that does not age counts as drifting.

    Returns
    -------
    ParameterHistory
        Relative stiffness of each group by day with bands, rates a year, and when a limit is reached.

    Raises
    ------
    ValueError
        If fem is not a fitted chain or its model cannot be damaged, T and F are no frames with times, differ in rows or
        have other columns than in fit, a group is unknown, the step is not a day or some days, or no mode was
        measured on enough days.

    See Also
    --------
    Monitor : Follows drift day by day.
    skthermo.studies.identify_damage : Which damage explains a sudden shift.

    Notes
    -----
    Daily means of ln f are regressed on a cubic of the weather and on a line that may bend once a year. The covariance
    of its coefficients allows for residuals that last for days (Newey and West) or for months. By the derivatives of
    the FE model, the slopes of the line are changes of groups; the largest one in its standard errors says whether
    there is a drift. Changes of one or two groups explain it.

    Bands allow for an error of 3 % of the FE model's effects; if it is less accurate than that, they are too narrow.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.monitoring import track_parameters
    >>> from skthermo.surrogate import DataInformedFEM
    >>> years = make_truss_campaign(3, drift={"bottom": 0.02}, random_state=0)
    >>> T, F = years.temperatures, years.frequencies
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(T[:365], F[:365])
    >>> history = track_parameters(fem, T, F, freq="7D")
    >>> history.has_drift, history.rates["per_year"].idxmin()
    (True, 'bottom')
    """
    check_probability(significance, "significance")
    step = _step_of(freq)
    T, F = _checked(fem, T, F)
    names, slopes = read_slopes(fem, groups)
    daily_T, daily_F = daily_means(T, np.log(F))
    days, y = daily_F.index, daily_F.to_numpy()
    years = np.arange(len(days)) * (DAY / YEAR)
    line = bending_line(years, np.arange(1, int(years[-1])))
    X = DailyWeather.fitted(daily_T.to_numpy()).of_days(daily_T.to_numpy())[0]
    n_known = (~np.isnan(y) & ~np.isnan(X[:, :1])).sum(axis=0)
    few = n_known < 3 * (X.shape[1] + line.shape[1])
    if few.all():
        counts = ", ".join(f"{mode} {number}" for mode, number in zip(F, n_known, strict=True))
        least = 3 * (X.shape[1] + line.shape[1])
        raise ValueError(f"modes were measured, with temperatures, on too few days: {counts}; expected {least} or more")
    equations, noise = regressed(np.hstack([X, line]), y[:, ~few], line.shape[1])
    freedom = noise.independent(n_known.max()) - X.shape[1]
    trends = ModeTrends.fitted(equations, noise, slopes[~few], line.shape[1], freedom)
    steady = ModeTrends.fitted(equations.first(X.shape[1] + 1), noise, slopes[~few], 1, freedom)
    p_value, explanation = steady.p_value(), DriftExplanation.weighed(trends, names)
    best = explanation.sets[0] if p_value <= significance else ()
    alternatives = explanation.alternatives() if best else {}
    changes = {}
    for group, name in enumerate(names):
        beside = [one for one in best if one != group and name not in alternatives[names[one]]]
        changes[name] = explanation.change(group, beside, line)
    at_end = np.kron(np.eye(len(trends.slopes)), line[-1:])
    errors = np.sqrt(np.diag(at_end @ trends.covariance @ at_end.T))
    shifts = sum((np.outer(changes[names[group]][0], slopes[:, group]) for group in best), np.zeros(y.shape))
    modes = pd.DataFrame(np.nan, pd.Index(F.columns, name="mode"), ["measured", "explained", "standard_error"])
    modes.loc[~few] = np.column_stack([at_end @ trends.mean, shifts[-1, ~few], errors])
    return ParameterHistory(
        table=pd.DataFrame(
            {
                (name, what): np.exp(mean + side * deviation)[::step]
                for name, (mean, deviation) in changes.items()
                for what, side in zip(
                    ["estimate", "ci_low", "ci_high"], stats.norm.ppf([0.5, 0.025, 0.975]), strict=True
                )
            },
            days[::step],
        ),
        rates=_rates(explanation, alternatives, changes, rate_errors(steady), years[-1], significance),
        p_value=p_value,
        significance=significance,
        explanations=pd.DataFrame(
            {
                "groups": [tuple(names[group] for group in one) for one in explanation.sets],
                "probability": explanation.probabilities,
                "log_evidence": explanation.evidence,
            }
        ),
        alternatives=alternatives,
        modes=modes,
        shifts=pd.DataFrame(shifts, days, F.columns),
    )


def _rates(
    explanation: DriftExplanation,
    alternatives: Mapping[str, list[str]],
    changes: Mapping[str, tuple[Array, Array]],
    alone: Array,
    years: float,
    significance: float,
) -> pd.DataFrame:
    """One row a group, as in `ParameterHistory`; ``alone`` are standard errors of yearly changes."""
    names = explanation.names
    levels, deviations = np.array([(mean[-1], deviation[-1]) for mean, deviation in changes.values()]).T
    drifts = np.where(2 * alone * years > 0.05, "unobservable", "no sign").astype(object)
    for others in alternatives.values():
        drifts[[names.index(name) for name in others]] = "yes" if len(others) == 1 else "perhaps"
    change, errors = np.expm1(levels), np.exp(levels) * deviations
    return pd.DataFrame(
        {
            "change": change,
            "change_error": errors,
            "per_year": change / years,
            "standard_error": errors / years,
            "p_value": 2 * stats.norm.sf(np.abs(levels) / np.maximum(deviations, 1e-300)),
            "probability": [
                sum(p for one, p in zip(explanation.sets, explanation.probabilities, strict=True) if group in one)
                for group in range(len(names))
            ],
            "drifts": drifts,
            "detectable_rates": (stats.norm.isf(significance / (2 * len(names))) + 1.28) * alone,
        },
        index=pd.Index(names, name="group"),
    )


@dataclass(frozen=True, eq=False)
class ParameterHistory(Sentences):
    """Stiffness of groups over years, with bands.

    It is returned by `track_parameters`.

    Parameters
    ----------
    table : DataFrame
        Relative stiffness by day, 1 on the first: columns (group, "estimate" | "ci_low" | "ci_high"), at 95 %.
    rates : DataFrame
        One row a group: ``change`` over the records, relative, and ``change_error``; ``per_year`` and
        ``standard_error``; ``p_value`` of no change in this group; ``probability`` that it drifts if any group does;
        ``drifts``: "yes", "perhaps" (or another group in its place), "no sign", or "unobservable" (a loss of 5 % over
        the records would not be detected); ``detectable_rates``: change a year that is detected with probability 90 %.
    p_value : float
        Probability that records without any drift have such trends.
    significance : float
        Largest ``p_value`` that counts as a drift.
    explanations : DataFrame
        Sets of one or two groups that may drift, the best first: ``groups``; ``probability``, if any of the sets
        drifts; ``log_evidence`` against no drift.
    alternatives : mapping of str to list of str
        Groups that may drift in the place of each of the best explanation, itself among them; empty without drift.
    modes : DataFrame
        One row a mode: shift of ln f over the records, ``measured`` (apart from the weather) and ``explained`` by the
        drift, and ``standard_error`` of the measured one; NaN for a mode that was measured on too few days.
    shifts : DataFrame
        Shift of ln f of each mode by day that the drift causes; 0 without drift.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.monitoring import track_parameters
    >>> from skthermo.surrogate import DataInformedFEM
    >>> years = make_truss_campaign(3, drift={"bottom": 0.02}, random_state=0)
    >>> T, F = years.temperatures, years.frequencies
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(T[:365], F[:365])
    >>> history = track_parameters(fem, T, F, freq="7D")
    >>> history.has_drift, history.explanations["groups"].iloc[0]
    (True, ('bottom',))
    >>> history.table["bottom"].columns.tolist()
    ['estimate', 'ci_low', 'ci_high']
    """

    table: pd.DataFrame = field(repr=False)
    rates: pd.DataFrame = field(repr=False)
    p_value: float
    significance: float
    explanations: pd.DataFrame = field(repr=False)
    alternatives: Mapping[str, list[str]]
    modes: pd.DataFrame = field(repr=False)
    shifts: pd.DataFrame = field(repr=False)

    @property
    def has_drift(self) -> bool:
        """Whether there is a drift: chance alone would hardly give such trends."""
        return bool(self.p_value <= self.significance)

    @property
    def days(self) -> pd.DatetimeIndex:
        """Beginning of each day of the table."""
        return self.table.index

    @property
    def groups(self) -> list[str]:
        """Names of the groups."""
        return list(self.rates.index)

    @property
    def years(self) -> float:
        """Length of the records."""
        return (self.shifts.index[-1] - self.shifts.index[0]) / YEAR

    def reaches(self, limit: float = -0.1) -> pd.DataFrame:
        """When the stiffness of each group reaches a limit, if its mean rate over the records goes on.

        Parameters
        ----------
        limit : float, default=-0.1
            Relative change since the first day: -0.1 is a loss of 10 %.

        Returns
        -------
        DataFrame
            One row a group: ``date``, before which it is reached with probability one half; ``earliest`` and
            ``latest``, between which it is reached with 95 %; ``probability`` that it is reached within 10 years of the
            last day. NaT where that takes more than 100 years, and for groups that are unobservable.

        Raises
        ------
        ValueError
            If the limit is not between -1 and 1, or 0.
        """
        if not is_real(limit) or not -1 < limit < 1 or limit == 0:
            raise ValueError(f"limit is {limit!r}; expected a relative change, such as -0.1 for a loss of 10 %")
        change, errors = self.rates["change"], self.rates["change_error"]
        hidden = (self.rates["drifts"] == "unobservable").to_numpy()
        error = np.maximum((errors / (1 + change) / self.years).to_numpy(), 1e-12)
        towards, needed = np.sign(limit) * (np.log1p(change) / self.years).to_numpy(), abs(np.log1p(limit))
        first, found = self.shifts.index[0], {}
        for name, share in {"date": 0.5, "earliest": 0.975, "latest": 0.025}.items():
            rate = stats.norm.ppf(share, towards, error)
            years = np.where((rate > 0) & ~hidden, needed / np.where(rate > 0, rate, np.nan), np.inf)
            found[name] = [
                first + round(365.25 * after) * DAY if after - self.years <= 100 else pd.NaT for after in years
            ]
        chance = np.where(hidden, np.nan, stats.norm.sf(needed / (self.years + 10), towards, error))
        return pd.DataFrame(found | {"probability": chance}, self.rates.index)

    def remove_drift(self, F: pd.DataFrame) -> pd.DataFrame:
        """Frequencies as they would be without the drift since the first day; unchanged where there is none.

        Parameters
        ----------
        F : DataFrame of shape (n_samples, n_modes)
            Measured frequencies in Hz on a ``DatetimeIndex``. Records before the first day or after the last count as
            taken on these.

        Returns
        -------
        DataFrame of shape (n_samples, n_modes)
            In Hz. A chain that is fitted to them learns the weather's effect free of the drift.

        Raises
        ------
        ValueError
            If F is no frame with times, or has other modes; if values are no frequencies, all of which it lists.
        """
        if not has_stamps(F) or list(getattr(F, "columns", [])) != list(self.shifts.columns):
            raise ValueError(
                f"frequencies are a {type(F).__name__} with the columns {list(getattr(F, 'columns', []))}; expected a "
                f"DataFrame on a DatetimeIndex with {list(self.shifts.columns)}"
            )
        harmless = {"few-records", "useless-column"}
        found, doubts = set_aside(frequencies=F, exclude=harmless, needs_all=True, is_baseline=False)
        warn_each(doubts)
        days = self.shifts.index
        of_day = np.clip(days.searchsorted(F.index, side="right") - 1, 0, len(days) - 1)
        return frame_like(F, as_floats(found.frequencies) * np.exp(-self.shifts.to_numpy()[of_day]))

    def __repr__(self) -> str:
        drifting = self.rates[self.rates["drifts"].isin(["yes", "perhaps"])]
        found = ", ".join(
            f"{name} {row['per_year']:+.2%} ± {2 * row['standard_error']:.2%} a year"
            for name, row in drifting.iterrows()
        )
        return f"ParameterHistory({found or 'no drift'})"

    def _answer(self) -> Iterator[str]:
        first, last = (f"{self.shifts.index[end]:%Y-%m-%d}" for end in (0, -1))
        found = "The" if self.has_drift else "No significant"
        is_it = " is significant" if self.has_drift else ""
        chance = probability_text(self.p_value)
        yield f"{found} drift of stiffness from {first} to {last}{is_it} (p value {chance})."
        for group, others in self.alternatives.items():
            rate = self.rates.loc[group]
            verb = "loses" if rate["per_year"] < 0 else "gains"
            yearly = f"{_share(rate['per_year'])} (±{SPACE}{_share(2 * rate['standard_error'])})"
            yield f"{group} {verb} {yearly} of its stiffness a year, {percent(rate['change'], '+.2g')} in all."
            others = [other for other in others if other != group]
            if others:
                yield f"A drift of {listed(others)} explains these frequencies equally well."

    def _limits(self) -> Iterator[str]:
        is_hidden = self.rates["drifts"] == "unobservable"
        hidden, seen = list(self.rates.index[is_hidden]), self.rates["detectable_rates"][~is_hidden]
        if not self.has_drift and len(seen):
            each = ", ".join(f"{group} {_share(rate)}" for group, rate in seen.items())
            yield f"Smallest steady drift a year that is detected with probability 90{SPACE}%: {each}."
        if hidden:
            yield f"A loss of 5{SPACE}% of stiffness in {listed(hidden)} is unobservable in these modes."
        n_groups, n_modes = len(self.rates.index.drop(ALL_GROUPS, errors="ignore")), len(self.modes)
        if n_groups > n_modes:
            yield f"{n_groups} groups and {counted(n_modes, 'mode')} do not determine which group drifts."
        if self.years < 1.5:
            yield f"Records of {self.years:.1f} years hardly distinguish season and drift."
        missing = list(self.modes.index[self.modes["measured"].isna()])
        if missing:
            yield f"Measured on too few days to be used: {listed(missing)}."


def _checked(fem: Any, T: Any, F: Any) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Records in order of time without values that cannot be and columns that say nothing, the first of each time."""
    if isinstance(fem, type) or not hasattr(fem, "simulator_"):
        raise ValueError(f"fem is {fem!r:.200}; expected a fitted DataInformedFEM")
    check_is_fitted(fem)
    for what, table in (("temperatures", T), ("frequencies", F)):
        if not has_stamps(table):
            raise ValueError(f"the {what} are a {type(table).__name__}; expected a DataFrame with a DatetimeIndex")
        refuse_no_table(table, what)
    if T.shape[1] != fem.n_features_in_:
        raise ValueError(f"T has {T.shape[1]} columns, {list(T.columns)}; expected {fem.n_features_in_}, as in fit")
    if list(F.columns) != fem.mode_names_:
        raise ValueError(f"the frequencies have the columns {list(F.columns)}; expected {fem.mode_names_}, as in fit")
    if not len(F):
        raise ValueError("F has 0 samples; expected at least one record")
    in_order = (table.sort_index(kind="stable") for table in (T, F))
    found, doubts = set_aside(*in_order, model=fem.model, exclude={"few-records"})
    warn_each(doubts)
    firsts = (table[~table.index.duplicated()] for table in (found.temperatures, found.frequencies))
    T, F = (
        table.drop(columns=list(found.left_out), errors="ignore").reindex(columns=table.columns) for table in firsts
    )
    return T.dropna(axis=1, how="all"), F


def _step_of(freq: Any) -> int:
    """Days of a step; an error for what is no period of whole days."""
    try:
        step = pd.Timedelta(freq) / DAY if isinstance(freq, str) else np.nan
    except ValueError:
        step = np.nan
    if not step >= 1 or step % 1:
        raise ValueError(f"freq is {freq!r:.100}; expected a day or some days, such as '1D' or '7D'")
    return int(step)


def _share(value: float) -> str:
    return f"{significant(100 * abs(float(value)))}{SPACE}%"
