"""Families of scenarios: the smallest severity that a detector finds reliably, and its curve."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from skthermo._estimators.warnings import warn_user
from skthermo.exceptions import ResultWarning
from skthermo.metrics import minimum_detectable_damage
from skthermo.studies.detectability._pod_curve import PODCurve, bracket_of, pod_curve


@dataclass(frozen=True, eq=False)
class FamilyRates:
    """Results of one detector for one family and source, with the highest upper bound of its false alarms there."""

    name: str
    source: str
    rows: pd.DataFrame
    false_alarms: float
    confidence: float

    @property
    def tested(self) -> pd.DataFrame:
        """Rows with a severity, which have a place on a curve."""
        return self.rows[self.rows["severity"].notna()]

    @property
    def is_undetected(self) -> bool:
        """Whether no rate is above that bound."""
        return bool((self.rows["rate"] <= self.false_alarms).all())

    def curve(self, log: bool = False) -> PODCurve:
        """Probability of detection over severity, with records as their effective numbers."""
        rows = self.tested
        detected, n_effective = rows["rate"] * rows["n_effective"], rows["n_effective"]
        with self._named():
            return pod_curve(rows["severity"], detected, n_effective, log=log, confidence=self.confidence)

    def on_grid(self, level: float) -> tuple[float, float, float]:
        """Smallest tested severity from which the rate stays at or above a level, and that of its bounds."""
        with self._named():
            mdd, lowest, highest = (
                minimum_detectable_damage(self.tested["severity"], self.tested[rate], level)
                for rate in ("rate", "ci_high", "ci_low")
            )
        return mdd, lowest, highest

    def on_curve(self, level: float) -> tuple[float, float, float]:
        """Severity at which the curve and its bounds reach a level; without a finite slope, NaN and the bracket."""
        severities, rates = self.tested["severity"], self.tested["rate"]
        bracket = float("nan"), *bracket_of(severities.abs().to_numpy(), rates.to_numpy(), level)
        if len(severities) < 2:
            return bracket
        try:
            curve = self.curve()
        except ValueError as error:
            if severities.min() < 0 < severities.max():
                raise
            rare = "; alarms are as rare as for the healthy structure: severities are small, or outliers of the "
            cause = f"{rare}baseline raise the threshold" if self.is_undetected else ""
            warn_user(f"no curve of source {self.source!r} for {error}{cause}", ResultWarning, "family without a curve")
            return bracket
        if np.isnan(curve.slope):
            return float("nan"), *bracket_of(curve.severities, curve.n_detected / curve.n_records, level)
        tail = (1 - self.confidence) / 2
        return curve.severity_at(level), curve.severity_at(level, tail), curve.severity_at(level, 1 - tail)

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Begin the text of errors with the family's name."""
        try:
            yield
        except ValueError as error:
            raise ValueError(f"family {self.name!r}: {error}") from error


def families_of(results: pd.DataFrame, confidence: float) -> dict[tuple[Any, ...], FamilyRates]:
    """Families by detector, name and source."""
    healthy = results[results["measure"] == "PFA"].groupby(["detector", "source"])["ci_high"].max()
    damaged = results[(results["measure"] == "POD") & results["family"].notna()]
    return {
        key: FamilyRates(key[1], key[2], rows, float(healthy.get((key[0], key[2]), np.nan)), confidence)
        for key, rows in damaged.groupby(["detector", "family", "source"], sort=False)
    }
