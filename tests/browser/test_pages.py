"""Owner's pages in a browser: on a telephone, on a screen, on paper, by keyboard, and read by machines."""

import pandas as pd
import pytest

from skthermo.reporting import owner_report
from skthermo.studies import sweep
from tests.browser.reader import CUT, SMALL_TEXT, WIDTHS
from tests.reporting.monitors import FakeFleet, FakeMonitor, event_row
from tests.reporting.pages import HOSTILE, fitted_chain, run_study
from tests.studies.identified import identified

pytest.importorskip("matplotlib")
pytestmark = pytest.mark.filterwarnings("ignore:.*few-records")

BREAKABLE = """
return [...document.querySelectorAll("tr, img, .state")]
  .filter((one) => getComputedStyle(one).breakInside !== "avoid").map((one) => one.tagName)
"""
INSERTED = """
const script = document.createElement("script");
script.textContent = "window.ran = true";
document.body.append(script);
return window.ran
"""
KINDS = ["study", "monitor", "fleet", "one of the fleet"]
EVENTS = [event_row("2025-03-01", "2025-03-09", acknowledged=True), event_row("2025-06-20", None, modes="f2, f1")]
DRIFT = pd.DataFrame(
    {
        "change": [-0.12, 0.001],
        "standard_error": 0.01,
        "per_year": [-0.05, 0.0],
        "per_year_error": 0.01,
        "significant": [True, False],
        "p_value": 0.001,
    },
    index=["deck", "piers"],
)


@pytest.fixture(scope="module")
def files(tmp_path_factory, browser):
    """A page of each kind."""
    folder = tmp_path_factory.mktemp("pages")
    fem, T, _ = fitted_chain()
    study = run_study(fem, T, sweep(fem, (0.05, 0.1, 0.2)))
    found = identified({HOSTILE: (0.9, {HOSTILE: (0.2, 0.012)}), "no damage": (0.1, {})})
    monitor = FakeMonitor(events=EVENTS, drift=DRIFT)
    raised = FakeMonitor(events=[event_row("2025-06-25", None, kind="watch")], watch_per_year=12)
    silent = FakeMonitor(n_not_evaluated=9, reason="all of f1 are missing")
    fleet = FakeFleet(
        {"North viaduct": monitor, "Mill": silent, "Weir": raised},
        {"model": fem},
        {"broken": "ValueError: " + 9 * "long "},
    )
    subjects = {"study": (study, {"identified": found}), "monitor": (monitor, {}), "fleet": (fleet, {})}
    now = {"now": monitor.last_}
    files = {
        kind: owner_report(subject, folder / f"{kind}.html", **options, **(now if kind != "study" else {}))
        for kind, (subject, options) in subjects.items()
    }
    return files | {"one of the fleet": folder / "fleet_pages" / "North_viaduct.html"}


@pytest.fixture(params=KINDS)
def file(request, files):
    return files[request.param]


@pytest.mark.parametrize("width", WIDTHS.values(), ids=WIDTHS)
def test_a_page_fits_and_loads_nothing(browser, file, width):
    browser.open(file, width)
    assert browser.overflow() <= 0
    assert browser.run(CUT, ".scroll") == []
    assert browser.run(SMALL_TEXT) == []
    assert browser.requests() == [file.as_uri()]
    assert browser.errors() == []


@pytest.mark.parametrize(("width", "is_dark"), zip(WIDTHS.values(), (False, True), strict=True), ids=["light", "dark"])
def test_a_page_breaks_no_rule_of_accessibility(browser, axe, file, width, is_dark):
    browser.open(file, width, is_dark)
    assert browser.violations(axe) == {}


def test_the_keyboard_reaches_everything_in_its_order(browser, file):
    browser.open(file, WIDTHS["screen"])
    reached = browser.tabbed()
    assert [one["place"] for one in reached] == list(range(len(reached)))
    assert all(one["is_marked"] and one["is_seen"] for one in reached)


def test_what_is_printed_is_whole(browser, file):
    browser.open(file, 700)  # what remains of A4 between its margins
    browser.command("Emulation.setEmulatedMedia", media="print")
    assert browser.overflow() <= 0
    assert browser.run(CUT) == []
    assert browser.run(BREAKABLE) == []
    pdf = browser.printed()
    assert pdf.startswith(b"%PDF")
    assert pdf.count(b"/Type /Page\n") > 1


@pytest.mark.parametrize("kind", ["study", "monitor", "one of the fleet"])
def test_a_drawing_shows_the_value_under_a_finger_and_by_keys(browser, files, kind):
    from selenium.webdriver import Keys

    browser.open(files[kind], WIDTHS["telephone"])
    drawing = browser.run("return document.querySelector('.readable')")
    picture, slider, output, link = (
        drawing.find_element("css selector", part) for part in (".picture", "input", "output", "a")
    )
    assert output.text == ""
    places = [float(place) for place in drawing.get_attribute("data-x").split()]
    browser.run("arguments[0].scrollIntoView({block: 'center'})", picture)
    box = picture.rect
    top = box["y"] - browser.run("return scrollY") + box["height"] / 2
    row = len(places) // 3
    finger = [{"x": box["x"] + places[row] / 1000 * box["width"], "y": top}]
    browser.command("Input.dispatchTouchEvent", type="touchStart", touchPoints=finger)
    browser.command("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    rows = link.get_attribute("href").split("%0A")
    near = int(slider.get_attribute("value"))
    assert abs(places[near] - places[row]) <= 1
    assert output.text.startswith(f"date: {rows[near + 1].split(',')[0]}; ")
    slider.send_keys(Keys.ARROW_RIGHT)
    assert output.text.startswith(f"date: {rows[near + 2].split(',')[0]}; ")
    assert slider.get_attribute("aria-valuetext") == output.text


def test_names_of_data_run_nothing(browser, files):
    """Names with scripts are text, and an inserted script is refused by the page's policy."""
    browser.open(files["study"], WIDTHS["screen"])
    assert browser.run(INSERTED) is None
    assert any("Content Security Policy" in text for text in browser.errors())
