"""Pages for the owners of structures: one HTML file each."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from sklearn.exceptions import NotFittedError

from skthermo._core.arrays import check_path, check_size
from skthermo._core.files import write_when_complete
from skthermo.fem import Structure
from skthermo.reporting._monitor import Standing, monitor_facts
from skthermo.reporting._page import check_templates, identified_facts, rendered

if TYPE_CHECKING:  # jobs write the page on a monitor every night: studies and fleets are imported for their own pages
    from skthermo.monitoring import Fleet, Monitor
    from skthermo.studies import DetectabilityStudy, IdentifiedDamage


def owner_report(
    subject: DetectabilityStudy | Monitor | Fleet,
    path: str | os.PathLike[str],
    *,
    identified: IdentifiedDamage | None = None,
    title: str | None = None,
    structure: Structure | None = None,
    detector: str | None = None,
    max_false_alarms: float = 0.02,
    drift_limit: float = 0.1,
    fdr: float = 0.1,
    now: str | pd.Timestamp | None = None,
    templates: str | os.PathLike[str] | None = None,
    settings: str | None = None,
) -> Path:
    """Write a report for the owner of a structure, or of many: one HTML file, with all drawings in it.

    Of a study, it says which damage the monitoring would detect; of a monitor, how the structure is today; of a fleet,
    which bridges are in alarm, with a page for each in a folder beside the file (``fleet_pages`` for ``fleet.html``),
    whose earlier pages are replaced. :doc:`/guide/report` describes the pages.

    Parameters
    ----------
    subject : DetectabilityStudy, Monitor or Fleet
        A study with the results of `~skthermo.studies.DetectabilityStudy.run`, a fitted
        `~skthermo.monitoring.Monitor`, or what `~skthermo.monitoring.fit_fleet` gives.
    path : str or path
        The file; an older one is replaced when the new one is complete.
    identified : IdentifiedDamage, optional
        Damage that was identified in records of the structure.
    title : str, optional
        Heading of the report.
    structure : Structure, optional
        Drawn with the damage groups in colour; on the page on a monitor with directions of these groups, in the colour
        of the smallest loss that raises an alarm.
    detector : str, optional
        Name of the detector that the report is on, where there are several; by default the first of the study's
        ranking.
    max_false_alarms : float, default=0.02
        Limit of the share of false alarms, by which several detectors are ranked.
    drift_limit : float, default=0.1
        Loss of stiffness of which the page on a monitor says when slow drift reaches it.
    fdr : float, default=0.1
        False discovery rate: share of healthy ones among the significant bridges of the page on a fleet, on average.
    now : time, optional
        When the page on a monitor or a fleet is written, in the time zone of the records; by default the clock's time.
    templates : str or path, optional
        Folder of templates in Jinja that go before the package's, such as ``monitor.html.j2`` in another language.
        They run in Jinja2's sandbox, which keeps them from files and code; a page is still what they make of it.
    settings : str, optional
        Settings of the monitor as they are named in commands, such as "river": the page on a monitor then names the
        commands by which events are acknowledged, in place of calls in Python.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    NotFittedError
        If the study has no results, or the monitor is not fitted.
    ValueError
        If the folder does not exist, the path is a folder, an argument is something else or does not belong to this
        subject, the detector has no results, several cannot be ranked, as no scenario is healthy or none is damaged, or
        a template is wrong: the error names its file and line.
    ImportError
        If jinja2 is not installed. Without matplotlib, a sentence and a table to save stand in place of each drawing.

    Notes
    -----
    The file needs no network, follows the reader's choice of light or dark, and can be printed. Its only script shows
    the values of drawings; all else works without it.

    Examples
    --------
    >>> import tempfile
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector
    >>> from skthermo.reporting import owner_report
    >>> from skthermo.studies import DetectabilityStudy, sweep
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year = make_truss_campaign(random_state=0)
    >>> fem = DataInformedFEM(make_truss(1), random_state=0).fit(year.temperatures, year.frequencies[["f1"]])
    >>> scenarios = sweep(fem, (0.1, 0.3), ["bottom"])
    >>> study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, n_repeats=2, uncertainty="noise")
    >>> results = study.run(year.temperatures)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = owner_report(study, f"{folder}/bridge.html", title="Truss bridge")
    ...     "<h1>Truss bridge</h1>" in file.read_text(encoding="utf-8")
    True
    """
    kind = _kind_of(subject)
    others = {"structure": structure, "detector": detector, "now": now, "settings": settings}
    _check_arguments(kind, identified=identified, title=title, **others)
    file, folder = check_path(path), check_templates(templates)
    if file.is_dir() or not file.parent.is_dir():
        raise ValueError(f"path is {str(file)!r}; expected a file in a folder that exists, such as 'report.html'")
    limit = check_size(drift_limit, "drift_limit", 0, 1, "a loss of stiffness between 0 and 1, such as 0.1")
    check_size(fdr, "fdr", 0, 1, "a share of false ones between 0 and 1, such as 0.1")
    if kind == "Fleet":
        from skthermo.reporting._fleet import write_fleet

        write_fleet(subject, file, title, now, limit, fdr, folder)
        return file
    if kind == "Monitor":
        facts = monitor_facts(Standing(subject, now, limit), structure) | {"call": settings}
        facts["identified"] = None if identified is None else identified_facts(identified)
    else:
        from skthermo.reporting._study import study_facts

        facts = study_facts(subject, identified, structure, detector, max_false_alarms)
    page = "monitor" if kind == "Monitor" else "study"
    write_when_complete(file, rendered(page, facts | {"title": title}, folder))
    return file


def _kind_of(subject: object) -> str:
    """Whether it is a study, a monitor or a fleet; an error for what is none, or has nothing to report yet."""
    attributes = {"Fleet": "discoveries", "Monitor": "acknowledge", "DetectabilityStudy": "scenarios"}
    kind = next((kind for kind, name in attributes.items() if hasattr(subject, name)), None)
    if kind is None:
        raise ValueError(f"subject is {subject!r:.200}; expected a DetectabilityStudy, a Monitor or a Fleet")
    for of_kind, needed, call in (("Monitor", "events_", "fit"), ("DetectabilityStudy", "results_", "run")):
        if kind == of_kind and not hasattr(subject, needed):
            raise NotFittedError(f"the {kind} has no {needed} yet; expected a call of {call} before")
    return kind


def _check_arguments(kind: str, **given: Any) -> None:
    """Raise an error for arguments of another type, or that are not for this subject."""
    types: dict[str, type] = {"title": str, "structure": Structure, "settings": str}
    if given["identified"] is not None:
        from skthermo.studies import IdentifiedDamage

        types["identified"] = IdentifiedDamage
    for name, expected in types.items():
        if given[name] is not None and not isinstance(given[name], expected):
            raise ValueError(f"{name} is {given[name]!r:.200}; expected a {expected.__name__}")
    of_others = {"Fleet": ("identified", "structure", "detector", "settings"), "Monitor": ("detector",)}
    for name in of_others.get(kind, ("now", "settings")):
        if given[name] is not None:
            raise ValueError(f"{name} given for a {kind}; expected it for other subjects only")
