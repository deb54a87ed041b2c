"""Studies of what a monitoring system would detect, and which damage explains what it has detected.

It uses ``surrogate`` and ``detection``. Start with ``detectability/_study.py``, then
``identification/_identify.py``.
"""

from skthermo.studies.detectability import DetectabilityStudy, DetectionTask, PODCurve, detection_task, pod_curve
from skthermo.studies.extension import compare_extensions
from skthermo.studies.identification import DamagePrior, IdentifiedDamage, identify_damage
from skthermo.studies.location import LocatedDamage, locate_damage
from skthermo.studies.scenarios import ProgressiveDamage, Scenario, UncertainDamage, sweep

__all__ = [
    "DamagePrior",
    "DetectabilityStudy",
    "DetectionTask",
    "IdentifiedDamage",
    "LocatedDamage",
    "PODCurve",
    "ProgressiveDamage",
    "Scenario",
    "UncertainDamage",
    "detection_task",
    "identify_damage",
    "locate_damage",
    "pod_curve",
    "sweep",
    "compare_extensions",
]
