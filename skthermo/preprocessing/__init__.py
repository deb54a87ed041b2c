"""Preparing temperatures and frequencies: lags, gaps, offset from the model."""

from skthermo.preprocessing._bias import BiasAligner
from skthermo.preprocessing._impute import KNNGapImputer
from skthermo.preprocessing._lags import LagFeatures

__all__ = ["BiasAligner", "KNNGapImputer", "LagFeatures"]
