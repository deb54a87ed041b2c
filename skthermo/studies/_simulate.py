"""Simulated and true records of all scenarios, as a detector judges them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from numpy.typing import ArrayLike, NDArray

from skthermo._arrays import Array, as_columns, as_floats
from skthermo._threads import single_blas_thread
from skthermo._validation import _num_samples
from skthermo._warnings_once import without_warnings
from skthermo.studies._state import State
from skthermo.studies._view import View

SIMULATED, TRUE = "data-informed", "reference"


@dataclass(frozen=True)
class Trial:
    """One weather, a fitted detector, and the frequencies of every scenario before noise.

    Attributes
    ----------
    fem : DataInformedFEM
        Fitted.
    detector : detector
        Fitted.
    view : View
        What the detector sees.
    scenarios : sequence of State
        What is changed.
    T : array-like or DataFrame of shape (n_records, n_sensors)
        The weather.
    clean : mapping of str to list of ndarray
        By scenario, the frequencies (n_records, n_modes) of each of its draws.
    noise : float, array-like or "fitted"
        As in `DataInformedFEM.simulate`.
    reference : callable or None
        Gives true frequencies for a scenario and a seed.
    """

    fem: Any
    detector: Any
    view: View
    scenarios: Sequence[State]
    T: Any
    clean: Mapping[str, Sequence[Array]]
    noise: Any
    reference: Callable[[State, int], ArrayLike | None] | None

    def tables(self, repeat: int, seeds: NDArray) -> Any:
        """Records of every scenario and source, one after the other, all with the same noise."""
        factors = 1 + self.fem.draw_noise(self.T, self.noise, random_state=int(seeds[0]))
        for scenario in self.scenarios:
            draws = self.clean[scenario.name]
            yield scenario.name, SIMULATED, self.view.table(self.T, draws[repeat % len(draws)] * factors)
            records = None if self.reference is None else self.reference(scenario, int(seeds[1]))
            if records is not None:
                frequencies = as_columns(records)
                if len(frequencies) != len(self.T):
                    raise ValueError(
                        f"the reference of scenario {scenario.name!r} has shape {frequencies.shape}; expected "
                        f"frequencies for the {len(self.T)} rows of T"
                    )
                yield scenario.name, TRUE, self.view.reference(records, self.T, scenario.name)

    def first(self, measured: Mapping[str, Any], seeds: NDArray) -> tuple[dict[tuple[str, str], Any], dict]:
        """Records of the first repeat beside measured ones, by scenario and source, and what says when they were taken.

        Measured records have times of their own if they are a frame, or differ in number from the weather.
        """
        tables = {(name, source): table for name, source, table in self.tables(0, seeds)}
        rows = dict.fromkeys(tables, self.T)
        for name, records in measured.items():
            tables[name, TRUE] = self.view.reference(records, self.T, name)
            is_own = isinstance(records, pd.DataFrame) or _num_samples(records) != _num_samples(self.T)
            rows[name, TRUE] = records if is_own else self.T
        return tables, rows

    def decisions(self, repeat: int, seeds: NDArray) -> dict[tuple[str, str], Array]:
        """Decision function by scenario and source, each (n_records,)."""
        with without_warnings(), single_blas_thread():
            return {(name, source): judge(self.detector, table) for name, source, table in self.tables(repeat, seeds)}

    def repeated(self, seeds: Any, n_jobs: int | None) -> list[dict[tuple[str, str], Array]]:
        """Decisions of all repeats but the first, whose warnings speak for all."""
        with without_warnings():
            jobs = (delayed(self.decisions)(repeat, pair) for repeat, pair in enumerate(seeds) if repeat)
            return list(Parallel(n_jobs=n_jobs)(jobs))


def clean_frequencies(fem: Any, scenarios: Sequence[State], T: Any, n_repeats: int) -> dict[str, list[Array]]:
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


def judge(detector: Any, table: Any) -> Array:
    """Decision function of a detector, NaN where it has none; float32 is as much as alarms and intervals need."""
    return np.asarray(detector.decision_function(table), dtype=np.float32)
