"""Many bridges, fitted side by side.

It uses ``surrogate`` and ``monitoring``. Start with ``_fleet.py``, their monitors together.
"""

from skthermo.fleet._fit_fleet import fit_fleet
from skthermo.fleet._fleet import Fleet

__all__ = ["Fleet", "fit_fleet"]
