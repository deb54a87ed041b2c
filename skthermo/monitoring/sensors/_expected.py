"""What sensors are expected to show: each thermometer by the others, day by day, and responses by the weather."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import norm

from skthermo._core.arrays import Array, median, robust_deviation
from skthermo._core.frames import DAY, DAY_NS, YEAR
from skthermo.residuals.gaussian import Gaussian

Days = NDArray[np.int64]
LONGEST = 120  # days that are kept: a drift of 1 degree a month has come to 4 by then
CLIPPED = 5.0  # standard deviations at which an innovation is clipped: one odd day is no fault
LEAST_DAYS = 2  # with values since an offset began
LEAST_DRIFT = 7  # with values since a drift began
MONTH = 30  # days in the means that show how far a level wanders
SEASONAL = 0.3  # degrees by which a level, and its change over `LONGEST`, differ from those of the baseline's season
BEYOND = 1.0  # standard deviation of the error of what new weather moves a prediction by, as a share of that
MOST_CORRELATED = 0.95  # of neighbouring days
TESTS_A_DAY = 10.0  # independent ones to which the search over dates and shapes amounts; found by simulation
SAFER = 1.1  # times the largest statistic of the baseline
HIGHEST = 2.0  # times the lowest threshold, so that a fault of the baseline does not hide all later ones
WHOLE_YEAR = 330  # days from which a baseline shows the season of each thermometer
SEASONS = 2  # harmonics of the year, and of the day
OFTEN = 4  # records a day from which the time of the day counts
LEAST_OF_A_DAY = 0.3  # share of the usual number of records in a daily mean
N_FOLDS = 5
BLOCK = 15  # days in a block of a fold, where the baseline has whole years
LEAST_DEVIATION = 0.05  # degrees; thermometers are not better than that
FAR = 25.0  # robust deviations from the prediction within which no value is implausible
SHARE = 0.25  # of a response's level, within which none is: no damage changes one frequency alone by more
FARTHER = 3.0  # times what the baseline's own records are away from it, all but one in a thousand
UNMOVED = 0.2  # median of all responses' distances, in such limits, up to which one moves alone
FEWEST = 3  # responses of which one can be seen to move alone
ENORMOUS = 1000.0  # limits beyond which a value is implausible, whatever the others do
SAME_SIZE = 10.0  # ratio of the levels of two responses, and of their scatter, up to which they may be exchanged
NEARER = 0.5  # distance of both from their places when exchanged, over that as they are
CERTAIN = 20.0  # logarithm of the odds that two responses are exchanged
LARGEST = 50.0  # logarithm of the odds that one record may add
LEAST = 1e-4  # of the level, or of the scatter, below which no deviation is
JITTER = 1e-6  # share of its variance that each column has of its own, also where two show the same


class Change(NamedTuple):
    """An offset or a drift: its statistic, first day, size on the last day and rate in a day (0 for an offset).

    One of a single day is found only where no longer one is. ``z`` is robust, so that a few odd days do not make it;
    ``weight`` is the same without a bound.
    """

    z: float
    weight: float
    first: int
    size: float
    rate: float
    n_days: int


class Departures(NamedTuple):
    """A daily series: what a thermometer shows beside what the others predict; NaN where nothing is known.

    ``values`` are in ``deviations``, which are in degrees; ``errors`` are variances of the prediction in squares of
    these, and ``beyond`` is by how many degrees weather that the baseline does not have moves the prediction.
    """

    days: Days
    values: Array
    deviations: Array
    errors: Array
    beyond: Array

    def rows(self, rows: Any) -> Departures:
        return Departures(*map(itemgetter(rows), self))

    def known(self) -> Departures:
        return self.rows(~np.isnan(self.values))


@dataclass(frozen=True)
class ThermometerNoise:
    """Noise of a standardised daily series: its scale, its correlation from day to day and how far its level wanders.

    ``limit`` is the statistic of a change that noise reaches as rarely as asked for.
    """

    scale: float
    correlation: float
    wander: float
    limit: float

    @classmethod
    def of(cls, departures: Departures, per_year: float) -> ThermometerNoise:
        limit = float(norm.isf(per_year / 365.25 / TESTS_A_DAY / 2))
        days, y = departures.known()[:2]
        if len(y) < 2 * LEAST_DAYS:
            return cls(1.0, 0.0, 0.0, limit)
        scale = max(1.0, float(np.sqrt(np.mean(np.clip(y, -CLIPPED, CLIPPED) ** 2))))
        pairs = np.diff(days) == 1
        left, right = y[:-1][pairs], y[1:][pairs]
        total = np.sqrt((left @ left) * (right @ right))
        correlation = float(np.clip(left @ right / total, 0.0, MOST_CORRELATED)) if total > 0 else 0.0
        months = (days - days[0]) // MONTH
        counts = np.bincount(months)
        means = (np.bincount(months, y) / np.maximum(counts, 1))[counts >= MONTH / 3]
        by_noise = scale**2 * (1 + correlation) / (1 - correlation) / MONTH
        wander = float(np.sqrt(max(np.mean(means**2) - by_noise, 0.0))) if len(means) else 0.0
        noise = cls(scale, correlation, wander, limit)
        return replace(noise, limit=noise._beyond_baseline(departures))

    def _beyond_baseline(self, departures: Departures) -> float:
        """The limit, raised where the baseline's own days go beyond it."""
        largest = 0.0
        for last in range(LONGEST // 4, len(departures.days) + 1, 4):
            change = self.change(departures.rows(slice(max(last - LONGEST, 0), last)))
            if change is not None and change.n_days >= LEAST_DAYS:
                largest = max(largest, change.z)
        return float(np.clip(SAFER * largest, self.limit, HIGHEST * self.limit))

    def change(self, departures: Departures) -> Change | None:
        """The most likely offset or drift that still lasts on the last day; None with too few days.

        The level before the change is unknown: by as much as it wanders, by the errors of what predicts it, as if days
        of the baseline were independent, by what seasons differ from year to year, and in new weather by as much as
        that moves the prediction.
        """
        given = departures.known()
        if len(given.days) < LEAST_DAYS:
            return None
        at, scale = given.days.astype(float), self.scale * given.deviations
        since = at - at[:, np.newaxis]
        ramps = np.maximum(since[: max(len(at) + 1 - LEAST_DRIFT, 0)] + 1.0, 0.0)
        line = 2 * (at - at[0]) / LONGEST - 1
        shapes = np.vstack([given.deviations, np.ones(len(at)), line, given.beyond, since >= 0, ramps]) / scale
        white = self._whitened(at, np.vstack([given.values / self.scale, shapes]))
        exact, levels, steps = white[0], white[1:5], white[5:]
        slower = (1 + self.correlation) / (1 - self.correlation)
        unknown = self.wander**2 + slower * self.scale**2 * float(np.median(given.errors))
        prior = np.diag([1 / max(unknown, 1e-12), 1 / SEASONAL**2, 1 / SEASONAL**2, 1 / BEYOND**2])
        evidence = steps - steps @ levels.T @ np.linalg.solve(levels @ levels.T + prior, levels)
        information = np.maximum((steps * evidence).sum(axis=1), 1e-12)
        slopes, roots = evidence @ exact / information, np.sqrt(information)
        weights = np.abs(slopes) * roots
        z = np.abs(evidence @ np.clip(exact, -CLIPPED, CLIPPED)) / roots
        lasts = np.tile(np.arange(len(at))[::-1] + 1, 2)[: len(z)]
        certain = (z > self.limit) & (lasts >= LEAST_DAYS)
        best = int(np.where(certain | (not certain.any()), weights, 0.0).argmax())
        first, is_drift = int(at[best % len(at)]), best >= len(at)
        size = slopes[best] * (at[-1] - first + 1) if is_drift else slopes[best]
        rate = float(slopes[best] * is_drift)
        return Change(float(z[best]), float(weights[best]), first, float(size), rate, int(lasts[best]))

    def for_no_change(self, departures: Departures, expected: float) -> tuple[float, int]:
        """Logarithm of the odds that a change has ended, against its going on as expected, and the day it ended."""
        given = departures.known()
        if not len(given.days):
            return 0.0, 0
        at, values = given.days.astype(float), given.values
        series = np.vstack([values, values - expected / given.deviations]) / self.scale
        alone, beside = np.clip(self._whitened(at, series), -CLIPPED, CLIPPED)
        odds = np.cumsum((beside**2 - alone**2)[::-1])[::-1] / 2
        best = int(odds.argmax())
        return float(odds[best]), int(at[best])

    def _whitened(self, at: Array, rows: Array) -> Array:
        """Innovations of each row of values, given the value before."""
        memory = self.correlation ** np.diff(at)
        white = rows.copy()
        white[:, 1:] = (rows[:, 1:] - memory * rows[:, :-1]) / np.sqrt(1 - memory**2)
        return white


def local_days(stamps: pd.DatetimeIndex) -> Days:
    """Calendar day of each stamp in its own time zone, in days since 1970."""
    return stamps.tz_localize(None).as_unit("ns").asi8 // DAY_NS


def harmonics(stamps: pd.DatetimeIndex, periods: Sequence[float]) -> Array:
    """A constant, and harmonics of some periods in days."""
    at = stamps.tz_localize(None).as_unit("ns").asi8 / DAY_NS
    columns = [np.ones(len(at))]
    for period in periods:
        for k in range(1, SEASONS + 1):
            wave = 2 * np.pi * k * at / period
            columns += [np.sin(wave), np.cos(wave)]
    return np.column_stack(columns)


@dataclass(frozen=True)
class Thermometers:
    """Daily anomalies of thermometers, and how they go together in the baseline.

    ``usual`` are coefficients of the `harmonics` of some ``periods``: temperatures by season and time of day.
    """

    usual: Array
    periods: tuple[float, ...]
    gaussian: Gaussian
    least: float
    n_days: int
    lowest: Array
    highest: Array
    noises: tuple[ThermometerNoise, ...]
    records: Gaussian

    @classmethod
    def of(cls, stamps: pd.DatetimeIndex, temperatures: Array, per_year: float) -> Thermometers | None:
        """Learn from the baseline; None where it has too few days, or fewer than two thermometers."""
        n_sensors = temperatures.shape[1]
        every_day = local_days(stamps)
        days = np.unique(every_day)
        if n_sensors < 2 or len(days) < 3 * n_sensors + N_FOLDS or np.isnan(temperatures).all(axis=0).any():
            return None
        has_season = bool(days[-1] - days[0] >= WHOLE_YEAR)
        least = LEAST_OF_A_DAY * len(stamps) / len(days)
        periods = (YEAR / DAY,) * has_season + (1.0,) * (len(stamps) / len(days) >= OFTEN)
        found = np.full((4, len(days), n_sensors), np.nan)
        fold_of = days // BLOCK % N_FOLDS if has_season else np.arange(len(days)) * N_FOLDS // len(days)
        for fold in range(N_FOLDS):
            test = np.isin(every_day, days[fold_of == fold])
            if test.all() or not test.any() or np.isnan(temperatures[~test]).all(axis=0).any():
                continue
            part = cls._learned(stamps[~test], temperatures[~test], periods, least)
            means = part.daily_means(stamps[test], temperatures[test])
            found[:, fold_of == fold] = part.departures(means, np.ones(n_sensors, dtype=bool))
        noises = tuple(
            ThermometerNoise.of(Departures(days, *found[:, :, j]), per_year / n_sensors) for j in range(n_sensors)
        )
        whole = cls._learned(stamps, temperatures, periods, least)
        return replace(whole, noises=noises)

    @classmethod
    def _learned(
        cls, stamps: pd.DatetimeIndex, temperatures: Array, periods: tuple[float, ...], least: float
    ) -> Thermometers:
        """Usual weather and covariance from some records; NaN is passed over."""
        inputs = harmonics(stamps, periods)
        usual = np.zeros((inputs.shape[1], temperatures.shape[1]))
        for sensor, column in enumerate(temperatures.T):
            known = ~np.isnan(column)
            usual[:, sensor] = np.linalg.lstsq(inputs[known], column[known], rcond=1e-8)[0]
        gaussian = Gaussian(np.empty(0), np.empty((0, 0)))
        bare = cls(usual, periods, gaussian, least, 0, np.empty(0), np.empty(0), (), gaussian)
        means = bare.daily_means(stamps, temperatures)
        found = Gaussian.fitted(means[~np.isnan(means).all(axis=1)])
        own = np.diag(JITTER * np.diag(found.covariance) + LEAST_DEVIATION**2)
        lowest, highest = np.fmin.reduce(means), np.fmax.reduce(means)
        gaussian = Gaussian(found.mean, found.covariance + own)
        anomalies = temperatures - inputs @ usual
        together = Gaussian.fitted(anomalies[~np.isnan(anomalies).all(axis=1)])
        together = Gaussian(together.mean, together.covariance + own)
        return cls(usual, periods, gaussian, least, len(means), lowest, highest, (), together)

    def daily_means(self, stamps: pd.DatetimeIndex, temperatures: Array) -> Array:
        """Mean anomaly of each day that has records, in order; NaN where a thermometer has few of them."""
        day = np.unique(local_days(stamps), return_inverse=True)[1].ravel()
        anomalies = temperatures - harmonics(stamps, self.periods) @ self.usual
        known = ~np.isnan(anomalies)
        counts, sums = np.zeros((2, day.max() + 1, anomalies.shape[1]))
        for sensor, own in enumerate(known.T):
            counts[:, sensor] = np.bincount(day, own)
            sums[:, sensor] = np.bincount(day, np.where(own, anomalies[:, sensor], 0.0))
        return np.where(counts >= max(self.least, 1.0), sums / np.maximum(counts, 1.0), np.nan)

    def filled(self, stamps: pd.DatetimeIndex, temperatures: Array) -> Array:
        """Temperatures whose gaps hold what the other thermometers of their record predict."""
        usual = harmonics(stamps, self.periods) @ self.usual
        return usual + self.records.completed(temperatures - usual)[0]

    def departures(self, means: Array, trusted: NDArray[np.bool_]) -> Array:
        """Values, deviations, errors and what lies beyond the baseline, of `Departures`, (4, n_days, n_thermometers).

        NaN where a thermometer, or each of the other trusted ones, has no value.
        """
        found = np.full((4, *means.shape), np.nan)
        for sensor in range(means.shape[1]):
            others = np.where(trusted, means, np.nan)
            others[:, sensor] = np.nan
            expected, spread = self.gaussian.completed(others)
            within = self.gaussian.completed(np.clip(others, self.lowest, self.highest))[0]
            unusual = (len(self.usual) + self.gaussian.distances(others) ** 2) / self.n_days
            values = (means - expected)[:, sensor] / spread[:, sensor]
            found[:, :, sensor] = values, spread[:, sensor], unusual, (expected - within)[:, sensor]
        return found


@dataclass(frozen=True)
class Responses:
    """Responses in their own units beside what the weather predicts, and how far those of the baseline are from that.

    ``together`` is the distribution of temperatures and responses, these from ``centre`` in their ``scatter``;
    ``limits`` are distances from which a value that moves alone is implausible, ``deviations`` those of daily medians.
    """

    together: Gaussian
    centre: Array
    scatter: Array
    lowest: Array
    highest: Array
    limits: Array
    deviations: Array
    pairs: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, temperatures: Array, values: Array, stamps: pd.DatetimeIndex, units: Sequence[str]) -> Responses:
        centre, scatter = median(values), robust_deviation(values)
        least = np.where(scatter > 0, LEAST * scatter, np.where(centre != 0, LEAST * np.abs(centre), LEAST))
        scatter = np.maximum(np.nan_to_num(scatter), np.nan_to_num(least, nan=LEAST))
        rows = np.hstack([temperatures, (values - centre) / scatter])
        together = Gaussian.fitted(rows[~np.isnan(rows).all(axis=1)])
        own = np.diag(JITTER * np.maximum(np.diag(together.covariance), LEAST**2))
        together = Gaussian(together.mean, together.covariance + own)
        sizes = (np.maximum(np.abs(centre), scatter), scatter)
        pairs = tuple(
            (a, b)
            for a, b in combinations(range(len(centre)), 2)
            if units[a] == units[b] and all(max(size[[a, b]]) <= SAME_SIZE * min(size[[a, b]]) for size in sizes)
        )
        lowest, highest = np.fmin.reduce(values), np.fmax.reduce(values)
        bare = cls(together, centre, scatter, lowest, highest, np.empty(0), np.empty(0), pairs)
        rest = bare.residuals(temperatures, values)[0]
        reached = np.array([np.nanquantile(c, 0.999) if len(c) else 0.0 for c in _known(np.abs(rest))])
        scale = np.maximum(np.nan_to_num(robust_deviation(rest)), least)
        limits = np.fmax(np.fmax(FAR * scale, SHARE * np.abs(centre)), FARTHER * reached)
        by_day = pd.DataFrame(rest).groupby(local_days(stamps)).median().to_numpy()
        deviations = np.maximum(np.nan_to_num(robust_deviation(by_day), nan=np.inf), least)
        return cls(together, centre, scatter, lowest, highest, limits, deviations, pairs)

    def residuals(self, temperatures: Array, values: Array) -> tuple[Array, Array]:
        """Responses minus those that the weather predicts, and these."""
        rows = np.hstack([temperatures, np.full(values.shape, np.nan)])
        expected = self.centre + self.scatter * self.together.completed(rows)[0][:, temperatures.shape[1] :]
        expected = np.clip(np.where(np.isnan(expected), self.centre, expected), self.lowest, self.highest)
        return values - expected, expected

    def implausible(self, values: Array, rest: Array) -> NDArray[np.bool_]:
        """Values farther from the prediction than damage explains while the others of their record stay.

        Whatever the others do, none is enormous, and none is zero or below where all of the baseline are above.
        """
        size = np.abs(rest) / self.limits
        with np.errstate(invalid="ignore"):
            far, never = size > 1, (size > ENORMOUS) | ((values <= 0) & (self.lowest > 0))
        if not far.any() or rest.shape[1] < FEWEST:
            return never
        rows = far.any(axis=1)
        far[rows] &= (median(size[rows].T) < UNMOVED)[:, np.newaxis]
        return far | never

    def odds_of_exchange(self, rest: Array, expected: Array) -> Array:
        """Logarithm of the odds that a day's values of each pair are exchanged, against their being in place.

        Two are exchanged only where both come much nearer to their places by it: one has risen and the other one
        fallen, by about their distance. No damage does that, and the odds are as bad as can be otherwise.
        """
        today, places = median(rest), median(expected)
        found = np.zeros(len(self.pairs))
        for pair, (first, second) in enumerate(self.pairs):
            both = [first, second]
            if np.isnan(today[both]).any():
                continue
            gap = places[second] - places[first]
            here = today[both] / self.deviations[both]
            exchanged = np.array([today[second] + gap, today[first] - gap]) / self.deviations[both]
            odds = (here @ here - exchanged @ exchanged) / 2
            is_near = (np.abs(exchanged) < NEARER * np.abs(here)).all()
            found[pair] = min(odds, LARGEST) if is_near else -LARGEST
        return found


def _known(values: Array) -> list[Array]:
    return [column[~np.isnan(column)] for column in values.T]
