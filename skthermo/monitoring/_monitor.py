"""A damage detector in service."""

from __future__ import annotations

import os
from collections.abc import Hashable, Sequence
from datetime import timedelta
from numbers import Integral, Real
from typing import Any, Literal

import numpy as np
import pandas as pd
from sklearn.base import clone

from skthermo._estimators.arguments import check_flag
from skthermo._estimators.warnings import warn_user
from skthermo._tables.frames import positions_of
from skthermo._tables.saved_frames import SavesFrames
from skthermo._tables.times import DAY, YEAR
from skthermo._validation import (
    Estimator,
    HasMethods,
    Interval,
    StrOptions,
    _fit_context,
    check_is_fitted,
    seed_parts,
    seeded,
)
from skthermo.detection import TemperatureCompensator
from skthermo.exceptions import RecordsWarning, UnevaluatedRowsWarning
from skthermo.monitoring._active import ActiveDetector
from skthermo.monitoring._corrections import Corrections
from skthermo.monitoring._course import Course, no_evaluations
from skthermo.monitoring._events import Acknowledgement, event_table
from skthermo.monitoring._false_alarms import FalseAlarmEstimate
from skthermo.monitoring._files import versions, write_monitor
from skthermo.monitoring._in_words import in_words
from skthermo.monitoring._memory import Memory
from skthermo.monitoring._records import Intake, RecordStore, read_records
from skthermo.monitoring.retraining import Retraining, begun_again, retrained
from skthermo.preprocessing.checks import Plausible

COUNTS = ("n_records", "n_repeated", "n_late", "n_too_late", "n_not_evaluated", "n_implausible")
MOST_CAUSES = 3  # in a warning


