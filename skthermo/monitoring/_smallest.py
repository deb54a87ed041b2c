"""By how much responses have to fall until a detector raises an alarm."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._estimators.answers import answers_kept
from skthermo._tables.arrays import Array
from skthermo._tables.saved_frames import SavesFrames
from skthermo._tables.text import duration_text, percent

WEEK = pd.Timedelta("7D")
STEPS = (0.0, 0.5, 2.0, 5.0)  # standard deviations of a response, by which it is lowered
MOST_PROBED = 1000  # records of the baseline that are lowered, whole weeks of them
LARGE = 0.025  # fall of all natural frequencies that a monitor should see: 5 % of the stiffness of the structure


def blocks_of(times: pd.DatetimeIndex, length: pd.Timedelta = WEEK) -> NDArray[np.intp]:
    """Number of the block of each record, counted without gaps."""
    numbers = (times - times[0]) // length
    return np.unique(numbers, return_inverse=True)[1]


def whole_weeks(records: pd.DataFrame, most: int) -> pd.DataFrame:
    """Whole weeks, evenly spread, of at most some number of records, or one week."""
    if len(records) <= most:
        return records
    blocks = blocks_of(records.index)
    n_blocks = blocks.max() + 1
    chosen = np.unique(np.linspace(0, n_blocks - 1, max(n_blocks * most // len(records), 1)).astype(int))
    return records[np.isin(blocks, chosen)]


def lowered(records: pd.DataFrame, falls: Mapping[Any, Any]) -> pd.DataFrame:
    """Records of which some responses are lower."""
    changed = records.copy()
    for name, fall in falls.items():
        changed[name] -= fall
    return changed


def crossing(steps: Array, ratios: Array) -> float:
    """The step at which a ratio exceeds 1; NaN if it does so without any.

    Squared indices grow with squared steps, nearly on straight lines.
    """
    squares = ratios**2
    above = np.flatnonzero(squares > 1)
    if len(above) and above[0] == 0:
        return np.nan
    after = above[0] if len(above) else len(steps) - 1
    slope = (squares[after] - squares[after - 1]) / (steps[after] ** 2 - steps[after - 1] ** 2)
    return float(np.sqrt(steps[after - 1] ** 2 + (1 - squares[after - 1]) / slope)) if slope > 0 else np.nan


@dataclass(frozen=True)
class SmallestChanges:
    """Falls of responses that a threshold sees: half of the records are above it, and an alarm follows ``within`` days.

    ``common`` is that of all responses by one share, NaN where some are not positive throughout; ``single`` that of
    each alone, a share where ``is_relative``, else in its unit. NaN where no fall is seen.
    """

    common: float
    single: dict[Any, float]
    is_relative: bool
    within: pd.Timedelta

    @property
    def is_large(self) -> bool:
        """Whether a large fall of all responses is not detected, and a larger one is."""
        return self.is_relative and self.common > LARGE

    def as_dict(self) -> dict[str, Any]:
        """Plain values: NaN is None, ``within`` in seconds."""
        single = {str(name): _known(value) for name, value in self.single.items()}
        return {"common": _known(self.common), "single": single, "within": self.within.total_seconds()}

    def __str__(self) -> str:
        seen = {name: value for name, value in self.single.items() if np.isfinite(value)}
        parts = [f"all responses by {percent(self.common, '.2g')}"] if np.isfinite(self.common) else []
        if seen:
            least, most = min(seen, key=seen.__getitem__), max(seen, key=seen.__getitem__)
            values = [percent(seen[name], ".2g") if self.is_relative else f"{seen[name]:.2g}" for name in (least, most)]
            ends = f"by {values[0]} ({least})" + (f" to {values[1]} ({most})" if most != least else "")
            parts.append(f"one response alone {ends}")
        if not parts:
            return "no fall of the responses raises an alarm"
        text = f"a fall of {', or of '.join(parts)} raises an alarm within {duration_text(self.within)}"
        return text.replace("\N{NO-BREAK SPACE}", " ")


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


@dataclass(frozen=True)
class LoweredIndices(SavesFrames):
    """Median damage indices of a baseline of which responses are lowered, each alone and, last, all by one share.

    ``steps`` are by how much, (n_changes, n_steps): shares where all responses are positive throughout, which
    ``is_relative`` says, else in their units, and then there is no common change.
    """

    names: list[Any]
    steps: Array
    medians: Array
    is_relative: bool
    within: pd.Timedelta

    @classmethod
    @answers_kept()  # of the weather, which is the same in all calls
    def of(
        cls,
        index_of: Callable[[pd.DataFrame], Array],
        records: pd.DataFrame,
        names: Sequence[Any],
        deviations: Array,
        within: pd.Timedelta,
    ) -> LoweredIndices:
        """By a detector's indices of records in order of time; ``deviations`` are those of the responses."""
        some, steps = whole_weeks(records, MOST_PROBED), np.array(STEPS)
        is_relative = bool((records[list(names)].min() > 0).all())
        scale = some[list(names)].mean().to_numpy() if is_relative else np.ones(len(names))
        shares = deviations / scale
        start = index_of(some)
        curves = [[{name: step * size} for step in steps[1:]] for name, size in zip(names, deviations, strict=True)]
        sizes = [*shares]
        if is_relative:
            sizes.append(float(np.median(shares)))
            curves.append([{name: step * sizes[-1] * some[name] for name in names} for step in steps[1:]])
        indices = [np.array([start, *(index_of(lowered(some, falls)) for falls in curve)]) for curve in curves]
        return cls(
            list(names), np.outer(sizes, steps), np.array([_medians(one) for one in indices]), is_relative, within
        )

    def smallest(self, threshold: float) -> SmallestChanges:
        """The falls by which the median index exceeds a threshold."""
        found = [crossing(*pair) for pair in zip(self.steps, self.medians / threshold, strict=True)]
        found = [one if one < 1 or not self.is_relative else np.nan for one in found]
        common = found[len(self.names)] if self.is_relative else np.nan
        single = dict(zip(self.names, found, strict=False))
        return SmallestChanges(common, single, self.is_relative, self.within)


def _medians(indices: Array) -> Array:
    """Median over the records that have an index at each step."""
    known = indices[:, ~np.isnan(indices).any(axis=0)]
    return np.median(known, axis=1) if known.size else np.full(len(indices), np.nan)
