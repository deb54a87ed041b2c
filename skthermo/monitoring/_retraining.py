"""A detector in service that learns anew: from more records, or after an intervention."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats
from sklearn.base import BaseEstimator, clone
from sklearn.utils import check_random_state

from skthermo._core.arrays import Array
from skthermo._core.frames import DAY, YEAR, check_duration, check_stamp, correlation_times, usual_step
from skthermo._core.text import capital, counted, listed, probability_text
from skthermo._core.warnings import collected
from skthermo.detection import CompensatedDetector, TemperatureCompensator
from skthermo.monitoring._drift import DailyWeather, ModeTrends, daily_means, regressed
from skthermo.monitoring._events import WATCH
from skthermo.monitoring._records import compensators_of


@dataclass(frozen=True)
class Retraining:
    """A detector that has learned anew, and whether it takes over.

    `Monitor.refit` and `Monitor.rebaseline` give it.

    Parameters
    ----------
    kind : {"refit", "new baseline"}
        Whether more records joined the baseline, or a new one began after an intervention.
    accepted : bool
        Whether the new detector is in charge. If not, nothing has changed.
    reasons : tuple of str
        What spoke against it; also where it was forced to take over.
    notes : tuple of str
        What the engineer should know besides.
    table : DataFrame
        By mode, what weather does not explain: ``change`` between the baseline and the new records (relative; of
        responses that are not positive, in their unit) and its ``standard_error``. For a refit also ``per_year`` and
        ``per_year_error``, of a steady change over all records; for a new baseline ``n_records`` since.
    excluded : DataFrame
        What did not train: ``start``, ``end`` (NaT: up to the last record), ``columns``, ``n_records`` and ``reason``.
    baseline : DataFrame or None
        What the new detector learned from; None where there was nothing to learn from.
    prior : DataFrame or None
        Records before an intervention, as measured, from which a part of the baseline comes.
    since : Timestamp or None
        When the intervention was complete.
    detector : estimator or None
        The new detector, fitted.

    See Also
    --------
    Monitor : A damage detector in service.

    Examples
    --------
    A year of records joins the baseline:

    >>> from sklearn.linear_model import LinearRegression
    >>> from sklearn.pipeline import make_pipeline
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector, TemperatureCompensator
    >>> from skthermo.monitoring import Monitor
    >>> healthy = make_truss_campaign(2, random_state=2)
    >>> records = healthy.temperatures.join(healthy.frequencies)
    >>> compensator = TemperatureCompensator(LinearRegression(), targets=list(healthy.frequencies))
    >>> monitor = Monitor(make_pipeline(compensator, MahalanobisDetector()), sensors=False).fit(records[:365])
    >>> answers = monitor.update(records[365:])
    >>> retraining = monitor.refit()
    >>> print(retraining.summary())
    Refit: accepted.
    >>> len(monitor.trained_)
    730
    """

    kind: str
    accepted: bool
    reasons: tuple[str, ...]
    notes: tuple[str, ...]
    table: pd.DataFrame
    excluded: pd.DataFrame
    baseline: pd.DataFrame | None = field(default=None, repr=False)
    prior: pd.DataFrame | None = field(default=None, repr=False)
    since: pd.Timestamp | None = None
    detector: BaseEstimator | None = field(default=None, repr=False)

    def summary(self) -> str:
        """What was learned from, what was left out, and why the new detector takes over or not.

        Returns
        -------
        str
            Several lines.
        """
        outcome = "accepted" if self.accepted else "refused; the old detector stays in use"
        lines = [f"{self.kind.capitalize()}: {outcome}."]
        lines += [f"{'Accepted despite' if self.accepted else 'Reason'}: {reason}." for reason in self.reasons]
        for row in self.excluded.itertuples():
            until = "the last record" if pd.isna(row.end) else f"{row.end:%Y-%m-%d %H:%M}"
            what = "records" if row.columns == "all" else f"values of {row.columns}"
            lines.append(
                f"Left out: {row.n_records:,} {what} from {row.start:%Y-%m-%d %H:%M} to {until}, {row.reason}."
            )
        lines += [f"{capital(note)}." for note in self.notes]
        return "\n".join(lines)


def retrained(monitor: Any, records: pd.DataFrame | None, *, until: Any = None, force: bool = False) -> Retraining:
    """A detector that has learned from the baseline and what came since, unless these differ from it."""
    since, prior, events, trained = monitor.since_, monitor.prior_, monitor.events_, monitor.trained_
    is_given = records is not None
    if not is_given:
        oldest = monitor.last_ - check_duration(monitor.retention, "retention")
        records = monitor.corrected_[monitor.corrected_.index >= oldest]
    records = records[list(trained.columns)].sort_index()
    records = records[~records.index.isin(trained.index) & (True if since is None else records.index >= since)]
    margin = max(7 * DAY, monitor.lookback_.duration(usual_step(trained.index)))
    new, excluded = may_train(_until(records, until), events, monitor.faults_, margin, is_in_place=not is_given)
    n_weeks = len(np.unique((new.index - new.index.min()) // (7 * DAY)))
    if n_weeks < 3:
        come = f"{counted(len(new), 'new record')} in {counted(n_weeks, 'week')} may train; expected 3 weeks or more"
        come = come if len(new) else "there are no records since the baseline that may train"
        return Retraining("refit", False, (come,), (), pd.DataFrame(), excluded)
    baseline = pd.concat([trained, new])
    if prior is not None:
        own = baseline[baseline.index >= since]
        moved = at_new_level(monitor, prior, own)[1]
        baseline, prior = pd.concat([moved, own]), prior if len(moved) else None
    is_harmless = np.zeros(len(baseline), dtype=bool)
    for event in events[events["harmless"]].itertuples():
        is_harmless |= (baseline.index >= event.start) & (pd.isna(event.end) | (baseline.index <= event.end))
    changes = level_changes(baseline[~is_harmless], list(monitor.targets_), new.index[0])
    reasons, notes = what_speaks(changes)
    step, steady, years = changes[0], changes[-1], (baseline.index[-1] - baseline.index[0]) / YEAR
    columns = {
        "change": step.change,
        "standard_error": step.standard_error,
        "per_year": steady.change / years,
        "per_year_error": steady.standard_error / years,
    }
    learned = {"baseline": baseline, "prior": prior, "since": since, "detector": _fitted(monitor, baseline)}
    accepted = force or not reasons
    return Retraining("refit", accepted, reasons, notes, pd.DataFrame(columns), excluded, **learned)


def begun_again(monitor: Any, since: Any, *, until: Any = None) -> Retraining:
    """A detector for the structure after an intervention: old records, moved to the new level, beside the new ones."""
    since = check_stamp(since, monitor.trained_.index, "since")
    trained, prior = monitor.trained_, monitor.prior_
    first = since if monitor.since_ is None else max(since, monitor.since_)
    if monitor.since_ is None or since > monitor.since_:  # what is now the baseline is that before the intervention
        prior = trained
    if prior is None:
        raise ValueError(f"the baseline since {monitor.since_} needs no older records any more; expected refit")
    prior = prior[prior.index < since]
    if not len(prior):
        raise ValueError(f"since is {since}, but the baseline begins at {trained.index[0]}; expected a later time")
    events, kept = monitor.events_, monitor.corrected_
    damage = events[events["acknowledged"] & ~events["harmless"] & (events["start"] >= since)]
    trained = trained[trained.index >= first]
    known = pd.concat([trained, kept[~kept.index.isin(trained.index)]]).sort_index()
    own, excluded = may_train(_until(known[known.index >= since], until), damage, monitor.faults_, is_in_place=True)
    missing = [str(name) for name in monitor.targets_ if own[name].notna().sum() < 2]
    if missing:
        few = f"fewer than two records of {listed(missing)} since {since}"
        return Retraining("new baseline", False, (few,), (), pd.DataFrame(), excluded)
    table, moved = at_new_level(monitor, prior, own)
    baseline = pd.concat([moved, own])
    note = (
        f"{counted((own.index[-1] - own.index[0]).days + 1, 'day')} and {counted(len(own), 'record')} since "
        f"{since:%Y-%m-%d %H:%M}; {counted(len(moved), 'older record')}, moved to the new level, stand for weather not "
        "met since"
    )
    learned = {"baseline": baseline, "prior": prior if len(moved) else None, "since": since}
    return Retraining(
        "new baseline", True, (), (note,), table, excluded, **learned, detector=_fitted(monitor, baseline)
    )


def may_train(
    records: pd.DataFrame,
    events: pd.DataFrame,
    faults: pd.DataFrame,
    margin: pd.Timedelta = 7 * DAY,
    *,
    is_in_place: bool = False,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Records outside events that nobody called harmless, without values of faulty sensors; the others, with reasons.

    A change may have begun within the ``margin`` before the first alarm of an event.
    Modes that were exchanged for a time stand in their place already with ``is_in_place``.
    """
    kept, masked, rows = np.ones(len(records), dtype=bool), records.copy(), []
    for event in events[~events["harmless"] & (events["kind"] != WATCH)].itertuples():
        start = event.start - margin
        inside = (records.index >= start) & (pd.isna(event.end) | (records.index <= event.end))
        kept &= ~inside
        reason = f"event {event.Index} ({event.kind}), {'' if event.acknowledged else 'not '}acknowledged"
        rows.append((start, event.end, "all", int(inside.sum()), reason))
    for fault in faults.itertuples():
        if (is_in_place and fault.kind == "swapped") or fault.column not in records:  # or the sensor is a reference
            continue
        inside = (records.index >= fault.since) & (pd.isna(fault.until) | (records.index < fault.until))
        masked.loc[inside, fault.column] = np.nan
        rows.append((fault.since, fault.until, fault.column, int((inside & kept).sum()), f"sensor: {fault.kind}"))
    empty = kept & masked.isna().all(axis=1).to_numpy()
    if empty.any():
        rows.append((masked.index[empty][0], masked.index[empty][-1], "all", int(empty.sum()), "without a value"))
    excluded = pd.DataFrame(rows, columns=["start", "end", "columns", "n_records", "reason"])
    return masked[kept & ~empty], excluded[excluded["n_records"] > 0].reset_index(drop=True)


