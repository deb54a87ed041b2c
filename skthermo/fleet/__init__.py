"""Many bridges: fitted side by side, learning together.

It uses ``surrogate`` and ``monitoring``. Start with ``prior/_prior.py``, what bridges teach each other, and
``_fleet.py``, their monitors together.
"""

from skthermo.fleet._fit_fleet import fit_fleet
from skthermo.fleet._fleet import Fleet
from skthermo.fleet.prior import FleetMapper, FleetPrior

__all__ = ["Fleet", "FleetMapper", "FleetPrior", "fit_fleet"]
