"""Stiffness of groups over years, from records of temperatures and frequencies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from skthermo._core.arrays import Array, as_random_state, check_probability
from skthermo._core.warnings import warnings_once
from skthermo.monitoring.drift._explanations import N_SHAPES, SIGNIFICANT, Explanations, ModeTrends
from skthermo.monitoring.drift._history import DriftResolution, GroupTrajectory, ModeShifts, ParameterHistory
from skthermo.monitoring.drift._kalman import DailyNoise, DailySteps, State
from skthermo.monitoring.drift._observations import (
    MISLEARNED,
    DailyMeans,
    DailyRecords,
    GroupEffects,
    calendar,
    checked_records,
    length_of,
    observation,
    shapes_of_time,
    with_time,
)

ANY_TREND = 0.3  # prior standard deviation of a trend of ln frequency over the records
ANY_RATE = 0.1  # prior standard deviation of the yearly change of ln stiffness of a group that is followed
EFFECT_ERROR = 0.01  # relative error of the FE model's effects of groups that bands allow for
FEWEST = 3  # days with a mode for each coefficient that it needs, below which the mode is left out


@warnings_once()
def track_parameters(
    fem: Any,
    T: pd.DataFrame,
    F: pd.DataFrame,
    groups: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
    freq: str = "1D",
    *,
    significance: float = SIGNIFICANT,
    random_state: int | np.random.RandomState | None = None,
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
        Period over which records are averaged: a day or some days, such as "7D".
    significance : float, default=0.01
        Probability with which a structure that does not age counts as drifting.
    random_state : int, RandomState or None, default=None
        Seed of the draws behind ``p_value`` and `ParameterHistory.reaches`.

    Returns
    -------
    ParameterHistory
        Relative stiffness of each group by day with bands, rates a year, indistinguishable groups, and when a limit is
        reached.

    Raises
    ------
    ValueError
        If fem is not a fitted chain or its model cannot be damaged, T and F are no frames with times, differ in rows or
        have other columns than in fit, a group is unknown, the period is not a day or some days, or no mode was
        measured on enough days.

    See Also
    --------
    Monitor : Follows drift day by day.
    skthermo.studies.identify_damage : Which damage explains a sudden shift.

    Notes
    -----
    Bands allow for an error of 1 % of the FE model's effects; if it is less accurate than that, they are too narrow.
    :ref:`how-drift-is-estimated` has the parts of the daily means, and how sets of groups explain the trends.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.monitoring import track_parameters
    >>> from skthermo.surrogate import DataInformedFEM
    >>> years = make_truss_campaign(3, drift={"bottom": 0.02}, random_state=0)
    >>> T, F = years.temperatures, years.frequencies
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(T[:365], F[:365])
    >>> history = track_parameters(fem, T, F, freq="7D", random_state=0)
    >>> history.has_drift, history.rates["per_year"].idxmin()
    (True, 'bottom')
    """
    T, F = checked_records(fem, T, F)
    check_probability(significance, "significance")
    random = as_random_state(random_state)
    length_of(freq)
    order = np.argsort(F.index, kind="stable")
    T, F = T.iloc[order], F.iloc[order]
    days = calendar(F.index, freq)
    daily = with_enough_days(DailyRecords.of(fem, T).means(T, F, days), fem.mode_names_)
    effects = GroupEffects.of(fem, T, F, groups)
    noise = DailyNoise.of(daily.values, with_time(daily, N_SHAPES), daily.counts)
    trends = mode_trends(daily, noise, effects.slopes, freq)
    found = Explanations.of(trends, noise.freedom, random, effects.even)
    followed = Followed(trends.widened(found.widening), found, len(days))
    changes = {group: trajectory.mean[-1] for group, trajectory in followed.best().items()}
    slopes = effects.of_changes(changes if found.p_value <= significance else {})
    followed = replace(followed, trends=replace(followed.trends, slopes=slopes))
    return history_of(fem, days, effects, followed, daily.known.any(axis=0), significance, random)


def with_enough_days(daily: DailyMeans, modes: Sequence[Any]) -> DailyMeans:
    """Daily means without modes that were measured on too few days."""
    needed = FEWEST * (daily.basis.shape[2] + N_SHAPES)
    n_days = daily.known.sum(axis=0)
    if (n_days < needed).all():
        counts = ", ".join(f"{mode} {number}" for mode, number in zip(modes, n_days, strict=True))
        raise ValueError(
            f"modes were measured, with temperatures, on too few days: {counts}; expected {needed} or more"
        )
    return replace(daily, values=np.where(n_days < needed, np.nan, daily.values))


def mode_trends(daily: DailyMeans, noise: DailyNoise, slopes: Array, freq: str) -> ModeTrends:
    """How each mode went over the records beside what the weather explains, by a line and slow waves."""
    n_modes = len(slopes)
    none, size = np.zeros((n_modes, 0)), daily.basis.shape[2]
    wide = replace(daily, basis=with_time(daily, N_SHAPES))
    deviations = np.append(np.full(size, MISLEARNED), np.full(N_SHAPES, ANY_TREND))
    covariance = np.diag(np.append(np.tile(deviations**2, n_modes), np.zeros(n_modes)))
    covariance[-n_modes:, -n_modes:] = noise.stationary
    days = [observation(wide, number, noise, none) for number in range(len(daily.values))]
    steps = DailySteps(length_of(freq), np.zeros((0, 0)), np.zeros((0, 0)), noise.memory, noise.renewal)
    state = steps.filtered(State(np.zeros(len(covariance)), covariance), days)
    places = (np.arange(n_modes)[:, np.newaxis] * (size + N_SHAPES) + size + np.arange(N_SHAPES)).ravel()
    years = (len(daily.values) - 1) * length_of(freq)
    return ModeTrends(state.mean[places], state.covariance[np.ix_(places, places)], slopes, years)


