"""Simulated and reference records of all scenarios, and how the detectors of a study evaluate them."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, TypeAlias, TypeVar

import numpy as np
import pandas as pd
from joblib import delayed
from numpy.typing import ArrayLike, NDArray

from skthermo._estimators.answers import answers_kept
from skthermo._estimators.threads import single_blas_thread
from skthermo._estimators.warnings import warnings_of_detector, without_warnings
from skthermo._io import run_jobs
from skthermo._tables.arrays import Array, as_columns, as_floats, is_real
from skthermo._tables.frames import Table, column_names, frame_like, row_times, time_of
from skthermo._validation import _num_samples
from skthermo.studies.detectability._candidates import Candidate
from skthermo.studies.detectability._intervals import Rate, rate_of
from skthermo.studies.scenarios import BaseScenario
from skthermo.surrogate import FittedChain

SIMULATED, REFERENCE = "simulated", "reference"

Answer = TypeVar("Answer")
Key: TypeAlias = tuple[str, ...]
Repeat: TypeAlias = tuple[int, Sequence[int]]  # number and seeds


@dataclass(frozen=True, eq=False)
class EvaluatedRecords:
    """What a detector makes of the records of one scenario and source: their damage index in the first repeat, with
    their index, and decisions in each repeat, (n_repeats, n_records), NaN where there is none."""

    detector: str
    scenario: BaseScenario
    source: str
    damage_index: pd.Series
    decisions: Array

    def from_onset(self) -> tuple[Array, Array]:
        """Decisions from the onset of the damage on, in order of time, and the times since then."""
        times, onset = row_times(self.damage_index), self.scenario.onset
        start = times.min() if onset is None else time_of(self.damage_index, onset, "onset")
        order = np.argsort(times, kind="stable")
        order = order[times[order] >= start]
        return self.decisions[:, order], times[order] - start

    def rate(self, confidence: float) -> Rate:
        """Rate of alarms from the onset of the damage on, with its bounds."""
        return rate_of(self.from_onset()[0], confidence, whole_repeats=self.scenario.n_draws > 1)

    def summary(self, confidence: float) -> dict[str, Any]:
        """Rates, bounds and time to detection, from the onset of the damage on."""
        scenario, (decisions, waits), rate = self.scenario, self.from_onset(), self.rate(confidence)
        if not rate.n_records:
            raise ValueError(
                f"none of {len(self.damage_index)} records of scenario {scenario.name!r}, source {self.source!r}, can "
                "be evaluated: they lack what the detector needs, or are before the onset; expected complete records "
                "after the onset"
            )
        pi_low, pi_high = band_of(decisions, confidence)
        return {
            "detector": self.detector,
            "scenario": scenario.name,
            "family": scenario.family,
            "severity": scenario.severity,
            "source": self.source,
            "measure": "PFA" if scenario.is_healthy else "POD",
            "rate": rate.rate,
            "ci_low": rate.lowest,
            "ci_high": rate.highest,
            "pi_low": pi_low,
            "pi_high": pi_high,
            "n_alarms": rate.n_alarms,
            "n_records": rate.n_records,
            "n_not_evaluated": decisions.size - rate.n_records,
            "n_effective": rate.n_effective,
            "n_repeats": len(decisions),
            "time_to_detection": _mean_wait(decisions < 0, waits, self.damage_index),
            "error": "",
        }


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What detectors decided in the repeats of a study, by detector, scenario and source.

    ``decisions`` have shape (n_repeats, n_records); ``transitions``, (n_repeats, n_onsets, n_window), are those of
    detectors with windows on records that are damaged after some onsets only. ``calibration`` holds decisions on
    healthy records with noise of other seeds, by detector and source, ``indices`` the damage indices of the first
    repeat, and ``errors`` those of the detectors that failed, by name.
    """

    decisions: Mapping[Key, Array]
    transitions: Mapping[Key, Array]
    errors: Mapping[str, Exception]
    calibration: Mapping[Key, Array] = field(default_factory=dict)
    indices: Mapping[Key, pd.Series] = field(default_factory=dict)

    def with_repeats(self, later: Sequence[Evaluation]) -> Evaluation:
        """This evaluation and those of later repeats together."""
        joined = {}
        for name in ("decisions", "transitions", "calibration"):
            repeats = [getattr(one, name) for one in (self, *later)]
            joined[name] = {key: np.concatenate([one[key] for one in repeats if key in one]) for key in repeats[0]}
        errors = dict(self.errors)
        for one in later:
            errors |= one.errors
        return replace(self, errors=errors, **joined)

    def n_repeats_for(self, tol: float, confidence: float, scenarios: Sequence[BaseScenario]) -> int:
        """About how many repeats it takes until all bounds of simulated rates are so near to the rates."""
        rates = [
            one.rate(confidence)
            for name in {name for name, *_ in self.decisions} - set(self.errors)
            for one in self.records(name, scenarios)
            if one.source == SIMULATED
        ]
        widths = [(rate.highest - rate.lowest) / 2 for rate in rates if rate.n_records]
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
            with warnings_of_detector(name if len(asked) > 1 else None):
                found[name] = question(name)
        except Exception as error:
            errors[name] = error
    if not found:
        raise next(iter(errors.values()))
    return found, errors


