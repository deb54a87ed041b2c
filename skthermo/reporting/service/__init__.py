"""Pages on detectors in service."""

from skthermo.reporting.service._page import monitor_facts
from skthermo.reporting.service._standing import Doubt, Standing, Time

__all__ = ["Doubt", "Standing", "Time", "monitor_facts"]
