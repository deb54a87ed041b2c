"""How daily means scatter, and a Kalman filter for what drifts beside that, day by day."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from skthermo._core.arrays import Array
from skthermo.residuals.baseline import Scatter

SMALLEST = 1e-8  # standard deviation of a daily mean of the logarithm of a frequency
LEAST_WORTH = 4.0  # independent days as which those of a baseline count at least


@dataclass(frozen=True)
class DailyResiduals:
    """Daily means, (n_days, n_modes), NaN where a mode is missing, of which regressors explain a part.

    `Scatter` learns from them; the regressors, (n_days, n_regressors), are fitted to the days themselves.
    """

    values: Array
    regressors: Array
    is_overfitted: ClassVar[bool] = True

    def less_similar(self, values: Array) -> Array:
        """Values of the days, (n_days, n_columns), less what the regressors explain of each column."""
        rest, known = np.full(values.shape, np.nan), ~np.isnan(values)
        for days in known[:, :1].T if known.all() else np.unique(known, axis=1).T:
            part = np.ix_(days, (known == days[:, np.newaxis]).all(axis=0))
            inputs = self.regressors[days]
            rest[part] = values[part] - inputs @ np.linalg.lstsq(inputs, values[part], rcond=1e-10)[0]
        return rest


@dataclass(frozen=True)
class DailyNoise:
    """Scatter of daily means of ln frequencies around weather and drift.

    ``fading`` and ``fresh``, (n_modes,), are standard deviations of the part that fades, by the factors ``memory`` a
    day, and of the part that is new with each record; ``correlation`` is that of the modes in both.
    """

    memory: Array
    fading: Array
    fresh: Array
    correlation: Array
    freedom: float

    @property
    def renewal(self) -> Array:
        """Covariance of what is added to the fading part each day."""
        stationary = self.correlation * np.outer(self.fading, self.fading)
        kept = np.sqrt(1 - self.memory**2)
        return stationary * np.outer(kept, kept)

    @property
    def stationary(self) -> Array:
        """Covariance of the fading part, as it is while nothing is measured."""
        kept = np.sqrt(1 - self.memory**2)
        return self.renewal / (1 - np.outer(self.memory, self.memory)) if len(kept) else self.renewal

    def of_day(self, counts: Array, present: NDArray[np.intp]) -> Array:
        """Covariance of the fresh part of the daily means of some modes, each of so many records."""
        deviations = np.maximum(self.fresh / np.sqrt(np.maximum(counts, 1)), SMALLEST)[present]
        return self.correlation[np.ix_(present, present)] * np.outer(deviations, deviations)

    @classmethod
    def of(cls, values: Array, regressors: Array, counts: Array) -> DailyNoise:
        """Learned as `Scatter` learns from residuals, given regressors (n_days, n_modes, n_regressors).

        Days on which a mode is missing have a NaN in ``values``, (n_days, n_modes). Modes of too few days scatter as
        independent ones.
        """
        known = ~np.isnan(values)
        common = (regressors * known[:, :, np.newaxis]).sum(axis=1) / np.maximum(known.sum(axis=1), 1)[:, np.newaxis]
        residuals = DailyResiduals(values, common)
        scatter = Scatter.estimated(residuals)
        freedom = np.maximum(scatter.n_records - common.shape[1], 1)
        alone = np.nansum(residuals.less_similar(values) ** 2, axis=0) / freedom
        fresh, fading = np.diagonal(scatter.parts, axis1=1, axis2=2)
        fresh = np.maximum(np.where(fresh + fading > 0, fresh, alone), SMALLEST**2)
        deviations = np.sqrt(np.outer(scatter.variances, scatter.variances))
        correlation = np.eye(len(fresh))
        np.divide(scatter.parts.sum(axis=0), deviations, out=correlation, where=deviations > 0)
        np.fill_diagonal(correlation, 1.0)
        share, faded = fading / (fresh + fading), (1 - scatter.memory) / (1 + scatter.memory)
        worth = float(np.median(freedom * (1 - share + share * faded)))
        usual = np.array([np.median(column[column > 0]) if (column > 0).any() else 1.0 for column in counts.T])
        memory = np.full(len(fresh), scatter.memory)
        return cls(memory, np.sqrt(fading), np.sqrt(fresh * usual), correlation, max(worth, LEAST_WORTH))


class State(NamedTuple):
    """Mean and covariance of the states given all days so far."""

    mean: Array
    covariance: Array


class DayShown(NamedTuple):
    """What a day showed: values, (n,), how they depend on the states, (n, n_states), and the noise's covariance."""

    values: Array
    design: Array
    noise: Array


@dataclass(frozen=True)
class DailySteps:
    """How states go from one day to the next.

    The states are levels, a slope of each, constants, and disturbances. Levels walk at random with covariance ``walk``
    a day, and by their slopes times ``length``; slopes walk with covariance ``turn``; disturbances fade by the factors
    ``memory`` and are renewed with covariance ``renewal``.
    """

    length: float
    walk: Array
    turn: Array
    memory: Array
    renewal: Array

    @property
    def n_levels(self) -> int:
        """Number of levels, and of slopes."""
        return len(self.walk)

    def predict(self, state: State) -> State:
        """The state of the next day, before anything of it is measured."""
        n, fading, mean, covariance = self.n_levels, len(self.memory), state.mean.copy(), state.covariance.copy()
        if n:
            mean[:n] += mean[n : 2 * n] * self.length
            covariance[:n] += self.length * covariance[n : 2 * n]
            covariance[:, :n] += self.length * covariance[:, n : 2 * n]
            covariance[:n, :n] += self.walk
            covariance[n : 2 * n, n : 2 * n] += self.turn
        mean[-fading:] *= self.memory
        covariance[-fading:] *= self.memory[:, np.newaxis]
        covariance[:, -fading:] *= self.memory
        covariance[-fading:, -fading:] += self.renewal
        return State(mean, covariance)

    def filtered(self, start: State, days: Sequence[DayShown]) -> State:
        """The state after all days; the first of them begins with the state that is given."""
        state = start
        for number, day in enumerate(days):
            state = absorb(self.predict(state) if number else state, day)
        return state


def absorb(state: State, day: DayShown) -> State:
    """The state once a day is known."""
    if not len(day.values):
        return state
    shown = state.covariance @ day.design.T
    gain = cho_solve(cho_factor(day.design @ shown + day.noise, lower=True), shown.T).T
    covariance = state.covariance - gain @ shown.T
    return State(state.mean + gain @ (day.values - day.design @ state.mean), (covariance + covariance.T) / 2)
