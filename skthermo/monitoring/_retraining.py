"""A detector in service that learns anew: from more records, or after an intervention; compared with the old one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, clone
from sklearn.utils import check_random_state

from skthermo._core.arrays import Array
from skthermo._core.estimators import last_step
from skthermo._core.frames import DAY, YEAR, check_duration, check_stamp, correlation_time, usual_step
from skthermo._core.text import capital, counted
from skthermo._core.warnings import without_warnings
from skthermo.monitoring._events import WATCH
from skthermo.monitoring._records import Lookback
from skthermo.monitoring._shift import ShiftsTried, WeatherFree, block_mean
from skthermo.monitoring._threshold import WEEK, blocks_of, crossing, levels, lowered, whole_weeks
from skthermo.residuals.weather import BEYOND, TrainingRange

MARGIN = pd.Timedelta("7D")  # before the first alarm of an event, in which a change may have begun without an alarm
FEWEST_WEEKS = 3  # of new records, from which a comparison has standard errors

MOST_PROBED = 2000  # records whose frequencies are lowered, whole weeks of them
STEPS = (0.0, 2.0, 5.0)  # standard deviations by which they are lowered
CLEAR = 3.0  # standard errors from which a difference is one
WORSE = np.log(1.1)  # of the smallest detected change, from which it counts
FALSE, SMALLEST = "records in alarm", "smallest detected change"  # rows that decide


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
        For a refit, the old and the new detector on the records that the old one has not learned from, with columns
        ``old``, ``new``, ``difference``, ``standard_error`` (of the difference, from weeks) and ``worse``: records
        above the threshold (share), median index over threshold, smallest detected change (relative change of one mode
        by which half of the records come above the threshold; differences are of logarithms), records in unknown
        weather (share), and peaks of past events over the threshold. For a new baseline, by mode: ``change`` of the
        level (relative; of responses that are not positive, in their unit), its ``standard_error``, ``n_records``
        since, and the smallest detected change, ``old`` and ``new``.
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
    """A detector that has learned from the baseline and what came since, compared with the one in charge."""
    kept, margin = _until(_kept(monitor, records), until), margin_of(monitor.lookback_, monitor.trained_)
    harvest = Harvest.of(kept, monitor.events_, monitor.faults_, margin, are_put_back=records is None)
    refused = _too_few(harvest.records)
    if refused:
        return _none("refit", refused, harvest.excluded)
    old, targets = monitor, list(monitor.targets_)
    prior, since = monitor.prior_, monitor.since_
    baseline = pd.concat([old.trained_, harvest.records])
    if prior is not None:
        own = baseline[baseline.index >= since]
        _, moved = _at_new_level(monitor, prior, own)
        baseline, prior = pd.concat([moved, own]), prior if len(moved) else None
    new = _candidate(monitor, baseline)
    free = WeatherFree.of(monitor.detector_, baseline, targets)
    changes = _changes(free, baseline, monitor, harvest.records.index[0])
    spread = free.residuals.std() * free.scale
    table = comparison(old, new, harvest.records, targets, spread, _past_events(monitor))
    reasons = [
        *changes.objections(),
        *(f"the new detector is significantly worse in {name!r}" for name in worse_measures(table)),
    ]
    notes, shift = changes.notes(), changes.table((baseline.index[-1] - baseline.index[0]) / YEAR)
    accepted = force or not reasons
    learned = {"baseline": baseline, "prior": prior, "since": since, "detector": new.detector_, "shift": shift}
    return Retraining("refit", accepted, tuple(reasons), tuple(notes), table, harvest.excluded, **learned)


def begun_again(monitor: Any, since: Any, *, until: Any = None) -> Retraining:
    """A detector for the structure after an intervention: old records, moved to the new level, beside the new ones."""
    since = check_stamp(since, monitor.trained_.index, "since")
    old, targets, prior = monitor, list(monitor.targets_), monitor.prior_
    first = since if monitor.since_ is None else max(since, monitor.since_)
    if monitor.since_ is None or since > monitor.since_:  # what is now the baseline is that before the intervention
        prior = old.trained_
    if prior is None:
        raise ValueError(f"the baseline since {monitor.since_} needs no older records any more; expected refit")
    prior = prior[prior.index < since]
    if not len(prior):
        raise ValueError(f"since is {since}, but the baseline begins at {old.trained_.index[0]}; expected a later time")
    events = monitor.events_
    damage = events[events["acknowledged"] & ~events["harmless"] & (events["start"] >= since)]
    trained, kept = old.trained_[old.trained_.index >= first], monitor.corrected_
    known = pd.concat([trained, kept[~kept.index.isin(trained.index)]]).sort_index()
    harvest = Harvest.of(_until(known[known.index >= since], until), damage, monitor.faults_, are_put_back=True)
    own = harvest.records
    missing = [str(name) for name in targets if not len(own) or own[name].notna().sum() < 2]
    if missing:
        return _none("new baseline", f"fewer than two records of {', '.join(missing)} since {since}", harvest.excluded)
    level, moved = _at_new_level(monitor, prior, own)
    baseline = pd.concat([moved, own])
    new = _candidate(monitor, baseline)
    spread = level.old.residuals.std() * level.old.scale
    found = [smallest_changes(one, one.trained_, targets, spread)[:, -1] for one in (old, new)]
    table = level.table.assign(old=found[0], new=found[1])
    notes = [
        f"{counted(level.span.days, 'day')} and {counted(len(own), 'record')} since {since:%Y-%m-%d %H:%M}; "
        f"{counted(len(moved), 'older record')}, moved to the new level, stand for weather not met since"
    ]
    ratio = float(np.exp(np.nanmean(np.log(found[1] / found[0])))) if np.isfinite(found).any() else np.nan
    notes.append(f"the smallest detected change is {ratio:.2f} times that with the baseline before")
    learned = {"baseline": baseline, "prior": prior if len(moved) else None, "since": since, "detector": new.detector_}
    return Retraining("new baseline", True, (), tuple(notes), table, harvest.excluded, **learned)


def _kept(monitor: Any, records: pd.DataFrame | None) -> pd.DataFrame:
    """Given records, or those that the monitor keeps as its detector saw them, that are not in the baseline."""
    if records is None:
        records = monitor.corrected_[
            monitor.corrected_.index >= monitor.last_ - check_duration(monitor.retention, "retention")
        ]
    records = records[list(monitor.trained_.columns)].sort_index()
    known = records.index.isin(monitor.trained_.index)
    return records[~known if monitor.since_ is None else ~known & (records.index >= monitor.since_)]


def _until(records: pd.DataFrame, until: Any) -> pd.DataFrame:
    return records if until is None else records[records.index <= check_stamp(until, records.index, "until")]


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


def _candidate(monitor: Any, baseline: pd.DataFrame) -> Any:
    with without_warnings():
        return monitor._with(clone(monitor.detector_).fit(baseline[monitor.features_]), baseline)


def _changes(free: WeatherFree, baseline: pd.DataFrame, monitor: Any, since: pd.Timestamp) -> ShiftsTried:
    """What weather does not explain of the records, events left out that were acknowledged as harmless."""
    events, known = monitor.events_, np.zeros(len(baseline), dtype=bool)
    for event in events[events["harmless"]].itertuples():
        known |= (baseline.index >= event.start) & (pd.isna(event.end) | (baseline.index <= event.end))
    rest = replace(free, residuals=free.residuals[~known])
    return ShiftsTried.of(rest, baseline[~known].drop(columns=list(monitor.targets_)), since)


def _past_events(monitor: Any) -> dict[Any, pd.DataFrame]:
    records, events, found = monitor.corrected_, monitor.events_, {}
    margin = margin_of(monitor.lookback_, monitor.trained_)  # which windows reach back into
    for number, event in zip(events.index, events.itertuples(), strict=True):
        inside = records[(records.index >= event.start - margin) & (pd.isna(event.end) | (records.index <= event.end))]
        if not event.harmless and event.kind != WATCH and len(inside):
            found[number] = inside
    return found


@dataclass(frozen=True)
class Harvest:
    """Records that may train, and a table of what was left out and why.

    ``excluded`` has a row for each reason: ``start``, ``end`` (NaT: until the last record), ``columns`` (all, or the
    one whose values alone are left out), ``n_records`` and ``reason``.
    """

    records: pd.DataFrame
    excluded: pd.DataFrame

    @classmethod
    def of(
        cls,
        records: pd.DataFrame,
        events: pd.DataFrame,
        faults: pd.DataFrame | None,
        margin: pd.Timedelta = MARGIN,
        are_put_back: bool = False,
    ) -> Harvest:
        """Leave out events that were not acknowledged as harmless, and values of faulty sensors.

        Modes that were swapped for a time stand in their place already with ``are_put_back``.
        """
        kept, rows = np.ones(len(records), dtype=bool), []
        for start, end, reason in _spans(events, margin):
            inside = (records.index >= start) & (pd.isna(end) | (records.index <= end))
            kept &= ~inside
            rows.append((start, end, "all", int(inside.sum()), reason))
        masked = records.copy()
        for fault in (pd.DataFrame() if faults is None else faults).itertuples():
            is_kept = fault.kind == "disagree" or (are_put_back and fault.kind == "swapped")
            if is_kept or fault.column not in records:  # nothing is left out, or the sensor is a reference
                continue
            inside = (records.index >= fault.since) & (pd.isna(fault.until) | (records.index < fault.until))
            masked.loc[inside, fault.column] = np.nan
            rows.append((fault.since, fault.until, fault.column, int((inside & kept).sum()), f"sensor: {fault.kind}"))
        empty = kept & masked.isna().all(axis=1).to_numpy()
        if empty.any():
            rows.append((masked.index[empty][0], masked.index[empty][-1], "all", int(empty.sum()), "without a value"))
        excluded = pd.DataFrame(rows, columns=["start", "end", "columns", "n_records", "reason"])
        return cls(masked[kept & ~empty], excluded[excluded["n_records"] > 0].reset_index(drop=True))


def _spans(events: pd.DataFrame, margin: pd.Timedelta) -> Iterator[tuple[Any, Any, str]]:
    for number, event in zip(events.index, events.itertuples(), strict=True):
        if event.harmless or event.kind == WATCH:
            continue
        is_open = pd.isna(event.end)
        state = "acknowledged, but not as harmless" if event.acknowledged else "not acknowledged"
        still = ", and still open: nothing after its start may train" if is_open else ""
        yield event.start - margin, event.end, f"event {number} ({event.kind}), {state}{still}"


def margin_of(memory: Lookback, records: pd.DataFrame) -> pd.Timedelta:
    """How long before an event's first alarm records do not train: a week, or as long as the detector looks back."""
    return max(MARGIN, memory.duration(usual_step(records.index)))


