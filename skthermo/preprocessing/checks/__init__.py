"""Looking at records before anything is learned from them."""

from skthermo.preprocessing.checks._check_records import check_records, set_aside
from skthermo.preprocessing.checks._columns import equal_runs
from skthermo.preprocessing.checks._plausible import Plausible
from skthermo.preprocessing.checks._record_findings import RecordFindings, SetAside, period_of

__all__ = ["Plausible", "RecordFindings", "SetAside", "check_records", "equal_runs", "period_of", "set_aside"]
