"""A damage detector in service."""

from __future__ import annotations

import os
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from datetime import timedelta
from numbers import Integral, Real
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone

from skthermo._core.arrays import Array, check_flag
from skthermo._core.estimators import (
    Estimator,
    HasMethods,
    Interval,
    _fit_context,
    check_is_fitted,
    last_step,
    seed_parts,
    seeded,
)
from skthermo._core.frames import (
    DAY,
    YEAR,
    check_duration,
    check_stamp,
    days_later,
    midnight,
    midnights,
    usual_step,
)
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.text import plain
from skthermo._core.warnings import collected, warn_each
from skthermo.exceptions import UnevaluatedRowsWarning
from skthermo.monitoring._corrections import Corrections
from skthermo.monitoring._evaluation import (
    DetectorParts,
    blind_findings,
    causes,
    outages_of,
    refuse_other_batches,
    rounded,
)
from skthermo.monitoring._events import (
    FAULT,
    EventLevels,
    Events,
    SmallestChanges,
    event_changes,
    leading,
    lowered,
    rule_of,
    table_of,
)
from skthermo.monitoring._files import acknowledgements_in, versions, write_monitor
from skthermo.monitoring._means import MeanTest
from skthermo.monitoring._records import (
    OF_TRAINING,
    Lookback,
    compensators_of,
    read_records,
    refuse_other_units,
    sorted_out,
    unknown_months,
    usable_baseline,
    without_what_cannot_be,
    without_wrong_clocks,
)
from skthermo.monitoring._retraining import Retraining, begun_again, retrained
from skthermo.monitoring._status import MonitorStatus, status_of, summary_lines
from skthermo.residuals.weather import BEYOND, TrainingRange


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
        Names of the responses: natural frequencies, or any others of any sign and unit. By default the targets of the
        compensator, else the modes that ``fem`` was fitted on; with a compensator, they have to be its own.
    reference : sequence of str, optional
        Names of columns with temperatures from elsewhere, such as a weather station or a reanalysis. They check the
        thermometers and fill their gaps, and are no inputs of the detector.
    fem : DataInformedFEM, optional
        A fitted chain. With it, slow drift is followed in its parameters; without it, none is.
    false_alarms_per_year : float, default=1.0
        Alarms of a healthy structure in a year, on average: three quarters of them by damage indices, one quarter by
        the mean of the last 30 days (all by damage indices where the baseline is shorter than half a year). At most
        8766, one an hour.
    watch_per_year : float, optional
        A second, lower level: events of kind "watch" that a healthy structure has in a year, more than damage events.
        While one is open, and no damage event is, the state is "watch". By default there is no such level.
    persistence : int or (number, among), default=3
        An event opens where ``number`` of the last ``among`` evaluated records are above the threshold, such as
        ``(4, 6)``. An integer p means p of 2 p - 1: three of five. Single outliers raise no alarm, and a change that
        lasts is found by its third record. 1 means that a single record opens an event.
    max_delay : str or timedelta, default="7D"
        How late records may come and still be evaluated as if they had come in time.
    retention : str or timedelta, default="400D"
        How far back records may train a new detector. All records since the baseline are kept.
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
        A damage event opens with an index above it, of ``number`` of the last ``among`` evaluated records.
    clear_threshold_ : float
        An event closes when, for a day, fewer than ``number`` of the last ``among`` have been above it.
    smallest_changes_ : object
        By how much responses have to fall until enough records are above the threshold (half of them; 58 % for four of
        six), in the weather of the baseline: ``common`` (all by one share), ``single`` (each alone, by name), and
        ``within`` which time an alarm follows. Shares of the mean, or, where not all responses are positive, in their
        units without a ``common`` change. ``groups`` are losses of stiffness by name of the damage group, where the
        detector has directions of such. NaN where none is seen.
    watch_threshold_ : float or None
        An event of kind "watch" opens with an index above it, in the same way; None without ``watch_per_year``.
    baseline_peaks_ : Series
        Highest levels of the index in separate times of the baseline, in descending order: the k-th is exceeded by k
        events in as long a time, if the structure is healthy.
    lookback_ : object
        How far before a record the detector looks.
    events_ : DataFrame
        A row for each cause, counted from 1 by its first sign: ``kind`` ("damage", "drift": the mean of 30 days has
        moved, "watch", or "fault": responses that were set aside as implausible, and alarms that rested on a sensor
        that had failed), ``start`` (first record in alarm), ``end`` (first record after it, NaT while it is open),
        ``peak`` (highest index that ``number`` of the last ``among`` reached; of a drift, the statistic over its
        limit; of a fault, that index or the number of responses set aside), ``peak_time``, ``modes`` (at the peak, or
        the columns at fault) and ``groups`` (of all records in alarm together), as in `update`, ``size`` (loss of
        stiffness of the first of ``groups``, on average; NaN without), ``n_alarms`` (records in alarm), ``n_times``
        (times in alarm), ``acknowledged``, ``harmless`` and ``note``. What comes back in the same direction within four
        weeks, or becomes graver, is the same event.
    days_ : DataFrame
        A row for each day with records: ``n_records``, ``n_evaluated``, ``n_alarms``, ``n_left_out`` (values),
        ``index_median``, ``index_max`` and, where drift is followed, a column ``drift GROUP`` for each group.
    evaluations_ : DataFrame
        The latest evaluation of each record since the baseline, as `update` gives it.
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
        Records of the baseline and those since, both raw, and the latter as the detector sees them.
    last_ : Timestamp
        Stamp of the newest record.
    left_out_ : dict
        Columns of the baseline that cannot be used, each with the reason; nothing is said of them, and `faults_` lists
        them, too.
    set_aside_ : DataFrame
        Values of the baseline that cannot be, and count as missing: a row for each finding, as in
        `~skthermo.preprocessing.RecordFindings`.
    columns_, reference_, features_ : list
        Names of the columns that `fit` saw and `update` expects, names of the ``reference`` among them, and columns
        that the detector sees.
    trained_ : DataFrame
        What the detector in charge was fitted on: the baseline, or what `refit` or `rebaseline` made of it.
    prior_, since_ : DataFrame and Timestamp, or None
        After `rebaseline`: records from before the intervention, and when it was complete.
    versions_ : dict
        Versions of skthermo and scikit-learn by which it was fitted.
    decisions_ : DataFrame
        What was decided of each record since the baseline, from which all events follow: ``index``, also as it
        was before sensors at fault were found, levels of the detector in charge then, and what was left out, held or
        explained.
    means_, weeks_ : DataFrame
        Mean residuals of each day, and the test of the mean of 30 days at the end of each week: ``level`` (the
        statistic over its limit), ``p_value``, ``modes``, and departures of modes and groups.
    mean_test_ : object
        Errors of means, by which the test knows what is chance.
    acknowledgements_ : DataFrame
        What the owner has said: ``kind`` of the event, a ``time`` in it and the newest record ``at`` which it was said
        (both in nanoseconds), ``harmless`` and ``note``.
    transitions_ : tuple of dict
        As `transitions` gives them.
    known_events_ : object
        The events of these decisions, which ``events_`` lists; they are computed anew whenever decisions change.
    restarts_ : tuple of int
        Times (nanoseconds) at which a new baseline has ended all events.
    ahead_ : DataFrame
        Records that are set aside, because they are stamped too far ahead.
    tallies_ : dict
        Numbers of repeated, late and too late records.
    drifts_ : DataFrame
        Share of stiffness of each group, "drift GROUP", that was taken out of the records of each day.
    corrections_, states_, began_ : object, tuple and Timestamp
        Checks of sensors and drift; what they knew at the beginning of each of the last days; and their first day.

    See Also
    --------
    skthermo.detection.CompensatedDetector : Regression, regimes, windows and a detector.

    Notes
    -----
    Any division of records into batches gives the same evaluations, events and daily summaries, bit for bit, as one
    batch of all of them. Lags and windows reach into earlier batches, and into the end of the baseline. Records that
    come late are evaluated with those around them, and later ones anew: what `update` says last of a stamp counts.

    The damage index is rounded to six decimals, and one above 10 to seven digits, as its last bits depend on how many
    records are evaluated at once.

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
    >>> healthy = make_truss_campaign(2, random_state=0)
    >>> records = healthy.temperatures.join(healthy.frequencies)
    >>> compensator = TemperatureCompensator(LinearRegression(), targets=list(healthy.frequencies))
    >>> monitor = Monitor(make_pipeline(compensator, MahalanobisDetector())).fit(records[:365])
    >>> answers = monitor.update(records[365:372])
    >>> monitor.status(monitor.last_).state
    'healthy'
    """

    _parameter_constraints: dict = {
        "detector": [HasMethods(["fit", "score_samples"]), None],
        "targets": ["array-like", None],
        "fem": [HasMethods(["fit", "predict"]), None],
        "false_alarms_per_year": [Interval(Real, 0, 8766, closed="right")],
        "watch_per_year": [Interval(Real, 0, 8766, closed="right"), None],
        "persistence": "no_validation",  # rule_of does
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
        persistence: int | Sequence[int] = 3,
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

    def _validate_params(self) -> None:
        super()._validate_params()
        rule_of(self.persistence)

    @property
    def last_(self) -> pd.Timestamp:
        """Stamp of the newest record."""
        return (self.records_ if len(self.records_) else self.baseline_).index[-1]

    @property
    def events_(self) -> pd.DataFrame:
        """Events, counted from 1, with what the owner has said of them."""
        return self.known_events_.answered.drop(columns=["sign", "at"])

    @property
    def evaluations_(self) -> pd.DataFrame:
        """The latest evaluation of each record."""
        return self.known_events_.evaluations.copy()

    @property
    def days_(self) -> pd.DataFrame:
        """A summary of each day with records."""
        answers = self.known_events_.evaluations
        table = pd.DataFrame(
            {
                "n_records": 1,
                "n_evaluated": answers["state"] != "not evaluated",
                "n_alarms": answers["state"] == "alarm",
                "n_left_out": self.decisions_["n_left_out"],
            }
        ).astype(np.int64)
        day = midnights(answers.index).rename("day")
        index = answers["index"].groupby(day)
        table = table.groupby(day).sum().assign(index_median=index.median(), index_max=index.max())
        return table.join(self.drifts_)

    @property
    def counts_(self) -> dict[str, int]:
        """Numbers of records that came, and what became of them."""
        n_outside = self.tallies_["n_too_late"] + len(self.ahead_)
        return {
            "n_records": len(self.decisions_) + n_outside,
            **self.tallies_,
            "n_ahead": len(self.ahead_),
            "n_not_evaluated": int((self.known_events_.evaluations["state"] == "not evaluated").sum()) + n_outside,
            "n_left_out": int(self.decisions_["n_left_out"].sum()),
        }

    @property
    def faults_(self) -> pd.DataFrame:
        """Sensors that have failed, columns that are left out first."""
        found = self.corrections_.faults(self.states_[-1])
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
        follower = self.corrections_.drift
        return None if follower is None else follower.report(self.states_[-1].drift)

    def __sklearn_clone__(self) -> Monitor:
        return type(self)(
            **self.get_params(deep=False) | {"detector": clone(self.detector, safe=False)}
        )  # the chain is shared

    def __getstate__(self) -> dict[str, Any]:
        state = super().__getstate__()
        state.pop("known_events_", None)  # they follow from what is saved
        if "trained_" in state and self.trained_ is self.baseline_:  # most often: saved once
            state["trained_"] = None
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        if state.get("trained_", self) is None:
            self.trained_ = self.baseline_
        if "decisions_" in state:
            self._tell()

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
            not the targets of the compensator; if values make the baseline useless, such as kelvin or a frequency of
            1e6 (the error lists them all); if the detector looks at later records, farther back than its parts tell, or
            drops large changes.

        Warns
        -----
        UserWarning
            As the detector does; if values are no measurements and are taken as missing; if the detector does not see
            even large changes of a response.
        """
        for name in ("max_delay", "retention"):
            check_duration(getattr(self, name), name)
        if self.watch_per_year is not None and not self.watch_per_year > self.false_alarms_per_year:
            raise ValueError(
                f"watch_per_year is {self.watch_per_year:g} and false_alarms_per_year {self.false_alarms_per_year:g}; "
                "expected more watches than alarms a year, such as 12 and 1"
            )
        given, of_clocks = without_wrong_clocks(X, read_records(X))
        if not len(given):
            raise ValueError(
                "the baseline has no records; expected records of the healthy structure, of a year if possible"
            )
        if given.index.has_duplicates:
            again = given.index[given.index.duplicated()]
            raise ValueError(
                f"{len(again)} stamps of the baseline are there twice, the first {again[0]}; expected once"
            )
        with collected() as findings:
            baseline, detector, targets, units, found = usable_baseline(self, given)
            seed_parts(detector, seeded(self.random_state))
            self.columns_, self.left_out_, aside = list(given.columns), found.left_out, found.table
            self.targets_, self.units_ = targets, units
            self.reference_ = [name for name in baseline if name in (self.reference or [])]
            self.set_aside_ = aside[~aside["column"].isin(list(self.left_out_))].reset_index(drop=True)
            self.baseline_, self.prior_, self.since_ = baseline, None, None
            trained = baseline.drop(columns=self.reference_) if self.reference_ else baseline
            self.features_ = list(trained) if compensators_of(detector) else targets
            detector.fit(trained[self.features_])
        findings += [*of_clocks, *self._take_charge(detector, trained)]
        refuse_other_batches(self._index, trained, self.lookback_)
        findings += blind_findings(self._index, trained, self.targets_, self.lookback_, self.threshold_)
        self._begin_service(self.fem)
        self.versions_ = versions()
        warn_each(findings)
        return self

    def _begin_service(self, fem: Any) -> None:
        """Forget all records since the baseline, if there are any."""
        nothing = self.baseline_.iloc[:0]
        self.records_ = self.ahead_ = nothing
        self.corrected_ = nothing.drop(columns=self.reference_)
        self.means_, self.transitions_ = nothing[self.targets_], ()
        said = table_of([], {"kind": object, "time": np.int64, "at": np.int64, "harmless": bool, "note": object})
        weeks = self.mean_test_.weeks(self.means_, ())
        self._tell(decisions_=self._decisions(nothing.index), weeks_=weeks, acknowledgements_=said, restarts_=())
        self.tallies_ = dict.fromkeys(("n_repeated", "n_late", "n_too_late"), 0)
        self._begin_corrections(self.baseline_, fem)
        self.drifts_ = self.corrections_.drifts(self.states_)[:0]

    def _begin_corrections(self, baseline: pd.DataFrame, fem: Any) -> None:
        """Watch sensors and drift anew, from the newest day on."""
        options = {"fem": fem, "sensors": self.sensors}
        self.corrections_ = Corrections.learned(baseline, self.targets_, self.reference_, self.units_, **options)
        self.began_ = midnight(self.last_)
        self.states_ = (self.corrections_.start(self.began_),)

    def _take_charge(self, detector: Any, trained: pd.DataFrame) -> list[Any]:
        """Put a fitted detector in charge, with the levels of its events; what is doubtful about them."""
        self.detector_, self.trained_ = detector, trained
        self.lookback_ = Lookback.learned(detector)
        if self.lookback is not None:
            self.lookback_ = Lookback(0, check_duration(self.lookback, "lookback"))
        index = pd.Series(last_step(detector).baseline_index_, trained.index)
        parts, slow = self._parts, 0.25  # of the false alarms that are asked for
        self.mean_test_ = MeanTest.learned(parts, slow * self.false_alarms_per_year, self.since_)
        share = 1.0 if self.mean_test_.errors is None else 1 - slow
        levels = EventLevels.learned(index, self.false_alarms_per_year, self.persistence, share)
        self.threshold_, self.clear_threshold_ = levels.threshold, levels.release
        self.false_alarm_estimate_, self.baseline_peaks_ = levels.estimate, levels.peaks
        self.watch_threshold_ = None
        if self.watch_per_year is not None:
            watch = EventLevels.learned(index, self.watch_per_year, self.persistence)
            self.watch_threshold_ = min(watch.threshold, self.threshold_)
        step = usual_step(trained.index)
        number, among = rule_of(self.persistence)
        window = parts.window() if self.lookback is None else self.lookback_
        within, share_above = window.duration(step) + among * step, (number - 0.5) / among
        self.smallest_changes_ = SmallestChanges.measured(
            self._index, trained, self.targets_, self.threshold_, within, share_above, parts.groups
        )
        return [*levels.findings(self.smallest_changes_), *unknown_months(trained[self.targets_])]

    def _index(self, records: pd.DataFrame) -> Array:
        """Damage indices of records in order of time, by the detector in charge."""
        with collected(drop_others=True):  # the reason of each record stands for a warning of the detector
            return -np.asarray(self.detector_.score_samples(records[self.features_]), dtype=float)

    @property
    def _parts(self) -> DetectorParts:
        return DetectorParts(self.detector_, self.targets_, self.trained_)

    def _twin(self) -> Monitor:
        """A monitor that stands as this one, to be changed in its place: an error leaves this one as it was."""
        twin = object.__new__(type(self))
        vars(twin).update(vars(self))
        return twin

    def _tell(self, **changed: Any) -> None:
        """Change the tables of decisions, and tell the events that follow from them."""
        vars(self).update(changed)
        tables = self.decisions_, self.weeks_, self.acknowledgements_
        self.known_events_ = Events(*tables, self.persistence, self.restarts_)

    def _decisions(self, stamps: pd.DatetimeIndex, **columns: Any) -> pd.DataFrame:
        """A row for each record: its index, the levels of events, and what becomes of it."""
        watch = np.nan if self.watch_threshold_ is None else self.watch_threshold_
        levels = {"threshold": self.threshold_, "release": self.clear_threshold_, "watch": watch}
        levels["watch_release"] = min(watch, self.clear_threshold_)
        texts = dict.fromkeys(("modes", "held", "at_fault", "reason"), "")
        values = (
            {"index": np.nan, "index_then": np.nan}
            | levels
            | {"n_held": 0.0, "is_blind": False, "n_left_out": 0}
            | texts
            | columns
        )
        kinds = {"is_blind": bool, "n_left_out": np.int64} | dict.fromkeys(texts, object)
        return pd.DataFrame(values, stamps).astype({name: kinds.get(name, float) for name in values})

    def _decide(self, first: pd.Timestamp) -> pd.Timestamp:
        """Evaluate the records from a stamp on anew, or from when a sensor had failed before it; gives that stamp."""
        earlier = [one for one in self.states_ if one.day <= first]
        begin = earlier[-1] if earlier else self.corrections_.start(min(self.began_, midnight(first)))
        raw = self.records_[self.records_.index >= begin.day]
        if not len(raw):
            self.states_ = (begin,)
            return first
        states = self.corrections_.advanced(begin, raw)
        first = midnight(min([first, *changed_times(self._faults_of(self.states_[-1]), self._faults_of(states[-1]))]))
        restarts = self.restarts_
        if restarts:  # records that the detector of a new baseline evaluates are in no event from before
            restarts = (*restarts[:-1], min(restarts[-1], first.as_unit("ns").value))
        before = self.drifts_[self.drifts_.index < begin.day]
        self.drifts_ = pd.concat([before, self.corrections_.drifts(states)])
        states = [*(one for one in earlier if one.day < begin.day), *states]
        n_old = sum(one.day <= self.last_ - check_duration(self.max_delay, "max_delay") for one in states)
        self.states_ = tuple(states[max(n_old - 1, 0) :])
        seen, notes = self._corrected(self.records_[self.records_.index >= first])
        self.corrected_ = pd.concat([self.corrected_[self.corrected_.index < first], seen])
        new = self._decided(first, notes)
        weeks = self.weeks_[self.weeks_.index <= first]
        weeks = pd.concat([weeks, self.mean_test_.weeks(self.means_, self._test_times(weeks.index))])
        decisions = pd.concat([self.decisions_[self.decisions_.index < first], new])
        self._tell(decisions_=decisions, weeks_=weeks, restarts_=restarts)
        self._explain(first)
        return first

    def _faults_of(self, state: Any) -> Sequence[Any]:
        return () if state.sensors is None else state.sensors.faults

    def _corrected(self, raw: pd.DataFrame, **options: bool) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Records as the detector sees them by all that is known now, and what became of their values."""
        said = self.acknowledgements_[self.acknowledgements_["kind"] == FAULT].drop_duplicates("time", keep="last")
        at, faults = said["at"][said["harmless"]].tolist(), self._faults_of(self.states_[-1])
        return self.corrections_.corrected(faults, raw, self.drifts_, at, **options)

    def _decided(self, first: pd.Timestamp, notes: pd.DataFrame) -> pd.DataFrame:
        """Decisions on the records from a stamp on, but for what explains an event."""
        n_before = self.corrected_.index.searchsorted(first)
        records, place = self._with_memory(n_before)
        new = records.iloc[place:]
        temperatures = [name for name in new if name not in self.targets_]
        index = rounded(self._index(records)[place:])
        known = self.trained_[self.targets_].notna().any(axis=1).to_numpy()
        weather = TrainingRange.spanned(self.trained_[temperatures], known)
        is_outside = (np.nan_to_num(weather.excess(new[temperatures])) > BEYOND).any(axis=1)
        fall, is_blind = max(3 * self.smallest_changes_.common, 0.05), np.zeros(len(new), dtype=bool)
        if is_outside.any() and np.isfinite(self.smallest_changes_.common):
            fallen = lowered(records, {name: fall * records[name] for name in self.targets_})
            is_blind = is_outside & (self._index(fallen)[place:] <= self.threshold_) & (notes["n_held"] == 0)
        remarks = {
            "extrapolated: temperatures outside the range of the baseline": is_outside,
            f"even a fall of all responses by {100 * fall:.2g} % would stay undetected": is_blind,
        }
        regime = getattr(last_step(self.detector_), "regime_", None)
        said = [causes(new, self.targets_, temperatures, index, self._outages(), regime), notes["note"]]
        said += [np.where(rows, text, "") for text, rows in remarks.items()]
        reason = ["; ".join(filter(None, parts)) for parts in zip(*said, strict=True)]
        then = self._index_then(records, place, index)
        columns = {"index": index, "index_then": then, "is_blind": np.asarray(is_blind), "reason": reason}
        if self.mean_test_.errors is not None:
            rest = self._parts.residuals(records[self.features_]).iloc[place:]
            rest = rest[~is_outside]
            rest = rest + self.corrections_.shifts(self.drifts_, rest.index)  # what is taken out counts
            means = rest.groupby(midnights(rest.index)).mean()
            self.means_ = pd.concat([self.means_[self.means_.index < first], means])
        return self._decisions(new.index, **columns, **notes.drop(columns="note"))

    def _outages(self) -> list[tuple[pd.Timestamp, Any, Any]]:
        """Outages since the baseline: the first stamp after each, the last that reaches into it, and its length."""
        step, known = usual_step(self.trained_.index), self.corrected_.notna().any(axis=1)
        times = self.baseline_.index[-1:].append(self.corrected_.index[known])
        return outages_of(times, step, self.lookback_.duration(step))

    def _index_then(self, records: pd.DataFrame, place: int, index: Array) -> Array:
        """Damage indices as they were before sensors at fault had been found."""
        raw = self.records_[self.records_.index >= records.index[0]]
        then = self._corrected(raw, once_found=True)[0]
        if then.equals(records.loc[raw.index]):
            return index
        return rounded(self._index(pd.concat([records[records.index < raw.index[0]], then]))[place:])

    def _test_times(self, known: pd.DatetimeIndex) -> list[pd.Timestamp]:
        """When means of the last days are to be tested after those that are known: each week of service."""
        begin, last = midnight(self.baseline_.index[-1]), self.last_
        first = round((known[-1] - begin) / (7 * DAY)) + 1 if len(known) else 1
        times = (days_later(begin, 7 * number) for number in range(first, (last - begin) // (7 * DAY) + 2))
        return [time for time in times if time <= last]

    def _with_memory(self, n_before: int) -> tuple[pd.DataFrame, int]:
        """Records as the detector sees them, from those on that it looks back to, and the position of the first."""
        n = len(self.baseline_)
        times = np.concatenate([self.baseline_.index.asi8, self.corrected_.index.asi8])
        start = self.lookback_.start(times, n + n_before)
        memory = self.corrections_.cleaned(self.baseline_.iloc[start:])[list(self.corrected_.columns)]
        recent = self.corrected_.iloc[max(start - n, 0) :]
        return (pd.concat([memory, recent]) if len(memory) else recent), n + n_before - start

    def _explain(self, first: pd.Timestamp) -> None:
        """Name what drives the open events of the records from a stamp on."""
        is_raised = self.known_events_.is_raised() & self.decisions_["index"].notna().to_numpy()
        rows = np.flatnonzero(is_raised & (self.decisions_.index >= first))
        if not len(rows):
            return
        records, place = self._with_memory(int(rows[0]))
        places = place + rows - rows[0]
        records = records.iloc[: places[-1] + 1]
        parts, seen = self._parts, records[self.features_]
        sizes = parts.residuals(seen, in_windows=True).to_numpy()[places] / parts.scales
        sizes = pd.DataFrame(np.round(np.nan_to_num(sizes), 2), columns=list(map(str, self.targets_)))
        found = parts.effects(seen).iloc[places]
        modes = [leading(row) for _, row in sizes.abs().iterrows()]
        found = found.join(sizes.add_prefix("departure ").set_axis(found.index)).assign(modes=modes)
        found = found.astype({"modes": object})
        decisions = self.decisions_.reindex(
            columns=[*self.decisions_, *found.columns.difference(self.decisions_.columns)]
        )
        decisions.loc[found.index, found.columns] = found
        self._tell(decisions_=decisions)

    def _become(self, after: Monitor, first: pd.Timestamp, **done: Any) -> None:
        """Stand as a changed twin does; changes from a stamp on join the transitions, after what was ``done``."""
        old, new = (one.known_events_.table for one in (self, after))
        found = [*event_changes(old[~(old["end"] < first)], new[~(new["end"] < first)])]
        found = sorted([*found, *fault_changes(self.faults_, after.faults_, after.last_)], key=lambda one: one["time"])
        usual = {"id": 0, "what": "", "time": after.last_, "newest": after.last_, "kind": "", "event": 0}
        for number, one in enumerate([done, *found] if done else found, len(self.transitions_) + 1):
            entry = plain(usual | {"column": "", "detail": ""} | one | {"id": number})
            after.transitions_ = (*after.transitions_, entry)
        vars(self).update(vars(after))

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
            On the stamps of new records, and of known ones that are evaluated anew because others came late or a sensor
            was found to have failed: ``state`` ("healthy", "watch", "drift", "known damage", "alarm" or "not
            evaluated"), ``index`` (damage index), ``threshold``, ``modes`` (names
            of the modes that drive an alarm, the worst first), ``groups`` (of a directional detector with damage
            groups: those whose losses explain most of an alarm, "" where none do; "a or b" cannot be distinguished),
            ``reason`` (why a record is not evaluated, or what else is worth saying), ``event`` (its number in
            ``events_``, 0 for none), ``revised`` (whether it was evaluated before).

        Raises
        ------
        ValueError
            If the records are no frame on a ``DatetimeIndex`` with the columns and the time zone of the baseline; if a
            known stamp comes with other values; if all temperatures are in degrees Fahrenheit, kelvin or tenths of a
            degree. The monitor then stays as it was.

        Warns
        -----
        UserWarning
            If new records are not evaluated: how many, and why.
        """
        check_is_fitted(self)
        max_delay = check_duration(self.max_delay, "max_delay")
        tables, are_confirmed = (self.baseline_, self.records_, self.ahead_), check_flag(confirm, "confirm")
        records, ahead, reasons, numbers = sorted_out(self._read(new), *tables, max_delay, are_confirmed=are_confirmed)
        refuse_other_units(records.drop(columns=self.targets_), self.baseline_.drop(columns=self.targets_))
        after, fresh = self._twin(), records.index
        after.tallies_ = {name: known + numbers[name] for name, known in self.tallies_.items()}
        after.ahead_, refused = ahead, self._decisions(reasons.index, reason=reasons.to_numpy())
        answers = Events(refused, self.weeks_[:0], self.acknowledgements_, 1).evaluations.assign(revised=False)
        if len(fresh):
            known = pd.concat([self.records_, records])
            after.records_ = known if known.index.is_monotonic_increasing else known.sort_index()
            first = after._decide(fresh[0])
            was, now = (one.known_events_.evaluations for one in (self, after))
            news = _news(was[was.index >= first], now[now.index >= first], fresh)
            answers = pd.concat([news, answers]).sort_index(kind="stable") if len(answers) else news
        warn_each(_not_evaluated(answers))
        self._become(after, fresh[0] if len(fresh) else self.last_)
        return answers

    def status(self, now: Any = None, *, max_age: str | timedelta | None = None) -> MonitorStatus:
        """The state at a time, and the facts behind it, for machines.

        Parameters
        ----------
        now : str or datetime, optional
            The time, such as the stamp of the newest record, ``last_``. By default the computer's clock tells it; if
            the records have no time zone, the local time.
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
            "opened", "closed", "reopened", "became" (of another kind, such as a watch that becomes damage) or
            "withdrawn" (late records, or a sensor that has failed, have shown that there was no event), "acknowledged",
            "fault" or "put back" (a sensor), "refit", "rebaseline" or "discarded". ``time``: when it happened, by the
            stamps of the records. ``newest``: the newest record when it was reported. ``event``: the number of the
            event, 0 for none. ``kind``: kind of the event or fault. ``column``: the sensor, else "". ``detail``: text.

        Raises
        ------
        ValueError
            If ``after`` is not a number from 0 to the number of the newest entry.

        Notes
        -----
        Entries are saved with the monitor. A reader that remembers the last number it has seen misses none and gets
        none twice, also if it was stopped in between.
        """
        check_is_fitted(self)
        n = len(self.transitions_)
        if isinstance(after, bool) or not isinstance(after, Integral) or not 0 <= after <= n:
            raise ValueError(f"after is {after!r}; expected a number of a transition from 0 to {n}")
        return [dict(one) for one in self.transitions_[after:]]

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

    def acknowledge(self, event: int, *, harmless: bool, note: str = "") -> None:
        """Record what the owner has found out about an event.

        Parameters
        ----------
        event : int
            Its number in ``events_``.
        harmless : bool
            Whether the structure is as before: records of a harmless event may train a new detector. Of an event of
            kind "fault", that sensors are at fault: from the next record on, the other responses are evaluated without
            them. Of damage or drift that is not harmless, the state is "known damage" until `rebaseline`. Either answer
            holds up to one and a half times the index that was reached before.
        note : str, default=""
            What was found.

        Raises
        ------
        ValueError
            If there is no such event.
        """
        check_is_fitted(self)
        events = self.events_
        if isinstance(event, bool) or not isinstance(event, Integral) or not 1 <= event <= len(events):
            raise ValueError(f"event is {event!r}; expected the number of one of the {len(events)} events, from 1")
        if not isinstance(note, str):
            raise ValueError(f"note is {note!r:.100}; expected text")
        one, after = events.loc[event], self._twin()
        after._say(one["kind"], one["peak_time"], check_flag(harmless, "harmless"), note)
        self._become(after, self.last_, what="acknowledged", kind=one["kind"], event=int(event), detail=note)

    def _say(self, kind: str, time: pd.Timestamp, harmless: bool, note: str) -> None:
        """Note the owner's answer to the event of a kind at a time, at the time of the newest record."""
        row = {"kind": kind, "time": time.value, "at": self.last_.value, "harmless": harmless, "note": note}
        said = pd.DataFrame([row]).astype(self.acknowledgements_.dtypes)
        self._tell(acknowledgements_=pd.concat([self.acknowledgements_, said], ignore_index=True))

    def keep_acknowledgements(self, path: str | os.PathLike[str]) -> int:
        """Take over what the owner has said of events, from the file of an earlier monitor of the structure.

        Parameters
        ----------
        path : str or path
            The file of `save`, also one that version 0.2 has written with the ending ``.joblib``.

        Returns
        -------
        int
            Number of acknowledgements. Each holds for an event of the same kind at the same time.

        Raises
        ------
        ValueError
            If the file cannot be read.
        """
        check_is_fitted(self)
        said = acknowledgements_in(path).astype(self.acknowledgements_.dtypes)
        self._tell(acknowledgements_=pd.concat([said, self.acknowledgements_], ignore_index=True))
        return len(said)

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
            If there is no such record since the baseline.

        Notes
        -----
        The monitor is then as if these records had never come: those that stay are evaluated anew from there on by the
        detector in charge, and the newest record is the newest of them. Records that were refused as too late because
        of wrong stamps can come again. What was acknowledged stays, and `transitions` lists what changes.
        """
        check_is_fitted(self)
        stamps = self.baseline_.index
        first, last = check_stamp(start, stamps, "start"), None if end is None else check_stamp(end, stamps, "end")

        def others(table: pd.DataFrame) -> pd.DataFrame:
            return table[(table.index < first) | (False if last is None else table.index > last)]

        after = self._twin()
        after.records_, after.ahead_ = others(self.records_), others(self.ahead_)
        after.corrected_ = others(self.corrected_)
        after._tell(decisions_=others(self.decisions_))
        n_discarded = len(self.records_) - len(after.records_) + len(self.ahead_) - len(after.ahead_)
        if not n_discarded:
            until = "on" if last is None else f"to {last}"
            raise ValueError(f"no record since the baseline is stamped {first} {until}; expected some to be discarded")
        after._decide(min(first, midnight(after.last_)))
        self._become(after, first, what="discarded", time=first, detail=f"records: {n_discarded}")
        return n_discarded

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
            Whether it took over, why not, how the modes have changed, and what was left out. If refused, nothing has
            changed.

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
            records = self.corrections_.cleaned(records)
        retraining = retrained(self, records, until=until, force=check_flag(force, "force"))
        if retraining.accepted:
            self._take_over(retraining)
        return retraining

    def rebaseline(self, since: Any, *, until: Any = None) -> Retraining:
        """Begin a new baseline after an intervention that has changed the structure, such as a repair.

        Parameters
        ----------
        since : str or Timestamp
            When the intervention was complete. Records from then on show the structure as it is now.
        until : str or Timestamp, optional
            The last moment whose records may train; by default all may.

        Returns
        -------
        Retraining
            The change of each mode's level, and what was left out.

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
        retraining = begun_again(self, since, until=until)
        if retraining.accepted:
            self._take_over(retraining)
        return retraining

    def _read(self, records: pd.DataFrame) -> pd.DataFrame:
        """Records in the columns of `fit`, without those that are left out."""
        return read_records(records, self.columns_, self.baseline_.index.tz).drop(columns=list(self.left_out_))

    def _take_over(self, retraining: Retraining) -> None:
        """Put a retrained detector in charge, from the newest day on."""
        after, trained, today = self._twin(), retraining.baseline, midnight(self.last_)
        after.prior_, after.since_ = retraining.prior, retraining.since
        after._take_charge(retraining.detector, trained)
        if retraining.kind == "new baseline":
            events = self.events_
            for _, event in events[events["end"].isna() & ~events["acknowledged"]].iterrows():
                after._say(
                    event["kind"], event["peak_time"], True, f"ended by the new baseline since {retraining.since}"
                )
            restarts, weeks = (*self.restarts_, today.as_unit("ns").value), self.weeks_[self.weeks_.index < today]
            after.means_ = self.means_[:0]
            after._tell(restarts_=restarts, weeks_=weeks)
            raw = pd.concat([self.baseline_, self.records_])[self.reference_]
            T, F = trained.drop(columns=self.targets_), trained[self.targets_]
            fem = None if self.fem is None else clone(self.fem).fit(T, F)  # the chain of the structure as it is now
            after._begin_corrections(trained.join(raw)[list(self.baseline_.columns)], fem)
        after._decide(today)
        what = "rebaseline" if retraining.kind == "new baseline" else retraining.kind
        self._become(after, today, what=what, kind=retraining.kind)

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


