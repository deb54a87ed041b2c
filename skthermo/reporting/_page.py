"""Pages from templates, the package's own or changed ones in a folder; their HTML, settings and versions."""

from __future__ import annotations

import os
import platform
import re
import traceback
from base64 import b64encode
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import lru_cache, partial
from hashlib import sha256
from importlib import metadata
from importlib.resources import files
from inspect import isfunction
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import pandas as pd

import skthermo
from skthermo._core import text
from skthermo._core.arrays import check_path
from skthermo._core.estimators import import_optional
from skthermo._core.frames import midnight

if TYPE_CHECKING:
    from datetime import datetime

    from jinja2 import Environment

Row: TypeAlias = dict[str, Any]


STYLE, SCRIPT = (
    "\n" + files("skthermo.reporting").joinpath(name).read_text(encoding="utf-8") for name in ("page.css", "page.js")
)
POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
    f"script-src 'sha256-{b64encode(sha256(SCRIPT.encode()).digest()).decode()}'"
)
"""What a browser may load: drawings within the page, and the page's own script; nothing from a network."""


def rendered(name: str, facts: Mapping[str, Any], folder: str = "") -> str:
    """A page from its template and facts; templates in a folder go before those of the package.

    Raises
    ------
    ValueError
        If a template is wrong: the error names its file and line.
    ImportError
        If jinja2 is not installed.
    """
    jinja2 = import_optional("jinja2", extra="pages")
    try:
        return environment_of(folder).get_template(f"{name}.html.j2").render(facts)
    except ImportError:  # of what draws
        raise
    except Exception as error:
        place = _place(error, folder)
        if not folder or not (place or isinstance(error, jinja2.TemplateError | UnicodeDecodeError)):
            raise
        raise ValueError(f"{place or folder}: {error}") from error


def check_templates(folder: str | os.PathLike[str] | None) -> str:
    """The folder as text, "" for none; an error for one that holds no template of a page, or without jinja2."""
    import_optional("jinja2", extra="pages")
    if folder is None:
        return ""
    path = check_path(folder, "templates")
    known = sorted(one.name for one in files("skthermo.reporting").joinpath("templates").iterdir())
    if not path.is_dir():
        raise ValueError(f"templates is {str(path)!r}, and there is no such folder; expected one with {known[0]!r}")
    if not any((path / name).is_file() for name in known):
        raise ValueError(f"templates is {str(path)!r}; expected a folder with one of {', '.join(known)}")
    return str(path.resolve())


@lru_cache(maxsize=8)
def environment_of(folder: str = "") -> Environment:
    """What finds and writes templates, with the filters that they may use."""
    jinja2 = import_optional("jinja2", extra="pages")
    own = jinja2.PackageLoader("skthermo.reporting")
    changed = [jinja2.FileSystemLoader(folder)] if folder else []
    environment = jinja2.Environment(
        loader=jinja2.ChoiceLoader([*changed, own, jinja2.PrefixLoader({"skthermo": own})]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        finalize=_printable,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {"policy": POLICY, "style": STYLE, "script": SCRIPT}
    environment.tests["finite"] = np.isfinite
    environment.filters |= {name: one for name, one in vars(text).items() if isfunction(one)}
    environment.filters |= {"moment": moment, "rows_of": rows_of, "sections_of": sections_of}
    environment.filters |= {"grouped": "{:,}".format, "day": partial(moment, is_short=True)}
    return environment


def rows_of(table: pd.DataFrame) -> list[Row]:
    """Rows by the names of the columns, their label as "name"; a missing time is None, a missing number NaN."""
    rows = table.to_dict("index") if table.index.is_unique else dict(enumerate(table.to_dict("records")))
    return [
        {"name": label, **{str(key): None if one is pd.NaT else one for key, one in row.items()}}
        for label, row in rows.items()
    ]


def sections_of(page: str) -> list[tuple[str, str]]:
    """Anchors and headings of the sections of a page, as HTML."""
    return re.findall(r'<section id="([^"]+)"[^>]*>\s*<h2[^>]*>(.*?)</h2>', page, re.DOTALL)


def moment(time: str | datetime | None, *, is_short: bool = False) -> str:
    """A time as text that stays on one line: its day, and the hour where it is not midnight; nothing for none."""
    if pd.isna(time):
        return ""
    stamp = pd.Timestamp(time)
    day = f"{stamp.day} {stamp.month_name()[: 3 if is_short else None]} {stamp.year}".replace(" ", text.SPACE)
    return day if stamp == midnight(stamp) else f"{day}, {stamp:%H:%M}"


def _printable(value: Any) -> Any:
    """What a template writes: nothing for None, and text without control characters."""
    if value is None:
        return ""
    return value if hasattr(value, "__html__") else text.printable(value)


def _place(error: Exception, folder: str = "") -> str:
    """File and line of the innermost template, perhaps of those in a folder, through which an error came."""
    frames = [(frame.filename, frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
    found = [(file, line) for file, line in frames if file.startswith(folder) and file.endswith(".html.j2")]
    return f"{found[-1][0]}, line {found[-1][1]}" if found else ""


def versions() -> list[tuple[str, str]]:
    """Versions of the programs by name."""
    found = {"Python": platform.python_version(), "skthermo": skthermo.__version__}
    for name in ("numpy", "scipy", "pandas", "scikit-learn", "matplotlib"):
        with suppress(metadata.PackageNotFoundError):
            found[name] = metadata.version(name)
    return list(found.items())


def settings_of(estimators: Mapping[str, object], but: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Parameters of estimators as short text, by the name of their part; of what has none, nothing."""
    rows = [
        (f"{part}: {name}", " ".join(repr(value).split()))
        for part, estimator in estimators.items()
        if hasattr(estimator, "get_params")
        for name, value in estimator.get_params(deep=False).items()
    ]
    return [(name, shown if len(shown) <= 400 else f"{shown[:400]} ...") for name, shown in rows if name not in but]
