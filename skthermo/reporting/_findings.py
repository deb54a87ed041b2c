"""What a study found for one family of scenarios, in numbers and in sentences."""

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

LEVEL = 0.9  # share of records in alarm from which on damage counts as found reliably


@dataclass(frozen=True, eq=False)
class Finding:
    """Smallest damage of one family of scenarios that is found reliably.

    Severities are in ascending order of their magnitude; the smallest and its bounds are NaN where none is found. Where
    no curve can be fitted, ``problem`` says why.
    """

    family: str
    severities: Array
    rates: Array
    smallest: float
    lowest: float
    highest: float
    curve: PODCurve | None
    problem: str

    @property
    def largest(self) -> str:
        """Largest severity that was tested."""
        return _magnitude(self.severities[-1])

    @property
    def is_found(self) -> bool:
        """Whether some tested severity is found reliably."""
        return bool(np.isfinite(self.smallest))

    @property
    def bounds(self) -> str:
        """Bounds of the smallest severity."""
        if np.isnan(self.lowest):
            return f"above {self.largest}"
        if self.lowest == self.highest:
            return _magnitude(self.lowest)
        upper = _magnitude(self.highest) if np.isfinite(self.highest) else f"above {self.largest}"
        return f"{_magnitude(self.lowest)} to {upper}"

    def sentence(self) -> str:
        """The smallest severity that is found, and how uncertain it is."""
        kind = "damage" if self.severities[0] > 0 else "strengthening"
        if not self.is_found:
            text = f"no tested {kind} is found reliably; the largest was {self.largest}."
        elif self.smallest == self.severities[0]:
            text = f"{kind} of {_magnitude(self.smallest)} or more is found reliably; less was not tested."
        else:
            text = f"{kind} of {_magnitude(self.smallest)} or more is found reliably."
        return f"{text} {self._uncertainty()} {self._between()}".replace("  ", " ").strip()

    def _uncertainty(self) -> str:
        if self.lowest == self.highest and self.is_found:
            return "The uncertainty of the counted alarms does not change this."
        if np.isnan(self.lowest):
            return ""
        return f"Given the uncertainty of the counted alarms, this limit is {self.bounds}."

    def _between(self) -> str:
        """What the curve says about severities between those that were tested."""
        if self.curve is None:
            return self.problem
        if np.isnan(self.curve.slope):
            low, high = self.curve.bracket
            if np.isnan(high) or low == 0:
                return ""
            return f"The limit lies between {_magnitude(low)} and {_magnitude(high)}; nothing in between was tested."
        a90, a90_95 = self._on_curve(self.curve.a90), self._on_curve(self.curve.a90_95)
        sure = f"with {percent(0.95)} confidence"
        text = f"A curve through the tested severities puts this limit at {a90} and, {sure}, at {a90_95}."
        if not self.curve.n_missed:
            return text
        return (
            f"{text} This is doubtful, because the curve lies outside the bounds of {self.curve.n_missed} of "
            f"{len(self.severities)} tested severities."
        )

    def _on_curve(self, severity: float) -> str:
        """A severity within those that were tested; beyond them a curve is a guess."""
        size, low, high = abs(severity), abs(self.severities[0]), abs(self.severities[-1])
        if size < low:
            return f"less than {_magnitude(self.severities[0])}"
        return percent(abs(severity), ".3g") if size <= high else f"more than {self.largest}"


def _magnitude(severity: float) -> str:
    return percent(abs(severity))


def findings_of(study: DetectabilityStudy) -> list[Finding]:
    """Findings for all families of simulated records."""
    rows = study.results_
    rows = rows[(rows["measure"] == "POD") & (rows["source"] == SIMULATED) & rows["family"].notna()]
    rows = rows[rows["severity"].notna() & (rows["severity"] != 0)]
    families = rows.groupby("family", sort=False)
    return [found for name, some in families if (found := _finding(study, name, some)) is not None]


def _finding(study: DetectabilityStudy, family: object, rows: pd.DataFrame) -> Finding | None:
    rows = rows.iloc[np.argsort(rows["severity"].abs().to_numpy(), kind="stable")]
    severities = rows["severity"].to_numpy(dtype=float)
    try:
        smallest, lowest, highest = (
            minimum_detectable_damage(severities, rows[name], LEVEL) for name in ("rate", "ci_high", "ci_low")
        )
    except ValueError:  # damage and strengthening in one family, or one severity twice
        return None
    curve, problem = None, ""
    if len(rows) < 2:
        problem = "Only one severity was tested, so that nothing can be said about others."
    elif study.is_undetected(family):
        problem = (
            "Alarms are as rare as for the healthy structure, so that no curve is drawn: the tested severities are "
            "small, or outliers in the records that the alarm system learned raise its threshold."
        )
    else:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                curve = study.pod_curve(family)
        except ValueError:
            problem = "The share of alarms does not increase with severity, so that no curve can be drawn."
    rates = rows["rate"].to_numpy(dtype=float)
    return Finding(str(family), severities, rates, smallest, lowest, highest, curve, problem)
