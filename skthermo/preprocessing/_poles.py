"""Poles of records, reference modes, and which pole is which mode."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy.linalg
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from skthermo._core.arrays import Array, real_array, rows_by_pattern, shape_array
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
    frequencies, damping, shapes, index, given_sensors = _fields(X)
    if n_sensors is not None and shapes is None:
        raise ValueError("X has no 'shapes'; expected mode shapes, as in the reference, or a reference without shapes")
    rows = _each_record(frequencies, "frequencies")
    index = pd.RangeIndex(len(rows)) if index is None else pd.Index(index)
    if len(index) != len(rows):
        raise ValueError(f"the index has {len(index)} entries; expected {len(rows)}, one a record")
    lengths = np.array([len(row) for row in rows], dtype=int)
    record = np.repeat(np.arange(len(rows)), lengths)
    column = np.arange(len(record)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    F = np.concatenate([np.empty(0), *rows])
    is_pole = ~np.isnan(F)
    wrong = np.flatnonzero(is_pole & ~(np.isfinite(F) & (F > 0)))
    if wrong.size:
        place = f"frequency {column[wrong[0]]} of record {record[wrong[0]]}"
        raise ValueError(f"{place} is {F[wrong[0]]:g}; expected positive values in Hz, and NaN where there is no pole")
    if damping is not None:
        check_same_rows(frequencies, damping, ("frequencies", "damping"))
        damping = np.concatenate([np.empty(0), *_each_record(damping, "damping", lengths)])[is_pole]
    if n_sensors is not None:
        check_same_rows(frequencies, shapes, ("frequencies", "shapes"))
        parts = [part for part in _each_record(shapes, "shapes", lengths, 2) if part.size]
        widths = {part.shape[1] for part in parts} or {n_sensors}
        if len(widths) > 1:
            raise ValueError(f"shapes of X have {sorted(widths)} sensors in different records; expected one number")
        shapes = np.concatenate(parts)[is_pole] if parts else np.empty((0, n_sensors))
        shapes = _chosen_sensors(shapes, given_sensors, sensors) if parts else shapes
        if shapes.shape[1] != n_sensors:
            raise ValueError(f"shapes of X have {shapes.shape[1]} sensors; expected {n_sensors}, as in the reference")
        if np.isinf(shapes).any():
            raise ValueError("shapes of X have infinite components; expected NaN where a component is missing")
    return Poles(record[is_pole], column[is_pole], F[is_pole], damping, None if n_sensors is None else shapes, index)


def is_table(values: Any) -> bool:
    """Whether values are a frame or an array of numbers, not a list of arrays."""
    return isinstance(values, pd.DataFrame) or (isinstance(values, np.ndarray) and values.dtype != object)


def _fields(X: Any) -> tuple[Any, Any, Any, Any, Any]:
    """Frequencies, damping ratios, shapes, index and names of sensors of all records; None for those that X lacks."""
    index = getattr(X, "index", None) if isinstance(X, pd.DataFrame | pd.Series) else None
    if is_table(X):
        X = {"frequencies": X}
    elif isinstance(X, Sequence | pd.Series) and len(X) and all(isinstance(record, Mapping) for record in X):
        records, X = list(X), {}
        for name in (*POLE_FIELDS, "sensors"):
            has = [record.get(name) is not None for record in records]
            if any(has) and not all(has):
                raise ValueError(f"record {has.index(False)} has no {name!r}, others have; expected all or none")
            X[name] = [record[name] for record in records] if any(has) else None
        names = set(map(tuple, X["sensors"] or ()))
        if len(names) > 1:
            raise ValueError(f"records name different sensors, such as {list(names)[:2]}; expected the same in all")
        X["sensors"] = next(iter(names), None)
    if not isinstance(X, Mapping) or X.get("frequencies") is None:
        got = f"the fields {list(X)}" if isinstance(X, Mapping) else f"the type {type(X).__name__}"
        expected = f"a mapping with {', '.join(map(repr, POLE_FIELDS))} of all records, or a sequence of one for each"
        raise ValueError(f"X has {got}; expected {expected}")
    frequencies = X["frequencies"]
    if not isinstance(frequencies, Sequence | np.ndarray | pd.DataFrame | pd.Series):
        raise ValueError(f"frequencies are {frequencies!r:.200}; expected a table, or a vector for each record")
    index = frequencies.index if isinstance(frequencies, pd.DataFrame | pd.Series) else X.get("index", index)
    return frequencies, X.get("damping"), X.get("shapes"), index, X.get("sensors")


def _each_record(values: Any, what: str, lengths: NDArray | None = None, n_dims: int = 1) -> list[NDArray]:
    """An array for each record: of as many entries as the record has frequencies, if these are known."""
    read = shape_array if n_dims == 2 else real_array
    if is_table(values):
        rows = list(read(values, f"{what} of X", any_size=True))
    else:
        rows = [read(row, f"{what} of record {i}", any_size=True) for i, row in enumerate(values)]
    for i, row in enumerate(rows):
        n_poles = row.size if lengths is None else lengths[i]
        if (row.size or n_poles) and (row.ndim != n_dims or len(row) != n_poles):
            expected = (int(n_poles), "n_sensors")[:n_dims]
            raise ValueError(f"{what} of record {i} have shape {row.shape}; expected {expected}")
    return rows


def _chosen_sensors(shapes: NDArray, given: Any, wanted: list | None) -> NDArray:
    """Shapes at the reference's sensors, by name where both have names."""
    if given is None or wanted is None:
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
        text = (
            f"reference modes cannot be distinguished: {named}. A frequency can lie within max_shift={max_shift:g} of "
            f"both, and {by}. One may be taken for the other. Use a smaller max_shift, or more sensors"
        )
        return [RecordsWarning(text, "mode-order")]


