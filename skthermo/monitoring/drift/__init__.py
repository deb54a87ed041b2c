"""Stiffness over years: drift of damage groups, apart from weather and noise."""

from skthermo.monitoring.drift._follower import DriftFollower
from skthermo.monitoring.drift._history import ParameterHistory
from skthermo.monitoring.drift._track import track_parameters

__all__ = ["DriftFollower", "ParameterHistory", "track_parameters"]
