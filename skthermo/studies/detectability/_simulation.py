"""Simulated and reference records of all scenarios, and what the detectors of a study decide on them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, clone

from skthermo._core.arrays import Array, as_floats
from skthermo._core.estimators import last_step, seed_parts, seeded
from skthermo._core.frames import Table, column_names
from skthermo._core.memory import remembered
from skthermo._core.parallel import single_blas_thread
from skthermo._core.warnings import collected
from skthermo.exceptions import SkthermoWarning
from skthermo.studies._scenarios import BaseScenario
from skthermo.surrogate import DataInformedFEM

Key: TypeAlias = tuple[str, str | None, str]


def sensors_of(fem: DataInformedFEM) -> list[Hashable]:
    """Names of the temperatures that a chain has learned from."""
    return column_names(fem.records_.temperatures, "T")


def side_by_side(fem: DataInformedFEM, T: Table, F: Table) -> pd.DataFrame:
    """Temperatures and frequencies of all modes, with the chain's names, on the index that one of them has."""
    index = next((table.index for table in (T, F) if isinstance(table, pd.DataFrame)), None)
    return pd.DataFrame(np.hstack([as_floats(T), as_floats(F)]), index, [*sensors_of(fem), *fem.mode_names_])


def named(fem: DataInformedFEM, records: Table, what: str) -> pd.DataFrame:
    """A table of modes, or of temperatures and modes, with the chain's names."""
    sensors, modes, is_frame = sensors_of(fem), list(fem.mode_names_), isinstance(records, pd.DataFrame)
    n_columns = np.shape(records)[1] if np.ndim(records) == 2 else 0
    by_number = {len(names): names for names in (modes, sensors + modes)}
    names = list(records.columns) if is_frame else by_number.get(n_columns, range(n_columns))
    if not set(names) & set(modes) or not {*sensors, *modes}.issuperset(names):
        raise ValueError(
            f"{what} has the columns {list(names)}; expected modes {modes}, alone or beside temperatures {sensors}, as "
            "in the fit of the chain"
        )
    return records if is_frame else pd.DataFrame(as_floats(records), columns=names)


def baseline_table(fem: DataInformedFEM, baseline: Table | None) -> pd.DataFrame:
    """What detectors learn, with the chain's names; by default the chain's records."""
    T, F = fem.records_.temperatures, fem.records_.frequencies
    return side_by_side(fem, T, F) if baseline is None else named(fem, baseline, "the baseline")


def has_targets(detector: BaseEstimator) -> bool:
    """Whether a part of a detector takes some of its columns for targets, as `TemperatureCompensator` does."""
    return any(name.rsplit("__", 1)[-1] == "targets" for name in detector.get_params())


class Records(NamedTuple):
    """Records of a scenario from one source."""

    scenario: BaseScenario
    source: str
    table: pd.DataFrame


@dataclass(frozen=True, eq=False)
class Candidate:
    """A detector that has learned ``n_baseline`` healthy records, and the columns that it sees, as a frame or not."""

    detector: BaseEstimator
    columns: list[Hashable]
    n_baseline: int
    is_frame: bool

    @classmethod
    def learned(
        cls, fem: DataInformedFEM, detector: BaseEstimator, baseline: Table | None, random_state: Any, memory: Any
    ) -> Candidate:
        """A clone, fitted to the baseline or the chain's records; only a detector with targets sees temperatures.

        The random state, of which a copy is used, seeds parts without a seed of their own.
        """
        table, records = baseline_table(fem, baseline), fem.records_
        is_sensor, sees_sensors = table.columns.isin(sensors_of(fem)), has_targets(detector)
        if sees_sensors and not is_sensor.any():
            raise ValueError("the detector compensates for temperature, and the baseline has none; expected both")
        given = (records.temperatures, records.frequencies) if baseline is None else (baseline,)
        is_frame = any(isinstance(one, pd.DataFrame) for one in given)
        columns = list(table.columns[sees_sensors | ~is_sensor])
        unfitted = clone(detector)
        seed_parts(unfitted, deepcopy(seeded(random_state)))
        candidate = cls(unfitted, columns, len(table), is_frame)
        return cls(remembered(memory, fitted_to, unfitted, candidate.seen(table)), columns, len(table), is_frame)

    @property
    def threshold(self) -> float | None:
        """Damage index above which there is an alarm, where the detector has one."""
        offset = getattr(last_step(self.detector), "offset_", None)
        return None if offset is None else -float(np.squeeze(offset))

    def seen(self, table: pd.DataFrame) -> Table:
        """The detector's columns of a table."""
        seen = table[self.columns]
        return seen if self.is_frame else seen.to_numpy()

    def entering(self, records: Records) -> Table:
        """What the detector sees of records."""
        lacking = [name for name in self.columns if name not in records.table]
        if lacking:
            text = f"the {records.source} of scenario {records.scenario.name!r} lacks the columns {lacking}"
            raise ValueError(f"{text}; expected those that the detector sees, or frequencies in the rows of T")
        return self.seen(records.table)


