"""Checks of rows: times that cannot be, rows of two tables that differ, tables that are exchanged, too few records."""

from __future__ import annotations

import numpy as np
import pandas as pd

from skthermo._core.arrays import spread_evenly
from skthermo._core.frames import as_stamps
from skthermo.preprocessing.checks._reading import Reading
from skthermo.preprocessing.checks._record_findings import RecordFinding, period_of


def times_found(index: pd.Index) -> list[RecordFinding]:
    """What is wrong with the times of rows."""
    n_rows, everywhere = len(index), np.arange(len(index))
    if not isinstance(index, pd.DatetimeIndex):
        return labels_found(index)
    missing = np.flatnonzero(index.isna())
    if len(missing):
        detail = f"{len(missing)} of {n_rows} rows have no time, the first row {missing[0]}"
        return [RecordFinding.in_rows(index, "wrong-stamps", "", missing, detail, period=False)]
    try:
        stamps = index.as_unit("ns").asi8
    except ValueError:  # beyond the years that nanoseconds reach
        return [RecordFinding.in_rows(index, "wrong-stamps", "", everywhere, "beyond the years from 1678 to 2262")]
    steps = np.diff(stamps)
    if n_rows > 1 and not steps.any():
        return [RecordFinding.in_rows(index, "wrong-stamps", "", everywhere, f"all {n_rows} rows have one time")]
    is_early = n_rows > 1 and 0 <= stamps.max() < pd.Timestamp("1970-03-01").value
    if is_early and np.median(np.abs(steps)) < pd.Timedelta("1min").value:
        detail = f"{n_rows} rows are at the beginning of 1970, as numbers are that count nanoseconds"
        return [RecordFinding.in_rows(index, "wrong-stamps", "", everywhere, detail)]
    found, again, late = [], np.flatnonzero(index.duplicated()), 1 + np.flatnonzero(steps < 0)
    if len(again):
        again = again[np.argsort(stamps[again], kind="stable")]
        detail = f"{len(again)} of {n_rows} rows have the time of another"
        found.append(RecordFinding.in_rows(index, "repeated-stamps", "", again, detail))
    if len(late):
        detail = f"{len(late)} of {n_rows} rows are earlier than the row before, the first row {late[0]}"
        detail = f"{detail} ({period_of(index, late[:1])})"
        found.append(RecordFinding.in_rows(index, "unsorted-stamps", "", late, detail, period=False))
    return found


def labels_found(index: pd.Index) -> list[RecordFinding]:
    """Labels that look like times although they are none."""
    detail = ""
    if len(index) > 1 and pd.api.types.is_integer_dtype(index.dtype) and not isinstance(index, pd.MultiIndex):
        months = index.to_numpy() // 100 % 100
        if 19500101 <= index.min() < index.max() <= 21001231 and ((months >= 1) & (months <= 12)).all():
            detail = f"the index holds dates as integers, such as {index[0]}"
    try:
        as_stamps(index)
    except Exception as error:  # labels of users may be anything
        detail = f"{str(error).partition(';')[0].replace('X has', 'the index has').replace('of X ', ''):.150}"
    everywhere = np.arange(len(index))
    return [RecordFinding.in_rows(index, "stamps-as-text", "", everywhere, detail, period=False)] if detail else []


def rows_found(tables: list[Reading]) -> list[RecordFinding]:
    """Whether tables differ in the number of rows or in their labels, and whether few rows have a value in each."""
    found, first, last = [], tables[0], tables[-1]
    here, there, n_findings = first.given_index, last.given_index, len(first.findings) + len(last.findings)
    if len(here) != len(there):
        detail = f"{len(here)} rows of {first.what} and {len(there)} of {last.what}"
        found.append(RecordFinding("different-rows", "", abs(len(here) - len(there)), None, None, detail))
    elif first.is_frame and last.is_frame and not here.equals(there):
        rows = np.array([row for row, pair in enumerate(zip(here, there, strict=True)) if pair[0] != pair[1]] or [0])
        detail = f"{len(rows)} of {len(here)} rows have different labels, the first row {rows[0]}"
        detail = f"{detail}: {here[rows[0]]} and {there[rows[0]]}"
        found.append(RecordFinding.in_rows(here, "different-rows", "", rows, detail, period=False))
    n_rows = min(len(here), len(there))
    is_known = ~np.isnan(first.values[:n_rows]).all(axis=1) & ~np.isnan(last.values[:n_rows]).all(axis=1)
    known = np.flatnonzero(is_known)
    if len(known) < 50 and (len(known) or not n_findings):
        what, detail = "few-rows" if len(known) > 1 else "no-rows", f"{len(known)} of {n_rows} rows have values"
        found.append(RecordFinding.in_rows(first.index, what, "", known, detail))
    return found


def copies_found(tables: list[Reading]) -> list[RecordFinding]:
    """Columns that vary and are copies of another one, in their table or in both."""
    found, seen = [], {}
    for table in tables:
        everywhere = np.arange(len(table.values))
        for place in np.flatnonzero(np.fmax.reduce(table.values) > np.fmin.reduce(table.values)):
            name, content = table.columns[place], table.values[:, place].tobytes()
            owner, other = seen.setdefault(content, (table, place))
            if owner is not table:
                detail = f"{owner.columns[other]!r} of the temperatures equals {name!r}"
                found.append(RecordFinding.in_rows(table.index, "exchanged-tables", name, everywhere, detail))
            elif other != place:
                detail = f"{name!r} equals {owner.columns[other]!r} in {len(everywhere)} rows"
                found.append(RecordFinding.in_rows(table.index, "equal-columns", name, everywhere, detail))
    return found


def exchanged_found(T: Reading, F: Reading) -> list[RecordFinding]:
    """Temperatures that are frequencies: they change much less, relative to their median, than the frequencies do."""
    changes, is_positive = [], False
    for table in (F, T):
        some = table.values[spread_evenly(np.arange(len(table.values)), 1000)]
        some = some[:, np.fmax.reduce(some) > np.fmin.reduce(some)]
        if len(some) < 50 or not some.size:
            return []
        low, middle, high = np.nanquantile(some, [0.25, 0.5, 0.75], axis=0)
        changes.append(float(np.median((high - low) / np.maximum(np.abs(middle), 1e-300))))
        is_positive = bool((low > 0).all())
    if not is_positive or changes[1] >= min(0.1, changes[0] / 4):
        return []
    detail = f"half of the temperatures lie within {changes[1]:.1%} of their median, of the frequencies within"
    everywhere = np.arange(len(T.values))
    return [RecordFinding.in_rows(T.index, "exchanged-tables", "", everywhere, f"{detail} {changes[0]:.0%}")]
