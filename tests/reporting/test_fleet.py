"""The page for the owner of many bridges: the worst first, and no bridge healthy of which nothing is known."""

import sys
import time
from urllib.parse import unquote

import pandas as pd
import pytest

from skthermo.reporting import owner_report
from tests.reporting.monitors import FakeFleet, FakeMonitor, event_row
from tests.reporting.pages import HOSTILE, QUOTED, Page, fitted_chain, page_text, sections_in

LOST = {"standard_error": 0.01, "per_year": -0.03, "per_year_error": 0.005, "significant": True, "p_value": 0.001}
ENDED = event_row("2025-03-02", "2025-03-20")


def drift_of(change):
    return pd.DataFrame({"change": [change], **LOST}, ["deck"])


class Unreadable(dict):
    """Monitors of which one cannot be read from its file."""

    def __getitem__(self, name):
        if name == "broken file":
            raise OSError("checksum <wrong>")
        return super().__getitem__(name)


@pytest.fixture(scope="module")
def fleet():
    """A bridge for each place in the table, in no order."""
    chain = fitted_chain()[0]
    monitors = {
        "healthy": FakeMonitor(),
        "silent": FakeMonitor(n_days=60),
        "blind": FakeMonitor(n_not_evaluated=20, reason="no mode has a value"),
        "drifting": FakeMonitor(drift=drift_of(-0.02)),
        "worn": FakeMonitor(drift=drift_of(-0.2)),
        "explained": FakeMonitor(events=[{**ENDED, "acknowledged": True, "harmless": True}]),
        "unexplained": FakeMonitor(events=[ENDED]),
        "by chance": FakeMonitor(events=[{**event_row("2025-06-01", None), "peak": 70.0}]),
        HOSTILE: FakeMonitor(events=[event_row("2025-06-01", None)]),
        "broken file": None,
    }
    errors = {"failed": f"ValueError: {QUOTED}", "not updated": "OSError (new records): no such file"}
    monitors["not updated"] = FakeMonitor()
    warned = [(HOSTILE, "offset", HOSTILE), ("only fitted", "gaps", QUOTED)]
    significant = {(HOSTILE, 1), ("unexplained", 1), ("explained", 1)}
    made = FakeFleet(monitors, {"only fitted": chain}, errors, warned, significant)
    made.monitors = Unreadable(made.monitors)
    return made


ORDER = [
    HOSTILE,
    "by chance",
    "unexplained",
    "worn",
    "broken file",
    "silent",
    "blind",
    "not updated",
    "failed",
    "only fitted",
    "drifting",
]
NOW = pd.Timestamp("2025-06-29 05:00")


@pytest.fixture(scope="module")
def file(fleet, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "all of #1.html"
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "matplotlib.pyplot", None)
        assert owner_report(fleet, path, title=QUOTED, now=NOW) == path
    return path


@pytest.fixture(scope="module")
def page(file):
    return Page(file.read_text(encoding="utf-8"))


def test_worst_bridges_come_first(page):
    links = [(name, link) for name, link in zip(page.link_texts, page.values("href"), strict=True) if "_pages/" in link]
    in_table = [name for name, _ in links[-13:]]
    assert in_table[: len(ORDER)] == ORDER
    assert sorted(in_table[len(ORDER) :]) == ["explained", "healthy"]


def test_every_bridge_has_a_page_that_links_back(page, file, fleet):
    links = {unquote(link) for link in page.links() if not link.startswith("#")}
    assert {path.relative_to(file.parent).as_posix() for path in file.parent.glob("*/*")} == links
    assert len(links) == len(fleet.table)
    for link in links:
        one = Page((file.parent / link).read_text(encoding="utf-8"))
        (back,) = [target for target in one.links() if not target.startswith("#")]
        assert ((file.parent / link).parent / unquote(back)).resolve() == file.resolve()
        assert one.is_self_contained()


def test_nothing_of_which_nothing_is_known_is_called_healthy(page, file):
    assert "2 of 13 bridges are in alarm" in page.text
    counts = "2 in alarm; 1 without an alarm, but with much stiffness lost slowly; 4 not evaluated by the monitor"
    assert f"Of 13\xa0bridges: {counts}; 1 that could not be fitted; 1 without a monitor; 4 healthy." in page.text
    assert "Nothing is known of 6\xa0bridges" in page.text
    for name in ("broken_file", "silent", "blind", "not_updated", "failed", "only_fitted"):
        text = (file.parent / "all of #1_pages" / f"{name}.html").read_text(encoding="utf-8")
        assert '"state not-evaluated"' in text
        assert "Healthy" not in Page(text).paragraphs[2]


