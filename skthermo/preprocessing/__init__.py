"""Preparing temperatures and frequencies: lags, gaps, broken lines, offsets, tracked modes, folds in time."""

from skthermo.preprocessing._bias import BiasAligner
from skthermo.preprocessing._folds import BlockedKFold
from skthermo.preprocessing._hinges import HingeFeatures
from skthermo.preprocessing._impute import KNNGapImputer
from skthermo.preprocessing._lags import LagFeatures
from skthermo.preprocessing.tracking import ModeTracker

__all__ = ["BiasAligner", "BlockedKFold", "HingeFeatures", "KNNGapImputer", "LagFeatures", "ModeTracker"]
