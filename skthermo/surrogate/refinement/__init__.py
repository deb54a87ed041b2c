"""Parameters of measured frequencies and shapes by steps on the FE model, which end at the posterior mode."""

from skthermo.surrogate.refinement._refinement import Prior, Refinement, ResponseSurface, ShapeInputs, unconverged

__all__ = ["Prior", "Refinement", "ResponseSurface", "ShapeInputs", "unconverged"]
