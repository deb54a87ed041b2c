"""Eigenproblems, tracking of modes by their shapes, and derivatives of modes."""

from skthermo.fem.modal._core import AffineCore, may_be_missed, pair_modes, repeated_modes
from skthermo.fem.modal._modes import LocalModes, linearised_by_row, mac, match_modes, shape_components
from skthermo.fem.modal._sparse import ShiftInvertSolver, check_supported, count_modes

__all__ = [
    "AffineCore",
    "LocalModes",
    "ShiftInvertSolver",
    "check_supported",
    "count_modes",
    "linearised_by_row",
    "mac",
    "match_modes",
    "may_be_missed",
    "pair_modes",
    "repeated_modes",
    "shape_components",
]
