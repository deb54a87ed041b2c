"""How daily means scatter, and a Kalman filter for what drifts beside that, day by day."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from skthermo._tables.arrays import Array

LASTING = np.geomspace(1.5, 99, 16)
"""Factors by which the fading part raises the variance of a mean of many days that are tried."""

MEMORIES = (LASTING - 1) / (LASTING + 1)
"""Correlations of the fading part from one day to the next that belong to them."""

SHARES = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)
"""Shares of the fading part in the variance of a usual day that are tried; none is tried, too."""

DAYS_AT_ONCE = 200
PSEUDO_DAYS = 20  # weight of no correlation of modes beside that of the days
SMALLEST = 1e-8  # standard deviation of a daily mean of the logarithm of a frequency


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
        """Restricted maximum likelihood for each mode on a grid, given regressors (n_days, n_modes, n_regressors).

        Days on which a mode is missing have a NaN in ``values``, (n_days, n_modes).
        """
        candidates = np.array([(0.0, 0.0), *((memory, share) for memory in MEMORIES for share in SHARES)])
        usual = np.array([np.median(column[column > 0]) if (column > 0).any() else 1.0 for column in counts.T])
        thinness = usual / np.maximum(counts, 1)
        columns = np.concatenate([np.nan_to_num(values)[:, :, np.newaxis], regressors], axis=2)
        known = ~np.isnan(values)
        products, logarithms, _ = _innovations(columns, known, thinness, candidates[:, np.newaxis])
        n_days, n_regressors = known.sum(axis=0), regressors.shape[2]
        gram, cross = products[:, :, 1:, 1:], products[:, :, 1:, 0]
        size = np.trace(gram, axis1=2, axis2=3)[:, :, np.newaxis, np.newaxis]
        ridge = np.where(size > 0, 1e-10 * size, 1.0) * np.eye(n_regressors)  # 0 for a mode that was not measured
        coefficients = np.linalg.solve(gram + ridge, cross[..., np.newaxis])[..., 0]
        rest = np.maximum(products[:, :, 0, 0] - (cross * coefficients).sum(axis=2), 0.0)
        freedom = np.maximum(n_days - n_regressors, 1)
        variances = np.maximum(rest / freedom, SMALLEST**2)
        likelihood = -(logarithms + np.linalg.slogdet(gram + ridge)[1] + freedom * np.log(variances)) / 2
        best, modes = likelihood.argmax(axis=0), np.arange(values.shape[1])
        chosen, deviations = candidates[best], np.sqrt(variances[best, modes])
        whitened = _innovations(columns, known, thinness, chosen[np.newaxis], keep=True)[2][:, 0]
        residuals = whitened[:, :, 0] - np.einsum("tmk,mk->tm", whitened[:, :, 1:], coefficients[best, modes])
        residuals = np.where(known, residuals / deviations, 0.0)
        together = known.T.astype(float) @ known
        correlation = residuals.T @ residuals / (together + PSEUDO_DAYS)
        np.fill_diagonal(correlation, 1.0)
        lowest, vectors = np.linalg.eigh(correlation)
        if lowest[0] < 0.02:
            correlation = (vectors * np.maximum(lowest, 0.02)) @ vectors.T
            scale = np.sqrt(np.diag(correlation))
            correlation = correlation / np.outer(scale, scale)
        memory, share = chosen.T
        times = (1 - memory) / (1 + memory)
        worth = np.median(freedom * ((1 - share) + share * times))
        fresh = deviations * np.sqrt((1 - share) * usual)
        return cls(memory, deviations * np.sqrt(share), fresh, correlation, float(max(worth, 4.0)))


def _innovations(
    columns: Array, known: Array, thinness: Array, candidates: Array, keep: bool = False
) -> tuple[Array, Array, Array]:
    """Sums of products of whitened columns, (n_candidates, n_modes, n_columns, n_columns), and of log variances.

    The columns, (n_days, n_modes, n_columns), are whitened by the scalar Kalman filter of each candidate, which has a
    memory and a share for all modes, (n_candidates, 1, 2), or for each, (n_candidates, n_modes, 2).
    """
    n_days, n_modes, n_columns = columns.shape
    memory, share = candidates[..., 0], candidates[..., 1]
    expected = np.zeros((len(candidates), n_modes, n_columns))
    spread = np.broadcast_to(share, (len(candidates), n_modes)).copy()
    products = np.zeros((len(candidates), n_modes, n_columns, n_columns))
    logarithms, kept = np.zeros_like(spread), []
    for first in range(0, n_days, DAYS_AT_ONCE):
        part = slice(first, min(first + DAYS_AT_ONCE, n_days))
        whitened = np.empty((part.stop - first, len(candidates), n_modes, n_columns))
        for place, day in enumerate(range(first, part.stop)):
            there = known[day]
            total = spread + (1 - share) * thinness[day]
            total = np.where(total > 0, total, 1.0)
            innovation = columns[day] - expected
            gain = np.where(there, spread / total, 0.0)
            whitened[place] = innovation * (there / np.sqrt(total))[:, :, np.newaxis]
            logarithms += np.where(there, np.log(total), 0.0)
            expected = memory[:, :, np.newaxis] * (expected + gain[:, :, np.newaxis] * innovation)
            spread = memory**2 * (spread - gain * spread) + (1 - memory**2) * share
        rows = np.moveaxis(whitened, 0, 3)
        products += rows @ rows.swapaxes(2, 3)
        if keep:
            kept.append(whitened)
    return products, logarithms, np.concatenate(kept) if keep else np.empty(0)


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
