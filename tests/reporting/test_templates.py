"""Templates of pages: a folder of changed ones is used, escapes as the package's do, and errors name their place."""

import re
import sys
import textwrap
from pathlib import Path

import pandas as pd
import pytest

from skthermo.reporting import owner_report
from tests.reporting.monitors import FakeFleet, FakeMonitor, event_row
from tests.reporting.pages import HOSTILE, QUOTED, TEMPLATES, Page, assert_sound, sections_in

pytest.importorskip("matplotlib")
pytest.importorskip("jinja2")
GERMAN = Path(__file__).parent / "german"


@pytest.fixture(autouse=True)
def no_drawings(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)


@pytest.fixture
def write(tmp_path):
    """Write a template into a folder, and a page by it; the page."""

    def written(text, name="monitor.html.j2", subject=None):
        folder = tmp_path / "templates"
        folder.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
        subject = subject or FakeMonitor()
        now = pd.Timestamp("2025-06-29 05:00")
        return Page(owner_report(subject, tmp_path / "a.html", now=now, templates=folder).read_text(encoding="utf-8"))

    return written


@pytest.fixture(scope="module")
def monitor():
    drift = {"change": [-0.02], "standard_error": 0.01, "per_year": -0.01, "per_year_error": 0.01, "p_value": 0.2}
    faults = {"column": ["T1"], "kind": "stuck", "since": pd.Timestamp("2025-03-01"), "detail": QUOTED}
    events = [event_row("2025-03-03", "2025-03-09", note=HOSTILE), event_row("2025-06-10", None, modes=QUOTED)]
    return FakeMonitor(
        events=events,
        drift=pd.DataFrame(drift, ["deck"]).assign(significant=False),
        faults=pd.DataFrame(faults).assign(detected=pd.Timestamp("2025-03-05"), until=pd.NaT),
        n_not_evaluated=3,
        reason=HOSTILE,
    )


@pytest.mark.parametrize("folder", [None, GERMAN], ids=["own", "german"])
def test_a_page_in_another_language_has_the_same_parts_and_facts(monitor, tmp_path, folder):
    file = owner_report(monitor, tmp_path / "a.html", title=HOSTILE, now="2025-06-29 05:00", templates=folder)
    page = Page(file.read_text(encoding="utf-8"))
    assert page.all("html") == [{"lang": "en" if folder is None else "de"}]
    assert_sound(page, sections_in("monitor.html.j2", folder or TEMPLATES))
    assert "state alarm" in [tag.get("class") for tag in page.all("div")]
    assert {"1", "2", "deck", HOSTILE} <= set(page.heads)
    assert {"f1", QUOTED, "3"} <= set(page.cells)
    assert page.text.count(HOSTILE) == 4  # title, headline, note and reason
    assert len(page.tables()) == 3  # the last month, the last year, and drift
    assert any(("10" in text and "2025" in text) for text in page.paragraphs[:3])


def test_no_word_of_the_package_is_in_a_translation(monitor, tmp_path):
    pages = [
        Page(
            owner_report(monitor, tmp_path / "a.html", title="x", now="2025-06-29", templates=folder).read_text("utf-8")
        )
        for folder in (None, GERMAN)
    ]
    own, german = ({text for text in words_of(page) if re.search("[a-z]{2} [a-z]{2}", text)} for page in pages)
    assert len(own) > 30
    assert own & german == set()


def words_of(page):
    return [*page.paragraphs, *page.heads, *page.link_texts, *(image["alt"] for image in page.all("img"))]


def test_a_folder_goes_before_the_package_which_it_can_extend(write):
    guide = (Path(__file__).parents[2] / "docs" / "guide" / "report.rst").read_text(encoding="utf-8")
    example = guide.partition(".. code-block:: jinja\n\n")[2].partition("\n\nNames")[0]
    page = write(textwrap.dedent(example))
    ids = [tag["id"] for tag in page.all("section")]
    assert ids[:3] == ["today", "duty", "events"]
    assert "settings" not in ids
    assert [link.removeprefix("#") for link in page.links()] == ids
    assert "The newest record is of 29\xa0June\xa02025." in page.text


def test_a_folder_is_for_pages_of_a_fleet_too(write, tmp_path):
    fleet = FakeFleet({"one": FakeMonitor()}, errors={HOSTILE: HOSTILE})
    write('{% extends "skthermo/monitor.html.j2" %}{% block more %}<b>Anna</b>{% endblock %}', subject=fleet)
    assert "<b>Anna</b>" in (tmp_path / "a_pages" / "one.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("<p>\n{% if %}", 2, "Expected an expression"),
        ("<p>\n\n{{ standing.states }}", 3, "states"),
        ("{{ nothing_of_this_name }}", 1, "nothing_of_this_name"),
        ('\n{% extends "other.html.j2" %}', 2, "other.html.j2"),
        ("\n{{ standing.state|significant }}", 2, "isfinite"),
        ("{{ 1 + standing.state }}", 1, "unsupported operand"),
        ("\n{{ monitor.__class__.__mro__ }}", 2, "unsafe"),
        ("{{ standing.days.to_csv('/tmp/days.csv') }}", 1, "unsafe"),
        ("{{ monitor.acknowledge(1, harmless=true) }}", 1, "unsafe"),
    ],
)
def test_errors_name_the_file_and_the_line(write, tmp_path, text, line, message):
    with pytest.raises(ValueError, match=message) as raised:
        write(text)
    assert str(raised.value).startswith(f"{tmp_path / 'templates' / 'monitor.html.j2'}, line {line}: ")
    assert not (tmp_path / "a.html").exists()


def test_without_jinja_the_error_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "jinja2", None)
    for subject in (FakeMonitor(), FakeFleet({"one": FakeMonitor()})):
        with pytest.raises(ImportError, match=r"'jinja2' is not installed; .*\[pages\]"):
            owner_report(subject, tmp_path / "a.html")
    assert not list(tmp_path.iterdir())
