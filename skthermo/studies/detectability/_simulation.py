"""Simulated and reference records of all scenarios, as a detector judges them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from numpy.typing import ArrayLike, NDArray

from skthermo._arrays import Array, as_columns, as_floats
from skthermo._threads import single_blas_thread
from skthermo._validation import _num_samples
from skthermo._warnings import without_warnings
from skthermo.studies.detectability._judged import JudgedRecords
from skthermo.studies.detectability._view import View
from skthermo.studies.scenarios import BaseScenario

SIMULATED, REFERENCE = "data-informed", "reference"


@dataclass(frozen=True)
class Simulation:
    """One weather, a fitted detector, and the frequencies before noise, (n_records, n_modes), of each draw of every
    scenario; ``reference`` gives true frequencies for a scenario and a seed."""

    fem: Any
    detector: Any
    view: View
    scenarios: Sequence[BaseScenario]
    T: Any
    clean: Mapping[str, Sequence[Array]]
    noise: Any
    reference: Callable[[BaseScenario, int], ArrayLike | None] | None

    def tables(self, repeat: int, seeds: NDArray) -> Iterator[tuple[BaseScenario, str, Any]]:
        """Records of every scenario and source, one after the other, all with the same noise."""
        factors = 1 + self.fem.draw_noise(self.T, self.noise, random_state=int(seeds[0]))
        for scenario in self.scenarios:
            draws = self.clean[scenario.name]
            yield scenario, SIMULATED, self.view.table(self.T, draws[repeat % len(draws)] * factors)
            records = None if self.reference is None else self.reference(scenario, int(seeds[1]))
            if records is not None:
                shape = as_columns(records).shape
                if shape[0] != len(self.T):
                    raise ValueError(
                        f"the reference of scenario {scenario.name!r} has shape {shape}; expected frequencies for the "
                        f"{len(self.T)} rows of T"
                    )
                yield scenario, REFERENCE, self.view.reference(records, self.T, scenario.name)

    def first_repeat(self, measured: Mapping[str, Any], seeds: NDArray) -> list[JudgedRecords]:
        """Judged records of the first repeat and measured ones, both sources of a scenario side by side.

        Measured records have times of their own if they are a frame, or differ in number from the weather.
        """
        found = [(scenario, source, table, self.T) for scenario, source, table in self.tables(0, seeds)]
        for scenario in self.scenarios:
            if scenario.name in measured:
                records = measured[scenario.name]
                is_own = isinstance(records, pd.DataFrame) or _num_samples(records) != _num_samples(self.T)
                table = self.view.reference(records, self.T, scenario.name)
                found.append((scenario, REFERENCE, table, records if is_own else self.T))
        found.sort(key=lambda one: self.scenarios.index(one[0]))
        return [
            JudgedRecords(scenario, source, rows, self._damage_index(table, rows), [self._decisions(table)])
            for scenario, source, table, rows in found
        ]

    def repeat(self, records: Sequence[JudgedRecords], seeds: Any, n_jobs: int | None, verbose: int = 0) -> None:
        """Add the decisions of later repeats to those of the first, whose warnings are the only ones given."""
        with without_warnings():
            jobs = (delayed(self._one_repeat)(number, pair) for number, pair in enumerate(seeds) if number)
            for decisions in Parallel(n_jobs=n_jobs, verbose=verbose)(jobs):
                for one in records:
                    one.decisions.extend(decisions.get((one.scenario.name, one.source), []))

    def _one_repeat(self, number: int, seeds: NDArray) -> dict[tuple[str, str], list[Array]]:
        with without_warnings(), single_blas_thread():
            tables = self.tables(number, seeds)
            return {(scenario.name, source): [self._decisions(table)] for scenario, source, table in tables}

    def _decisions(self, table: Any) -> Array:
        """Decision function, NaN where there is none; float32 is as much as alarms and intervals need."""
        return np.asarray(self.detector.decision_function(table), dtype=np.float32)

    def _damage_index(self, table: Any, rows: Any) -> pd.Series:
        """Minus the detector's ``score_samples``, on the index of the records."""
        index = rows.index if isinstance(rows, pd.DataFrame) else None
        return pd.Series(-np.asarray(self.detector.score_samples(table), dtype=float), index, name="damage_index")


def clean_frequencies(fem: Any, scenarios: Sequence[BaseScenario], T: Any, n_repeats: int) -> dict[str, list[Array]]:
    """Frequencies without noise by scenario, for each of the draws that the repeats take."""
    clean = {}
    for scenario in scenarios:
        changes = [scenario.changes(T, draw) for draw in range(min(scenario.n_draws, n_repeats))]
        if len(changes) > 1 and hasattr(fem.model, "with_damage_parameters"):
            clean[scenario.name] = _of_draws(fem, [change["damage"] for change in changes], T)
        else:
            clean[scenario.name] = [as_floats(fem.simulate(T, **change)) for change in changes]
    return clean


def _of_draws(fem: Any, draws: Sequence[Mapping[str, float]], T: Any) -> list[Array]:
    """Frequencies of the structure with one damage after the other, solved together by one model."""
    groups = list(draws[0])
    severities = np.array([[draw[group] for group in groups] for draw in draws])
    simulator = fem.simulator_.with_damage_parameters(groups, severities.min(), severities.max())
    theta = as_floats(fem.predict_parameters(T))
    factors = np.repeat(1 - severities, len(theta), axis=0)
    frequencies = simulator.frequencies(np.hstack([np.tile(theta, (len(draws), 1)), factors]), fem.n_jobs)
    return np.split(as_floats(fem.aligner_.inverse_transform(frequencies)), len(draws))
