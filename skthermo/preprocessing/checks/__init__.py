"""Looking at records before anything is learned from them."""

from skthermo.preprocessing.checks._check_records import check_records, residual_trend
from skthermo.preprocessing.checks._record_findings import RecordFindings
from skthermo.preprocessing.checks._set_aside import Plausible, SetAside, set_aside
from skthermo.preprocessing.checks._stuck import equal_runs

__all__ = [
    "Plausible",
    "RecordFindings",
    "SetAside",
    "check_records",
    "equal_runs",
    "residual_trend",
    "set_aside",
]
