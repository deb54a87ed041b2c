"""Records in a row in which a column has no value, repeats one or shows what cannot be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skthermo._tables.arrays import Array
from skthermo.preprocessing.checks import equal_runs

Counts = NDArray[np.int64]
MISSING, REPEATED, ABSURD = range(3)
FEWEST = np.array([3, 5, 3])  # records of a run of each kind that may be a fault
USUAL_RANK = 3  # the usual run is the longest but so many: faults of the baseline are no rule
TIMES_LONGEST = (1.7, 4.0)  # times the longest run of the baseline that faults exceed
TIMES_USUAL = (3.0, 4.0)  # times its usual run


@dataclass(frozen=True)
class Runs:
    """Last value of each column, and number of records and first stamp (ns) of its current run of each kind."""

    last: Array
    counts: Counts
    since: Counts

    @classmethod
    def none(cls, last: Array) -> Runs:
        """No run yet, after these last values."""
        return cls(last, np.zeros((3, len(last)), dtype=np.int64), np.zeros((3, len(last)), dtype=np.int64))

    def after(self, stamps: Counts, values: Array, absurd: NDArray[np.bool_]) -> Runs:
        """Runs after more records; those without any value tell nothing of a single column."""
        runs = self
        for stamp, row, is_absurd in zip(stamps, values, absurd, strict=True):
            runs = runs._next(stamp, row, is_absurd)
        return runs

    def _next(self, stamp: np.int64, row: Array, absurd: NDArray[np.bool_]) -> Runs:
        """Runs after one more record."""
        seen = ~np.isnan(row)
        if not seen.any():
            return self
        begun = ~np.isnan(self.last)
        counts = np.array(
            [
                np.where(seen | ~begun, 0, self.counts[MISSING] + 1),
                np.where(seen, np.where(row == self.last, self.counts[REPEATED] + 1, 1), self.counts[REPEATED]),
                np.where(seen, np.where(absurd, self.counts[ABSURD] + 1, 0), self.counts[ABSURD]),
            ]
        )
        fresh = (counts == 1) & ((self.counts != 1) | np.array([~seen, seen, seen]))
        return Runs(np.where(seen, row, self.last), counts, np.where(fresh, stamp, self.since))


@dataclass(frozen=True)
class RunLimits:
    """Number of records from which a run of each kind is a fault, (3, n_columns), and each column's last value."""

    limits: Counts
    last: Array

    @classmethod
    def of(cls, values: Array, per_day: float) -> RunLimits:
        """Learn from records of the baseline, in order of time."""
        limits = np.repeat(FEWEST[:, np.newaxis], values.shape[1], axis=1)
        seen = values[~np.isnan(values).all(axis=1)]
        last = np.full(values.shape[1], np.nan)
        for column, series in enumerate(seen.T):
            known = np.flatnonzero(~np.isnan(series))
            if not known.size:
                continue
            last[column] = series[known[-1]]
            lengths = [np.diff(known) - 1, equal_runs(series[known])[1]]
            least = [max(FEWEST[MISSING], round(per_day)), FEWEST[REPEATED]]
            for kind, runs in enumerate(lengths):
                runs = np.sort(runs[runs > kind])[::-1]
                longest, usual = runs[0] if len(runs) else 0, runs[USUAL_RANK - 1] if len(runs) >= USUAL_RANK else 0
                usually = min(TIMES_LONGEST[kind] * longest, TIMES_USUAL[kind] * usual)
                has_gaps = kind == MISSING and longest > 0
                limits[kind, column] = max((1 + has_gaps) * least[kind], int(np.ceil(usually)))
        return cls(limits, last)
