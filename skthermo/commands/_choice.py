"""Which detector suits a baseline: the one that finds the smallest changes at the same number of false alarms."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from skthermo._estimators.warnings import without_warnings
from skthermo.monitoring import Monitor

DENSE = pd.Timedelta(hours=6)  # time between records up to which those of a day can be evaluated together
DEVIATIONS = 5.0  # size of a change by which the damage index is tried, in standard deviations of the response

SINGLE = ("MahalanobisDetector", {}, "each record for itself")
DAY = ("WindowedAlarm", {"window": "1D"}, "the records of a day together")


@dataclass(frozen=True)
class Candidate:
    """A detector by its class and settings, and the smallest lasting change of each response that it finds.

    ``changes`` is None if the monitor could not be fitted, as ``why`` says.
    """

    kind: str
    chosen: Mapping[str, Any]
    text: str
    changes: pd.Series | None
    size: float
    why: str = ""

    def in_words(self, units: Mapping[str, str]) -> str:
        """What it finds, in a sentence."""
        if self.changes is None:
            return f"{self.kind}, {self.text}: it cannot be fitted to this baseline: {self.why}"
        found = ", ".join(f"{name} {value:.2g} {units[name]}".strip() for name, value in self.changes.items())
        return f"{self.kind}, {self.text}: a lasting change of one response alone is found from about {found}"


def candidates(
    step: pd.Timedelta, baseline: pd.DataFrame, monitor: Callable[[str, Mapping[str, Any]], Monitor]
) -> list[Candidate]:
    """Detectors that are possible, the best first; the single record where nothing speaks for another."""
    kinds = [SINGLE, DAY] if step <= DENSE else [SINGLE]
    tried = [_tried(kind, chosen, text, baseline, monitor) for kind, chosen, text in kinds]
    return sorted(tried, key=lambda one: one.size)


def _tried(
    kind: str,
    chosen: Mapping[str, Any],
    text: str,
    baseline: pd.DataFrame,
    monitor: Callable[[str, Mapping[str, Any]], Monitor],
) -> Candidate:
    try:
        with without_warnings():  # the fit that follows gives them
            fitted = monitor(kind, chosen).fit(baseline)
            changes = pd.Series(dict(_smallest_changes(fitted)))
    except ValueError as error:
        return Candidate(kind, chosen, text, None, np.inf, str(error))
    relative = changes / baseline[changes.index].std()
    return Candidate(kind, chosen, text, changes, float(np.exp(np.log(relative).mean())))


def _smallest_changes(monitor: Monitor) -> Iterator[tuple[str, float]]:
    """By response, the change at which half of the baseline's records would be above the threshold.

    A damage index is a distance: for a large change it is proportional to it.
    """
    trained = monitor.trained_
    for name in monitor.targets_:
        change = DEVIATIONS * float(trained[name].std())
        changed = trained.assign(**{name: trained[name] - change})
        index = -monitor.detector_.score_samples(changed)
        yield name, float(change * monitor.threshold_ / np.nanmedian(index))
