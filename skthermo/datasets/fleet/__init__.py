"""Synthetic fleets of bridges: structures, climates, thermal laws, thermometers."""

from skthermo.datasets.fleet._bridge import FleetBridge
from skthermo.datasets.fleet._fleet import BridgeFleet, make_fleet

__all__ = ["BridgeFleet", "FleetBridge", "make_fleet"]
