"""Monitors of many bridges."""

from skthermo.monitoring.fleet._fleet import Fleet, fit_fleet

__all__ = ["Fleet", "fit_fleet"]
