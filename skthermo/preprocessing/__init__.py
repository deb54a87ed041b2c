"""Preparing temperatures and frequencies: lags, gaps, broken lines, offset from the model, tracked modes."""

from skthermo.preprocessing._bias import BiasAligner
from skthermo.preprocessing._hinges import HingeFeatures
from skthermo.preprocessing._impute import KNNGapImputer
from skthermo.preprocessing._lags import LagFeatures
from skthermo.preprocessing.tracking import ModeTracker

__all__ = ["BiasAligner", "HingeFeatures", "KNNGapImputer", "LagFeatures", "ModeTracker"]
