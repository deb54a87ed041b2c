"""The detectors of a study: the columns that each sees, what it has learned, and the smallest damage that it finds."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from joblib import Memory
from sklearn.base import BaseEstimator, clone
from sklearn.pipeline import Pipeline

from skthermo._estimators.answers import answer_once
from skthermo._estimators.memory import remembered
from skthermo._estimators.warnings import reported_by_caller
from skthermo._tables.arrays import Array, as_columns, as_floats
from skthermo._tables.frames import Table, check_same_rows, column_names, frame_like
from skthermo._validation import _num_samples, last_step, seed_parts
from skthermo.detection import DamageDetector
from skthermo.studies.detectability._pod_curve import pod_curve
from skthermo.surrogate import FittedChain


@dataclass(frozen=True)
class SeenColumns:
    """Columns of a detector's baseline: their positions among temperatures and modes of the chain side by side."""

    names: Sequence[Hashable]
    n_sensors: int
    positions: Any
    is_frame: bool

    def table(self, T: Table, F: Array) -> Table:
        """Temperatures and frequencies of all modes as the detector sees them."""
        return self._seen(np.hstack([as_floats(T), F]), T)

    def reference(self, records: Table, T: Table, name: str) -> Table:
        """Measured records of a scenario as the detector sees them, with temperatures T where they lack their own."""
        known = self._positions_of(records, f"the reference of scenario {name!r}")
        values = np.full((len(records), len(self.names)), np.nan)
        values[:, known] = as_columns(records)
        lacking = np.setdiff1d(self.positions, known)
        if (lacking >= self.n_sensors).any():
            raise ValueError(
                f"the reference of scenario {name!r} lacks the modes {[self.names[i] for i in lacking]}; expected "
                f"those that the detector sees"
            )
        if lacking.size:
            check_same_rows(T, records, ("temperatures", f"the reference of scenario {name!r}"))
            values[:, : self.n_sensors] = as_floats(T)
        return self._seen(values, records if isinstance(records, pd.DataFrame) or len(values) != len(T) else T)

    def _seen(self, values: Array, rows: Table) -> Table:
        """The detector's columns of all of the chain's, on the index of some rows."""
        if not self.is_frame:
            return values[:, self.positions]
        index = rows.index if isinstance(rows, pd.DataFrame) else None
        return pd.DataFrame(values[:, self.positions], index=index, columns=[self.names[i] for i in self.positions])

    def _positions_of(self, records: Table, what: str) -> Any:
        """Which of the chain's columns a table holds."""
        n_columns, n_all = np.shape(records)[1] if np.ndim(records) == 2 else 0, len(self.names)
        sensors, modes = list(self.names[: self.n_sensors]), list(self.names[self.n_sensors :])
        if isinstance(records, pd.DataFrame):
            unknown = [name for name in records.columns if name not in self.names]
            if unknown or not set(records.columns) & set(modes):
                raise ValueError(
                    f"{what} has the columns {list(records.columns)}; expected modes {modes}, alone or beside "
                    f"temperatures {sensors}, as in the fit of the chain"
                )
            return np.array([list(self.names).index(name) for name in records.columns])
        if n_columns not in (n_all, n_all - self.n_sensors):
            raise ValueError(
                f"{what} has shape {np.shape(records)}; expected {n_all - self.n_sensors} columns of frequencies, or "
                f"{self.n_sensors} of temperatures and {n_all - self.n_sensors} of frequencies side by side"
            )
        return np.arange(n_all - n_columns, n_all)


def read_baseline(fem: FittedChain, detector: BaseEstimator, baseline: Table | None) -> tuple[SeenColumns, Table]:
    """The detector's view, and the records that it learns from: by default those that the chain has learned from.

    Only a detector with a part that has ``targets`` sees temperatures.
    """
    T, F = fem.records_.temperatures, fem.records_.frequencies
    names, n_sensors, compensates = [*column_names(T, "T"), *fem.mode_names_], fem.n_features_in_, has_targets(detector)
    everything = SeenColumns(names, n_sensors, np.arange(len(names)), False)
    if baseline is None:
        positions = everything.positions if compensates else everything.positions[n_sensors:]
        view = SeenColumns(names, n_sensors, positions, isinstance(T, pd.DataFrame) or isinstance(F, pd.DataFrame))
        return view, view.table(T if isinstance(T, pd.DataFrame) else frame_like(F, as_floats(T)), as_floats(F))
    known = everything._positions_of(baseline, "the baseline")
    if compensates and not (known < n_sensors).any():
        raise ValueError("the detector compensates for temperature, and the baseline has none; expected both")
    seen = np.flatnonzero(compensates | (known >= n_sensors))
    view = SeenColumns(names, n_sensors, known[seen], isinstance(baseline, pd.DataFrame))
    return view, baseline.iloc[:, seen] if view.is_frame else as_columns(baseline)[:, seen]