@dataclass(frozen=True)
class LevelChange:
    """A change of the responses that follows a profile in time, from 0 to 1, and that weather does not explain.

    Changes are relative, or in the unit of a response that is not positive. ``size`` is their length in standard
    deviations of a day's noise, ``p_value`` the probability of one as large by chance, allowing for ``what`` else was
    tried, and ``is_clear`` says whether weather could hide it.
    """

    what: str
    change: pd.Series
    standard_error: pd.Series
    size: float
    p_value: float
    is_clear: bool

    def __str__(self) -> str:
        worst = (self.change / self.standard_error).abs().idxmax()
        return (
            f"{self.what}, beside the weather, {worst} changes by {self.change[worst]:+.2g} +- "
            f"{self.standard_error[worst]:.1g}, all modes together by {self.size:.2g} standard deviations of a day "
            f"(p value {probability_text(self.p_value)})"
        )


def level_changes(records: pd.DataFrame, targets: list[Any], since: pd.Timestamp) -> list[LevelChange]:
    """Steps each 30 days from the first new record on, and lines over the new and over all records, beside the weather.

    Daily means are regressed on the weather and on one profile at a time, as for drift, but slow means of the weather
    and noise that lasts for months would hide a step: a refit is refused rather than that; Hotelling's law, times the
    number of profiles, tells chance.
    """
    F = records[targets]
    is_positive = F.min() > 0
    scale = F.std().where(~is_positive, 0.01) * 100  # others vary by about 0.01 then, as logarithms do
    y = pd.DataFrame(
        {name: np.log(F[name]) if is_positive[name] else (F[name] - F[name].mean()) / scale[name] for name in F}
    )
    daily_T, daily_y = daily_means(records.drop(columns=targets), y)
    T, y, days = daily_T.to_numpy(), daily_y.to_numpy(), daily_y.index
    X = DailyWeather.fitted(T, half_lives=(5.0,)).of_days(T)[0] if T.shape[1] else np.ones((len(y), 1))
    first, places = days.searchsorted(since, side="right") - 1, np.arange(len(days))
    profiles = {
        f"from {days[start]:%Y-%m-%d} on": (places >= start).astype(float)
        for start in range(first, max(len(days) - 20, first + 1), 30)
    }
    for what, start in (("steadily over the new records", first), ("steadily over all records", 0)):
        profiles[what] = np.maximum((places - start) / max(len(days) - 1 - start, 1), 0.0)
    found, n = [], len(targets)
    for what, profile in profiles.items():
        equations, noise = regressed(np.column_stack([X, profile]), y, 1, lasts_for_months=False)
        freedom = noise.independent((~np.isnan(y)).sum(axis=0).max()) - X.shape[1]
        trend = ModeTrends.fitted(equations, noise, np.eye(n), 1, freedom)
        day = noise.covariance / (1 - noise.correlation**2)
        squares = [float(trend.mean @ np.linalg.solve(one, trend.mean)) for one in (trend.covariance, day)]
        own = max(freedom - n + 1, 1.0)
        p_value = stats.f.sf(squares[0] * own / (n * max(freedom, n)), n, own) * len(profiles)
        errors = np.sqrt(np.diag(trend.covariance))
        is_clear = bool(np.median(errors / np.sqrt(np.diag(day))) <= 0.5)
        named = (pd.Series(one, pd.Index(targets)) * scale for one in (trend.mean, errors))
        found.append(LevelChange(what, *named, squares[1] ** 0.5, min(float(p_value), 1.0), is_clear))
    return found


