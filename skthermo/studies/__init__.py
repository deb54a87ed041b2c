"""Studies of what a monitoring system would detect."""

from skthermo.studies._identified import IdentifiedDamage
from skthermo.studies._identify import identify_damage
from skthermo.studies._pod_curve import PODCurve, pod_curve
from skthermo.studies._progressive import ProgressiveDamage
from skthermo.studies._report import report
from skthermo.studies._scenario import Scenario
from skthermo.studies._study import DetectabilityStudy
from skthermo.studies._sweep import sweep
from skthermo.studies._uncertain import UncertainDamage
from skthermo.studies._what_to_add import what_to_add

__all__ = [
    "DetectabilityStudy",
    "IdentifiedDamage",
    "PODCurve",
    "ProgressiveDamage",
    "Scenario",
    "UncertainDamage",
    "identify_damage",
    "pod_curve",
    "report",
    "sweep",
    "what_to_add",
]
