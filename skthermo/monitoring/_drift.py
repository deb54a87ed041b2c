"""Slow change of stiffness in daily means of frequencies: how it is followed in service, and its history over years."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats
from scipy.special import softmax
from sklearn.decomposition import PCA
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from skthermo._core.arrays import Array, as_floats, check_probability, is_real, refuse_no_table
from skthermo._core.estimators import check_is_fitted
from skthermo._core.frames import (
    DAY,
    YEAR,
    check_duration,
    frame_like,
    has_stamps,
    midnight,
    midnights,
    midnights_between,
)
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.text import SPACE, Sentences, listed, percent, probability_text, share_text
from skthermo._core.warnings import warn_each
from skthermo.fem.damage import ALL_GROUPS, read_groups
from skthermo.preprocessing.checks import set_aside
from skthermo.residuals.sensors import SensorRegression


def read_slopes(fem: Any, groups: Sequence[str] | Mapping[str, Sequence[str]] | None) -> tuple[list[str], Array]:
    """Names of damage groups, last "all groups" alike, and d ln f / d ln stiffness, (n_modes, n_groups)."""
    members = read_groups(fem.model, groups)
    if len(members) > 1:
        members[ALL_GROUPS] = list(dict.fromkeys(name for joined in members.values() for name in joined))
    asked = list(dict.fromkeys(name for joined in members.values() for name in joined))
    directions = fem.damage_directions(asked, kind="stiffness")
    slopes = [-directions.reindex(joined).fillna(0.0).sum().to_numpy() for joined in members.values()]
    return list(members), np.column_stack(slopes)


def daily_means(table: pd.DataFrame) -> pd.DataFrame:
    """Means over each calendar day from the first record to the last, NaN without any."""
    calendar = midnights_between(table.index.min(), table.index.max())
    return table.groupby(midnights(table.index)).mean().reindex(calendar)


def weather_columns(T: Array, half_lives: Sequence[float] = (5.0, 30.0)) -> Array:
    """Columns of a regression on daily mean temperatures: a cubic of up to three of their principal components.

    Exponential means of the first one stand for what follows the weather slowly.
    """
    T = T[:, ~np.isnan(T).all(axis=0)]
    known = ~np.isnan(T).all(axis=1)
    if known.sum() < 10:
        return np.ones((len(T), 1))
    filled = SensorRegression.fitted(T).fill(T)[0]
    axes = make_pipeline(StandardScaler(), PCA(0.98, svd_solver="full", whiten=True))
    parts = axes.fit_transform(filled[known])[:, :3]
    columns = np.full((len(T), PolynomialFeatures(2).fit(parts).n_output_features_ + parts.shape[1]), np.nan)
    columns[known] = np.hstack([PolynomialFeatures(2).fit_transform(parts), parts**3])
    first = pd.Series(columns[:, 1])
    return np.column_stack([columns, *(first.ewm(halflife=days).mean() for days in half_lives)])


def lasting_covariance(rest: Array, n_columns: int, lags: int = 10, n_waves: int = 12) -> tuple[Array, float]:
    """Covariance of a day's residuals times the days for which they last, and its degrees of freedom.

    ``rest`` has a row a day, NaN where a mode is missing, from a regression on so many columns. What is left of them
    by the day before is summed with its products up to some lags apart (Newey and West). What lasts for months, such
    as moisture, shows in the slowest waves over all days (the regression has taken a few of them): where these are
    larger, they count.
    """
    n_days, rest = (~np.isnan(rest)).sum(axis=0), np.nan_to_num(rest)
    kept = float(np.clip((rest[1:] * rest[:-1]).sum() / max((rest[:-1] ** 2).sum(), 1e-300), 0.0, 0.97))
    added = rest[1:] - kept * rest[:-1]
    total = added.T @ added
    for lag in range(1, min(lags, len(added) // 5) + 1):
        product = added[lag:].T @ added[:-lag]
        total += (1 - lag / (lags + 1)) * (product + product.T)
    total /= (1 - kept) ** 2
    if n_waves:
        share = (np.arange(len(rest)) + 0.5) / len(rest)
        waves = np.sqrt(2) * np.cos(np.pi * np.outer(np.arange(1, n_waves + 1), share))
        slow = ((waves @ rest) ** 2).sum(axis=0) / (n_waves - 4)
        larger = np.sqrt(np.fmax(slow / np.maximum(np.diag(total), 1e-300), 1.0))
        total *= np.outer(larger, larger)
    left = max(n_days.max() - n_columns, 1)
    total *= n_days.max() / left / np.sqrt(np.outer(n_days, n_days)).clip(1)
    n_independent = min(left * (1 - kept) / (1 + kept), 1.5 * len(rest) / (lags + 1))  # of a sum over so many lags
    return total + 1e-16 * np.eye(len(total)), max(n_independent, 3.0)


@dataclass(frozen=True)
class DailyRegression:
    """Ln f of each mode on the weather of the day and, last, on columns of time, with noise that lasts.

    ``change`` are the coefficients of time, (n_modes, n_times), and ``covariance`` is theirs, mode by mode; ``rest``
    are residuals by day, and ``freedom`` counts the degrees of freedom of their noise.
    """

    change: Array
    covariance: Array
    rest: Array
    freedom: float

    @classmethod
    def fitted(
        cls, X: Array, times: Array, y: Array, *, deviations: float | Sequence[float] = 0.3, **noise_options: int
    ) -> DailyRegression:
        """Each mode by the days that have it; the coefficients of time have such deviations beforehand."""
        columns, y = np.hstack([X, times]), y - np.nanmean(y, axis=0)
        known = ~np.isnan(y) & ~np.isnan(X).any(axis=1, keepdims=True)
        columns, n_times = np.nan_to_num(columns), times.shape[1]
        products = np.array([columns[rows].T @ columns[rows] for rows in known.T])
        moments = np.where(known, y, 0.0).T @ columns
        prior = np.r_[np.full(X.shape[1], 0.3), np.broadcast_to(deviations, n_times)] ** -2.0
        noise = np.diag(np.nanvar(y, axis=0))
        for _ in range(2):  # the prior hardly matters to the residuals, by which the noise is known
            inverse = np.linalg.inv(products + np.diag(noise)[:, np.newaxis, np.newaxis] * np.diag(prior))
            coefficients = np.einsum("mpq,mq->mp", inverse, moments)
            rest = np.where(known, y - columns @ coefficients.T, np.nan)
            noise, freedom = lasting_covariance(rest, columns.shape[1], **noise_options)
        roots = np.linalg.cholesky((inverse + inverse.swapaxes(1, 2)) / 2)[:, -n_times:]
        covariance = np.einsum("mn,mip,njp->minj", noise, roots, roots, optimize=True)
        covariance = covariance.reshape(2 * [n_times * y.shape[1]])
        covariance += 1e-9 * np.diag(np.diag(covariance))  # of modes that are copies of each other
        return cls(coefficients[:, -n_times:], covariance, rest, freedom)

    def chance(self) -> tuple[Array, Array, float]:
        """Coefficients of the last column of time, their covariance, and Hotelling's probability of such by chance."""
        n_modes, n_times = self.change.shape
        last, own = self.change[:, -1], self.covariance[n_times - 1 :: n_times, n_times - 1 :: n_times]
        freedom = max(self.freedom - n_modes + 1, 1.0)
        squared = float(last @ np.linalg.solve(own, last))
        share = freedom / (n_modes * max(self.freedom, n_modes))
        return last, own, float(stats.f.sf(squared * share, n_modes, freedom))


