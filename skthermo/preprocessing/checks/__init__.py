"""Looking at records before anything is learned from them."""

from skthermo.preprocessing.checks._findings import RecordFindings, check_records
from skthermo.preprocessing.checks._trend import residual_trend

__all__ = ["RecordFindings", "check_records", "residual_trend"]