def _news(before: pd.DataFrame, after: pd.DataFrame, fresh: pd.DatetimeIndex) -> pd.DataFrame:
    """Evaluations of new records, and of known ones whose evaluation has changed."""
    answers, is_new = after, after.index.isin(fresh)
    old = before.reindex(index=answers.index, columns=answers.columns)
    is_same = ((answers == old) | (answers.isna() & old.isna())).all(axis=1).to_numpy()
    return answers.assign(revised=~is_new & ~is_same)[is_new | ~is_same]


def _not_evaluated(answers: pd.DataFrame) -> Iterable[UnevaluatedRowsWarning]:
    """The finding of new records that are not evaluated."""
    new = answers[~answers["revised"]]
    unknown = new[new["state"] == "not evaluated"]
    if len(unknown):
        counts = unknown["reason"].value_counts()[:3]
        yield UnevaluatedRowsWarning(
            f"{len(unknown)} of {len(new)} new records are not evaluated, the first {unknown.index[0]}: "
            f"{'; '.join(f'{n} because {cause}' for cause, n in counts.items())}",
            "not-evaluated",
        )


def changed_times(before: Sequence[Any], after: Sequence[Any]) -> Iterator[pd.Timestamp]:
    """From when on what is known of faults of sensors has changed."""
    for fault in {*before} ^ {*after}:
        yield fault.since if fault.until is None or fault not in {*after} else min(fault.since, fault.until)


def fault_changes(before: pd.DataFrame, after: pd.DataFrame, newest: pd.Timestamp) -> Iterable[dict[str, Any]]:
    """Sensors that have failed, in another way than before perhaps, and those that are used again."""
    for row in range(max(len(before), len(after))):
        old, new = (table.iloc[row] if row < len(table) else None for table in (before, after))
        was_open = old is not None and pd.isna(old["until"])
        if new is None:
            if was_open:
                yield {"what": "put back", "time": newest, "kind": old["kind"], "column": str(old["column"])}
            continue
        about = {"kind": new["kind"], "column": str(new["column"])}
        is_open, is_same = pd.isna(new["until"]), old is not None and old["kind"] == new["kind"]
        if not is_same or (is_open and not was_open):
            yield {"what": "fault", "time": new["since"], "detail": new["detail"]} | about
        if not is_open and (was_open or not is_same):
            yield {"what": "put back", "time": new["until"]} | about
