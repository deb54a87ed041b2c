"""The report of a study for the owner of a structure: one HTML file."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from datetime import date
from importlib import import_module
from pathlib import Path
from typing import Any

from sklearn.exceptions import NotFittedError

from skthermo._arguments import check_path
from skthermo._formatting import counted
from skthermo._io import write_when_complete
from skthermo.fem import Structure
from skthermo.reporting._answer import answer, found_and_missed
from skthermo.reporting._choice import Choice
from skthermo.reporting._findings import findings_of
from skthermo.reporting._html import Html, bullets, element, page, paragraphs, section, table
from skthermo.reporting._identified import identified_damage
from skthermo.reporting._model import monitored, quality
from skthermo.studies import IdentifiedDamage

TITLE = "Which damage the monitoring would find"
LONGEST_VALUE = 400  # number of letters after which the text of a setting is cut
PACKAGES = ("skthermo", "numpy", "scipy", "pandas", "sklearn", "matplotlib")


def owner_report(
    study: Any,
    path: str | os.PathLike[str],
    *,
    identified: Any = None,
    title: str | None = None,
    structure: Any = None,
    detector: str | None = None,
    max_false_alarms: float = 0.02,
) -> Path:
    """Write a report for the owner of a structure: one HTML file, with all drawings in it.

    It says in plain sentences which damage the monitoring would find, what was monitored, how good the model is, which
    damage was identified, and with which settings and warnings all this was computed. Of a study with several
    detectors, it says which one is recommended and why, and the rest is on that one.

    Parameters
    ----------
    study : DetectabilityStudy
        With the results of `~skthermo.studies.DetectabilityStudy.run`.
    path : str or path
        The file; an older one is replaced when the new one is complete.
    identified : IdentifiedDamage, optional
        Damage that was identified in records of the structure.
    title : str, optional
        Heading of the report.
    structure : Structure, optional
        Drawn with the damage groups in colour.
    detector : str, optional
        Name of the detector that the report is on, where there are several; by default the first of the study's
        ranking.
    max_false_alarms : float, default=0.02
        Limit of the share of false alarms, by which several detectors are ranked.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    NotFittedError
        If the study has no results.
    ValueError
        If the folder does not exist, the path is a folder, ``study`` or ``identified`` is something else, the detector
        has no results, or several cannot be ranked, as no scenario is healthy or none is damaged.
    ImportError
        If matplotlib is not installed.

    Notes
    -----
    The file needs no network and no script, follows the reader's choice of light or dark, and can be printed.

    Examples
    --------
    >>> import tempfile
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector
    >>> from skthermo.reporting import owner_report
    >>> from skthermo.studies import DetectabilityStudy, sweep
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year = make_truss_campaign(random_state=0)
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> study = DetectabilityStudy(fem, MahalanobisDetector(), sweep(fem, (0.1, 0.3), ["bottom"]), n_repeats=2)
    >>> results = study.run(year.temperatures)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = owner_report(study, f"{folder}/bridge.html", title="Truss bridge")
    ...     "<h1>Truss bridge</h1>" in file.read_text(encoding="utf-8")
    True
    """
    if not hasattr(study, "scenarios"):
        raise ValueError(f"study is {study!r:.200}; expected a DetectabilityStudy")
    if identified is not None and not isinstance(identified, IdentifiedDamage):
        raise ValueError(f"identified is {identified!r:.200}; expected what identify_damage gives")
    if not hasattr(study, "results_"):
        raise NotFittedError("the study has no results yet; expected a call of run before")
    if title is not None and not isinstance(title, str):
        raise ValueError(f"title is {title!r:.100}; expected a text")
    if structure is not None and not isinstance(structure, Structure):
        raise ValueError(f"structure is {structure!r:.200}; expected a Structure")
    file = check_path(path)
    if not file.parent.is_dir():
        raise ValueError(
            f"path is {str(file)!r}, and there is no folder {str(file.parent)!r}; expected one that exists"
        )
    if file.is_dir():
        raise ValueError(f"path is {str(file)!r}, a folder; expected a file, such as {str(file / 'report.html')!r}")
    choice = None
    if study.results_["detector"].nunique() > 1:
        choice = Choice.of(study, detector, max_false_alarms)
    elif detector is not None:
        study.detector_name(detector)
    n_states = counted(study.results_["scenario"].nunique(), "state")
    tested = "The alarm system was" if choice is None else f"{counted(len(choice.ranking), 'alarm system')} were"
    introduction = [f"{tested} tested by simulation, in {n_states} of the structure."]
    introduction += [] if choice is None else [choice.sentence()]
    ending = paragraphs(f"Written by skthermo on {date.today():%Y-%m-%d}.")
    sections = _sections(study if choice is None else choice.only(), identified, structure, choice)
    heading = TITLE if title is None else title
    write_when_complete(file, page(heading, paragraphs(*introduction), sections, ending))
    return file


def _sections(study: Any, identified: Any, structure: Any, choice: Choice | None) -> dict[str, tuple[str, Html]]:
    findings = findings_of(study)
    now = [] if identified is None else identified.answer()
    sections = {"answer": ("The answer", answer(study, findings, now))}
    if choice is not None:
        sections["choice"] = ("Which alarm system", choice.section())
    sections |= {
        "monitored": ("What was monitored", monitored(study, structure, [found.family for found in findings])),
        "model": ("How good the model is", quality(study)),
        "found": ("What would be found", found_and_missed(study, findings)),
    }
    if identified is not None:
        sections["identified"] = ("Identified damage", identified_damage(identified))
    return sections | {"settings": ("Settings", _settings(study, identified))}


def _settings(study: Any, identified: Any) -> Html:
    """Parameters, versions and warnings."""
    parts = {"model": study.fem, "alarm system": study.detectors_[study.detector_name()]}
    rows = [[f"{part}: {name}", value] for part, estimator in parts.items() for name, value in _parameters(estimator)]
    rows += [
        [f"study: {name}", value] for name, value in _parameters(study) if name not in ("fem", "detectors", "scenarios")
    ]
    warned = [*getattr(study, "warnings_", [])]
    warned += [f"Identified damage: {text}" for _, text in ([] if identified is None else identified.warnings())]
    return section(
        "settings",
        "Settings",
        paragraphs("For the engineer who repeats this study."),
        table("Settings of the model, of the alarm system and of the study.", ["Setting", "Value"], rows),
        table("Versions of the programs.", ["Program", "Version"], _versions()),
        element("h3", "Warnings"),
        bullets(warned) or paragraphs("There was no warning."),
    )


def _parameters(estimator: Any) -> Iterator[tuple[str, Html]]:
    """Parameters by name, as short text."""
    for name, value in estimator.get_params(deep=False).items():
        text = " ".join(repr(value).split())
        yield name, element("code", text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]} ...")


def _versions() -> list[list[str]]:
    names = {"sklearn": "scikit-learn"}
    versions = [[names.get(name, name), str(import_module(name).__version__)] for name in PACKAGES]
    return [["Python", platform.python_version()], *versions]
