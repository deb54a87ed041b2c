"""Bridges of a fleet as users give them, fitted chains or pairs of tables, and their records as a prior reads them."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from skthermo._core.arrays import Array, as_columns, spread_evenly
from skthermo._core.estimators import check_array, check_is_fitted
from skthermo._core.frames import (
    check_same_rows,
    column_names,
    frame_like,
    has_stamps,
    row_times,
)
from skthermo.preprocessing import set_aside

MOST_ROWS = 20_000
TYPICAL = 0.02  # standard deviation of the logarithm of a frequency, as which those of linear quantities count
DAY = 86_400e9  # nanoseconds


@dataclass(frozen=True)
class Link:
    """What is linear in functions of the weather: the logarithm of a quantity, or the quantity over a scale.

    ``scales``, (n_outputs,), are in the units of the quantities, and NaN for logarithms.
    """

    scales: Array

    @classmethod
    def of(
        cls,
        link: str | Mapping[Hashable, str],
        families: Sequence[Hashable],
        values: Array,
        known: Mapping[Hashable, float] | None = None,
    ) -> Link:
        """That of families, by name; scales are those of the fleet where known, else of the values."""
        kinds = [link if isinstance(link, str) else link.get(family, "log") for family in families]
        wrong = sorted({repr(kind) for kind in kinds} - {"'log'", "'linear'"})
        if wrong:
            raise ValueError(f"link is {', '.join(wrong)}; expected 'log' or 'linear', or one of them by family")
        deviations = [np.std(column[~np.isnan(column)]) if (~np.isnan(column)).any() else 0.0 for column in values.T]
        own = [deviation / TYPICAL if deviation > 0 else 1.0 for deviation in deviations]
        scales = [(known or {}).get(family, scale) for family, scale in zip(families, own, strict=True)]
        return cls(np.where([kind == "log" for kind in kinds], np.nan, scales))

    def forward(self, values: Array) -> Array:
        """What is linear, of quantities (n_rows, n_outputs)."""
        is_log = np.isnan(self.scales)
        return np.where(is_log, np.log(np.where(is_log, values, 1.0)), values / self.scales)

    def inverse(self, linear: Array) -> Array:
        """Quantities of what is linear."""
        is_log = np.isnan(self.scales)
        return np.where(is_log, np.exp(np.where(is_log, linear, 0.0)), linear * self.scales)

    def slopes(self, values: Array) -> Array:
        """Derivatives of quantities by what is linear."""
        return np.where(np.isnan(self.scales), values, self.scales)


@dataclass(frozen=True)
class BridgeRecords:
    """Inputs (n, d) and what is linear in them (n, q); ``weights`` are relative precisions of the rows.

    ``step`` is the usual time from row to row, in days.
    """

    inputs: Array
    linear: Array
    names: list[Hashable]
    weights: Array
    step: float = 1.0

    @classmethod
    def of(
        cls,
        inputs: Array,
        values: Array,
        names: Sequence[Hashable],
        link: Link,
        weights: Array | None = None,
        times: Array | None = None,
    ) -> BridgeRecords:
        """The usable rows, evenly spread where there are very many; without times in days, rows are days."""
        weights = np.ones(len(inputs)) if weights is None else weights
        usable = usable_rows(inputs, values, weights)
        rows = spread_evenly(np.flatnonzero(usable), MOST_ROWS)
        for name, column, scale in zip(names, values[rows].T, link.scales, strict=True):
            if np.isnan(column).all():
                raise ValueError(f"quantity {name!r} is NaN in all {len(rows)} rows that can be used; expected values")
            if np.isnan(scale) and (column <= 0).any():
                raise ValueError(
                    f"quantity {name!r} falls to {np.nanmin(column):g}; expected positive numbers, or "
                    "link='linear' for quantities of any sign"
                )
        steps = np.diff(np.arange(len(inputs)) if times is None else times)[: len(rows)]
        step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
        step *= usable.sum() / max(len(rows), 1)
        return cls(inputs[rows], link.forward(values[rows]), list(names), weights[rows], step)

    @property
    def n_outputs(self) -> int:
        return self.linear.shape[1]


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

    def records(self, name: Hashable, order: Sequence[Hashable] | None, link: Link) -> BridgeRecords:
        """Its records, inputs in a common order; errors name the bridge."""
        inputs = self.inputs
        if order is not None and self.input_names is not None and self.inputs.shape[1] > 1:
            inputs = inputs[:, [self.input_names.index(name) for name in order]]
        with errors_of(name):
            return BridgeRecords.of(inputs, self.values, self.names, link, self.weights, self.times)


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
    options = {"dtype": np.float64}
    T = T.to_frame() if isinstance(T, pd.Series) else T
    inputs = check_array(T, ensure_2d=False, **options)
    values = as_columns(check_array(Y, ensure_2d=False, **options))
    check_same_rows(T, Y, ("temperatures", "quantities"))
    inputs = as_columns(inputs)
    found = set_aside(
        frame_like(T, inputs), frame_like(Y, values), unit="", exclude={"no-rows", "constant"}, needs_all=True
    )
    inputs, values = np.asarray(found.temperatures), np.asarray(found.frequencies)
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


def linear_scales(
    read: Mapping[Hashable, ReadBridge],
    of_bridge: Mapping[Hashable, Mapping[Hashable, Hashable]],
    link: str | Mapping[Hashable, str],
) -> dict[Hashable, float]:
    """Scale of each family that is linear itself: the median over its outputs on all bridges."""
    found: dict[Hashable, list[float]] = {}
    for bridge, one in read.items():
        families = list(of_bridge[bridge].values())
        for family, scale in zip(families, Link.of(link, families, one.values).scales, strict=True):
            if family is not None and not np.isnan(scale):
                found.setdefault(family, []).append(float(scale))
    return {family: float(np.median(scales)) for family, scales in found.items()}
