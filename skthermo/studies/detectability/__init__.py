"""Which damage a detector would find."""

from skthermo.studies.detectability._candidates import Arrangement
from skthermo.studies.detectability._pod_curve import PODCurve, pod_curve
from skthermo.studies.detectability._simulation import Measurement
from skthermo.studies.detectability._study import DetectabilityStudy
from skthermo.studies.detectability._task import DetectionTask, detection_task

__all__ = [
    "Arrangement",
    "DetectabilityStudy",
    "DetectionTask",
    "Measurement",
    "PODCurve",
    "detection_task",
    "pod_curve",
]
