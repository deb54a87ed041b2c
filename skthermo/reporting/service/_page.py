"""What the page on a monitor is made of."""

from __future__ import annotations

from typing import Any

from skthermo.fem import Structure
from skthermo.monitoring import Monitor
from skthermo.reporting._settings import settings_of, versions
from skthermo.reporting.service._figures import chart_year, draw_detectable, draw_drift, draw_span, losses_on, spans_of
from skthermo.reporting.service._standing import Standing

DRAWINGS = (chart_year, draw_detectable, draw_drift, draw_span, losses_on, spans_of)
"""What templates draw with, and what they say of drawings."""


def monitor_facts(standing: Standing, structure: Structure | None = None) -> dict[str, Any]:
    """What the template of the page on a monitor is given."""
    monitor = standing.monitor
    detector = monitor.detector_
    parts = dict(detector.named_steps) if hasattr(detector, "named_steps") else {"detector": detector}
    parts = {"monitor": monitor, **parts, "model": monitor.fem}
    return {
        "written": standing.now,
        "standing": standing,
        "monitor": monitor,
        "structure": structure,
        "draw": {one.__name__: one for one in DRAWINGS},
        "settings": settings_of(parts, but=("monitor: detector", "monitor: fem")),
        "columns": _columns(monitor),
        "versions": versions(),
        "identified": None,
        "fleet": None,
    }


def _columns(monitor: Monitor) -> dict[str, list[str]]:
    """Names of the columns with their units: responses, and temperatures."""
    found: dict[str, list[str]] = {"responses": [], "temperatures": []}
    for name, unit in monitor.units_.items():
        kind = "responses" if name in set(monitor.targets_) else "temperatures"
        says_it = f"[{unit}]" in str(name) or f"({unit})" in str(name)
        found[kind].append(f"{name}" if says_it or not unit else f"{name} ({unit})")
    return found
