"""Settings, and versions of programs."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec

LONGEST_VALUE = 400  # number of letters after which the text of a setting is cut
PACKAGES = ("skthermo", "numpy", "scipy", "pandas", "sklearn", "matplotlib")


def versions() -> list[tuple[str, str]]:
    """Versions of the programs by name."""
    names = {"sklearn": "scikit-learn"}
    installed = [name for name in PACKAGES if find_spec(name) is not None]
    found = [(names.get(name, name), str(import_module(name).__version__)) for name in installed]
    return [("Python", platform.python_version()), *found]


def settings_of(estimators: Mapping[str, object], but: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Parameters of estimators as short text, by the name of their part; of what has none, nothing."""
    rows = []
    for part, estimator in estimators.items():
        found = estimator.get_params(deep=False) if hasattr(estimator, "get_params") else {}
        for name, value in found.items():
            text = " ".join(repr(value).split())
            text = text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]} ..."
            label = f"{part}: {name}"
            rows += [] if label in but else [(label, text)]
    return rows
