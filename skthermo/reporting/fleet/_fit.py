"""Page on a bridge without a monitor: what its model has learned, or why it could not."""

from __future__ import annotations

from typing import Any

from skthermo.reporting._html import Html, element, paragraphs, section
from skthermo.reporting._model import learned, stiffnesses
from skthermo.reporting._settings import parameters, settings
from skthermo.reporting.fleet._bridge import FAILED, Bridge
from skthermo.reporting.service import NOT_JUDGED, symbol

HEADLINES = {FAILED: "Not judged: it could not be fitted", NOT_JUDGED: "Not judged: its monitor cannot be used"}
"""By state; any other bridge of this page has no monitor."""


def fit_page(bridge: Bridge, chain: Any, warned: Html, written: str) -> tuple[Html, dict[str, tuple[str, Html]]]:
    """What stands above the sections, and these with their titles."""
    lines = [
        element("p", HEADLINES.get(bridge.state, "Not judged: no monitor"), class_="headline"),
        element("p", bridge.why),
        element("p", "Whether the bridge is healthy is not known: silence never means healthy."),
        element("p", f"As of {written}, when this page was written.", class_="soft"),
    ]
    banner = element("div", symbol(NOT_JUDGED), element("div", *lines), class_="state not-judged")
    sections = {"today": ("Today", section("today", "Today", banner, paragraphs(_advice(bridge))))}
    report = getattr(chain, "report_", None)
    if hasattr(report, "offsets"):
        parts = [*learned(report), *stiffnesses(report)]
        sections["fit"] = ("How good the model is", section("fit", "How good the model is", *parts))
    sections["warnings"] = ("Warnings", warned)
    if chain is not None:
        rows = parameters(chain)
        sections["settings"] = ("Settings", settings("For the engineer.", "Settings of the model.", rows))
    return Html(), sections


def _advice(bridge: Bridge) -> str:
    if bridge.state == FAILED:
        return "An engineer should look at the records and at the model of this bridge; the others are not affected."
    if bridge.state == NOT_JUDGED:
        return "An engineer should look at the monitor of this bridge; the others are not affected."
    return "Records that come are judged once the bridge has a monitor."
