"""Many bridges: fitted side by side, learning together."""

from skthermo.fleet.prior import FleetMapper, FleetPrior

__all__ = ["FleetMapper", "FleetPrior"]
