"""Structures of nodes and members, and how they become affine terms."""

from skthermo.fem.assembly._structure import Structure

__all__ = ["Structure"]
