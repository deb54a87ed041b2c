"""Display objects, as scikit-learn has them; matplotlib is imported when something is drawn.

It uses what it draws; only pages and commands use it. Start with ``_display.py``, what all share.
"""

from skthermo.plotting._damage_index import DamageIndexDisplay
from skthermo.plotting._detectors import DetectorsDisplay
from skthermo.plotting._pod_curve import PODCurveDisplay
from skthermo.plotting._prediction import PredictionDisplay
from skthermo.plotting._structure_display import StructureDisplay

__all__ = [
    "DamageIndexDisplay",
    "DetectorsDisplay",
    "PODCurveDisplay",
    "PredictionDisplay",
    "StructureDisplay",
]
