"""Bridges of a fleet as users give them: fitted chains, or pairs of tables."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from skthermo._arrays import Array, as_columns
from skthermo._frames import check_columns, check_same_rows, check_temperatures, column_names, frame_like
from skthermo._validation import check_array, check_is_fitted
from skthermo.fleet.prior._records import BridgeRecords, days_of


@dataclass(frozen=True)
class ReadBridge:
    """Inputs and values of one bridge as they were given."""

    inputs: Array
    values: Array
    names: list[Any]
    input_names: list[Any] | None
    weights: Array | None = None
    times: Array | None = None

    def records(self, name: Hashable, order: Sequence[Any] | None) -> BridgeRecords:
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


def read_pair(T: Any, Y: Any) -> ReadBridge:
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


def common_inputs(read: Mapping[Hashable, ReadBridge]) -> list[Any] | None:
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
