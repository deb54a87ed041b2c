"""Which damage a detector would find."""

from skthermo.studies.detectability._arrangement import Arrangement
from skthermo.studies.detectability._pod_curve import PODCurve, pod_curve
from skthermo.studies.detectability._study import DetectabilityStudy

__all__ = ["Arrangement", "DetectabilityStudy", "PODCurve", "pod_curve"]
