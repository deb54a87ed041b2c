"""Simulated and reference records of all scenarios, and how the detectors of a study evaluate them."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, TypeAlias, TypeVar

import numpy as np
import pandas as pd
from joblib import Memory, delayed
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, clone
from sklearn.pipeline import Pipeline

from skthermo._core.arrays import Array, as_columns, as_floats, is_real
from skthermo._core.estimators import _num_samples, last_step, seed_parts
from skthermo._core.frames import Table, check_same_rows, column_names, frame_like
from skthermo._core.memory import remembered
from skthermo._core.parallel import run_jobs, single_blas_thread
from skthermo._core.warnings import collected, warn_each, without_warnings
from skthermo.detection import DamageDetector
from skthermo.studies._scenarios import BaseScenario
from skthermo.studies.detectability._rates import EvaluatedRecords, rate_of
from skthermo.surrogate import DataInformedFEM

SIMULATED, REFERENCE = "simulated", "reference"

Answer = TypeVar("Answer")
Key: TypeAlias = tuple[str, ...]
Repeat: TypeAlias = tuple[int, Sequence[int]]  # number and seeds

LARGEST_SEED = np.iinfo(np.int32).max
MOST_ROWS = 20_000  # of records that are evaluated together


@dataclass(frozen=True)
class SeenColumns:
    """Columns of a detector's baseline: their positions among temperatures and modes of the chain side by side."""

    names: Sequence[Hashable]
    n_sensors: int
    positions: Any
    is_frame: bool

    @classmethod
    def all_of(cls, fem: DataInformedFEM) -> SeenColumns:
        """All columns of a chain."""
        names = [*column_names(fem.records_.temperatures, "T"), *fem.mode_names_]
        return cls(names, fem.n_features_in_, np.arange(len(names)), False)

    def table(self, T: Table, F: Array) -> Table:
        """Temperatures and frequencies of all modes as the detector sees them."""
        return self._seen(np.hstack([as_floats(T), F]), T)

    def reference(self, records: Table, T: Table, name: str) -> Table:
        """Measured records of a scenario as the detector sees them, with temperatures T where they lack their own."""
        known = self.positions_of(records, f"the reference of scenario {name!r}")
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

    def positions_of(self, records: Table, what: str) -> Any:
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


def read_baseline(fem: DataInformedFEM, detector: BaseEstimator, baseline: Table | None) -> tuple[SeenColumns, Table]:
    """The detector's view, and the records that it learns from: by default those that the chain has learned from.

    Only a detector with a part that has ``targets`` sees temperatures.
    """
    T, F = fem.records_.temperatures, fem.records_.frequencies
    everything, compensates = SeenColumns.all_of(fem), has_targets(detector)
    n_sensors = everything.n_sensors
    if baseline is None:
        positions = everything.positions if compensates else everything.positions[n_sensors:]
        is_frame = isinstance(T, pd.DataFrame) or isinstance(F, pd.DataFrame)
        view = replace(everything, positions=positions, is_frame=is_frame)
        return view, view.table(T if isinstance(T, pd.DataFrame) else frame_like(F, as_floats(T)), as_floats(F))
    known = everything.positions_of(baseline, "the baseline")
    if compensates and not (known < n_sensors).any():
        raise ValueError("the detector compensates for temperature, and the baseline has none; expected both")
    seen = np.flatnonzero(compensates | (known >= n_sensors))
    view = replace(everything, positions=known[seen], is_frame=isinstance(baseline, pd.DataFrame))
    return view, baseline.iloc[:, seen] if view.is_frame else as_columns(baseline)[:, seen]


def has_targets(detector: BaseEstimator) -> bool:
    """Whether a part of a detector takes some of its columns for targets, as `TemperatureCompensator` does."""
    return any(name.rsplit("__", 1)[-1] == "targets" for name in detector.get_params())


def transformed_by(steps: Pipeline, table: Table) -> tuple[Pipeline, Table]:
    """Fitted steps, and the table that they give."""
    return steps, steps.fit_transform(table)


