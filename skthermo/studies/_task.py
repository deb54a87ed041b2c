"""detection_task: labelled records on which the searches of scikit-learn tune a detector, and their score."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, clone
from sklearn.pipeline import Pipeline
from sklearn.utils import Bunch

from skthermo._core.arrays import as_floats, as_random_state, check_names, check_probability, positive_integer
from skthermo._core.estimators import BaseSearchCV, _num_samples, last_step
from skthermo._core.frames import Table, has_stamps, row_times, time_of
from skthermo._core.parallel import single_blas_thread
from skthermo._core.warnings import collected, warn_each
from skthermo.exceptions import ResultWarning, SkthermoWarning, WeatherWarning
from skthermo.preprocessing.checks import set_aside
from skthermo.studies._rates import rate_of
from skthermo.studies._scenarios import BaseScenario, check_chain, read_scenarios
from skthermo.studies._simulation import Simulation, baseline_table, has_targets, scatter_of, sensors_of
from skthermo.studies._study import check_detector
from skthermo.surrogate import DataInformedFEM


@dataclass(frozen=True, eq=False)
class Decisions:
    """A detector's decisions on simulated records in order of time, with the label of each and the numbers of its
    scenario and its repeat.

    Negative decisions are alarms, NaN where a record is not evaluated; labels are +1 (healthy) and -1 (damaged).
    """

    values: NDArray[np.float64]
    labels: NDArray[np.intp]
    scenario: NDArray[np.intp]
    repeat: NDArray[np.intp]

    def score(self, limit: float) -> float:
        """Share of the damaged records found within the limit, times what the detector is worth."""
        return self.found(limit) * self.worth(limit)

    def worth(self, limit: float) -> float:
        """1, or the limit over the lower bound of the false alarms where this is more: the detector will work with its
        own threshold, not with a raised one."""
        return limit / max(self.false_alarms()["ci_low"], limit)

    def found(self, limit: float) -> float:
        """Share of the damaged records in alarm, mean over scenarios; the threshold is raised where the limit asks."""
        return float(np.mean([pod["rate"] for pod in self.pods(limit)]))

    def pods(self, limit: float, confidence: float = 0.95, drawn: Collection[int] = ()) -> list[dict[str, Any]]:
        """That share with bounds by scenario; what is not evaluated is not found. Repeats of those ``drawn`` differ."""
        missed = np.where(np.isnan(self.values), 0.0, self.values - self.raised(limit))
        damaged = {
            one: (self.labels == -1) & (self.scenario == one) for one in np.unique(self.scenario[self.labels == -1])
        }
        return [rate_of(self.by_repeat(missed, rows), confidence, one in drawn) for one, rows in damaged.items()]

    def raised(self, limit: float) -> float:
        """Decision below which there is an alarm: 0, or less where more healthy records than the limit lie below."""
        healthy = self.values[self.healthy()]
        evaluated = np.sort(healthy[~np.isnan(healthy)])
        if not evaluated.size:
            raise ValueError(f"none of {len(healthy)} healthy records is evaluated; expected one or more")
        return float(min(evaluated[int(limit * len(evaluated) + 1e-9)], 0.0))

    def false_alarms(self, confidence: float = 0.95) -> dict[str, Any]:
        """Share of the evaluated healthy records beyond the detector's own threshold, with bounds."""
        return rate_of(self.by_repeat(self.values, self.healthy()), confidence)

    def healthy(self) -> NDArray[np.bool_]:
        """Healthy records of the scenario that has most; those of others are the same records with the same noise."""
        return (self.labels == 1) & (self.scenario == np.bincount(self.scenario[self.labels == 1]).argmax())

    def by_repeat(self, values: NDArray[np.float64], rows: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Values of some records, (n_repeats, n_records); in one row where repeats differ in number."""
        counts = np.unique(self.repeat[rows], return_counts=True)[1]
        return values[rows].reshape(len(counts) if np.ptp(counts) == 0 else 1, -1)


@dataclass(frozen=True, eq=False)
class TaskScorer:
    """Scores a fitted detector on simulated records of a task, each state by itself.

    ``states`` has the label, scenario and repeat of all simulated records.
    """

    states: pd.DataFrame
    sensors: Sequence[Hashable]
    max_false_alarms: float

    def __call__(self, estimator: BaseEstimator, X: pd.DataFrame, y: ArrayLike | None = None) -> float:
        """Share of the damaged records that are found within the limit of false alarms."""
        return self.decisions(estimator, X, y).score(self.max_false_alarms)

    def decisions(self, estimator: BaseEstimator, X: pd.DataFrame, y: ArrayLike | None = None) -> Decisions:
        """Decisions on rows of the task; lags and windows of a state see no record of another."""
        check_detector(estimator, "the detector")
        self._check_columns(estimator, X)
        rows = self._rows(X)
        labels = self.states["label"].to_numpy()[rows] if y is None else np.asarray(y)
        missing = [name for name, label in (("healthy", 1), ("damaged", -1)) if not (labels == label).any()]
        if missing:
            raise ValueError(f"none of {len(labels)} rows is {missing[0]}; expected the rows of a split of the task")
        order, values = np.argsort(rows, kind="stable"), []
        states = self.states.iloc[rows[order]]
        repeat, scenario = states["repeat"].to_numpy(), states["scenario"].cat.codes.to_numpy()
        of_first_rows, findings = ("not-evaluated", "no-earlier-records"), list[SkthermoWarning]()
        for one in np.split(order, np.flatnonzero(np.diff(repeat) | np.diff(scenario)) + 1):
            with collected() as found:
                values.append(np.asarray(estimator.decision_function(X.iloc[one]), dtype=float))
            is_none = np.isnan(values[-1]).all()
            findings += [finding for finding in found if is_none or finding.kind not in of_first_rows]
        warn_each(findings)
        return Decisions(np.concatenate(values), labels[order], scenario, repeat)

    def _rows(self, X: Table) -> NDArray[np.intp]:
        """Positions of the rows among the simulated ones."""
        if not isinstance(X, pd.DataFrame):
            raise ValueError(f"X is of type {type(X).__name__}; expected a frame: rows of the task's X, with its index")
        rows = self.states.index.get_indexer(X.index)
        if (rows < 0).any():
            raise ValueError(
                f"{(rows < 0).sum()} of {len(rows)} rows are no simulated records of the task, the first "
                f"{X.index[(rows < 0).argmax()]}; expected rows of the task's X, split by its cv, and no score of the "
                "baseline on which a detector is fitted (return_train_score=False)"
            )
        return rows

    def _check_columns(self, estimator: BaseEstimator, X: Table) -> None:
        """Refuse a detector that would take temperatures for frequencies."""
        seen = [name for name in self.sensors if name in getattr(X, "columns", ())]
        if seen and not (has_targets(estimator) or isinstance(estimator, Pipeline)):
            raise ValueError(
                f"X has the temperatures {seen}, and the detector {estimator!r:.200} would take them for "
                "frequencies; expected a task with columns=modes, or a pipeline with a TemperatureCompensator"
            )


class DetectionTask(Bunch):
    """Labelled records, measured and simulated, on which a detector is tuned; `detection_task` makes it.

    Parameters
    ----------
    **kwargs : dict
        The attributes.

    Attributes
    ----------
    X : DataFrame of shape (n_records, n_columns)
        Temperatures in degrees Celsius beside frequencies in Hz: the baseline, then all scenarios of the first repeat,
        of the second, and so on.
    y : Series of shape (n_records,)
        +1 for healthy records, -1 for damaged ones.
    cv : list of (ndarray, ndarray)
        Positions of the baseline, on which a detector is fitted, and of the simulated records of some repeats, by which
        it is evaluated.
    scoring : callable
        ``scoring(detector, X, y)``: share of the damaged records found within the limit of false alarms.
    baseline : DataFrame
        The measured records in ``X``.
    states : DataFrame of shape (n_records, 2)
        Name of the ``scenario`` (missing for the baseline) and number of the ``repeat`` (-1) of each record.

    fem, T, scenarios, measurement, seeds : object
        What the records were simulated with.

    See Also
    --------
    detection_task : Makes it, and says what the score is.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector
    >>> from skthermo.studies import detection_task, sweep
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year, weather = make_truss_campaign(random_state=0), make_truss_campaign(random_state=1).temperatures
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> scenarios = [{}, {"bottom": 0.2}]
    >>> task = detection_task(fem, weather, scenarios, columns=fem.mode_names_, n_repeats=2, random_state=0)
    >>> detector = task.refit(MahalanobisDetector())
    >>> train, test = task.cv[0]
    >>> print(f"{task.scoring(detector, task.X.iloc[test], task.y.iloc[test]):.1f} found")
    0.9 found
    """

    X: pd.DataFrame
    y: pd.Series
    cv: list[tuple[NDArray[np.intp], NDArray[np.intp]]]
    scoring: TaskScorer
    baseline: pd.DataFrame
    states: pd.DataFrame

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)

    def refit(self, detector: BaseEstimator) -> BaseEstimator:
        """A detector, or the best one of a search, fitted to the baseline alone.

        Parameters
        ----------
        detector : detector or search
            A detector with the settings that it shall have, or a fitted search.

        Returns
        -------
        detector
            A clone, fitted to ``baseline``.

        Raises
        ------
        ValueError
            If there is no such detector, or a search that is not fitted or has no score.

        Warns
        -----
        UserWarning
            If the search has fitted its best detector to all records of the task, damaged ones among them, as those of
            other libraries are, which ignore ``y``.
        """
        if isinstance(detector, BaseSearchCV):
            if not hasattr(detector, "best_params_"):
                raise ValueError(f"{detector!r:.200} has no best_params_; expected a search that is fitted")
            if not np.isfinite(getattr(detector, "best_score_", 0.0)):
                raise ValueError(
                    f"the best score of {detector!r:.200} is no number; expected a search that could evaluate some "
                    "setting, by the task's scoring, of a detector that learns the modes and not temperatures"
                )
            if hasattr(detector, "best_estimator_") and not hasattr(last_step(detector), "damage_index"):
                text = (
                    "the search has fitted best_estimator_ to all records of the task, damaged ones among them, since "
                    "a detector of another library ignores their labels. It takes such damage for healthy: do not use "
                    "it. Give the search refit=False, and learn the baseline by task.refit(search)"
                )
                warn_each([ResultWarning(text, "search-refits")])
            detector = clone(detector.estimator).set_params(**clone(detector.best_params_, safe=False))
        check_detector(detector, "the detector")
        return clone(detector).fit(self.baseline)

    def confirm(
        self,
        detectors: Any,
        T: ArrayLike,
        *,
        n_repeats: int | None = None,
        confidence: float = 0.95,
        random_state: int | np.random.RandomState | None = None,
    ) -> pd.DataFrame:
        """Evaluate tuned detectors in fresh weather and with fresh noise.

        Parameters
        ----------
        detectors : detector, search or mapping of str to these
            What was tuned and, to compare with, what was not, such as ``{"tuned": search, "default": detector}``. Each
            is fitted to the baseline, as in `refit`.
        T : array-like or DataFrame of shape (n_records, n_sensors)
            Temperatures that took no part in the tuning, such as another year, in degrees Celsius.
        n_repeats : int, optional
            How often the records are simulated; by default as often as in the task.
        confidence : float, default=0.95
            Of the bounds, two-sided.
        random_state : int, RandomState or None, default=None
            Seed of the noise, which is another than that of a task with the same seed.

        Returns
        -------
        DataFrame
            One row for each detector:

            - ``tuned``: score in the task, mean over its splits;
            - ``fresh``, ``fresh_ci_low``, ``fresh_ci_high``: the same score in the fresh records, and its bounds;
            - ``optimism``: ``tuned`` less ``fresh``;
            - ``false_alarms``, ``false_alarms_ci_low``, ``false_alarms_ci_high``: share of the healthy fresh records
              beyond the detector's own threshold, and its bounds;
            - ``within_limit``: False where both of these bounds exceed the limit of the task: give the detector a
              smaller ``contamination``;
            - ``not_evaluated``: share of the fresh records that are not evaluated.

        Raises
        ------
        ValueError
            If a detector or the weather is wrong.

        Warns
        -----
        UserWarning
            As in `refit`; if the weather is that of the task, so that only the noise is fresh.
        """
        check_probability(confidence, "confidence")
        named = detectors if isinstance(detectors, Mapping) else {"": detectors}
        if not named:
            raise ValueError("detectors is empty; expected a detector, a search, or {name: detector or search}")
        seeds = _seeds(len(self.seeds) if n_repeats is None else n_repeats, random_state)[:, 1]
        limit, ends = self.scoring.max_false_alarms, ("ci_low", "ci_high")
        drawn = {number for number, scenario in enumerate(self.scenarios) if scenario.n_draws > 1}
        fresh, findings = self._simulated(T, limit, 1, seeds)
        if np.array_equal(as_floats(T), as_floats(self.T), equal_nan=True):
            text = "the weather is that of the task: the optimism is that of the noise alone. Give that of another year"
            findings.append(WeatherWarning(text, "other-weather"))
        rows = []
        for name, detector in named.items():
            fitted = self.refit(detector)
            tuned = np.mean([self.scoring(fitted, self.X.iloc[test], self.y.iloc[test]) for _, test in self.cv])
            found = fresh.scoring.decisions(fitted, fresh.X.iloc[len(fresh.baseline) :])
            pods, alarms = found.pods(limit, confidence, drawn), found.false_alarms(confidence)
            row = {"detector": name or type(last_step(fitted)).__name__, "tuned": float(tuned)}
            row |= {"fresh": found.score(limit)}
            row |= {f"fresh_{end}": found.worth(limit) * np.mean([pod[end] for pod in pods]) for end in ends}
            row |= {"false_alarms": alarms["rate"]} | {f"false_alarms_{end}": alarms[end] for end in ends}
            row |= {"within_limit": alarms["ci_low"] <= limit, "not_evaluated": np.isnan(found.values).mean()}
            rows.append(row)
        warn_each(findings)
        table = pd.DataFrame(rows).set_index("detector")
        table.insert(4, "optimism", table["tuned"] - table["fresh"])
        return table

    def _simulated(
        self, T: Table, limit: float, n_splits: int, seeds: Sequence[int]
    ) -> tuple[DetectionTask, list[SkthermoWarning]]:
        """A task with its records, with the noise of some seeds, and what is doubtful about its weather."""
        baseline, labels = self.baseline, _labels(self.scenarios, T)
        n_baseline, n_repeats, (n_scenarios, n_records) = len(baseline), len(seeds), labels.shape
        index = _moved(T, baseline, n_repeats * n_scenarios)
        with collected() as findings, single_blas_thread():
            findings += self.fem.thermal_.doubts(self.fem.weather(T))
            simulation = Simulation.solved(self.fem, self.scenarios, T, self.measurement, n_repeats)
            tables = [
                table[list(baseline)].to_numpy()
                for repeat, seed in enumerate(seeds)
                for table in simulation.records(repeat, [seed]).values()
            ]
        X = pd.concat([baseline, pd.DataFrame(np.vstack(tables), index, baseline.columns)])
        X = X.rename_axis(baseline.index.name)
        y = pd.Series(np.r_[np.ones(n_baseline, dtype=int), np.tile(labels.ravel(), n_repeats)], X.index, name="y")
        repeat, scenario = np.divmod(np.repeat(np.arange(len(tables)), n_records), n_scenarios)
        before = np.full(n_baseline, -1)
        names = pd.Categorical.from_codes(np.r_[before, scenario], [one.name for one in self.scenarios])
        states = pd.DataFrame({"scenario": names, "repeat": np.r_[before, repeat]}, X.index)
        groups = np.array_split(np.arange(n_repeats), n_splits)
        cv = [(np.arange(n_baseline), n_baseline + np.flatnonzero(np.isin(repeat, group))) for group in groups]
        scoring = TaskScorer(states.assign(label=y).iloc[n_baseline:], sensors_of(self.fem), limit)
        simulated = {"X": X, "y": y, "cv": cv, "scoring": scoring, "states": states, "T": T, "seeds": seeds}
        return DetectionTask(**{**self, **simulated}), findings


def detection_task(
    fem: DataInformedFEM,
    T: ArrayLike,
    scenarios: Sequence[BaseScenario | Mapping[str, float]],
    *,
    baseline: ArrayLike | None = None,
    columns: Sequence[Hashable] | None = None,
    n_repeats: int = 10,
    noise: ArrayLike | Literal["fitted"] = "fitted",
    gaps: float | Literal["fitted"] | None = "fitted",
    outliers: ArrayLike | Literal["fitted"] | None = "fitted",
    max_false_alarms: float = 0.02,
    n_splits: int = 2,
    random_state: int | np.random.RandomState | None = None,
) -> DetectionTask:
    """Labelled records on which scikit-learn's searches tune a detector for this structure and its weather.

    Every detector learns the measured baseline, and is evaluated by simulated records of the healthy and of the damaged
    structure: a search over its settings, its compensator, lags, windows and covariance needs no damaged record.

    Parameters
    ----------
    fem : DataInformedFEM
        Fitted.
    T : array-like or DataFrame of shape (n_records, n_sensors)
        Temperatures in degrees Celsius under which the structure is simulated, in order of time; best a year, and one
        other than that of the baseline. With a baseline on a ``DatetimeIndex``, T needs one too.
    scenarios : sequence of Scenario, ProgressiveDamage, UncertainDamage or mapping
        At least one healthy and one damaged; mappings are severities by damage group.
    baseline : array-like or DataFrame, optional
        Measured records of the healthy structure: temperatures and frequencies side by side, or frequencies alone. By
        default those that the chain was fitted on.
    columns : sequence of str, optional
        Those columns of the baseline that the detector shall see, such as ``fem.mode_names_`` for one that sees no
        temperature; by default all.
    n_repeats : int, default=10
        How often the records are simulated, each time with other noise.
    noise : float, array-like of shape (n_modes,) or "fitted", default="fitted"
        As in `~skthermo.surrogate.DataInformedFEM.simulate`, and so are the next two.
    gaps : float, "fitted" or None, default="fitted"
        Values that are missing; with "fitted" temperatures, too.
    outliers : float, "fitted", None or array-like of shape (n_training_records, n_modes), default="fitted"
        Values that are far off.
    max_false_alarms : float, default=0.02
        Limit of the share of healthy records in alarm.
    n_splits : int, default=2
        Into how many groups the repeats are divided. In each split, the detector is fitted anew to the same baseline
        and evaluated by one of the groups.
    random_state : int, RandomState or None, default=None
        Seed of the noise.

    Returns
    -------
    DetectionTask
        With ``X``, ``y``, ``cv`` and ``scoring`` for a search, and the methods ``refit`` and ``confirm``.

    Raises
    ------
    ValueError
        If the chain is not fitted; if no scenario, or each, is healthy; if there are fewer repeats than splits; if
        columns, stamps or an argument are wrong.

    Warns
    -----
    UserWarning
        Once for each kind of doubt about the simulations, such as weather outside the training range.

    See Also
    --------
    DetectabilityStudy : What a detector, or several, would find, with bounds.

    Notes
    -----
    The score is the probability of detection at a limit of false alarms. Fit the search's best detector to the baseline
    by ``task.refit``. Detectors of skthermo do not learn what ``y`` labels damaged, so that a search may also refit,
    on the baseline and the simulated healthy records; for those of other libraries give it ``refit=False``.
    :ref:`how-a-task-is-scored` says how states are kept apart, and :ref:`tune-by-simulated-damage` how to read the
    score of the best of many settings.

    Examples
    --------
    >>> from sklearn.linear_model import LinearRegression
    >>> from sklearn.model_selection import GridSearchCV
    >>> from sklearn.neighbors import KNeighborsRegressor
    >>> from sklearn.pipeline import make_pipeline
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector, TemperatureCompensator
    >>> from skthermo.studies import detection_task, sweep
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year, weather = make_truss_campaign(random_state=0), make_truss_campaign(random_state=1).temperatures
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> scenarios = sweep(fem, (0.1,), ["bottom"])
    >>> task = detection_task(fem, weather, scenarios, n_repeats=2, random_state=0)
    >>> task.X.shape, task.states["scenario"].value_counts().to_dict()
    ((1825, 9), {'healthy': 730, 'bottom 10 %': 730})
    >>> compensator = TemperatureCompensator(LinearRegression(), targets=fem.mode_names_)
    >>> detector = make_pipeline(compensator, MahalanobisDetector())
    >>> regressors = {"temperaturecompensator__estimator": [KNeighborsRegressor(), LinearRegression()]}
    >>> search = GridSearchCV(detector, regressors, cv=task.cv, scoring=task.scoring, refit=False)
    >>> search.fit(task.X, task.y).best_params_
    {'temperaturecompensator__estimator': LinearRegression()}
    >>> later = make_truss_campaign(random_state=2).temperatures
    >>> task.confirm({"tuned": search}, later, random_state=0)[["tuned", "fresh"]].round(1)
              tuned  fresh
    detector
    tuned       0.6    0.6
    """
    seeds = _seeds(n_repeats, random_state)[:, 0]
    n_splits = positive_integer(n_splits, "n_splits")
    if n_splits > len(seeds):
        raise ValueError(f"n_splits is {n_splits} for {len(seeds)} repeats; expected at most as many splits as repeats")
    limit = check_probability(max_false_alarms, "max_false_alarms")
    check_chain(fem)
    table, findings = _baseline(fem, baseline)
    chosen = list(table) if columns is None else check_names(columns, "columns", list(table))
    if not set(chosen) & set(fem.mode_names_):
        raise ValueError(f"columns are {chosen}; expected some of {list(table)}, modes among them")
    table = table[[name for name in table if name in chosen]]
    measurement = scatter_of(fem, noise, gaps, outliers)
    given = {"scenarios": read_scenarios(scenarios, fem.model), "baseline": table, "measurement": measurement}
    task, doubts = DetectionTask(fem=fem, **given)._simulated(T, limit, n_splits, seeds)
    warn_each([*findings, *doubts])
    return task


def _baseline(fem: DataInformedFEM, baseline: Table | None) -> tuple[pd.DataFrame, list[SkthermoWarning]]:
    """Measured records as a frame, by default those of the chain, and findings; rows without stamps are numbered."""
    table = baseline_table(fem, baseline)
    table = pd.DataFrame(as_floats(table), table.index if has_stamps(table) else None, table.columns)
    if baseline is None:
        return table, []
    is_sensor = table.columns.isin(sensors_of(fem))
    T, F = (table.loc[:, chosen] if chosen.any() else None for chosen in (is_sensor, ~is_sensor))
    is_whole = table.shape[1] == len(sensors_of(fem)) + len(fem.mode_names_)
    found, doubts = set_aside(T, F, model=fem.model if is_whole else None, needs_all=True)
    tables = [one for one in (found.temperatures, found.frequencies) if one is not None]
    return pd.concat(tables, axis=1)[list(table)], [*doubts]


def _moved(T: Table, baseline: pd.DataFrame, n_states: int) -> pd.Index:
    """Rows of all states, one after the other: stamps of T moved into the future, or numbers after the baseline's."""
    if not has_stamps(baseline):
        return pd.RangeIndex(len(baseline), len(baseline) + n_states * _num_samples(T))
    stamps = getattr(T, "index", None)
    if (
        not has_stamps(T)
        or (stamps.tz is None) != (baseline.index.tz is None)
        or not stamps.is_unique
        or stamps.hasnans
    ):
        raise ValueError(
            f"T has the index {stamps!r:.200}, and the baseline stamps in the time zone {baseline.index.tz}; expected "
            "T on a DatetimeIndex as well, with a time zone if the baseline has one, and each stamp once"
        )
    day, gap = pd.Timedelta(days=1), pd.Timedelta(days=30)  # between two states
    wait, period = (baseline.index.max() + gap - stamps.min()) / day, (stamps.max() - stamps.min() + gap) / day
    room = (pd.Timestamp.max.tz_localize(stamps.tz) - stamps.max()) / day - 1
    for length in (365.2425, 1.0):  # whole years or, where they do not fit, days
        days = np.round(length * (max(np.ceil(wait / length), 0) + np.ceil(period / length) * np.arange(n_states)))
        if days[-1] < room:
            moved = stamps[:0].append([stamps + one * day for one in days])
            return moved.tz_convert(baseline.index.tz) if stamps.tz is not None else moved
    raise ValueError(
        f"{n_states} states of {period:.0f} days, each with stamps of its own, would end after the year 2262; expected "
        "fewer scenarios or repeats, or a shorter T"
    )


def _labels(scenarios: Sequence[BaseScenario], T: Table) -> NDArray[np.intp]:
    """+1 where a scenario is healthy or its damage has not begun, else -1, (n_scenarios, n_records)."""
    times = row_times(T)
    labels = np.ones((len(scenarios), len(times)), dtype=int)
    for one, row in zip(scenarios, labels, strict=True):
        if not one.is_healthy:
            row[times >= (-np.inf if one.onset is None else time_of(T, one.onset, "onset"))] = -1
    for name, label in (("healthy", 1), ("damaged", -1)):
        if not (labels == label).any():
            names = [one.name for one in scenarios]
            raise ValueError(f"none of the scenarios {names} has {name} records; expected a healthy and a damaged one")
    return labels


def _seeds(n_repeats: Any, random_state: np.random.RandomState | None) -> NDArray[np.intp]:
    """Seeds of the noise of each repeat: of a task, and of its confirmation."""
    size = positive_integer(n_repeats, "n_repeats"), 2
    return as_random_state(random_state).randint(np.iinfo(np.int32).max, size=size)
