"""A detector in service that learns anew: from more records, or after an intervention."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, clone
from sklearn.dummy import DummyRegressor
from sklearn.utils import check_random_state

from skthermo._core.frames import (
    DAY,
    YEAR,
    check_duration,
    check_stamp,
    correlation_times,
    midnights_between,
    usual_step,
)
from skthermo._core.text import capital, counted, listed, probability_text
from skthermo._core.warnings import collected
from skthermo.detection import TemperatureCompensator
from skthermo.monitoring._drift import DailyRegression, daily_means, weather_columns
from skthermo.monitoring._evaluation import DetectorParts
from skthermo.monitoring._events import DRIFT, WATCH


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
        why, out = "Accepted despite" if self.accepted else "Reason", self.excluded
        until = out["end"].map(lambda end: "the last record" if pd.isna(end) else f"{end:%Y-%m-%d %H:%M}")
        lines = [f"{self.kind.capitalize()}: {outcome}.", *(f"{why}: {reason}." for reason in self.reasons)]
        for row, end in zip(out.itertuples(), until, strict=True):
            what = "records" if row.columns == "all" else f"values of {row.columns}"
            lines.append(f"Left out: {row.n_records:,} {what} from {row.start:%Y-%m-%d %H:%M} to {end}, {row.reason}.")
        return "\n".join([*lines, *(f"{capital(note)}." for note in self.notes)])


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
    reasons, notes, table = level_changes(baseline[~is_harmless], list(monitor.targets_), new.index[0])
    detector = _fitted(monitor, baseline)
    accepted = force or not reasons
    return Retraining("refit", accepted, reasons, notes, table, excluded, baseline, prior, since, detector)


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
    events, trained, kept = monitor.events_, trained[trained.index >= first], monitor.corrected_
    damage = events[events["acknowledged"] & ~events["harmless"] & (events["start"] >= since)]
    known = pd.concat([trained, kept[~kept.index.isin(trained.index)]]).sort_index()
    own, excluded = may_train(_until(known[known.index >= since], until), damage, monitor.faults_, is_in_place=True)
    missing = [str(name) for name in monitor.targets_ if own[name].notna().sum() < 2]
    if missing:
        few = f"fewer than two records of {listed(missing)} since {since}"
        return Retraining("new baseline", False, (few,), (), pd.DataFrame(), excluded)
    table, moved = at_new_level(monitor, prior, own)
    baseline, left = pd.concat([moved, own]), prior if len(moved) else None
    note = (
        f"{counted(len(midnights_between(*own.index[[0, -1]])), 'day')} and {counted(len(own), 'record')} since "
        f"{since:%Y-%m-%d %H:%M}; {counted(len(moved), 'older record')}, moved to the new level, stand for weather not "
        "met since"
    )
    detector = _fitted(monitor, baseline)
    return Retraining("new baseline", True, (), (note,), table, excluded, baseline, left, since, detector)


def may_train(
    records: pd.DataFrame,
    events: pd.DataFrame,
    faults: pd.DataFrame,
    margin: pd.Timedelta = 7 * DAY,
    *,
    is_in_place: bool = False,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Records outside events that nobody called harmless, without values of faulty sensors; the others, with reasons.

    A change may have begun within the ``margin`` before the first alarm of an event, or in the 30 days whose mean has
    moved.
    Columns that were exchanged for a time stand in their place already with ``is_in_place``.
    """
    said = {True: "acknowledged", False: "not acknowledged"}
    spans = [
        (
            one.start - margin - (30 if one.kind == DRIFT else 0) * DAY,
            one.end,
            "all",
            f"event {one.Index} ({one.kind}), " + said[one.acknowledged],
        )
        for one in events[~events["harmless"] & (events["kind"] != WATCH)].itertuples()
    ]
    spans += [
        (one.since, one.until, one.column, f"sensor: {one.kind}")
        for one in faults.itertuples()
        if one.column in records and not (is_in_place and one.kind == "swapped")
    ]
    masked, rows = records.copy(), []
    for start, end, column, reason in spans:
        inside = (records.index >= start) & (pd.isna(end) | (records.index <= end))
        columns = list(records) if column == "all" else [column]
        n_records = int(masked.loc[inside, columns].notna().any(axis=1).sum())
        masked.loc[inside, columns] = np.nan
        rows += [(start, end, column, n_records, reason)] if n_records else []
    excluded = pd.DataFrame(rows, columns=["start", "end", "columns", "n_records", "reason"])
    return masked.dropna(how="all"), excluded