def bending_line(years: Array, bends: Array) -> Array:
    """A line through zero, and ramps from each bend on, (n_days, 1 + n_bends)."""
    return np.column_stack([years, np.maximum(years[:, np.newaxis] - bends, 0.0)])


def products_of(fit: DailyRegression, slopes: Array) -> Array:
    """Products of the effects of groups, and last of the modes' changes, in standard errors of the latter."""
    effects = np.kron(slopes, np.eye(fit.change.shape[1]))
    root = np.linalg.cholesky(fit.covariance)
    whitened = np.linalg.solve(root, np.column_stack([effects, fit.change.ravel()]))
    return whitened.T @ whitened


class StiffnessTrends:
    """Changes of groups that explain how modes change along a bending line in time.

    All sets of one or two groups, and an even change of all, by decreasing evidence against no change; most often one
    group changes, and steadily. Of the bends, the yearly standard deviation counts by which the best set explains the
    modes. ``p_value`` is the probability that one of the groups would seem to change as clearly by chance, along a
    straight line: Student's law of the largest change in its standard errors, times the number of groups (Bonferroni).
    ``rate_errors`` are standard errors of the yearly change of each group if no other changes.
    """

    def __init__(self, X: Array, line: Array, y: Array, slopes: Array, names: list[str]):
        straight, self.modes = (DailyRegression.fitted(X, times, y) for times in (line[:, :1], line))
        self.names, self.line, self._products = names, line, products_of(self.modes, slopes)
        steady, n = products_of(straight, slopes), len(names)
        with np.errstate(divide="ignore"):
            self.rate_errors = np.diag(steady)[:n] ** -0.5  # infinite where no mode moves
        scores = np.abs(steady[:n, n]) * np.minimum(self.rate_errors, 1e150)
        self.p_value = float(min(2 * n * stats.t.sf(scores.max(), straight.freedom), 1.0))
        apart = [place for place, name in enumerate(names) if name != ALL_GROUPS]
        pairs, bends = list(combinations(apart, 2)), (0.0, 0.005, 0.02)[: line.shape[1] + 1 if line.shape[1] > 1 else 1]
        sets = [*((place,) for place in range(n)), *pairs]
        shares = np.r_[np.full(n, 0.8 / n), np.full(len(pairs), 0.2 / max(len(pairs), 1))]
        table = np.array([[self._explained(one, 0.03, bend)[2] for bend in bends] for one in sets])
        evidence = np.logaddexp.reduce(table, axis=1) + np.log(shares / len(bends))
        order = np.argsort(-evidence, kind="stable")
        self.sets, self.evidence = [sets[place] for place in order], evidence[order]
        self.bend = bends[int(np.argmax(table[order[0]]))]

    def alternatives(self, as_likely: float = 3.0) -> dict[str, list[str]]:
        """For each group of the best set, those that explain the modes about as well in its place."""
        best, found = set(self.sets[0]), {}
        likely = [set(one) for one in self.sets[: np.count_nonzero(self.evidence >= self.evidence[0] - as_likely)]]
        for group in sorted(best):
            others = best - {group}
            rivals = {place for one in likely if len(one) == len(best) and others < one for place in one - others}
            found[self.names[group]] = [self.names[place] for place in sorted(rivals)]
        return found

    def change(self, group: int, beside: Sequence[int]) -> tuple[Array, Array]:
        """Ln stiffness of a group by day, and its standard deviation, if some others change as well.

        Three per cent of it may be an error of the FE model's effects.
        """
        coefficients, covariance, _ = self._explained([group, *beside], 0.1, self.bend)
        size = self.line.shape[1]
        mean = self.line @ coefficients[:size]
        spread = np.sqrt(np.einsum("ti,ij,tj->t", self.line, covariance[:size, :size], self.line))
        return mean, np.hypot(spread, 0.03 * mean)

    def expected(self) -> Array:
        """Ln stiffness of each group on the last day: the mean over all sets, and none, weighed by their evidence."""
        found = np.zeros(len(self.names))
        for weight, one in zip(softmax(np.r_[0.0, self.evidence])[1:], self.sets, strict=True):
            coefficients = self._explained(one, 0.1, self.bend)[0].reshape(len(one), -1)
            found[list(one)] += weight * coefficients @ self.line[-1]
        return found

    def _explained(self, groups: Sequence[int], rate: float, bend: float) -> tuple[Array, Array, float]:
        """Coefficients of ln stiffness, group by group, if no others change, their covariance, and their evidence.

        ``rate`` and ``bend`` are standard deviations of a yearly change beforehand. The evidence is the logarithm of
        how many times likelier the modes' lines are than if no group changed.
        """
        size = self.line.shape[1]
        places = np.add.outer(size * np.array(groups), np.arange(size)).ravel()
        deviations = np.tile(np.maximum(np.r_[rate, np.full(size - 1, bend)], 1e-7), len(groups))
        covariance = np.linalg.inv(self._products[np.ix_(places, places)] + np.diag(deviations**-2))
        coefficients = covariance @ self._products[places, -1]
        squares = coefficients @ self._products[places, -1]
        evidence = (squares + np.linalg.slogdet(covariance)[1]) / 2 - np.log(deviations).sum()
        return coefficients, covariance, float(evidence)


