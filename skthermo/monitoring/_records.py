"""Records as they come: roles of columns, new, repeated, late and early ones, and how far back a detector looks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, is_dataclass
from datetime import timedelta
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, clone
from sklearn.pipeline import Pipeline

from skthermo._core.arrays import as_floats, is_model, refuse_no_table
from skthermo._core.estimators import check_is_fitted
from skthermo._core.frames import DAY, YEAR, midnights, of_a_wrong_clock, positions_of, usual_step
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.text import counted, duration_text, listed
from skthermo.detection import (
    CompensatedDetector,
    DirectionalDetector,
    MahalanobisDetector,
    TemperatureCompensator,
)
from skthermo.exceptions import FewRecordsWarning, RecordsWarning
from skthermo.preprocessing import HampelFilter
from skthermo.preprocessing.checks import RecordFindings, set_aside

OF_TRAINING = frozenset({"few-records", "useless-column"})  # gross errors that do no harm to a few records


def read_records(X: Any, columns: list[Any] | None = None, zone: Any = None) -> pd.DataFrame:
    """Records in order of time as floats, in the columns and the time zone of the baseline."""
    if not isinstance(X, pd.DataFrame):
        raise ValueError(f"the records are of type {type(X).__name__}; expected a frame on a DatetimeIndex")
    if columns is not None and not len(X):
        return pd.DataFrame(np.empty((0, len(columns))), pd.DatetimeIndex([], tz=zone).as_unit("ns"), columns)
    if not isinstance(X.index, pd.DatetimeIndex):
        raise ValueError(
            f"the records have an index of type {type(X.index).__name__} ({X.index.dtype}); expected a DatetimeIndex, "
            "as pandas.to_datetime gives"
        )
    if X.index.hasnans:
        raise ValueError(f"{X.index.isna().sum()} of {len(X)} stamps are missing; expected one for each record")
    if columns is not None:
        missing, unknown = [c for c in columns if c not in X.columns], [c for c in X.columns if c not in columns]
        if missing or unknown or X.columns.has_duplicates:
            raise ValueError(
                f"the records lack the columns {missing} of the baseline, and have {unknown} beside them"
                f"{', some of them twice' if X.columns.has_duplicates else ''}; expected the columns of the baseline "
                "(a column of NaN for a sensor that is gone)"
            )
        if str(X.index.tz) != str(zone):
            raise ValueError(
                f"the records have the time zone {X.index.tz}, the baseline {zone}; expected the same, as "
                "tz_localize or tz_convert gives"
            )
        X = X.loc[:, list(columns)]
    refuse_no_table(X, "the table of records")
    stamps = X.index.as_unit("ns")
    stamps.freq = None  # a batch and its parts differ in it
    frame = pd.DataFrame(as_floats(X), stamps, X.columns)
    return frame if X.index.is_monotonic_increasing else frame.sort_index(kind="stable")


def without_wrong_clocks(X: pd.DataFrame, records: pd.DataFrame) -> tuple[pd.DataFrame, list[RecordsWarning]]:
    """Records of a table without those that a wrong clock has stamped, and a finding that names these."""
    wrong = X.index[of_a_wrong_clock(X.index)]
    if not len(wrong):
        return records, []
    text = (
        f"the stamps of {counted(len(wrong), 'record')} of the baseline are far from the others, {wrong.min()} to "
        f"{wrong.max()}. They are set aside, as of a wrong clock. Correct their stamps if they count"
    )
    return records[~records.index.isin(wrong)], [RecordsWarning(text, "wrong-stamps")]


def refuse_other_units(new: pd.DataFrame, baseline: pd.DataFrame, far: float = 10.0, fewest: int = 12) -> None:
    """Raise an error for temperatures that are in another unit than the baseline's.

    In most records all of them are ``far`` degrees warmer or colder than the baseline ever was in that season, and
    within it as in the other unit. Of a single thermometer, a few records may be its fault.
    """
    known = new.columns[new.notna().any()]
    if not len(known) or new[known].count().sum() < (fewest if len(known) == 1 else 1):
        return
    new, baseline = new[known], baseline[known]
    units = {"degrees Celsius": (1.0, 0.0), "degrees Fahrenheit": (1.8, 32.0), "kelvin": (1.0, 273.15)}
    units["tenths of a degree"] = (10.0, 0.0)
    excesses: dict[str, list[pd.DataFrame]] = {name: [] for name in units}
    for month, rows in new.groupby(new.index.month):
        season = baseline[np.isin((baseline.index.month - month) % 12, [11, 0, 1])]
        for name, (factor, zero) in units.items():
            values = (rows - zero) / factor
            excesses[name].append(np.maximum(season.min() - values, values - season.max()))
    beyond = {name: pd.concat(parts).median() for name, parts in excesses.items()}
    for name in units:
        if (beyond["degrees Celsius"] > far).all() and (beyond[name] <= 0).all():
            raise ValueError(
                f"the temperatures {list(known)} of {counted(len(new), 'record')} are far from the season's values "
                f"in the baseline, and within them as in {name}; expected degrees Celsius, as in the baseline"
            )


def sorted_out(
    batch: pd.DataFrame,
    baseline: pd.DataFrame,
    known: pd.DataFrame,
    ahead: pd.DataFrame,
    max_delay: pd.Timedelta,
    *,
    are_confirmed: bool,
) -> tuple[pd.DataFrame, pd.DataFrame, pd.Series, dict[str, int]]:
    """Records of a batch to evaluate, all that are set aside as stamped too far ahead, why others are not evaluated,
    and numbers of repeated, late and too late ones; by the baseline, the records known since and those set aside.

    A record is set aside if it is stamped farther after the one before it than any outage of the baseline explains,
    until it is of the present by the clock of this computer, or others confirm it.
    """
    n_given, again = len(batch), batch.index.duplicated()
    if again.any():
        same_rows(batch[again], batch[~again])
        batch = batch[~again]
    batch = batch[~np.any([same_rows(batch, table) for table in (known, baseline, ahead)], axis=0)]
    end, last, n_new = baseline.index[-1], (known if len(known) else baseline).index[-1], len(batch)
    is_late = (batch.index <= end) | (batch.index < last - max_delay)
    stamps, late = batch.index[is_late], f"came too late, more than {duration_text(max_delay)} after newer records"
    reasons = pd.Series(late, stamps, dtype=object).mask(stamps <= end, f"before the end of the baseline ({end})")
    timely = pd.concat([batch[~is_late], ahead]).sort_index() if len(ahead) else batch[~is_late]
    jump = longest_step(baseline)
    n_taken = len(timely) if are_confirmed else _n_in_time(timely.index, last, jump)
    fresh, ahead = timely[:n_taken], timely[n_taken:]
    newest = max(last, fresh.index[-1]) if len(fresh) else last
    said = f"stamped more than {duration_text(jump)} after the newest record ({newest}): set aside"
    early = pd.Series(said, ahead.index[ahead.index.isin(batch.index)], dtype=object)
    numbers = {"n_repeated": n_given - n_new, "n_late": int((fresh.index < last).sum()), "n_too_late": len(stamps)}
    return fresh, ahead, pd.concat([reasons, early]), numbers


def longest_step(baseline: pd.DataFrame) -> pd.Timedelta:
    """The time between two records from which on a clock may be wrong."""
    longest = pd.Timedelta(np.diff(baseline.index.asi8).max(initial=0), "ns")
    return max(pd.Timedelta("28D"), 2 * longest, 10 * usual_step(baseline.index))


def _n_in_time(stamps: pd.DatetimeIndex, last: pd.Timestamp, jump: pd.Timedelta) -> int:
    """How many new records, in order of time, are not too far ahead of the last one.

    After a jump, those up to the next one are taken in if they reach the present, or if they are ten or more, which
    confirm each other, and not in the future: a logger may have been silent for months. Where earlier records were in
    the future already, as in a simulation, the clock says nothing, and only a year or more is a jump.
    """
    now = pd.Timestamp.now("UTC").tz_convert(None if last.tz is None else last.tz)
    now += DAY  # stamps without a time zone are local
    is_live = last <= now
    jump = jump if is_live else max(jump, YEAR)
    before = np.maximum.accumulate(np.append(last.as_unit("ns").value, stamps.asi8[:-1]))
    for start, stop in pairwise([*np.flatnonzero(stamps.asi8 - before > jump.value), len(stamps)]):
        newest = stamps[stop - 1]
        is_present = is_live and now - jump <= newest <= now
        if (is_live and newest > now) or (not is_present and stop - start < 10):
            return int(start)
    return len(stamps)


def same_rows(batch: pd.DataFrame, table: pd.DataFrame) -> NDArray[np.bool_]:
    """Which rows of a batch stand in a table, up to the last bits; an error if some have other values there."""
    known = batch.index.isin(table.index)
    if not known.any():
        return known
    new, old = batch.to_numpy()[known], table.to_numpy()[table.index.get_indexer(batch.index[known])]
    differs = ~np.isclose(new, old, rtol=1e-9, atol=0.0, equal_nan=True)
    if differs.any():
        row, column = np.argwhere(differs)[0]
        raise ValueError(
            f"{differs.any(axis=1).sum()} of {known.sum()} repeated records have other values than before, the "
            f"first {batch.index[known][row]}: {batch.columns[column]!r} is {new[row, column]:.10g}, and was "
            f"{old[row, column]:.10g}; expected each stamp once, or with the same values"
        )
    return known


@dataclass(frozen=True)
class Lookback(SavesFrames):
    """How far before a record a detector looks: so many records, and from there on a time."""

    rows: int
    time: pd.Timedelta

    @classmethod
    def learned(cls, *parts: Any) -> Lookback:
        """From ``lookback_`` of fitted parts: those in a row add up, else the largest counts."""
        reaches = [_reach(part) for part in parts]
        return cls(sum(rows for rows, _ in reaches), pd.Timedelta(sum(time for _, time in reaches), "ns"))

    def start(self, times: NDArray[np.int64], place: int) -> int:
        """Position of the earliest record that is needed for the one at a position."""
        first = max(place - self.rows, 0)
        earliest = int(np.searchsorted(times[:place], times[first] - self.time.value))
        return max(min(first, earliest) - self.rows * bool(self.time), 0)

    def duration(self, step: pd.Timedelta) -> pd.Timedelta:
        """The reach as a time, of records that are so far apart."""
        return self.rows * step + self.time

    def __str__(self) -> str:
        """In words, such as "30 h" or "24 records and 30 h"."""
        words = [f"{self.rows} records"] if self.rows else []
        words += [f"{self.time / pd.Timedelta('1h'):.3g} h"] if self.time else []
        return " and ".join(words) or "nothing"


def _reach(part: Any, above: tuple[Any, ...] = ()) -> tuple[int, int]:
    """Records and nanoseconds that a fitted part looks back."""
    if any(part is one for one in above):
        return 0, 0
    if isinstance(part, HampelFilter):
        raise ValueError(
            f"the detector holds {part!r:.100}, which compares records with later ones; expected steps that look back "
            "only: filter the baseline before fit"
        )
    if hasattr(part, "lookback_") and not isinstance(part, CompensatedDetector):
        is_time = isinstance(part.lookback_, np.timedelta64 | timedelta)
        return (0, pd.Timedelta(part.lookback_).as_unit("ns").value) if is_time else (int(part.lookback_), 0)
    above = (*above, part)
    if isinstance(part, Pipeline | CompensatedDetector):
        steps = (part.compensator_, part.means_) if isinstance(part, CompensatedDetector) else dict(part.steps).values()
        inner = [_reach(step, above) for step in steps]
        return sum(rows for rows, _ in inner), sum(time for _, time in inner)
    inner = [_reach(one, above) for one in _inner(part)]
    return max((rows for rows, _ in inner), default=0), max((time for _, time in inner), default=0)


def _inner(part: Any) -> Iterator[Any]:
    """Estimators and objects within a part."""
    for value in list(getattr(part, "__dict__", {}).values()):
        values = value.values() if isinstance(value, Mapping) else value if isinstance(value, list | tuple) else [value]
        for one in values:
            for inner in one if isinstance(one, tuple) else (one,):
                made = isinstance(inner, BaseEstimator) or (is_dataclass(inner) and not isinstance(inner, type))
                if made and not is_model(inner):
                    yield inner


def compensators_of(detector: BaseEstimator | None) -> list[Any]:
    """Parts of an unfitted detector that say which columns are responses."""
    parts = [] if detector is None else [detector, *detector.get_params(deep=True).values()]
    return [part for part in parts if isinstance(part, TemperatureCompensator | CompensatedDetector)]


def roles_of(monitor: Any, columns: list[Any], detector: BaseEstimator | None) -> tuple[list[Any], dict[Any, str]]:
    """Responses among the columns, and units, by the parameters of a monitor, the compensators of its detector, or its
    chain."""
    reference = _among(monitor.reference or [], columns, "reference")
    inputs = [name for name in columns if name not in reference]
    places = [positions_of(one.targets, len(inputs), inputs) for one in compensators_of(detector)]
    own = [inputs[k] for k in sorted(set(np.concatenate(places).tolist()))] if places else None
    wanted = own if monitor.targets is None else monitor.targets
    if wanted is None and monitor.fem is None:
        raise ValueError(
            "the detector has no TemperatureCompensator whose targets say which columns are responses, and there "
            "is no fem; expected targets=[names of the responses]"
        )
    if wanted is None:
        check_is_fitted(monitor.fem)
        wanted = monitor.fem.mode_names_
    targets = _among(wanted, inputs, "targets")
    if not targets or (own is not None and set(targets) != set(own)):
        expected = f"some of the columns {inputs}" if own is None else f"the targets of the compensator {own}"
        raise ValueError(f"targets are {targets}; expected {expected}")
    of_targets = monitor.units if isinstance(monitor.units, str) else "" if monitor.fem is None else "Hz"
    given = dict(monitor.units) if isinstance(monitor.units, Mapping) else {}
    if set(given) - set(columns) or not all(isinstance(unit, str) for unit in given.values()):
        raise ValueError(f"units are {given}; expected a text for some of the columns {columns}")
    units = {name: of_targets if name in targets else "°C" for name in columns} | given
    return [name for name in inputs if name in targets], units


def _among(names: Any, columns: list[Any], what: str) -> list[Any]:
    wanted = [names] if isinstance(names, str) else list(names)
    if any(name not in columns for name in wanted) or len(set(wanted)) < len(wanted):
        raise ValueError(f"{what} is {wanted}; expected different names among the columns {columns}")
    return wanted


def usable_baseline(
    monitor: Any, baseline: pd.DataFrame
) -> tuple[pd.DataFrame, BaseEstimator, list[Any], dict[Any, str], RecordFindings]:
    """What can be used of a baseline, the unfitted detector, the responses, units, and what was set aside.

    By default, responses in Hz have directions of damage, and others the Mahalanobis distance, of residuals.
    """
    detector = None if monitor.detector is None else clone(monitor.detector)
    targets, units = roles_of(monitor, list(baseline.columns), detector)
    records, found = without_what_cannot_be(baseline, targets, units)
    if found.left_out:
        if monitor.fem is not None:
            why = "; ".join(found.left_out.values())
            raise ValueError(f"columns of the chain cannot be used: {why}; expected a chain fitted without them")
        records = records.drop(columns=list(found.left_out))
        targets, units = [name for name in targets if name in records], {name: units[name] for name in records}
        for part in compensators_of(detector):
            part.set_params(targets=targets)
    if detector is None:
        in_hertz = {units[name] for name in targets} == {"Hz"}
        directions = "softening" if monitor.fem is None else monitor.fem
        detector = DirectionalDetector(directions) if in_hertz else MahalanobisDetector()
        if len(targets) < len(records.columns.difference(monitor.reference or [], sort=False)):
            detector = CompensatedDetector(detector, targets=targets)
    return records, detector, targets, units, found


def unknown_months(responses: pd.DataFrame) -> Iterator[FewRecordsWarning]:
    """The finding that responses of a baseline have no value in a month in which others have values on seven days."""
    days = responses.groupby(midnights(responses.index)).count() > 0
    per_month = days.groupby(days.index.month).sum()
    is_unknown = (per_month == 0) & (per_month.max(axis=1) >= 7).to_numpy()[:, np.newaxis]
    months = {
        name: listed([f"{pd.Timestamp(2001, month, 1):%B}" for month in per_month.index[is_unknown[name]]])
        for name in is_unknown.columns[is_unknown.any()]
    }
    if months:
        each = "; ".join(f"{name!r} in {names}" for name, names in months.items())
        yield FewRecordsWarning(
            f"responses have no baseline record in some months: {each}. The regression predicts them there "
            "from other seasons, which may give false alarms or hide damage. Refit with records of these months",
            "few-records",
        )


def without_what_cannot_be(
    records: pd.DataFrame, targets: list[Any], units: Mapping[Any, str], **options: Any
) -> tuple[pd.DataFrame, RecordFindings]:
    """Records with NaN where a value cannot be, and what was set aside, by options of `set_aside`."""
    T, F = records.drop(columns=targets), records[targets]
    unit = "Hz" if all(units[name] == "Hz" for name in targets) else ""
    found, _ = set_aside(T if len(T.columns) else None, F, unit=unit, **options)
    tables = [table for table in (found.temperatures, found.frequencies) if table is not None]
    return pd.concat(tables, axis=1)[list(records.columns)], found