def fitted_to(detector: BaseEstimator, table: Table) -> BaseEstimator:
    """The detector, fitted to the table."""
    return detector.fit(table)


@dataclass(frozen=True, eq=False)
class Decided:
    """Decisions of detectors by detector, scenario and source: (n_records,) of one repeat, (n_repeats, n_records) of
    several. The scenario is None for healthy records with noise of other seeds, by which thresholds are moved.

    ``indices`` are damage indices of the first repeat, ``errors`` those of detectors that failed, and ``findings`` what
    others doubt.
    """

    decisions: Mapping[Key, Array]
    errors: Mapping[str, Exception]
    findings: Sequence[SkthermoWarning] = ()
    indices: Mapping[Key, pd.Series] = field(default_factory=dict)

    @classmethod
    def by(cls, candidates: Mapping[str, Candidate], records: Iterable[Records], *, is_first: bool = False) -> Decided:
        """What detectors decide on records one after the other; those that fail are left out from then on.

        Damage indices are those of the first repeat alone, and so are warnings. As float32, decisions are as exact as
        alarms and intervals need.
        """
        decisions, indices, errors, findings = {}, {}, {}, []
        for one in records:
            for name, candidate in candidates.items():
                if name in errors:
                    continue
                key, detector = (name, one.scenario.name, one.source), candidate.detector
                with collected(drop_others=not is_first) as doubts:
                    try:
                        seen = candidate.entering(one)
                        decisions[key] = np.asarray(detector.decision_function(seen), dtype=np.float32)
                        if is_first:
                            index = -np.asarray(detector.score_samples(seen), dtype=float)
                            indices[key] = pd.Series(index, one.table.index, name="damage_index")
                    except Exception as error:
                        errors[name] = error
                findings += by_detector(doubts, name, candidates)
        return cls(decisions, errors, findings, indices)

    @classmethod
    def together(cls, repeats: Sequence[Decided]) -> Decided:
        """Several repeats, one after the other; findings and measured records are those of the first."""
        errors = {name: error for one in reversed(repeats) for name, error in one.errors.items()}
        keys = [key for key in repeats[0].decisions if key[0] not in errors]
        joined = {key: np.array([one.decisions[key] for one in repeats if key in one.decisions]) for key in keys}
        return cls(joined, errors, repeats[0].findings, repeats[0].indices)


def by_detector(findings: Iterable[SkthermoWarning], name: str, detectors: Mapping[str, Any]) -> list[SkthermoWarning]:
    """Findings that name their detector where there are several."""
    if len(detectors) == 1:
        return [*findings]
    return [type(one)(f"detector {name!r}: {one.args[0]}", one.kind) for one in findings]


def scatter_of(fem: DataInformedFEM, noise: Any, gaps: Any, outliers: Any) -> dict[str, Any]:
    """Noise, gaps and outliers of simulated records, as in `~skthermo.surrogate.DataInformedFEM.simulate`; outliers may
    be the frequencies of the training records before these were cleaned."""
    outliers = fem.recorder_.service_of(outliers) if np.ndim(outliers) else outliers
    return {"noise": noise, "gaps": gaps, "outliers": outliers}


