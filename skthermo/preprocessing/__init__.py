"""Preparing temperatures and frequencies: lags, gaps, broken lines, offset from the model."""

from skthermo.preprocessing._bias import BiasAligner
from skthermo.preprocessing._hinges import HingeFeatures
from skthermo.preprocessing._impute import KNNGapImputer
from skthermo.preprocessing._lags import LagFeatures

__all__ = ["BiasAligner", "HingeFeatures", "KNNGapImputer", "LagFeatures"]
