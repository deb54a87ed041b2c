"""The first pages of the documentation in a browser, where the site has been built."""

import os
from pathlib import Path

import pytest

from tests.browser.reader import WIDTHS

SITE = Path(os.environ.get("SKTHERMO_SITE") or Path(__file__).parents[2] / "docs/_build").resolve()
PAGES = ["index", "quickstart", "guide/index", "guide/report", "gallery/index", "reference/index", "accuracy"]

pytestmark = pytest.mark.skipif(
    not (SITE / "index.html").is_file(), reason="no site: sphinx-build docs docs/_build, or its folder in SKTHERMO_SITE"
)


@pytest.fixture(params=PAGES)
def file(request):
    return SITE / f"{request.param}.html"


@pytest.mark.parametrize("width", WIDTHS.values(), ids=WIDTHS)
def test_a_page_of_the_site_fits_and_loads_nothing_from_outside(browser, file, width):
    browser.open(file, width)
    assert browser.overflow() <= 0
    assert [address for address in browser.requests() if not address.startswith(SITE.as_uri())] == []


@pytest.mark.parametrize(("width", "is_dark"), zip(WIDTHS.values(), (False, True), strict=True), ids=["light", "dark"])
def test_a_page_of_the_site_breaks_no_rule_of_accessibility(browser, axe, file, width, is_dark):
    browser.open(file, width, is_dark)
    assert browser.violations(axe) == {}


def test_the_keyboard_reaches_everything_on_the_home_page_in_its_order(browser):
    browser.open(SITE / "index.html", WIDTHS["screen"])
    reached = browser.tabbed()
    assert [one["place"] for one in reached] == list(range(len(reached)))
    assert all(one["is_marked"] and one["is_seen"] for one in reached)