@dataclass(frozen=True)
class NewLevel:
    """Relative change of each mode's level, and what days as many as the new ones tell of a level.

    ``table`` has a row for each mode: ``change`` (relative), ``standard_error``, ``n_records``. ``span`` is the time
    that the new records cover.
    """

    table: pd.DataFrame
    span: pd.Timedelta
    old: WeatherFree

    @classmethod
    def of(cls, old: WeatherFree, new: pd.DataFrame) -> NewLevel:
        """From new records, by what the old regression leaves of them."""
        left = old.of_new(new)
        span = new.index[-1] - new.index[0] + usual_step(new.index)
        counts = left.notna().sum()
        deviations = old.residuals.std()
        times = pd.Series([correlation_time(column) for column in old.residuals.to_numpy().T], left.columns)
        error = deviations * np.sqrt(np.minimum(times / counts.where(counts > 0), 1.0))
        table = pd.DataFrame({"change": left.mean(), "standard_error": error, "n_records": counts})
        return cls(table, span, old)

    def prior(self, records: pd.DataFrame, new: pd.DataFrame, random_state: int | None = None) -> pd.DataFrame:
        """Old records at the new level, without those of a time of the year that new records cover.

        The level is known only as well as a few days tell it. Each week of old records is therefore moved by what
        another stretch of the old baseline, as long as the new one, misses its level by: what a detector learns of the
        scatter then holds for records to come.
        """
        blocks = blocks_of(records.index)
        kept = _season_not_covered(records.index, new.index)[blocks]
        missed = self._missed(blocks.max() + 1, random_state)[blocks]
        change, is_relative = self.table["change"].to_numpy(), self.old.is_relative.to_numpy()
        moved, targets = records.copy(), list(self.table.index)
        values = records[targets].to_numpy()
        moved[targets] = np.where(is_relative, values * (1 + change) / (1 + missed), values + change - missed)
        return moved[kept]

    def _missed(self, n_blocks: int, random_state: int | None) -> Array:
        """Mean residuals of stretches of the old baseline by chance, (n_blocks, n_modes)."""
        values = self.old.residuals - self.old.residuals.mean()
        times = values.index
        latest = times[-1] - self.span
        if latest <= times[0]:
            return np.zeros((n_blocks, values.shape[1]))
        random = check_random_state(random_state)
        starts = times[0] + (latest - times[0]) * random.uniform(size=n_blocks)
        first, last = times.searchsorted(starts), times.searchsorted(starts + self.span)
        known = values.notna().to_numpy()
        sums, counts = (
            np.vstack([np.zeros(values.shape[1]), np.cumsum(part, axis=0)])
            for part in (np.nan_to_num(values.to_numpy()), known)
        )
        number = counts[last] - counts[first]
        return np.where(number > 0, (sums[last] - sums[first]) / np.maximum(number, 1), 0.0)


