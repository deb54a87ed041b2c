"""By how much responses have to fall, or damage groups to lose stiffness, until a detector raises an alarm."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
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
    each alone, a share where ``is_relative``, else in its unit. ``groups`` are losses of stiffness of damage groups, of
    a detector that has their directions. NaN where no fall or loss is seen.
    """

    common: float
    single: dict[Any, float]
    is_relative: bool
    within: pd.Timedelta
    groups: dict[str, float] = field(default_factory=dict)

    @property
    def is_large(self) -> bool:
        """Whether a large fall of all responses is not detected, and a larger one is."""
        return self.is_relative and self.common > LARGE

    def as_dict(self) -> dict[str, Any]:
        """Plain values: NaN is None, ``within`` in seconds."""
        single, groups = (
            {str(name): _known(value) for name, value in some.items()} for some in (self.single, self.groups)
        )
        within = self.within.total_seconds()
        return {"common": _known(self.common), "single": single, "groups": groups, "within": within}

    def __str__(self) -> str:
        parts = [f"a fall of all responses by {percent(self.common, '.2g')}"] if np.isfinite(self.common) else []
        if single := _range_text(self.single, "{:.2g} %" if self.is_relative else "{:.2g}"):
            parts.append(f"{'of' if parts else 'a fall of'} one response alone {single}")
        if groups := _range_text(self.groups, "{:.2g} %"):
            parts.append(f"a loss of stiffness {groups}")
        if not parts:
            return "no fall of the responses raises an alarm"
        text = f"{', or '.join(parts)} raises an alarm within {duration_text(self.within)}"
        return text.replace("\N{NO-BREAK SPACE}", " ")


def _range_text(changes: Mapping[Any, float], form: str) -> str:
    """The smallest and the largest of some changes, with their names; "" where none is seen."""
    seen = {name: value for name, value in changes.items() if np.isfinite(value)}
    if not seen:
        return ""
    ends = dict.fromkeys((min(seen, key=seen.__getitem__), max(seen, key=seen.__getitem__)))
    factor = 100 if "%" in form else 1
    return "by " + " to ".join(f"{form.format(factor * seen[name])} ({name})" for name in ends)


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


@dataclass(frozen=True)
class LoweredIndices(SavesFrames):
    """Median damage indices of a baseline of which responses are lowered.

    Each alone, all by one share, and as by losses of stiffness of damage groups: ``kinds`` and ``names`` say which.
    ``steps`` are by how much, (n_changes, n_steps): shares where all responses are positive throughout, which
    ``is_relative`` says, else in their units, and then there is no common change.
    """

    kinds: list[str]
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
        losses: pd.DataFrame | None = None,
    ) -> LoweredIndices:
        """By a detector's indices of records in order of time; ``deviations`` are those of the responses.

        ``losses`` are relative changes of the responses, in their order, by the loss of each damage group that moves a
        record by one standard deviation; their column ``"loss"`` is that loss.
        """
        some = whole_weeks(records, MOST_PROBED)
        responses = some[list(names)]
        is_relative = bool((records[list(names)].min() > 0).all())
        shares = deviations / (responses.mean().to_numpy() if is_relative else 1.0)
        changes = [
            ("single", name, share, {name: size}) for name, share, size in zip(names, shares, deviations, strict=True)
        ]
        if is_relative:
            share = float(np.median(shares))
            changes.append(("common", "", share, dict((share * responses).items())))
        for group, row in (pd.DataFrame() if losses is None else losses).iterrows():
            falls = -row.drop("loss").to_numpy() * responses
            changes.append(("groups", group, float(row["loss"]), dict(falls.items())))
        start, medians = index_of(some), []
        for *_, falls in changes:
            by_step = ({name: step * size for name, size in falls.items()} for step in STEPS[1:])
            medians.append(_medians(np.array([start, *(index_of(lowered(some, one)) for one in by_step)])))
        kinds, of, sizes, _ = zip(*changes, strict=True)
        return cls(list(kinds), list(of), np.outer(sizes, STEPS), np.array(medians), is_relative, within)

    def smallest(self, threshold: float) -> SmallestChanges:
        """The falls by which the median index exceeds a threshold."""
        found: dict[str, dict[Any, float]] = {"single": {}, "common": {}, "groups": {}}
        for kind, name, steps, medians in zip(self.kinds, self.names, self.steps, self.medians, strict=True):
            fall = crossing(steps, medians / threshold)
            is_share = self.is_relative or kind == "groups"
            found[kind][name] = fall if fall < 1 or not is_share else np.nan
        common = found["common"].get("", np.nan)
        return SmallestChanges(common, found["single"], self.is_relative, self.within, found["groups"])


def _medians(indices: Array) -> Array:
    """Median over the records that have an index at each step."""
    known = indices[:, ~np.isnan(indices).any(axis=0)]
    return np.median(known, axis=1) if known.size else np.full(len(indices), np.nan)
