"""Stiffness of groups over years, from records of temperatures and frequencies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from skthermo._arrays import Array, as_random_state
from skthermo.monitoring.drift._daily import DailyMeans, calendar
from skthermo.monitoring.drift._explanations import N_SHAPES, Explanations, ModeTrends
from skthermo.monitoring.drift._filter import (
    MISLEARNED,
    DailyRecords,
    GroupEffects,
    check_records,
    length_of,
    observation,
    with_time,
)
from skthermo.monitoring.drift._history import Followed, ParameterHistory
from skthermo.monitoring.drift._kalman import DailySteps, State
from skthermo.monitoring.drift._noise import DailyNoise

ANY_TREND = 0.3  # prior standard deviation of a trend of ln frequency over the records
ANY_RATE = 0.1  # prior standard deviation of the yearly change of ln stiffness of a group that is followed


def track_parameters(
    fem: Any,
    T: pd.DataFrame,
    F: pd.DataFrame,
    groups: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
    freq: str = "1D",
    *,
    significance: float = 0.01,
    random_state: int | np.random.RandomState | None = None,
) -> ParameterHistory:
    """Follow."""
    check_records(fem, T, F)
    random = as_random_state(random_state)
    records = DailyRecords.of(fem, T, freq)
    daily = records.means(T, F, calendar(F.index, freq))
    effects = GroupEffects.of(fem, T, F, groups)
    noise = DailyNoise.of(daily.values, with_time(daily, N_SHAPES), daily.counts)
    trends = mode_trends(daily, noise, effects.slopes, freq)
    found = Explanations.of(trends, noise.freedom, random)
    smoother = Smoother(daily, noise.widened(found.widening), effects.slopes, length_of(freq))
    best, walk = found.sets[0], float(found.walk[0])
    followed = {}
    for group in range(len(effects.names)):
        rivals = [one for one in best if group in found.instead(one)]
        beside = tuple(one for one in best if one not in rivals) if rivals else best
        chosen = best if group in best else (*beside, group)
        if chosen not in followed:
            followed[chosen] = smoother.follow(chosen, walk)
    return ParameterHistory(daily, effects, trends, found, followed, significance)


def mode_trends(daily: DailyMeans, noise: DailyNoise, slopes: Array, freq: str) -> ModeTrends:
    """How each mode went over the records beside what the weather explains, by a line and slow waves."""
    n_modes = len(slopes)
    none, size = np.zeros((n_modes, 0)), daily.basis.shape[2]
    wide = replace(daily, basis=with_time(daily, N_SHAPES))
    deviations = np.append(np.full(size, MISLEARNED), np.full(N_SHAPES, ANY_TREND))
    covariance = np.diag(np.append(np.tile(deviations**2, n_modes), np.zeros(n_modes)))
    covariance[-n_modes:, -n_modes:] = noise.stationary
    days = [observation(wide, number, noise, none) for number in range(len(daily.days))]
    steps = DailySteps(length_of(freq), np.zeros((0, 0)), noise.memory, noise.renewal)
    state, _ = steps.filtered(State(np.zeros(len(covariance)), covariance), days)
    places = (np.arange(n_modes)[:, np.newaxis] * (size + N_SHAPES) + size + np.arange(N_SHAPES)).ravel()
    years = (len(daily.days) - 1) * length_of(freq)
    return ModeTrends(state.mean[places], state.covariance[np.ix_(places, places)], slopes, years)


@dataclass(frozen=True)
class Smoother:
    """Follows the levels of some groups through all days."""

    daily: DailyMeans
    noise: DailyNoise
    slopes: Array
    length: float

    def follow(self, groups: Sequence[int], walk: float) -> Followed:
        """Levels of some groups, 0 on the first day, each with its steady rate and a random walk."""
        slopes, n = self.slopes[:, list(groups)], len(groups)
        n_modes, size = len(slopes), self.daily.basis.shape[2]
        variances = [0.0, ANY_RATE**2, MISLEARNED**2, 0.0]
        covariance = np.diag(np.repeat(variances, [n, n, n_modes * size, n_modes]))
        covariance[-n_modes:, -n_modes:] = self.noise.stationary
        days = [observation(self.daily, number, self.noise, slopes) for number in range(len(self.daily.days))]
        steps = DailySteps(self.length, walk**2 * self.length * np.eye(n), self.noise.memory, self.noise.renewal)
        start = State(np.zeros(len(covariance)), covariance)
        means, covariances = steps.smoothed(start, days)
        end, _ = steps.filtered(start, days)
        return Followed(tuple(groups), means, covariances, end.mean[: 2 * n], end.covariance[: 2 * n, : 2 * n], walk)
