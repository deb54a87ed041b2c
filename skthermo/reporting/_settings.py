"""Section of a page on settings, versions of programs, and warnings."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Iterator, Sequence
from importlib import import_module
from typing import Any

from skthermo.reporting._html import Html, bullets, element, paragraphs, section, table

LONGEST_VALUE = 400  # number of letters after which the text of a setting is cut
PACKAGES = ("skthermo", "numpy", "scipy", "pandas", "sklearn", "matplotlib")


def settings(
    introduction: str, caption: str, rows: Iterable[Sequence[Any]], warned: Sequence[str] | None = None
) -> Html:
    """Settings by name, versions and, where warnings are known, these."""
    parts = [
        paragraphs(introduction),
        table(caption, ["Setting", "Value"], rows),
        table("Versions of the programs.", ["Program", "Version"], versions()),
    ]
    if warned is not None:
        parts += [element("h3", "Warnings"), bullets(warned) or paragraphs("There was no warning.")]
    return section("settings", "Settings", *parts)


def parameters(estimator: Any) -> Iterator[tuple[str, Html]]:
    """Parameters by name, as short text; of what has none, nothing."""
    if not hasattr(estimator, "get_params"):
        return
    for name, value in estimator.get_params(deep=False).items():
        text = " ".join(repr(value).split())
        yield name, element("code", text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]} ...")


def versions() -> list[list[str]]:
    """Programs and their versions."""
    names = {"sklearn": "scikit-learn"}
    found = [[names.get(name, name), str(import_module(name).__version__)] for name in PACKAGES]
    return [["Python", platform.python_version()], *found]
