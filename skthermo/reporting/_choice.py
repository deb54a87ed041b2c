"""Section of a report on which of several alarm systems is recommended, and what the others are worth."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
import pandas as pd

from skthermo._tables.text import bounds_text, counted, percent, share_text
from skthermo.reporting._findings import SIMULATED
from skthermo.reporting._html import Section, bar, bullets, paragraphs, section, table
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
    def best(self) -> pd.Series:
        """First row of the ranking."""
        return self.ranking.iloc[0]

    def only(self) -> DetectabilityStudy:
        """The study as if the detector of the report were its only one."""
        one = copy.copy(self.study)
        one.findings_ = self.study.findings_.only(self.name)
        return one

    def sentence(self) -> str:
        """Which detector is recommended, and which one the report is on."""
        best, limit = quoted(self.best.name), percent(self.limit)
        text = f"Recommended is {best}, with a limit of {limit} false alarms."
        if not self.best["within_limit"]:
            text = (
                f"None keeps the limit of {limit} false alarms, so that none is recommended; {best} raises the fewest."
            )
        asked = f"This report is on {quoted(self.name)}, as was asked for."
        return text if self.name == self.best.name else f"{text} {asked}"

    def section(self) -> Section:
        """The recommended detector, and all others beside it."""
        results = self.study.results_
        damaged = results[(results["measure"] == "POD") & (results["source"] == SIMULATED)]
        n_states = counted(damaged["scenario"].nunique(), "damaged state")
        n_evaluated = counted(int((self.ranking["error"] == "").sum()), "alarm system")
        introduction = (
            f"{n_evaluated} judged the same simulated records: those of the healthy "
            f"structure and of {n_states}. The damage found is the mean over these states."
        )
        columns = ["Alarm system", "False alarms", "Bounds", "Damage found", "Bounds"]
        columns += [f"Less than {quoted(self.best.name)} (percentage points)", "Not evaluated"]
        caution = (
            "Differences hold for all alarm systems together with "
            f"{percent(self.study.confidence_)} confidence. They cover the scatter of the measurements, but neither "
            "damage of other kinds than those tested, nor weather of another kind, nor errors of the model."
        )
        return section(
            "choice",
            "Which alarm system is recommended",
            paragraphs(introduction, self.sentence()),
            bullets(self.study.summary(self.limit).splitlines()),
            table(
                "Alarm systems, the best first.", columns, map(self._cells, *zip(*self.ranking.iterrows(), strict=True))
            ),
            paragraphs(caution),
            link="Which alarm system",
        )

    def _cells(self, name: str, row: pd.Series) -> list[str]:
        if row["error"]:
            return [name, "failed", *[""] * 5]
        cells = [name]
        for rate in ("false_alarms", "pod"):
            bounds = bounds_text(row[f"{rate}_ci_low"], row[f"{rate}_ci_high"])
            cells += [bar(row[rate], share_text(row[rate])), bounds]
        points = [100 * row[f"pod_deficit{end}"] for end in ("", "_ci_low", "_ci_high")]
        ends = f" ({points[1]:.1f} to {points[2]:.1f})" if np.isfinite(points[1]) else ""
        behind = "" if name == self.best.name else f"{points[0]:.1f}{ends}"
        return [*cells, behind, share_text(row["not_evaluated"])]


def quoted(name: object) -> str:
    """A name, which may hold commas, in a sentence."""
    return f"\N{LEFT DOUBLE QUOTATION MARK}{name}\N{RIGHT DOUBLE QUOTATION MARK}"