def read_reference(reference: Any) -> ReferenceModes:
    """The reference modes, checked."""
    is_mapping = isinstance(reference, Mapping)
    parts = dict(reference if is_mapping else zip(("frequencies", "shapes"), reference, strict=False))
    if not parts.keys() >= {"frequencies", "shapes"} or (not is_mapping and len(reference) != 2):
        got = f"the fields {list(parts)}" if is_mapping else f"{len(reference)} parts"
        raise ValueError(f"reference has {got}; expected 'frequencies' and 'shapes'")
    given, shapes, sensors = parts["frequencies"], parts["shapes"], parts.get("sensors")
    frequencies = real_array(given, "reference frequencies")
    if frequencies.ndim != 1 or not frequencies.size or not (np.isfinite(frequencies) & (frequencies > 0)).all():
        raise ValueError(f"reference frequencies are {frequencies}; expected positive values in Hz, (n_modes,)")
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
    wrong = np.flatnonzero(~(np.isfinite(norms) & (norms > 0)))
    if wrong.size:
        raise ValueError(f"shape {wrong[0]} of the reference is zero, or not finite; expected other values")
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
    ratios = poles.frequencies[:, np.newaxis] / modes.frequencies
    fits = (ratios < 8) & (ratios > 1 / 8)
    if poles.shapes is None or modes.shapes is None:
        mac = span = np.ones(ratios.shape)
    else:
        mac, span = shape_agreement(poles.shapes, modes.shapes, modes.close_groups(close))
        fits &= span >= min_mac
    pole, mode = np.nonzero(fits)
    cost = (1 - span[fits]) / (1 - min_mac) + (span - mac)[fits]
    return Pairs(pole, mode, mac[fits], cost, poles.record[pole], poles.frequencies[pole])


def assign(record: Positions, pole: Positions, mode: Positions, cost: Array) -> Positions:
    """Positions of the pairs that assign poles to modes one-to-one in every record, at the lowest total cost. A mode
    may stay without a pole at the cost `MISSED_MODE`."""
    order = np.lexsort((cost, mode, record))
    cell = record * (mode.max(initial=0) + 1) + mode
    best = order[np.unique(cell[order], return_index=True)[1]]  # the cheapest pole of each mode in each record
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