@dataclass(frozen=True)
class DriftState(SavesFrames):
    """What a `DriftFollower` knows at the end of a day.

    Daily means of temperatures and ln f of the days that are learned and of those that wait, and the logarithm of each
    group's stiffness that is taken out.
    """

    learned: pd.DataFrame
    waiting: pd.DataFrame
    change: tuple[float, ...]


@dataclass(frozen=True)
class DriftFollower:
    """Takes slow drift out of measured frequencies, and leaves sudden changes in.

    Once a week, the regression of `track_parameters` learns a week more of daily means, a month behind. If the days
    that wait are then a step away from those that are learned, they are never learned: a sudden change does not count
    as drift, however long it lasts. A step that the mean of a month does not show is learned in time, and reported as
    the drift that it looks like. The correction is the drift since the middle of the baseline, by how probable it is.
    """

    temperatures: list[Any]
    modes: list[Any]
    groups: list[str]
    slopes: Array
    start_: DriftState
    n_days: int

    @classmethod
    def fitted(cls, fem: Any, T: pd.DataFrame, F: pd.DataFrame) -> DriftFollower:
        """Learn from the temperatures and frequencies of a baseline, for all groups of a fitted chain."""
        check_is_fitted(fem)
        inputs, modes = list(getattr(fem, "feature_names_in_", ["named temperatures"])), list(fem.mode_names_)
        missing = [one for one in inputs if one not in T] + [one for one in modes if one not in F]
        if missing:
            raise ValueError(
                f"the baseline lacks {missing}, to which the chain fem was fitted; expected "
                f"their names among the temperatures {list(T.columns)} and the frequencies {list(F.columns)}"
            )
        names, slopes = read_slopes(fem, None)
        learned = daily_means(T[inputs].join(np.log(F[modes])))
        state = DriftState(learned, learned.iloc[:0], (0.0,) * len(names))
        return cls(inputs, modes, names, slopes, state, len(learned))

    def advance(self, state: DriftState, T: pd.DataFrame, F: pd.DataFrame, n_weeks: int = 5) -> DriftState:
        """The state at the end of one complete day; as it is without records, or if that day is known already."""
        last = (state.waiting if len(state.waiting) else state.learned).index[-1]
        if not len(F) or midnight(F.index[-1]) <= last:
            return state
        means = T[self.temperatures].join(np.log(F[self.modes])).mean().to_frame(midnight(F.index[-1])).T
        waiting = pd.concat([state.waiting, means])
        if len(waiting) < 7 * n_weeks:
            return replace(state, waiting=waiting)
        if self._is_apart(state.learned, waiting):
            return replace(state, waiting=waiting.iloc[:0])
        learned = DriftState(pd.concat([state.learned, waiting[:7]]), waiting[7:], state.change)
        trends = self._trends(learned)
        return learned if trends is None else replace(learned, change=tuple(trends.expected().tolist()))

    def shifts(self, drifts: pd.DataFrame, names: Sequence[Any]) -> Array:
        """Shifts of ln f of some modes by the changes of stiffness that are taken out of records, "drift GROUP"."""
        groups = [name.removeprefix("drift ") for name in drifts]
        slopes = pd.DataFrame(self.slopes, self.modes, self.groups).reindex(names).fillna(0.0)[groups]
        return np.log1p(drifts.to_numpy()) @ slopes.to_numpy().T

    def taken_out(self, state: DriftState) -> pd.Series:
        """Relative change of each group's stiffness that is taken out of the frequencies."""
        change = pd.Series(state.change, pd.Index(self.groups, name="group"))
        return np.expm1(change.drop(ALL_GROUPS, errors="ignore") + change.get(ALL_GROUPS, 0.0))

    def report(self, state: DriftState) -> pd.DataFrame:
        """Drift of each group since the middle of the baseline, as `track_parameters` finds it.

        Of its stiffness: relative ``change`` and ``standard_error``, the same a year (``per_year``,
        ``per_year_error``), the ``p_value`` of the structure's drift, by which groups it is explained best
        (``significant``, none if that may be chance), and whether such a change is ``beyond_limit``.
        """
        trends, n = self._trends(state), len(self.groups)
        best, levels, p_value = (), np.array([[0.0, np.nan]] * n), 1.0
        if trends is not None:
            p_value, best = trends.p_value, trends.sets[0] if trends.p_value <= 0.01 else ()
            found = [trends.change(group, [one for one in best if one != group]) for group in range(n)]
            levels = np.array([(mean[-1], deviation[-1]) for mean, deviation in found])
        table = pd.DataFrame({"change": np.expm1(levels[:, 0])}, pd.Index(self.groups, name="group"))
        table["standard_error"] = np.exp(levels[:, 0]) * levels[:, 1]
        years = self._years(pd.concat([state.learned, state.waiting]).index)[-1]
        table[["per_year", "per_year_error"]] = table / years
        is_best = np.isin(np.arange(n), best)
        table = table.assign(
            p_value=p_value, significant=is_best, beyond_limit=is_best & (table["change"].abs() > 0.05)
        )
        return table[is_best | (table.index != ALL_GROUPS)]

    def _years(self, days: pd.DatetimeIndex) -> Array:
        """Time since the middle of the baseline."""
        return ((days - days[0]) / YEAR).to_numpy() - self.n_days / 2 * (DAY / YEAR)

    def _regression(self, daily: pd.DataFrame) -> tuple[Array, Array, Array]:
        """Columns of the weather, a line that bends as each year of service begins, and the modes."""
        daily = daily.reindex(midnights_between(*daily.index[[0, -1]]))
        years, service = self._years(daily.index), self.n_days / 2 * (DAY / YEAR)
        line = bending_line(years, np.arange(int(np.ceil(max(years[-1] - service, 0.0)))) + service)
        return weather_columns(daily[self.temperatures].to_numpy()), line, daily[self.modes].to_numpy()

    def _trends(self, state: DriftState) -> StiffnessTrends | None:
        """By the days that are learned, with the line up to the newest; None where no mode has enough days."""
        X, line, y = self._regression(pd.concat([state.learned, state.waiting[self.temperatures]]))
        enough = enough_days(X, line, y)
        return StiffnessTrends(X, line, y[:, enough], self.slopes[enough], self.groups) if enough.any() else None

    def _is_apart(self, learned: pd.DataFrame, waiting: pd.DataFrame, chance: float = 1e-3) -> bool:
        """Whether there is a step between the days that are learned and those that wait, beside a slow drift."""
        X, line, y = self._regression(pd.concat([learned, waiting]))
        step = (midnights_between(learned.index[0], waiting.index[-1]) > learned.index[-1]).astype(float)
        enough = enough_days(X, line, y) & ~np.isnan(y[step > 0]).all(axis=0)
        if not enough.any():
            return False
        deviations = np.r_[np.full(line.shape[1], 0.01), 0.3]
        found = DailyRegression.fitted(X, np.column_stack([line, step]), y[:, enough], deviations=deviations)
        return found.chance()[2] < chance


