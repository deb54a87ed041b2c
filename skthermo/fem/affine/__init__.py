"""Affine models: one core of terms and eigensolver, and the full and the reduced model on it."""

from skthermo.fem.affine._affine import AffineModel
from skthermo.fem.affine._read_terms import check_different, check_n_modes, read_terms
from skthermo.fem.affine._reduced import ReducedModel

__all__ = ["AffineModel", "ReducedModel", "check_different", "check_n_modes", "read_terms"]
