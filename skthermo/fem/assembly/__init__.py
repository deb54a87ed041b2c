"""Structures of nodes and members, and their assembly into affine terms."""

from skthermo.fem.assembly._imported import ImportedStructure
from skthermo.fem.assembly._structure import Structure

__all__ = ["ImportedStructure", "Structure"]
