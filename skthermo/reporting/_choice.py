"""Which of several alarm systems is recommended, and what the others are worth."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import pandas as pd

from skthermo.reporting._findings import SIMULATED
from skthermo.studies import DetectabilityStudy


@dataclass(frozen=True, eq=False)
class Choice:
    """Ranking of the detectors of a study with a limit of the share of false alarms, and the name of the one that the
    report is on."""

    study: DetectabilityStudy
    ranking: pd.DataFrame
    limit: float
    name: str

    @classmethod
    def of(cls, study: DetectabilityStudy, detector: str | None, limit: float) -> Choice:
        """The detector that is named, or the first of the ranking."""
        ranking = study.ranking(limit)
        return cls(study, ranking, limit, ranking.index[0] if detector is None else study.detector_name(detector))

    @property
    def best(self) -> str:
        """The recommended detector, or the one with the fewest false alarms."""
        return self.ranking.index[0]

    @property
    def best_row(self) -> pd.Series:
        return self.ranking.iloc[0]

    @property
    def n_damaged(self) -> int:
        """Number of damaged states that were simulated."""
        results = self.study.results_
        return results.loc[(results["measure"] == "POD") & (results["source"] == SIMULATED), "scenario"].nunique()

    def only(self) -> DetectabilityStudy:
        """The study as if the detector of the report were its only one."""
        one, results = copy.copy(self.study), self.study.results_
        one.results_ = results[results["detector"] == self.name].reset_index(drop=True)
        one.indices_ = {key: index for key, index in self.study.indices_.items() if key[0] == self.name}
        return one

    @property
    def comparison(self) -> list[str]:
        """What the study's summary says of the ranking; bands are in another section."""
        elsewhere: set[str] = set()
        if self.study.uncertainty_ is not None:
            elsewhere = set(self.study.uncertainty_summary(self.best).splitlines())
        return [line for line in self.study.summary(self.limit).splitlines() if line not in elsewhere]
