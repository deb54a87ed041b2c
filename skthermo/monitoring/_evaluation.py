"""What a fitted detector says of records: damage indices, the modes and groups that drive them, why there is none."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from scipy.sparse.csgraph import connected_components
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


def index_of(detector: Any, columns: list[Any], records: pd.DataFrame) -> Array:
    """Damage indices of records; the reason of each record stands for a warning of the detector."""
    with collected(drop_others=True):
        return -np.asarray(detector.score_samples(records[columns]), dtype=float)


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


def window_of(detector: Any) -> Lookback:
    """How far back a fitted detector takes means of residuals; its memory of the weather delays no alarm."""
    *_, last = parts = parts_of(detector)
    after = 1 + max((n for n, part in enumerate(parts) if isinstance(part, TemperatureCompensator)), default=-1)
    averaged = [last.means_] if isinstance(last, CompensatedDetector) else parts[after:]
    found = [Lookback.learned(part) for part in averaged if part is not None]
    return Lookback(sum(one.rows for one in found), sum((one.time for one in found), pd.Timedelta(0)))


def residuals(
    detector: Any, records: pd.DataFrame, targets: list[Any], trained: pd.DataFrame, *, is_baseline: bool = False
) -> pd.DataFrame:
    """What the weather does not explain of each record, without windows; departures from the mean of the baseline where
    the detector has no compensator. Those of the baseline itself are out of fold."""
    *steps, last = parts_of(detector)
    with collected(drop_others=True):
        if isinstance(last, CompensatedDetector):
            before, compensator = steps, last.compensator_
        else:
            places = [n for n, step in enumerate(steps) if isinstance(step, TemperatureCompensator)]
            if not places:
                return records[targets] - trained[targets].mean()
            before, compensator = steps[: places[0]], steps[places[0]]
        rest = compensator.residuals_ if is_baseline else compensator.transform(_through(before, records))
    return in_order(compensator, as_floats(rest), targets).set_index(records.index)


def in_order(compensator: TemperatureCompensator, values: Array, targets: list[Any]) -> pd.DataFrame:
    """Values of the targets of a compensator in the order of some targets."""
    names = list(compensator.get_feature_names_out())
    if not set(names) <= set(targets):  # a step before has made arrays of the records
        return pd.DataFrame(values[:, np.argsort(compensator.targets_)], columns=targets)
    return pd.DataFrame(values, columns=names).reindex(columns=targets)


def scales_of(detector: Any, targets: list[Any], trained: pd.DataFrame) -> Array:
    """Standard deviations of what a detector sees of each target while nothing changes."""
    *steps, last = parts_of(detector)
    places = [step for step in steps if isinstance(step, TemperatureCompensator)]
    if not places and not isinstance(last, CompensatedDetector):
        return trained[targets].std(ddof=0).replace(0.0, 1.0).to_numpy()
    scale = last.scale_ if isinstance(last, CompensatedDetector) else places[0].scale_
    compensator = last.compensator_ if isinstance(last, CompensatedDetector) else places[0]
    return in_order(compensator, np.where(scale > 0, scale, 1.0)[np.newaxis], targets).to_numpy()[0]


def departures(detector: Any, records: pd.DataFrame, targets: list[Any], trained: pd.DataFrame) -> Array:
    """Residuals of records in standard deviations, of windows where the detector has such."""
    *steps, last = parts_of(detector)
    if isinstance(last, CompensatedDetector):
        with collected(drop_others=True):
            rest = in_order(last.compensator_, as_floats(last.residuals(_through(steps, records))), targets)
    else:
        rest = residuals(detector, records, targets, trained)
    return rest.to_numpy() / scales_of(detector, targets, trained)


def _through(steps: list[Any], records: pd.DataFrame) -> Any:
    table: Any = records
    for step in steps:
        table = step.transform(table)
    return table


def directions_of(detector: Any) -> DirectionalDetector | None:
    """The fitted detector that has directions of losses of stiffness of damage groups, if there is one."""
    last = parts_of(detector)[-1]
    one = last.detectors_[0] if isinstance(last, CompensatedDetector) else last
    is_directional = isinstance(one, DirectionalDetector) and not isinstance(one.directions, str)
    return one if is_directional and len(sensitivities_of(one)) else None


def sensitivities_of(directional: DirectionalDetector) -> pd.Series:
    """By how many standard deviations a whole loss of stiffness of each group moves a record."""
    found = directional.sensitivities_
    return found[~found.index.str.endswith(", section")]


def losses_of(detector: Any) -> pd.DataFrame | None:
    """Loss of stiffness of each damage group that moves a record by one standard deviation, and the relative changes
    by it."""
    directional = directions_of(detector)
    if directional is None:
        return None
    known = sensitivities_of(directional)
    seen = known[known > 0]
    return directional.directions_.loc[seen.index].div(seen, axis=0).assign(loss=1 / seen)


def group_effects(detector: Any, records: pd.DataFrame) -> pd.DataFrame:
    """Losses of stiffness of the damage groups, as in column "loss top", and their effects in standard deviations,
    "effect top".

    NaN where they explain less than half of a record. Groups that cannot be distinguished are one, such as "top or
    bottom"; no columns without such directions.
    """
    directional = directions_of(detector)
    if directional is None:
        return pd.DataFrame(index=records.index)
    *steps, last = parts_of(detector)
    with collected(drop_others=True):
        table = _through(steps, records)
        losses, shares = last.severities(table).set_axis(records.index), last.explained(table)
    sensitivities, joined = sensitivities_of(directional), joined_names(directional)
    losses, effects = (one.T.groupby(joined).sum().T for one in (losses, (losses * sensitivities).round(2)))
    is_explained = (effects > 0) & (np.round(shares, 4)[:, np.newaxis] >= 0.5)
    found = {"loss ": losses.round(6), "effect ": effects}
    return pd.concat([one.where(is_explained).add_prefix(prefix) for prefix, one in found.items()], axis=1)


def joined_names(directional: DirectionalDetector) -> dict[str, str]:
    """Names of damage groups, those that cannot be distinguished as one, such as "top or bottom"."""
    names = sensitivities_of(directional).index
    alike = pd.DataFrame(np.eye(len(names)), names, names)
    for one, other in directional.indistinguishable_:
        if {one, other} <= {*names}:
            alike.loc[one, other] = 1.0
    together = pd.Series(connected_components(alike.to_numpy(), directed=False)[1], names)
    return {name: " or ".join(names[together == together[name]]) for name in names}


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


def refuse_other_batches(detector: Any, columns: list[Any], trained: pd.DataFrame, lookback: Lookback) -> None:
    """Refuse a detector that evaluates a record otherwise among all than with the records it looks back to."""
    times = trained.index.asi8
    rows = np.linspace(len(times) // 2, min(len(times) // 2 + 100, len(times) - 1), 5).astype(np.intp)
    first = max(lookback.start(times, int(rows[0])) - 100, 0)
    whole = index_of(detector, columns, trained.iloc[first : rows[-1] + 100])[rows - first]
    parts = (trained.iloc[lookback.start(times, int(row)) : row + 1] for row in rows)
    alone = np.array([index_of(detector, columns, part)[-1] for part in parts])
    same = np.isclose(whole, alone, rtol=1e-6, atol=1e-9, equal_nan=True)
    if not same.all():
        row = int(np.argmin(same))
        raise ValueError(
            f"the damage index of {trained.index[rows[row]]} is {whole[row]:.6g} among all records and "
            f"{alone[row]:.6g} with the records of {lookback} before it. The detector uses later records, or "
            "earlier ones; expected steps that look back only, and lookback='48h' if that is how far"
        )


def blind_findings(
    detector: Any, columns: list[Any], trained: pd.DataFrame, targets: list[Any], lookback: Lookback, threshold: float
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
        indices = (pd.Series(index_of(detector, columns, records)[-n_last:]) for records in changed)
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
