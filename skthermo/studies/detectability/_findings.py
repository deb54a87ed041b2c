"""What a run of a study has found: decisions of its detectors, and all that is read from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._estimators.arguments import check_flag
from skthermo._estimators.warnings import warnings_once
from skthermo._tables.arrays import Array
from skthermo.studies.detectability._candidates import Arrangement, Candidate
from skthermo.studies.detectability._families import FamilyRates, families_of
from skthermo.studies.detectability._judged import SIMULATED, JudgedRecords, Judgement
from skthermo.studies.detectability._pod_curve import PODCurve, check_probability
from skthermo.studies.detectability._ranking import in_words, rank
from skthermo.studies.detectability._replicate_rates import ReplicateRates, sentences
from skthermo.studies.detectability._waits import soonest, waits_table
from skthermo.studies.scenarios import BaseScenario

MANY_FALSE_ALARMS = 0.5  # rate above which baseline and simulation seem to be of different structures


@dataclass(frozen=True, eq=False)
class StudyFindings:
    """Rates, decisions and errors of a run of `DetectabilityStudy`, which documents them and the methods."""

    table: pd.DataFrame
    scenarios: Sequence[BaseScenario] = ()
    confidence: float = 0.95
    detectors: Mapping[str, Any] = field(default_factory=dict)
    thresholds: Mapping[str, float | None] = field(default_factory=dict)
    arrangements: Mapping[str, Arrangement] = field(default_factory=dict)
    indices: Mapping[tuple[str, str, str], pd.Series] = field(default_factory=dict)
    decisions: Mapping[tuple[str, str, str], Array] = field(default_factory=dict)
    transitions: Mapping[tuple[str, str, str], Array] = field(default_factory=dict)
    calibration: Mapping[tuple[str, str], Array] = field(default_factory=dict)
    errors: Mapping[str, str] = field(default_factory=dict)
    replicates: ReplicateRates | None = None
    uncertainty: pd.DataFrame | None = None
    warnings: Sequence[str] = ()

    @classmethod
    def of(
        cls,
        judgement: Judgement,
        candidates: Mapping[str, Candidate],
        scenarios: list[BaseScenario],
        detectors: Sequence[str],
        replicates: ReplicateRates | None,
        confidence: float,
        warnings: Sequence[str],
    ) -> StudyFindings:
        """What detectors that have not failed decided, and the errors of the others."""
        records = {name: judgement.records(name, scenarios) for name in candidates if name not in judgement.errors}
        rows = judgement.ask(records, lambda name: [one.summary(confidence) for one in records[name]])
        errors = {name: f"{type(error).__name__}: {error}" for name, error in judgement.errors.items()}
        lines = [row for name in detectors for row in rows.get(name, [{"detector": name, "error": errors.get(name)}])]
        table = pd.DataFrame(lines, columns=list(next(iter(rows.values()))[0]))
        judged = {(one.detector, one.scenario.name, one.source): one for name in rows for one in records[name]}
        return cls(
            table=table if replicates is None else replicates.banded(table, confidence),
            scenarios=scenarios,
            confidence=confidence,
            detectors={name: candidates[name].detector for name in rows},
            thresholds={name: candidates[name].threshold for name in rows},
            arrangements={name: candidates[name].arrangement for name in rows},
            indices={key: one.damage_index for key, one in judged.items()},
            decisions={key: one.decisions for key, one in judged.items()},
            transitions={key: np.array(found) for key, found in judgement.transitions.items() if key[0] in rows},
            calibration={key: np.array(found) for key, found in judgement.calibration.items() if key[0] in rows},
            errors=errors,
            replicates=replicates,
            uncertainty=None if replicates is None else replicates.table(),
            warnings=warnings,
        )

    def only(self, detector: str) -> StudyFindings:
        """The findings as if a detector were the only one."""
        by_key = ("indices", "decisions", "transitions", "calibration")
        return replace(
            self,
            table=self.table[self.table["detector"] == detector].reset_index(drop=True),
            **{what: {detector: getattr(self, what)[detector]} for what in ("detectors", "thresholds", "arrangements")},
            **{what: {key: one for key, one in getattr(self, what).items() if key[0] == detector} for what in by_key},
        )

    def detector_name(self, detector: str | None = None) -> str:
        """Name of the only detector, or one that has results."""
        known = self.table.loc[self.table["error"] == "", "detector"].unique().tolist()
        if detector is None and self.table["detector"].nunique() == 1:
            return known[0]
        if not isinstance(detector, str) or detector not in known:
            raise ValueError(f"detector is {detector!r:.100}; expected the name of one of {known}")
        return detector

    def pod_curve(self, family: str, source: str, *, log: bool = False, detector: str | None = None) -> PODCurve:
        """Probability of detection over severity, with the curves of the replicates."""
        found = self._family(family, source, detector)
        curves = [] if self.replicates is None else self.replicates.curves(found, log)
        return replace(found.curve(log), replicates=tuple(curves))

    def minimum_detectable_damage(
        self, level: float = 0.9, method: Literal["grid", "curve"] = "grid", detector: str | None = None
    ) -> pd.DataFrame:
        """Smallest severity that is detected reliably, for every family and source."""
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

    def time_to_detection(
        self,
        within: Sequence[str | int] | None = None,
        level: float = 0.95,
        *,
        source: str = SIMULATED,
        confidence: float | None = None,
        detector: str | None = None,
        smallest: bool = False,
    ) -> pd.DataFrame:
        """Chance to find damage within some times, and the time within which it is found."""
        check_probability(level, "level")
        asked = self.confidence if confidence is None else check_probability(confidence, "confidence")
        self._check_source(source)
        chosen = None if detector is None else self.detector_name(detector)
        records = {key: one for key, one in self._records(source).items() if chosen in (None, key[0])}
        table = waits_table(records, self.transitions, within, level, asked)
        return soonest(table, within) if check_flag(smallest, "smallest") else table

    def is_undetected(self, family: str, source: str, detector: str | None) -> bool:
        """Whether no severity of a family raises clearly more alarms than the healthy structure does."""
        return self._family(family, source, detector).is_undetected

    def ranking(
        self,
        max_false_alarms: float,
        source: str = SIMULATED,
        confidence: float | None = None,
        *,
        by: Literal["pod", "pod_at_equal_pfa"] = "pod",
    ) -> pd.DataFrame:
        """Detectors in the order of what they find."""
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
        calibration = {name: decisions for (name, of), decisions in self.calibration.items() if of == source}
        if by == "pod_at_equal_pfa" and not calibration:
            raise ValueError(f"source {source!r} has no healthy records to move thresholds by; expected by='pod'")
        records = list(self._records(source).values())
        if asked != self.confidence:
            rows = pd.DataFrame([one.summary(asked) for one in records])
        return rank(records, rows, calibration, self.errors, limit, asked, by)

    def labelled_scores(
        self, detector: str | None, source: str, scenarios: Sequence[str] | None
    ) -> tuple[NDArray[np.bool_], Array]:
        """Which records are damaged, and how suspicious a detector finds them."""
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
                f"detector {name!r} has judged {len(healthy)} healthy and {len(damaged)} damaged records of source "
                f"{source!r} and scenarios {scenarios}; expected some of both"
            )
        return np.repeat([False, True], [len(healthy), len(damaged)]), np.r_[healthy, damaged]

    def summary(self, max_false_alarms: float, source: str = SIMULATED) -> str:
        """Which detector finds most, how soon, and which are not clearly worse, in plain sentences."""
        ranking = self.ranking(max_false_alarms, source)
        waits = self.time_to_detection(source=source, detector=ranking.index[0], smallest=True)
        lines = [in_words(ranking, max_false_alarms), *(f"{one.scenario!r} {one.text}." for one in waits.itertuples())]
        if self.replicates is not None and source == SIMULATED:
            lines.append(self.uncertainty_summary(ranking.index[0]))
        return "\n".join(lines)

    def uncertainty_summary(self, detector: str | None = None) -> str:
        """What the bands hold, and which part of the widest one is the largest, in plain sentences."""
        return sentences(self.table, self.uncertainty, self.detector_name(detector), self.confidence)

    def many_false_alarms(self) -> str:
        """What is wrong if a detector takes most simulated records of the healthy structure for damaged, or ""."""
        rows = self.table[(self.table["measure"] == "PFA") & (self.table["source"] == SIMULATED)]
        many = rows[rows["ci_low"] > MANY_FALSE_ALARMS]
        if not len(many):
            return ""
        names = ", ".join(map(repr, many["detector"].unique()))
        return (
            f"{many['rate'].iloc[0]:.0%} of the simulated records of scenario {many['scenario'].iloc[0]!r}, where "
            "nothing is changed, raise an alarm; expected a baseline in Hz of the structure that the chain has "
            "learned, and weather in degrees Celsius as in the baseline"
            f"{f' (detectors {names})' if self.table['detector'].nunique() > 1 else ''}"
        )

    def _check_source(self, source: Any) -> None:
        known = self.table["source"].dropna().unique().tolist()
        if source not in known:
            raise ValueError(f"source is {source!r:.100}; expected one of {known}")

    def _records(self, source: str) -> dict[tuple[str, str, str], JudgedRecords]:
        """What the detectors judged of one source."""
        scenarios = {one.name: one for one in self.scenarios}
        return {
            key: JudgedRecords(key[0], scenarios[key[1]], source, self.indices[key], decisions)
            for key, decisions in self.decisions.items()
            if key[2] == source
        }

    def _family(self, family: str, source: str, detector: str | None) -> FamilyRates:
        name = self.detector_name(detector)
        found = {key: one for key, one in families_of(self.table, self.confidence).items() if key[0] == name}
        is_known = isinstance(family, str) and isinstance(source, str)
        if not is_known or (name, family, source) not in found:
            known = [f"{f!r} ({s})" for _, f, s in found]
            raise ValueError(f"family {family!r}, source {source!r} is not in the results; expected one of {known}")
        return found[name, family, source]