def _at_new_level(monitor: Any, prior: pd.DataFrame, own: pd.DataFrame) -> tuple[NewLevel, pd.DataFrame]:
    """The level of records since an intervention, and older ones moved to it."""
    level = NewLevel.of(WeatherFree.of(monitor.detector_, prior, list(monitor.targets_)), own)
    return level, level.prior(prior, own, monitor.random_state)


def _season_not_covered(old: pd.DatetimeIndex, new: pd.DatetimeIndex) -> Array:
    """Which weeks of old records have a time of the year that no new record has within half a week."""
    blocks = blocks_of(old)
    middle = pd.Series(old).groupby(blocks).agg(lambda some: some.iloc[len(some) // 2])
    covered = np.unique(new.day_of_year)
    distance = np.abs(middle.dt.day_of_year.to_numpy()[:, np.newaxis] - covered)
    return np.minimum(distance, YEAR / DAY - distance).min(axis=1) > WEEK.days / 2


def comparison(
    old: Any,
    new: Any,
    overlap: pd.DataFrame,
    targets: list[Any],
    spread: pd.Series,
    events: dict[Any, pd.DataFrame],
) -> pd.DataFrame:
    """The old detector and the one that may follow it, on the records that the old one has not learned from.

    False alarms, scatter, the smallest changes found, weather, and records of past events. A row for each measure:
    ``old``, ``new``, ``difference`` (of logarithms for the smallest changes), its ``standard_error`` from blocks of
    time, and ``worse``: whether the new one is significantly worse in it. ``spread`` holds standard deviations of the
    responses, weather taken out, in their units.
    """
    blocks = blocks_of(overlap.index)
    own = pd.Series(last_step(new.detector_).baseline_index_, new.trained_.index)
    rates = [_ratio(old, overlap), (own / new.threshold_).reindex(overlap.index).to_numpy()]
    persistence = old.persistence
    rows = {
        FALSE: _compared(*(_above(levels(one, persistence)) for one in rates), blocks),
        "median index over threshold": _medians(*rates),
        **dict(_rows_of_changes(*(smallest_changes(one, overlap, targets, spread) for one in (old, new)), targets)),
        "records in unknown weather": _unknown(old, new, overlap, targets),
        **dict(_found(old, new, events)),
    }
    table = pd.DataFrame(rows, index=["old", "new", "difference", "standard_error", "worse"]).T
    return table.astype(dict.fromkeys(table.columns[:4], float) | {"worse": bool})


def worse_measures(table: pd.DataFrame) -> list[str]:
    """Measures in which the new detector is significantly worse, and which count."""
    false = table.loc[FALSE]
    has_fewer_false = bool(false["difference"] < -CLEAR * false["standard_error"])
    # A threshold that gives no false alarms any more is worth a somewhat larger smallest change.
    return [name for name in table.index[table["worse"]] if not (name == SMALLEST and has_fewer_false)]


def _ratio(monitor: Any, records: pd.DataFrame) -> Array:
    return monitor._index(records) / monitor.threshold_


def _above(ratio: Array) -> Array:
    return np.where(np.isnan(ratio), np.nan, (ratio > 1).astype(float))


def _compared(old: Array, new: Array, blocks: Array) -> list[Any]:
    """Means of both, of their difference where both evaluate, and whether it is clearly positive."""
    difference, error = block_mean(new - old, blocks)
    return [np.nanmean(old), np.nanmean(new), difference, error, bool(difference > CLEAR * error)]


def _medians(old: Array, new: Array) -> list[Any]:
    medians = [float(np.nanmedian(one)) for one in (old, new)]
    return [*medians, medians[1] - medians[0], np.nan, False]


def smallest_changes(active: Any, records: pd.DataFrame, targets: list[Any], spread: pd.Series) -> Array:
    """By how much each mode has to be lowered, relatively, until half of the records are above the threshold.

    For each week and, last, for all records, (n_modes, n_weeks + 1); at most some number of whole weeks are taken.
    """
    records = whole_weeks(records, MOST_PROBED)
    blocks = blocks_of(records.index)
    found, start = np.full((len(targets), blocks.max() + 2), np.nan), _ratio(active, records)
    for mode, target in enumerate(targets):
        fallen = (lowered(records, {target: step * spread[target]}) for step in STEPS[1:])
        steps = np.array(STEPS) * (spread[target] / (records[target].mean() if records[target].min() > 0 else 1.0))
        ratios = [_ratio(active, one) for one in fallen]
        curve = np.array([start, *ratios])
        found[mode, -1] = _crossing(steps, curve)
        for block in range(blocks.max() + 1):
            found[mode, block] = _crossing(steps, curve[:, blocks == block])
    return found


def _rows_of_changes(old: Array, new: Array, targets: list[Any]) -> Iterator[tuple[str, list[Any]]]:
    """A row for their geometric mean over the modes, which decides, and one for each mode."""
    logs = np.log(np.array([old, new]))
    known = np.isfinite(logs).all(axis=0)
    together = np.where(known, logs, 0.0).sum(axis=1) / np.where(known.any(axis=0), known.sum(axis=0), np.nan)
    for name, values in [(SMALLEST, together), *zip(targets, logs.transpose(1, 0, 2), strict=True)]:
        change = values[1] - values[0]
        error = block_mean(change[:-1], np.arange(len(change) - 1))[1]
        row = [*np.exp(values[:, -1]), change[-1], error]
        if name == SMALLEST:
            yield name, [*row, bool(change[-1] - CLEAR * error > WORSE)]
        else:
            yield f"{SMALLEST}, {name}", [*row, False]


def _crossing(steps: Array, curve: Array) -> float:
    """The step at which the median of the records' ratios exceeds 1; NaN if it does so without any."""
    curve = curve[:, ~np.isnan(curve).any(axis=0)]
    return crossing(steps, np.median(curve, axis=1)) if curve.size else np.nan


def _unknown(old: Any, new: Any, overlap: pd.DataFrame, targets: list[Any]) -> list[Any]:
    """Shares of records outside the weather of each baseline."""
    weather = [name for name in overlap.columns if name not in targets]
    if not weather:
        return [0.0, 0.0, 0.0, np.nan, False]
    shares = []
    for active in (old, new):
        known = TrainingRange.spanned(active.trained_[weather], np.ones(len(active.trained_), dtype=bool))
        shares.append(float((np.nan_to_num(known.excess(overlap[weather])) > BEYOND).any(axis=1).mean()))
    return [*shares, shares[1] - shares[0], np.nan, shares[1] > shares[0]]


def _found(old: Any, new: Any, events: dict[Any, pd.DataFrame]) -> Iterator[tuple[str, list[Any]]]:
    """Peaks of past events over the threshold: what was found has to be found again."""
    for number, records in events.items():
        peaks = [float(np.nanmax(_ratio(active, records), initial=0.0)) for active in (old, new)]
        yield f"event {number}, peak over threshold", [*peaks, peaks[1] - peaks[0], np.nan, peaks[1] <= 1 < peaks[0]]
