"""Section of a report on which of several alarm systems is recommended, and what the others are worth."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
import pandas as pd

from skthermo._tables.text import bounds_text, counted, percent, share_text
from skthermo.reporting._findings import SIMULATED
from skthermo.reporting._html import Section, bar, bullets, section, table
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
        """The recommended detector, or the one with the fewest false alarms."""
        return self.ranking.iloc[0]

    def only(self) -> DetectabilityStudy:
        """The study as if the detector of the report were its only one."""
        one = copy.copy(self.study)
        one.findings_ = self.study.findings_.only(self.name)
        return one

    def sentence(self) -> str:
        best, limit = quoted(self.best.name), percent(self.limit)
        text = f"Recommended is {best}, with a limit of {limit} false alarms."
        if not self.best["within_limit"]:
            text = f"None is recommended, as all exceed the limit of {limit} false alarms; {best} raises the fewest."
        asked = f"This report is on {quoted(self.name)}, as was asked for."
        return text if self.name == self.best.name else f"{text} {asked}"

    def section(self) -> Section:
        results = self.study.results_
        damaged = results[(results["measure"] == "POD") & (results["source"] == SIMULATED)]
        n_states = counted(damaged["scenario"].nunique(), "damaged state")
        columns = ["Alarm system", "False alarms", "Bounds", "Probability of detection", "Bounds"]
        columns += [f"Below {quoted(self.best.name)} (percentage points)", "Not evaluated"]
        caption = (
            f"Alarm systems, the best first, on the same simulated records. The probability of detection is the "
            f"mean over {n_states}. Bounds of the differences hold for all alarm systems together with "
            f"{percent(self.study.confidence_)} confidence; they cover the scatter of the measurements alone."
        )
        return section(
            "choice",
            "Which alarm system is recommended",
            bullets([self.sentence(), *self._comparison()]),
            table(caption, columns, [self._cells(name, row) for name, row in self.ranking.iterrows()], is_cards=True),
            link="Which alarm system",
        )

    def _comparison(self) -> list[str]:
        """What the study's summary says of the ranking; times and bands are in other sections."""
        waits = self.study.time_to_detection(detector=self.best.name, smallest=True)
        elsewhere = {f"{row['scenario']!r} {row['text']}." for _, row in waits.iterrows()}
        if self.study.uncertainty_ is not None:
            elsewhere |= set(self.study.uncertainty_summary(self.best.name).splitlines())
        return [line for line in self.study.summary(self.limit).splitlines() if line not in elsewhere]

    def _cells(self, name: str, row: pd.Series) -> list[str]:
        if row["error"]:
            return [name, "failed", *[""] * 5]
        cells = [name]
        for rate in ("false_alarms", "pod"):
            bounds = bounds_text(row[f"{rate}_ci_low"], row[f"{rate}_ci_high"])
            cells += [bar(row[rate], share_text(row[rate])), bounds]
        points = [100 * row[f"pod_deficit{end}"] for end in ("", "_ci_low", "_ci_high")]
        ends = f" ({points[1]:.1f} to {points[2]:.1f})" if np.isfinite(points[1]) else ""
        deficit = "" if name == self.best.name else f"{points[0]:.1f}{ends}"
        return [*cells, deficit, share_text(row["not_evaluated"])]


def quoted(name: object) -> str:
    """A name, which may hold commas, in a sentence."""
    return f"\N{LEFT DOUBLE QUOTATION MARK}{name}\N{RIGHT DOUBLE QUOTATION MARK}"
