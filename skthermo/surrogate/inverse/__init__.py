"""The inverse surrogate M1: parameters from frequencies and mode shapes."""

from skthermo.surrogate.inverse._inverse import InverseSurrogate

__all__ = ["InverseSurrogate"]
