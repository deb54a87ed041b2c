"""Calibration of FE models to measured modes: sensitivities, identifiability, model updating."""

from skthermo.updating._identifiability import identifiability
from skthermo.updating._sensitivity import select_parameters, sensitivity
from skthermo.updating._updater import ModelUpdater

__all__ = ["ModelUpdater", "identifiability", "select_parameters", "sensitivity"]
