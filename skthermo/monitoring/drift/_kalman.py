"""A Kalman filter and smoother for levels that drift, constants, and disturbances that fade, day by day."""

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


class DayLearned(NamedTuple):
    """What a day changed: innovations, (n,), over their covariance, its inverse, and the gain, (n_states, n)."""

    weighted: Array
    precision: Array
    gain: Array


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

    def back(self, vector: Array) -> Array:
        """The transposed transition times vectors, (n_states, ...)."""
        n, fading, vector = self.n_levels, len(self.memory), vector.copy()
        vector[n : 2 * n] += self.length * vector[:n]
        vector[-fading:] = (self.memory * vector[-fading:].T).T
        return vector

    def filtered(self, start: State, days: Sequence[DayShown]) -> State:
        """The state after all days; the first of them begins with the state that is given."""
        state = start
        for number, day in enumerate(days):
            state = absorb(self.predict(state) if number else state, day)[0]
        return state

    def smoothed(self, start: State, days: Sequence[DayShown]) -> tuple[Array, Array, State]:
        """Levels of each day given all days, (n_days, n_levels), their covariances, and the state after all days.

        By the backward recursion of Bryson and Frazier, which needs no inverse of a state's covariance.
        """
        n, state, passed = self.n_levels, start, []
        for number, day in enumerate(days):
            state = self.predict(state) if number else state
            before = (state.mean[:n], state.covariance[:n])
            state, update = absorb(state, day)
            passed.append((*before, update))
        end = state
        means, covariances = np.empty((len(days), n)), np.empty((len(days), n, n))
        score, information = np.zeros(len(start.mean)), np.zeros_like(start.covariance)
        for number in range(len(days) - 1, -1, -1):
            mean, rows, update = passed[number]
            design = days[number].design
            if number < len(days) - 1:
                score = self.back(score)
                information = self.back(self.back(information).T)
            if len(design):
                score = score + design.T @ (update.weighted - update.gain.T @ score)
                turned = information @ update.gain
                information = information - turned @ design
                information -= design.T @ (turned.T - (turned.T @ update.gain) @ design - update.precision @ design)
            means[number] = mean + rows @ score
            covariances[number] = rows[:, :n] - rows @ information @ rows.T
        return means, covariances, end


def absorb(state: State, day: DayShown) -> tuple[State, DayLearned]:
    """The state once a day is known, and what the day changed."""
    if not len(day.values):
        return state, DayLearned(np.empty(0), np.empty((0, 0)), np.empty((len(state.mean), 0)))
    shown = state.covariance @ day.design.T
    spread = day.design @ shown + day.noise
    precision = cho_solve(cho_factor(spread, lower=True), np.eye(len(spread)))
    innovation = day.values - day.design @ state.mean
    weighted, gain = precision @ innovation, shown @ precision
    covariance = state.covariance - gain @ shown.T
    found = State(state.mean + shown @ weighted, (covariance + covariance.T) / 2)
    return found, DayLearned(weighted, precision, gain)
