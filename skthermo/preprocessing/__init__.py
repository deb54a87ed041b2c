"""Preparing temperatures and frequencies: files, faults, outliers, lags, gaps, hinges, offsets, tracked modes, folds.

It uses ``_core``. Start with ``checks/_check_records.py``, through which all fits go.
"""

from skthermo.preprocessing._hampel import HampelFilter
from skthermo.preprocessing._impute import KNNGapImputer
from skthermo.preprocessing._mode_tracker import ModeTracker
from skthermo.preprocessing._past import ExponentialMeans, LagFeatures
from skthermo.preprocessing._read_records import read_records
from skthermo.preprocessing._transformers import BiasAligner, HingeFeatures, SensorMeans
from skthermo.preprocessing.checks import RecordFindings, check_records
from skthermo.preprocessing.folds import BlockedKFold

__all__ = [
    "BiasAligner",
    "BlockedKFold",
    "ExponentialMeans",
    "HampelFilter",
    "HingeFeatures",
    "KNNGapImputer",
    "LagFeatures",
    "ModeTracker",
    "RecordFindings",
    "SensorMeans",
    "check_records",
    "read_records",
]
