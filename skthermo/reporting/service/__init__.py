"""Pages on detectors in service."""

from skthermo.reporting.service._sections import monitor_page
from skthermo.reporting.service._standing import (
    ALARM,
    ATTENTION,
    HEALTHY,
    NOT_EVALUATED,
    Standing,
    Time,
    moment,
    time_of,
)
from skthermo.reporting.service._today import banner, first_section, symbol

__all__ = [
    "ALARM",
    "ATTENTION",
    "HEALTHY",
    "NOT_EVALUATED",
    "Standing",
    "Time",
    "banner",
    "first_section",
    "moment",
    "monitor_page",
    "symbol",
    "time_of",
]
