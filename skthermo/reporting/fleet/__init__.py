"""Pages for owners of many bridges."""

from skthermo.reporting.fleet._page import write_fleet

__all__ = ["write_fleet"]
