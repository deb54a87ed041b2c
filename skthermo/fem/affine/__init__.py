"""Affine models: the full and the reduced model, and the terms and eigensolver that both use."""

from skthermo.fem.affine._affine import AffineModel
from skthermo.fem.affine._base import check_different, check_severities, read_matrix, read_terms
from skthermo.fem.affine._reduced import ReducedModel
from skthermo.fem.affine._surface import FrequencySurface, ResponseSurface, n_terms

__all__ = [
    "AffineModel",
    "FrequencySurface",
    "ReducedModel",
    "ResponseSurface",
    "check_different",
    "check_severities",
    "n_terms",
    "read_matrix",
    "read_terms",
]
