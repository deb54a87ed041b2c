"""Detectors in service: records that come in batches, sensors that fail, structures that age."""

from skthermo.monitoring._files import load_monitor
from skthermo.monitoring._monitor import Monitor
from skthermo.monitoring.retraining import Retraining

__all__ = ["Monitor", "Retraining", "load_monitor"]
