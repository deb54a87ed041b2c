"""Parameters of measured frequencies and shapes by steps on the FE model, which end at the posterior mode."""

from skthermo.surrogate.refinement._posterior import Prior
from skthermo.surrogate.refinement._refinement import Refinement, ResponseSurface, unconverged
from skthermo.surrogate.refinement._shapes import ShapeInputs

__all__ = ["Prior", "Refinement", "ResponseSurface", "ShapeInputs", "unconverged"]