@dataclass(frozen=True, eq=False)
class Simulation:
    """One weather, and the frequencies without noise, (n_records, n_modes), of each draw of every scenario that repeats
    from the ``first`` on take; those of another ``chain`` where one is given. ``reference`` gives true frequencies for
    a scenario and a seed, ``levels`` are factors of the noise of each mode."""

    fem: DataInformedFEM
    scenarios: Sequence[BaseScenario]
    T: Table
    measurement: Mapping[str, Any]
    n_repeats: int = 1
    reference: Callable[[BaseScenario, int], ArrayLike | None] | None = None
    chain: DataInformedFEM | None = None
    first: int = 0
    levels: Any = 1.0
    clean: Mapping[str, Sequence[Array]] = field(init=False)

    def __post_init__(self) -> None:
        chain, clean = self.fem if self.chain is None else self.chain, {}
        weather, model = chain.weather(self.T), chain.thermal_
        for one in self.scenarios:
            numbers = np.arange(self.first, self.first + min(one.n_draws, self.n_repeats)) % one.n_draws
            changes = [one.changes(self.T, int(number)) for number in numbers]
            if len(changes) > 1 and hasattr(chain.model, "with_damage_parameters"):
                clean[one.name] = model.with_each(weather, [change["damage"] for change in changes], one.kind)
            else:
                clean[one.name] = [model.simulated(weather, **change) for change in changes]
        object.__setattr__(self, "clean", clean)

    @cached_property
    def weather(self) -> Any:
        return self.fem.weather(self.T)

    @cached_property
    def temperatures(self) -> pd.DataFrame:
        """With the chain's names, before any is missing."""
        index = self.T.index if isinstance(self.T, pd.DataFrame) else None
        return pd.DataFrame(as_floats(self.weather.given), index, sensors_of(self.fem))

    def records(
        self, repeat: int, seeds: Sequence[int], scenarios: Sequence[BaseScenario] | None = None
    ) -> Iterator[Records]:
        """Records of scenarios from every source, one after the other, all with the same noise, gaps and outliers.

        These are drawn by the first seed; the second is that of the reference.
        """
        T, options = self.temperatures, {**self.measurement, "random_state": int(seeds[0])}
        noise = self.fem.recorder_.noise(self.weather, **options) * self.levels
        if isinstance(options["gaps"], str) and np.isnan(as_floats(self.fem.records_.temperatures)).any():
            del options["noise"]
            T = T.mask(self.fem.recorder_.gaps(self.weather, **options)[0])
        for scenario in self.scenarios if scenarios is None else scenarios:
            draws = self.clean[scenario.name]
            frequencies = draws[repeat % len(draws)] * (1 + noise)
            yield Records(scenario, "simulated", side_by_side(self.fem, T, frequencies))
            values = None if self.reference is None else self.reference(scenario, int(seeds[1]))
            if values is not None:
                if np.shape(values)[0] != len(T):
                    what = f"the reference of scenario {scenario.name!r} has shape {np.shape(values)}"
                    raise ValueError(f"{what}; expected frequencies for the {len(T)} rows of T")
                yield self.measured(scenario, values, T)

    def measured(self, scenario: BaseScenario, values: Table, T: pd.DataFrame | None = None) -> Records:
        """Given records of a scenario; those without times of their own have the rows of the weather, if as many, and
        those in its rows have its temperatures where they have none."""
        T = self.temperatures if T is None else T
        table = named(self.fem, values, f"the reference of scenario {scenario.name!r}")
        if not isinstance(values, pd.DataFrame) and len(table) == len(T):
            table = table.set_axis(T.index)
        if table.index.equals(T.index):
            table = table.join(T[[name for name in T if name not in table]])
        return Records(scenario, "reference", table)

    def repeat(
        self, candidates: Mapping[str, Candidate], number: int, seeds: Sequence[int], given: Any = None
    ) -> Decided:
        """Decisions on one repeat of all scenarios, on those that are given, and on other healthy records, by which
        thresholds are moved."""
        with single_blas_thread():
            measured = [self.measured(one, given[one.name]) for one in self.scenarios if one.name in (given or {})]
            records = itertools.chain(self.records(number, seeds), measured)
            found = Decided.by(candidates, records, is_first=given is not None)
            healthy = [scenario for scenario in self.scenarios if scenario.is_healthy][:1]
            left = {name: one for name, one in candidates.items() if name not in found.errors}
            others = np.random.RandomState(seeds).randint(np.iinfo(np.int32).max, size=2)
            again = Decided.by(left, self.records(number, others, healthy) if healthy else [])
        moving = {(name, None, source): decisions for (name, _, source), decisions in again.decisions.items()}
        return Decided(found.decisions | moving, {**found.errors, **again.errors}, found.findings, found.indices)
