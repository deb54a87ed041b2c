"""Eigenproblems, tracking of modes by their shapes, and derivatives of modes."""

from skthermo.fem._factors import factorise
from skthermo.fem.modal._condensation import CondensationSolver, batch_solver
from skthermo.fem.modal._dense import EigenSolver, dense_solver, hertz
from skthermo.fem.modal._local_modes import LocalModes, shape_jacobian
from skthermo.fem.modal._mac import mac
from skthermo.fem.modal._matching import match_modes
from skthermo.fem.modal._reordering import share_reordered
from skthermo.fem.modal._shape_components import shape_components
from skthermo.fem.modal._shape_derivatives import shape_derivatives
from skthermo.fem.modal._shift_invert import GuidedSolver, ShiftInvertSolver
from skthermo.fem.modal._stability import check_supported, count_modes
from skthermo.fem.modal._tracking import may_be_missed, may_differ, pair_modes, repeated_modes

__all__ = [
    "CondensationSolver",
    "EigenSolver",
    "GuidedSolver",
    "LocalModes",
    "ShiftInvertSolver",
    "batch_solver",
    "check_supported",
    "count_modes",
    "dense_solver",
    "factorise",
    "hertz",
    "mac",
    "match_modes",
    "may_be_missed",
    "may_differ",
    "pair_modes",
    "repeated_modes",
    "shape_components",
    "shape_derivatives",
    "shape_jacobian",
    "share_reordered",
]
