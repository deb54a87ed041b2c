"""Curves of the probability of detection, and minimum detectable damage, from a study's table."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal

import numpy as np
import pandas as pd
from sklearn.exceptions import NotFittedError

from skthermo._warnings import warn_user
from skthermo._warnings_once import warnings_once
from skthermo.metrics import minimum_detectable_damage
from skthermo.studies._pod_curve import PODCurve, pod_curve
from skthermo.studies._pod_fit import bracket_of, check_probability


class StudyCurves:
    """Methods of a study that need the rates of a family of scenarios."""

    results_: pd.DataFrame
    _confidence: float

    def pod_curve(self, family: str, source: str = "data-informed", *, log: bool = False) -> PODCurve:
        """Probability of detection over severity for one family of scenarios.

        Parameters
        ----------
        family : str
            Of the scenarios.
        source : str, default="data-informed"
            "data-informed" or "reference".
        log : bool, default=False
            Whether the logit is linear in the logarithm of the severity.

        Returns
        -------
        PODCurve
            Records count as their effective numbers, so that serial correlation is in its bounds.

        Raises
        ------
        ValueError
            If there is no such family, or the curve cannot be fitted.

        Warns
        -----
        UserWarning
            If the curve has no finite slope, or lies outside the bounds of some tested severities.
        """
        rows = self._families().get((family, source))
        if rows is None:
            known = [f"{f!r} ({s})" for f, s in self._families()]
            raise ValueError(f"family {family!r}, source {source!r} is not in the results; expected one of {known}")
        detected = rows["rate"] * rows["n_effective"]
        with _naming(family):
            return pod_curve(rows["severity"], detected, rows["n_effective"], log=log, confidence=self._confidence)

    def minimum_detectable_damage(self, level: float = 0.9, method: Literal["grid", "curve"] = "grid") -> pd.DataFrame:
        """Smallest severity that is detected reliably, for every family and source.

        Parameters
        ----------
        level : float, default=0.9
            Probability of detection that counts as reliable.
        method : {"grid", "curve"}, default="grid"
            Of the tested severities the smallest from which the rate stays at or above the level (bounds: the same for
            the upper and the lower bounds of the rates); or where the fitted curve and its two-sided bounds reach it.

        Returns
        -------
        DataFrame
            Indexed by family and source, with ``mdd``, ``lowest`` and ``highest``: NaN or infinite where the level is
            not reached. Where a curve has no finite slope, the POD does not increase, or a family has one severity
            only, ``mdd`` is NaN and the bounds are the two tested severities between which it lies.

        Raises
        ------
        ValueError
            If there is no family, the level is not between 0 and 1, or a family has both damage and strengthening.

        Warns
        -----
        UserWarning
            If a curve has no finite slope or lies outside the bounds of some tested severities, or there is none
            because the POD does not increase. Of texts that differ in their numbers only, the first is given.
        """
        check_probability(level, "level")
        if method not in ("grid", "curve"):
            raise ValueError(f"method is {method!r}; expected 'grid' or 'curve'")
        find = self._on_grid if method == "grid" else self._on_curve
        with warnings_once("for other families or sources"):
            found = {key: find(key, rows, level) for key, rows in self._families().items()}
        if not found:
            raise ValueError("no scenario belongs to a family with a severity; expected some, as `sweep` makes them")
        index = pd.MultiIndex.from_tuples(list(found), names=["family", "source"])
        return pd.DataFrame(list(found.values()), index=index, columns=["mdd", "lowest", "highest"])

    def _families(self) -> dict[tuple[Any, Any], pd.DataFrame]:
        """Rows of the results by family and source."""
        if not hasattr(self, "results_"):
            raise NotFittedError("the study has no results yet; expected a call of run before")
        rows = self.results_
        rows = rows[(rows["measure"] == "POD") & rows["family"].notna() & rows["severity"].notna()]
        return dict(iter(rows.groupby(["family", "source"], sort=False)))  # type: ignore[arg-type]

    def _hint(self, family: str, source: str) -> str:
        """Likely cause of a POD that does not increase, where there is one."""
        if not is_blind(self.results_, family, source):
            return ""
        return (
            "; alarms are as rare as for the healthy structure: severities are small, or outliers of the baseline "
            "raise the threshold"
        )

    def _on_grid(self, key: Any, rows: pd.DataFrame, level: float) -> tuple[float, float, float]:
        with _naming(key[0]):
            mdd, lowest, highest = (
                minimum_detectable_damage(rows["severity"], rows[rate], level) for rate in ("rate", "highest", "lowest")
            )
        return mdd, lowest, highest

    def _on_curve(self, key: Any, rows: pd.DataFrame, level: float) -> tuple[float, float, float]:
        if len(rows) < 2:
            return float("nan"), *bracket_of(rows["severity"].abs().to_numpy(), rows["rate"].to_numpy(), level)
        try:
            curve = self.pod_curve(*key)
        except ValueError as error:
            if rows["severity"].min() < 0 < rows["severity"].max():
                raise
            warn_user(f"no curve of source {key[1]!r} for {error}{self._hint(*key)}", "family without a curve")
            return float("nan"), *bracket_of(rows["severity"].abs().to_numpy(), rows["rate"].to_numpy(), level)
        if np.isnan(curve.slope):
            return float("nan"), *bracket_of(curve.severities, curve.n_detected / curve.n_records, level)
        tail = (1 - self._confidence) / 2
        return curve.severity_at(level), curve.severity_at(level, tail), curve.severity_at(level, 1 - tail)


def is_blind(results: pd.DataFrame, family: str, source: str) -> bool:
    """Whether no severity of a family raises clearly more alarms than the healthy structure does."""
    rows = results[results["source"] == source]
    healthy = rows.loc[rows["measure"] == "PFA", "highest"].max()
    rates = rows.loc[(rows["measure"] == "POD") & (rows["family"] == family), "rate"]
    return bool((rates <= healthy).all())


@contextmanager
def _naming(family: Any) -> Iterator[None]:
    """Let errors say which family they are about."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"family {family!r}: {error}") from error