def has_targets(detector: BaseEstimator) -> bool:
    """Whether a part of a detector takes some of its columns for targets, as `TemperatureCompensator` does."""
    return any(name.rsplit("__", 1)[-1] == "targets" for name in detector.get_params())


@dataclass(frozen=True)
class Arrangement:
    """An unfitted detector, the names of the columns that it sees, in order, as a frame or an array, and the number of
    healthy records that it learns from."""

    detector: BaseEstimator
    columns: Sequence[Hashable]
    n_baseline: int
    is_frame: bool

    def with_mode(self, name: str) -> "Arrangement":
        """The arrangement with one more measured mode, which is a target where a part of the detector has targets."""
        detector, added = clone(self.detector), name if self.is_frame else len(self.columns)
        targets = {key: value for key, value in detector.get_params().items() if key.rsplit("__", 1)[-1] == "targets"}
        detector.set_params(**{key: [*value, added] for key, value in targets.items()})
        return replace(self, detector=detector, columns=[*self.columns, name])

    def with_sensor(self, name: Hashable) -> "Arrangement":
        """The arrangement with one more temperature."""
        return replace(self, columns=[*self.columns, name])

    def with_baseline(self, factor: float) -> "Arrangement":
        """The arrangement with a longer baseline."""
        return replace(self, n_baseline=int(np.ceil(self.n_baseline * factor)))

    def smallest(self, baseline: pd.DataFrame, tables: Mapping[tuple[str, float], pd.DataFrame]) -> dict[str, float]:
        """Severity at which the curve of the probability of detection reaches 0.9, by family."""
        detector = clone(self.detector).fit(self._seen(baseline.iloc[: self.n_baseline]))
        counts: dict[str, list[tuple[float, int, int]]] = {}
        for (family, severity), table in tables.items():
            decisions = np.asarray(detector.decision_function(self._seen(table)), dtype=float)
            evaluated = int((~np.isnan(decisions)).sum())
            counts.setdefault(family, []).append((abs(severity), int((decisions < 0).sum()), evaluated))
        return {family: _a90(*np.transpose(rows)) for family, rows in counts.items()}

    def _seen(self, table: pd.DataFrame) -> Table:
        seen = table[list(self.columns)]
        return seen if self.is_frame else seen.to_numpy()


def _a90(severities: Any, n_detected: Any, n_records: Any) -> float:
    """a90 of the curve; without a finite slope, the middle of its bracket; infinite where damage is not found."""
    try:
        with reported_by_caller({"separated-severities", "poor-curve-fit"}):
            curve = pod_curve(severities, n_detected, n_records)
    except ValueError:  # the rate does not increase with severity, or nothing could be evaluated
        return np.inf
    return curve.a90 if np.isfinite(curve.a90) else float(np.nan_to_num(np.mean(curve.bracket), nan=np.inf))


def _learned(memory: str | Memory | None, detector: Any, records: Table) -> Any:
    """A detector fitted to records, or one that was."""
    return remembered(memory, "detector", lambda: detector.fit(records), (detector, records))