def band_of(decisions: Array, confidence: float) -> tuple[float, float]:
    """Range that holds the rate of one more repeat with this probability, or that of all repeats if they are too few.

    Of n rates, the k-th smallest exceeds that of one more repeat with probability k / (n + 1). One rate has no range.
    """
    evaluated = (~np.isnan(decisions)).sum(axis=1)
    rates = (decisions < 0).sum(axis=1)[evaluated > 0] / evaluated[evaluated > 0]
    if len(rates) < 2:
        return float("nan"), float("nan")
    lowest, highest = np.quantile(rates, [(1 - confidence) / 2, (1 + confidence) / 2], method="weibull")
    return float(lowest), float(highest)


def _mean_wait(alarms: NDArray[np.bool_], waits: Array, rows: Table) -> Any:
    """Mean time to the first alarm over the repeats that have one, in records or as a Timedelta."""
    detected = alarms[alarms.any(axis=1)].argmax(axis=1)
    if isinstance(getattr(rows, "index", None), pd.DatetimeIndex):
        return pd.Timedelta(int(waits[detected].mean()), "ns") if detected.size else pd.NaT
    return float(detected.mean()) if detected.size else float("nan")


LARGEST_SEED = np.iinfo(np.int32).max
MOST_ROWS = 20_000  # of records that are evaluated together
YEARS = 10  # of weather at least, in which an FE model simulates each state in the replicates of a study


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
    healthy: Array | None = None
    _known: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def has_onsets(self) -> bool:
        """Whether damage that is there from the beginning may be thought to begin at any record."""
        is_known = self.source == SIMULATED and self.healthy is not None
        return is_known and not self.scenario.is_healthy and self.scenario.onset is None

    def beginning(self, memory: int) -> Records:
        """The records, damaged after some onsets only, and healthy before each for as long as a detector remembers."""
        if memory not in self._known:
            damaged = damaged_rows(len(self.values), memory)[:, np.newaxis]
            self._known[memory] = replace(self, values=np.where(damaged, self.values, self.healthy))
        return self._known[memory]

    def entering(self, candidate: Candidate) -> Table:
        """What the last step of a detector sees, computed once for all whose steps before it are the same."""
        if not candidate.head:
            return self.seen_by(candidate)
        if candidate.head not in self._known:
            self._known[candidate.head] = candidate.entering(self.seen_by(candidate))
        return self._known[candidate.head]

    def seen_by(self, candidate: Candidate) -> Table:
        """The columns that a detector sees, in one table for all that see the same."""
        view = candidate.view
        seen = (*view.positions, view.is_frame)
        if seen not in self._known:
            if self.source == SIMULATED:
                self._known[seen] = view.table(self.T, self.values)
            else:
                self._known[seen] = view.reference(self.values, self.T, self.scenario.name)
        return self._known[seen]


