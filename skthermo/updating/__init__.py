"""Calibration of FE models to measured modes: sensitivities, identifiability, model updating.

It uses ``fem``. Start with ``_updater.py``.
"""

from skthermo.updating._identifiability import identifiability, select_parameters, sensitivity
from skthermo.updating._updater import ModelUpdater

__all__ = ["ModelUpdater", "identifiability", "select_parameters", "sensitivity"]
