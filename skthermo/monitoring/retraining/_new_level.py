"""The old baseline as prior of a new one: its frequencies moved to the level after an intervention."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from sklearn.utils import check_random_state

from skthermo._tables.arrays import Array
from skthermo._tables.times import DAY, YEAR, correlation_time
from skthermo.monitoring.retraining._blocks import WEEK, blocks_of
from skthermo.monitoring.retraining._shift import WeatherFree


@dataclass(frozen=True)
class NewLevel:
    """Relative change of each mode's level, and what days as many as the new ones tell of a level.

    ``table`` has a row for each mode: ``change`` (relative), ``standard_error``, ``n_records``. ``span`` is the time
    that the new records cover.
    """

    table: pd.DataFrame
    span: pd.Timedelta
    old: WeatherFree

    @classmethod
    def of(cls, old: WeatherFree, new: pd.DataFrame) -> NewLevel:
        """From new records, by what the old regression leaves of them."""
        left = old.of_new(new)
        step = pd.Series(new.index).diff().median()
        span = new.index[-1] - new.index[0] + (step if pd.notna(step) else pd.Timedelta(0))
        counts = left.notna().sum()
        deviations = old.residuals.std()
        times = pd.Series([correlation_time(column) for column in old.residuals.to_numpy().T], left.columns)
        error = deviations * np.sqrt(np.minimum(times / counts.where(counts > 0), 1.0))
        table = pd.DataFrame({"change": left.mean(), "standard_error": error, "n_records": counts})
        return cls(table, span, old)

    def prior(self, records: pd.DataFrame, new: pd.DataFrame, random_state: int | None = None) -> pd.DataFrame:
        """Old records at the new level, without those of a time of the year that new records cover.

        The level is known only as well as a few days tell it. Each week of old records is therefore moved by what
        another stretch of the old baseline, as long as the new one, misses its level by: what a detector learns of the
        scatter then holds for records to come.
        """
        blocks = blocks_of(records.index)
        kept = _season_not_covered(records.index, new.index)[blocks]
        missed = self._missed(blocks.max() + 1, random_state)[blocks]
        factors = (1 + self.table["change"].to_numpy()) / (1 + missed)
        moved = records.copy()
        targets = list(self.table.index)
        moved[targets] = records[targets].to_numpy() * factors
        return moved[kept]

    def _missed(self, n_blocks: int, random_state: int | None) -> Array:
        """Mean residuals of stretches of the old baseline by chance, (n_blocks, n_modes)."""
        values = self.old.residuals - self.old.residuals.mean()
        times = values.index
        latest = times[-1] - self.span
        if latest <= times[0]:
            return np.zeros((n_blocks, values.shape[1]))
        random = check_random_state(random_state)
        starts = times[0] + (latest - times[0]) * random.uniform(size=n_blocks)
        first, last = times.searchsorted(starts), times.searchsorted(starts + self.span)
        known = values.notna().to_numpy()
        sums, counts = (
            np.vstack([np.zeros(values.shape[1]), np.cumsum(part, axis=0)])
            for part in (np.nan_to_num(values.to_numpy()), known)
        )
        number = counts[last] - counts[first]
        return np.where(number > 0, (sums[last] - sums[first]) / np.maximum(number, 1), 0.0)


def _season_not_covered(old: pd.DatetimeIndex, new: pd.DatetimeIndex) -> Array:
    """Which weeks of old records have a time of the year that no new record has within half a week."""
    blocks = blocks_of(old)
    middle = pd.Series(old).groupby(blocks).agg(lambda some: some.iloc[len(some) // 2])
    covered = np.unique(new.dayofyear)
    distance = np.abs(middle.dt.dayofyear.to_numpy()[:, np.newaxis] - covered)
    return np.minimum(distance, YEAR / DAY - distance).min(axis=1) > WEEK.days / 2
