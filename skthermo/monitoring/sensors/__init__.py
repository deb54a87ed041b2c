"""Faults of sensors in service, distinguished from damage where the data can."""

from skthermo.monitoring.sensors._watch import SensorWatch, Watched, WatchState

__all__ = ["SensorWatch", "WatchState", "Watched"]
