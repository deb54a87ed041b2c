"""A prior that a fleet of bridges gives to a new one: how its parameters or frequencies change with the weather."""

from skthermo.fleet.prior._mapper import FleetMapper
from skthermo.fleet.prior._prior import FleetPrior

__all__ = ["FleetMapper", "FleetPrior"]
