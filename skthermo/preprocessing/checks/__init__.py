"""Looking at records before anything is learned from them."""

from skthermo.preprocessing.checks._findings import check_records
from skthermo.preprocessing.checks._gross import gross_errors
from skthermo.preprocessing.checks._kinds import Finding
from skthermo.preprocessing.checks._plausible import Plausible
from skthermo.preprocessing.checks._record_findings import RecordFindings
from skthermo.preprocessing.checks._set_aside import SetAside, set_aside
from skthermo.preprocessing.checks._signs import equal_runs, residual_trend

__all__ = [
    "Finding",
    "Plausible",
    "RecordFindings",
    "SetAside",
    "check_records",
    "equal_runs",
    "gross_errors",
    "residual_trend",
    "set_aside",
]
