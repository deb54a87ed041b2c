"""What pages are made of: templates, the package's own or changed ones in a folder, tables, and drawings as SVG whose
values can be read under the pointer, and as CSV."""

from __future__ import annotations

import os
import platform
import re
import textwrap
import traceback
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache, partial
from hashlib import sha256
from importlib import metadata
from importlib.resources import files
from inspect import isfunction
from io import BytesIO
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias
from urllib.parse import quote

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

import skthermo
from skthermo._core import text
from skthermo._core.arrays import check_path
from skthermo._core.estimators import import_optional
from skthermo._core.text import printable
from skthermo._core.warnings import collected
from skthermo.fem import Structure
from skthermo.plotting import DetectorsDisplay, StructureDisplay

if TYPE_CHECKING:
    from jinja2 import Environment
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skthermo.studies import IdentifiedDamage

Row: TypeAlias = dict[str, Any]


STYLE, SCRIPT = (
    "\n" + files("skthermo.reporting").joinpath(name).read_text(encoding="utf-8") for name in ("page.css", "page.js")
)
POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
    f"script-src 'sha256-{b64encode(sha256(SCRIPT.encode()).digest()).decode()}'"
)
"""What a browser may load: drawings within the page, and the page's own script; nothing from a network."""
UNSAFE = r"to_(?!dict$)\w+|tofile|save(fig)?|eval|query|pipe|apply|fit|update|acknowledge|discard|re(fit|base\w+)"
"""Names of methods and attributes of facts that write files, run code or change a monitor."""


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
    except Exception as error:
        frames = [(frame.filename, frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
        inside = [(file, line) for file, line in frames if file.startswith(folder) and file.endswith(".html.j2")]
        place = "{}, line {}".format(*inside[-1]) if inside else ""
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
    if not any((path / name).is_file() for name in known):
        raise ValueError(f"templates is {str(path)!r}; expected a folder with one of {', '.join(known)}")
    return str(path.resolve())


@lru_cache(maxsize=8)
def environment_of(folder: str = "") -> Environment:
    """What finds and writes templates, with the filters that they may use."""
    jinja2, sandbox = (import_optional(name, extra="pages") for name in ("jinja2", "jinja2.sandbox"))
    own = jinja2.PackageLoader("skthermo.reporting")
    changed = [jinja2.FileSystemLoader(folder)] if folder else []

    class Sandbox(sandbox.ImmutableSandboxedEnvironment):
        """Templates read facts: they reach no private name, and no method that writes files, runs code or changes."""

        def is_safe_attribute(self, obj: Any, attr: str, value: Any) -> bool:
            return super().is_safe_attribute(obj, attr, value) and not re.fullmatch(UNSAFE, attr)

    environment = Sandbox(
        loader=jinja2.ChoiceLoader([*changed, own, jinja2.PrefixLoader({"skthermo": own})]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        finalize=lambda value: "" if value is None else value if hasattr(value, "__html__") else printable(value),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {"policy": POLICY, "style": STYLE, "script": SCRIPT, "versions": versions}
    environment.tests["finite"] = np.isfinite
    environment.filters |= {name: one for name, one in vars(text).items() if isfunction(one)}
    environment.filters |= {"moment": text.day_text, "rows_of": rows_of, "sections_of": sections_of}
    environment.filters |= {"grouped": "{:,}".format, "day": partial(text.day_text, is_short=True)}
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


@lru_cache(maxsize=1)
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


class Drawing(NamedTuple):
    """A picture, what it shows in words, and the table behind it, as addresses of data.

    ``x`` and ``y`` are places of the rows in thousandths of the picture's width and height, from the top left corner.
    Without a table ``csv`` is empty, without matplotlib ``source`` is.
    """

    alt: str
    source: str = ""
    name: str = ""
    csv: str = ""
    n_rows: int = 0
    x: str = ""
    y: str = ""


def csv_address(table: pd.DataFrame) -> str:
    """A table as CSV, within an address."""
    index = table.index
    if isinstance(index, pd.DatetimeIndex):
        times = index.tz_localize(None)
        index = times.strftime("%Y-%m-%d %H:%M" if (times != times.normalize()).any() else "%Y-%m-%d")
    elif not is_numeric_dtype(index):
        index = index.map(printable)
    shown = table.rename(columns=printable).set_axis(index)
    label = printable(table.index.name or "record")
    content = shown.to_csv(float_format="%.6g", index_label=label, lineterminator="\n")
    return f"data:text/csv;charset=utf-8,{quote(content, safe=',:;+/')}"


def draw(
    make: Callable[..., Any],
    alt: str,
    title: str = "",
    *,
    height: float | None = 2.8,
    width: float = 4.2,
    name: str = "",
    table: pd.DataFrame | None = None,
    is_scatter: bool = False,
    legend: str | None = "outside upper center",
) -> Drawing:
    """A display as an image of fixed width, in matplotlib's own style and on white; its values can be read.

    Width and height are in inches, so that a telephone shows it at nearly full size; without a height, the drawing
    keeps its proportions, with room for a legend. The index of the table is in the unit of the horizontal axis; in a
    scatter plot, a row is a point of its first column. Without matplotlib, what the image shows is said, and its values
    can be saved.
    """
    drawn = Drawing(alt)
    if table is not None:
        drawn = drawn._replace(name=name, csv=csv_address(table), n_rows=len(table))
    try:
        plt = import_optional("matplotlib.pyplot", extra="plot")
    except ImportError:
        return drawn
    settings = {"svg.hashsalt": "skthermo", "figure.facecolor": "white", "savefig.dpi": 150}
    with plt.style.context("default"), plt.rc_context(settings):
        figure = make().figure_
        own_width, own_height = figure.get_size_inches()
        figure.set_size_inches(width, own_height / own_width * width + 0.5 if height is None else height)
        _fold_legend(figure, legend)
        if title:
            shown = textwrap.shorten(printable(title), 50, placeholder=" ...")
            figure.axes[0].set_title(shown, fontsize="medium", parse_math=False)
        drawn = drawn._replace(source=f"data:image/svg+xml;base64,{b64encode(_svg(figure)).decode()}")
        drawn = drawn if table is None else drawn._replace(**_places(figure.axes[0], table, is_scatter))
        plt.close(figure)
        return drawn


def _fold_legend(figure: Figure, place: str | None) -> None:
    """Put the legends of a figure into one place and at most two columns, so that they fit a narrow drawing."""
    for one in [*figure.legends, *(ax.get_legend() for ax in figure.axes if ax.get_legend())]:
        labels = [text.get_text() for text in one.get_texts()]
        one.remove()
        is_wide = max(map(len, labels)) > 28  # letters, of which two labels fit beside each other
        style = {"ncols": 1 if is_wide else 2, "frameon": False, "fontsize": "small" if is_wide else "medium"}
        if place is not None:
            figure.legend(one.legend_handles, labels, loc=place, **style)


def _svg(figure: Figure) -> bytes:
    """A figure as SVG: letters as shapes or, if the font lacks some, as text in fonts of the reader."""
    fonts, texts = (import_optional(f"matplotlib.{name}", extra="plot") for name in ("font_manager", "text"))
    for line in figure.findobj(lambda artist: hasattr(artist, "get_xdata")):
        line.set_rasterized(len(line.get_xdata()) > 1000)  # as an image, which is smaller
    letters = {ord(letter) for one in figure.findobj(texts.Text) for letter in one.get_text() if letter.isprintable()}
    has_all = letters <= set(fonts.get_font(fonts.findfont(fonts.FontProperties())).get_charmap())
    drawn = BytesIO()
    plt = import_optional("matplotlib.pyplot", extra="plot")
    with plt.rc_context({"svg.fonttype": "path" if has_all else "none"}), collected(drop_others=True):
        figure.savefig(drawn, format="svg", metadata={"Date": None})
    return drawn.getvalue()


def _places(ax: Axes, table: pd.DataFrame, is_scatter: bool) -> dict[str, str]:
    """Where the rows of a table are drawn."""
    index = table.index.tz_localize(None) if isinstance(table.index, pd.DatetimeIndex) else table.index
    is_placed = isinstance(index, pd.DatetimeIndex) or is_numeric_dtype(index)
    across = ax.convert_xunits(np.asarray(index if is_placed else range(len(index))))
    up = table.iloc[:, 0].to_numpy(dtype=float) if is_scatter else np.zeros(len(table))
    pixels = ax.transData.transform(np.column_stack([across, up]))
    x, y = 1000 * ax.figure.transFigure.inverted().transform(pixels).T
    shares = {"x": x, "y": np.clip(1000 - y, 0, 1000)} if is_scatter else {"x": x}
    return {name: " ".join(f"{share:.0f}" for share in places) for name, places in shares.items()}


def draw_structure(
    structure: Structure, alt: str, groups: Sequence[str] | None = None, losses: Mapping[str, float] | None = None
) -> Drawing:
    """Where damage groups are, or the smallest loss of stiffness of each member's group that raises an alarm."""
    values = None if losses is None else {name: 100 * loss for name, loss in losses.items()}
    make = partial(StructureDisplay.from_structure, structure, values, groups=groups, label="smallest loss (%)")
    return draw(make, alt, height=None, width=5.2 if losses is None else 6.2, legend="outside lower center")


def identified_facts(identified: IdentifiedDamage) -> dict[str, Any]:
    """What the template of the section on identified damage is given: probabilities and severities are drawn one below
    the other."""
    height = 2.6 + 0.6 * len(identified.table)

    def make() -> DetectorsDisplay:
        plt = import_optional("matplotlib.pyplot", extra="plot")
        axes = plt.subplots(2, 1, figsize=(4.2, height), layout="constrained")[1]
        return DetectorsDisplay.from_predictions(identified.table, ax=axes)

    saved = Drawing("", name="identified damage", csv=csv_address(identified.table.rename_axis("group")))
    return {"found": identified, "draw": partial(draw, make, height=height), "saved": saved}
