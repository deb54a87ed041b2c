"""A detector in service that learns anew: from more records, or after an intervention."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, clone

from skthermo._estimators.warnings import without_warnings
from skthermo._tables.text import counted
from skthermo._tables.times import YEAR
from skthermo.monitoring._active import ActiveDetector
from skthermo.monitoring.retraining._blocks import blocks_of
from skthermo.monitoring.retraining._comparison import DetectorComparison, smallest_changes
from skthermo.monitoring.retraining._harvest import Harvest, margin_of
from skthermo.monitoring.retraining._new_level import NewLevel
from skthermo.monitoring.retraining._shift import ShiftsTried, WeatherFree

FEWEST_WEEKS = 3  # of new records, from which standard errors of a comparison can be told

Activated = Callable[[BaseEstimator, pd.DataFrame], ActiveDetector]
"""A detector that was fitted on some records, with the threshold that its monitor promises."""


@dataclass(frozen=True)
class Retraining:
    """A detector that has learned anew, and whether it takes over.

    `Monitor.refit` and `Monitor.begin_again` give it.

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
        For a refit, the old and the new detector on the records that the old one has not learned from, with columns
        ``old``, ``new``, ``difference``, ``standard_error`` (of the difference, from weeks) and ``worse``: records
        above the threshold (share), median index over threshold, smallest change found (relative change of one mode by
        which half of the records come above the threshold; differences are of logarithms), records in unknown
        weather (share), and peaks of past events over the threshold. For a new baseline, by mode: ``change`` of the
        level (relative), its ``standard_error``, ``n_records`` since, and the smallest change found, ``old`` and
        ``new``.
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
    shift : DataFrame or None
        For a refit, by mode: ``change`` of frequencies, relative, that weather does not explain between the baseline
        and the new records, its ``standard_error``, and the same ``per_year`` and ``per_year_error`` over all of them.

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
    >>> healthy = make_truss_campaign(2, random_state=0)
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
    shift: pd.DataFrame | None = field(default=None, repr=False)

    def summary(self) -> str:
        """What was learned from, what was left out, and why the new detector takes over or not.

        Returns
        -------
        str
            Plain English, several lines.
        """
        lines = [f"{self.kind.capitalize()}: {'accepted' if self.accepted else 'refused; the old detector judges on'}."]
        lines += [f"{'In spite of' if self.accepted else 'Because'}: {reason}." for reason in self.reasons]
        for row in self.excluded.itertuples():
            until = "the last record" if pd.isna(row.end) else f"{row.end:%Y-%m-%d %H:%M}"
            what = "records" if row.columns == "all" else f"values of {row.columns}"
            lines.append(
                f"Left out: {row.n_records:,} {what} from {row.start:%Y-%m-%d %H:%M} to {until}, {row.reason}."
            )
        lines += [f"{note[:1].upper()}{note[1:]}." for note in self.notes]
        return "\n".join(lines)


def retrained(
    monitor: Any, records: pd.DataFrame | None, activated: Activated, *, until: Any = None, force: bool = False
) -> Retraining:
    """A detector that has learned from the baseline and what came since, compared with the one in charge."""
    harvest = _harvest(monitor, records, until)
    refused = _too_few(harvest.records)
    if refused:
        return _none("refit", refused, harvest.excluded)
    old, targets = monitor.active_, list(monitor.targets_)
    prior, since = monitor.prior_, monitor.since_
    baseline = pd.concat([old.trained, harvest.records])
    if prior is not None:
        own = baseline[baseline.index >= since]
        level = NewLevel.of(WeatherFree.of(monitor.detector_, prior, targets), own)
        moved = level.prior(prior, own, monitor.random_state)
        baseline, prior = pd.concat([moved, own]), prior if len(moved) else None
    new = _candidate(monitor, baseline, activated)
    free = WeatherFree.of(monitor.detector_, baseline, targets)
    changes = _changes(free, baseline, monitor, harvest.records.index[0])
    spread = free.residuals.std() * baseline[targets].mean()
    found = DetectorComparison.of(old, new, harvest.records, targets, spread, _past_events(monitor))
    reasons, notes = [f"clearly worse: {name}" for name in found.worse()], []
    clearest = changes.clearest
    if clearest.matters:
        what = "the new records are not those of the baseline's structure"
        reasons.insert(0, f"{what}: {clearest.sentence()}; a detector that learned them would not see that change")
    elif clearest.is_real:
        notes.append(f"there is a small change: {clearest.sentence()}")
    if np.isnan(clearest.p_value):
        notes.append("there are too few weeks to tell whether the new records differ from the baseline, weather apart")
    elif changes.step.is_hidden:
        error = 100 * changes.step.standard_error.median()
        notes.append(
            "the new records have hardly any weather in common with the baseline: a change between the two of up to "
            f"{2 * error:.2g} % of a frequency could not be told from weather"
        )
    years = (baseline.index[-1] - baseline.index[0]) / YEAR
    shift = pd.DataFrame(
        {
            "change": changes.step.change,
            "standard_error": changes.step.standard_error,
            "per_year": changes.trend.change / years,
            "per_year_error": changes.trend.standard_error / years,
        }
    )
    accepted = force or not reasons
    learned = {"baseline": baseline, "prior": prior, "since": since, "detector": new.detector, "shift": shift}
    return Retraining("refit", accepted, tuple(reasons), tuple(notes), found.table, harvest.excluded, **learned)


