"""Poles of records, reference modes, and which pole is which mode."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy.linalg
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from skthermo._core.arrays import Array, as_floats, real_array, rows_by_pattern, shape_array
from skthermo._core.frames import check_same_rows
from skthermo.exceptions import RecordsWarning, SkthermoWarning

POLE_FIELDS = ("frequencies", "damping", "shapes")
Positions = NDArray[np.intp]
MISSED_MODE = 3.0  # cost of a mode without a pole: no pair costs more


class Poles(NamedTuple):
    """The poles of all records, one after another; a pole's ``column`` is its position in its record."""

    record: NDArray[np.intp]
    column: NDArray[np.intp]
    frequencies: NDArray[np.float64]
    damping: NDArray[np.float64] | None
    shapes: NDArray | None
    index: pd.Index


def read_poles(X: Any, sensors: list | None, n_sensors: int | None) -> Poles:
    """The poles of records as `ModeTracker.transform` takes them; without ``n_sensors`` shapes are not read."""
    fields, given_sensors = _fields(X)
    if n_sensors is not None and fields["shapes"] is None:
        raise ValueError("X has no 'shapes'; expected mode shapes, as in the reference, or a reference without shapes")
    if n_sensors is None:
        fields["shapes"] = None
    poles = (_from_arrays if is_table(fields["frequencies"]) else _from_lists)(**fields)
    wrong = ~(np.isfinite(poles.frequencies) & (poles.frequencies > 0))
    if wrong.any():
        pole = np.flatnonzero(wrong)[0]
        raise ValueError(
            f"frequency {poles.column[pole]} of record {poles.record[pole]} is {poles.frequencies[pole]:g}; expected "
            "positive values in Hz, and NaN where there is no pole"
        )
    if poles.shapes is None:
        return poles
    shapes = _chosen_sensors(poles.shapes, given_sensors, sensors)
    if not len(shapes):
        shapes = np.empty((0, n_sensors or 0), dtype=shapes.dtype)
    if shapes.shape[1] != n_sensors:
        raise ValueError(f"shapes of X have {shapes.shape[1]} sensors; expected {n_sensors}, as in the reference")
    if np.isinf(shapes).any():
        raise ValueError("shapes of X have infinite components; expected NaN where a component is missing")
    return poles._replace(shapes=shapes)


def is_table(values: Any) -> bool:
    """Whether values are a frame or a two-dimensional array, not a list of arrays."""
    return isinstance(values, pd.DataFrame) or (
        isinstance(values, np.ndarray) and values.dtype != object and values.ndim == 2
    )


def _fields(X: Any) -> tuple[dict[str, Any], Any]:
    """Frequencies, damping ratios, shapes and index of all records, and the names of their sensors."""
    sensors = None
    if isinstance(X, Mapping):
        fields, sensors = {name: X.get(name) for name in POLE_FIELDS}, X.get("sensors")
        if fields["frequencies"] is None:
            raise ValueError(f"X has the fields {list(X)}; expected 'frequencies', and mostly 'shapes' and 'damping'")
    elif is_table(X):
        fields = {"frequencies": X, "damping": None, "shapes": None}
    elif isinstance(X, Sequence | pd.Series) and len(X) and all(isinstance(record, Mapping) for record in X):
        fields = {}
        for name in POLE_FIELDS:
            has = [record.get(name) is not None for record in X]
            if any(has) and not all(has):
                raise ValueError(f"record {has.index(False)} has no {name!r}, others have; expected all or none")
            fields[name] = [record[name] for record in X] if any(has) else None
        if fields["frequencies"] is None:
            raise ValueError(f"record 0 has the fields {list(next(iter(X)))}; expected 'frequencies'")
        names = {None if record.get("sensors") is None else tuple(record["sensors"]) for record in X}
        if len(names) > 1:
            raise ValueError(f"records name different sensors, such as {list(names)[:2]}; expected the same in all")
        sensors = names.pop()
    else:
        raise ValueError(
            f"X is of type {type(X).__name__}; expected a mapping with 'frequencies', 'shapes' and 'damping' of all "
            "records, or a sequence of such mappings, one for each record"
        )
    index = X.get("index") if isinstance(X, Mapping) else None
    frequencies = X if isinstance(X, pd.Series) else fields["frequencies"]
    if isinstance(frequencies, pd.DataFrame | pd.Series):
        index = frequencies.index
    if not isinstance(frequencies, Sequence | np.ndarray | pd.DataFrame | pd.Series):
        raise ValueError(f"frequencies are {frequencies!r:.200}; expected a table, or a vector for each record")
    fields["index"] = pd.RangeIndex(len(frequencies)) if index is None else pd.Index(index)
    if len(fields["index"]) != len(frequencies):
        raise ValueError(f"the index has {len(fields['index'])} entries; expected {len(frequencies)}, one a record")
    return fields, sensors


