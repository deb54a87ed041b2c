"""Structures, values of their members, and their mode shapes."""

from skthermo.plotting.structures._mode_shapes import ModeShapesDisplay
from skthermo.plotting.structures._structure_display import StructureDisplay

__all__ = ["ModeShapesDisplay", "StructureDisplay"]
