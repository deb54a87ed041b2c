"""What is measured and learned, and the smallest damage that a detector finds with it."""

import warnings
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone

from skthermo.studies.detectability._pod_curve import pod_curve


@dataclass(frozen=True)
class Arrangement:
    """An unfitted detector, the names of the columns that it sees, in order, as a frame or an array, and the number of
    healthy records that it learns from."""

    detector: Any
    columns: Sequence[Hashable]
    n_baseline: int
    is_frame: bool

    def with_mode(self, name: str) -> "Arrangement":
        """The arrangement with one more measured mode, which is a target where a part of the detector has targets."""
        detector, added = clone(self.detector), name if self.is_frame else len(self.columns)
        targets = {key: value for key, value in detector.get_params().items() if key.rsplit("__", 1)[-1] == "targets"}
        detector.set_params(**{key: [*value, added] for key, value in targets.items()})
        return replace(self, detector=detector, columns=[*self.columns, name])

    def with_sensor(self, name: Hashable) -> "Arrangement":
        """The arrangement with one more temperature."""
        return replace(self, columns=[*self.columns, name])

    def with_baseline(self, factor: float) -> "Arrangement":
        """The arrangement with a longer baseline."""
        return replace(self, n_baseline=int(np.ceil(self.n_baseline * factor)))

    def smallest(self, baseline: pd.DataFrame, tables: Mapping[tuple[str, float], pd.DataFrame]) -> dict[str, float]:
        """Severity at which the curve of the probability of detection reaches 0.9, by family."""
        detector = clone(self.detector).fit(self._seen(baseline.iloc[: self.n_baseline]))
        counts: dict[str, list[tuple[float, int, int]]] = {}
        for (family, severity), table in tables.items():
            decisions = np.asarray(detector.decision_function(self._seen(table)), dtype=float)
            judged = int((~np.isnan(decisions)).sum())
            counts.setdefault(family, []).append((abs(severity), int((decisions < 0).sum()), judged))
        return {family: _a90(*np.transpose(rows)) for family, rows in counts.items()}

    def _seen(self, table: pd.DataFrame) -> Any:
        seen = table[list(self.columns)]
        return seen if self.is_frame else seen.to_numpy()


def _a90(severities: Any, n_detected: Any, n_records: Any) -> float:
    """a90 of the curve; without a finite slope, the middle of its bracket; infinite where damage is not found."""
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="the (severities|curve lies)")
            curve = pod_curve(severities, n_detected, n_records)
    except ValueError:  # the rate does not increase with severity, or nothing could be judged
        return np.inf
    return curve.a90 if np.isfinite(curve.a90) else float(np.nan_to_num(np.mean(curve.bracket), nan=np.inf))