@dataclass(frozen=True, eq=False)
class Candidate:
    """A detector that has learned the healthy structure, its name, and which columns it sees.

    Its ``head``, the steps before its ``last`` one, may be those of other detectors too.
    """

    name: str
    detector: BaseEstimator
    view: SeenColumns
    n_baseline: int

    @classmethod
    def learned(
        cls,
        fem: FittedChain,
        baseline: Table | None,
        random_state: np.random.RandomState | None,
        memory: str | Memory | None,
        name: str,
        detector: BaseEstimator,
    ) -> "Candidate":
        """A fitted clone; the random state, of which a copy is used, seeds parts without a seed of their own.

        A memory keeps what is fitted, and the steps before the last one are shared by all pipelines that begin alike.
        """
        view, healthy = read_baseline(fem, detector, baseline)
        fitted = clone(detector)
        seed_parts(fitted, deepcopy(random_state))
        if not isinstance(fitted, Pipeline) or len(fitted) == 1:
            return cls(name, _learned(memory, fitted, healthy), view, _num_samples(healthy))
        head = Pipeline([*fitted.steps[:-1], (fitted.steps[-1][0], "passthrough")], memory=fitted.memory)
        begins = head.steps[:-1], healthy

        def learn() -> tuple[Pipeline, Table]:
            return remembered(memory, "head", lambda: (head, head.fit_transform(healthy)), begins)

        head, seen = answer_once(cls, begins, 0, learn)  # without a size: the candidates keep it in any case
        fitted.steps = [*head.steps[:-1], (fitted.steps[-1][0], _learned(memory, fitted[-1], seen))]
        return cls(name, fitted, view, _num_samples(healthy))

    @property
    def head(self) -> tuple[BaseEstimator, ...]:
        """The fitted steps before the last one, none of what is no pipeline."""
        steps = self.detector.steps if isinstance(self.detector, Pipeline) else []
        return tuple(step for _, step in steps[:-1])

    @property
    def last(self) -> BaseEstimator:
        """The detector, or the last step of its pipeline."""
        return self.detector[-1] if self.head else self.detector

    @property
    def threshold(self) -> float | None:
        """Damage index above which there is an alarm, where the detector has one."""
        offset = getattr(last_step(self.detector), "offset_", None)
        return None if offset is None else -float(np.squeeze(offset))

    @property
    def memory(self) -> int:
        """Number of records, up to the evaluated one, on which a decision depends: those of the longest window."""
        parts, longest = [self.detector], 1
        while parts:
            part = parts.pop()
            longest = max(longest, getattr(part, "width_", 1))
            parts += [step for _, step in getattr(part, "steps", ())] + list(getattr(part, "detectors_", ()))
        return longest

    @property
    def arrangement(self) -> Arrangement:
        """What is measured and learned."""
        columns = [self.view.names[i] for i in self.view.positions]
        return Arrangement(clone(self.detector), columns, self.n_baseline, self.view.is_frame)

    def entering(self, table: Table) -> Table:
        """What the last step sees of a table of the columns that the detector sees."""
        return self.detector[:-1].transform(table) if self.head else table

    @property
    def is_rowwise(self) -> bool:
        """Whether the last step evaluates each record by itself, as a `DamageDetector` without ``lookback_`` does."""
        return isinstance(self.last, DamageDetector) and self.memory == 1 and not hasattr(self.last, "lookback_")

    def decisions(self, entering: Sequence[Table], indices: Sequence[pd.Series] | None = None) -> list[Array]:
        """Decision function of each of some tables, NaN where there is none; float32 is as much as alarms and intervals
        need. They follow from known damage indices where the detector's decisions are those of `DamageDetector`."""
        follow = getattr(type(self.last), "decision_function", None) is DamageDetector.decision_function
        if indices is not None and follow:
            return [np.asarray(-index.to_numpy() - self.last.offset_, dtype=np.float32) for index in indices]
        return self._each(self.last.decision_function, entering, np.float32)

    def damage_indices(self, entering: Sequence[Table], rows: Sequence[Table]) -> list[pd.Series]:
        """Minus the detector's ``score_samples`` of each of some tables, on the index of their records."""
        scores = self._each(self.last.score_samples, entering, float)
        indices = [one.index if isinstance(one, pd.DataFrame) else None for one in rows]
        return [pd.Series(-one, index, name="damage_index") for one, index in zip(scores, indices, strict=True)]

    def _each(self, ask: Callable[[Table], Any], tables: Sequence[Table], dtype: Any) -> list[Array]:
        """Answers for each table, asked at once where each record is evaluated by itself."""
        if not self.is_rowwise or len(tables) < 2:
            return [np.asarray(ask(table), dtype=dtype) for table in tables]
        values = np.vstack([as_floats(table) for table in tables])
        together = pd.DataFrame(values, columns=tables[0].columns) if hasattr(tables[0], "columns") else values
        ends = np.cumsum([len(table) for table in tables])[:-1]
        return np.split(np.asarray(ask(together), dtype=dtype), ends)
