"""Section of a page on settings, versions of programs, and warnings."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module

from skthermo.reporting._html import Html, Section, bullets, element, paragraphs, section, table

LONGEST_VALUE = 400  # number of letters after which the text of a setting is cut
PACKAGES = ("skthermo", "numpy", "scipy", "pandas", "sklearn", "matplotlib")


def settings(
    introduction: str, caption: str, rows: Iterable[Sequence[object]], warned: Sequence[str] | None = None
) -> Section:
    """Settings by name, versions and, where warnings are known, these."""
    names = {"sklearn": "scikit-learn"}
    versions = [[names.get(name, name), str(import_module(name).__version__)] for name in PACKAGES]
    versions = [["Python", platform.python_version()], *versions]
    parts = [
        paragraphs(introduction),
        table(caption, ["Setting", "Value"], rows),
        table("Versions of the programs.", ["Program", "Version"], versions),
    ]
    if warned is not None:
        parts += [element("h3", "Warnings"), bullets(warned) or paragraphs("There was no warning.")]
    return section("settings", "Settings", *parts)


def parameters(estimators: Mapping[str, object], but: Sequence[str] = ()) -> list[list[str | Html]]:
    """Parameters of estimators as short text, by the name of their part; of what has none, nothing."""
    rows: list[list[str | Html]] = []
    for part, estimator in estimators.items():
        found = estimator.get_params(deep=False) if hasattr(estimator, "get_params") else {}
        for name, value in found.items():
            text = " ".join(repr(value).split())
            text = text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]} ..."
            label = f"{part}: {name}"
            rows += [] if label in but else [[label, element("code", text)]]
    return rows
