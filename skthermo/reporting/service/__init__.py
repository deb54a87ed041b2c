"""Pages on detectors in service."""

from skthermo.reporting.service._sections import monitor_page

__all__ = ["monitor_page"]
