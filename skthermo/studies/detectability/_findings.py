"""What a run of a study has found: decisions of its detectors, and all that is read from them."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array, check_probability
from skthermo._core.warnings import warnings_once
from skthermo.studies._scenarios import BaseScenario
from skthermo.studies.detectability._pod_curve import FamilyRates, PODCurve, families_of
from skthermo.studies.detectability._ranking import in_words, rank
from skthermo.studies.detectability._rates import EvaluatedRecords
from skthermo.studies.detectability._replicates import ReplicateRates, sentences
from skthermo.studies.detectability._simulation import SIMULATED, Candidate, Evaluation, ask_each

MANY_FALSE_ALARMS = 0.5  # rate above which baseline and simulation seem to be of different structures


@dataclass(frozen=True, eq=False)
class StudyFindings:
    """Rates, decisions and errors of a run of `DetectabilityStudy`, which documents them and the methods."""

    table: pd.DataFrame
    scenarios: Sequence[BaseScenario] = ()
    confidence: float = 0.95
    candidates: Mapping[str, Candidate] = field(default_factory=dict)
    evaluation: Evaluation = field(default_factory=Evaluation)
    errors: Mapping[str, str] = field(default_factory=dict)
    replicates: ReplicateRates | None = None
    warnings: Sequence[str] = ()

    @classmethod
    def of(
        cls,
        evaluation: Evaluation,
        candidates: Mapping[str, Candidate],
        scenarios: list[BaseScenario],
        detectors: Sequence[str],
        replicates: ReplicateRates | None,
        confidence: float,
        warnings: Sequence[str],
    ) -> StudyFindings:
        """What detectors that have not failed decided, and the errors of the others."""
        records = {name: evaluation.records(name, scenarios) for name in candidates if name not in evaluation.errors}
        rows, failed = ask_each(
            records, lambda name: [one.summary(confidence) for one in records[name]], evaluation.errors
        )
        errors = {name: f"{type(error).__name__}: {error}" for name, error in failed.items()}
        lines = [row for name in detectors for row in rows.get(name, [{"detector": name, "error": errors.get(name)}])]
        table = pd.DataFrame(lines, columns=list(next(iter(rows.values()))[0]))
        return cls(
            table=table if replicates is None else replicates.banded(table, confidence),
            scenarios=scenarios,
            confidence=confidence,
            candidates={name: candidates[name] for name in rows},
            evaluation=evaluation.only(rows),
            errors=errors,
            replicates=replicates,
            warnings=warnings,
        )

    @property
    def detectors(self) -> dict[str, Any]:
        """The fitted detectors."""
        return {name: one.detector for name, one in self.candidates.items()}

    @property
    def thresholds(self) -> dict[str, float | None]:
        """Damage index above which there is an alarm, where a detector has one."""
        return {name: one.threshold for name, one in self.candidates.items()}

    @property
    def columns(self) -> dict[str, list[Hashable]]:
        """Names of the columns that each detector sees."""
        return {name: one.columns for name, one in self.candidates.items()}

    @property
    def uncertainty(self) -> pd.DataFrame | None:
        """Standard deviation of each rate due to each part of what is uncertain, and its share of the variance."""
        return None if self.replicates is None else self.replicates.table()

    def only(self, detector: str) -> StudyFindings:
        """The findings as if a detector were the only one."""
        return replace(
            self,
            table=self.table[self.table["detector"] == detector].reset_index(drop=True),
            candidates={detector: self.candidates[detector]},
            evaluation=self.evaluation.only([detector]),
        )

    def detector_name(self, detector: str | None = None) -> str:
        """Name of the only detector, or a name that is known.

        Parameters
        ----------
        detector : str, optional
            Needed where there are several.

        Returns
        -------
        str
            Of a detector that has results.

        Raises
        ------
        ValueError
            If there are several detectors and none is named, or the one that is named has no results.
        """
        known = self.table.loc[self.table["error"] == "", "detector"].unique().tolist()
        if detector is None and self.table["detector"].nunique() == 1:
            return known[0]
        if not isinstance(detector, str) or detector not in known:
            raise ValueError(f"detector is {detector!r:.100}; expected the name of one of {known}")
        return detector

    def pod_curve(
        self, family: str, source: str = "simulated", *, log: bool = True, detector: str | None = None
    ) -> PODCurve:
        """Probability of detection over severity for one family of scenarios.

        Parameters
        ----------
        family : str
            Of the scenarios.
        source : str, default="simulated"
            "simulated" or "reference".
        log : bool, default=True
            Whether the logit is linear in the logarithm of the severity.
        detector : str, optional
            Name of the detector, where there are several.

        Returns
        -------
        PODCurve
            Records count as their effective numbers, so that serial correlation is in its bounds. Its
            ``prediction_interval`` and ``a90_prediction_interval`` hold all that ``uncertainty`` names.

        Raises
        ------
        ValueError
            If there is no such family, the curve cannot be fitted, or there are several detectors and none is named.

        Warns
        -----
        UserWarning
            If the curve has no finite slope, or lies outside the bounds of some tested severities.
        """
        found = self._family(family, source, detector)
        curves = [] if self.replicates is None else self.replicates.curves(found, log)
        return replace(found.curve(log), replicates=tuple(curves))

    def minimum_detectable_damage(
        self, level: float = 0.9, method: Literal["grid", "curve"] = "grid", detector: str | None = None
    ) -> pd.DataFrame:
        """Smallest severity that is detected reliably, for every family and source.

        Parameters
        ----------
        level : float, default=0.9
            Probability of detection that counts as reliable.
        method : {"grid", "curve"}, default="grid"
            Of the tested severities the smallest from which the rate stays at or above the level (bounds: the same for
            the upper and the lower bounds of the rates); or where the fitted curve and its two-sided bounds reach it.
        detector : str, optional
            Name of one of several detectors; by default all.

        Returns
        -------
        DataFrame
            Indexed by family and source, and first by detector where there are several, with ``mdd``, ``ci_low`` and
            ``ci_high``: NaN or infinite where the level is not reached. Where a curve has no finite slope, the POD does
            not increase, or a family has one severity only, ``mdd`` is NaN and the bounds are the two tested severities
            between which it lies. Detectors that failed are left out. With replicates, also ``pi_low`` and
            ``pi_high``, between which that of a measured campaign should lie: quantiles over the replicates, infinite
            if the level may not be reached.

        Raises
        ------
        ValueError
            If there is no family, the level is not between 0 and 1, a family has both damage and strengthening, or
            there is no such detector.

        Warns
        -----
        UserWarning
            If a curve has no finite slope or lies outside the bounds of some tested severities, or there is none
            because the POD does not increase. Of texts that differ in their numbers only, the first is given.
        """
        check_probability(level, "level")
        if method not in ("grid", "curve"):
            raise ValueError(f"method is {method!r}; expected 'grid' or 'curve'")
        families = {key: one for key, one in families_of(self.table, self.confidence).items() if len(one.tested)}
        if detector is not None or self.table["detector"].nunique() == 1:
            name = self.detector_name(detector)
            families = {key[1:]: one for key, one in families.items() if key[0] == name}
        with warnings_once("for other families or sources"):
            found = {
                key: family.on_grid(level) if method == "grid" else family.on_curve(level)
                for key, family in families.items()
            }
        if not found:
            raise ValueError("no scenario belongs to a family with a severity; expected some, as `sweep` makes them")
        names = ["detector", "family", "source"][-len(next(iter(found))) :]
        index = pd.MultiIndex.from_tuples(list(found), names=names)
        table = pd.DataFrame(list(found.values()), index=index, columns=["mdd", "ci_low", "ci_high"])
        if self.replicates is None:
            return table
        bands = [self.replicates.smallest(one, level, method, self.confidence) for one in families.values()]
        return table.assign(**dict(zip(["pi_low", "pi_high"], np.transpose(bands), strict=True)))

    def is_undetected(self, family: str, source: str = "simulated", detector: str | None = None) -> bool:
        """Whether no severity of a family raises clearly more alarms than the healthy structure does.

        Parameters
        ----------
        family : str
            Of the scenarios.
        source : str, default="simulated"
            "simulated" or "reference".
        detector : str, optional
            Name of the detector, where there are several.

        Returns
        -------
        bool
            True if no rate is above the highest upper bound of the rates of false alarms.

        Raises
        ------
        ValueError
            If there is no such family or source, or there are several detectors and none is named.
        """
        return self._family(family, source, detector).is_undetected

    def ranking(
        self,
        max_false_alarms: float = 0.02,
        source: str = "simulated",
        confidence: float | None = None,
        *,
        by: Literal["pod", "pod_at_equal_pfa"] = "pod",
    ) -> pd.DataFrame:
        """Detectors in the order of what they find, with what is not significant.

        First come those that keep the limit of false alarms, by their probability of detection (POD), then the others,
        those with the fewest false alarms first.

        Parameters
        ----------
        max_false_alarms : float, default=0.02
            Limit of the share of healthy records in alarm.
        source : str, default="simulated"
            "simulated" or "reference".
        confidence : float, optional
            Of the bounds, two-sided; by default that of the study.
        by : {"pod", "pod_at_equal_pfa"}, default="pod"
            What is compared: detectors as they are, or with thresholds moved to equal false alarms.

        Returns
        -------
        DataFrame
            One row for each detector, indexed by ``detector``, best first, those that failed last:

            - ``false_alarms``, ``false_alarms_ci_low``, ``false_alarms_ci_high``: rate and bounds, means over the
              healthy scenarios;
            - ``within_limit``: False only where the lower bound is above the limit;
            - ``pod``, ``pod_ci_low``, ``pod_ci_high``: the same of the damaged scenarios;
            - ``pod_at_equal_pfa``: POD with the threshold moved so that the share of ``calibration_`` in alarm is the
              limit (less where indices are tied); NaN for measured records, which have no calibration;
            - ``pod_deficit``, ``pod_deficit_ci_low``, ``pod_deficit_ci_high``: POD of the first row less that of this
              one, by the measure of the order; the bounds hold for all rows together, and need two repeats;
            - ``significantly_worse``: whether the lower bound is above 0;
            - ``auc``: area under the ROC curve, the mean over the damaged scenarios; 0.5 is chance;
            - ``time_to_detection``: mean over the damaged scenarios; NaN where one of them raises no alarm;
            - ``not_evaluated``: share of the records that the detector cannot evaluate, which count nowhere else;
            - for each family ``pod FAMILY``, ``pod FAMILY ci_low``, ``pod FAMILY ci_high`` and ``mdd FAMILY``, the
              minimum detectable damage at a POD of 0.9 (NaN: not reached, or the severities have no order);
            - ``error``: "", or the error of a detector that failed.

        Raises
        ------
        ValueError
            If no scenario of this source is healthy, or none is damaged, or ``by="pod_at_equal_pfa"`` and there are no
            healthy records to move thresholds by.

        Notes
        -----
        Differences are paired, as all detectors evaluate the same records. Their bounds include noise alone
        (:ref:`how-detectors-are-ranked`). Limits of a ranking: :doc:`/guide/rank_detectors`.

        Examples
        --------
        >>> from sklearn.ensemble import IsolationForest
        >>> from skthermo.datasets import make_truss, make_truss_campaign
        >>> from skthermo.detection import MahalanobisDetector, OutlierDetector
        >>> from skthermo.studies import DetectabilityStudy
        >>> from skthermo.surrogate import DataInformedFEM
        >>> year, weather = make_truss_campaign(random_state=0), make_truss_campaign(random_state=1).temperatures
        >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
        >>> detectors = {"forest": OutlierDetector(IsolationForest()), "Mahalanobis": MahalanobisDetector()}
        >>> options = {"n_repeats": 5, "uncertainty": "noise", "random_state": 0}
        >>> study = DetectabilityStudy(fem, detectors, [{}, {"bottom": 0.1}], **options)
        >>> results = study.run(weather)
        >>> study.ranking()[["false_alarms", "pod", "pod_at_equal_pfa", "significantly_worse"]].round(2)
                     false_alarms   pod  pod_at_equal_pfa  significantly_worse
        detector
        Mahalanobis          0.02  0.22              0.22                False
        forest               0.01  0.19              0.16                 True
        >>> print(study.summary())
        'Mahalanobis' detects 22.4% of the damaged records at a false-alarm rate of 1.9%.
        Significantly worse at 95% confidence: 'forest' (18.7% at 1.2%).
        These comparisons include noise only: another year, baseline or FE model may change the order.
        """
        limit = check_probability(max_false_alarms, "max_false_alarms")
        asked = self.confidence if confidence is None else check_probability(confidence, "confidence")
        if by not in ("pod", "pod_at_equal_pfa"):
            raise ValueError(f"by is {by!r:.100}; expected 'pod' or 'pod_at_equal_pfa'")
        self._check_source(source)
        rows = self.table[self.table["source"] == source]
        for measure, kind in (("PFA", "healthy"), ("POD", "damaged")):
            if not (rows["measure"] == measure).any():
                raise ValueError(
                    f"source {source!r} has the scenarios {rows['scenario'].unique().tolist()}, none of them {kind}; "
                    "expected healthy and damaged ones"
                )
        calibration = {name: decisions for (name, of), decisions in self.evaluation.calibration.items() if of == source}
        if by == "pod_at_equal_pfa" and not calibration:
            raise ValueError(f"source {source!r} has no healthy records to move thresholds by; expected by='pod'")
        records = list(self._records(source).values())
        if asked != self.confidence:
            rows = pd.DataFrame([one.summary(asked) for one in records])
        return rank(records, rows, calibration, self.errors, limit, asked, by)

    def labelled_scores(
        self, detector: str | None = None, source: str = "simulated", scenarios: Sequence[str] | None = None
    ) -> tuple[NDArray[np.bool_], Array]:
        """Which records are damaged, and how suspicious a detector finds them, as scikit-learn's curves take them.

        Parameters
        ----------
        detector : str, optional
            Name of the detector, where there are several.
        source : str, default="simulated"
            "simulated" or "reference".
        scenarios : sequence of str, optional
            Damaged states whose records are put together, from the onset of damage on; by default all.

        Returns
        -------
        is_damaged : ndarray of shape (n_records,)
            Records of all repeats; those that are not evaluated are left out.
        scores : ndarray of shape (n_records,)
            Minus the decision function: positive is an alarm.

        Raises
        ------
        ValueError
            If the detector is not known, or it has evaluated no healthy or no damaged records of these scenarios.

        Examples
        --------
        Found damage over false alarms, for all thresholds, is ``RocCurveDisplay.from_predictions(
        *study.labelled_scores("raw"), name="raw")`` of scikit-learn.
        """
        name = self.detector_name(detector)
        parts: dict[bool, list[Array]] = {False: [], True: []}
        for (of, *_), one in self._records(source).items():
            is_healthy = one.scenario.is_healthy
            if of == name and (is_healthy or scenarios is None or one.scenario.name in scenarios):
                kept = one.from_onset()[0]
                parts[not is_healthy].append(-kept[~np.isnan(kept)])
        healthy, damaged = (np.concatenate([*some, []]) for some in parts.values())
        if not len(healthy) or not len(damaged):
            raise ValueError(
                f"detector {name!r} has evaluated {len(healthy)} healthy and {len(damaged)} damaged records of source "
                f"{source!r} and scenarios {scenarios}; expected some of both"
            )
        return np.repeat([False, True], [len(healthy), len(damaged)]), np.r_[healthy, damaged]

    def summary(self, max_false_alarms: float = 0.02, source: str = "simulated") -> str:
        """Which detector detects most, and which are not significantly worse, in sentences.

        Parameters
        ----------
        max_false_alarms : float, default=0.02
            Limit of the share of healthy records in alarm.
        source : str, default="simulated"
            "simulated" or "reference".

        Returns
        -------
        str
            What `ranking` says, a line for each group of detectors, and what the bands of the first one include.

        Raises
        ------
        ValueError
            As `ranking`.
        """
        ranking = self.ranking(max_false_alarms, source)
        lines = [in_words(ranking, max_false_alarms, self.confidence)]
        if self.replicates is not None and source == SIMULATED:
            lines.append(self.uncertainty_summary(ranking.index[0]))
        return "\n".join(lines)

    def uncertainty_summary(self, detector: str | None = None) -> str:
        """Which uncertainties the prediction intervals include, and which dominates the widest one, in sentences.

        Parameters
        ----------
        detector : str, optional
            Name of the detector, where there are several.

        Returns
        -------
        str
            A line on what the intervals include, one on the scenario with the widest, and one on rates outside theirs.

        Raises
        ------
        ValueError
            If there are several detectors and none is named, or the one that is named has no results.
        """
        return sentences(self.table, self.uncertainty, self.detector_name(detector), self.confidence)

    def many_false_alarms(self) -> str:
        """What is wrong if a detector takes most simulated records of the healthy structure for damaged, or ""."""
        rows = self.table[(self.table["measure"] == "PFA") & (self.table["source"] == SIMULATED)]
        many = rows[rows["ci_low"] > MANY_FALSE_ALARMS]
        if not len(many):
            return ""
        names = ", ".join(map(repr, many["detector"].unique()))
        by = f" (detectors {names})" if self.table["detector"].nunique() > 1 else ""
        return (
            f"{many['rate'].iloc[0]:.0%} of the simulated records of scenario {many['scenario'].iloc[0]!r}, where "
            f"nothing is changed, raise an alarm{by}. No rate of the study is meaningful. Give a baseline in Hz of the "
            "structure that the chain has learned, and weather in degrees Celsius"
        )

    def _check_source(self, source: Any) -> None:
        known = self.table["source"].dropna().unique().tolist()
        if source not in known:
            raise ValueError(f"source is {source!r:.100}; expected one of {known}")

    def _records(self, source: str) -> dict[tuple[str, str, str], EvaluatedRecords]:
        """What the detectors evaluated of one source."""
        names = dict.fromkeys(name for name, *_ in self.evaluation.decisions)
        records = (one for name in names for one in self.evaluation.records(name, self.scenarios))
        return {(one.detector, one.scenario.name, source): one for one in records if one.source == source}

    def _family(self, family: str, source: str, detector: str | None) -> FamilyRates:
        name = self.detector_name(detector)
        found = {key: one for key, one in families_of(self.table, self.confidence).items() if key[0] == name}
        is_known = isinstance(family, str) and isinstance(source, str)
        if not is_known or (name, family, source) not in found:
            known = [f"{f!r} ({s})" for _, f, s in found]
            raise ValueError(f"family {family!r}, source {source!r} is not in the results; expected one of {known}")
        return found[name, family, source]
