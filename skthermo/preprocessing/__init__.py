"""Temperatures and frequencies made ready: lags, gaps, bias."""

from skthermo.preprocessing._bias import BiasAligner
from skthermo.preprocessing._impute import KNNGapImputer
from skthermo.preprocessing._lags import LagFeatures

__all__ = ["BiasAligner", "KNNGapImputer", "LagFeatures"]
