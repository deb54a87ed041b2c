"""Records of one scenario as a detector judges them, and their row in the table of a study."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo._times import row_times, time_of
from skthermo.studies.detectability._intervals import rate_of
from skthermo.studies.scenarios import BaseScenario


@dataclass(frozen=True, eq=False)
class JudgedRecords:
    """Records of one scenario and source: when they were taken, their damage index in the first repeat, and the
    detector's decision function in each repeat, NaN where there is none."""

    scenario: BaseScenario
    source: str
    rows: Any
    damage_index: pd.Series
    decisions: list[Array]

    def summary(self, confidence: float) -> dict[str, Any]:
        """Rates, bounds and time to detection, from the onset of the damage on."""
        times, scenario = row_times(self.rows), self.scenario
        start = times.min() if scenario.onset is None else time_of(self.rows, scenario.onset, "onset")
        order = np.argsort(times, kind="stable")
        order = order[times[order] >= start]
        decisions = np.array(self.decisions)
        rate = rate_of(decisions[:, order], confidence, whole_repeats=scenario.n_draws > 1)
        if not rate.n_records:
            raise ValueError(
                f"none of {len(times)} records of scenario {scenario.name!r}, source {self.source!r}, can be judged: "
                "they lack what the detector needs, or are before the onset; expected some that it can judge"
            )
        band_lowest, band_highest = band_of(decisions[:, order], confidence)
        return {
            "scenario": scenario.name,
            "family": scenario.family,
            "severity": scenario.severity,
            "source": self.source,
            "measure": "PFA" if scenario.is_healthy else "POD",
            "rate": rate.rate,
            "lowest": rate.lowest,
            "highest": rate.highest,
            "band_lowest": band_lowest,
            "band_highest": band_highest,
            "n_alarms": rate.n_alarms,
            "n_records": rate.n_records,
            "n_not_judged": decisions[:, order].size - rate.n_records,
            "n_effective": rate.n_effective,
            "n_repeats": len(decisions),
            "time_to_detection": _mean_wait(decisions[:, order] < 0, times[order] - start, self.rows),
        }


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
