"""Offsets and drifts in a daily series whose noise has a memory."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from skthermo._tables.arrays import Array

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
        return Departures(*(part[rows] for part in self))

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
