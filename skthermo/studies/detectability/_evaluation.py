"""Decisions of the detectors of a study, and their rows in its table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
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
class EvaluatedRecords:
    """What a detector makes of the records of one scenario and source: their damage index in the first repeat, with
    their index, and decisions in each repeat, (n_repeats, n_records), NaN where there is none."""

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
                "be evaluated: they lack what the detector needs, or are before the onset; expected complete records "
                "after the onset"
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
class Evaluation:
    """What detectors decided in the repeats of a study, by detector, scenario and source.

    ``decisions`` have shape (n_repeats, n_records); ``transitions``, (n_repeats, n_onsets, n_window), are those of
    detectors with windows on records that are damaged after some onsets only. ``calibration`` holds decisions on
    healthy records with noise of other seeds, by detector and source, ``indices`` the damage indices of the first
    repeat, and ``errors`` those of the detectors that failed, by name.
    """

    decisions: Mapping[Key, Array]
    errors: Mapping[str, Exception]
    transitions: Mapping[Key, Array] = field(default_factory=dict)
    calibration: Mapping[Key, Array] = field(default_factory=dict)
    indices: Mapping[Key, pd.Series] = field(default_factory=dict)

    def with_repeats(self, later: Sequence[Evaluation]) -> Evaluation:
        """This evaluation and those of later repeats together."""
        joined = {}
        for name in ("decisions", "transitions", "calibration"):
            repeats = [getattr(one, name) for one in (self, *later)]
            joined[name] = {key: np.concatenate([one[key] for one in repeats if key in one]) for key in repeats[0]}
        errors = dict(self.errors)
        for one in later:
            errors |= one.errors
        return replace(self, errors=errors, **joined)

    def records(self, detector: str, scenarios: Sequence[BaseScenario]) -> list[EvaluatedRecords]:
        """Those of a detector, in the order of the scenarios."""
        return [
            EvaluatedRecords(detector, scenario, source, self.indices[key], self.decisions[key])
            for scenario in scenarios
            for source in (SIMULATED, REFERENCE)
            if (key := (detector, scenario.name, source)) in self.decisions
        ]


def ask_each(
    detectors: Iterable[str], question: Callable[[str], Answer], errors: Mapping[str, Exception]
) -> tuple[dict[str, Answer], dict[str, Exception]]:
    """Answers of detectors that have not failed before, and all errors, new ones included.

    The first error is raised if no detector is left.
    """
    asked, found, errors = [name for name in detectors if name not in errors], {}, dict(errors)
    for name in asked:
        try:
            with warnings_of_detector(name if len(asked) > 1 else None):
                found[name] = question(name)
        except Exception as error:
            errors[name] = error
    if not found:
        raise next(iter(errors.values()))
    return found, errors


def band_of(decisions: Array, confidence: float) -> tuple[float, float]:
    """Range that holds the rate of one more repeat with this probability, or that of all repeats if they are too few.

    Of n rates, the k-th smallest exceeds that of one more repeat with probability k / (n + 1). One rate has no range.
    """
    evaluated = (~np.isnan(decisions)).sum(axis=1)
    rates = (decisions < 0).sum(axis=1)[evaluated > 0] / evaluated[evaluated > 0]
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
