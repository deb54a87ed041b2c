"""Looking at records before anything is learned from them."""

from skthermo.preprocessing.checks._findings import RecordFindings, check_records
from skthermo.preprocessing.checks._plausible import Plausible
from skthermo.preprocessing.checks._signs import equal_runs, residual_trend

__all__ = ["Plausible", "RecordFindings", "check_records", "equal_runs", "residual_trend"]