@dataclass(frozen=True)
class Followed:
    """Trends of the modes over so many days, and what explains these; gives the stiffness of groups by day."""

    trends: ModeTrends
    found: Explanations
    n_days: int

    def best(self) -> dict[int, GroupTrajectory]:
        groups, walk = self.found.sets[0], float(self.found.walk[0])
        return {group: self.beside([group], [one for one in groups if one != group], walk) for group in groups}

    def beside(self, joined: Sequence[int], others: Sequence[int], walk: float) -> GroupTrajectory:
        """Groups that all change alike, if only some others change beside them; from the trends of the modes."""
        trends, n = self.trends, self.trends.n_shapes
        both = replace(
            trends, slopes=np.column_stack([trends.slopes[:, list(joined)].sum(axis=1), trends.slopes[:, list(others)]])
        )
        means, covariance = both.coefficients(range(1 + len(others)), walk, ANY_RATE)
        mean, covariance = means[:n], covariance[:n, :n]
        shapes = shapes_of_time(self.n_days, n)
        at_end = np.array([shapes[-1], np.append(1 / trends.years, np.zeros(n - 1))])
        deviations = np.sqrt(np.einsum("ti,ij,tj->t", shapes, covariance, shapes))
        return GroupTrajectory(shapes @ mean, deviations, at_end @ mean, at_end @ covariance @ at_end.T, walk)


def indistinguishable_sets(
    found: Explanations, alternatives: Mapping[int, Sequence[int]], even: Sequence[int]
) -> list[tuple[int, ...]]:
    """Groups that cannot be distinguished: in the drift that was found, or by their effects on the modes."""
    sets = [tuple(one for one in others if one not in even) for others in alternatives.values()]
    sets = [others for others in sets if len(others) > 1]
    for group, others in found.confounded.items():
        both = [group, *(one for one in others if group in found.confounded.get(one, []))]
        alike = tuple(sorted(one for one in both if one not in even))
        if len(alike) > 1 and not set(alike) & set(alternatives) and alike not in sets:
            sets.append(alike)
    return sets


def mode_table(
    names: Sequence[Any], followed: Followed, explained: Array, is_measured: NDArray[np.bool_]
) -> pd.DataFrame:
    """Measured and explained change of ln frequency over the records; NaN for a mode that was hardly measured."""
    trends = followed.trends
    at_end = np.kron(np.eye(len(trends.slopes)), shapes_of_time(followed.n_days, trends.n_shapes)[-1:])
    columns = {
        "measured": at_end @ trends.mean,
        "explained": explained,
        "standard_error": np.sqrt(np.diag(at_end @ trends.covariance @ at_end.T)),
    }
    table = pd.DataFrame(columns, index=pd.Index(names, name="mode"))
    table.loc[~is_measured] = np.nan
    return table


def history_of(
    fem: Any,
    days: pd.DatetimeIndex,
    effects: GroupEffects,
    followed: Followed,
    is_measured: NDArray[np.bool_],
    significance: float,
    random: np.random.RandomState,
) -> ParameterHistory:
    """What was found, by the names of groups and modes."""
    found, names = followed.found, effects.names
    has_drift, trends = found.p_value <= significance, followed.trends
    best, walk = (found.sets[0], float(found.walk[0])) if has_drift else ((), 0.0)
    alternatives = {group: found.instead(group) for group in best}
    trajectories = [
        followed.beside([group], [one for one in best if group not in alternatives[one]], walk)
        for group in range(len(names))
    ]
    sets = indistinguishable_sets(found, alternatives, effects.even)
    named = dict(zip(names, trajectories, strict=True))
    for alike in sets:
        label = " and ".join(names[group] for group in alike)
        named[label] = followed.beside(alike, [one for one in best if one not in alike], walk)
    with np.errstate(divide="ignore"):
        alone = 1 / np.sqrt(np.diag(trends.information())) / trends.years
    shifts = np.zeros((len(days), len(trends.slopes)))
    for group in best:
        shifts += np.outer(trajectories[group].mean, trends.slopes[:, group])
    misfit, freedom = replace(trends, covariance=trends.covariance / found.widening).misfit(found.sets[0])
    return ParameterHistory(
        days=days,
        trajectories={name: one.with_error_of_effects(EFFECT_ERROR) for name, one in named.items()},
        p_value=found.p_value,
        significance=significance,
        explanations=pd.DataFrame(
            {
                "groups": [tuple(names[group] for group in one) for one in found.sets],
                "probability": found.probabilities,
                "log_evidence": found.evidence,
            }
        ),
        alternatives={names[group]: [names[other] for other in others] for group, others in alternatives.items()},
        resolution=DriftResolution(
            pd.Series((stats.norm.isf(significance / (2 * len(names))) + 1.28) * alone, index=names),
            unobservable=[names[group] for group in np.flatnonzero(found.unobservable)],
            confounded={names[one]: [names[other] for other in others] for one, others in found.confounded.items()},
            indistinguishable=[tuple(names[group] for group in one) for one in sets],
        ),
        modes=ModeShifts(
            mode_table(fem.mode_names_, followed, shifts[-1], is_measured),
            pd.DataFrame(shifts, days, fem.mode_names_),
            misfit_p_value=float(stats.chi2.sf(misfit, freedom)) if freedom > 0 else float("nan"),
            widening=found.widening,
        ),
        seed=int(random.randint(2**31 - 1)),
    )
