"""Which columns of a baseline are temperatures and which responses, in which units, and which can be used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, clone

from skthermo._core.estimators import check_is_fitted
from skthermo._core.frames import positions_of
from skthermo.detection import (
    CompensatedDetector,
    DirectionalDetector,
    MahalanobisDetector,
    TemperatureCompensator,
)
from skthermo.preprocessing.checks import SetAside, set_aside


@dataclass(frozen=True)
class Columns:
    """Names of columns: ``inputs`` are all but those of ``reference``, and the detector sees ``seen`` of them."""

    inputs: list[Any]
    reference: list[Any]
    targets: list[Any]
    seen: list[Any]
    units: dict[Any, str]

    @classmethod
    def of(cls, monitor: Any, detector: BaseEstimator, columns: list[Any]) -> Columns:
        """Those of a baseline, by the parameters of a monitor and the compensators of its detector."""
        parts = [detector, *detector.get_params(deep=True).values()]
        compensators = [part for part in parts if isinstance(part, TemperatureCompensator | CompensatedDetector)]
        reference = _among(monitor.reference or [], columns, "reference")
        inputs = [name for name in columns if name not in reference]
        places = [positions_of(one.targets, len(inputs), inputs) for one in compensators]
        own = [inputs[k] for k in sorted(set(np.concatenate(places).tolist()))] if places else None
        targets = _responses(monitor, inputs, own)
        return cls(inputs, reference, targets, inputs if compensators else targets, _units(monitor, columns, targets))


def default_detector(monitor: Any, columns: list[Any]) -> BaseEstimator:
    """Directions of damage for responses in Hz, the Mahalanobis distance for others, of what the rest leaves."""
    reference = _among(monitor.reference or [], columns, "reference")
    inputs = [name for name in columns if name not in reference]
    targets = _responses(monitor, inputs, None)
    directions = "softening" if monitor.fem is None else monitor.fem
    in_hertz = {_units(monitor, columns, targets)[name] for name in targets} == {"Hz"}
    last = DirectionalDetector(directions) if in_hertz else MahalanobisDetector()
    if len(targets) == len(inputs):
        return last
    return CompensatedDetector(last, targets=targets)


def _responses(monitor: Any, columns: list[Any], own: list[Any] | None) -> list[Any]:
    """Names of the responses: as given, ``own`` ones of the compensators, or those of the chain."""
    if monitor.targets is None and own is not None:
        return own
    if monitor.targets is None and monitor.fem is None:
        raise ValueError(
            "the detector has no TemperatureCompensator whose targets say which columns are responses, and there is no "
            "fem; expected targets=[names of the responses]"
        )
    if monitor.targets is None:
        check_is_fitted(monitor.fem)
    wanted = _among(monitor.fem.mode_names_ if monitor.targets is None else monitor.targets, columns, "targets")
    if not wanted or (own is not None and set(wanted) != set(own)):
        raise ValueError(
            f"targets are {wanted}; expected {'some of the columns' if own is None else 'those of the compensator'}"
            f" {columns if own is None else own}"
        )
    return [name for name in columns if name in wanted]


def _units(monitor: Any, columns: list[Any], targets: list[Any]) -> dict[Any, str]:
    of_targets = monitor.units if isinstance(monitor.units, str) else "" if monitor.fem is None else "Hz"
    given = dict(monitor.units) if isinstance(monitor.units, Mapping) else {}
    unknown = [name for name in given if name not in columns]
    if unknown or not all(isinstance(unit, str) for unit in given.values()):
        raise ValueError(f"units are {given}; expected a text for some of the columns {columns}")
    return {name: of_targets if name in targets else "°C" for name in columns} | given


def _among(names: Any, columns: list[Any], what: str) -> list[Any]:
    wanted = [names] if isinstance(names, str) else list(names)
    if any(name not in columns for name in wanted) or len(set(wanted)) < len(wanted):
        raise ValueError(f"{what} is {wanted}; expected different names among the columns {columns}")
    return wanted


def usable_baseline(monitor: Any, baseline: pd.DataFrame) -> tuple[pd.DataFrame, BaseEstimator, Columns, SetAside]:
    """What can be used of a baseline, by which unfitted detector and columns, and what was set aside."""
    given, is_default = list(baseline.columns), monitor.detector is None
    detector = default_detector(monitor, given) if is_default else clone(monitor.detector)
    columns = Columns.of(monitor, detector, given)
    records, found = without_what_cannot_be(baseline, columns.targets, columns.units)
    if not found.left_out:
        return records, detector, columns, found
    if monitor.fem is not None:
        raise ValueError(f"the chain needs columns that cannot be used: {'; '.join(found.left_out.values())}")
    records = records.drop(columns=list(found.left_out))
    wanted = SimpleNamespace(
        fem=None,
        reference=[name for name in columns.reference if name in records],
        targets=[name for name in columns.targets if name in records],
        units={name: unit for name, unit in columns.units.items() if name in records},
    )
    if is_default:
        detector = default_detector(wanted, list(records.columns))
    for part in (detector, *detector.get_params(deep=True).values()):
        if isinstance(part, TemperatureCompensator | CompensatedDetector):
            part.set_params(targets=wanted.targets)
    return records, detector, Columns.of(wanted, detector, list(records.columns)), found


def without_what_cannot_be(
    records: pd.DataFrame, targets: list[Any], units: Mapping[Any, str], **options: Any
) -> tuple[pd.DataFrame, SetAside]:
    """Records with NaN where a value cannot be, and what was set aside, by options of `set_aside`."""
    T, F = records.drop(columns=targets), records[targets]
    unit = "Hz" if all(units[name] == "Hz" for name in targets) else ""
    found = set_aside(T if len(T.columns) else None, F, unit=unit, **options)
    tables = [table for table in (found.temperatures, found.frequencies) if table is not None]
    return pd.concat(tables, axis=1)[list(records.columns)], found
