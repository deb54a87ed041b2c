"""Detectors beside each other, and bridges beside a fleet."""

from skthermo.plotting.comparison._agreement import AgreementDisplay
from skthermo.plotting.comparison._fleet_prior import FleetPriorDisplay
from skthermo.plotting.comparison._ranking import RankingDisplay
from skthermo.plotting.comparison._roc import ROCDisplay

__all__ = ["AgreementDisplay", "FleetPriorDisplay", "ROCDisplay", "RankingDisplay"]