def fitted_to(detector: BaseEstimator, table: Table) -> BaseEstimator:
    """The detector, fitted to the table."""
    return detector.fit(table)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A detector that has learned the healthy structure, and which columns it sees.

    Its ``head`` are the steps before its ``last`` one; what is no pipeline has none.
    A decision depends on ``memory`` records, up to the evaluated one: those of the longest window.
    """

    detector: BaseEstimator
    view: SeenColumns
    n_baseline: int
    head: tuple[BaseEstimator, ...]
    last: BaseEstimator
    memory: int

    @classmethod
    def learned(
        cls,
        fem: DataInformedFEM,
        baseline: Table | None,
        random_state: np.random.RandomState | None,
        memory: str | Memory | None,
        detector: BaseEstimator,
    ) -> Candidate:
        """A fitted clone; the random state, of which a copy is used, seeds parts without a seed of their own.

        A memory keeps what is fitted, and the steps before the last one by themselves: pipelines may begin alike.
        """
        view, healthy = read_baseline(fem, detector, baseline)
        fitted, head, seen = clone(detector), (), healthy
        seed_parts(fitted, deepcopy(random_state))
        is_pipeline = isinstance(fitted, Pipeline) and len(fitted) > 1
        if is_pipeline:
            before = Pipeline([*fitted.steps[:-1], ("last", "passthrough")], memory=fitted.memory)
            before, seen = remembered(memory, transformed_by, before, healthy)
            head = tuple(step for _, step in before.steps[:-1])
        last = fitted[-1] if is_pipeline else fitted
        last = remembered(memory, fitted_to, last, seen)
        if is_pipeline:
            fitted.steps = [*before.steps[:-1], (fitted.steps[-1][0], last)]
        detector = fitted if is_pipeline else last
        return cls(detector, view, _num_samples(healthy), head, last, _longest_window(detector))

    @property
    def threshold(self) -> float | None:
        """Damage index above which there is an alarm, where the detector has one."""
        offset = getattr(last_step(self.detector), "offset_", None)
        return None if offset is None else -float(np.squeeze(offset))

    @property
    def columns(self) -> list[Hashable]:
        """Names of the columns that the detector sees."""
        return [self.view.names[i] for i in self.view.positions]

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
        """Answers for each table, asked at once where the last step evaluates each record by itself, as a
        `DamageDetector` without ``lookback_`` does."""
        is_rowwise = isinstance(self.last, DamageDetector) and self.memory == 1 and not hasattr(self.last, "lookback_")
        if not is_rowwise or len(tables) < 2:
            return [np.asarray(ask(table), dtype=dtype) for table in tables]
        values = np.vstack([as_floats(table) for table in tables])
        together = pd.DataFrame(values, columns=tables[0].columns) if hasattr(tables[0], "columns") else values
        ends = np.cumsum([len(table) for table in tables])[:-1]
        return np.split(np.asarray(ask(together), dtype=dtype), ends)


def _longest_window(detector: BaseEstimator) -> int:
    """Number of records, up to the evaluated one, on which a decision depends."""
    parts, longest = [detector], 1
    while parts:
        part = parts.pop()
        longest = max(longest, getattr(part, "width", 1))
        parts += [*dict(getattr(part, "steps", ())).values(), *filter(None, [getattr(part, "means_", None)])]
    return longest


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What detectors decided in the repeats of a study, by detector, scenario and source.

    ``decisions`` have shape (n_repeats, n_records). ``calibration`` holds decisions on healthy records with noise of
    other seeds, by detector and source, ``indices`` the damage indices of the first repeat, and ``errors`` those of
    the detectors that failed, by name.
    """

    decisions: Mapping[Key, Array] = field(default_factory=dict)
    errors: Mapping[str, Exception] = field(default_factory=dict)
    calibration: Mapping[Key, Array] = field(default_factory=dict)
    indices: Mapping[Key, pd.Series] = field(default_factory=dict)

    def with_repeats(self, later: Sequence[Evaluation]) -> Evaluation:
        """This evaluation and those of later repeats together."""
        joined = {}
        for name in ("decisions", "calibration"):
            repeats = [getattr(one, name) for one in (self, *later)]
            joined[name] = {key: np.concatenate([one[key] for one in repeats if key in one]) for key in repeats[0]}
        errors = dict(self.errors)
        for one in later:
            errors |= one.errors
        return replace(self, errors=errors, **joined)

    def only(self, names: Collection[str]) -> Evaluation:
        """That of some detectors without errors, one after the other."""
        parts = ("decisions", "calibration", "indices")
        found = {
            part: {key: one for name in names for key, one in getattr(self, part).items() if key[0] == name}
            for part in parts
        }
        return Evaluation(**found)

    def n_repeats_for(self, tol: float, confidence: float, scenarios: Sequence[BaseScenario]) -> int:
        """About how many repeats it takes until all bounds of simulated rates are so near to the rates."""
        rates = [
            rate_of(one.from_onset()[0], confidence, whole_repeats=one.scenario.n_draws > 1)
            for name in {name for name, *_ in self.decisions} - set(self.errors)
            for one in self.records(name, scenarios)
            if one.source == SIMULATED
        ]
        widths = [(rate.ci_high - rate.ci_low) / 2 for rate in rates if rate.n_records]
        return int(np.ceil(self.n_repeats * (max(widths, default=0.0) / tol) ** 2))

    @property
    def n_repeats(self) -> int:
        """Number of repeats."""
        return len(next(iter(self.decisions.values())))

    def records(self, detector: str, scenarios: Sequence[BaseScenario]) -> list[EvaluatedRecords]:
        """Those of a detector, in the order of the scenarios."""
        return [
            EvaluatedRecords(detector, scenario, source, self.indices[key], self.decisions[key])
            for scenario in scenarios
            for source in (SIMULATED, REFERENCE)
            if (key := (detector, scenario.name, source)) in self.decisions
        ]


