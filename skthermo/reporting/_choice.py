"""Section of a report on which of several alarm systems is recommended, and what the others are worth."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from skthermo._formatting import bounds_text, counted, listed, percent, share_text
from skthermo.reporting._findings import SIMULATED
from skthermo.reporting._html import Html, bar, bullets, paragraphs, section, table


@dataclass(frozen=True, eq=False)
class Choice:
    """Ranking of the detectors of a study with a limit of the share of false alarms, and the name of the one that the
    report is on."""

    study: Any
    ranking: pd.DataFrame
    limit: float
    name: str

    @classmethod
    def of(cls, study: Any, detector: str | None, limit: float) -> Choice:
        """The detector that is named, or the first of the ranking."""
        ranking = study.ranking(limit)
        return cls(study, ranking, limit, ranking.index[0] if detector is None else study.detector_name(detector))

    @property
    def best(self) -> pd.Series:
        """First row of the ranking."""
        return self.ranking.iloc[0]

    def only(self) -> Any:
        """The study as if the detector of the report were its only one."""
        one, results = copy.copy(self.study), self.study.results_
        one.results_ = results[results["detector"] == self.name].reset_index(drop=True)
        for what in ("detectors_", "thresholds_", "arrangements_"):
            setattr(one, what, {self.name: getattr(self.study, what)[self.name]})
        for what in ("indices_", "decisions_", "calibration_"):
            setattr(one, what, {key: found for key, found in getattr(self.study, what).items() if key[0] == self.name})
        return one

    def sentence(self) -> str:
        """Which detector is recommended, and which one the report is on."""
        best, limit, name = self.best, percent(self.limit), quoted(self.best.name)
        rates = (
            f"finds {share_text(best['pod'])} of the records of the damaged structure and raises false alarms in "
            f"{share_text(best['false_alarms'])} of the healthy ones"
        )
        if best["keeps_limit"]:
            text = f"Recommended is {name}: it {rates}, with a limit of {limit}."
        else:
            text = f"None keeps the limit of {limit} false alarms, so that none is recommended: {name} {rates}."
        return text if self.name == best.name else f"{text} This report is on {quoted(self.name)}, as was asked for."

    def groups(self) -> list[str]:
        """What the simulations say of the others, a sentence for each group of detectors."""
        others = self.ranking.drop(index=self.best.name)
        failed, known = others[others["error"] != ""], others[others["error"] == ""]
        quiet, loud = known[known["keeps_limit"]], known[~known["keeps_limit"]]
        best, limit = quoted(self.best.name), percent(self.limit)
        sentences = []
        if quiet["behind_lowest"].isna().any():
            sentences.append(f"One repeat of the simulations does not tell which of the others find less than {best}.")
        else:
            level, behind = quiet[~quiet["clearly_behind"]], quiet[quiet["clearly_behind"]]
            if len(level):
                why = "the simulations do not tell them apart, so that other reasons may decide"
                sentences.append(f"Not clearly worse than {best}: {quoted(*level.index)}; {why}.")
            if len(behind):
                sentences.append(f"Clearly worse: {quoted(*behind.index)}.")
        if len(loud) and self.best["keeps_limit"]:
            sentences.append(f"More false alarms than {limit}: {quoted(*loud.index)}.")
        return sentences + [f"Failed: {quoted(name)} ({row['error']})." for name, row in failed.iterrows()]

    def section(self) -> Html:
        """The recommended detector, and all others beside it."""
        results = self.study.results_
        damaged = results[(results["measure"] == "POD") & (results["source"] == SIMULATED)]
        n_states = counted(damaged["scenario"].nunique(), "damaged state")
        n_judged = counted(int((self.ranking["error"] == "").sum()), "alarm system")
        introduction = (
            f"{n_judged} judged the same simulated records: those of the healthy "
            f"structure and of {n_states}. The damage found is the mean over these states."
        )
        columns = ["Alarm system", "False alarms", "Bounds", "Damage found", "Bounds"]
        columns += [f"Less than {quoted(self.best.name)} (percentage points)", "Not judged"]
        caution = (
            "Differences hold for all alarm systems together with "
            f"{percent(self.study.confidence_)} confidence. They cover the scatter of the measurements, but neither "
            "damage of other kinds than those tested, nor weather of another kind, nor errors of the model."
        )
        return section(
            "choice",
            "Which alarm system is recommended",
            paragraphs(introduction, self.sentence()),
            bullets(self.groups()),
            table(
                "Alarm systems, the best first.", columns, map(self._cells, *zip(*self.ranking.iterrows(), strict=True))
            ),
            paragraphs(caution),
        )

    def _cells(self, name: str, row: pd.Series) -> list[Any]:
        if row["error"]:
            return [name, "failed", *[""] * 5]
        cells = [name]
        for rate in ("false_alarms", "pod"):
            bounds = bounds_text(row[f"{rate}_lowest"], row[f"{rate}_highest"])
            cells += [bar(row[rate], share_text(row[rate])), bounds]
        points = [100 * row[f"behind{end}"] for end in ("", "_lowest", "_highest")]
        ends = f" ({points[1]:.1f} to {points[2]:.1f})" if np.isfinite(points[1]) else ""
        behind = "" if name == self.best.name else f"{points[0]:.1f}{ends}"
        return [*cells, behind, share_text(row["not_judged"])]


def quoted(*names: Any) -> str:
    """Names, which may hold commas, in a sentence."""
    return listed([f"\N{LEFT DOUBLE QUOTATION MARK}{name}\N{RIGHT DOUBLE QUOTATION MARK}" for name in names])