def test_the_page_is_sound_and_says_what_failed(page, file, fleet):
    assert page.is_self_contained()
    assert [tag["id"] for tag in page.all("section")] == sections_in("fleet.html.j2")
    assert f"ValueError: {QUOTED}" in page.text
    for what in ("Its model could not be fitted to its records", "Its new records could not be evaluated"):
        assert page.text.count(what) == 2  # as a state, and beside its message
    assert "11 false alarms a year over all bridges" in page.text
    assert all(line in page.text for line in fleet.discoveries(0.1).summary().splitlines())
    fitted = Page((file.parent / "all of #1_pages" / "only_fitted.html").read_text(encoding="utf-8"))
    broken = Page((file.parent / "all of #1_pages" / "broken_file.html").read_text(encoding="utf-8"))
    assert "The file of its monitor cannot be read." in broken.paragraphs
    assert "OSError: checksum <wrong>" in broken.text
    assert "with a mean error of" in fitted.text
    assert QUOTED in fitted.text


def text_of(fleet, now=NOW):
    return Page(page_text(fleet, now=now)).text


def test_bridges_on_watch_come_after_alarms_and_before_healthy_ones():
    raised = FakeMonitor(events=[event_row("2025-06-25", None, kind="watch")], watch_per_year=12)
    bridges = {"well": FakeMonitor(), "raised": raised}
    alarmed = FakeMonitor(events=[event_row("2025-06-20", None)])
    page = Page(page_text(FakeFleet(bridges | {"alarmed": alarmed}), now=NOW))
    assert page.link_texts[-3:] == ["alarmed", "raised", "well"]
    assert "1 in alarm; 1 to be watched, with a raised damage index but no alarm; 1 healthy." in page.text
    assert "No alarm, but 1 of 2 bridges is to be watched" in text_of(FakeFleet(bridges))


def test_a_fleet_in_which_nothing_is_wrong():
    well = FakeFleet({0: FakeMonitor(), 1: FakeMonitor()})
    text = text_of(well)
    assert "No alarm: all 2 bridges are healthy" in text
    assert "None of the 2 evaluated bridges is in alarm" in text
    events = FakeFleet({0: FakeMonitor(), 1: FakeMonitor(events=[ENDED])}, significant={(1, 1)})
    assert "No alarm now, but 1 of 2 bridges had one that nobody has explained" in text_of(events)
    assert "No alarm, but nothing is known of 2 of 2 bridges" in text_of(well, "2025-09-01")


def test_arguments_for_a_single_structure_are_refused(fleet, tmp_path):
    with pytest.raises(ValueError, match="detector given for a Fleet"):
        owner_report(fleet, tmp_path / "a.html", detector="x")
    with pytest.raises(ValueError, match="fdr is 2; expected a share"):
        owner_report(fleet, tmp_path / "a.html", fdr=2)
    with pytest.raises(ValueError, match="now is 'soon'; expected a time"):
        owner_report(fleet, tmp_path / "a.html", now="soon")
    assert not list(tmp_path.iterdir())


@pytest.mark.nightly
def test_pages_of_many_bridges_are_small_and_take_as_long_as_each_alone(tmp_path):
    def taken(number):
        fleet = FakeFleet({f"bridge {one:03d}": FakeMonitor() for one in range(number)})
        start = time.process_time()
        owner_report(fleet, tmp_path / f"{number}.html", now=NOW)
        return time.process_time() - start

    few = taken(20)
    assert taken(200) < 20 * few
    assert sum(path.stat().st_size for path in tmp_path.rglob("*.html")) < 8.8e6  # of 220 bridges


def test_without_matplotlib_each_drawing_is_a_sentence_and_a_table(tmp_path, monkeypatch):
    monitor = FakeMonitor(events=[event_row("2025-06-20", None)], drift=drift_of(-0.02))
    drawn, page = (Page(page_text(monitor, is_drawn=is_drawn, now=NOW)) for is_drawn in (True, False))
    assert len(drawn.drawings()) == len(page.tables()) == 3
    assert not page.all("img")
    assert all(image["alt"].replace("\n", " ") in page.text for image in drawn.all("img"))
    for name, table in drawn.tables().items():
        pd.testing.assert_frame_equal(page.tables()[name], table)
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    fleet = FakeFleet({"one": monitor})
    owner_report(fleet, tmp_path / "all.html", now=NOW)
    (table,) = Page((tmp_path / "all_pages" / "one.html").read_text(encoding="utf-8")).tables().values()
    assert table["highest of the day"].max() == pytest.approx(monitor.days_["index_max"].max(), rel=1e-5)
