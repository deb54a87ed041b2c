"""Structures and monitoring campaigns to learn and test with."""

from skthermo.datasets._campaign import make_truss_campaign, steel_modulus
from skthermo.datasets._truss import make_truss

__all__ = ["make_truss", "make_truss_campaign", "steel_modulus"]