def what_speaks(
    changes: list[LevelChange], chance: float = 1e-3, matters: float = 0.2
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What speaks against learning: a change beyond chance that moves a detector's rates; and notes."""
    clearest, step, notes = min(changes, key=lambda one: one.p_value), changes[0], []
    reasons = (
        f"the new records are not those of the baseline's structure: {clearest}; a detector fitted to them would not "
        "detect that change",
    )
    if clearest.p_value >= chance or clearest.size <= matters:
        reasons = ()
        notes += [f"small but significant change: {clearest}"] if clearest.p_value < 0.01 else []
    if not step.is_clear:
        notes.append(
            "the new records have hardly any weather in common with the baseline: a change between the two of up "
            f"to {2 * step.standard_error.median():.2g} could not be distinguished from weather"
        )
    return reasons, tuple(notes)


def at_new_level(monitor: Any, prior: pd.DataFrame, own: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Change of each mode's level since an intervention, and older records moved to it.

    The change is the mean residual of the new records beside the old regression on the weather. Few days do not tell it
    well: each week of old records is moved by an error of its own as large, so that the scatter that a detector
    learns holds for records to come. Weeks of a season that the new records have are left out.
    """
    targets = list(monitor.targets_)
    old, new, is_relative = residuals_of(monitor.detector_, prior, own, targets)
    counts = new.notna().sum()
    n_independent = (counts / pd.Series(correlation_times(old.to_numpy()), old.columns)).clip(lower=1.0)
    week = np.asarray((prior.index - prior.index[0]) // (7 * DAY))
    errors = old.cov().fillna(0.0).to_numpy() / np.sqrt(np.outer(n_independent, n_independent))
    random = check_random_state(monitor.random_state)
    missed = random.multivariate_normal(np.zeros(len(targets)), errors, week.max() + 1)[week]
    values, change, moved = prior[targets].to_numpy(), new.mean().to_numpy(), prior.copy()
    moved[targets] = np.where(is_relative, values * np.exp(change - missed), values + change - missed)
    table = pd.DataFrame({"change": np.where(is_relative, np.expm1(change), change)}, old.columns)
    table = table.assign(standard_error=old.std() / np.sqrt(n_independent), n_records=counts)
    middle = pd.Series(prior.index).groupby(week).transform(lambda some: some.iloc[len(some) // 2]).dt.day_of_year
    distance = np.abs(middle.to_numpy()[:, np.newaxis] - np.unique(own.index.day_of_year))
    return table, moved[np.minimum(distance, YEAR / DAY - distance).min(axis=1) > 3.5]


def residuals_of(
    detector: BaseEstimator, baseline: pd.DataFrame, new: pd.DataFrame, targets: list[Any]
) -> tuple[pd.DataFrame, pd.DataFrame, Array]:
    """Residuals of a baseline, out of fold, and of new records, by the regression within a detector.

    Also which are relative, ln f - ln f expected. Without weather, they are departures from the mean.
    """
    if len(baseline.columns) == len(targets):
        level, is_relative = baseline[targets].mean(), baseline[targets].min() > 0
        old, own = (
            pd.DataFrame(
                {
                    name: np.log(one[name] / level[name]) if is_relative[name] else one[name] - level[name]
                    for name in one
                }
            )
            for one in (baseline[targets], new[targets])
        )
        return old, own, is_relative.to_numpy()
    plain = TemperatureCompensator(targets=targets)
    for part in compensators_of(detector):
        is_whole = isinstance(part, CompensatedDetector)
        plain = TemperatureCompensator(part.regressor, targets=part.targets, cv=part.cv) if is_whole else clone(part)
    with collected(drop_others=True):
        left = np.asarray(plain.fit_transform(baseline)), np.asarray(plain.transform(new))
    names = list(plain.get_feature_names_out())
    old, own = (
        pd.DataFrame(one, table.index, names)[targets] for one, table in zip(left, (baseline, new), strict=True)
    )
    return old, own, pd.Series(plain.relative_, names)[targets].to_numpy()


def _fitted(monitor: Any, baseline: pd.DataFrame) -> BaseEstimator:
    with collected(drop_others=True):
        return clone(monitor.detector_).fit(baseline[monitor.features_])


def _until(records: pd.DataFrame, until: Any) -> pd.DataFrame:
    return records if until is None else records[records.index <= check_stamp(until, records.index, "until")]