def level_changes(
    records: pd.DataFrame, targets: list[Any], since: pd.Timestamp, chance: float = 1e-3, matters: float = 0.2
) -> tuple[tuple[str, ...], tuple[str, ...], pd.DataFrame]:
    """What speaks against learning from records since a time, notes, and the change of each mode.

    Daily means are regressed on the weather and on a step each 30 days from that time on, or a line over the new or
    over all records. What speaks against it is a change beyond chance, in view of their number, that moves a detector's
    rates. Slow means of the weather and noise that lasts for months could hide a step; a refit is refused rather than
    that, and they are left out.
    """
    F = records[targets]
    is_positive = F.min() > 0
    scale = (100 * F.std()).where(~is_positive, 1.0)  # others vary by about 0.01 then, as logarithms do
    y = F / scale
    y.loc[:, is_positive] = np.log(F.loc[:, is_positive])
    daily = daily_means(records.drop(columns=targets)).join(daily_means(y))
    days, X = daily.index, weather_columns(daily.drop(columns=targets).to_numpy(), half_lives=(5.0,))
    first, places = days.searchsorted(since, side="right") - 1, np.arange(len(days))
    profiles = {
        f"from {days[start]:%Y-%m-%d} on": (places >= start).astype(float)
        for start in range(first, max(len(days) - 20, first + 1), 30)
    }
    for what, start in (("steadily over the new records", first), ("steadily over all records", 0)):
        profiles[what] = np.maximum((places - start) / max(len(days) - 1 - start, 1), 0.0)
    found = []
    for what, profile in profiles.items():
        fit = DailyRegression.fitted(X, profile[:, np.newaxis], daily[targets].to_numpy(), n_waves=0)
        change, covariance, p_value = fit.chance()
        day = pd.DataFrame(fit.rest).cov().fillna(0.0).to_numpy() + 1e-16 * np.eye(len(targets))
        size = float(change @ np.linalg.solve(day, change)) ** 0.5  # in standard deviations of a day
        table = pd.DataFrame({"change": change, "standard_error": np.sqrt(np.diag(covariance))}, targets)
        is_clear = bool((table["standard_error"] / np.sqrt(np.diag(day))).median() <= 0.5)
        found.append((min(p_value * len(profiles), 1.0), what, size, is_clear, table.mul(scale, axis=0)))
    step, steady, years = found[0], found[-1], (records.index[-1] - records.index[0]) / YEAR
    yearly = (steady[-1] / years).set_axis(["per_year", "per_year_error"], axis=1)
    p_value, what, size, _, table = min(found, key=lambda one: one[0])
    reasons, notes = (), ()
    if p_value < chance and size > matters:
        worst = table.loc[(table["change"] / table["standard_error"]).abs().idxmax()]
        reasons = (
            f"the new records do not show the baseline's structure: {what}, beside the weather, {worst.name} "
            f"changes by {worst['change']:+.2g} +- {worst['standard_error']:.1g}, all modes together by {size:.2g} "
            f"standard deviations of a day (p value {probability_text(p_value)}); a detector fitted to them would not "
            "detect that change",
        )
    if not step[3]:
        hidden = 2 * step[-1]["standard_error"].median()
        notes = (
            "the new records have hardly any weather in common with the baseline: a change between the two of up to "
            f"{hidden:.2g} could not be distinguished from weather",
        )
    return reasons, notes, step[-1].join(yearly)


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
) -> tuple[pd.DataFrame, pd.DataFrame, Any]:
    """Residuals of a baseline, out of fold, and of new records, by the regression within a detector.

    Also which are relative, ln f - ln f expected. Without weather, they are departures from the mean.
    """
    own = DetectorParts(detector, targets, baseline).compensator
    plain = TemperatureCompensator(targets=targets) if own is None else clone(own)
    if len(baseline.columns) == len(targets):
        plain = TemperatureCompensator(DummyRegressor(), targets=targets)
        baseline, new = (table.assign(nothing=0.0) for table in (baseline, new))
    with collected(drop_others=True):
        left = np.asarray(plain.fit_transform(baseline)), np.asarray(plain.transform(new))
    names = list(plain.get_feature_names_out())
    old, rest = (
        pd.DataFrame(one, table.index, names)[targets] for one, table in zip(left, (baseline, new), strict=True)
    )
    return old, rest, pd.Series(plain.relative_, names)[targets].to_numpy()


def _fitted(monitor: Any, baseline: pd.DataFrame) -> BaseEstimator:
    with collected(drop_others=True):
        return clone(monitor.detector_).fit(baseline[monitor.features_])


def _until(records: pd.DataFrame, until: Any) -> pd.DataFrame:
    return records if until is None else records[records.index <= check_stamp(until, records.index, "until")]
