"""Structures and monitoring campaigns to learn and test with.

It uses ``fem``. Start with ``_truss.py``, the structure of most examples.
"""

from skthermo.datasets._fleet import make_fleet
from skthermo.datasets._kw51_campaign import make_kw51_campaign
from skthermo.datasets._kw51_file import load_kw51
from skthermo.datasets._kw51_model import kw51_sensors, kw51_structure, make_kw51
from skthermo.datasets._truss import make_truss, make_truss_campaign, steel_modulus, truss_structure
from skthermo.datasets._z24 import load_z24, make_z24

__all__ = [
    "kw51_sensors",
    "kw51_structure",
    "load_kw51",
    "load_z24",
    "make_fleet",
    "make_kw51",
    "make_kw51_campaign",
    "make_truss",
    "make_truss_campaign",
    "make_z24",
    "steel_modulus",
    "truss_structure",
]