@dataclass(frozen=True, eq=False)
class Measurement:
    """Noise, gaps and outliers of simulated records, as in `~skthermo.surrogate.DataInformedFEM.simulate`."""

    noise: Any
    gaps: Any
    outliers: Any

    @classmethod
    def asked(cls, fem: FittedChain, noise: Any, gaps: Any, outliers: Any) -> Measurement:
        """Outliers may be the frequencies of the training records before these were cleaned."""
        return cls(noise, gaps, fem.recorder_.service_of(outliers) if np.ndim(outliers) else outliers)

    def resampled(self, fem: FittedChain, random_state: np.random.RandomState) -> Measurement:
        """With drawn outliers, and the gaps beside them, of other records that could have trained the chain."""
        if self.outliers is None or is_real(self.outliers):
            return self
        service = fem.recorder_.service if isinstance(self.outliers, str) else self.outliers
        return replace(self, outliers=service.resampled(random_state)) if service.has_faults else self

    def of(self, fem: FittedChain, weather: Any, seed: int) -> tuple[Array, Table]:
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

    fem: FittedChain
    candidates: Mapping[str, Candidate]
    scenarios: Sequence[BaseScenario]
    T: Table
    clean: Mapping[str, Sequence[Array]]
    measurement: Measurement
    reference: Callable[[BaseScenario, int], ArrayLike | None] | None

    def first_repeat(
        self, measured: Mapping[str, Table], seeds: Sequence[int], errors: Mapping[str, Exception]
    ) -> Evaluation:
        """Evaluate the records of the first repeat and measured ones.

        Measured records have times of their own if they are a frame, or differ in number from the weather.
        """
        records = itertools.chain(self.records(self.scenarios, 0, seeds), self._measured(measured))
        found = self.evaluate(records, errors, with_indices=True)
        with without_warnings():
            return self._calibrated(found, [(0, seeds)])

    @property
    def share_in_replicates(self) -> float:
        """Share of the tables of a repeat that a draw of a replicate evaluates: no transitions, and no calibration."""
        n_damaged = sum(not scenario.is_healthy and scenario.onset is None for scenario in self.scenarios)
        n_all, n_windowed = len(self.candidates), sum(one.memory > 1 for one in self.candidates.values())
        n_decided, n_calibrated = n_all * len(self.scenarios), n_all * (n_damaged < len(self.scenarios))
        return n_decided / (n_decided + n_windowed * n_damaged + n_calibrated)

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
        repeats = [(number, seeds[number]) for number in numbers]
        some = (repeats[first : first + size] for first in range(0, len(repeats), size))
        with without_warnings(), answers_kept():
            jobs = (delayed(self._some_repeats)(part) for part in some)
            options = {"count": lambda one: one.n_repeats, "unit": "repeats", "n_jobs": n_jobs, "verbose": verbose}
            return run_jobs(jobs, len(numbers), **options)

    def _some_repeats(self, repeats: Sequence[Repeat]) -> Evaluation:
        with without_warnings(), answers_kept(), single_blas_thread():
            records = (self.records(self.scenarios, number, seeds) for number, seeds in repeats)
            return self._calibrated(self.evaluate(itertools.chain.from_iterable(records), {}), repeats)

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

        These are drawn by the first seed, unless noise and temperatures are given: then, the records of the healthy
        structure with the same noise are not kept.
        """
        noise, T = drawn or self.drawn(int(seeds[0]))
        for scenario in scenarios:
            draws = self.clean[scenario.name]
            values, healthy = draws[repeat % len(draws)] * (1 + noise), None if drawn else self._healthy * (1 + noise)
            yield Records(scenario, SIMULATED, values, T, self.T, healthy)
            values = None if self.reference is None else self.reference(scenario, int(seeds[1]))
            if values is not None:
                shape = as_columns(values).shape
                if shape[0] != len(self.T):
                    raise ValueError(
                        f"the reference of scenario {scenario.name!r} has shape {shape}; expected frequencies for the "
                        f"{len(self.T)} rows of T"
                    )
                yield Records(scenario, REFERENCE, values, self.T, self.T)

    @cached_property
    def _healthy(self) -> Array:
        """Frequencies of the healthy structure before noise."""
        names = [scenario.name for scenario in self.scenarios if scenario.is_healthy]
        with without_warnings():
            if names:
                return self.clean[names[0]][0]
            return self.fem.thermal_.in_weather(self._weather, YEARS * len(self.T)).simulated()

    def evaluate(
        self, records: Iterable[Records], errors: Mapping[str, Exception], with_indices: bool = False
    ) -> Evaluation:
        """Decisions of every detector that has not failed and, if asked, its damage indices, on one after another.

        Records of one scenario and source are those of one repeat after another. Without indices, as in later repeats,
        whose warnings are not given, some are evaluated together.
        """
        decisions, transitions, indices = defaultdict(list), defaultdict(list), {}
        for some in ([one] for one in records) if with_indices else _together(records):
            answers, errors = ask_each(self.candidates, partial(self._answers, some, with_indices), errors)
            for name, found in answers.items():
                for one, (index, decided, during) in zip(some, found, strict=True):
                    key = name, one.scenario.name, one.source
                    decisions[key].append(decided)
                    if during is not None:
                        transitions[key].append(during)
                    if with_indices:
                        indices[key] = index
        stacked = ({key: np.array(values) for key, values in one.items()} for one in (decisions, transitions))
        return Evaluation(*stacked, errors=errors, indices=indices)

    def _answers(self, records: Sequence[Records], with_indices: bool, name: str) -> list[tuple[Any, Array, Any]]:
        """Damage index, decisions and those of transitions of one detector for each of some records."""
        candidate = self.candidates[name]
        entering, memory = [one.entering(candidate) for one in records], candidate.memory
        during: list[Any] = [None] * len(records)
        if memory > 1:
            with without_warnings():
                for number, one in enumerate(records):
                    if one.has_onsets:
                        seen = one.beginning(memory).entering(candidate)
                        during[number] = transitions_of(candidate.decisions([seen])[0], memory)
        found = candidate.damage_indices(entering, [one.rows for one in records]) if with_indices else None
        decisions = candidate.decisions(entering, found)
        return list(zip(found or during, decisions, during, strict=True))

    def _calibrated(self, found: Evaluation, repeats: Sequence[Repeat]) -> Evaluation:
        """The evaluation with decisions on healthy records with noise of other seeds."""
        healthy = [scenario for scenario in self.scenarios if scenario.is_healthy][:1]
        if not healthy:
            return found
        others = (np.random.RandomState(seeds).randint(LARGEST_SEED, size=2) for _, seeds in repeats)
        records = (self.records(healthy, number, pair) for (number, _), pair in zip(repeats, others, strict=True))
        again = self.evaluate(itertools.chain.from_iterable(records), found.errors)
        calibration = {(name, source): decisions for (name, _, source), decisions in again.decisions.items()}
        return replace(found, errors=again.errors, calibration=calibration)


def _together(records: Iterable[Records]) -> Iterator[list[Records]]:
    """Records that are evaluated together, of so many rows that memory is bounded."""
    some: list[Records] = []
    for one in records:
        if some and sum(len(other.rows) for other in some) + len(one.rows) > MOST_ROWS:
            yield some
            some = []
        some.append(one)
    if some:
        yield some


def onsets_of(n_records: int, n_window: int) -> NDArray[np.intp]:
    """Records at which damage begins again and again, with a window of damaged and one of healthy records in turn."""
    onsets = np.arange(n_window, n_records - n_window + 1, 2 * n_window)
    return onsets if onsets.size else np.array([n_records // 2])


def damaged_rows(n_records: int, n_window: int) -> NDArray[np.bool_]:
    """Which records are damaged, a window after each of these onsets."""
    damaged = np.zeros(n_records, dtype=bool)
    places = onsets_of(n_records, n_window)[:, np.newaxis] + np.arange(n_window)
    damaged[places[places < n_records]] = True
    return damaged


def transitions_of(decisions: Array, n_window: int) -> Array:
    """Decisions on such records in the windows after the onsets, (n_onsets, n_window), NaN after the last record."""
    places = onsets_of(len(decisions), n_window)[:, np.newaxis] + np.arange(n_window)
    return np.append(decisions, np.full(n_window, np.nan, decisions.dtype))[places]


def clean_frequencies(
    fem: FittedChain, scenarios: Sequence[BaseScenario], T: Table, n_repeats: int, first: int = 0, n_years: int = YEARS
) -> dict[str, list[Array]]:
    """Frequencies without noise by scenario, for each of the draws that the repeats take, from the first one on.

    The same chain, or others with its FE model, will simulate so many years like T in all.
    """
    structure, clean = fem.thermal_.in_weather(fem.weather(T), n_years * len(T)), {}
    for scenario in scenarios:
        draws = np.arange(first, first + min(scenario.n_draws, n_repeats)) % scenario.n_draws
        changes = [scenario.changes(T, int(draw)) for draw in draws]
        if len(changes) > 1 and hasattr(fem.model, "with_damage_parameters"):
            clean[scenario.name] = structure.with_each([change["damage"] for change in changes])
        else:
            clean[scenario.name] = [structure.simulated(**change) for change in changes]
    return clean
