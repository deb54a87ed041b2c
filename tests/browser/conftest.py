"""Headless Chromium, driven by Selenium; tests are skipped, with the reason, where a part is missing."""

import os
import shutil
from pathlib import Path

import pytest

from tests.browser.reader import Browser

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def browser():
    selenium = pytest.importorskip("selenium.webdriver", reason='Selenium is missing: pip install ".[browser]"')
    binary = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    driver = shutil.which("chromedriver")
    if binary is None or driver is None:
        pytest.skip("Chromium or its driver is missing: apt-get install chromium chromium-driver")
    options = selenium.ChromeOptions()
    options.binary_location = binary
    options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
    for argument in ("headless=new", "no-sandbox", "disable-dev-shm-usage", "hide-scrollbars"):
        options.add_argument(f"--{argument}")
    service = selenium.ChromeService(driver)
    with selenium.Chrome(options, service) as chrome:
        yield Browser(chrome)


@pytest.fixture(scope="session")
def axe():
    """The source of axe-core, which npm brings and this repository does not."""
    places = [Path(os.environ.get("AXE_CORE", "")), ROOT / "node_modules/axe-core/axe.min.js"]
    file = next((place for place in places if place.is_file()), None)
    if file is None:
        pytest.skip("axe-core is missing: npm install --no-save axe-core, or its axe.min.js in AXE_CORE")
    return file.read_text(encoding="utf-8")
