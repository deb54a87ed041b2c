"""Several detectors beside each other."""

from skthermo.plotting.comparison._agreement import AgreementDisplay

__all__ = ["AgreementDisplay"]
