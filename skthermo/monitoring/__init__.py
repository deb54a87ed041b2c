"""Detectors in service: records that come in batches, sensors that fail, structures that age."""

from skthermo.monitoring._files import load_monitor
from skthermo.monitoring._monitor import Monitor

__all__ = ["Monitor", "load_monitor"]
