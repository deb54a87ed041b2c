"""Eigenproblems, tracking of modes by their shapes, and derivatives of modes."""

from skthermo.fem.modal._condensation import CondensationSolver, batch_solver
from skthermo.fem.modal._core import AffineCore, dense_solver, may_be_missed, pair_modes, repeated_modes
from skthermo.fem.modal._modes import LocalModes, linearised_by_row, mac, match_modes, shape_components
from skthermo.fem.modal._sparse import ShiftInvertSolver, check_supported, count_modes

__all__ = [
    "AffineCore",
    "CondensationSolver",
    "LocalModes",
    "ShiftInvertSolver",
    "batch_solver",
    "check_supported",
    "count_modes",
    "dense_solver",
    "linearised_by_row",
    "mac",
    "match_modes",
    "may_be_missed",
    "pair_modes",
    "repeated_modes",
    "shape_components",
]
