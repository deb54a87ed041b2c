"""Display objects, as scikit-learn has them; matplotlib is imported when something is drawn.

It uses what it draws; only pages and commands use it. Start with ``_display.py``, what all share.
"""

from skthermo.plotting._over_time import DamageIndexDisplay, PredictionDisplay
from skthermo.plotting._structures import StructureDisplay
from skthermo.plotting._studies import DetectorsDisplay, PODCurveDisplay

__all__ = ["DamageIndexDisplay", "DetectorsDisplay", "PODCurveDisplay", "PredictionDisplay", "StructureDisplay"]
