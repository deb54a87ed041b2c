"""A browser that opens pages at a width, and says what a reader would notice."""

import base64
import json
from pathlib import Path

WIDTHS = {"telephone": 390, "screen": 1280}

FOCUSABLE = """
return [...document.querySelectorAll("a[href], button, input, select, textarea, [tabindex='0']")]
  .filter((one) => one.checkVisibility({visibilityProperty: true}) && !one.disabled && !one.closest("[inert]"))
"""
FOCUS = """
for (const motion of document.getAnimations()) motion.finish();
const focused = document.activeElement, one = focused.closest(".sd-card") ?? focused; // a card is its link
const box = one.getBoundingClientRect(), style = getComputedStyle(one);
return {place: arguments[0].indexOf(focused), is_marked: style.outlineStyle !== "none" || style.boxShadow !== "none",
        is_seen: box.bottom > 0 && box.top < innerHeight && box.width > 0 && box.height > 0}
"""
CUT = """
const width = document.documentElement.clientWidth;
return [...document.querySelectorAll("body *")]
  .filter((one) => one.getClientRects().length && one.getBoundingClientRect().right > width + 1
                   && !(arguments[0] && one.closest(arguments[0])))
  .map((one) => `${one.tagName}.${one.className.baseVal ?? one.className}: ${one.textContent.slice(0, 60)}`)
"""
SMALL_TEXT = """
const sizeOf = (one) => parseFloat(getComputedStyle(one).fontSize) * (one.ownerSVGElement ? one.getScreenCTM().a : 1);
return [...document.querySelectorAll("body *")]
  .filter((one) => [...one.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim())
                   && one.checkVisibility() && one.getClientRects().length && sizeOf(one) < 10)
  .map((one) => one.textContent.trim().slice(0, 40))
"""


class Browser:
    """Chromium at a width, and what was loaded since the page was opened."""

    def __init__(self, chrome):
        self.chrome = chrome

    def open(self, file, width, is_dark=False):
        """Open a file; a telephone has a finger and no pointer."""
        size = {"width": width, "height": 844, "deviceScaleFactor": 1, "mobile": width < 600}
        self.command("Emulation.setDeviceMetricsOverride", **size)
        wishes = {"prefers-color-scheme": "dark" if is_dark else "light", "prefers-reduced-motion": "reduce"}
        features = [{"name": name, "value": value} for name, value in wishes.items()]
        self.command("Emulation.setEmulatedMedia", media="", features=features)
        for log in ("performance", "browser"):
            self.chrome.get_log(log)
        self.chrome.get(Path(file).as_uri())

    def command(self, name, **options):
        """A command of Chromium's developer tools."""
        return self.chrome.execute_cdp_cmd(name, options)

    def requests(self):
        """Addresses asked for since the page was opened."""
        messages = [json.loads(entry["message"])["message"] for entry in self.chrome.get_log("performance")]
        sent = [one["params"]["request"]["url"] for one in messages if one["method"] == "Network.requestWillBeSent"]
        return [address for address in sent if not address.startswith("data:")]

    def errors(self):
        """What Chromium complains of."""
        return [entry["message"] for entry in self.chrome.get_log("browser") if entry["level"] == "SEVERE"]

    def run(self, script, *arguments):
        return self.chrome.execute_script(script, *arguments)

    def overflow(self):
        """Pixels by which the page is wider than its window."""
        return self.run("const page = document.documentElement; return page.scrollWidth - page.clientWidth")

    def tabbed(self):
        """What each press of the tabulator reaches, until all that can be reached has been: place in the document,
        whether it is marked and in view."""
        from selenium.webdriver import ActionChains, Keys

        self.run("document.activeElement.blur(); scrollTo(0, 0)")
        reachable, reached = self.run(FOCUSABLE), []
        for _ in reachable:
            ActionChains(self.chrome, duration=0).send_keys(Keys.TAB).perform()
            reached.append(self.run(FOCUS, reachable))
        return reached

    def printed(self):
        """The page on paper of A4, as PDF."""
        return base64.b64decode(self.command("Page.printToPDF", paperWidth=8.27, paperHeight=11.69)["data"])

    def violations(self, axe):
        """Rules of axe-core that the page breaks, with the first element that does."""
        self.run(axe)
        found = self.chrome.execute_async_script(
            "const done = arguments[0]; axe.run({resultTypes: ['violations']}).then((found) => done(found.violations))"
        )
        return {one["id"]: one["nodes"][0]["html"][:300] for one in found}