def begun_again(monitor: Any, since: Any, activated: Activated, *, until: Any = None) -> Retraining:
    """A detector for the structure after an intervention: old records, moved to the new level, beside the new ones."""
    since = _stamp(since, monitor.trained_.index)
    old, targets, prior = monitor.active_, list(monitor.targets_), monitor.prior_
    first = since if monitor.since_ is None else max(since, monitor.since_)
    if monitor.since_ is None or since > monitor.since_:  # what is now the baseline is that before the intervention
        prior = old.trained
    if prior is None:
        raise ValueError(f"the baseline since {monitor.since_} needs no older records any more; expected refit")
    prior = prior[prior.index < since]
    if not len(prior):
        raise ValueError(f"since is {since}, but the baseline begins at {old.trained.index[0]}; expected a later time")
    events = monitor.events_
    damage = events[events["acknowledged"] & ~events["harmless"] & (events["start"] >= since)]
    trained, kept = old.trained[old.trained.index >= first], monitor.corrected_
    known = pd.concat([trained, kept[~kept.index.isin(trained.index)]]).sort_index()
    harvest = Harvest.of(_until(known[known.index >= since], until), damage, monitor.faults_, are_put_back=True)
    own = harvest.records
    missing = [str(name) for name in targets if not len(own) or own[name].notna().sum() < 2]
    if missing:
        return _none("new baseline", f"fewer than two records of {', '.join(missing)} since {since}", harvest.excluded)
    level = NewLevel.of(WeatherFree.of(monitor.detector_, prior, targets), own)
    moved = level.prior(prior, own, monitor.random_state)
    baseline = pd.concat([moved, own])
    new = _candidate(monitor, baseline, activated)
    spread = level.old.residuals.std() * prior[targets].mean()
    found = [smallest_changes(one, one.trained, targets, spread)[:, -1] for one in (old, new)]
    table = level.table.assign(old=found[0], new=found[1])
    notes = [
        f"{counted(level.span.days, 'day')} and {counted(len(own), 'record')} since {since:%Y-%m-%d %H:%M}; "
        f"{counted(len(moved), 'older record')}, moved to the new level, stand for weather not met since"
    ]
    ratio = float(np.exp(np.nanmean(np.log(found[1] / found[0])))) if np.isfinite(found).any() else np.nan
    notes.append(f"the smallest change found is {ratio:.2f} times that of the baseline before")
    learned = {"baseline": baseline, "prior": prior if len(moved) else None, "since": since, "detector": new.detector}
    return Retraining("new baseline", True, (), tuple(notes), table, harvest.excluded, **learned)


def _harvest(monitor: Any, records: pd.DataFrame | None, until: Any) -> Harvest:
    """Records since the baseline that may train."""
    kept = _until(_kept(monitor, records), until)
    margin = margin_of(monitor.memory_, monitor.trained_)
    return Harvest.of(kept, monitor.events_, monitor.faults_, margin, are_put_back=records is None)


def _kept(monitor: Any, records: pd.DataFrame | None) -> pd.DataFrame:
    """Given records, or those that the monitor keeps as its detector saw them, that are not in the baseline."""
    if records is None:
        records = monitor.corrected_
    records = records[list(monitor.trained_.columns)].sort_index()
    known = records.index.isin(monitor.trained_.index)
    return records[~known if monitor.since_ is None else ~known & (records.index >= monitor.since_)]


def _until(records: pd.DataFrame, until: Any) -> pd.DataFrame:
    return records if until is None else records[records.index <= _stamp(until, records.index)]


def _stamp(moment: Any, index: pd.DatetimeIndex) -> pd.Timestamp:
    """A moment in the time zone of the records."""
    stamp = pd.Timestamp(moment)
    return stamp.tz_localize(index.tz) if stamp.tz is None and index.tz is not None else stamp


def _too_few(records: pd.DataFrame) -> str:
    """Why records cannot be compared, else an empty string."""
    if not len(records):
        return "there are no records since the baseline that may train"
    n_weeks = blocks_of(records.index).max() + 1
    if n_weeks < FEWEST_WEEKS:
        come = f"{counted(len(records), 'new record')} in {counted(n_weeks, 'week')}"
        return f"{come}; expected {FEWEST_WEEKS} weeks or more"
    return ""


def _none(kind: str, reason: str, excluded: pd.DataFrame) -> Retraining:
    return Retraining(kind, False, (reason,), (), pd.DataFrame(), excluded)


def _candidate(monitor: Any, baseline: pd.DataFrame, activated: Activated) -> ActiveDetector:
    """A clone of the detector, fitted, with its monitor's threshold."""
    with without_warnings():
        return activated(clone(monitor.detector_).fit(baseline[list(monitor.detector_.feature_names_in_)]), baseline)


def _changes(free: WeatherFree, baseline: pd.DataFrame, monitor: Any, since: pd.Timestamp) -> ShiftsTried:
    """What weather does not explain of the records, events left out that were acknowledged as harmless."""
    events, known = monitor.events_, np.zeros(len(baseline), dtype=bool)
    for event in events[events["harmless"]].itertuples():
        known |= (baseline.index >= event.start) & (pd.isna(event.end) | (baseline.index <= event.end))
    rest = replace(free, residuals=free.residuals[~known])
    return ShiftsTried.of(rest, baseline[~known].drop(columns=list(monitor.targets_)), since)


def _past_events(monitor: Any) -> dict[Any, pd.DataFrame]:
    """Kept records of each event that was not acknowledged as harmless."""
    records, events, found = monitor.corrected_, monitor.events_, {}
    margin = margin_of(monitor.memory_, monitor.trained_)  # which windows reach back into
    for number, event in zip(events.index, events.itertuples(), strict=True):
        inside = records[(records.index >= event.start - margin) & (pd.isna(event.end) | (records.index <= event.end))]
        if not event.harmless and len(inside):
            found[number] = inside
    return found
