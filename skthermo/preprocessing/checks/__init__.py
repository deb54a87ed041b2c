"""Looking at records before anything is learned from them."""

from skthermo.preprocessing.checks._beside_weather import misplaced_columns
from skthermo.preprocessing.checks._check_records import check_records, set_aside
from skthermo.preprocessing.checks._columns import Plausible, equal_runs, stuck_runs
from skthermo.preprocessing.checks._record_findings import RecordFindings, listed_details, period_of

__all__ = [
    "Plausible",
    "RecordFindings",
    "check_records",
    "equal_runs",
    "listed_details",
    "misplaced_columns",
    "period_of",
    "set_aside",
    "stuck_runs",
]
