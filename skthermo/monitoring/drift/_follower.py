"""Drift that is taken out of the frequencies of a bridge in service, and sudden changes that are not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from skthermo._estimators.warnings import without_warnings
from skthermo._tables.arrays import Array
from skthermo._validation import check_is_fitted
from skthermo.monitoring._memory import Memory
from skthermo.monitoring.drift._daily import DailyMeans
from skthermo.monitoring.drift._filter import WALK, ParameterFilter, ParameterState, length_of

DELAY = 30
"""Days that a day waits before drift is learned from it: a sudden change is seen by then."""

SUDDEN = 1e-3  # probability that the mean of waiting days is as far from what was foretold by chance
CLEAR = 0.05  # probability that frequencies without drift would seem to drift as much, from which it is taken out
SIGNIFICANT = 2.58  # standard errors of a group's change: by chance in 1 % of groups that do not drift
LIMIT = 0.05
ONE_DAY = pd.DateOffset(days=1)


@dataclass(frozen=True)
class Waiting:
    """Daily means of days that wait, as in `DailyMeans`."""

    values: Array
    counts: Array
    basis: Array


@dataclass(frozen=True)
class FollowerState:
    """What a `DriftFollower` knows at the end of a day.

    ``known`` is the drift by the days that have waited long enough, ``waiting`` holds those since. Drift is not learned
    from those that are ``sudden``: in a time that departs from what was foretold; ``n_left_out`` of such in a row.
    ``weather`` is the first coordinate of the last day's mean weather, NaN if it is not known, ``times`` (nanoseconds)
    and ``temperatures`` are the latest records, as many as lags of the chain look back.
    """

    known: ParameterState
    waiting: Waiting
    sudden: NDArray[np.bool_]
    weather: float
    times: NDArray[np.int64]
    temperatures: Array
    n_left_out: int = 0

    @property
    def day(self) -> pd.Timestamp:
        """Beginning of the last day."""
        return self.known.day + len(self.sudden) * ONE_DAY


@dataclass(frozen=True)
class DriftFollower:
    """Takes slow drift out of measured frequencies, and leaves sudden changes in.

    Drift is followed by a `ParameterFilter`, a month behind: a day is learned from when it has waited `DELAY` days, and
    only if no time of this length that holds it departs from what was foretold. So a sudden change is never learned
    as drift, however long it lasts; a drift that is much faster than some percent a year is not either. A sudden change
    that the mean of a month does not show is learned in time, and reported as the drift that it looks like.

    What is taken out is the drift found, times a share that is 0 as long as it may be chance and goes to 1 as it
    becomes clear.

    ``limit`` is the change of a group's stiffness that is worth attention however slowly it came, ``start_`` what is
    known at the end of the baseline.
    """

    filter: ParameterFilter
    limit: float
    memory: Memory
    start_: FollowerState = field(repr=False)

    @classmethod
    def of(
        cls,
        fem: Any,
        T: pd.DataFrame,
        F: pd.DataFrame,
        groups: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
        *,
        limit: float = LIMIT,
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
        T, F = T[list(fem.feature_names_in_)], F[list(fem.mode_names_)]
        followed, memory = ParameterFilter.of(fem, T, F, groups), Memory.of(fem.mapper_)
        n_modes, size = F.shape[1], followed.records.basis.size
        nothing = np.empty((0, n_modes))
        waiting, known = Waiting(nothing, nothing, np.empty((0, n_modes, size))), followed.start()
        start = FollowerState(known, waiting, np.empty(0, dtype=bool), known.weather, *_latest(memory, T))
        return cls(followed, limit, memory, start)

    def start(self) -> FollowerState:
        """What is known at the end of the baseline."""
        return self.start_

    def advance(self, state: FollowerState, T: pd.DataFrame, F: pd.DataFrame) -> FollowerState:
        """The state at the end of one complete day, whose records are in order of time.

        It stays as it is without any, or if that day is known already, such as the last one of the baseline.
        """
        if not len(F):
            return state
        today = F.index[-1].normalize()
        days = pd.date_range(state.day, today, freq="D")[1:]
        if not len(days):
            return state
        for _ in days[:-1]:
            state = self._with_day(state, self._no_records())
        beside = pd.concat([_history(state, T.index.tz, self.temperatures), T[self.temperatures]])
        with without_warnings():  # earlier temperatures have no lags; gaps of the day are the detector's to tell
            daily = self.filter.records.means(beside, F[self.modes], days[-1:], state.weather)
        times, temperatures = _latest(self.memory, beside)
        return replace(self._with_day(state, daily), times=times, temperatures=temperatures)

    def corrected(self, state: FollowerState, F: pd.DataFrame) -> pd.DataFrame:
        """Measured frequencies without the drift that is taken out, by the state at the end of the day before."""
        shift = dict(zip(self.modes, self.share(state) * self.filter.frequency_drift(state.known), strict=True))
        return F * np.exp([-shift.get(mode, 0.0) for mode in F])

    def share(self, state: FollowerState) -> float:
        """Share of the drift found that is taken out: 0 as long as it may be chance, and nearly 1 when it is clear."""
        shift, covariance = self.filter.frequency_drift(state.known), self.filter.frequency_covariance(state.known)
        values, vectors = np.linalg.eigh(covariance)
        clear = values > 1e-8 * values[-1]
        distance = float(((shift @ vectors[:, clear]) ** 2 / values[clear]).sum())
        by_chance = float(stats.chi2.isf(CLEAR, clear.sum()))
        return max(1 - (by_chance / distance) ** 2, 0.0) if distance > 0 else 0.0

    def report(self, state: FollowerState) -> pd.DataFrame:
        """Drift of each group since the baseline.

        Of its stiffness: relative ``change`` and ``standard_error``, the same a year (``per_year``,
        ``per_year_error``), whether the change is ``significant``, ``taken_out`` (the change that is taken out of the
        frequencies), and whether a significant change is ``beyond_limit``.
        """
        found = self.filter.estimate(state.known)
        scale = np.exp(found["change"])
        share = self.share(state)
        clear = (np.abs(found["change"]) > SIGNIFICANT * found["standard_error"]) & (share > 0)
        change = scale - 1
        return pd.DataFrame(
            {
                "change": change,
                "standard_error": scale * found["standard_error"],
                "per_year": np.expm1(found["per_year"]),
                "per_year_error": found["per_year_error"],
                "significant": clear,
                "taken_out": np.expm1(share * found["change"]),
                "beyond_limit": clear & (np.abs(change) > self.limit),
            }
        )

    @property
    def modes(self) -> list[str]:
        """Names of the frequencies that are followed."""
        return list(self.filter.records.fem.mode_names_)

    @property
    def temperatures(self) -> list[str]:
        """Names of the temperatures that tell the weather."""
        return list(self.filter.records.fem.feature_names_in_)

    def _no_records(self) -> DailyMeans:
        """A day without any."""
        n_modes, size = len(self.modes), self.filter.records.basis.size
        none = np.zeros((1, n_modes))
        return DailyMeans(pd.DatetimeIndex([pd.NaT]), none + np.nan, none, np.zeros((1, n_modes, size)))

    def _with_day(self, state: FollowerState, daily: DailyMeans) -> FollowerState:
        """The state after one more day; the day that has waited longest is learned from or left out."""
        there = daily.basis[0, daily.known[0], 1]
        waiting = Waiting(
            np.vstack([state.waiting.values, daily.values]),
            np.vstack([state.waiting.counts, daily.counts]),
            np.concatenate([state.waiting.basis, daily.basis]),
        )
        sudden = np.append(state.sudden, False) | self._departs(state.known, waiting)
        weather = float(there[0]) if len(there) else float("nan")
        state = replace(state, waiting=waiting, sudden=sudden, weather=weather)
        if len(sudden) <= DELAY:
            return state
        day = pd.DatetimeIndex([state.known.day + ONE_DAY])
        oldest = DailyMeans(day, waiting.values[:1], waiting.counts[:1], waiting.basis[:1])
        return replace(
            state,
            known=self.filter.advanced(state.known, oldest, absorb=not sudden[0]),
            waiting=Waiting(waiting.values[1:], waiting.counts[1:], waiting.basis[1:]),
            sudden=sudden[1:],
            n_left_out=state.n_left_out + 1 if sudden[0] else 0,
        )

    def _departs(self, known: ParameterState, waiting: Waiting) -> bool:
        """Whether the mean of the days that wait is too far from what was foretold."""
        number = (~np.isnan(waiting.values)).sum(axis=0)
        modes = np.flatnonzero(number)
        if not len(modes):
            return False
        shift, spread = self._foretold(known, waiting)
        difference = (np.nansum(waiting.values, axis=0)[modes] / number[modes]) - shift
        distance = float(difference @ np.linalg.solve(spread, difference))
        return distance > len(modes) * stats.f.isf(SUDDEN, len(modes), max(self.filter.noise.freedom, 4.0))

    def _foretold(self, known: ParameterState, waiting: Waiting) -> tuple[Array, Array]:
        """Mean of ln ratios of each measured mode over the days that wait, and its covariance."""
        noise, slopes = self.filter.noise, self.filter.slopes
        known_days = ~np.isnan(waiting.values)
        weights = known_days / np.maximum(known_days.sum(axis=0), 1)
        ahead = np.arange(1, len(weights) + 1)
        later = ahead @ weights * length_of(self.filter.records.freq)
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


def _latest(memory: Memory, T: pd.DataFrame) -> tuple[NDArray[np.int64], Array]:
    """Stamps in nanoseconds and temperatures of the last records that those of the next day look back to."""
    times = T.index.as_unit("ns").asi8
    first = memory.start(times, len(times), int(times[-1]) + 1) if len(times) else 0
    return times[first:], T.to_numpy(dtype=float)[first:]


def _history(state: FollowerState, zone: Any, names: list[str]) -> pd.DataFrame:
    """The latest temperatures that a state holds."""
    stamps = pd.DatetimeIndex(state.times.astype("datetime64[ns]"))
    return pd.DataFrame(
        state.temperatures, stamps if zone is None else stamps.tz_localize("UTC").tz_convert(zone), names
    )
