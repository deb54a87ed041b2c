"""Many bridges: what a fleet knows of a bridge that has few records."""

from skthermo.fleet.prior import FleetMapper, FleetPrior

__all__ = ["FleetMapper", "FleetPrior"]
