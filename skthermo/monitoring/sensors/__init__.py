"""Faults of sensors in service, distinguished from damage where the data can."""

from skthermo.monitoring.sensors._watch import Dispute, SensorWatch, Watched, WatchState

__all__ = ["Dispute", "SensorWatch", "WatchState", "Watched"]
