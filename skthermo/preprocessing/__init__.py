"""Preparing temperatures and frequencies: faults, outliers, lags, gaps, broken lines, offsets, tracked modes, folds."""

from skthermo.preprocessing._bias import BiasAligner
from skthermo.preprocessing._exponential import ExponentialMeans
from skthermo.preprocessing._folds import BlockedKFold
from skthermo.preprocessing._hampel import HampelFilter
from skthermo.preprocessing._hinges import HingeFeatures
from skthermo.preprocessing._impute import KNNGapImputer
from skthermo.preprocessing._lags import LagFeatures
from skthermo.preprocessing._memory import MemoryFindings, find_memory
from skthermo.preprocessing._sensors import SensorMeans
from skthermo.preprocessing.checks import RecordFindings, check_records, residual_trend
from skthermo.preprocessing.tracking import ModeTracker

__all__ = [
    "BiasAligner",
    "BlockedKFold",
    "ExponentialMeans",
    "HampelFilter",
    "HingeFeatures",
    "KNNGapImputer",
    "LagFeatures",
    "MemoryFindings",
    "ModeTracker",
    "RecordFindings",
    "SensorMeans",
    "check_records",
    "find_memory",
    "residual_trend",
]
