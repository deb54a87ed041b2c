"""Finite-element models as functions of their parameters: structures, modal analysis, sampling.

It uses NumPy and SciPy alone. Start with ``_protocol.py``, the interface of a model, then ``affine/_affine.py``.
"""

from skthermo.fem._evaluate import add_noise, evaluate, evaluate_modes, linearise, linearise_modes, sample
from skthermo.fem._protocol import FEModel
from skthermo.fem._structure import ImportedStructure, Structure
from skthermo.fem.affine import AffineModel, FrequencySurface, ReducedModel
from skthermo.fem.elements import Bar, Beam, Element, Membrane, PointMass, Spring
from skthermo.fem.external import CallableModel, difference_terms, load_affine, probe, read_triplets
from skthermo.fem.modal import mac, match_modes, shape_components

__all__ = [
    "AffineModel",
    "Bar",
    "Beam",
    "CallableModel",
    "Element",
    "FEModel",
    "FrequencySurface",
    "ImportedStructure",
    "Membrane",
    "PointMass",
    "ReducedModel",
    "Spring",
    "Structure",
    "add_noise",
    "difference_terms",
    "evaluate",
    "evaluate_modes",
    "linearise",
    "linearise_modes",
    "load_affine",
    "mac",
    "match_modes",
    "probe",
    "read_triplets",
    "sample",
    "shape_components",
]
