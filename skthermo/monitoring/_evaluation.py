"""What a fitted detector says of records: damage indices, the modes and groups that drive them, why there is none."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from scipy.sparse.csgraph import connected_components
from sklearn.base import clone
from sklearn.pipeline import Pipeline

from skthermo._core.arrays import Array, as_floats
from skthermo._core.estimators import BaseSearchCV
from skthermo._core.frames import DAY
from skthermo._core.text import duration_text
from skthermo._core.warnings import collected
from skthermo.detection import CompensatedDetector, DirectionalDetector, TemperatureCompensator
from skthermo.exceptions import ResultWarning
from skthermo.monitoring._events import lowered
from skthermo.monitoring._records import Lookback
from skthermo.preprocessing import BlockedKFold

IndexOf: TypeAlias = Callable[[pd.DataFrame], Array]  # damage indices of records in order of time


def rounded(index: Array) -> Array:
    """Indices with six decimals, and above 10 with seven digits: their last bits depend on how many there are."""
    scale = 10.0 ** (6 - np.floor(np.log10(np.clip(np.abs(index), 1.0, 1e300))))
    return np.round(index * scale) / scale


def parts_of(detector: Any) -> list[Any]:
    """The steps of a fitted pipeline or search, the detector last."""
    if isinstance(detector, BaseSearchCV):
        return parts_of(detector.best_estimator_)
    if isinstance(detector, Pipeline):
        return [part for _, step in detector.steps for part in parts_of(step)]
    return [] if detector is None or detector == "passthrough" else [detector]


class DetectorParts:
    """A fitted detector taken apart, and what it says of records beside their index.

    ``steps`` come before the compensator, and ``after`` takes means of what that leaves, such as a window. Without a
    compensator, the records themselves are evaluated, as departures from the mean of ``trained``.
    """

    def __init__(self, detector: Any, targets: list[Any], trained: pd.DataFrame):
        *self.steps, self.last = self.after = parts_of(detector)
        self.targets, self.trained = targets, trained
        self.is_whole, self.compensator = isinstance(self.last, CompensatedDetector), None
        places = [place for place, step in enumerate(self.steps) if isinstance(step, TemperatureCompensator)]
        if self.is_whole:
            self.compensator, self.after = self.last.compensator_, [part for part in [self.last.means_] if part]
        elif places:
            self.compensator, self.after = self.steps[places[0]], self.after[places[0] + 1 :]
            self.steps = self.steps[: places[0]]

    def window(self) -> Lookback:
        """How far back means of residuals are taken; the memory of the weather delays no alarm."""
        return Lookback.learned(*self.after)

    def residuals(self, records: pd.DataFrame, *, in_windows: bool = False) -> pd.DataFrame:
        """What the weather does not explain of each record, of windows where these are asked for and there are some."""
        if self.compensator is None:
            return records[self.targets] - self.trained[self.targets].mean()
        rest_of = self.last.residuals if in_windows and self.is_whole else self.compensator.transform
        with collected(drop_others=True):
            rest = rest_of(through(self.steps, records))
        return self._in_order(as_floats(rest)).set_index(records.index)

    def out_of_fold(self, block: pd.Timedelta) -> pd.DataFrame:
        """Residuals of the baseline by regressions that have not learned from the same block of time.

        Means over a block scatter as they will in other years; out of shorter folds they scatter too little. Folds
        that somebody has chosen stay.
        """
        compensator = self.compensator
        if compensator is None:
            return self.residuals(self.trained)
        if compensator.cv is None:
            folds = list(BlockedKFold(block=block).split(self.trained))
            with collected(drop_others=True):
                compensator = clone(compensator).set_params(cv=folds).fit(through(self.steps, self.trained))
        return self._in_order(as_floats(compensator.residuals_)).set_index(self.trained.index)

    def _in_order(self, values: Array) -> pd.DataFrame:
        """Values of the compensator's targets in the order of the monitor's."""
        names = list(self.compensator.get_feature_names_out())
        if not set(names) <= set(self.targets):  # a step before has made arrays of the records
            return pd.DataFrame(values[:, np.argsort(self.compensator.targets_)], columns=self.targets)
        return pd.DataFrame(values, columns=names).reindex(columns=self.targets)

    @cached_property
    def scales(self) -> Array:
        """Standard deviations of what the detector sees of each target while nothing changes."""
        if self.compensator is None:
            return self.trained[self.targets].std(ddof=0).replace(0.0, 1.0).to_numpy()
        scale = (self.last if self.is_whole else self.compensator).scale_
        return self._in_order(np.where(scale > 0, scale, 1.0)[np.newaxis]).to_numpy()[0]

    @cached_property
    def groups(self) -> pd.DataFrame | None:
        """Relative changes of the modes by a whole loss of stiffness of each damage group, None without directions.

        Also by how many standard deviations it moves a record (``sensitivity``), and the name of all groups that cannot
        be distinguished from it, such as "top or bottom" (``joined``).
        """
        directional = self.last.detectors_[0] if self.is_whole else self.last
        if not isinstance(directional, DirectionalDetector) or isinstance(directional.directions, str):
            return None
        found = directional.sensitivities_
        found = found[~found.index.str.endswith(", section")]
        alike = pd.DataFrame(np.eye(len(found)), found.index, found.index)
        for one, other in directional.indistinguishable_:
            if {one, other} <= {*found.index}:
                alike.loc[one, other] = 1.0
        together = pd.Series(connected_components(alike.to_numpy(), directed=False)[1], found.index)
        joined = together.groupby(together).transform(lambda same: " or ".join(same.index))
        return directional.directions_.loc[found.index].assign(sensitivity=found, joined=joined) if len(found) else None

    def effects(self, records: pd.DataFrame) -> pd.DataFrame:
        """Losses of stiffness of the damage groups, as in column "loss top", and their effects in standard deviations,
        "effect top".

        NaN where they explain less than half of a record. No columns without directions of groups.
        """
        if self.groups is None:
            return pd.DataFrame(index=records.index)
        with collected(drop_others=True):
            table = through(self.steps, records)
            losses, shares = self.last.severities(table).set_axis(records.index), self.last.explained(table)
        moved = (losses * self.groups["sensitivity"]).round(2)
        losses, effects = (one.T.groupby(self.groups["joined"]).sum().T for one in (losses, moved))
        is_explained = (effects > 0) & (np.round(shares, 4)[:, np.newaxis] >= 0.5)
        found = {"loss ": losses.round(6), "effect ": effects}
        return pd.concat([one.where(is_explained).add_prefix(prefix) for prefix, one in found.items()], axis=1)


def through(steps: list[Any], records: pd.DataFrame) -> Any:
    """Records as the last of some steps gives them."""
    table: Any = records
    for step in steps:
        table = step.transform(table)
    return table


def outages_of(times: pd.DatetimeIndex, step: pd.Timedelta, reach: pd.Timedelta) -> list[tuple[pd.Timestamp, Any, Any]]:
    """First stamp after each outage, the last one of a record that reaches into it, and how long it was."""
    steps = times[1:] - times[:-1]
    ends = np.flatnonzero(steps > 3 * step)
    return [(times[end + 1], times[end + 1] + reach, steps[end]) for end in ends]


def causes(
    new: pd.DataFrame,
    targets: list[Any],
    temperatures: list[Any],
    index: Array,
    outages: list[tuple[pd.Timestamp, Any, Any]],
    regime: tuple[Any, float] | None = None,
) -> list[str]:
    """Why new records have no damage index, or whose index they have; "" for the others.

    A record that reaches into an outage names it. Windows hold records of one ``regime``: up to a value of an input, or
    above it.
    """
    without = {"mode": new[targets].isna().all(axis=1).to_numpy()}
    without["temperature"] = new[temperatures].isna().all(axis=1).to_numpy() if temperatures else without["mode"]
    what = np.select(list(without.values()), [f"no {name} has a value" for name in without], "")
    within = "" if regime is None else f" and regime ({regime[0]} up to or above {regime[1]:.3g})"
    few = f"too few values in its window{within}, its lags or among its modes"
    unknown = np.where(what == "", few, what).astype(object)
    for end, until, length in outages:
        text = f"too few records for its window, means or lags since the outage of {duration_text(length)}"
        unknown[(new.index >= end) & (new.index <= until) & (what == "")] = f"{text} up to {end:%Y-%m-%d %H:%M}"
    others = np.where(what == "", "", np.char.add(what, ": others of its window are evaluated"))
    return np.where(np.isnan(index), unknown, others).tolist()


def refuse_other_batches(index_of: IndexOf, trained: pd.DataFrame, lookback: Lookback) -> None:
    """Refuse a detector that evaluates a record otherwise among all than with the records it looks back to."""
    times = trained.index.asi8
    rows = np.linspace(len(times) // 2, min(len(times) // 2 + 100, len(times) - 1), 5).astype(np.intp)
    first = max(lookback.start(times, int(rows[0])) - 100, 0)
    whole = index_of(trained.iloc[first : rows[-1] + 100])[rows - first]
    parts = (trained.iloc[lookback.start(times, int(row)) : row + 1] for row in rows)
    alone = np.array([index_of(part)[-1] for part in parts])
    same = np.isclose(whole, alone, rtol=1e-6, atol=1e-9, equal_nan=True)
    if not same.all():
        row = int(np.argmin(same))
        raise ValueError(
            f"the damage index of {trained.index[rows[row]]} is {whole[row]:.6g} among all records and "
            f"{alone[row]:.6g} with the records of {lookback} before it. The detector uses later records, or "
            "earlier ones; expected steps that look back only, and lookback='48h' if that is how far"
        )


def blind_findings(
    index_of: IndexOf, trained: pd.DataFrame, targets: list[Any], lookback: Lookback, threshold: float
) -> Iterator[ResultWarning]:
    """The finding of responses whose large fall raises no alarm; an error where a larger one ends it."""
    number, times = trained[targets].notna().sum(axis=1).to_numpy(), trained.index.asi8
    row = int(number[len(number) // 2 :].argmax()) + len(number) // 2
    first = min(int(times.searchsorted(times[row] - 7 * DAY.value)), row)  # single records may lack a full window
    part, blind = trained.iloc[lookback.start(times, first) : row + 1], []
    n_last = row + 1 - first
    for target, deviation in trained[targets].std(ddof=0).replace(0.0, 1.0).items():
        sizes = (5, 20, 80)  # standard deviations by which it is lowered
        changed = (lowered(part, {target: size * deviation}) for size in sizes)
        indices = (pd.Series(index_of(records)[-n_last:]) for records in changed)
        seen = [index.median() > threshold for index in indices]
        for smaller, larger, *found in zip(sizes[:-1], sizes[1:], seen[:-1], seen[1:], strict=True):
            if found == [True, False]:
                raise ValueError(
                    f"the detector is in alarm where {target} falls by {smaller} standard deviations of the baseline, "
                    f"and not where it falls by {larger}. One of its steps drops or fills large changes; expected an "
                    "alarm for larger changes, too. Filter the baseline before fit"
                )
        blind += [] if seen[-1] else [str(target)]
    if blind:
        yield ResultWarning(
            f"a fall by {sizes[-1]} standard deviations of the baseline stays at or below the threshold "
            f"{threshold:.3g} for {', '.join(blind)}. The detector does not see damage there. Use another detector, or "
            "allow more false alarms a year",
            "undetected-changes",
        )
