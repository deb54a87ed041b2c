"""Faults of sensors in service, distinguished from damage where the data can."""

from skthermo.monitoring.sensors._faults import Fault
from skthermo.monitoring.sensors._watch import SensorWatch, Watched, WatchState

__all__ = ["Fault", "SensorWatch", "WatchState", "Watched"]
