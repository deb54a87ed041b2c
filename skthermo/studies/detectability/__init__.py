"""Which damage detectors would find, and which further measurement would make smaller damage detectable."""

from skthermo.studies.detectability._extensions import compare_extensions
from skthermo.studies.detectability._pod_curve import PODCurve, pod_curve
from skthermo.studies.detectability._study import DetectabilityStudy
from skthermo.studies.detectability._task import DetectionTask, detection_task

__all__ = ["DetectabilityStudy", "DetectionTask", "PODCurve", "compare_extensions", "detection_task", "pod_curve"]
