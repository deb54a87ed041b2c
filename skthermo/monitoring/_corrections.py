"""Records as a detector sees them, day by day: values that are no measurements are left out, drift is taken out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from skthermo._core.frames import MISSING_CODES, midnights
from skthermo._core.saved_frames import SavesFrames
from skthermo.monitoring._drift import DriftFollower
from skthermo.monitoring._sensors import Fault, SensorWatch, values_text
from skthermo.preprocessing.checks import Plausible


@dataclass(frozen=True)
class DayState(SavesFrames):
    """States of the sensor watch and of the drift follower at the beginning of a day."""

    day: pd.Timestamp
    sensors: Any = None
    drift: Any = None


@dataclass(frozen=True)
class Corrections:
    """Bounds of what can be measured, the sensor watch and the drift follower; the latter two may be None."""

    targets: list[Any]
    reference: list[Any]
    units: dict[Any, str]
    plausible: Plausible
    sensors: Any = None
    drift: Any = None

    @classmethod
    def learned(
        cls,
        baseline: pd.DataFrame,
        targets: list[Any],
        reference: list[Any],
        units: Mapping[Any, str],
        *,
        fem: Any = None,
        sensors: bool = True,
    ) -> Corrections:
        """From a raw baseline; drift is followed where there is a chain."""
        plausible = Plausible.learned(baseline, targets)
        cleaned = baseline.mask(plausible.implausible(baseline.to_numpy()))
        T, F = cleaned.drop(columns=targets), cleaned[targets]
        watch = SensorWatch.fitted(T, F, reference, units) if sensors else None
        follower = None if fem is None else DriftFollower.fitted(fem, T.drop(columns=reference), F)
        return cls(list(targets), list(reference), dict(units), plausible, watch, follower)

    def start(self, day: pd.Timestamp) -> DayState:
        """The state before the first record since the baseline."""
        return DayState(day, *(getattr(one, "start_", None) for one in (self.sensors, self.drift)))

    def cleaned(self, raw: pd.DataFrame) -> pd.DataFrame:
        """Records without what no sensor measures."""
        return raw.mask(self.plausible.implausible(raw.to_numpy()))

    def advanced(self, begin: DayState, raw: pd.DataFrame) -> tuple[DayState, ...]:
        """States at the beginning of each day of raw records from a day on, by the days before."""
        days = list(raw.groupby(midnights(raw.index)))
        if self.sensors is None and self.drift is None:
            return (replace(begin, day=days[-1][0]),)
        states = [replace(begin, day=days[0][0])]
        for (_, records), (next_day, _) in pairwise(days):
            states.append(replace(self._after(states[-1], records), day=next_day))
        return tuple(states)

    def _after(self, state: DayState, raw: pd.DataFrame) -> DayState:
        """The state after the records of one day."""
        wrong, sensors, drift = self.plausible.implausible(raw.to_numpy()), state.sensors, state.drift
        if self.drift is not None:
            T, F = self._split(raw.mask(wrong))
            seen_T, seen_F = T.drop(columns=self.reference), F
            if self.sensors is not None:
                seen_T, seen_F, _ = self.sensors.masked(sensors.faults, T, F, once_found=True)
            drift = self.drift.advance(drift, seen_T, seen_F.where(seen_F > 0))
        if self.sensors is not None:  # it is to see what is implausible, but not what stands for a missing value
            is_missing = wrong & (raw.isin(MISSING_CODES) | np.isinf(raw)) if wrong.any() else wrong
            sensors = self.sensors.advance(sensors, *self._split(raw.mask(is_missing)))
        return DayState(state.day, sensors, drift)

    def drifts(self, states: Sequence[DayState]) -> pd.DataFrame:
        """Shares of stiffness by group, as in "drift top", that are taken out of the records of each day."""
        days = pd.DatetimeIndex([state.day for state in states]).as_unit("ns")
        if self.drift is None:
            return pd.DataFrame(index=days)
        return pd.DataFrame([self.drift.taken_out(state.drift).add_prefix("drift ") for state in states], days)

    def shifts(self, drifts: pd.DataFrame, stamps: pd.DatetimeIndex) -> Any:
        """Shifts of ln f of the responses that are taken out of records by the drifts of their days."""
        return 0.0 if self.drift is None else self.drift.shifts(drifts.loc[midnights(stamps)], self.targets)

    def corrected(
        self,
        faults: Sequence[Fault],
        raw: pd.DataFrame,
        drifts: pd.DataFrame,
        acknowledged: Sequence[int] = (),
        *,
        once_found: bool = False,
    ) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Raw records as the detector sees them, without values of sensors since these are at fault, and drift.

        Also what became of their values, a row for each record (``n_held`` responses that were set aside although the
        structure may have moved them, ``held`` names them; ``n_left_out`` values; columns ``at_fault``; ``note``).
        ``drifts`` are those of each day, and ``acknowledged`` times (nanoseconds) at which what was held then was said
        to be the fault of a sensor. With ``once_found``, values of sensors at fault stay until that was found.
        """
        wrong = self.plausible.implausible(raw.to_numpy())
        T, F = self._split(raw.mask(wrong))
        notes = values_text(raw, wrong, self.units, "taken as missing")
        if self.sensors is None:
            seen_T, seen_F = T.drop(columns=self.reference), F
            about = pd.DataFrame({"n_held": 0.0, "held": "", "n_left_out": 0, "at_fault": "", "note": ""}, raw.index)
        else:
            seen_T, seen_F, about = self.sensors.masked(faults, T, F, acknowledged, once_found=once_found)
        seen_F = seen_F * np.exp(-self.shifts(drifts, raw.index))
        about["n_left_out"] += wrong.sum(axis=1)
        about["note"] = ["; ".join(filter(None, parts)) for parts in zip(notes, about["note"], strict=True)]
        records = seen_T.join(seen_F)[[name for name in raw.columns if name not in self.reference]]
        return records, about.astype({"held": object, "note": object, "at_fault": object})

    def _split(self, records: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
        is_target = records.columns.isin(self.targets)
        return records.loc[:, ~is_target], records[self.targets]

    def faults(self, state: DayState) -> pd.DataFrame:
        """Sensors that have failed."""
        if self.sensors is None:
            return pd.DataFrame({name: [] for name in ("column", "kind", "since", "detected", "until", "detail")})
        return self.sensors.faults(state.sensors)
