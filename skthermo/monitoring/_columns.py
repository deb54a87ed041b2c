"""Which columns of a baseline are temperatures and which responses, in which units, and which can be used."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
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


def compensators_of(detector: BaseEstimator | None) -> list[Any]:
    """Parts of an unfitted detector that say which columns are responses."""
    parts = [] if detector is None else [detector, *detector.get_params(deep=True).values()]
    return [part for part in parts if isinstance(part, TemperatureCompensator | CompensatedDetector)]


@dataclass(frozen=True)
class Columns:
    """Roles of columns: ``inputs`` are all but those of ``reference``, and ``targets`` the responses among them."""

    inputs: list[Any]
    reference: list[Any]
    targets: list[Any]
    units: dict[Any, str]

    @classmethod
    def assigned(cls, monitor: Any, columns: list[Any], detector: BaseEstimator | None) -> Columns:
        """By the parameters of a monitor, the compensators of its detector, or its chain."""
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
            expected = f"some of the columns {inputs}" if own is None else f"those of the compensator {own}"
            raise ValueError(f"targets are {targets}; expected {expected}")
        of_targets = monitor.units if isinstance(monitor.units, str) else "" if monitor.fem is None else "Hz"
        given = dict(monitor.units) if isinstance(monitor.units, Mapping) else {}
        if set(given) - set(columns) or not all(isinstance(unit, str) for unit in given.values()):
            raise ValueError(f"units are {given}; expected a text for some of the columns {columns}")
        units = {name: of_targets if name in targets else "°C" for name in columns} | given
        return cls(inputs, reference, [name for name in inputs if name in targets], units)

    def without(self, names: Collection[Any]) -> Columns:
        """The roles of the other columns."""
        lists = ([name for name in some if name not in names] for some in (self.inputs, self.reference, self.targets))
        return Columns(*lists, {name: unit for name, unit in self.units.items() if name not in names})

    def seen(self, detector: BaseEstimator) -> list[Any]:
        """Columns that a detector gets: without a compensator the responses alone."""
        return self.inputs if compensators_of(detector) else self.targets

    def default_detector(self, fem: Any) -> BaseEstimator:
        """Directions of damage for responses in Hz, the Mahalanobis distance for others, of residuals."""
        in_hertz = {self.units[name] for name in self.targets} == {"Hz"}
        last = DirectionalDetector("softening" if fem is None else fem) if in_hertz else MahalanobisDetector()
        return last if len(self.targets) == len(self.inputs) else CompensatedDetector(last, targets=self.targets)


def _among(names: Any, columns: list[Any], what: str) -> list[Any]:
    wanted = [names] if isinstance(names, str) else list(names)
    if any(name not in columns for name in wanted) or len(set(wanted)) < len(wanted):
        raise ValueError(f"{what} is {wanted}; expected different names among the columns {columns}")
    return wanted


def usable_baseline(monitor: Any, baseline: pd.DataFrame) -> tuple[pd.DataFrame, BaseEstimator, Columns, SetAside]:
    """What can be used of a baseline, by which unfitted detector and columns, and what was set aside."""
    detector = None if monitor.detector is None else clone(monitor.detector)
    columns = Columns.assigned(monitor, list(baseline.columns), detector)
    records, found = without_what_cannot_be(baseline, columns.targets, columns.units)
    if found.left_out:
        if monitor.fem is not None:
            raise ValueError(f"the chain needs columns that cannot be used: {'; '.join(found.left_out.values())}")
        records, columns = records.drop(columns=list(found.left_out)), columns.without(found.left_out)
        for part in compensators_of(detector):
            part.set_params(targets=columns.targets)
    return records, columns.default_detector(monitor.fem) if detector is None else detector, columns, found


def without_what_cannot_be(
    records: pd.DataFrame, targets: list[Any], units: Mapping[Any, str], **options: Any
) -> tuple[pd.DataFrame, SetAside]:
    """Records with NaN where a value cannot be, and what was set aside, by options of `set_aside`."""
    T, F = records.drop(columns=targets), records[targets]
    unit = "Hz" if all(units[name] == "Hz" for name in targets) else ""
    found = set_aside(T if len(T.columns) else None, F, unit=unit, **options)
    tables = [table for table in (found.temperatures, found.frequencies) if table is not None]
    return pd.concat(tables, axis=1)[list(records.columns)], found