def enough_days(X: Array, line: Array, y: Array) -> Array:
    """Which modes were measured on three times as many days as the regression has columns."""
    n_known = (~np.isnan(y) & ~np.isnan(X).any(axis=1, keepdims=True)).sum(axis=0)
    return n_known >= 3 * (X.shape[1] + line.shape[1])


def track_parameters(
    fem: Any,
    T: pd.DataFrame,
    F: pd.DataFrame,
    groups: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
    freq: str = "1D",
    *,
    significance: float = 0.01,
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
        Step of the table: a day or some days, such as "7D".
    significance : float, default=0.01
        Probability with which a structure that does not age counts as drifting.

    Returns
    -------
    ParameterHistory
        Relative stiffness of each group by day with bands, rates a year, and when a limit is reached.

    Raises
    ------
    ValueError
        If fem is not a fitted chain or its model cannot be damaged, T and F are no frames with times, differ in rows or
        have other columns than in fit, a group is unknown, the step is not a day or some days, or no mode was
        measured on enough days.

    See Also
    --------
    Monitor : Follows drift day by day.
    skthermo.studies.identify_damage : Which damage explains a sudden shift.

    Notes
    -----
    Daily means of ln f are regressed on a cubic of the weather and on a line that may bend once a year. The covariance
    of its coefficients allows for residuals that last for days (Newey and West) or for months. By the derivatives of
    the FE model, the slopes of the line are changes of groups; the largest one in its standard errors says whether
    there is a drift. Changes of one or two groups explain it.

    Bands allow for an error of 3 % of the FE model's effects; if it is less accurate than that, they are too narrow.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.monitoring import track_parameters
    >>> from skthermo.surrogate import DataInformedFEM
    >>> years = make_truss_campaign(3, drift={"bottom": 0.02}, random_state=0)
    >>> T, F = years.temperatures, years.frequencies
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(T[:365], F[:365])
    >>> history = track_parameters(fem, T, F, freq="7D")
    >>> history.has_drift, history.rates["per_year"].idxmin()
    (True, 'bottom')
    """
    check_probability(significance, "significance")
    step, rest = divmod(check_duration(freq, "freq", may_be_zero=False), DAY)
    if rest:
        raise ValueError(f"freq is {freq!r}; expected a day or some days, such as '7D'")
    T, F = _checked(fem, T, F)
    names, slopes = read_slopes(fem, groups)
    daily = daily_means(T.join(np.log(F)))
    days, y, X = daily.index, daily[F.columns].to_numpy(), weather_columns(daily[T.columns].to_numpy())
    years = np.arange(len(days)) * (DAY / YEAR)
    line = bending_line(years, np.arange(1, int(years[-1])))
    enough = enough_days(X, line, y)
    if not enough.any():
        counts = ", ".join(f"{mode} {number}" for mode, number in daily[F.columns].count().items())
        least = 3 * (X.shape[1] + line.shape[1])
        raise ValueError(f"modes were measured, with temperatures, on too few days: {counts}; expected {least} or more")
    trends = StiffnessTrends(X, line, y[:, enough], slopes[enough], names)
    best = trends.sets[0] if trends.p_value <= significance else ()
    alternatives = trends.alternatives() if best else {}
    beside = [[one for one in best if one != k and names[k] not in alternatives[names[one]]] for k in range(len(names))]
    changes = [trends.change(group, others) for group, others in enumerate(beside)]
    mean, deviation = (pd.DataFrame(dict(zip(names, some, strict=True)), days) for some in zip(*changes, strict=True))
    shifts = mean.to_numpy()[:, list(best)] @ slopes[:, list(best)].T
    at_end = np.kron(np.eye(enough.sum()), line[-1:])
    errors = np.sqrt(np.diag(at_end @ trends.modes.covariance @ at_end.T))
    modes = pd.DataFrame(np.nan, pd.Index(F.columns, name="mode"), ["measured", "explained", "standard_error"])
    modes.loc[enough] = np.column_stack([at_end @ trends.modes.change.ravel(), shifts[-1, enough], errors])
    sides = dict(zip(["estimate", "ci_low", "ci_high"], stats.norm.ppf([0.5, 0.025, 0.975]), strict=True))
    table = np.exp(pd.concat({what: mean + side * deviation for what, side in sides.items()}, axis=1))
    explanations = pd.DataFrame({"groups": [tuple(names[group] for group in one) for one in trends.sets]})
    return ParameterHistory(
        table=table.swaplevel(axis=1)[[(name, what) for name in names for what in sides]][::step],
        rates=_rates(trends, alternatives, mean.iloc[-1], deviation.iloc[-1], years[-1], significance),
        p_value=trends.p_value,
        significance=significance,
        explanations=explanations.assign(probability=softmax(trends.evidence), log_evidence=trends.evidence),
        alternatives=alternatives,
        modes=modes,
        shifts=pd.DataFrame(shifts, days, F.columns),
    )


def _rates(
    trends: StiffnessTrends,
    alternatives: Mapping[str, list[str]],
    mean: pd.Series,
    deviation: pd.Series,
    years: float,
    significance: float,
) -> pd.DataFrame:
    """One row a group, as in `ParameterHistory`, by ln stiffness on the last day."""
    alone = trends.rate_errors
    table = pd.DataFrame({"change": np.expm1(mean), "change_error": np.exp(mean) * deviation}).rename_axis("group")
    table[["per_year", "standard_error"]] = table[["change", "change_error"]] / years
    table["p_value"] = 2 * stats.norm.sf(mean.abs() / deviation.clip(lower=1e-300))
    has_group = np.array([[group in one for one in trends.sets] for group in range(len(mean))])
    table["probability"] = has_group @ softmax(trends.evidence)
    table["drifts"] = np.where(2 * alone * years > 0.05, "unobservable", "no sign").astype(object)
    for others in alternatives.values():
        table.loc[others, "drifts"] = "yes" if len(others) == 1 else "perhaps"
    table["detectable_rates"] = (stats.norm.isf(significance / (2 * len(mean))) + 1.28) * alone
    return table


@dataclass(frozen=True, eq=False)
class ParameterHistory(Sentences):
    """Stiffness of groups over years, with bands.

    It is returned by `track_parameters`.

    Parameters
    ----------
    table : DataFrame
        Relative stiffness by day, 1 on the first: columns (group, "estimate" | "ci_low" | "ci_high"), at 95 %.
    rates : DataFrame
        One row a group: ``change`` over the records, relative, and ``change_error``; ``per_year`` and
        ``standard_error``; ``p_value`` of no change in this group; ``probability`` that it drifts if any group does;
        ``drifts``: "yes", "perhaps" (or another group in its place), "no sign", or "unobservable" (a loss of 5 % over
        the records would not be detected); ``detectable_rates``: change a year that is detected with probability 90 %.
    p_value : float
        Probability that records without any drift have such trends.
    significance : float
        Largest ``p_value`` that counts as a drift.
    explanations : DataFrame
        Sets of one or two groups that may drift, the best first: ``groups``; ``probability``, if any of the sets
        drifts; ``log_evidence`` against no drift.
    alternatives : mapping of str to list of str
        Groups that may drift in the place of each of the best explanation, itself among them; empty without drift.
    modes : DataFrame
        One row a mode: shift of ln f over the records, ``measured`` (apart from the weather) and ``explained`` by the
        drift, and ``standard_error`` of the measured one; NaN for a mode that was measured on too few days.
    shifts : DataFrame
        Shift of ln f of each mode by day that the drift causes; 0 without drift.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.monitoring import track_parameters
    >>> from skthermo.surrogate import DataInformedFEM
    >>> years = make_truss_campaign(3, drift={"bottom": 0.02}, random_state=0)
    >>> T, F = years.temperatures, years.frequencies
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(T[:365], F[:365])
    >>> history = track_parameters(fem, T, F, freq="7D")
    >>> history.has_drift, history.explanations["groups"].iloc[0]
    (True, ('bottom',))
    >>> history.table["bottom"].columns.tolist()
    ['estimate', 'ci_low', 'ci_high']
    """

    table: pd.DataFrame = field(repr=False)
    rates: pd.DataFrame = field(repr=False)
    p_value: float
    significance: float
    explanations: pd.DataFrame = field(repr=False)
    alternatives: Mapping[str, list[str]]
    modes: pd.DataFrame = field(repr=False)
    shifts: pd.DataFrame = field(repr=False)

    @property
    def has_drift(self) -> bool:
        """Whether there is a drift: chance alone would hardly give such trends."""
        return bool(self.p_value <= self.significance)

    @property
    def days(self) -> pd.DatetimeIndex:
        """Beginning of each day of the table."""
        return self.table.index

    @property
    def groups(self) -> list[str]:
        """Names of the groups."""
        return list(self.rates.index)

    @property
    def years(self) -> float:
        """Length of the records."""
        return (self.shifts.index[-1] - self.shifts.index[0]) / YEAR

    def reaches(self, limit: float = -0.1) -> pd.DataFrame:
        """When the stiffness of each group reaches a limit, if its mean rate over the records goes on.

        Parameters
        ----------
        limit : float, default=-0.1
            Relative change since the first day: -0.1 is a loss of 10 %.

        Returns
        -------
        DataFrame
            One row a group: ``date``, before which it is reached with probability one half; ``earliest`` and
            ``latest``, between which it is reached with 95 %; ``probability`` that it is reached within 10 years of the
            last day. NaT where that takes more than 100 years, and for groups that are unobservable.

        Raises
        ------
        ValueError
            If the limit is not between -1 and 1, or 0.
        """
        if not is_real(limit) or not -1 < limit < 1 or limit == 0:
            raise ValueError(f"limit is {limit!r}; expected a relative change, such as -0.1 for a loss of 10 %")
        change, errors = (self.rates[name].to_numpy() for name in ("change", "change_error"))
        hidden, first = (self.rates["drifts"] == "unobservable").to_numpy(), self.shifts.index[0]
        error = np.maximum(errors / (1 + change) / self.years, 1e-12)
        towards, needed = np.sign(limit) * np.log1p(change) / self.years, abs(np.log1p(limit))
        found = pd.DataFrame(index=self.rates.index)
        for name, share in {"date": 0.5, "earliest": 0.975, "latest": 0.025}.items():
            rate = stats.norm.ppf(share, towards, error)
            years = needed / np.where((rate > 0) & ~hidden, rate, np.nan)
            days = np.where(years - self.years <= 100, np.round(365.25 * years), np.nan)
            found[name] = first + pd.to_timedelta(days, unit="D")
        return found.assign(
            probability=np.where(hidden, np.nan, stats.norm.sf(needed / (self.years + 10), towards, error))
        )

    def remove_drift(self, F: pd.DataFrame) -> pd.DataFrame:
        """Frequencies as they would be without the drift since the first day; unchanged where there is none.

        Parameters
        ----------
        F : DataFrame of shape (n_samples, n_modes)
            Measured frequencies in Hz on a ``DatetimeIndex``. Records before the first day or after the last count as
            taken on these.

        Returns
        -------
        DataFrame of shape (n_samples, n_modes)
            In Hz. A chain that is fitted to them learns the weather's effect free of the drift.

        Raises
        ------
        ValueError
            If F is no frame with times, or has other modes; if values are no frequencies: the error lists them all.
        """
        if not has_stamps(F) or list(getattr(F, "columns", [])) != list(self.shifts.columns):
            raise ValueError(
                f"frequencies are a {type(F).__name__} with the columns {list(getattr(F, 'columns', []))}; expected a "
                f"DataFrame on a DatetimeIndex with {list(self.shifts.columns)}"
            )
        harmless = {"few-records", "useless-column"}
        found, doubts = set_aside(frequencies=F, exclude=harmless, needs_all=True, is_baseline=False)
        warn_each(doubts)
        days = self.shifts.index
        of_day = np.clip(days.searchsorted(F.index, side="right") - 1, 0, len(days) - 1)
        return frame_like(F, as_floats(found.frequencies) * np.exp(-self.shifts.to_numpy()[of_day]))

    def _answer(self) -> Iterator[str]:
        first, last = (f"{self.shifts.index[end]:%Y-%m-%d}" for end in (0, -1))
        found = "A significant" if self.has_drift else "No significant"
        yield f"{found} drift of stiffness from {first} to {last} (p value {probability_text(self.p_value)})."
        for group, others in self.alternatives.items():
            rate = self.rates.loc[group]
            verb = "loses" if rate["per_year"] < 0 else "gains"
            yearly = f"{share_text(abs(rate['per_year']))} (±{SPACE}{share_text(2 * rate['standard_error'])})"
            yield f"{group} {verb} {yearly} of its stiffness a year, {percent(rate['change'], '+.2g')} in all."
            others = [other for other in others if other != group]
            if others:
                yield f"A drift of {listed(others)} explains these frequencies equally well."

    def _limits(self) -> Iterator[str]:
        is_hidden = self.rates["drifts"] == "unobservable"
        hidden, seen = list(self.rates.index[is_hidden]), self.rates["detectable_rates"][~is_hidden]
        if not self.has_drift and len(seen):
            each = ", ".join(f"{group} {share_text(rate)}" for group, rate in seen.items())
            yield f"Smallest steady drift a year that is detected with probability 90{SPACE}%: {each}."
        if hidden:
            yield f"A loss of 5{SPACE}% of stiffness in {listed(hidden)} is unobservable in these modes."
        if self.years < 1.5:
            yield f"Records of {self.years:.1f} years hardly distinguish season and drift."
        missing = list(self.modes.index[self.modes["measured"].isna()])
        if missing:
            yield f"Measured on too few days to be used: {listed(missing)}."


def _checked(fem: Any, T: Any, F: Any) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Records in order of time without values that cannot be and columns that say nothing, the first of each time."""
    if isinstance(fem, type) or not hasattr(fem, "simulator_"):
        raise ValueError(f"fem is {fem!r:.200}; expected a fitted DataInformedFEM")
    for what, table in (("temperatures", T), ("frequencies", F)):
        if not has_stamps(table):
            raise ValueError(f"the {what} are a {type(table).__name__}; expected a DataFrame with a DatetimeIndex")
        refuse_no_table(table, what)
    if T.shape[1] != fem.n_features_in_ or list(F.columns) != fem.mode_names_:
        raise ValueError(
            f"T and F have the columns {list(T.columns)} and {list(F.columns)}; expected {fem.n_features_in_} and "
            f"{fem.mode_names_}, as in fit"
        )
    if not len(F):
        raise ValueError("F has 0 samples; expected at least one record")
    in_order = (table.sort_index(kind="stable") for table in (T, F))
    found, doubts = set_aside(*in_order, model=fem.model, exclude={"few-records"})
    warn_each(doubts)
    firsts = (table[~table.index.duplicated()] for table in (found.temperatures, found.frequencies))
    T, F = (
        table.drop(columns=list(found.left_out), errors="ignore").reindex(columns=table.columns) for table in firsts
    )
    return T.dropna(axis=1, how="all"), F