def ask_each(
    detectors: Iterable[str], question: Callable[[str], Answer], errors: Mapping[str, Exception]
) -> tuple[dict[str, Answer], dict[str, Exception]]:
    """Answers of detectors that have not failed before, and all errors, new ones included.

    The first error is raised if no detector is left.
    """
    asked, found, errors = [name for name in detectors if name not in errors], {}, dict(errors)
    for name in asked:
        try:
            with collected() as findings:
                found[name] = question(name)
            named = f"detector {name!r}: " if len(asked) > 1 else ""
            warn_each(type(one)(named + str(one.args[0]), one.kind) for one in findings)
        except Exception as error:
            errors[name] = error
    if not found:
        raise next(iter(errors.values()))
    return found, errors


@dataclass(frozen=True, eq=False)
class Records:
    """Records of a scenario from one source: simulated frequencies of all modes at the temperatures T, or others, which
    may have temperatures of their own; ``rows`` are those whose times they have. ``healthy`` are simulated frequencies
    of the healthy structure with the same noise."""

    scenario: BaseScenario
    source: str
    values: ArrayLike
    T: Table
    rows: Table
    _known: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)

    def entering(self, candidate: Candidate) -> Table:
        """What the last step of a detector sees."""
        view, known = candidate.view, self._known
        seen = (*view.positions, view.is_frame)
        if seen not in known:
            is_simulated = self.source == SIMULATED
            known[seen] = (
                view.table(self.T, self.values)
                if is_simulated
                else view.reference(self.values, self.T, self.scenario.name)
            )
        if candidate.head and candidate.head not in known:
            known[candidate.head] = candidate.detector[:-1].transform(known[seen])
        return known[candidate.head or seen]


@dataclass(frozen=True, eq=False)
class Measurement:
    """Noise, gaps and outliers of simulated records, as in `~skthermo.surrogate.DataInformedFEM.simulate`."""

    noise: Any
    gaps: Any
    outliers: Any

    @classmethod
    def asked(cls, fem: DataInformedFEM, noise: Any, gaps: Any, outliers: Any) -> Measurement:
        """Outliers may be the frequencies of the training records before these were cleaned."""
        return cls(noise, gaps, fem.recorder_.service_of(outliers) if np.ndim(outliers) else outliers)

    def resampled(self, fem: DataInformedFEM, random_state: np.random.RandomState) -> Measurement:
        """With drawn outliers, and the gaps beside them, of other records that could have trained the chain."""
        if self.outliers is None or is_real(self.outliers):
            return self
        service = fem.recorder_.service if isinstance(self.outliers, str) else self.outliers
        return replace(self, outliers=service.resampled(random_state)) if service.has_faults else self

    def of(self, fem: DataInformedFEM, weather: Any, seed: int) -> tuple[Array, Table]:
        """Relative noise, (n_records, n_modes), and the temperatures with gaps, as frames if they are."""
        noise = fem.recorder_.noise(weather, self.noise, self.gaps, self.outliers, seed)
        if not isinstance(self.gaps, str) or not np.isnan(as_floats(fem.records_.temperatures)).any():
            return noise, weather.given
        missing = fem.recorder_.gaps(weather, self.gaps, self.outliers, seed)[0]
        T = np.where(missing, np.nan, as_floats(weather.given))
        return noise, frame_like(weather.given, T, column_names(weather.given, "T"))


