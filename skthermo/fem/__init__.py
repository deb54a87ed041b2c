"""Finite-element models as functions of their parameters: structures, modal analysis, sampling."""

from skthermo.fem._affine import AffineModel
from skthermo.fem._beam import Beam
from skthermo.fem._callable import CallableModel
from skthermo.fem._elements import Bar, PointMass, Spring
from skthermo.fem._exported import load_affine
from skthermo.fem._local_modes import shape_jacobian
from skthermo.fem._membrane import Membrane
from skthermo.fem._noise import add_noise
from skthermo.fem._probe import probe
from skthermo.fem._protocol import FEModel
from skthermo.fem._reduced import ReducedModel
from skthermo.fem._sampling import sample
from skthermo.fem._structure import Structure
from skthermo.fem._tracking import mac

__all__ = [
    "AffineModel",
    "Bar",
    "Beam",
    "CallableModel",
    "FEModel",
    "Membrane",
    "PointMass",
    "ReducedModel",
    "Spring",
    "Structure",
    "add_noise",
    "load_affine",
    "mac",
    "probe",
    "sample",
    "shape_jacobian",
]
