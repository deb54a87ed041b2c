"""Drift that is taken out of the frequencies of a bridge in service, and sudden changes that are not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from skthermo._core.arrays import Array
from skthermo._core.estimators import check_is_fitted
from skthermo._core.frames import DAY, YEAR, as_index, days_later, midnights_between
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.warnings import warnings_once, without_warnings
from skthermo.fem.damage import ALL_GROUPS
from skthermo.monitoring._records import Lookback
from skthermo.monitoring.drift._explanations import SIGNIFICANT, Explanations, ModeTrends
from skthermo.monitoring.drift._kalman import DailyNoise, DailySteps, DayShown, State, absorb
from skthermo.monitoring.drift._observations import (
    MISLEARNED,
    DailyMeans,
    DailyRecords,
    GroupEffects,
    calendar,
    checked_records,
    observation,
    with_time,
)

DELAY = 30
"""Days that a day waits before drift is learned from it: a sudden change is seen by then."""

SUDDEN = 1e-3  # probability that the mean of waiting days is as far from what was predicted by chance
CLEAR = 0.05  # probability that frequencies without drift would seem to drift as much, from which it is taken out
ROUNDING = 1e-6  # share of the mean variance of the shifts by which directions that no group moves are known
LIMIT = 0.05
RATE = 0.02  # standard deviation of the yearly change of a group that is expected beforehand
WALK = 0.005  # standard deviation of what a year adds to a group's stiffness beside its steady rate
TURN = 0.01  # standard deviation of what a year adds to the yearly rate
A_DAY = DAY / YEAR


@dataclass(frozen=True)
class FollowerState(SavesFrames):
    """What a `DriftFollower` knows at the end of a day.

    ``known`` are levels and rates of the groups, constants and disturbances by all days up to the one that was
    ``learned`` last, ``waiting`` the days since. Drift is not learned from those that are ``sudden``: in a time that
    departs from what was predicted; ``n_left_out`` of such in a row. ``weather`` is that of the last day; ``times``
    (nanoseconds) and ``temperatures`` are the latest records, as many as lags of the chain look back.
    """

    learned: pd.Timestamp
    known: State
    waiting: DailyMeans
    sudden: NDArray[np.bool_]
    weather: float
    times: NDArray[np.int64]
    temperatures: Array
    n_left_out: int = 0

    @property
    def day(self) -> pd.Timestamp:
        return days_later(self.learned, len(self.sudden))


@dataclass(frozen=True)
class DriftFollower:
    """Takes slow drift out of measured frequencies, and leaves sudden changes in.

    A Kalman filter follows the stiffness of groups day by day, apart from weather and noise, relative to the mean of a
    baseline, a month behind: a day is learned from when it has waited `DELAY` days, and only if no time of this length
    that holds it departs from what was predicted. So a sudden change is never learned as drift, however long it lasts;
    a drift that is much faster than some percent a year is not either. A sudden change that the mean of a month does
    not show is learned in time, and reported as the drift that it looks like.

    What is taken out is the drift found, times a share that is 0 as long as it may be chance and goes to 1 as it
    becomes clear.

    ``members`` are the model's groups behind each group, ``slopes``, (n_modes, n_groups), relative changes of
    frequencies per relative change of stiffness; ``start_`` is what is known at the end of a baseline of so many
    ``years``. A change of a group's stiffness by `LIMIT` is worth attention however slowly it came.
    """

    records: DailyRecords
    members: Mapping[str, Sequence[str]]
    slopes: Array
    noise: DailyNoise
    memory: Lookback
    years: float
    start_: FollowerState = field(repr=False)

    @classmethod
    @warnings_once()
    def of(
        cls,
        fem: Any,
        T: pd.DataFrame,
        F: pd.DataFrame,
        groups: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
    ) -> DriftFollower:
        """Learn from the temperatures and frequencies of a baseline, for a fitted chain; by default for all groups."""
        check_is_fitted(fem)
        temperatures = list(getattr(fem, "feature_names_in_", ["named temperatures"]))
        missing = [one for one in temperatures if one not in T] + [one for one in fem.mode_names_ if one not in F]
        if missing:
            raise ValueError(
                f"the chain fem was fitted on temperatures and modes of which the baseline lacks {missing}; expected "
                f"their names among the temperatures {list(T.columns)} and the frequencies {list(F.columns)}"
            )
        T, F = T[temperatures], F[list(fem.mode_names_)]
        T, F = checked_records(fem, T, F)
        records, memory, days = DailyRecords.of(fem, T), Lookback.learned(fem.mapper_), calendar(F.index, "1D")
        daily, effects = records.means(T, F, days), GroupEffects.of(fem, T, F, groups).without_even()
        noise = DailyNoise.of(daily.values, with_time(daily, 1), daily.counts)
        n_groups, n_modes, span = len(effects.names), F.shape[1], len(days) * A_DAY
        sizes = [n_groups, n_groups, n_modes * (records.basis.size + 1), n_modes]
        covariance = np.diag(np.repeat([0.0, RATE**2, MISLEARNED**2, 0.0], sizes))
        levels, slopes = np.arange(n_groups), n_groups + np.arange(n_groups)
        covariance[levels, levels] = (RATE * span / 2) ** 2
        covariance[levels, slopes] = covariance[slopes, levels] = -(RATE**2) * span / 2
        covariance[-n_modes:, -n_modes:] = noise.stationary
        known, sudden = State(np.zeros(len(covariance)), covariance), np.empty(0, dtype=bool)
        start = FollowerState(days[-1], known, daily[:0], sudden, daily.weather, *_latest(memory, T))
        found = cls(records, effects.members, effects.slopes, noise, memory, span, start)
        for number in range(len(days)):
            known = found.next_day(known, observation(daily, number, noise, effects.slopes))
        return replace(found, start_=replace(start, known=known))

    def start(self) -> FollowerState:
        return self.start_

    def advance(self, state: FollowerState, T: pd.DataFrame, F: pd.DataFrame) -> FollowerState:
        """The state at the end of one complete day, whose records are in order of time.

        It stays as it is without any, or if that day is known already, such as the last one of the baseline.
        """
        if not len(F):
            return state
        days = midnights_between(state.day, F.index[-1])[1:]
        if not len(days):
            return state
        for _ in days[:-1]:
            state = self._with_day(state, self._no_records())
        beside = pd.concat([_history(state, T.index.tz, self.temperatures), T[self.temperatures]])
        with without_warnings():  # earlier temperatures have no lags; gaps of the day are the detector's to tell
            daily = self.records.means(beside, F[self.modes], days[-1:], state.weather)
        times, temperatures = _latest(self.memory, beside)
        return replace(self._with_day(state, daily), times=times, temperatures=temperatures)

    def corrected(self, state: FollowerState, F: pd.DataFrame) -> pd.DataFrame:
        """Measured frequencies without the drift that is taken out, by the state at the end of the day before."""
        shift = dict(zip(self.modes, self.share(state) * self.frequency_drift(state.known)[0], strict=True))
        return F * np.exp([-shift.get(mode, 0.0) for mode in F])

    def share(self, state: FollowerState) -> float:
        """Share of the drift found that is taken out: 0 as long as it may be chance, and nearly 1 when it is clear."""
        shift, covariance = self.frequency_drift(state.known)
        values, vectors = np.linalg.eigh(covariance)
        clear = values > 1e-8 * values[-1]
        distance = float(((shift @ vectors[:, clear]) ** 2 / values[clear]).sum())
        by_chance = float(stats.chi2.isf(CLEAR, clear.sum()))
        return max(1 - (by_chance / distance) ** 2, 0.0) if distance > 0 else 0.0

    def report(self, state: FollowerState) -> pd.DataFrame:
        """Drift of each group since the baseline.

        Of its stiffness: relative ``change`` and ``standard_error``, the same a year (``per_year``,
        ``per_year_error``), the ``p_value`` of the structure's drift, by which groups it is explained best
        (``significant``, none if that may be chance), and whether such a change is ``beyond_limit``. The explanation,
        of one or two groups or of "all groups", which has a row then, is that of `track_parameters`.
        """
        found, explained = self.estimate(state.known), self.explanations(state)
        if explained.p_value <= SIGNIFICANT:
            best = self.estimate_of(explained.sets[0], state)
            found = pd.concat([found.drop(index=best.index, errors="ignore"), best])
            found = found.reindex([*self.members, *best.index.difference(list(self.members))]).rename_axis("group")
        scale = np.exp(found["change"])
        clear = found.index.isin(best.index) if explained.p_value <= SIGNIFICANT else np.zeros(len(found), dtype=bool)
        return pd.DataFrame(
            {
                "change": scale - 1,
                "standard_error": scale * found["standard_error"],
                "per_year": np.expm1(found["per_year"]),
                "per_year_error": found["per_year_error"],
                "p_value": explained.p_value,
                "significant": clear,
                "beyond_limit": clear & (np.abs(scale - 1) > LIMIT),
            }
        )

    def taken_out(self, state: FollowerState) -> pd.Series:
        """Relative change of each group's stiffness that is taken out of the frequencies."""
        return np.expm1(self.share(state) * self.estimate(state.known)["change"])

    def explanations(self, state: FollowerState) -> Explanations:
        """What explains the drift since the baseline, and the probability of such a drift by chance."""
        trends, n = self.trends(state), len(self.members)
        return Explanations.of(trends, self.noise.freedom, np.random.RandomState(0), range(n, trends.n_groups))

    def trends(self, state: FollowerState) -> ModeTrends:
        """Shift of the modes from the middle of the baseline on, and the effects of groups and of all of them."""
        shift, covariance = self.frequency_drift(state.known)
        rounding = ROUNDING * np.diag(covariance).mean() * np.eye(len(covariance))
        years = self.years / 2 + (state.learned - self.start_.learned) / YEAR
        evenly = [self.slopes.sum(axis=1, keepdims=True)] if len(self.members) > 1 else []
        return ModeTrends(shift, covariance + rounding, np.hstack([self.slopes, *evenly]), years)

    def estimate_of(self, groups: Sequence[int], state: FollowerState) -> pd.DataFrame:
        """As `estimate`, if only these groups drift, of which the last may be all groups alike."""
        trends, n = self.trends(state), len(self.members)
        slopes = trends.slopes[:, list(groups)]
        weighted = np.linalg.solve(trends.covariance, slopes)
        inverse = np.linalg.inv(slopes.T @ weighted) @ weighted.T @ self.slopes
        levels, rates = slice(0, n), slice(n, 2 * n)
        columns = {}
        for name, part in (("change", levels), ("per_year", rates)):
            spread = inverse @ state.known.covariance[part, part] @ inverse.T
            columns[name] = inverse @ state.known.mean[part]
            columns["standard_error" if name == "change" else "per_year_error"] = np.sqrt(np.diag(spread))
        return pd.DataFrame(columns, index=[[*self.members, ALL_GROUPS][group] for group in groups])

    def next_day(self, known: State, shown: DayShown | None) -> State:
        """What is known one day later, of which nothing is learned without what that day showed."""
        n = len(self.members)
        walk, turn = (deviation**2 * A_DAY * np.eye(n) for deviation in (WALK, TURN))
        predicted = DailySteps(A_DAY, walk, turn, self.noise.memory, self.noise.renewal).predict(known)
        return predicted if shown is None else absorb(predicted, shown)

    def estimate(self, known: State) -> pd.DataFrame:
        """Change of each group's ln stiffness since the baseline, and yearly, with standard errors."""
        n = len(self.members)
        errors = np.sqrt(np.diag(known.covariance)[: 2 * n])
        columns = {
            "change": known.mean[:n],
            "standard_error": errors[:n],
            "per_year": known.mean[n : 2 * n],
            "per_year_error": errors[n:],
        }
        return pd.DataFrame(columns, index=pd.Index(list(self.members), name="group"))

    def frequency_drift(self, known: State) -> tuple[Array, Array]:
        """Shift of ln frequency of each mode that the drift causes, (n_modes,), and its covariance."""
        n = len(self.members)
        return self.slopes @ known.mean[:n], self.slopes @ known.covariance[:n, :n] @ self.slopes.T

    @property
    def modes(self) -> list[str]:
        return list(self.records.fem.mode_names_)

    @property
    def temperatures(self) -> list[str]:
        return list(self.records.fem.feature_names_in_)

    def _no_records(self) -> DailyMeans:
        n_modes, size = len(self.modes), self.records.basis.size + 1
        none = np.zeros((1, n_modes))
        return DailyMeans(none + np.nan, none, np.zeros((1, n_modes, size)))

    def _with_day(self, state: FollowerState, daily: DailyMeans) -> FollowerState:
        """The state after one more day; the day that has waited longest is learned from or left out."""
        waiting = state.waiting.followed_by(daily)
        sudden = np.append(state.sudden, False) | self._departs(state.known, waiting)
        state = replace(state, waiting=waiting, sudden=sudden, weather=daily.weather)
        if len(sudden) <= DELAY:
            return state
        return replace(
            state,
            learned=days_later(state.learned, 1),
            known=self.next_day(state.known, None if sudden[0] else observation(waiting, 0, self.noise, self.slopes)),
            waiting=waiting[1:],
            sudden=sudden[1:],
            n_left_out=state.n_left_out + 1 if sudden[0] else 0,
        )

    def _departs(self, known: State, waiting: DailyMeans) -> bool:
        """Whether the mean of the days that wait is too far from what was predicted."""
        number = waiting.known.sum(axis=0)
        modes = np.flatnonzero(number)
        if not len(modes):
            return False
        shift, spread = self._predicted(known, waiting)
        difference = (np.nansum(waiting.values, axis=0)[modes] / number[modes]) - shift
        distance = float(difference @ np.linalg.solve(spread, difference))
        return distance > len(modes) * stats.f.isf(SUDDEN, len(modes), max(self.noise.freedom, 4.0))

    def _predicted(self, known: State, waiting: DailyMeans) -> tuple[Array, Array]:
        """Mean of ln ratios of each measured mode over the days that wait, and its covariance."""
        noise, slopes = self.noise, self.slopes
        known_days = waiting.known
        weights = known_days / np.maximum(known_days.sum(axis=0), 1)
        ahead = np.arange(1, len(weights) + 1)
        later = ahead @ weights * A_DAY
        n_modes, n_groups = slopes.shape
        size = waiting.basis.shape[2]
        design = np.zeros((n_modes, len(known.mean)))
        design[:, :n_groups] = slopes
        design[:, n_groups : 2 * n_groups] = slopes * later[:, np.newaxis]
        basis = np.einsum("km,kms->ms", weights, waiting.basis)
        for mode in range(n_modes):
            design[mode, 2 * n_groups + mode * size :][:size] = basis[mode]
        lasting = noise.memory[:, np.newaxis, np.newaxis] ** np.abs(ahead[:, np.newaxis] - ahead)
        fading = noise.fading**2 * np.einsum("km,mkl,lm->m", weights, lasting, weights)
        fresh = noise.fresh**2 * (weights**2 / np.maximum(waiting.counts, 1)).sum(axis=0)
        deviations = np.sqrt(fading + fresh)
        walked = WALK**2 * np.sqrt(np.outer(later, later)) * (slopes @ slopes.T)
        spread = design @ known.covariance @ design.T + walked + noise.correlation * np.outer(deviations, deviations)
        modes = np.flatnonzero(known_days.any(axis=0))
        return (design @ known.mean)[modes], spread[np.ix_(modes, modes)]


def _latest(memory: Lookback, T: pd.DataFrame) -> tuple[NDArray[np.int64], Array]:
    """Stamps in nanoseconds and temperatures of the last records that those of the next day look back to."""
    times = T.index.as_unit("ns").asi8
    first = memory.start(times, len(times), int(times[-1]) + 1) if len(times) else 0
    return times[first:], T.to_numpy(dtype=float)[first:]


def _history(state: FollowerState, zone: Any, names: list[str]) -> pd.DataFrame:
    return pd.DataFrame(state.temperatures, as_index(state.times, zone), names)
