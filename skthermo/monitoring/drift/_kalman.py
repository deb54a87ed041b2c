"""A Kalman filter for levels that drift, constants, and disturbances that fade, day by day."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from skthermo._tables.arrays import Array


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
