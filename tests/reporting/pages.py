"""A small structure whose names try to break a page, and a reader that checks pages."""

import base64
import functools
import re
import sys
import tempfile
from hashlib import sha256
from html.parser import HTMLParser
from importlib.resources import files
from io import StringIO
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from skthermo.detection import MahalanobisDetector
from skthermo.fem import AffineModel
from skthermo.reporting import owner_report
from skthermo.studies import DetectabilityStudy
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper

HOSTILE = "<script>alert(1)</script>"
QUOTED = "\"onerror='x' & $\\frac{"
SENSOR, MODES = "<b>air</b>", ["</table><img src=x>", "$x^{", "f3"]
TEMPLATES = files("skthermo.reporting") / "templates"
SCRIPT = "\n" + files("skthermo.reporting").joinpath("page.js").read_text(encoding="utf-8")
VOID = {"meta", "img", "br", "link", "hr", "input"}


@functools.cache
def fitted_chain(index=True):
    """Three masses on springs of two groups, whose stiffness falls with temperature; no test changes it."""
    n_records = 120
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
    first, second = np.zeros((3, 3)), np.zeros((3, 3))
    first[0, 0] = 400.0
    first[:2, :2] += 900.0 * spring
    second[1:, 1:] += 800.0 * spring
    model = AffineModel({(HOSTILE,): first, (QUOTED,): second}, np.eye(3), n_modes=3)
    random = np.random.RandomState(0)
    weather = 10 + 12 * np.sin(np.arange(n_records) / 12) + random.standard_normal(n_records)
    theta = 1 - np.column_stack([0.004 * weather, 0.003 * weather])
    F = model.frequencies(theta) * (1 + 0.005 * random.standard_normal((n_records, 3)))
    F[5:9, 1] = np.nan
    T = weather[:, np.newaxis]
    if index:
        days = pd.date_range("2024-01-01", periods=n_records, freq="D")
        T, F = pd.DataFrame(T, days, [SENSOR]), pd.DataFrame(F, days, MODES)
    mapper = TemperatureMapper(random_state=0)
    inverse = PosteriorInverse(noise=0.005)
    return DataInformedFEM(model, inverse=inverse, mapper=mapper, random_state=0).fit(T, F), T, F


def run_study(fem, T, scenarios, **options):
    study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, n_repeats=2, random_state=0, uncertainty="noise")
    study.run(T, **options)
    return study


def page_text(subject, *, is_drawn=False, **options):
    """The page on a subject; drawings are sentences, as without matplotlib, unless they are wanted."""
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        if not is_drawn:
            patch.setitem(sys.modules, "matplotlib.pyplot", None)
        return owner_report(subject, Path(folder) / "page.html", **options).read_text(encoding="utf-8")


def sections_in(template, folder=TEMPLATES):
    """Names of the sections that a template has, in its order."""
    return re.findall(r'call section\("([^"]+)"', (folder / template).read_text(encoding="utf-8"))


def section_text(text, anchor):
    """One section of a page."""
    return re.search(rf'<section id="{anchor}".*?</section>', text, re.DOTALL)[0]


def section_of(text, anchor):
    return Page(section_text(text, anchor))


class Page(HTMLParser):
    """A page or a section that was read, white space as one space: an error if tags are not balanced."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.text, self.cells, self.heads, self.paragraphs = [], [], "", [], [], []
        self.link_texts = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        assert len(dict(attributes)) == len(attributes), f"{tag} has an attribute twice"
        self.tags.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "script":
            assert data == SCRIPT, "a script that is not the page's own"
        elif self.open and self.open[-1] not in ("style", "title"):
            data = re.sub("[ \n]+", " ", data)
            self.text += data
            texts = {"td": self.cells, "th": self.heads, "p": self.paragraphs, "a": self.link_texts}.get(self.open[-1])
            if texts is not None and data.strip(" "):
                texts.append(data.strip(" "))

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]

    def values(self, attribute):
        return [attributes[attribute] for _, attributes in self.tags if attribute in attributes]

    def links(self):
        """Where links lead, those that save a table left out."""
        return [link for link in self.values("href") if not link.startswith("data:text/csv;")]

    def tables(self):
        """Tables behind drawings by the names of their files."""
        saved = [link for link in self.all("a") if "download" in link]
        return {one["download"]: pd.read_csv(StringIO(unquote(one["href"].split(",", 1)[1]))) for one in saved}

    def is_self_contained(self):
        """Nothing is loaded, and no script runs but the page's own."""
        (policy,) = [tag["content"] for tag in self.all("meta") if "http-equiv" in tag]
        foreign = [tag for tag, _ in self.tags if tag in ("link", "iframe", "object", "form")]
        handlers = [name for _, attributes in self.tags for name in attributes if name.startswith("on")]
        hashed = base64.b64encode(sha256(SCRIPT.encode()).digest()).decode()
        is_closed = policy.startswith("default-src 'none';") and policy.endswith(f"script-src 'sha256-{hashed}'")
        return is_closed and self.all("script") == [{}] and not foreign and not handlers

    def drawings(self):
        """Drawings as trees; an error if they are no XML."""
        kind = "data:image/svg+xml;base64,"
        sources = [image["src"] for image in self.all("img")]
        assert all(source.startswith(kind) for source in sources)
        return [ElementTree.fromstring(base64.b64decode(source[len(kind) :])) for source in sources]


def assert_sound(page, sections):
    """It has these sections and links to them, loads nothing from elsewhere, and can be read without seeing it."""
    ids, tags = page.values("id"), [tag for tag, _ in page.tags]
    assert [tag["id"] for tag in page.all("section")] == sections
    assert page.links() == [f"#{name}" for name in sections]
    assert len(set(ids)) == len(ids)
    assert set(page.values("aria-labelledby")) <= set(ids)
    assert page.is_self_contained()
    levels = [int(tag[1]) for tag in tags if re.fullmatch("h[1-6]", tag)]
    assert (levels[0], levels.count(1)) == (1, 1)
    assert max(np.diff(levels)) <= 1
    assert all(len(image["alt"]) > 20 for image in page.all("img"))
    assert all(tags[i + 1] == "caption" for i, tag in enumerate(tags) if tag == "table")
    assert all(head["scope"] in ("col", "row") for head in page.all("th"))
