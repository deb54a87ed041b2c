"""Records of one bridge as a prior reads them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skthermo._arrays import Array, spread_evenly
from skthermo._times import has_stamps, row_times

MOST_ROWS = 20_000
UNSEEN = 1e-8  # size of a direction of ln theta in the frequencies, beside the largest, below which none sees it
ROWS_PER_EFFECTIVE_ROW = 10.0  # by which the damping of a chain exceeds the precision of its inverse's prior, per row
DAY = 86_400e9  # nanoseconds
LEAST_PRECISION = 1e-9  # of levels, beside that of one record


@dataclass(frozen=True)
class BridgeRecords:
    """Inputs (n, d) and logarithms (n, q) of positive quantities; ``weights`` are relative precisions of the rows.

    ``seen``, (r, q), turns ln theta into what was measured in deviations of the noise: z = A ln theta, rotated, without
    directions that no frequency sees; None where the quantities themselves were measured. ``level_precision``, (q,),
    is what is known of the levels without any record. ``step`` is the usual time from row to row, in days.
    """

    inputs: Array
    logs: Array
    names: list[Any]
    weights: Array
    seen: Array | None
    level_precision: Array
    step: float = 1.0

    @classmethod
    def of(
        cls,
        inputs: Array,
        values: Array,
        names: Sequence[Any],
        weights: Array | None = None,
        coordinates: Any = None,
        times: Array | None = None,
    ) -> BridgeRecords:
        """The usable rows, evenly spread where there are very many; without times in days, rows are days."""
        weights = np.ones(len(inputs)) if weights is None else weights
        usable = usable_rows(inputs, values, weights, complete=coordinates is not None)
        rows = spread_evenly(np.flatnonzero(usable), MOST_ROWS)
        for name, column in zip(names, values[rows].T, strict=True):
            if np.isnan(column).all():
                raise ValueError(f"quantity {name!r} is NaN in all {len(rows)} rows that can be used; expected values")
            if (column <= 0).any():
                raise ValueError(f"quantity {name!r} falls to {np.nanmin(column):g}; expected positive numbers")
        seen, level_precision = None, np.zeros(values.shape[1])
        if coordinates is not None:
            _, sizes, vectors = np.linalg.svd(coordinates.sensitivities, full_matrices=False)
            kept = sizes > UNSEEN * sizes[0]
            seen = sizes[kept, np.newaxis] * vectors[kept]
            level_precision = coordinates.damping * len(rows) / ROWS_PER_EFFECTIVE_ROW
            level_precision = np.maximum(level_precision, LEAST_PRECISION * (seen**2).sum())
        steps = np.diff(np.arange(len(inputs)) if times is None else times)[: len(rows)]
        step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
        step *= usable.sum() / max(len(rows), 1)
        return cls(inputs[rows], np.log(values[rows]), list(names), weights[rows], seen, level_precision, step)

    @property
    def n_outputs(self) -> int:
        """Number of quantities, q."""
        return self.logs.shape[1]

    def measured(self, logs: Array) -> Array:
        """What was measured where the quantities have these logarithms."""
        return logs if self.seen is None else logs @ self.seen.T


def days_of(table: Any) -> Array | None:
    """Days since the first row of a frame with stamps; None for other tables."""
    return row_times(table) / DAY if has_stamps(table) else None


def usable_rows(inputs: Array, values: Array, weights: Array | None, *, complete: bool = False) -> Array:
    """Rows with all inputs, at least one value (or all of them) and a weight."""
    gaps = np.isnan(values)
    usable = ~np.isnan(inputs).any(axis=1) & ~(gaps.any(axis=1) if complete else gaps.all(axis=1))
    return usable if weights is None else usable & (weights > 0)
