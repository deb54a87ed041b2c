"""The report on a study."""

from __future__ import annotations

from skthermo._tables.text import counted
from skthermo.fem import Structure
from skthermo.reporting._answer import answer, found_and_missed
from skthermo.reporting._choice import Choice
from skthermo.reporting._findings import findings_of
from skthermo.reporting._html import Html, Section, paragraphs
from skthermo.reporting._identified import identified_damage
from skthermo.reporting._model import monitored, quality
from skthermo.reporting._settings import parameters, settings
from skthermo.studies import DetectabilityStudy, IdentifiedDamage


def study_page(
    study: DetectabilityStudy,
    identified: IdentifiedDamage | None,
    structure: Structure | None,
    detector: str | None,
    max_false_alarms: float,
) -> tuple[Html, list[Section]]:
    """What stands above the sections, and these."""
    choice = None
    n_states = counted(study.results_["scenario"].nunique(), "state")
    said = [f"The alarm system was tested by simulation, in {n_states} of the structure."]
    if study.results_["detector"].nunique() > 1:
        choice = Choice.of(study, detector, max_false_alarms)
        n_systems = counted(len(choice.ranking), "alarm system")
        said = [f"{n_systems} were tested by simulation, in {n_states} of the structure.", choice.sentence()]
        study = choice.only()
    elif detector is not None:
        study.detector_name(detector)
    findings = findings_of(study)
    parts = {"model": study.fem, "alarm system": study.detectors_[study.detector_name()], "study": study}
    warned = [*getattr(study, "warnings_", [])]
    warned += [f"Identified damage: {text}" for text in ([] if identified is None else identified.warnings())]
    caption = "Settings of the model, of the alarm system and of the study."
    sections = [
        answer(study, findings, [] if identified is None else identified.answer()),
        None if choice is None else choice.section(),
        monitored(study, structure, [found.family for found in findings]),
        quality(study),
        found_and_missed(study, findings),
        None if identified is None else identified_damage(identified),
        settings(
            "For the engineer who repeats this study.",
            caption,
            parameters(parts, but=("study: fem", "study: detectors", "study: scenarios")),
            warned,
        ),
    ]
    return paragraphs(*said), [one for one in sections if one is not None]
