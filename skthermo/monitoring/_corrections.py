"""What happens to records before they are evaluated: what is no measurement is left out, drift is taken out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array
from skthermo._core.frames import MISSING_CODES
from skthermo.monitoring._drift import DriftFollower
from skthermo.monitoring.sensors import Dispute, SensorWatch
from skthermo.preprocessing.checks import Plausible


@dataclass(frozen=True)
class CorrectionState:
    """States of the sensor watch and of the drift follower at the beginning of a day."""

    sensors: Any = None
    drift: Any = None


@dataclass(frozen=True)
class Corrected:
    """Records as the detector sees them, and what became of their values.

    ``n_held`` counts the responses of a record that were set aside although the structure may have moved them, and
    ``held`` names them: where there are some, ``is_held``, a record is not healthy. ``disputes`` say which thermometers
    contradict each other.
    """

    records: pd.DataFrame
    n_held: Array
    held: list[str]
    notes: list[str]
    n_left_out: NDArray[np.int64]
    disputes: list[Dispute | None]

    @property
    def is_held(self) -> NDArray[np.bool_]:
        """Which records have responses that were set aside."""
        return self.n_held > 0

    @classmethod
    def joined(cls, parts: Sequence[Corrected]) -> Corrected:
        return cls(
            pd.concat([part.records for part in parts]),
            np.concatenate([part.n_held for part in parts]),
            [name for part in parts for name in part.held],
            [note for part in parts for note in part.notes],
            np.concatenate([part.n_left_out for part in parts]),
            [one for part in parts for one in part.disputes],
        )


@dataclass(frozen=True)
class Corrections:
    """Bounds of what can be measured, the sensor watch and the drift follower; the latter two may be None."""

    temperatures: list[Any]
    targets: list[Any]
    reference: list[Any]
    units: dict[Any, str]
    plausible: Plausible
    sensors: SensorWatch | None = None
    drift: DriftFollower | None = None

    @classmethod
    def of(
        cls,
        baseline: pd.DataFrame,
        targets: list[Any],
        reference: list[Any],
        units: Mapping[Any, str],
        *,
        fem: Any = None,
        sensors: bool = True,
    ) -> Corrections:
        """Learned from a raw baseline; drift is followed where there is a chain."""
        plausible = Plausible.learned(baseline, targets)
        cleaned = baseline.mask(plausible.implausible(baseline.to_numpy()))
        T, F = cleaned.drop(columns=targets), cleaned[targets]
        watch = SensorWatch.of(T, F, reference=reference, units=units) if sensors else None
        follower = None if fem is None else DriftFollower.fitted(fem, T.drop(columns=reference), F)
        return cls(list(T.columns), list(targets), list(reference), dict(units), plausible, watch, follower)

    def start(self) -> CorrectionState:
        return CorrectionState(*(None if one is None else one.start() for one in (self.sensors, self.drift)))

    def cleaned(self, raw: pd.DataFrame) -> pd.DataFrame:
        """Records without what no sensor measures."""
        wrong = self.plausible.implausible(raw.to_numpy())
        return raw.mask(wrong) if wrong.any() else raw

    def advance(self, state: CorrectionState, raw: pd.DataFrame) -> CorrectionState:
        """The states after one more complete day, which may have no records."""
        if self.sensors is None and self.drift is None:
            return state
        day = self.cleaned(raw)
        T, F = day[self.temperatures], day[self.targets]
        sensors, drift = state.sensors, state.drift
        if self.drift is not None:
            T_seen, F_seen = self._masked(state, T, F)
            drift = self.drift.advance(drift, T_seen, F_seen.where(F_seen > 0))
        if self.sensors is not None:  # it is to see what is implausible, but not what stands for a missing value
            seen = raw if day is raw else raw.mask(day.isna() & (raw.isin(MISSING_CODES) | np.isinf(raw)))
            sensors = self.sensors.advance(sensors, seen[self.temperatures], seen[self.targets])
        return CorrectionState(sensors, drift)

    def _masked(self, state: CorrectionState, T: pd.DataFrame, F: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
        if self.sensors is None:
            return T.drop(columns=self.reference), F
        seen = self.sensors.masked(state.sensors, T, F)
        return seen.T, seen.F

    def corrected(self, state: CorrectionState, raw: pd.DataFrame, acknowledged: Sequence[int] = ()) -> Corrected:
        """Raw records of one day as the detector sees them.

        ``acknowledged`` are times (nanoseconds) at which what was held then was said to be the fault of a sensor.
        """
        wrong = self.plausible.implausible(raw.to_numpy())
        day = raw.mask(wrong) if wrong.any() else raw
        T, F = day[self.temperatures], day[self.targets]
        held = np.zeros(F.shape, dtype=bool)
        notes, names, n_left_out = [""] * len(raw), [""] * len(raw), wrong.sum(axis=1)
        for row in np.flatnonzero(wrong.any(axis=1)):
            columns = raw.columns[wrong[row]]
            parts = [f"{name} is {f'{raw[name].iloc[row]:g} {self.units[name]}'.rstrip()}" for name in columns]
            notes[row] = f"{', '.join(parts)}: taken as missing"
        dispute = None if self.sensors is None else self.sensors.dispute(state.sensors, list(T.columns))
        if self.sensors is None:
            T = T.drop(columns=self.reference)
        else:
            seen = self.sensors.masked(state.sensors, T, F, acknowledged)
            T, F, held, n_left_out = seen.T, seen.F, seen.held, n_left_out + seen.n_left_out
            notes = ["; ".join(filter(None, parts)) for parts in zip(notes, seen.notes, strict=True)]
        if self.drift is not None:
            F = self.drift.corrected(state.drift, F)
        for row in np.flatnonzero(held.any(axis=1)):
            names[row] = ", ".join(str(self.targets[k]) for k in np.flatnonzero(held[row]))
        records = pd.concat([T, F], axis=1)[[name for name in raw.columns if name not in self.reference]]
        return Corrected(records, held.sum(axis=1).astype(float), names, notes, n_left_out, [dispute] * len(raw))

    def faults(self, state: CorrectionState) -> pd.DataFrame:
        if self.sensors is None:
            return pd.DataFrame({name: [] for name in ("column", "kind", "since", "detected", "until", "detail")})
        return self.sensors.faults(state.sensors)

    def drifts(self, state: CorrectionState) -> pd.DataFrame | None:
        return None if self.drift is None else self.drift.report(state.drift)
