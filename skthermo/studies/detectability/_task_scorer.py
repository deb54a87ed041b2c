"""Score of a detector on a task: the share of damaged records that it finds within a limit of false alarms."""

from __future__ import annotations

import warnings
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.pipeline import Pipeline

from skthermo._estimators.warnings import warnings_once
from skthermo._tables.arrays import Array
from skthermo.studies.detectability._candidates import has_targets
from skthermo.studies.detectability._intervals import Rate, rate_of
from skthermo.studies.detectability._study import check_detector

FIRST_ROWS = r"(\d+ of \d+ rows cannot be predicted|lags reach \d+ rows back)"  # warnings that each state would give


@dataclass(frozen=True, eq=False)
class Decisions:
    """A detector's decisions on simulated records in order of time, with the label of each and the numbers of its
    scenario and its repeat.

    Negative decisions are alarms, NaN where a record is not evaluated; labels are +1 (healthy) and -1 (damaged).
    """

    values: Array
    labels: NDArray[np.intp]
    scenario: NDArray[np.intp]
    repeat: NDArray[np.intp]

    def score(self, limit: float) -> float:
        """Share of the damaged records found within the limit, times what the detector is worth."""
        return self.found(limit) * self.worth(limit)

    def worth(self, limit: float) -> float:
        """1, or the limit over the lower bound of the false alarms where this is more: the detector will work with its
        own threshold, not with a raised one."""
        return limit / max(self.false_alarms().lowest, limit)

    def found(self, limit: float) -> float:
        """Share of the damaged records in alarm, mean over scenarios; the threshold is raised where the limit asks."""
        raised = self.raised(limit)
        return float(np.mean([np.mean(self.values[rows] < raised) for rows in self.damaged()]))

    def raised(self, limit: float) -> float:
        """Decision below which there is an alarm: 0, or less where more healthy records than the limit lie below."""
        healthy = self.values[self.healthy()]
        evaluated = np.sort(healthy[~np.isnan(healthy)])
        if not evaluated.size:
            raise ValueError(
                f"none of {len(healthy)} healthy records is evaluated; expected a detector that evaluates some"
            )
        return float(min(evaluated[int(limit * len(evaluated) + 1e-9)], 0.0))

    def false_alarms(self, confidence: float = 0.95) -> Rate:
        """Share of the evaluated healthy records beyond the detector's own threshold, with bounds."""
        return rate_of(self.by_repeat(self.values, self.healthy()), confidence)

    def healthy(self) -> NDArray[np.intp]:
        """Healthy records of the scenario that has most; those of others are the same records with the same noise."""
        first = np.bincount(self.scenario[self.labels == 1]).argmax()
        return np.flatnonzero((self.labels == 1) & (self.scenario == first))

    def damaged(self) -> list[NDArray[np.intp]]:
        """Damaged records of each scenario that has some."""
        damaged = np.unique(self.scenario[self.labels == -1])
        return [np.flatnonzero((self.labels == -1) & (self.scenario == one)) for one in damaged]

    def by_repeat(self, values: Array, rows: NDArray[np.intp]) -> Array:
        """Values of some records, (n_repeats, n_records); in one row where repeats differ in number."""
        counts = np.unique(self.repeat[rows], return_counts=True)[1]
        return values[rows].reshape(len(counts) if np.ptp(counts) == 0 else 1, -1)


@dataclass(frozen=True, eq=False)
class TaskScorer:
    """Scores a fitted detector on simulated records of a task, each state by itself.

    Labels are those of all simulated records; the number of the state of each counts through the scenarios of the first
    repeat, then through those of the second.
    """

    labels: pd.Series
    state: NDArray[np.intp]
    n_scenarios: int
    sensors: Sequence[Hashable]
    max_false_alarms: float

    def __call__(self, estimator: Any, X: pd.DataFrame, y: ArrayLike | None = None) -> float:
        """Share of the damaged records that are found within the limit of false alarms."""
        return self.decisions(estimator, X, y).score(self.max_false_alarms)

    def decisions(self, estimator: Any, X: pd.DataFrame, y: ArrayLike | None = None) -> Decisions:
        """Decisions on rows of the task; lags and windows of a state see no record of another."""
        check_detector(estimator, "the detector")
        self._check_columns(estimator, X)
        rows = self._rows(X)
        labels = self.labels.to_numpy()[rows] if y is None else np.asarray(y)
        missing = [name for name, label in (("healthy", 1), ("damaged", -1)) if not (labels == label).any()]
        if missing:
            raise ValueError(f"none of {len(labels)} rows is {missing[0]}; expected the rows of a split of the task")
        order = np.argsort(rows, kind="stable")
        state, values = self.state[rows[order]], []
        with warnings_once("in other states of the task"):
            warnings.filterwarnings("ignore", FIRST_ROWS)
            for one in np.split(order, np.flatnonzero(np.diff(state)) + 1):
                values.append(np.asarray(estimator.decision_function(X.iloc[one]), dtype=float))
        repeat, scenario = np.divmod(state, self.n_scenarios)
        return Decisions(np.concatenate(values), labels[order], scenario, repeat)

    def _rows(self, X: Any) -> NDArray[np.intp]:
        """Positions of the rows among the simulated ones."""
        if not isinstance(X, pd.DataFrame):
            raise ValueError(f"X is of type {type(X).__name__}; expected a frame: rows of the task's X, with its index")
        rows = self.labels.index.get_indexer(X.index)
        if (rows < 0).any():
            raise ValueError(
                f"{(rows < 0).sum()} of {len(rows)} rows are no simulated records of the task, the first "
                f"{X.index[(rows < 0).argmax()]}; expected rows of the task's X, split by its cv, and no score of the "
                "baseline on which a detector is fitted (return_train_score=False)"
            )
        return rows

    def _check_columns(self, estimator: Any, X: Any) -> None:
        """Refuse a detector that would take temperatures for frequencies."""
        seen = [name for name in self.sensors if name in getattr(X, "columns", ())]
        if seen and not (has_targets(estimator) or isinstance(estimator, Pipeline)):
            raise ValueError(
                f"X has the temperatures {seen}, and the detector {estimator!r:.200} would take them for "
                "frequencies; expected a task with columns=modes, or a pipeline with a TemperatureCompensator"
            )
