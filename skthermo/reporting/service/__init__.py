"""Pages on detectors in service."""

from skthermo.reporting.service._sections import banner, first_section, monitor_page, symbol
from skthermo.reporting.service._standing import Standing, Time, moment

__all__ = ["Standing", "Time", "banner", "first_section", "moment", "monitor_page", "symbol"]
