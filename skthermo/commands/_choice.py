"""Which detector suits a baseline: the one that finds the smallest changes at the same number of false alarms."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from skthermo._estimators.warnings import without_warnings
from skthermo.monitoring import Monitor

DENSE = pd.Timedelta(hours=6)  # time between records up to which those of a day can be evaluated together
SINGLE = ("MahalanobisDetector", {}, "each record for itself")
DAY = ("WindowedAlarm", {"window": "1D"}, "the records of a day together")


@dataclass(frozen=True)
class Candidate:
    """A detector by its class and settings, what it evaluates, what it finds, and how small changes are that it finds.

    The ``size`` is the geometric mean of the smallest changes of each response alone, infinite where none is found.
    """

    kind: str
    chosen: Mapping[str, Any]
    text: str
    finds: str
    size: float

    def __str__(self) -> str:
        return f"{self.kind}, {self.text}: {self.finds}"


def candidates(
    step: pd.Timedelta, baseline: pd.DataFrame, monitor: Callable[[str, Mapping[str, Any]], Monitor]
) -> list[Candidate]:
    """Detectors that are possible, the best first; the single record where nothing speaks for another."""
    kinds = [SINGLE, DAY] if step <= DENSE else [SINGLE]
    tried = []
    for kind, chosen, text in kinds:
        try:
            with without_warnings():  # the fit that follows gives them
                smallest = monitor(kind, chosen).fit(baseline).smallest_changes_
            size = float(np.exp(np.log(list(smallest.single.values())).mean()))
            tried.append(Candidate(kind, chosen, text, str(smallest), size if np.isfinite(size) else np.inf))
        except ValueError as error:
            tried.append(Candidate(kind, chosen, text, f"it cannot be fitted to this baseline: {error}", np.inf))
    return sorted(tried, key=lambda one: one.size)
