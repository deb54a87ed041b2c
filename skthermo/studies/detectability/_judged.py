"""Decisions of the detectors of a study, and their rows in its table."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._estimators.warnings import warnings_of_detector
from skthermo._tables.arrays import Array
from skthermo._tables.times import row_times, time_of
from skthermo.studies.detectability._intervals import rate_of
from skthermo.studies.scenarios import BaseScenario

SIMULATED, REFERENCE = "simulated", "reference"

Answer = TypeVar("Answer")
Key: TypeAlias = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class JudgedRecords:
    """Records of one scenario and source as a detector judges them: their damage index in the first repeat, with their
    index, and decisions in each repeat, (n_repeats, n_records), NaN where there is none."""

    detector: str
    scenario: BaseScenario
    source: str
    damage_index: pd.Series
    decisions: Array

    def from_onset(self) -> tuple[Array, Array]:
        """Decisions from the onset of the damage on, in order of time, and the times since then."""
        times, onset = row_times(self.damage_index), self.scenario.onset
        start = times.min() if onset is None else time_of(self.damage_index, onset, "onset")
        order = np.argsort(times, kind="stable")
        order = order[times[order] >= start]
        return self.decisions[:, order], times[order] - start

    def summary(self, confidence: float) -> dict[str, Any]:
        """Rates, bounds and time to detection, from the onset of the damage on."""
        scenario, (decisions, waits) = self.scenario, self.from_onset()
        rate = rate_of(decisions, confidence, whole_repeats=scenario.n_draws > 1)
        if not rate.n_records:
            raise ValueError(
                f"none of {len(self.damage_index)} records of scenario {scenario.name!r}, source {self.source!r}, can "
                "be judged: they lack what the detector needs, or are before the onset; expected some that it can judge"
            )
        pi_low, pi_high = band_of(decisions, confidence)
        return {
            "detector": self.detector,
            "scenario": scenario.name,
            "family": scenario.family,
            "severity": scenario.severity,
            "source": self.source,
            "measure": "PFA" if scenario.is_healthy else "POD",
            "rate": rate.rate,
            "ci_low": rate.lowest,
            "ci_high": rate.highest,
            "pi_low": pi_low,
            "pi_high": pi_high,
            "n_alarms": rate.n_alarms,
            "n_records": rate.n_records,
            "n_not_evaluated": decisions.size - rate.n_records,
            "n_effective": rate.n_effective,
            "n_repeats": len(decisions),
            "time_to_detection": _mean_wait(decisions < 0, waits, self.damage_index),
            "error": "",
        }


@dataclass(frozen=True, eq=False)
class Judgement:
    """Decisions of each repeat by detector, scenario and source; those on records that are damaged after some onsets
    only, of detectors with windows; those on healthy records with noise of other seeds by detector and source; damage
    indices of the first repeat; errors of the detectors that failed."""

    decisions: dict[Key, list[Array]] = field(default_factory=dict)
    transitions: dict[Key, list[Array]] = field(default_factory=dict)
    calibration: dict[Key, list[Array]] = field(default_factory=dict)
    indices: dict[Key, pd.Series] = field(default_factory=dict)
    errors: dict[str, Exception] = field(default_factory=dict)

    def ask(self, detectors: Iterable[str], question: Callable[[str], Answer]) -> dict[str, Answer]:
        """Answers of detectors that have not failed, nor fail at this question; an error if none is left."""
        asked, found = [name for name in detectors if name not in self.errors], {}
        for name in asked:
            try:
                with warnings_of_detector(name if len(asked) > 1 else None):
                    found[name] = question(name)
            except Exception as error:
                self.errors[name] = error
        if not found:
            raise next(iter(self.errors.values()))
        return found

    def extend(self, later: "Judgement") -> None:
        """Add the decisions of a later repeat, and the errors of detectors that failed there."""
        for name in ("decisions", "transitions", "calibration"):
            mine, added = getattr(self, name), getattr(later, name)
            for key, decisions in added.items():
                if key in mine:
                    mine[key].extend(decisions)
        self.errors.update(later.errors)

    def records(self, detector: str, scenarios: Sequence[BaseScenario]) -> list[JudgedRecords]:
        """What a detector that has not failed has judged, in the order of the scenarios."""
        keys = [(detector, scenario.name, source) for scenario in scenarios for source in (SIMULATED, REFERENCE)]
        by_name = {scenario.name: scenario for scenario in scenarios}
        return [
            JudgedRecords(detector, by_name[key[1]], key[2], self.indices[key], np.array(self.decisions[key]))
            for key in keys
            if key in self.decisions
        ]


def band_of(decisions: Array, confidence: float) -> tuple[float, float]:
    """Range that holds the rate of one more repeat with this probability, or that of all repeats if they are too few.

    Of n rates, the k-th smallest exceeds that of one more repeat with probability k / (n + 1). One rate has no range.
    """
    judged = (~np.isnan(decisions)).sum(axis=1)
    rates = (decisions < 0).sum(axis=1)[judged > 0] / judged[judged > 0]
    if len(rates) < 2:
        return float("nan"), float("nan")
    lowest, highest = np.quantile(rates, [(1 - confidence) / 2, (1 + confidence) / 2], method="weibull")
    return float(lowest), float(highest)


def _mean_wait(alarms: NDArray[np.bool_], waits: Array, rows: Any) -> Any:
    """Mean time to the first alarm over the repeats that have one, in records or as a Timedelta."""
    detected = alarms[alarms.any(axis=1)].argmax(axis=1)
    if isinstance(getattr(rows, "index", None), pd.DatetimeIndex):
        return pd.Timedelta(int(waits[detected].mean()), "ns") if detected.size else pd.NaT
    return float(detected.mean()) if detected.size else float("nan")
