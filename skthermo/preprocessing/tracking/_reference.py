"""The reference modes that poles are assigned to, and how well shapes agree with theirs."""

from collections.abc import Mapping
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy.linalg
from numpy.typing import NDArray

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array, real_array, rows_by_pattern, shape_array
from skthermo.exceptions import RecordsWarning


class ReferenceModes(NamedTuple):
    """Frequencies (n_modes,), shapes (n_sensors, n_modes) or None, names of modes, names of sensors or None."""

    frequencies: NDArray[np.float64]
    shapes: NDArray | None
    names: list[str]
    sensors: list | None

    def close_groups(self, close: float) -> list[NDArray[np.intp]]:
        """Groups of modes, in each of which neighbours in frequency are no farther apart than a share of it."""
        order = np.argsort(self.frequencies)
        steps = np.diff(self.frequencies[order]) > close * self.frequencies[order][1:]
        return np.split(order, np.flatnonzero(steps) + 1)

    def warn_of_similar(self, max_shift: float, min_mac: float) -> None:
        """Warn of modes that neither their frequencies nor their shapes can tell apart."""
        pairs = np.array(list(combinations(range(len(self.names)), 2)), dtype=int).reshape(-1, 2)
        low, high = np.sort(self.frequencies[pairs], axis=1).T
        similar = (1 - max_shift) * high <= (1 + max_shift) * low
        if self.shapes is not None:
            mac, _ = shape_agreement(self.shapes.T, self.shapes, [])
            similar &= mac[pairs[:, 0], pairs[:, 1]] >= min_mac
        if similar.any():
            first = "/".join(self.names[mode] for mode in pairs[similar][0])
            by = "no shapes are given" if self.shapes is None else f"their shapes have a MAC of {min_mac:g} or more"
            warn_user(
                f"{similar.sum()} of {len(pairs)} pairs of reference modes can be confused, the first {first}: a "
                f"frequency can lie within max_shift={max_shift:g} of both, and {by}; expected a smaller max_shift or "
                "more sensors",
                RecordsWarning,
                "modes that can be confused",
            )


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
