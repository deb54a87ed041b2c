"""What a study found for one family of scenarios, as a row of a table."""

import warnings
from dataclasses import dataclass

import numpy as np
import pandas as pd

from skthermo._tables.arrays import Array
from skthermo._tables.text import percent
from skthermo.metrics import minimum_detectable_damage
from skthermo.studies import DetectabilityStudy, PODCurve

SIMULATED, REFERENCE = "simulated", "reference"
"""Sources of records in the table of a study."""

LEVEL = 0.9  # share of records in alarm from which on damage counts as detected reliably
COLUMNS = ("Group", "Smallest change", "Bounds", "a90 of the fitted curve", "a90/95 of the fitted curve", "Remark")


@dataclass(frozen=True, eq=False)
class Finding:
    """Smallest damage of one family that is detected reliably.

    Severities are in ascending order of their magnitude; the smallest and its bounds are NaN where none is detected.
    ``remark`` says why there is no curve, or why it is doubtful.
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

    def sentence(self) -> str:
        kind = "a loss of stiffness" if self.severities[0] > 0 else "a gain of stiffness"
        least, largest = percent(abs(self.severities[0])), percent(abs(self.severities[-1]))
        if not self.is_found:
            return f"{kind} of up to {largest} would not be detected reliably."
        if self.smallest == self.severities[0]:
            return f"{kind} of {least} or more would be detected reliably; less was not tested."
        return f"{kind} of {percent(abs(self.smallest))} or more would be detected reliably."

    def cells(self) -> list[str]:
        """Family, smallest severity, its bounds, severities on the curve, and remark."""
        kind = "damage" if self.severities[0] > 0 else "strengthening"
        least, largest = percent(abs(self.severities[0])), percent(abs(self.severities[-1]))
        smallest = f"{kind} of {percent(abs(self.smallest))}" if self.is_found else f"none up to {kind} of {largest}"
        if self.smallest == self.severities[0]:
            smallest += "; less was not tested"
        ends = [percent(abs(end)) if np.isfinite(end) else f"above {largest}" for end in (self.lowest, self.highest)]
        bounds = " to ".join(dict.fromkeys(ends))
        on_curve = ["", ""]
        if self.curve is not None and np.isfinite(self.curve.slope):
            for place, severity in enumerate(abs(one) for one in (self.curve.a90, self.curve.a90_95)):
                is_less, is_more = severity < abs(self.severities[0]), not severity <= abs(self.severities[-1])
                inside = percent(severity, ".3g")  # the curve is not extrapolated
                on_curve[place] = f"less than {least}" if is_less else f"more than {largest}" if is_more else inside
        return [self.family, smallest, bounds, *on_curve, self.remark]


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
        remark = "one severity was tested"
    elif study.is_undetected(family):
        remark = "alarms are as rare as without damage: severities are small, or baseline outliers raise the threshold"
    else:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                curve = study.pod_curve(family)
            remark = _doubt(curve)
        except ValueError:
            remark = "no curve: the share of alarms does not increase with severity"
    return Finding(family, severities, rates, *smallest, curve, remark)


def _doubt(curve: PODCurve) -> str:
    """What a curve leaves open; nothing if it fits."""
    if np.isnan(curve.slope):
        low, high = curve.bracket
        is_between = np.isfinite(high) and low != 0
        return f"no severity between {percent(abs(low))} and {percent(abs(high))} was tested" if is_between else ""
    n_tested = len(curve.severities)
    return f"the curve lies outside the bounds of {curve.n_missed} of {n_tested} severities" if curve.n_missed else ""