@dataclass(frozen=True, eq=False)
class Simulation:
    """One weather, fitted detectors by name, and the frequencies before noise, (n_records, n_modes), of each draw of
    every scenario; ``reference`` gives true frequencies for a scenario and a seed."""

    fem: DataInformedFEM
    candidates: Mapping[str, Candidate]
    scenarios: Sequence[BaseScenario]
    T: Table
    clean: Mapping[str, Sequence[Array]]
    measurement: Measurement
    reference: Callable[[BaseScenario, int], ArrayLike | None] | None

    def evaluated(
        self, repeats: Sequence[Repeat], errors: Mapping[str, Exception], measured: Mapping[str, Table] | None = None
    ) -> Evaluation:
        """Evaluate the records of some repeats, and healthy ones with noise of other seeds, by which thresholds are
        moved; measured records beside those of the first repeat, whose damage indices are kept.

        Measured records have times of their own if they are a frame, or differ in number from the weather.
        """
        some = (self.records(self.scenarios, number, seeds) for number, seeds in repeats)
        records = itertools.chain(itertools.chain.from_iterable(some), self._measured(measured or {}))
        found = self.evaluate(records, errors, with_indices=measured is not None)
        healthy = [scenario for scenario in self.scenarios if scenario.is_healthy][:1]
        if not healthy:
            return found
        others = [(number, np.random.RandomState(seeds).randint(LARGEST_SEED, size=2)) for number, seeds in repeats]
        some = (self.records(healthy, number, seeds) for number, seeds in others)
        with without_warnings():
            again = self.evaluate(itertools.chain.from_iterable(some), found.errors)
        calibration = {(name, source): decisions for (name, _, source), decisions in again.decisions.items()}
        return replace(found, errors=again.errors, calibration=calibration)

    @property
    def share_in_replicates(self) -> float:
        """Share of the tables of a repeat that a draw of a replicate evaluates: no calibration."""
        n_decided = len(self.scenarios)
        return n_decided / (n_decided + any(scenario.is_healthy for scenario in self.scenarios))

    def without(self, failed: Collection[str]) -> Simulation:
        """The same without the detectors that failed."""
        return replace(self, candidates={k: v for k, v in self.candidates.items() if k not in failed})

    def repeats(
        self, numbers: range, seeds: Sequence[Sequence[int]], n_jobs: int | None, verbose: int = 0
    ) -> list[Evaluation]:
        """Evaluate the records of some later repeats; the warnings of the first are the only ones given.

        Jobs are as many repeats as are evaluated together, however many run side by side.
        """
        size = max(MOST_ROWS // (len(self.T) * (len(self.scenarios) + 1)), 1)
        repeats = list(zip(numbers, seeds[numbers.start : numbers.stop], strict=True))
        some = (repeats[first : first + size] for first in range(0, len(repeats), size))
        with without_warnings():
            jobs = (delayed(self._some_repeats)(part) for part in some)
            options = {"count": lambda one: one.n_repeats, "unit": "repeats", "n_jobs": n_jobs, "verbose": verbose}
            return run_jobs(jobs, len(numbers), **options)

    def _some_repeats(self, repeats: Sequence[Repeat]) -> Evaluation:
        with without_warnings(), single_blas_thread():
            return self.evaluated(repeats, {})

    def _measured(self, measured: Mapping[str, Table]) -> Iterator[Records]:
        for scenario in self.scenarios:
            if scenario.name in measured:
                values = measured[scenario.name]
                is_own = isinstance(values, pd.DataFrame) or _num_samples(values) != _num_samples(self.T)
                yield Records(scenario, REFERENCE, values, self.T, values if is_own else self.T)

    def drawn(self, seed: int) -> tuple[Array, Table]:
        """Relative noise, (n_records, n_modes), NaN where a mode is missing, and temperatures with gaps."""
        return self.measurement.of(self.fem, self._weather, seed)

    @cached_property
    def _weather(self) -> Any:
        return self.fem.weather(self.T)

    def records(
        self,
        scenarios: Sequence[BaseScenario],
        repeat: int,
        seeds: Sequence[int],
        drawn: tuple[Array, Table] | None = None,
    ) -> Iterator[Records]:
        """Records of scenarios from every source, one after the other, all with the same noise, gaps and outliers.

        These are drawn by the first seed, unless noise and temperatures are given.
        """
        noise, T = drawn or self.drawn(int(seeds[0]))
        for scenario in scenarios:
            draws = self.clean[scenario.name]
            yield Records(scenario, SIMULATED, draws[repeat % len(draws)] * (1 + noise), T, self.T)
            values = None if self.reference is None else self.reference(scenario, int(seeds[1]))
            if values is not None:
                shape = as_columns(values).shape
                if shape[0] != len(self.T):
                    raise ValueError(
                        f"the reference of scenario {scenario.name!r} has shape {shape}; expected frequencies for the "
                        f"{len(self.T)} rows of T"
                    )
                yield Records(scenario, REFERENCE, values, self.T, self.T)

    def evaluate(
        self, records: Iterable[Records], errors: Mapping[str, Exception], with_indices: bool = False
    ) -> Evaluation:
        """Decisions of every detector that has not failed and, if asked, its damage indices, on one after another.

        Records of one scenario and source are those of one repeat after another. Without indices, as in later repeats,
        whose warnings are not given, some are evaluated together.
        """
        decisions, indices = defaultdict(list), {}
        for some in ([one] for one in records) if with_indices else _together(records):
            answers, errors = ask_each(self.candidates, partial(self._answers, some, with_indices), errors)
            for name, found in answers.items():
                for one, (index, decided) in zip(some, found, strict=True):
                    key = name, one.scenario.name, one.source
                    decisions[key].append(decided)
                    if with_indices:
                        indices[key] = index
        return Evaluation({key: np.array(values) for key, values in decisions.items()}, errors, indices=indices)

    def _answers(self, records: Sequence[Records], with_indices: bool, name: str) -> list[tuple[Any, Array]]:
        """Damage index, if asked, and decisions of one detector for each of some records."""
        candidate = self.candidates[name]
        entering = [one.entering(candidate) for one in records]
        found = candidate.damage_indices(entering, [one.rows for one in records]) if with_indices else None
        return list(zip(found or [None] * len(records), candidate.decisions(entering, found), strict=True))


def _together(records: Iterable[Records]) -> Iterator[list[Records]]:
    """Records that are evaluated together, of so many rows that memory is bounded."""
    some: list[Records] = []
    n_rows = 0
    for one in records:
        n_rows += len(one.rows)
        if some and n_rows > MOST_ROWS:
            yield some
            some, n_rows = [], len(one.rows)
        some.append(one)
    if some:
        yield some


def clean_frequencies(
    fem: DataInformedFEM, scenarios: Sequence[BaseScenario], T: Table, n_repeats: int, first: int = 0
) -> dict[str, list[Array]]:
    """Frequencies without noise by scenario, for each of the draws that the repeats take, from the first one on."""
    weather, clean = fem.weather(T), {}
    for scenario in scenarios:
        draws = np.arange(first, first + min(scenario.n_draws, n_repeats)) % scenario.n_draws
        changes = [scenario.changes(T, int(draw)) for draw in draws]
        if len(changes) > 1 and hasattr(fem.model, "with_damage_parameters"):
            clean[scenario.name] = fem.thermal_.with_each(weather, [change["damage"] for change in changes])
        else:
            clean[scenario.name] = [fem.thermal_.simulated(weather, **change) for change in changes]
    return clean
