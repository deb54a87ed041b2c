"""The inverse surrogate M1: parameters from frequencies and mode shapes."""

from skthermo.surrogate.inverse._inverse import InverseSurrogate
from skthermo.surrogate.inverse._refinement import ShapeInputs, unconverged

__all__ = ["InverseSurrogate", "ShapeInputs", "unconverged"]
