"""Which columns of a baseline are temperatures and which responses, in which units, and values that none can have."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator
from sklearn.pipeline import make_pipeline

from skthermo._tables.arrays import robust_deviation
from skthermo._tables.frames import positions_of
from skthermo._validation import check_is_fitted
from skthermo.detection import DirectionalDetector, MahalanobisDetector, TemperatureCompensator
from skthermo.preprocessing.checks import gross_errors

TIMES_DEVIATION, TIMES_LEVEL = 1000, 10  # robust deviations and medians, from which a response is no measurement


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
        compensators = [part for part in parts if isinstance(part, TemperatureCompensator)]
        reference = _among(monitor.reference or [], columns, "reference")
        inputs = [name for name in columns if name not in reference]
        names = np.array(inputs, dtype=object)
        places = [positions_of(one.targets, len(inputs), names) for one in compensators]
        own = [inputs[k] for k in sorted(set(np.concatenate(places).tolist()))] if places else None
        targets = _responses(monitor, inputs, own)
        return cls(inputs, reference, targets, inputs if compensators else targets, _units(monitor, columns, targets))


def default_detector(monitor: Any, columns: list[Any]) -> BaseEstimator:
    """Directions of damage for responses in Hz, the Mahalanobis distance for others, of what the rest leaves."""
    from skthermo.surrogate import TemperatureMapper  # a monitor with a detector of its own needs no surrogate

    reference = _among(monitor.reference or [], columns, "reference")
    inputs = [name for name in columns if name not in reference]
    targets = _responses(monitor, inputs, None)
    directions = "softening" if monitor.fem is None else monitor.fem
    in_hertz = {_units(monitor, columns, targets)[name] for name in targets} == {"Hz"}
    last = DirectionalDetector(directions) if in_hertz else MahalanobisDetector()
    if len(targets) == len(inputs):
        return last
    return make_pipeline(TemperatureCompensator(TemperatureMapper(), targets=targets), last)


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


def refuse_meaningless(
    baseline: pd.DataFrame, targets: list[Any], units: Mapping[Any, str], exclude: Collection[str] = ()
) -> None:
    """Raise an error that lists all that makes records useless for training: gross errors, responses of another size.

    ``exclude`` are kinds of gross errors that do no harm.
    """
    F, T = baseline[targets], baseline.drop(columns=targets)
    unit = "Hz" if all(units[name] == "Hz" for name in targets) else ""
    wrong = []
    try:
        gross_errors(T if len(T.columns) else None, F, unit=unit).refuse_meaningless(exclude=exclude)
    except ValueError as error:
        wrong.append(str(error))
    values = F.to_numpy()
    if not len(values):
        return
    level, deviation = np.nanmedian(values, axis=0), robust_deviation(values)
    limit = np.where(deviation > 0, np.maximum(TIMES_DEVIATION * deviation, TIMES_LEVEL * np.abs(level)), np.inf)
    far = np.abs(values - level) > limit
    for column in np.flatnonzero(far.any(axis=0)):
        rows = np.flatnonzero(far[:, column])
        wrong.append(
            f"{targets[column]!r} is {values[rows[0], column]:.4g} at {F.index[rows[0]]}"
            + (f", and as far off in {len(rows) - 1} other records" if len(rows) > 1 else "")
            + f"; expected values near its median {level[column]:.4g}, and NaN where a value is wrong"
        )
    if wrong:
        raise ValueError("; ".join(wrong))
