"""A new baseline for a detector in service: more records, or another one after an intervention."""

from skthermo.monitoring.retraining._retraining import Retraining, begun_again, retrained

__all__ = ["Retraining", "begun_again", "retrained"]
