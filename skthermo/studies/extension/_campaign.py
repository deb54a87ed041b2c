"""Simulated campaigns with modes, sensors and a length of the baseline that the real monitoring does not have."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from skthermo._tables.arrays import Array, as_floats
from skthermo._tables.frames import column_names
from skthermo.studies.detectability import Measurement

ChangesBySeverity: TypeAlias = Mapping[tuple[str, float], Mapping[str, Any]]
"""What is changed, as arguments of `DataInformedFEM.simulate`, by family and severity."""

LARGEST_SEED = np.iinfo(np.int32).max


@dataclass(frozen=True)
class CampaignSimulator:
    """A chain that stands for the true structure: healthy records to learn from, and records of every severity.

    The weather of the training begins again where ``n_baseline`` is longer. ``modes`` are the ranks of further modes of
    the model, and ``scatter`` the relative standard deviations of their noise; they are missing where all others are.
    """

    fem: Any
    T: Any
    changes: ChangesBySeverity
    measurement: Measurement
    n_baseline: int
    modes: Sequence[int] = ()
    scatter: Array = field(default_factory=lambda: np.empty(0))

    @property
    def names(self) -> list[Hashable]:
        """Columns of the tables: temperatures, measured modes, further modes."""
        sensors = column_names(self.fem.training_records_[0], "T")
        return [*sensors, *self.fem.mode_names_, *(mode_name(mode) for mode in self.modes)]

    def clean(self) -> tuple[Array, dict[tuple[str, float], Array]]:
        """Frequencies without noise: healthy in the weather of the training, and by family and severity in the new."""
        weather = self.fem.training_records_[0]
        return self._clean(weather, {}), {key: self._clean(self.T, changes) for key, changes in self.changes.items()}

    def draw(self, clean: tuple[Array, Mapping[Any, Array]], seed: int) -> tuple[pd.DataFrame, dict]:
        """Records with noise: a baseline, and frames by family and severity, all of which have the same noise."""
        (healthy, changed), weather = clean, self.fem.training_records_[0]
        seeds = np.random.RandomState(seed).randint(LARGEST_SEED, size=(1 + -(-self.n_baseline // len(weather)), 2))
        factors, seen = self._measured(self.T, seeds[0])
        periods = []
        for period, pair in enumerate(seeds[1:]):
            noise, T = self._measured(weather, pair)
            periods.append(self._table(T, healthy * noise, period))
        tables = {key: self._table(seen, frequencies * factors) for key, frequencies in changed.items()}
        return pd.concat(periods).iloc[: self.n_baseline], tables

    def _clean(self, T: Any, changes: Mapping[str, Any]) -> Array:
        measured = as_floats(self.fem.simulate(T, **changes))
        if not self.modes:
            return measured
        return np.hstack([measured, self.fem.thermal_.simulated(self.fem.weather(T), self.modes, **changes)])

    def _measured(self, T: Any, seeds: Any) -> tuple[Array, Any]:
        """Factors by which noise, gaps and outliers change frequencies, and temperatures with gaps."""
        measured, seen = self.measurement.of(self.fem, T, int(seeds[0]))
        further = np.random.RandomState(seeds[1]).standard_normal((len(self.modes), len(measured))).T * self.scatter
        further[np.isnan(measured).all(axis=1)] = np.nan
        return 1 + np.hstack([measured, further]), seen

    def _table(self, T: Any, frequencies: Array, period: int = 0) -> pd.DataFrame:
        """Temperatures and frequencies side by side; a later period repeats the weather of the first."""
        table = pd.DataFrame(np.hstack([as_floats(T), frequencies]), columns=self.names)
        index = getattr(T, "index", None)
        if not isinstance(index, pd.DatetimeIndex):
            return table.set_index(table.index + period * len(table))
        step = (index[-1] - index[0]) / max(len(index) - 1, 1)
        return table.set_index(index + period * (index[-1] - index[0] + step))


def mode_name(rank: int) -> str:
    """Name of a mode that was not measured, counted from 1."""
    return f"mode {rank + 1}"
