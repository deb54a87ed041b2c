"""A damage detector in service."""

from __future__ import annotations

import os
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from datetime import timedelta
from numbers import Integral, Real
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone

from skthermo._core.arrays import check_flag, is_real
from skthermo._core.estimators import (
    Estimator,
    HasMethods,
    Interval,
    _fit_context,
    check_is_fitted,
    held,
    seed_parts,
    seeded,
)
from skthermo._core.frames import DAY, YEAR, check_duration, check_stamp, midnight
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.warnings import warn_user
from skthermo.exceptions import UnevaluatedRowsWarning
from skthermo.monitoring._active import ActiveDetector
from skthermo.monitoring._columns import usable_baseline, without_what_cannot_be
from skthermo.monitoring._corrections import Corrections
from skthermo.monitoring._events import DAMAGE, Acknowledgement, Transition
from skthermo.monitoring._files import versions, write_monitor
from skthermo.monitoring._history import History
from skthermo.monitoring._records import OF_TRAINING, Memory, RecordStore, read_records
from skthermo.monitoring._retraining import Retraining, begun_again, retrained
from skthermo.monitoring._status import MonitorStatus, status_of, summary_lines
from skthermo.monitoring._threshold import FalseAlarmEstimate, SmallestChanges

MOST_CAUSES = 3  # in a warning


