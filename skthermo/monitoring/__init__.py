"""Detectors in service: records that come in batches, sensors that fail, structures that age.

It uses ``detection``, and takes a chain where there is an FE model. Start with ``_monitor.py``: a
record goes through ``_records.py``, ``_corrections.py`` (sensors, drift), ``_evaluation.py`` and ``_events.py``.
"""

from skthermo.monitoring._drift import ParameterHistory, track_parameters
from skthermo.monitoring._files import load_monitor
from skthermo.monitoring._fleet import Fleet, fit_fleet
from skthermo.monitoring._monitor import Monitor
from skthermo.monitoring._retraining import Retraining
from skthermo.monitoring._status import MonitorStatus

__all__ = [
    "Fleet",
    "Monitor",
    "MonitorStatus",
    "ParameterHistory",
    "Retraining",
    "fit_fleet",
    "load_monitor",
    "track_parameters",
]