def _from_arrays(frequencies: Any, damping: Any, shapes: Any, index: pd.Index) -> Poles:
    F = as_floats(frequencies)
    record, column = np.nonzero(~np.isnan(F))
    if damping is not None:
        check_same_rows(frequencies, damping, ("frequencies", "damping"))
        damping = as_floats(damping)
        if damping.shape != F.shape:
            raise ValueError(f"damping has shape {damping.shape}; expected {F.shape}, as frequencies")
        damping = damping[record, column]
    if shapes is not None:
        shapes = shape_array(shapes, "shapes of X", any_size=True)
        if shapes.ndim != 3 or shapes.shape[:2] != F.shape:
            raise ValueError(f"shapes have shape {shapes.shape}; expected {F.shape + ('n_sensors',)}")
        shapes = shapes[record, column]
    return Poles(record, column, F[record, column], damping, shapes, index)


def _from_lists(frequencies: Any, damping: Any, shapes: Any, index: pd.Index) -> Poles:
    rows = [real_array(row, f"frequencies of record {i}") for i, row in enumerate(frequencies)]
    for i, row in enumerate(rows):
        if row.ndim != 1:
            raise ValueError(f"frequencies of record {i} have shape {row.shape}; expected a vector for each record")
    lengths = np.array([len(row) for row in rows], dtype=int)
    record = np.repeat(np.arange(len(rows)), lengths)
    column = np.arange(len(record)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    F = np.concatenate([np.empty(0), *rows])
    is_pole = ~np.isnan(F)
    if damping is not None:
        damping = np.concatenate([np.empty(0), *_each(damping, lengths, "damping", 1)])[is_pole]
    if shapes is not None:
        parts = _each(shapes, lengths, "shapes", 2)
        widths = {part.shape[1] for part in parts if part.shape[0]}
        if len(widths) > 1:
            raise ValueError(f"shapes of X have {sorted(widths)} sensors in different records; expected one number")
        parts = [part for part in parts if part.shape[0]]
        shapes = np.concatenate(parts)[is_pole] if parts else np.empty((0, 0))
    return Poles(record[is_pole], column[is_pole], F[is_pole], damping, shapes, index)


def _each(values: Any, lengths: NDArray, what: str, ndim: int) -> list[NDArray]:
    """One array for each record, of as many entries as the record has frequencies."""
    if len(values) != len(lengths):
        raise ValueError(f"{what} has {len(values)} records and frequencies {len(lengths)}; expected the same number")
    rows = [as_floats(row) if what == "damping" else shape_array(row, f"{what} of X", any_size=True) for row in values]
    for i, (row, length) in enumerate(zip(rows, lengths, strict=True)):
        if length == 0 and row.size == 0:
            rows[i] = np.empty((0,) * ndim)
        elif row.ndim != ndim or len(row) != length:
            expected = (int(length),) if ndim == 1 else (int(length), "n_sensors")
            raise ValueError(f"{what} of record {i} have shape {row.shape}; expected {expected}")
    return rows


def _chosen_sensors(shapes: NDArray, given: Any, wanted: list | None) -> NDArray:
    """Shapes at the reference's sensors, by name where both have names."""
    if not shapes.shape[0] or given is None or wanted is None:
        return shapes
    given = list(given)
    if len(given) != shapes.shape[1]:
        raise ValueError(f"X names {len(given)} sensors; expected {shapes.shape[1]}, as its shapes have")
    unknown = [name for name in wanted if name not in given]
    if unknown:
        raise ValueError(f"X has no sensors {unknown} of the reference; expected them among {given}")
    return shapes[:, [given.index(name) for name in wanted]]


class ReferenceModes(NamedTuple):
    """Frequencies (n_modes,), shapes (n_sensors, n_modes) or None, names of modes, names of sensors or None."""

    frequencies: NDArray[np.float64]
    shapes: NDArray | None
    names: list[str]
    sensors: list | None

    def close_groups(self, close: float) -> list[NDArray[np.intp]]:
        """Groups of modes whose neighbours in frequency are no farther apart than a share of it."""
        order = np.argsort(self.frequencies)
        steps = np.diff(self.frequencies[order]) > close * self.frequencies[order][1:]
        return np.split(order, np.flatnonzero(steps) + 1)

    def similar(self, max_shift: float, min_mac: float) -> list[SkthermoWarning]:
        """A finding of modes that neither their frequencies nor their shapes distinguish."""
        pairs = np.array(list(combinations(range(len(self.names)), 2)), dtype=int).reshape(-1, 2)
        low, high = np.sort(self.frequencies[pairs], axis=1).T
        similar = (1 - max_shift) * high <= (1 + max_shift) * low
        if self.shapes is not None:
            mac, _ = shape_agreement(self.shapes.T, self.shapes, [])
            similar &= mac[pairs[:, 0], pairs[:, 1]] >= min_mac
        if not similar.any():
            return []
        named = ", ".join("/".join(self.names[mode] for mode in pair) for pair in pairs[similar])
        by = "no shapes are given" if self.shapes is None else f"their shapes have a MAC of {min_mac:g} or more"
        return [
            RecordsWarning(
                f"reference modes cannot be distinguished: {named}. A frequency can lie within "
                f"max_shift={max_shift:g} of both, and {by}. One may be taken for the other. Use a smaller max_shift, "
                "or more sensors",
                "mode-order",
            )
        ]


def read_reference(reference: Any) -> ReferenceModes:
    """The reference modes, checked."""
    if isinstance(reference, Mapping):
        missing = [name for name in ("frequencies", "shapes") if name not in reference]
        if missing:
            raise ValueError(f"reference has the fields {list(reference)}; expected also {missing}")
        given, shapes, sensors = reference["frequencies"], reference["shapes"], reference.get("sensors")
    elif len(reference) == 2:
        (given, shapes), sensors = reference, None
    else:
        raise ValueError(f"reference has {len(reference)} parts; expected two, frequencies and shapes")
    frequencies = real_array(given, "reference frequencies")
    if frequencies.ndim != 1 or not frequencies.size:
        raise ValueError(f"reference frequencies have shape {frequencies.shape}; expected (n_modes,)")
    if not (np.isfinite(frequencies) & (frequencies > 0)).all():
        raise ValueError(f"reference frequencies are {frequencies}; expected positive values in Hz")
    n_modes = len(frequencies)
    names = [f"f{mode + 1}" for mode in range(n_modes)]
    if isinstance(given, pd.Series) and not isinstance(given.index, pd.RangeIndex):
        names = [str(name) for name in given.index]
    if len(set(names)) < n_modes:
        raise ValueError(f"reference modes are named {names}; expected different names")
    if shapes is not None:
        shapes = _read_shapes(shapes, n_modes)
        if sensors is not None and len(sensors) != len(shapes):
            raise ValueError(f"reference names {len(sensors)} sensors; expected {len(shapes)}, as its shapes have")
    return ReferenceModes(frequencies, shapes, names, None if sensors is None else list(sensors))


def _read_shapes(shapes: Any, n_modes: int) -> NDArray:
    shapes = shape_array(shapes, "reference shapes")
    if shapes.ndim != 2 or shapes.shape[1] != n_modes:
        hint = ": transpose them" if shapes.ndim == 2 and shapes.shape[0] == n_modes else ""
        raise ValueError(f"reference shapes have shape {shapes.shape}; expected (n_sensors, {n_modes}){hint}")
    norms = np.linalg.norm(shapes, axis=0)
    if not (np.isfinite(norms) & (norms > 0)).all():
        mode = np.flatnonzero(~(np.isfinite(norms) & (norms > 0)))[0]
        raise ValueError(f"shape {mode} of the reference is zero at all sensors, or not finite; expected other values")
    return shapes


def shape_agreement(shapes: NDArray, reference: NDArray, groups: list[NDArray[np.intp]]) -> tuple[Array, Array]:
    """MAC of poles with modes, and of poles with the spaces that groups of close modes span.

    Both are computed from the sensors where a pole's shape is not NaN, if these are more than one and more than the
    modes of the group; otherwise, they are NaN, and the space counts as the mode alone. Shapes are (n_poles,
    n_sensors), those of the reference (n_sensors, n_modes), and both results (n_poles, n_modes).
    """
    mac = np.full((len(shapes), reference.shape[1]), np.nan)
    span = mac.copy()
    for missing, poles in rows_by_pattern(np.isnan(shapes)):
        n_present = len(missing) - missing.sum()
        if n_present < min(2, len(missing)):
            continue
        seen, modes = shapes[np.ix_(poles, ~missing)], reference[~missing]
        with np.errstate(invalid="ignore", divide="ignore"):
            seen = seen / np.linalg.norm(seen, axis=1, keepdims=True)
            modes = modes / np.linalg.norm(modes, axis=0)
        both = np.abs(seen @ modes.conj()) ** 2
        mac[poles] = span[poles] = np.minimum(both, 1)
        for group in groups:
            if 1 < len(group) < n_present and np.isfinite(modes[:, group]).all():
                basis = scipy.linalg.orth(modes[:, group], rcond=1e-3)
                projected = (np.abs(seen @ basis.conj()) ** 2).sum(axis=1, keepdims=True)
                span[np.ix_(poles, group)] = np.clip(projected, mac[np.ix_(poles, group)], 1)
    return mac, span


class Pairs(NamedTuple):
    """Poles and modes whose shapes fit, with the pole's record and frequency; costs of their shapes are 0 to 2."""

    pole: Positions
    mode: Positions
    mac: Array
    cost: Array
    record: Positions
    frequency: Array

    def at(self, chosen: NDArray) -> "Pairs":
        return Pairs(*(values[chosen] for values in self))


def fitting_pairs(poles: Poles, modes: ReferenceModes, min_mac: float, close: float) -> Pairs:
    """All pairs of a pole and a mode with similar shapes, within a factor of 8 in frequency: those in rad/s are 6.3
    times those in Hz."""
    groups = modes.close_groups(close)
    blocks = []
    at_a_time = 65_536  # poles whose products with all modes are in memory
    for start in range(0, max(len(poles.frequencies), 1), at_a_time):
        block = slice(start, start + at_a_time)
        ratios = poles.frequencies[block, np.newaxis] / modes.frequencies
        fits = (ratios < 8) & (ratios > 1 / 8)
        if poles.shapes is None or modes.shapes is None:
            mac = span = np.ones(ratios.shape)
        else:
            mac, span = shape_agreement(poles.shapes[block], modes.shapes, groups)
            fits &= span >= min_mac
        pole, mode = np.nonzero(fits)
        cost = (1 - span[fits]) / (1 - min_mac) + (span - mac)[fits]
        pole += start
        blocks.append(Pairs(pole, mode, mac[fits], cost, poles.record[pole], poles.frequencies[pole]))
    return Pairs(*(np.concatenate(values) for values in zip(*blocks, strict=True)))


def assign(record: Positions, pole: Positions, mode: Positions, cost: Array) -> Positions:
    """Positions of the pairs that assign poles to modes one-to-one in every record, at the lowest total cost. A mode
    may stay without a pole at the cost `MISSED_MODE`."""
    order = np.lexsort((cost, mode, record))
    is_first = np.ones(len(order), dtype=bool)
    is_first[1:] = (np.diff(record[order]) != 0) | (np.diff(mode[order]) != 0)
    best = order[is_first]
    _, inverse, counts = np.unique(pole[best], return_inverse=True, return_counts=True)
    contested = np.unique(record[best][counts[inverse] > 1])
    chosen = [best[~np.isin(record[best], contested)]]
    starts = np.searchsorted(record[order], contested, side="left")
    ends = np.searchsorted(record[order], contested, side="right")
    for start, end in zip(starts, ends, strict=True):
        pairs = order[start:end]
        modes, row = np.unique(mode[pairs], return_inverse=True)
        poles, column = np.unique(pole[pairs], return_inverse=True)
        costs = np.full((len(modes), len(poles) + len(modes)), MISSED_MODE)
        costs[:, : len(poles)] = 1e6  # pairs that do not fit
        costs[row, column] = cost[pairs]
        solution = linear_sum_assignment(costs)[1]
        chosen.append(pairs[solution[row] == column])
    return np.concatenate(chosen)


def assign_near(pairs: Pairs, reference: Array, max_shift: float) -> tuple[Positions, Positions]:
    """Positions of the chosen pairs, and of all pairs within ``max_shift`` of the reference frequencies."""
    shift = np.abs(pairs.frequency / reference[pairs.mode] - 1)
    near = np.flatnonzero(shift <= max_shift)
    fitting = pairs.at(near)
    chosen = assign(fitting.record, fitting.pole, fitting.mode, fitting.cost + shift[near] / max_shift)
    return near[chosen], near


def assign_while_following(
    pairs: Pairs, reference: Array, max_shift: float, *, order: Positions, n_records: float, max_drift: float
) -> tuple[Positions, Positions, Array]:
    """The same, record by record in the order given, near exponential means of the frequencies assigned before, which
    are the third result. A mode without a pole keeps its mean, and no mean leaves the reference by more than
    ``max_drift``."""
    gain = -np.expm1(-1 / n_records)
    lowest, highest = (1 - max_drift) * reference, (1 + max_drift) * reference
    by_record = np.argsort(pairs.record, kind="stable")
    edges = np.searchsorted(pairs.record[by_record], np.arange(len(order) + 1))
    followed = np.empty((len(order), len(reference)))
    chosen, near = [np.empty(0, dtype=np.intp)], [np.empty(0, dtype=np.intp)]
    mean = reference.copy()
    for row in order:
        followed[row] = mean
        own = by_record[edges[row] : edges[row + 1]]
        taken, fitting = assign_near(pairs.at(own), mean, max_shift)
        modes = pairs.mode[own[taken]]
        mean[modes] += gain * (pairs.frequency[own[taken]] - mean[modes])
        mean = np.clip(mean, lowest, highest)
        chosen.append(own[taken])
        near.append(own[fitting])
    return np.concatenate(chosen), np.concatenate(near), followed
