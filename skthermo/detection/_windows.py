"""Which records count together with each one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, range_sums
from skthermo._tables.frames import first_disorder
from skthermo.residuals.weather import parts


@dataclass(frozen=True)
class Windows:
    """Records in order of time, and the first record of the window that ends with each."""

    rows: Array
    first: NDArray[np.intp]

    @classmethod
    def of(cls, X: Any, rows: Array, window: int | str) -> Windows:
        """Windows of a number of records, or of a time on the index of a frame."""
        row = first_disorder(X)
        if row:
            raise ValueError(
                f"row {row} ({X.index[row]}) is earlier than the row before it; expected records in order of time, as "
                "X.sort_index() gives"
            )
        if not isinstance(window, str):
            return cls(rows, np.maximum(np.arange(len(rows)) - window + 1, 0))
        try:
            duration = pd.Timedelta(window)
        except ValueError:
            duration = pd.NaT
        if not duration >= pd.Timedelta("1s"):
            raise ValueError(f"window is {window!r}; expected a number of records, or a time such as '24h'")
        times = getattr(X, "index", None)
        if not isinstance(times, pd.DatetimeIndex) or times.hasnans:
            raise ValueError(
                f"window is {window!r}, a time, but the records are not a frame with a stamp for each; expected a "
                "DatetimeIndex, or a number of records as the window"
            )
        return cls(rows, times.searchsorted(times - duration, side="right"))

    def sums(self, values: Array) -> Array:
        """Sums of the values of the records in every window."""
        return range_sums(values, self.first, np.arange(len(values)) + 1)

    def inside(self, values: Array) -> Array:
        """The value of each record in every window, (n_rows, longest), in order of time after NaN in shorter ones."""
        padded = np.concatenate([np.full(self.longest - 1, np.nan), values])
        last = np.lib.stride_tricks.sliding_window_view(padded, self.longest)
        return np.where(np.arange(self.longest) >= self.longest - self.sizes[:, np.newaxis], last, np.nan)

    def ending_in(self, start: int, stop: int) -> Windows:
        """The windows that end in a run of records, after those of the records before it that they need."""
        before = self.first[start]
        return Windows(self.rows[before:stop], np.maximum(self.first[before:stop] - before, 0))

    def runs(self) -> Iterator[slice]:
        """Runs of records whose windows fit into memory."""
        return parts(len(self.rows), self.longest)

    @cached_property
    def n_known(self) -> NDArray[np.intp]:
        """Number of records with a value in every window."""
        return self.sums((~np.isnan(self.rows)).any(axis=1).astype(np.intp))

    @property
    def sizes(self) -> NDArray[np.intp]:
        """Number of records in every window."""
        return np.arange(len(self.rows)) - self.first + 1

    @property
    def longest(self) -> int:
        """Largest number of records in a window."""
        return int(self.sizes.max())
