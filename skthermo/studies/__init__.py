"""Studies of what a monitoring system would detect."""

from skthermo.studies._pod_curve import PODCurve, pod_curve
from skthermo.studies._progressive import ProgressiveDamage
from skthermo.studies._report import report
from skthermo.studies._scenario import Scenario
from skthermo.studies._study import DetectabilityStudy
from skthermo.studies._sweep import sweep
from skthermo.studies._uncertain import UncertainDamage

__all__ = [
    "DetectabilityStudy",
    "PODCurve",
    "ProgressiveDamage",
    "Scenario",
    "UncertainDamage",
    "pod_curve",
    "report",
    "sweep",
]
