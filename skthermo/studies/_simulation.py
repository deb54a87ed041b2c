"""Simulated and reference records of all scenarios, and what the detectors of a study decide on them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
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
"""Detector; scenario, None for healthy records with noise of other seeds, by which thresholds are moved; source."""


class Decided(NamedTuple):
    """A detector's decisions of one repeat, (n_records,), or of several, (n_repeats, n_records), and damage indices and
    warnings of the first."""

    decisions: dict[Key, Array]
    indices: dict[Key, pd.Series]
    findings: list[SkthermoWarning]


def joined(repeats: Sequence[Decided | Exception]) -> Decided | Exception:
    """One repeat after the other, or the first error; measured records are in the first repeat alone."""
    failed = [one for one in repeats if isinstance(one, Exception)]
    if failed:
        return failed[0]
    found = {key: [one.decisions[key] for one in repeats if key in one.decisions] for key in repeats[0].decisions}
    return repeats[0]._replace(decisions={key: np.array(some) for key, some in found.items()})


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

    def seen(self, table: pd.DataFrame, what: str = "the baseline") -> Table:
        """The detector's columns of a table."""
        lacking = [name for name in self.columns if name not in table]
        if lacking:
            expected = "expected those that the detector sees, or frequencies in the rows of T"
            raise ValueError(f"{what} lacks the columns {lacking}; {expected}")
        seen = table[self.columns]
        return seen if self.is_frame else seen.to_numpy()

    def decided(
        self, name: str, tables: Mapping[tuple[str | None, str], pd.DataFrame], is_first: bool = False
    ) -> Decided | Exception:
        """What the detector decides on tables by scenario and source, or its error.

        Damage indices and warnings are those of the first repeat alone. As float32, decisions are as exact as alarms
        and intervals need.
        """
        found = Decided({}, {}, [])
        for (scenario, source), table in tables.items():
            is_shown = is_first and scenario is not None
            with collected(drop_others=not is_shown) as doubts:
                try:
                    seen = self.seen(table, f"the {source} of scenario {scenario!r}")
                    decisions = np.asarray(self.detector.decision_function(seen), dtype=np.float32)
                    found.decisions[name, scenario, source] = decisions
                    if is_shown:
                        index = -np.asarray(self.detector.score_samples(seen), dtype=float)
                        found.indices[name, scenario, source] = pd.Series(index, table.index, name="damage_index")
                except Exception as error:
                    return error
            found.findings.extend(doubts if is_shown else [])
        return found


def fitted_to(detector: BaseEstimator, table: Table) -> BaseEstimator:
    """The detector, fitted to the table."""
    return detector.fit(table)


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


def changed_frequencies(
    chain: DataInformedFEM, scenarios: Iterable[BaseScenario], T: Table, repeats: Sequence[int]
) -> dict[str, list[Array]]:
    """Frequencies without noise, (n_records, n_modes), of each draw of every scenario that some repeats take."""
    weather = chain.weather(T)
    return {
        one.name: [
            chain.thermal_.simulated(weather, **one.changes(T, repeat % one.n_draws))
            for repeat in repeats[: one.n_draws]
        ]
        for one in scenarios
    }


@dataclass(frozen=True, eq=False)
class Simulation:
    """One weather, what measures in it, and the frequencies that `changed_frequencies` gives. ``reference`` gives true
    frequencies for a scenario and a seed, ``given`` has measured ones by scenario, and ``levels`` are factors of the
    noise of each mode."""

    fem: DataInformedFEM
    scenarios: Sequence[BaseScenario]
    T: Table
    measurement: Mapping[str, Any]
    clean: Mapping[str, Sequence[Array]]
    reference: Callable[[BaseScenario, int], ArrayLike | None] | None = None
    given: Mapping[str, Table] = field(default_factory=dict)
    levels: Any = 1.0

    @classmethod
    def solved(
        cls, fem: DataInformedFEM, scenarios: Sequence[BaseScenario], T: Table, measurement: Any, n_repeats: int = 1
    ) -> Simulation:
        """A simulation by the chain itself of so many repeats."""
        return cls(fem, scenarios, T, measurement, changed_frequencies(fem, scenarios, T, range(n_repeats)))

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
    ) -> dict[tuple[str, str], pd.DataFrame]:
        """Tables by scenario and source, all with the same noise, gaps and outliers.

        These are drawn by the first seed; the second is that of the reference.
        """
        T, options = self.temperatures, {**self.measurement, "random_state": int(seeds[0])}
        noise = self.fem.recorder_.noise(self.weather, **options) * self.levels
        if isinstance(options["gaps"], str) and np.isnan(as_floats(self.fem.records_.temperatures)).any():
            del options["noise"]
            T = T.mask(self.fem.recorder_.gaps(self.weather, **options)[0])
        tables = {}
        for scenario in self.scenarios if scenarios is None else scenarios:
            draws = self.clean[scenario.name]
            simulated = draws[repeat % len(draws)] * (1 + noise)
            tables[scenario.name, "simulated"] = side_by_side(self.fem, T, simulated)
            values = None if self.reference is None else self.reference(scenario, int(seeds[1]))
            if values is not None:
                if np.shape(values)[0] != len(T):
                    what = f"the reference of scenario {scenario.name!r} has shape {np.shape(values)}"
                    raise ValueError(f"{what}; expected frequencies for the {len(T)} rows of T")
                tables[scenario.name, "reference"] = self.measured(scenario.name, values, T)
        return tables

    def measured(self, scenario: str, values: Table, T: pd.DataFrame) -> pd.DataFrame:
        """Given records of a scenario; those without times of their own have the rows of the weather, if as many, and
        those in its rows have its temperatures where they have none."""
        table = named(self.fem, values, f"the reference of scenario {scenario!r}")
        if not isinstance(values, pd.DataFrame) and len(table) == len(T):
            table = table.set_axis(T.index)
        return table.join(T[[name for name in T if name not in table]]) if table.index.equals(T.index) else table

    def repeat(
        self, candidates: Mapping[str, Candidate], number: int, seeds: Sequence[int]
    ) -> dict[str, Decided | Exception]:
        """What each detector decides on one repeat of all scenarios, in the first one on records that are given, and on
        other healthy ones, by which thresholds are moved."""
        with single_blas_thread():
            tables: dict[tuple[str | None, str], pd.DataFrame] = {**self.records(number, seeds)}
            for name in self.given if number == 0 else ():
                tables[name, "reference"] = self.measured(name, self.given[name], self.temperatures)
            healthy = [scenario for scenario in self.scenarios if scenario.is_healthy][:1]
            others = np.random.RandomState(seeds).randint(np.iinfo(np.int32).max, size=2)
            again = self.records(number, others, healthy) if healthy else {}
            tables |= {(None, source): table for (_, source), table in again.items()}
            return {name: one.decided(name, tables, number == 0) for name, one in candidates.items()}
