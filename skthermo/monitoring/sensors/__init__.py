"""Faults of sensors in service, distinguished from damage where the data can."""

from skthermo.monitoring.sensors._faults import Fault
from skthermo.monitoring.sensors._watch import Dispute, SensorWatch, Watched, WatchState

__all__ = ["Dispute", "Fault", "SensorWatch", "WatchState", "Watched"]
