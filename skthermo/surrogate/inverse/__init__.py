"""The inverse M1: parameters from frequencies and mode shapes."""

from skthermo.surrogate.inverse._inverse import InverseSurrogate
from skthermo.surrogate.inverse._posterior import PosteriorInverse, ThermalPrior, unconverged
from skthermo.surrogate.inverse._shapes import ShapeInputs

__all__ = ["InverseSurrogate", "PosteriorInverse", "ShapeInputs", "ThermalPrior", "unconverged"]
