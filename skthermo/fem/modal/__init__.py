"""Eigenproblems, tracking of modes by their shapes, and derivatives of modes."""

from skthermo.fem._factors import factorise
from skthermo.fem.modal._dense import (
    CondensationSolver,
    EigenSolver,
    batch_solver,
    dense_solver,
    hertz,
    shape_derivatives,
)
from skthermo.fem.modal._local_modes import LocalModes, shape_jacobian
from skthermo.fem.modal._pairing import (
    mac,
    match_modes,
    may_be_missed,
    may_differ,
    pair_modes,
    repeated_modes,
    shape_components,
    share_reordered,
)
from skthermo.fem.modal._sparse import GuidedSolver, ShiftInvertSolver
from skthermo.fem.modal._stability import check_supported, count_modes

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
