"""The detectors of a study, each with the columns that it sees."""

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone

from skthermo._arrays import Array
from skthermo._validation import _num_samples, last_step, seed_parts
from skthermo.studies.detectability._arrangement import Arrangement
from skthermo.studies.detectability._view import View, read_baseline


@dataclass(frozen=True, eq=False)
class Candidate:
    """A detector that has learned the healthy structure, its name, and which columns it sees."""

    name: str
    detector: Any
    view: View
    n_baseline: int

    @classmethod
    def learned(cls, name: str, detector: Any, fem: Any, baseline: Any, random_state: Any) -> "Candidate":
        """A fitted clone; the random state, of which a copy is used, seeds parts without a seed of their own."""
        view, healthy = read_baseline(fem, detector, baseline)
        fitted = clone(detector)
        seed_parts(fitted, deepcopy(random_state))
        return cls(name, fitted.fit(healthy), view, _num_samples(healthy))

    @property
    def threshold(self) -> float | None:
        """Damage index above which there is an alarm, where the detector has one."""
        offset = getattr(last_step(self.detector), "offset_", None)
        return None if offset is None else -float(np.squeeze(offset))

    @property
    def memory(self) -> int:
        """Number of records, up to the one that is judged, on which a decision depends: those of the longest window."""
        parts, longest = [self.detector], 1
        while parts:
            part = parts.pop()
            longest = max(longest, getattr(part, "width_", 1))
            parts += [step for _, step in getattr(part, "steps", ())] + list(getattr(part, "detectors_", ()))
        return longest

    @property
    def arrangement(self) -> Arrangement:
        """What is measured and learned."""
        columns = [self.view.names[i] for i in self.view.positions]
        return Arrangement(clone(self.detector), columns, self.n_baseline, self.view.is_frame)

    def decisions(self, table: Any) -> Array:
        """Decision function, NaN where there is none; float32 is as much as alarms and intervals need."""
        return np.asarray(self.detector.decision_function(table), dtype=np.float32)

    def damage_index(self, table: Any, rows: Any) -> pd.Series:
        """Minus the detector's ``score_samples``, on the index of the records."""
        index = rows.index if isinstance(rows, pd.DataFrame) else None
        return pd.Series(-np.asarray(self.detector.score_samples(table), dtype=float), index, name="damage_index")