class Monitor(SavesFrames, Estimator):
    """A damage detector in service: it evaluates records as they come, day by day, for years.

    Parameters
    ----------
    detector : detector or Pipeline
        Any detector of ``skthermo.detection``, or a pipeline that ends with one, such as
        ``make_pipeline(TemperatureCompensator(...), WindowedAlarm("24h"))``. One without a compensator sees the
        frequencies only.
    targets : sequence of str, optional
        Names of the frequency columns. By default those of the compensator, else those that ``fem`` was fitted on.
    fem : DataInformedFEM, optional
        A fitted chain. With it, slow drift is followed in its parameters; without it, none is.
    false_alarms_per_year : float, default=1.0
        Damage events that a healthy structure has in a year, on average.
    persistence : int, default=3
        Number of evaluated records in a row above the threshold by which an event opens: single outliers raise no
        alarm, and damage is found by so many records later. 1 means that a single record does.
    direction : {"both", "softening"}, default="both"
        Which changes are damage. With "softening", stiffening is an event of its own kind, and no alarm.
    max_delay : str or timedelta, default="7D"
        How late records may come and still be evaluated as if they had come in time.
    retention : str or timedelta, default="400D"
        How long raw records are kept, for a new fit and to tell repeated records.
    sensors : bool, default=True
        Whether sensors are watched, and those that fail left out.
    lookback : str or timedelta, optional
        How long before a record the detector looks. By default the lags and windows of its parts tell.
    random_state : int, RandomState or None, default=None
        Seeds parts of the detector that are not seeded.

    Attributes
    ----------
    detector_ : detector or Pipeline
        Fitted clone.
    targets_ : list of str
        Names of the frequency columns.
    false_alarm_estimate_ : object
        How the threshold was set, and how many false events to expect: ``expected``, ``lowest`` and ``highest`` in a
        year.
    promises_ : tuple of (Timestamp, object)
        The promises of all detectors that were in charge, and since when.
    threshold_ : float
        A damage event opens with an index above it, of ``persistence`` evaluated records in a row.
    clear_threshold_ : float
        An event closes when, for a day, no ``persistence`` records in a row have been above it.
    lookback_ : object
        Which earlier records the evaluation of a record needs.
    events_ : DataFrame
        A row for each event, counted from 1: ``kind`` ("damage" or "stiffening"), ``start``, ``end`` (first record
        after it, NaT while it is open), ``peak`` (highest index that ``persistence`` records in a
        row reached), ``peak_time``, ``modes``, ``n_alarms`` (records
        evaluated while it was open), ``acknowledged``, ``harmless`` and ``note``.
    days_ : DataFrame
        A row for each day with records: ``n_records``, ``n_evaluated``, ``n_alarms``, ``index_median``, ``index_max``
        and, where drift is followed, a column ``drift GROUP`` for each group.
    evaluations_ : DataFrame
        The latest evaluation of each record that is kept, as `update` gives it.
    faults_ : DataFrame
        Sensors that have failed: ``column``, ``kind``, ``since``, ``detected``, ``until``, ``detail``.
    drift_ : DataFrame or None
        Change of each group's stiffness that was followed: ``change``, ``standard_error``, ``per_year``,
        ``per_year_error``, ``significant``; None without ``fem``.
    counts_ : dict
        ``n_records`` that came, without repeated ones; of these ``n_not_evaluated``, ``n_late`` (evaluated
        all the same) and ``n_too_late`` (not evaluated); ``n_repeated``, and
        ``n_implausible``: values that were taken as missing.
    baseline_, records_, corrected_ : DataFrame
        Records of the baseline and those kept since, both raw, and the latter as the detector sees them.
    last_ : Timestamp
        Stamp of the newest record.
    trained_ : DataFrame
        What the detector in charge was fitted on: the baseline, or what `refit` or `rebaseline` made of it.
    prior_, since_ : DataFrame and Timestamp, or None
        After `rebaseline`: records from before the intervention, and when it was complete.
    versions_ : dict
        Versions of skthermo and scikit-learn by which it was fitted.

    See Also
    --------
    skthermo.detection.WindowedAlarm : Alarms by several records in a row.

    Notes
    -----
    Any division of records into batches gives the same evaluations, events and daily summaries, bit for bit, as one
    batch of all of them. Lags and windows reach into earlier batches, and into the end of the baseline. Records that
    come late are evaluated with those around them, and later ones anew: what `update` says last of a stamp counts.

    The damage index is rounded to six decimals. Where the last bits, which depend on how many records are evaluated at
    once, would decide how, the index of the record alone with its memory counts.

    A value that no sensor measures is taken as missing: a number that loggers write for a missing one (-999), a
    frequency of zero or below, a temperature more than 100 degrees beyond the baseline's that is above 100 or below -80
    degrees Celsius, as in kelvin.

    Examples
    --------
    >>> from sklearn.linear_model import LinearRegression
    >>> from sklearn.pipeline import make_pipeline
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector, TemperatureCompensator
    >>> from skthermo.monitoring import Monitor
    >>> healthy = make_truss_campaign(3, random_state=0)
    >>> records = healthy.temperatures.join(healthy.frequencies)
    >>> compensator = TemperatureCompensator(LinearRegression(), targets=list(healthy.frequencies))
    >>> monitor = Monitor(make_pipeline(compensator, MahalanobisDetector())).fit(records[:730])
    >>> answers = monitor.update(records[730:737])
    >>> monitor.state()
    'healthy'
    """

    _parameter_constraints: dict = {
        "detector": [HasMethods(["fit", "score_samples"])],
        "targets": ["array-like", None],
        "fem": [HasMethods(["fit", "predict"]), None],
        "false_alarms_per_year": [Interval(Real, 0, None, closed="neither")],
        "persistence": [Interval(Integral, 1, None, closed="left")],
        "direction": [StrOptions({"both", "softening"})],
        "max_delay": [str, timedelta, np.timedelta64],
        "retention": [str, timedelta, np.timedelta64],
        "sensors": ["boolean"],
        "lookback": [str, timedelta, np.timedelta64, None],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        detector: Any,
        *,
        targets: Sequence[Hashable] | None = None,
        fem: Any = None,
        false_alarms_per_year: float = 1.0,
        persistence: int = 3,
        direction: Literal["both", "softening"] = "both",
        max_delay: str | timedelta = "7D",
        retention: str | timedelta = "400D",
        sensors: bool = True,
        lookback: str | timedelta | None = None,
        random_state: int | np.random.RandomState | None = None,
    ):
        self.detector = detector
        self.targets = targets
        self.fem = fem
        self.false_alarms_per_year = false_alarms_per_year
        self.persistence = persistence
        self.direction = direction
        self.max_delay = max_delay
        self.retention = retention
        self.sensors = sensors
        self.lookback = lookback
        self.random_state = random_state

    def __sklearn_clone__(self) -> Monitor:
        return type(self)(**self.get_params(deep=False) | {"detector": clone(self.detector)})  # the chain is shared

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: pd.DataFrame, y: None = None) -> Monitor:
        """Fit the detector to a baseline, and set the threshold of events.

        Parameters
        ----------
        X : DataFrame of shape (n_samples, n_features)
            Temperatures in degrees Celsius and frequencies in Hz of the healthy structure, side by side, on a
            ``DatetimeIndex``.
        y : None
            Ignored.

        Returns
        -------
        Monitor
            The monitor, ready for the records that come after the baseline.

        Raises
        ------
        ValueError
            If the records are no frame on a ``DatetimeIndex`` with each stamp once; if the frequency columns are not
            known; if the detector looks at later records, or farther back than its parts tell.

        Warns
        -----
        UserWarning
            As the detector does; if values are no measurements and are taken as missing.
        """
        max_delay, retention = (_duration(getattr(self, name), name) for name in ("max_delay", "retention"))
        if retention < max_delay + 2 * DAY:
            raise ValueError(
                f"retention is {self.retention!r} and max_delay {self.max_delay!r}; expected records to be kept for at "
                "least two days longer than they may be late"
            )
        baseline = read_records(X)
        if not len(baseline):
            raise ValueError(
                "the baseline has no records; expected those of the healthy structure, of a year if possible"
            )
        if baseline.index.has_duplicates:
            again = baseline.index[baseline.index.duplicated()]
            raise ValueError(
                f"{len(again)} stamps of the baseline are there twice, the first {again[0]}; expected once"
            )
        detector = clone(self.detector)
        seed_parts(detector, seeded(self.random_state))
        parts = [detector, *detector.get_params(deep=True).values()]
        compensators = [part for part in parts if isinstance(part, TemperatureCompensator)]
        self.targets_ = self._frequency_columns(baseline, compensators)
        columns = list(baseline.columns) if compensators else self.targets_
        anything = Plausible.of_anything(baseline.shape[1])
        n_markers, cleaned = int(anything.implausible(baseline.to_numpy()).sum()), anything.cleaned(baseline)[0]
        if n_markers:
            warn_user(
                f"{n_markers} of {cleaned.size} values of the baseline stand for missing ones, such as -999, and "
                "are taken as missing; expected NaN there",
                RecordsWarning,
                "markers",
            )
        corrections = Corrections.of(cleaned, self.targets_, fem=self.fem, sensors=self.sensors)
        active = self._activated(detector.fit(cleaned[columns]), cleaned, columns, corrections)
        active.check_memory()
        self._store = RecordStore(baseline, baseline.iloc[:0], max_delay, retention)
        self._active, self._course = active, Course.of(active, baseline)
        self.promises_ = ((self.last_, self.false_alarm_estimate_),)
        self.counts_ = dict.fromkeys(COUNTS, 0)
        self._acknowledgements: tuple[Acknowledgement, ...] = ()
        self.prior_, self.since_ = None, None
        self.versions_ = versions()
        return self

    def update(self, new: pd.DataFrame) -> pd.DataFrame:
        """Evaluate records that came since.

        Parameters
        ----------
        new : DataFrame of shape (n_samples, n_features)
            Raw records in the columns of `fit`, in any order: an hour, a day or a month, with gaps, late or repeated.

        Returns
        -------
        DataFrame
            On the stamps of new records, and of known ones that are evaluated anew because others came late: ``state``
            ("healthy", "alarm" or "not evaluated"), ``index`` (damage index), ``threshold``, ``modes`` (names of the
            modes that drive an alarm, the worst first), ``reason`` (why a record is not evaluated, or what else is
            worth saying), ``event`` (its number in ``events_``, 0 for none), ``revised`` (whether it was evaluated
            before).

        Raises
        ------
        ValueError
            If the records are no frame on a ``DatetimeIndex`` with the columns and the time zone of the baseline; if
            values are infinite; if a known stamp comes with other values. The monitor then stays as it was.

        Warns
        -----
        UserWarning
            If new records are not evaluated: how many, and why.
        """
        check_is_fitted(self)
        intake = self._store.sort_in(read_records(new, self.baseline_.columns, self.baseline_.index.tz))
        store, course = self._store.with_records(intake.fresh), self._course
        answers = no_evaluations(self.baseline_.index[:0]).assign(revised=False)
        if len(intake.fresh):
            course, answers = course.advanced(self._active, intake.fresh, store)
        if len(intake.too_late):
            refused = no_evaluations(intake.too_late.index, self.threshold_, self._why_too_late(intake.too_late))
            answers = pd.concat([answers, refused.assign(revised=False)]).sort_index()
        counts = self._counted(intake, course)
        _warn_of_not_evaluated(answers)
        self._store, self._course, self.counts_ = store.trimmed(), course, counts
        return answers

    def state(self) -> Literal["healthy", "alarm", "not evaluated"]:
        """How the structure is, by the newest record.

        Returns
        -------
        str
            "alarm" while a damage event is open, else "healthy" or "not evaluated", as the newest record was.
        """
        check_is_fitted(self)
        if self._course.log.is_open("damage"):
            return "alarm"
        return self.evaluations_["state"].iloc[-1] if len(self.evaluations_) else "not evaluated"

    def years_watched(self, since: Any = None) -> float:
        """Time in which records were evaluated.

        Parameters
        ----------
        since : str or Timestamp, optional
            Its beginning; by default the end of the baseline.

        Returns
        -------
        float
            In years. Of a gap, only a day or the usual step counts.
        """
        check_is_fitted(self)
        days = self.days_
        evaluated = days.index[days["n_evaluated"] > 0]
        if since is not None:
            evaluated = evaluated[evaluated >= pd.Timestamp(since).floor("D")]
        if not len(evaluated):
            return 0.0
        steps = np.diff(evaluated.as_unit("ns").asi8) / DAY.value
        longest = max(1.0, float(np.median(steps))) if len(steps) else 1.0
        return float((1 + np.minimum(steps, longest).sum()) * (DAY / YEAR))

    def event_p_values(self, since: Any = None, *, tail_shape: float | None = None) -> pd.Series:
        """How probable so high a peak is for a healthy structure, by event.

        Parameters
        ----------
        since : str or Timestamp, optional
            Only events that are open, or have ended since then; by default all.
        tail_shape : float, optional
            Shape of the generalised Pareto tail of squared peaks, such as that of other bridges (`Fleet.discoveries`);
            0 is an exponential tail. By default the baseline decides whether that is heavy enough.

        Returns
        -------
        Series
            By number of the event, for those of damage: the probability that a healthy structure has so high a peak in
            the time watched since then.

        Notes
        -----
        For a healthy structure, the p value of its highest event is at most p with probability p or less, if squared
        peaks over their scale in the season have an exponential tail, as those of normal residuals have. Single
        outliers are no peaks where ``persistence`` is more than 1; where the baseline shows a heavier tail, that is
        taken. The p value comes from the highest excursions of the baseline, by which the detector in charge when the
        event began was given its threshold, and allows for their number, however small.
        """
        check_is_fitted(self)
        events = self.events_[self.events_["kind"] == "damage"]
        if since is not None:
            begin = pd.Timestamp(since)
            events = events[events["end"].isna() | (events["end"] >= begin)]
            since = min([begin, *events.loc[events["end"].isna(), "start"]])
        n_years = self.years_watched(since)
        p_values = [
            [promise for taken, promise in self.promises_ if taken <= event["start"]][-1].p_value(
                event["peak"], n_years, tail_shape
            )
            for _, event in events.iterrows()
        ]
        return pd.Series(p_values, events.index, dtype=float, name="p_value")

    def acknowledge(self, event: int, *, harmless: bool, note: str = "") -> None:
        """Record what the owner has found out about an event.

        Parameters
        ----------
        event : int
            Its number in ``events_``.
        harmless : bool
            Whether the structure is as before: records of a harmless event may train a new detector.
        note : str, default=""
            What was found.

        Raises
        ------
        ValueError
            If there is no such event.
        """
        check_is_fitted(self)
        events = self._course.log.events
        if isinstance(event, bool) or not isinstance(event, Integral) or not 1 <= event <= len(events):
            raise ValueError(f"event is {event!r}; expected the number of one of the {len(events)} events, from 1")
        if not isinstance(note, str):
            raise ValueError(f"note is {note!r:.100}; expected text")
        said = Acknowledgement(
            events[event - 1].kind, events[event - 1].peak_time, check_flag(harmless, "harmless"), note
        )
        self._acknowledgements = (*self._acknowledgements, said)

    def refit(self, records: pd.DataFrame | None = None, *, until: Any = None, force: bool = False) -> Retraining:
        """Learn anew from the baseline and the records since, if the new detector is not clearly worse.

        Parameters
        ----------
        records : DataFrame, optional
            Records since the baseline in the columns of `fit`; by default those that are kept, as the detector saw
            them: without the values of faulty sensors, and without drift that was reported.
        until : str or Timestamp, optional
            The last moment whose records may train; by default all may.
        force : bool, default=False
            Whether the new detector takes over whatever speaks against it.

        Returns
        -------
        Retraining
            Whether it took over, why not, how both compare, and what was left out. If refused, nothing has changed.

        Raises
        ------
        ValueError
            If the records are not as `update` expects them.

        Notes
        -----
        Records never train of events that were not acknowledged as harmless, from a week before their start (or the
        detector's window, if that is longer) to their end; while such an event is open, nothing after that trains.
        Values of faulty sensors do not train, nor do records that came too late.

        The new detector is refused if the new records differ from the baseline, weather apart, from some day on or
        steadily, by more than chance (probability below 1 % among all that is tried) and by more than a fifth of a
        record's standard deviation: a detector that learned them would not see that change any more. It is refused if
        more of the new records are above its threshold, each evaluated by the others, than above the old one; if it
        finds only clearly larger changes, unless it has fewer false alarms; and if it no longer finds a past event.
        """
        check_is_fitted(self)
        if records is not None:
            records = read_records(records, self.baseline_.columns, self.baseline_.index.tz)
            records = self._active.plausible.cleaned(records)[0]
        retraining = retrained(self, records, self._activated, until=until, force=check_flag(force, "force"))
        if retraining.accepted:
            self._take_over(retraining)
        return retraining

    def rebaseline(self, since: Any, *, until: Any = None) -> Retraining:
        """Begin a new baseline after an intervention that has changed the structure, such as a repair.

        Parameters
        ----------
        since : str or Timestamp
            When the intervention was complete. Records from then on are those of the structure as it is now.
        until : str or Timestamp, optional
            The last moment whose records may train; by default all may.

        Returns
        -------
        Retraining
            The change of each mode's level, and how large a change the new detector finds beside the old one.

        Raises
        ------
        ValueError
            If no record of the baseline is from before ``since``, or none of those is needed any more.

        Notes
        -----
        The call says that the records since are healthy. Open events end, and count as harmless if nothing else has
        been said of them. Records of an event that began since, and was acknowledged as damage, do not train.

        The records of the baseline stand in for the weather that has not come since: each mode is moved to its new
        level, which is the mean of what the old regression on the weather leaves of the new records. As few days tell
        a level only roughly, each week of old records is moved besides by what another stretch of the old baseline, as
        long as the new one, misses its level by: the threshold allows for that. Old weeks drop out when new records
        cover their time of the year. Call again as days come; `refit` goes on in the same way.
        """
        check_is_fitted(self)
        retraining = begun_again(self, since, self._activated, until=until)
        if retraining.accepted:
            self._take_over(retraining)
        return retraining

    def _activated(
        self,
        detector: Any,
        trained: pd.DataFrame,
        columns: list[Any] | None = None,
        corrections: Corrections | None = None,
    ) -> ActiveDetector:
        """All by which a detector evaluates that was fitted on some records; by default as the one in charge."""
        return ActiveDetector.of(
            detector,
            trained,
            self._active.columns if columns is None else columns,
            self.targets_,
            self._active.corrections if corrections is None else corrections,
            Memory.of(detector) if self.lookback is None else Memory.of_time(_duration(self.lookback, "lookback")),
            by_direction=self.direction == "softening",
            per_year=self.false_alarms_per_year,
            persistence=self.persistence,
        )

    def _take_over(self, retraining: Retraining) -> None:
        """Put a retrained detector in charge, from the newest day on."""
        trained, end, corrections, said = retraining.baseline, None, self._active.corrections, self._acknowledgements
        if retraining.kind == "new baseline":
            end = (self.last_ + pd.Timedelta("1s")).as_unit("ns").value
            note = f"ended by the new baseline since {retraining.since}"
            known = self.events_["acknowledged"]
            said += tuple(
                Acknowledgement(one.kind, one.peak_time, True, note)
                for one, is_known in zip(self._course.log.events, known, strict=True)
                if one.end is None and not is_known
            )
            T, F = trained.drop(columns=self.targets_), trained[self.targets_]
            fem = None if self.fem is None else clone(self.fem).fit(T, F)  # the chain of the structure as it is now
            corrections = Corrections.of(trained, self.targets_, fem=fem, sensors=self.sensors)
        active = self._activated(retraining.detector, trained, corrections=corrections)
        self._course = self._course.handed_over(active, self._store, end)
        self._active, self.promises_ = active, (*self.promises_, (self.last_, active.promises["damage"]))
        self.prior_, self.since_, self._acknowledgements = retraining.prior, retraining.since, said

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the monitor to a file, from which `load_monitor` reads it; it goes on there where it stopped.

        Parameters
        ----------
        path : str or path
            The file, which ends with ``.skops`` (skops, runs no code when it is read) or ``.joblib``. An older one is
            replaced when the new one is complete and on the disk, so that a crash leaves one of the two.

        Raises
        ------
        NotFittedError
            If the monitor is not fitted.
        ValueError
            If the path has another ending, the folder does not exist, or skops cannot save a part of the monitor, such
            as a class of another package.
        ImportError
            If the file ends with ``.skops``, and skops is not installed.
        """
        write_monitor(self, path)

    def summary(self) -> str:
        """What the owner should know, in a few lines.

        Returns
        -------
        str
            State, records, events, sensors and drift.
        """
        check_is_fitted(self)
        return in_words(self)

    @property
    def detector_(self) -> Any:
        """The fitted detector."""
        return self._active.detector

    @property
    def trained_(self) -> pd.DataFrame:
        """What the detector in charge was fitted on."""
        return self._active.trained

    @property
    def lookback_(self) -> Memory:
        """Which earlier records the evaluation of a record needs."""
        return self._active.memory

    @property
    def false_alarm_estimate_(self) -> FalseAlarmEstimate:
        """How the threshold was set, and how many false events to expect."""
        return self._active.promises["damage"]

    @property
    def threshold_(self) -> float:
        """A damage event opens with an index above it."""
        return self.false_alarm_estimate_.rule.threshold

    @property
    def clear_threshold_(self) -> float:
        """An event closes when the index has stayed at or below it."""
        return self.false_alarm_estimate_.rule.release

    @property
    def baseline_(self) -> pd.DataFrame:
        """Records of the baseline, raw."""
        return self._store.baseline

    @property
    def records_(self) -> pd.DataFrame:
        """Records kept since the baseline, raw."""
        return self._store.kept

    @property
    def corrected_(self) -> pd.DataFrame:
        """Records kept since the baseline as the detector sees them."""
        return self._course.corrected.loc[self.records_.index]

    @property
    def last_(self) -> pd.Timestamp:
        """Stamp of the newest record."""
        return self._store.last

    @property
    def evaluations_(self) -> pd.DataFrame:
        """The latest evaluation of each record that is kept."""
        return self._course.evaluations

    @property
    def days_(self) -> pd.DataFrame:
        """Daily summaries."""
        return self._course.days

    @property
    def events_(self) -> pd.DataFrame:
        """Events, counted from 1."""
        return event_table(self._course.log.events, self._acknowledgements, self.baseline_.index.tz)

    @property
    def faults_(self) -> pd.DataFrame:
        """Sensors that have failed."""
        return self._active.corrections.faults(self._course.corrections)

    @property
    def drift_(self) -> pd.DataFrame | None:
        """Drift that was followed, by group."""
        return self._active.corrections.drifts(self._course.corrections)

    def _frequency_columns(self, baseline: pd.DataFrame, compensators: Sequence[TemperatureCompensator]) -> list[Any]:
        """Names of the frequency columns: as given, those of the compensators, or those of the chain."""
        columns = list(baseline.columns)
        if self.targets is not None:
            wanted = list(self.targets)
        elif compensators:
            places = [positions_of(one.targets, len(columns), np.array(columns, dtype=object)) for one in compensators]
            return [columns[k] for k in sorted(set(np.concatenate(places).tolist()))]
        elif self.fem is not None:
            check_is_fitted(self.fem)
            wanted = list(self.fem.mode_names_)
        else:
            raise ValueError(
                "the detector has no TemperatureCompensator whose targets tell which columns are frequencies, and "
                "there is no fem; expected targets=[names of the frequency columns]"
            )
        unknown = [name for name in wanted if name not in columns]
        if unknown or not wanted or len(set(wanted)) < len(wanted):
            raise ValueError(f"targets are {wanted}; expected different names among the columns {columns}")
        return wanted

    def _why_too_late(self, records: pd.DataFrame) -> list[str]:
        end = self.baseline_.index[-1]
        return [
            f"before the end of the baseline ({end})"
            if stamp <= end
            else f"came too late, more than {self.max_delay} after newer records"
            for stamp in records.index
        ]

    def _counted(self, intake: Intake, course: Course) -> dict[str, int]:
        """The counts after a batch."""
        counts = self.counts_
        n_too_late = counts["n_too_late"] + len(intake.too_late)
        n_records, n_evaluated = course.days[["n_records", "n_evaluated"]].sum()
        return {
            "n_records": int(n_records) + n_too_late,
            "n_repeated": counts["n_repeated"] + intake.n_repeated,
            "n_late": counts["n_late"] + intake.n_late,
            "n_too_late": n_too_late,
            "n_not_evaluated": int(n_records - n_evaluated) + n_too_late,
            "n_implausible": counts["n_implausible"]
            + int(self._active.plausible.implausible(intake.fresh.to_numpy()).sum()),
        }


def _warn_of_not_evaluated(answers: pd.DataFrame) -> None:
    new = answers[~answers["revised"]]
    unknown = new[new["state"] == "not evaluated"]
    if not len(unknown):
        return
    counts = unknown["reason"].value_counts()
    causes = [f"{n} because {cause}" for cause, n in counts.iloc[:MOST_CAUSES].items()]
    more = f"; and {counts.iloc[MOST_CAUSES:].sum()} for other reasons" if len(counts) > MOST_CAUSES else ""
    warn_user(
        f"{len(unknown)} of {len(new)} new records are not evaluated, the first {unknown.index[0]}: {'; '.join(causes)}"
        f"{more}",
        UnevaluatedRowsWarning,
        "records not evaluated",
    )


def _duration(value: Any, name: str) -> pd.Timedelta:
    """A duration of zero or more."""
    try:
        duration = pd.Timedelta(value).as_unit("ns")
    except (ValueError, TypeError) as error:
        raise ValueError(f"{name} is {value!r}; expected a duration, such as '7D'") from error
    if not duration >= pd.Timedelta(0):
        raise ValueError(f"{name} is {value!r}; expected a duration of zero or more, such as '7D'")
    return duration
