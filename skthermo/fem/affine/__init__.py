"""Affine models, full and on a basis of mode shapes, and polynomials of their frequencies."""

from skthermo.fem.affine._affine import AffineModel, ReducedModel
from skthermo.fem.affine._surface import FrequencySurface, ResponseSurface, n_terms

__all__ = ["AffineModel", "FrequencySurface", "ReducedModel", "ResponseSurface", "n_terms"]
