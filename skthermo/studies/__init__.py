"""Studies of what a monitoring system would detect, and which damage explains what it has detected.

It uses ``surrogate`` and ``detection``. Start with ``_study.py``, then ``_identify.py``.
"""

from skthermo.studies._causes import DamagePrior
from skthermo.studies._extensions import compare_extensions
from skthermo.studies._identify import IdentifiedDamage, identify_damage
from skthermo.studies._pod_curve import PODCurve, pod_curve
from skthermo.studies._scenarios import ProgressiveDamage, Scenario, UncertainDamage, sweep
from skthermo.studies._study import DetectabilityStudy
from skthermo.studies._task import DetectionTask, detection_task

__all__ = [
    "DamagePrior",
    "DetectabilityStudy",
    "DetectionTask",
    "IdentifiedDamage",
    "PODCurve",
    "ProgressiveDamage",
    "Scenario",
    "UncertainDamage",
    "compare_extensions",
    "detection_task",
    "identify_damage",
    "pod_curve",
    "sweep",
]
