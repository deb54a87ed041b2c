"""What happens to records before they are evaluated: sensors that fail are left out, followed drift is taken out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pandas as pd

from skthermo.monitoring.drift import DriftFollower
from skthermo.monitoring.sensors import SensorWatch


@dataclass(frozen=True)
class CorrectionState:
    """States of the sensor watch and of the drift follower at the beginning of a day."""

    sensors: Any = None
    drift: Any = None


@dataclass(frozen=True)
class Corrections:
    """The sensor watch and the drift follower, either of which may be None."""

    temperatures: list[Any]
    modes: list[Any]
    sensors: Any = None
    drift: Any = None

    @classmethod
    def of(cls, baseline: pd.DataFrame, targets: list[Any], *, fem: Any = None, sensors: bool = True) -> Corrections:
        """Learned from the baseline that the detector was fitted on; drift is followed where there is a chain."""
        T, F = baseline.drop(columns=targets), baseline[targets]
        watch = SensorWatch.of(T, F) if sensors else None
        follower = None if fem is None else DriftFollower.of(fem, T, F)
        return cls(list(T.columns), list(targets), watch, follower)

    def start(self) -> CorrectionState:
        """The states after the baseline."""
        return CorrectionState(
            None if self.sensors is None else self.sensors.start(), None if self.drift is None else self.drift.start()
        )

    def advance(self, state: CorrectionState, day: pd.DataFrame) -> CorrectionState:
        """The states after one more complete day, which may have no records."""
        if self.sensors is None and self.drift is None:
            return state
        T, F = day[self.temperatures], day[self.modes]
        sensors, drift = state.sensors, state.drift
        if self.drift is not None:
            masked = (T, F) if self.sensors is None else self.sensors.masked(sensors, T, F)
            drift = self.drift.advance(drift, *masked)
        if self.sensors is not None:
            sensors = self.sensors.advance(sensors, T, F)
        return CorrectionState(sensors, drift)

    def corrected(self, state: CorrectionState, records: pd.DataFrame) -> pd.DataFrame:
        """Records of one day as the detector sees them."""
        if (self.sensors is None and self.drift is None) or not len(records):
            return records
        T, F = records[self.temperatures], records[self.modes]
        if self.sensors is not None:
            T, F = self.sensors.masked(state.sensors, T, F)
        if self.drift is not None:
            F = self.drift.corrected(state.drift, F)
        return pd.concat([T, F], axis=1)[list(records.columns)]

    def faults(self, state: CorrectionState) -> pd.DataFrame:
        """Sensors that have failed."""
        if self.sensors is None:
            return pd.DataFrame({name: [] for name in ("column", "kind", "since", "detected", "until", "detail")})
        return self.sensors.faults(state.sensors)

    def drifts(self, state: CorrectionState) -> pd.DataFrame | None:
        """The drift of each group; None where none is followed."""
        return None if self.drift is None else self.drift.report(state.drift)
