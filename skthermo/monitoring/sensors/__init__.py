"""Faults of sensors in service, told from damage where the data can."""

from skthermo.monitoring.sensors._watch import SensorWatch, WatchState

__all__ = ["SensorWatch", "WatchState"]
