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
from skthermo.monitoring._sensors import SensorWatch, values_text
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
        watch = SensorWatch.fitted(T, F, reference=reference, units=units) if sensors else None
        follower = None if fem is None else DriftFollower.fitted(fem, T.drop(columns=reference), F)
        return cls(list(targets), list(reference), dict(units), plausible, watch, follower)

    def start(self, day: pd.Timestamp) -> DayState:
        """The state before the first record since the baseline."""
        return DayState(day, *(getattr(one, "start_", None) for one in (self.sensors, self.drift)))

    def cleaned(self, raw: pd.DataFrame) -> pd.DataFrame:
        """Records without what no sensor measures."""
        return raw.mask(self.plausible.implausible(raw.to_numpy()))

    def corrected(
        self, begin: DayState, raw: pd.DataFrame, acknowledged: Sequence[int] = ()
    ) -> tuple[pd.DataFrame, pd.DataFrame, tuple[DayState, ...]]:
        """Raw records from a day on as the detector sees them, each day by what was known at its beginning.

        Also what became of their values, a row for each record (``n_held`` responses that were set aside although the
        structure may have moved them, ``held`` names them; ``n_left_out`` values; ``note``; and the shares of stiffness
        by group, as in "drift top", that are taken out of the frequencies), and the states at the beginning of each
        day. ``acknowledged`` are times (nanoseconds) at which what was held then was said to be the fault of a sensor.
        """
        days = midnights(raw.index)
        bounds = [*np.flatnonzero(np.diff(days.asi8, prepend=days.asi8[0] - 1)), len(raw)]
        if self.sensors is None and self.drift is None:
            bounds = [0, len(raw)]
        state, states, parts = begin, [], []
        for first, stop in pairwise(bounds):
            states.append(replace(state, day=days[first]))
            *part, state = self._after(states[-1], raw.iloc[first:stop], acknowledged)
            parts.append(part)
        records, notes = (pd.concat(list(some)) for some in zip(*parts, strict=True))
        return records, notes, tuple(states)

    def _after(
        self, state: DayState, raw: pd.DataFrame, acknowledged: Sequence[int]
    ) -> tuple[pd.DataFrame, pd.DataFrame, DayState]:
        """Records of one day, what became of their values, and the state after it."""
        wrong = self.plausible.implausible(raw.to_numpy())
        T, F = self._split(raw.mask(wrong))
        notes = values_text(raw, wrong, self.units, "taken as missing")
        sensors, drift, taken_out = state.sensors, state.drift, {}
        if self.sensors is None:
            seen_T, seen_F = T.drop(columns=self.reference), F
            about = pd.DataFrame({"n_held": 0.0, "held": "", "n_left_out": 0, "note": ""}, raw.index)
        else:  # it is to see what is implausible, but not what stands for a missing value
            seen_T, seen_F, about = self.sensors.masked(sensors, T, F, acknowledged)
            is_missing = wrong & (raw.isin(MISSING_CODES) | np.isinf(raw))
            sensors = self.sensors.advance(sensors, *self._split(raw.mask(is_missing)))
        responses = seen_F
        if self.drift is not None:
            responses = self.drift.corrected(drift, seen_F)
            taken_out = self.drift.taken_out(drift).add_prefix("drift ").to_dict()
            drift = self.drift.advance(drift, seen_T, seen_F.where(seen_F > 0))
        about["n_left_out"] += wrong.sum(axis=1)
        about["note"] = ["; ".join(filter(None, parts)) for parts in zip(notes, about["note"], strict=True)]
        records = seen_T.join(responses)[[name for name in raw.columns if name not in self.reference]]
        notes = about.assign(**taken_out).astype({"held": object, "note": object})
        return records, notes, DayState(state.day, sensors, drift)

    def _split(self, records: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
        return records.drop(columns=self.targets), records[self.targets]

    def faults(self, state: DayState) -> pd.DataFrame:
        """Sensors that have failed."""
        if self.sensors is None:
            return pd.DataFrame({name: [] for name in ("column", "kind", "since", "detected", "until", "detail")})
        return self.sensors.faults(state.sensors)