class Monitor(SavesFrames, Estimator):
    """A damage detector in service: it evaluates records as they come, day by day, for years.

    Parameters
    ----------
    detector : detector or Pipeline, optional
        Any detector of ``skthermo.detection``, or a pipeline that ends with one, such as
        ``CompensatedDetector(targets=..., window="1D")``. One without a compensator sees the
        frequencies only. By default a `~skthermo.surrogate.TemperatureMapper` predicts the ``targets`` from the other
        columns, if there are any. Then a `~skthermo.detection.DirectionalDetector` evaluates responses in Hz, with the
        directions of ``fem`` if there is one, and a `~skthermo.detection.MahalanobisDetector` any others: only
        frequencies have a side on which damage lies.
    targets : sequence of str, optional
        Names of the responses: natural frequencies, or any others of any sign and unit. By default those of the
        compensator, else those that ``fem`` was fitted on; with a compensator, they have to be its own.
    reference : sequence of str, optional
        Names of columns with temperatures from elsewhere, such as a weather station or a reanalysis. They check the
        thermometers and fill their gaps, and are no inputs of the detector.
    fem : DataInformedFEM, optional
        A fitted chain. With it, slow drift is followed in its parameters; without it, none is.
    false_alarms_per_year : float, default=1.0
        Damage events that a healthy structure has in a year, on average.
    watch_per_year : float, optional
        A second, lower level: events of kind "watch" that a healthy structure has in a year, more than damage events.
        While one is open, and no damage event is, the state is "watch". By default there is no such level.
    persistence : int, default=3
        Number of records above the threshold by which an event opens, among the last ``2 persistence - 1`` that were
        evaluated: three of five. Single outliers raise no alarm, and a change that lasts is found by its third record.
        1 means that a single record opens an event.
    max_delay : str or timedelta, default="7D"
        How late records may come and still be evaluated as if they had come in time.
    retention : str or timedelta, default="400D"
        How long raw records are kept, for a new fit and to tell repeated records.
    sensors : bool, default=True
        Whether sensors are watched, and those that fail left out.
    units : str or mapping of str to str, optional
        Unit of the responses, or units by column, for messages and pages. By default "Hz" where there is a ``fem``, as
        its responses are natural frequencies, else none; temperatures are in "°C".
    lookback : str or timedelta, optional
        How long before a record the detector looks. By default the lags and windows of its parts tell.
    random_state : int, RandomState or None, default=None
        Seeds parts of the detector that are not seeded.

    Attributes
    ----------
    detector_ : detector or Pipeline
        Fitted clone.
    targets_ : list of str
        Names of the responses, in the order of the columns.
    units_ : dict
        Unit of each column, "" where it is not known.
    false_alarm_estimate_ : object
        How the threshold was set, and how many false events to expect: ``expected``, ``lowest`` and ``highest`` in a
        year.
    threshold_ : float
        A damage event opens with an index above it, of ``persistence`` of the last evaluated records.
    clear_threshold_ : float
        An event closes when, for a day, fewer than ``persistence`` of the last records have been above it.
    smallest_changes_ : object
        By how much responses have to fall until half of the records are above the threshold, in the weather of the
        baseline: ``common`` (all by one share), ``single`` (each alone, by name), and ``within`` which time an alarm
        follows. Shares of the mean, or, where not all responses are positive, in their units without a ``common``
        change. ``groups`` are losses of stiffness by name of the damage group, where the detector has directions of
        such. NaN where none is seen.
    watch_threshold_ : float or None
        An event of kind "watch" opens with an index above it, in the same way; None without ``watch_per_year``.
    lookback_ : object
        Which earlier records the evaluation of a record needs.
    events_ : DataFrame
        A row for each event, counted from 1: ``kind`` ("damage", "watch", or "measurement or structure":
        responses that were set aside as implausible or stuck), ``start``, ``end`` (first record after it, NaT while it
        is open), ``peak`` (highest index that ``persistence`` of the last records reached; of the last kind, the
        largest number of responses set aside), ``peak_time``, ``modes`` (at the peak) and ``groups`` (of all records in
        alarm together), as in `update`, ``n_alarms`` (records while it was open), ``acknowledged``, ``harmless`` and
        ``note``.
    days_ : DataFrame
        A row for each day with records: ``n_records``, ``n_evaluated``, ``n_alarms``, ``n_left_out`` (values),
        ``index_median``, ``index_max`` and, where drift is followed, a column ``drift GROUP`` for each group.
    evaluations_ : DataFrame
        The latest evaluation of each record that is kept, as `update` gives it.
    faults_ : DataFrame
        Sensors that have failed: ``column``, ``kind``, ``since``, ``detected``, ``until``, ``detail``.
    drift_ : DataFrame or None
        Change of each group's stiffness that was followed: ``change``, ``standard_error``, ``per_year``,
        ``per_year_error``, ``significant``, and the ``p_value`` of the structure's drift; None without ``fem``.
    counts_ : dict
        ``n_records`` that came, without repeated ones; of these ``n_not_evaluated``, ``n_late`` (evaluated all the
        same), ``n_too_late`` and ``n_ahead`` (set aside at present), neither of them evaluated; ``n_repeated``; and
        ``n_left_out``: values that came and were not used.
    baseline_, records_, corrected_ : DataFrame
        Records of the baseline and those kept since, both raw, and the latter as the detector sees them.
    last_ : Timestamp
        Stamp of the newest record.
    left_out_ : dict
        Columns of the baseline that cannot be used, each with the reason; nothing is said of them, and `faults_` lists
        them, too.
    set_aside_ : DataFrame
        Values of the baseline that cannot be, and count as missing: a row for each finding, as in
        `~skthermo.preprocessing.SetAside`.
    columns_ : list
        Names of the columns that `fit` saw, which `update` expects.
    trained_ : DataFrame
        What the detector in charge was fitted on: the baseline, or what `refit` or `rebaseline` made of it.
    prior_, since_ : DataFrame and Timestamp, or None
        After `rebaseline`: records from before the intervention, and when it was complete.
    versions_ : dict
        Versions of skthermo and scikit-learn by which it was fitted.
    active_, history_ : object
        The detector in charge with all by which it evaluates, and all that was evaluated so far. Both are immutable:
        `update`, `refit` and `rebaseline` put others in their place.

    See Also
    --------
    skthermo.detection.CompensatedDetector : Regression, regimes, windows and a detector.

    Notes
    -----
    Any division of records into batches gives the same evaluations, events and daily summaries, bit for bit, as one
    batch of all of them. Lags and windows reach into earlier batches, and into the end of the baseline. Records that
    come late are evaluated with those around them, and later ones anew: what `update` says last of a stamp counts.

    The damage index is rounded to six decimals, and one above 10 to seven digits. Where the last bits, which depend on
    how many records are evaluated at once, would decide how, the index of the record alone with its memory counts.

    A number that loggers write for a missing one (-999) is taken as missing where the baseline does not reach it, as is
    a temperature more than 100 degrees beyond the baseline's that is above 100 or below -80 degrees Celsius, as in
    kelvin. Whatever is left out has its reason in the row and counts in ``counts_``. :doc:`/guide/in_service` says what
    becomes of responses that are implausible, of sensors that fail, and of records from a clock that is wrong.

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
    >>> monitor.status(monitor.last_).state
    'healthy'
    """

    _parameter_constraints: dict = {
        "detector": [HasMethods(["fit", "score_samples"]), None],
        "targets": ["array-like", None],
        "fem": [HasMethods(["fit", "predict"]), None],
        "false_alarms_per_year": [Interval(Real, 0, None, closed="neither")],
        "watch_per_year": [Interval(Real, 0, None, closed="neither"), None],
        "persistence": [Interval(Integral, 1, None, closed="left")],
        "reference": ["array-like", None],
        "max_delay": [str, timedelta, np.timedelta64],
        "retention": [str, timedelta, np.timedelta64],
        "sensors": ["boolean"],
        "units": [str, Mapping, None],
        "lookback": [str, timedelta, np.timedelta64, None],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        detector: Any = None,
        *,
        targets: Sequence[Hashable] | None = None,
        reference: Sequence[Hashable] | None = None,
        fem: Any = None,
        false_alarms_per_year: float = 1.0,
        watch_per_year: float | None = None,
        persistence: int = 3,
        max_delay: str | timedelta = "7D",
        retention: str | timedelta = "400D",
        sensors: bool = True,
        units: str | Mapping[Hashable, str] | None = None,
        lookback: str | timedelta | None = None,
        random_state: int | np.random.RandomState | None = None,
    ):
        self.detector = detector
        self.targets = targets
        self.reference = reference
        self.fem = fem
        self.false_alarms_per_year = false_alarms_per_year
        self.watch_per_year = watch_per_year
        self.persistence = persistence
        self.max_delay = max_delay
        self.retention = retention
        self.sensors = sensors
        self.units = units
        self.lookback = lookback
        self.random_state = random_state

    detector_: Any = held("active_.detector")
    lookback_: Memory = held("active_.memory")
    false_alarm_estimate_: FalseAlarmEstimate = held("active_.estimate")
    threshold_: float = held("active_.threshold")
    clear_threshold_: float = held("active_.estimate.rule.release")
    watch_threshold_: float | None = held("active_.watch_threshold")
    smallest_changes_: SmallestChanges = held("active_.smallest")
    trained_: pd.DataFrame = held("active_.trained", is_copied=True)
    prior_: pd.DataFrame | None = held("active_.prior")
    since_: pd.Timestamp | None = held("active_.since")
    baseline_: pd.DataFrame = held("history_.store.baseline", is_copied=True)
    records_: pd.DataFrame = held("history_.store.kept", is_copied=True)
    last_: pd.Timestamp = held("history_.store.last")
    evaluations_: pd.DataFrame = held("history_.evaluations", is_copied=True)
    days_: pd.DataFrame = held("history_.days", is_copied=True)
    counts_: dict[str, int] = held("history_.counts")
    events_: pd.DataFrame = held("history_.event_table")

    @property
    def corrected_(self) -> pd.DataFrame:
        """Records kept since the baseline as the detector sees them."""
        return self.history_.corrected.loc[self.history_.store.kept.index]

    @property
    def faults_(self) -> pd.DataFrame:
        """Sensors that have failed, those of columns that are left out first."""
        found = self.active_.corrections.faults(self.history_.corrections)
        if not self.left_out_:
            return found
        first, last = self.baseline_.index[[0, -1]]
        out = pd.DataFrame(
            [(name, "left out", first, last, pd.NaT, reason) for name, reason in self.left_out_.items()],
            columns=["column", "kind", "since", "detected", "until", "detail"],
        )
        return pd.concat([out, found], ignore_index=True) if len(found) else out

    @property
    def drift_(self) -> pd.DataFrame | None:
        """Drift that was followed, by group."""
        return self.active_.corrections.drifts(self.history_.corrections)

    def __sklearn_clone__(self) -> Monitor:
        return type(self)(
            **self.get_params(deep=False) | {"detector": clone(self.detector, safe=False)}
        )  # the chain is shared

    def __getstate__(self) -> dict[str, Any]:
        state = super().__getstate__()
        if "active_" in state and self.active_.trained is self.history_.store.baseline:  # most often: saved once
            state["active_"] = replace(self.active_, trained=None)
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        if "active_" in state and self.active_.trained is None:
            self.active_ = replace(self.active_, trained=self.history_.store.baseline)

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: pd.DataFrame, y: None = None) -> Monitor:
        """Fit the detector to a baseline, and set the threshold of events.

        Parameters
        ----------
        X : DataFrame of shape (n_samples, n_features)
            Temperatures in degrees Celsius and responses of the healthy structure, side by side, on a
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
            If the records are no frame on a ``DatetimeIndex`` with each stamp once; if the responses are not known, or
            not those of the compensator; if values make the baseline useless, such as kelvin or a frequency of 1e6, all
            of which the error lists; if the detector looks at later records, farther back than its parts tell, or
            drops large changes.

        Warns
        -----
        UserWarning
            As the detector does; if values are no measurements and are taken as missing; if the detector does not see
            even large changes of a response.
        """
        max_delay, retention = self._checked_times()
        given = _read_baseline(X)
        baseline, detector, columns, found = usable_baseline(self, given)
        seed_parts(detector, seeded(self.random_state))
        self.targets_, self.units_ = columns.targets, columns.units
        self.columns_, self.left_out_, aside = list(given.columns), found.left_out, found.table
        self.set_aside_ = aside[~aside["column"].isin(list(self.left_out_))].reset_index(drop=True)
        corrections = self._corrections(baseline, columns.reference, self.fem)
        trained = baseline if len(columns.inputs) == baseline.shape[1] else baseline[columns.inputs]
        active = self._activated(detector.fit(trained[columns.seen]), trained, columns.seen, corrections)
        active.check()
        store = RecordStore.of(baseline, max_delay, retention)
        self.active_, self.history_ = active, History.of(active, store)
        self.versions_ = versions()
        return self

    def update(self, new: pd.DataFrame, *, confirm: bool = False) -> pd.DataFrame:
        """Evaluate records that came since.

        Parameters
        ----------
        new : DataFrame of shape (n_samples, n_features)
            Raw records in the columns of `fit`, in any order: an hour, a day or a month, with gaps, late or repeated.
        confirm : bool, default=False
            Whether records that are stamped far ahead of the newest one, and those set aside before, are right.

        Returns
        -------
        DataFrame
            On the stamps of new records, and of known ones that are evaluated anew because others came late: ``state``
            ("healthy", "watch", "alarm" or "not evaluated"), ``index`` (damage index), ``threshold``, ``modes`` (names
            of the modes that drive an alarm, the worst first), ``groups`` (of a directional detector with damage
            groups: those whose losses explain most of an alarm, "" where none do; "a or b" cannot be distinguished),
            ``reason`` (why a record is not evaluated, or what else is worth saying), ``event`` (its number in
            ``events_``, 0 for none), ``revised`` (whether it was evaluated before).

        Raises
        ------
        ValueError
            If the records are no frame on a ``DatetimeIndex`` with the columns and the time zone of the baseline; if a
            known stamp comes with other values. The monitor then stays as it was.

        Warns
        -----
        UserWarning
            If new records are not evaluated: how many, and why.
        """
        check_is_fitted(self)
        records = self._read(new)
        intake = self.history_.store.sort_in(records, check_flag(confirm, "confirm"))
        state, answers = self.history_.taken_in(self.active_, intake)
        _warn_of_not_evaluated(answers)
        self.history_ = state
        return answers

    def status(self, now: Any = None, *, max_age: str | timedelta | None = None) -> MonitorStatus:
        """The state at a time, and the facts behind it, for machines.

        Parameters
        ----------
        now : str or datetime, optional
            The time, such as that of the newest record, ``last_``. By default that of the computer's clock; if the
            records have no time zone, the local time.
        max_age : str or timedelta, optional
            Age of the newest record beyond which nothing is healthy. By default the usual time between records, and
            two days more.

        Returns
        -------
        MonitorStatus
            State, records, damage index and levels, open events, failed sensors; ``as_dict()`` gives plain values.

        Raises
        ------
        ValueError
            If ``now`` is no time, or has a time zone where the records have none; if ``max_age`` is no duration.
        """
        check_is_fitted(self)
        return status_of(self).at(now, max_age=max_age)

    def transitions(self, after: int = 0) -> list[dict[str, Any]]:
        """What has changed: events that open and close, sensors that fail, detectors that take over.

        Parameters
        ----------
        after : int, default=0
            Number of the last entry that is known already, such as ``status().transition`` before an update.

        Returns
        -------
        list of dict
            Plain values of each later entry, the oldest first. ``id``: its number, from 1, which it keeps. ``what``:
            "opened", "closed" or "withdrawn" (late records have shown that there was no event), "acknowledged", "fault"
            or "put back" (a sensor), "refit", "rebaseline" or "discarded". ``time``: when it happened, by the stamps of
            the records. ``newest``: the newest record when it was reported. ``event``: the number of the event, 0 for
            none. ``kind``: that of the event or fault. ``column``: the sensor, else "". ``detail``: text.

        Raises
        ------
        ValueError
            If ``after`` is not a number from 0 to that of the newest entry.

        Notes
        -----
        Entries are saved with the monitor. A reader that remembers the last number it has seen misses none and gets
        none twice, also if it was stopped in between.
        """
        check_is_fitted(self)
        found = self.history_.transitions
        if isinstance(after, bool) or not isinstance(after, Integral) or not 0 <= after <= len(found):
            raise ValueError(f"after is {after!r}; expected a number of a transition from 0 to {len(found)}")
        return [one.as_dict(number, self.last_.tz) for number, one in enumerate(found, 1) if number > after]

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
            evaluated = evaluated[evaluated >= midnight(check_stamp(since, self.baseline_.index, "since"))]
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
            Shape of the generalised Pareto tail of squared peaks, from 0 to less than 1, such as that of other bridges
            (`~skthermo.fleet.Fleet.discoveries`); 0 is an exponential tail. By default the baseline decides whether
            that is heavy enough.

        Returns
        -------
        Series
            By number of the event, for those of damage: the probability that a healthy structure has so high a peak in
            the time watched since then.

        Notes
        -----
        The p value comes from the highest peaks of the baseline, by which the detector in charge when the event
        began was given its threshold (:ref:`how-events-are-tested`).
        """
        check_is_fitted(self)
        if tail_shape is not None and not (is_real(tail_shape) and 0 <= tail_shape < 1):
            raise ValueError(f"tail_shape is {tail_shape!r:.100}; expected a number from 0 to less than 1, or None")
        events = self.events_[self.events_["kind"] == DAMAGE]
        if since is not None:
            begin = check_stamp(since, self.baseline_.index, "since")
            events = events[events["end"].isna() | (events["end"] >= begin)]
            since = min([begin, *events.loc[events["end"].isna(), "start"]])
        n_years = self.years_watched(since)
        p_values = [
            [estimate for taken, estimate in self.history_.estimates if taken <= event["start"]][-1].p_value(
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
            Whether the structure is as before: records of a harmless event may train a new detector. Of an event of
            kind "measurement or structure", that sensors are at fault: from the next record on, the other responses
            are evaluated without them.
        note : str, default=""
            What was found.

        Raises
        ------
        ValueError
            If there is no such event.
        """
        check_is_fitted(self)
        events = self.history_.log.events
        if isinstance(event, bool) or not isinstance(event, Integral) or not 1 <= event <= len(events):
            raise ValueError(f"event is {event!r}; expected the number of one of the {len(events)} events, from 1")
        if not isinstance(note, str):
            raise ValueError(f"note is {note!r:.100}; expected text")
        of, now = events[event - 1], self.last_.as_unit("ns").value
        one = Acknowledgement(of.kind, of.peak_time, now, check_flag(harmless, "harmless"), note)
        said = Transition("acknowledged", now, now, of.kind, int(event), detail=note)
        self.history_ = replace(
            self.history_,
            acknowledgements=(*self.history_.acknowledgements, one),
            transitions=(*self.history_.transitions, said),
        )

    def discard(self, start: Any, end: Any = None) -> int:
        """Take back records that should not have been taken in, such as those stamped by a wrong clock.

        Parameters
        ----------
        start : str or Timestamp
            The first stamp of them.
        end : str or Timestamp, optional
            The last stamp of them; by default all from ``start`` on.

        Returns
        -------
        int
            Number of records that were taken back.

        Raises
        ------
        ValueError
            If there is no such record since the baseline, or the monitor no longer knows how things stood before them.

        Notes
        -----
        The monitor is then as if these records had never come: those that stay are evaluated anew from there on by the
        detector in charge, and the newest record is the newest of them. Records that were refused as too late because
        of wrong stamps can come again. What was acknowledged stays, and `transitions` lists what changes.

        How things stood before is known for the last days (``max_delay``), before the latest jump of the stamps, and,
        while all records since the baseline are kept, for any time.
        """
        check_is_fitted(self)
        stamps = self.baseline_.index
        first, last = check_stamp(start, stamps, "start"), None if end is None else check_stamp(end, stamps, "end")
        self.history_, number = self.history_.without(self.active_, first, last)
        return number

    def refit(self, records: pd.DataFrame | None = None, *, until: Any = None, force: bool = False) -> Retraining:
        """Learn anew from the baseline and the records since, if the new detector is not significantly worse.

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
        Which records never train, and when the new detector is refused: :doc:`/guide/in_service`.
        """
        check_is_fitted(self)
        if records is not None:
            options = {"exclude": OF_TRAINING, "is_baseline": False}
            records, _ = without_what_cannot_be(self._read(records), self.targets_, self.units_, **options)
            records = self.active_.corrections.cleaned(records)
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
        level, the mean of what the old regression on the weather leaves of the new records. The threshold allows for
        how roughly few days tell it. Call again as days come; `refit` goes on in the same way.
        """
        check_is_fitted(self)
        retraining = begun_again(self, since, self._activated, until=until)
        if retraining.accepted:
            self._take_over(retraining)
        return retraining

    def _read(self, records: pd.DataFrame) -> pd.DataFrame:
        """Records in the columns of `fit`, without those that are left out."""
        return read_records(records, self.columns_, self.baseline_.index.tz).drop(columns=list(self.left_out_))

    def _checked_times(self) -> tuple[pd.Timedelta, pd.Timedelta]:
        """``max_delay`` and ``retention``; an error for parameters that contradict each other."""
        max_delay, retention = (check_duration(getattr(self, name), name) for name in ("max_delay", "retention"))
        if retention < max_delay + 2 * DAY:
            raise ValueError(
                f"retention is {self.retention!r} and max_delay {self.max_delay!r}; expected records to be kept for at "
                "least two days longer than they may be late"
            )
        if self.watch_per_year is not None and not self.watch_per_year > self.false_alarms_per_year:
            raise ValueError(
                f"watch_per_year is {self.watch_per_year:g} and false_alarms_per_year {self.false_alarms_per_year:g}; "
                "expected more watches than alarms a year, such as 12 and 1"
            )
        return max_delay, retention

    def _corrections(self, baseline: pd.DataFrame, reference: list[Any], fem: Any) -> Corrections:
        options = {"fem": fem, "sensors": self.sensors}
        return Corrections.of(baseline, self.targets_, reference, self.units_, **options)

    def _activated(
        self,
        detector: Any,
        trained: pd.DataFrame,
        columns: list[Any] | None = None,
        corrections: Corrections | None = None,
    ) -> ActiveDetector:
        """All by which a detector evaluates that was fitted on some records; by default as the one in charge."""
        columns = self.active_.columns if columns is None else columns
        corrections = self.active_.corrections if corrections is None else corrections
        return ActiveDetector.of(self, detector, trained, columns, corrections)

    def _take_over(self, retraining: Retraining) -> None:
        """Put a retrained detector in charge, from the newest day on."""
        trained, end, corrections, state = retraining.baseline, None, self.active_.corrections, self.history_
        if retraining.kind == "new baseline":
            now = self.last_.as_unit("ns").value
            end, note = now + 10**9, f"ended by the new baseline since {retraining.since}"
            known = self.events_["acknowledged"]
            ended = tuple(
                Acknowledgement(one.kind, one.peak_time, now, True, note)
                for one, is_known in zip(state.log.events, known, strict=True)
                if one.end is None and not is_known
            )
            state = replace(state, acknowledgements=(*state.acknowledgements, *ended))
            T, F = trained.drop(columns=self.targets_), trained[self.targets_]
            fem = None if self.fem is None else clone(self.fem).fit(T, F)  # the chain of the structure as it is now
            raw = pd.concat([self.baseline_, self.records_]).reindex(trained.index)
            whole = trained.join(raw[corrections.reference])[list(raw.columns)]
            corrections = self._corrections(whole, corrections.reference, fem)
        active = self._activated(retraining.detector, trained, corrections=corrections)
        self.active_ = replace(active, prior=retraining.prior, since=retraining.since)
        now = self.last_.as_unit("ns").value
        taken_over = Transition("refit" if end is None else "rebaseline", now, now, retraining.kind)
        self.history_ = state.handed_over(self.active_, end).changed_from(state, self.active_, taken_over)

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
        return "\n".join(summary_lines(self))


def _read_baseline(X: pd.DataFrame) -> pd.DataFrame:
    baseline = read_records(X)
    if not len(baseline):
        raise ValueError("the baseline has no records; expected those of the healthy structure, of a year if possible")
    if baseline.index.has_duplicates:
        again = baseline.index[baseline.index.duplicated()]
        raise ValueError(f"{len(again)} stamps of the baseline are there twice, the first {again[0]}; expected once")
    return baseline


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
        "not-evaluated",
    )
