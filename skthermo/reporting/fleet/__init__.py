"""Pages for owners of many bridges."""

from skthermo.reporting.fleet._page import fleet_page

__all__ = ["fleet_page"]
