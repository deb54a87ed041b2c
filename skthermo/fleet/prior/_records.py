"""Records of one bridge as a prior reads them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skthermo._arrays import Array, spread_evenly
from skthermo._times import has_stamps, row_times

MOST_ROWS = 20_000
DAY = 86_400e9  # nanoseconds


@dataclass(frozen=True)
class BridgeRecords:
    """Inputs (n, d) and logarithms (n, q) of positive quantities; ``weights`` are relative precisions of the rows.

    ``step`` is the usual time from row to row, in days.
    """

    inputs: Array
    logs: Array
    names: list[Any]
    weights: Array
    step: float = 1.0

    @classmethod
    def of(
        cls,
        inputs: Array,
        values: Array,
        names: Sequence[Any],
        weights: Array | None = None,
        times: Array | None = None,
    ) -> BridgeRecords:
        """The usable rows, evenly spread where there are very many; without times in days, rows are days."""
        weights = np.ones(len(inputs)) if weights is None else weights
        usable = usable_rows(inputs, values, weights)
        rows = spread_evenly(np.flatnonzero(usable), MOST_ROWS)
        for name, column in zip(names, values[rows].T, strict=True):
            if np.isnan(column).all():
                raise ValueError(f"quantity {name!r} is NaN in all {len(rows)} rows that can be used; expected values")
            if (column <= 0).any():
                raise ValueError(f"quantity {name!r} falls to {np.nanmin(column):g}; expected positive numbers")
        steps = np.diff(np.arange(len(inputs)) if times is None else times)[: len(rows)]
        step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
        step *= usable.sum() / max(len(rows), 1)
        return cls(inputs[rows], np.log(values[rows]), list(names), weights[rows], step)

    @property
    def n_outputs(self) -> int:
        """Number of quantities, q."""
        return self.logs.shape[1]


def days_of(table: Any) -> Array | None:
    """Days since the first row of a frame with stamps; None for other tables."""
    return row_times(table) / DAY if has_stamps(table) else None


def usable_rows(inputs: Array, values: Array, weights: Array | None) -> Array:
    """Rows with all inputs, at least one value and a weight."""
    usable = ~(np.isnan(inputs).any(axis=1) | np.isnan(values).all(axis=1))
    return usable if weights is None else usable & (weights > 0)
