"""Finite elements."""

from skthermo.fem.elements._beam import Beam
from skthermo.fem.elements._element import (
    ROTATIONS,
    TRANSLATIONS,
    ByProperties,
    Dof,
    Element,
    PhysicalElement,
    check_element,
    check_matrices,
)
from skthermo.fem.elements._membrane import Membrane
from skthermo.fem.elements._simple import Bar, PointMass, Spring

__all__ = [
    "ROTATIONS",
    "TRANSLATIONS",
    "Bar",
    "Beam",
    "ByProperties",
    "Dof",
    "Element",
    "Membrane",
    "PhysicalElement",
    "PointMass",
    "Spring",
    "check_element",
    "check_matrices",
]
