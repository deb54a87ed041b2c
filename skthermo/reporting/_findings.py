"""What a study found for one family of scenarios, as a row of a table."""

import warnings
from dataclasses import dataclass

import numpy as np
import pandas as pd

from skthermo._core.arrays import Array
from skthermo.metrics import minimum_detectable_damage
from skthermo.studies import DetectabilityStudy, PODCurve

SIMULATED, REFERENCE = "simulated", "reference"
"""Sources of records in the table of a study."""

LEVEL = 0.9  # share of records in alarm from which on damage counts as detected reliably


@dataclass(frozen=True, eq=False)
class Finding:
    """Smallest damage of one family that is detected reliably.

    Severities are in ascending order of their magnitude; the smallest and its bounds are NaN where none is detected.
    ``remark`` says why there is no curve, or why it is doubtful: "single" severity, "undetected", "falling" share of
    alarms, "gap" between the severities, or a curve "outside" the bounds of some.
    """

    family: str
    severities: Array
    rates: Array
    smallest: float
    lowest: float
    highest: float
    curve: PODCurve | None
    remark: str

    @property
    def is_found(self) -> bool:
        return bool(np.isfinite(self.smallest))

    @property
    def is_damage(self) -> bool:
        return bool(self.severities[0] > 0)

    @property
    def least(self) -> float:
        return float(abs(self.severities[0]))

    @property
    def largest(self) -> float:
        return float(abs(self.severities[-1]))

    @property
    def is_least(self) -> bool:
        """Whether the smallest tested severity is detected."""
        return bool(self.smallest == self.severities[0])

    @property
    def bounds(self) -> list[float]:
        """Bounds of the smallest severity without signs, once where they are equal."""
        ends = (float(abs(end)) if np.isfinite(end) else np.inf for end in (self.lowest, self.highest))
        return list(dict.fromkeys(ends))

    @property
    def on_curve(self) -> list[float]:
        """Severities that the curve gives without signs, a90 and a90/95; none without a curve."""
        has_curve = self.curve is not None and np.isfinite(self.curve.slope)
        return [abs(self.curve.a90), abs(self.curve.a90_95)] if has_curve else []


def with_severities(rows: pd.DataFrame) -> pd.DataFrame:
    """Results of simulated damage that belongs to a family and has a severity."""
    rows = rows[(rows["measure"] == "POD") & (rows["source"] == SIMULATED) & rows["family"].notna()]
    return rows[rows["severity"].fillna(0) != 0]


def findings_of(study: DetectabilityStudy) -> list[Finding]:
    """Findings for all families of simulated records; none for damage and strengthening, or a severity twice, in one
    family."""
    families = with_severities(study.results_).groupby("family", sort=False)
    return [found for name, some in families if (found := _finding(study, str(name), some)) is not None]


def _finding(study: DetectabilityStudy, family: str, rows: pd.DataFrame) -> Finding | None:
    rows = rows.iloc[np.argsort(rows["severity"].abs().to_numpy(), kind="stable")]
    severities, rates = rows["severity"].to_numpy(dtype=float), rows["rate"].to_numpy(dtype=float)
    try:
        smallest = [minimum_detectable_damage(severities, rows[name], LEVEL) for name in ("rate", "ci_high", "ci_low")]
    except ValueError:
        return None
    curve, remark = None, ""
    if len(rows) < 2:
        remark = "single"
    elif study.is_undetected(family):
        remark = "undetected"
    else:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                curve = study.pod_curve(family)
            remark = _doubt(curve)
        except ValueError:
            remark = "falling"
    return Finding(family, severities, rates, *smallest, curve, remark)


def _doubt(curve: PODCurve) -> str:
    """What a curve leaves open; nothing if it fits."""
    if np.isnan(curve.slope):
        low, high = curve.bracket
        return "gap" if np.isfinite(high) and low != 0 else ""
    return "outside" if curve.n_missed else ""
