"""Studies of what a monitoring system would detect, and which damage explains what it has detected.

It uses ``surrogate`` and ``detection``. Start with ``detectability/_study.py``, then
``identification/_identify.py``.
"""

from skthermo.studies._scenarios import ProgressiveDamage, Scenario, UncertainDamage, sweep
from skthermo.studies.detectability import (
    DetectabilityStudy,
    DetectionTask,
    PODCurve,
    compare_extensions,
    detection_task,
    pod_curve,
)
from skthermo.studies.identification import (
    DamagePrior,
    IdentifiedDamage,
    identify_damage,
)

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
