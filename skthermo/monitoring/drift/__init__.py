"""Stiffness over years: drift of damage groups, told from weather and noise."""

from skthermo.monitoring.drift._filter import ParameterFilter, ParameterState
from skthermo.monitoring.drift._follower import DriftFollower, FollowerState
from skthermo.monitoring.drift._history import ParameterHistory
from skthermo.monitoring.drift._track import track_parameters

__all__ = [
    "DriftFollower",
    "FollowerState",
    "ParameterFilter",
    "ParameterHistory",
    "ParameterState",
    "track_parameters",
]
