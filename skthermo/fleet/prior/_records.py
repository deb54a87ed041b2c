"""Bridges of a fleet as users give them, fitted chains or pairs of tables, and their records as a prior reads them."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from skthermo._tables.arrays import Array, as_columns, spread_evenly
from skthermo._tables.frames import check_columns, check_same_rows, check_temperatures, column_names, frame_like
from skthermo._tables.times import has_stamps, row_times
from skthermo._validation import check_array, check_is_fitted

MOST_ROWS = 20_000
DAY = 86_400e9  # nanoseconds


@dataclass(frozen=True)
class BridgeRecords:
    """Inputs (n, d) and logarithms (n, q) of positive quantities; ``weights`` are relative precisions of the rows.

    ``step`` is the usual time from row to row, in days.
    """

    inputs: Array
    logs: Array
    names: list[Hashable]
    weights: Array
    step: float = 1.0

    @classmethod
    def of(
        cls,
        inputs: Array,
        values: Array,
        names: Sequence[Hashable],
        weights: Array | None = None,
        times: Array | None = None,
    ) -> BridgeRecords:
        """The usable rows, evenly spread where there are very many; without times in days, rows are days."""
        weights = np.ones(len(inputs)) if weights is None else weights
        usable = usable_rows(inputs, values, weights)
        rows = spread_evenly(np.flatnonzero(usable), MOST_ROWS)
        for name, column in zip(names, values[rows].T, strict=True):
            if np.isnan(column).all():
                raise ValueError(f"quantity {name!r} is NaN in all {len(rows)} rows that can be used; expected values")
            if (column <= 0).any():
                raise ValueError(f"quantity {name!r} falls to {np.nanmin(column):g}; expected positive numbers")
        steps = np.diff(np.arange(len(inputs)) if times is None else times)[: len(rows)]
        step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
        step *= usable.sum() / max(len(rows), 1)
        return cls(inputs[rows], np.log(values[rows]), list(names), weights[rows], step)

    @property
    def n_outputs(self) -> int:
        """Number of quantities, q."""
        return self.logs.shape[1]


def days_of(table: ArrayLike) -> Array | None:
    """Days since the first row of a frame with stamps; None for other tables."""
    return row_times(table) / DAY if has_stamps(table) else None


def usable_rows(inputs: Array, values: Array, weights: Array | None) -> Array:
    """Rows with all inputs, at least one value and a weight."""
    usable = ~(np.isnan(inputs).any(axis=1) | np.isnan(values).all(axis=1))
    return usable if weights is None else usable & (weights > 0)


@dataclass(frozen=True)
class ReadBridge:
    """Inputs and values of one bridge as they were given."""

    inputs: Array
    values: Array
    names: list[Hashable]
    input_names: list[Hashable] | None
    weights: Array | None = None
    times: Array | None = None

    def records(self, name: Hashable, order: Sequence[Hashable] | None) -> BridgeRecords:
        """Its records, inputs in a common order; errors name the bridge."""
        inputs = self.inputs
        if order is not None and self.input_names is not None and self.inputs.shape[1] > 1:
            inputs = inputs[:, [self.input_names.index(name) for name in order]]
        with errors_of(name):
            return BridgeRecords.of(inputs, self.values, self.names, self.weights, self.times)


@contextmanager
def errors_of(name: Hashable) -> Iterator[None]:
    """Put the bridge's name before errors of its tables."""
    try:
        yield
    except (TypeError, ValueError) as error:
        raise ValueError(f"bridge {name!r}: {error}") from error


def bridges_of(bridges: Any) -> dict[Hashable, Any]:
    """Bridges by name."""
    bridges = getattr(bridges, "chains", bridges)
    if isinstance(bridges, Mapping):
        found = dict(bridges)
    elif isinstance(bridges, str) or not isinstance(bridges, Sequence):
        raise ValueError(f"bridges is {bridges!r:.100}; expected a mapping of names to fitted chains or pairs (T, Y)")
    else:
        found = dict(enumerate(bridges))
    if not found:
        raise ValueError("there are no bridges; expected at least one")
    return found


def read_bridge(name: Hashable, bridge: Any) -> ReadBridge:
    """Inputs, values and names of a chain's mapper, or of a pair of tables."""
    with errors_of(name):
        if isinstance(bridge, tuple | list):
            return read_pair(*bridge)
        if not hasattr(bridge, "predict_parameters"):
            raise ValueError(f"it is {bridge!r:.100}; expected a fitted DataInformedFEM, or a pair (T, Y) of tables")
        check_is_fitted(bridge)
    records = bridge.records_
    input_names = list(bridge.training_range_.names) if hasattr(bridge, "feature_names_in_") else None
    weights = records.weights if records.weights is None else np.where(records.counted, records.weights, 0.0)
    return ReadBridge(
        records.inputs,
        records.targets,
        list(bridge.parameter_names_),
        input_names,
        weights,
        days_of(records.temperatures),
    )


def read_pair(T: ArrayLike, Y: ArrayLike) -> ReadBridge:
    """Two tables, checked."""
    options = {"dtype": np.float64, "ensure_all_finite": "allow-nan"}
    T = T.to_frame() if isinstance(T, pd.Series) else T
    inputs = check_array(T, ensure_2d=False, **options)
    values = as_columns(check_array(Y, ensure_2d=False, **options))
    check_same_rows(T, Y, ("temperatures", "quantities"))
    inputs = as_columns(inputs)
    named = frame_like(T, inputs)
    check_temperatures(named)
    check_columns(named, "temperature", varying=True)
    if isinstance(Y, pd.Series):
        names = ["f1" if Y.name is None else Y.name]
    else:
        names = column_names(Y, "f") if np.ndim(Y) == 2 else ["f1"]
    input_names = list(T.columns) if hasattr(T, "columns") else None
    return ReadBridge(inputs, values, list(names), input_names, times=days_of(T))


def common_inputs(read: Mapping[Hashable, ReadBridge]) -> list[Hashable] | None:
    """Names of the inputs that all bridges have; None where one has none."""
    first, one = next(iter(read.items()))
    for name, other in read.items():
        if other.inputs.shape[1] != one.inputs.shape[1]:
            raise ValueError(
                f"bridge {first!r} has {one.inputs.shape[1]} inputs and bridge {name!r} {other.inputs.shape[1]}; "
                "expected the same inputs for all, such as means of the sensors in each part of a bridge"
            )
        if other.inputs.shape[1] == 1 or None in (one.input_names, other.input_names):
            continue
        if set(other.input_names) != set(one.input_names):
            raise ValueError(
                f"bridge {first!r} has the inputs {one.input_names[:20]} and bridge {name!r} {other.input_names[:20]}; "
                "expected the same names for all, such as means of the sensors in each part of a bridge"
            )
    if any(other.input_names is None for other in read.values()):
        return None
    return one.input_names


def families_by_name(
    families: Mapping[Hashable, Any] | None, names: Sequence[Hashable], bridge: Hashable | None = None
) -> dict[Hashable, Hashable | None]:
    """The family of each name: by default the name itself."""
    if families is not None and bridge in families and isinstance(families[bridge], Mapping):
        families = families[bridge]
    known = {} if families is None else families
    return {name: known.get(name, name) for name in names}
