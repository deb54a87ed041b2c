"""What two detectors say of the same healthy records, and what each would find."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from skthermo._estimators.answers import answers_kept
from skthermo._tables.arrays import Array
from skthermo.monitoring._active import ActiveDetector
from skthermo.monitoring._false_alarms import levels
from skthermo.monitoring._smallest import blocks_of, crossing, lowered, whole_weeks
from skthermo.monitoring.retraining._shift import block_mean
from skthermo.residuals.weather import BEYOND, TrainingRange

MOST_PROBED = 2000  # records whose frequencies are lowered, whole weeks of them
STEPS = (0.0, 2.0, 5.0)  # standard deviations by which they are lowered
CLEAR = 3.0  # standard errors from which a difference is one
WORSE = np.log(1.1)  # of the smallest detected change, from which it counts
FALSE, SMALLEST = "records in alarm", "smallest detected change"  # rows that decide


@dataclass(frozen=True)
class DetectorComparison:
    """The old detector and the one that may follow it, on the records that the old one has not learned from.

    ``table`` has a row for each measure: ``old``, ``new``, ``difference`` (of logarithms for the smallest changes), its
    ``standard_error`` from blocks of time, and ``worse``: whether the new one is significantly worse in it.
    """

    table: pd.DataFrame

    @classmethod
    def of(
        cls,
        old: ActiveDetector,
        new: ActiveDetector,
        overlap: pd.DataFrame,
        targets: list[Any],
        spread: pd.Series,
        events: dict[Any, pd.DataFrame],
    ) -> DetectorComparison:
        """On the overlap: false alarms, scatter, the smallest changes found, weather, and records of past events.

        ``spread`` holds standard deviations of the responses, weather taken out, in their units.
        """
        blocks = blocks_of(overlap.index)
        rates = [old.ratio(overlap), new.own_ratio(overlap.index)]
        persistence = old.estimate.rule.persistence
        rows = {
            FALSE: _compared(*(_above(levels(one, persistence)[0]) for one in rates), blocks),
            "median index over threshold": _medians(*rates),
            **dict(_rows_of_changes(*(smallest_changes(one, overlap, targets, spread) for one in (old, new)), targets)),
            "records in unknown weather": _unknown(old, new, overlap, targets),
            **dict(_found(old, new, events)),
        }
        table = pd.DataFrame(rows, index=["old", "new", "difference", "standard_error", "worse"]).T
        return cls(table.astype(dict.fromkeys(table.columns[:4], float) | {"worse": bool}))

    @property
    def fewer_false(self) -> bool:
        """Whether the new detector has clearly fewer records in alarm."""
        row = self.table.loc[FALSE]
        return bool(row["difference"] < -CLEAR * row["standard_error"])

    def worse(self) -> list[str]:
        """Measures in which the new detector is significantly worse, and which count."""
        found = list(self.table.index[self.table["worse"]])
        # A threshold that gives no false alarms any more is worth a somewhat larger smallest change.
        return [name for name in found if not (name == SMALLEST and self.fewer_false)]


def _above(ratio: Array) -> Array:
    return np.where(np.isnan(ratio), np.nan, (ratio > 1).astype(float))


def _compared(old: Array, new: Array, blocks: Array) -> list[Any]:
    """Means of both, of their difference where both evaluate, and whether it is clearly positive."""
    difference, error = block_mean(new - old, blocks)
    return [np.nanmean(old), np.nanmean(new), difference, error, bool(difference > CLEAR * error)]


def _medians(old: Array, new: Array) -> list[Any]:
    medians = [float(np.nanmedian(one)) for one in (old, new)]
    return [*medians, medians[1] - medians[0], np.nan, False]


@answers_kept()
def smallest_changes(active: ActiveDetector, records: pd.DataFrame, targets: list[Any], spread: pd.Series) -> Array:
    """By how much each mode has to be lowered, relatively, until half of the records are above the threshold.

    For each week and, last, for all records, (n_modes, n_weeks + 1); at most some number of whole weeks are taken.
    """
    records = whole_weeks(records, MOST_PROBED)
    blocks = blocks_of(records.index)
    found, start = np.full((len(targets), blocks.max() + 2), np.nan), active.ratio(records)
    for mode, target in enumerate(targets):
        fallen = (lowered(records, {target: step * spread[target]}) for step in STEPS[1:])
        steps = np.array(STEPS) * (spread[target] / (records[target].mean() if records[target].min() > 0 else 1.0))
        ratios = [active.ratio(one) for one in fallen]
        curve = np.array([start, *ratios])
        found[mode, -1] = _crossing(steps, curve)
        for block in range(blocks.max() + 1):
            found[mode, block] = _crossing(steps, curve[:, blocks == block])
    return found


def _rows_of_changes(old: Array, new: Array, targets: list[Any]) -> Iterator[tuple[str, list[Any]]]:
    """A row for their geometric mean over the modes, which decides, and one for each mode."""
    logs = np.log(np.array([old, new]))
    known = np.isfinite(logs).all(axis=0)
    together = np.where(known, logs, 0.0).sum(axis=1) / np.where(known.any(axis=0), known.sum(axis=0), np.nan)
    for name, values in [(SMALLEST, together), *zip(targets, logs.transpose(1, 0, 2), strict=True)]:
        change = values[1] - values[0]
        error = block_mean(change[:-1], np.arange(len(change) - 1))[1]
        row = [*np.exp(values[:, -1]), change[-1], error]
        if name == SMALLEST:
            yield name, [*row, bool(change[-1] - CLEAR * error > WORSE)]
        else:
            yield f"{SMALLEST}, {name}", [*row, False]


def _crossing(steps: Array, curve: Array) -> float:
    """The step at which the median of the records' ratios exceeds 1; NaN if it does so without any."""
    curve = curve[:, ~np.isnan(curve).any(axis=0)]
    return crossing(steps, np.median(curve, axis=1)) if curve.size else np.nan


def _unknown(old: ActiveDetector, new: ActiveDetector, overlap: pd.DataFrame, targets: list[Any]) -> list[Any]:
    """Shares of records outside the weather of each baseline."""
    weather = [name for name in overlap.columns if name not in targets]
    if not weather:
        return [0.0, 0.0, 0.0, np.nan, False]
    shares = []
    for active in (old, new):
        known = TrainingRange.of(active.trained[weather], np.ones(len(active.trained), dtype=bool))
        shares.append(float((np.nan_to_num(known.excess(overlap[weather])) > BEYOND).any(axis=1).mean()))
    return [*shares, shares[1] - shares[0], np.nan, shares[1] > shares[0]]


def _found(
    old: ActiveDetector, new: ActiveDetector, events: dict[Any, pd.DataFrame]
) -> Iterator[tuple[str, list[Any]]]:
    """Peaks of past events over the threshold: what was found has to be found again."""
    for number, records in events.items():
        peaks = [float(np.nanmax(active.ratio(records), initial=0.0)) for active in (old, new)]
        yield f"event {number}, peak over threshold", [*peaks, peaks[1] - peaks[0], np.nan, peaks[1] <= 1 < peaks[0]]
