"""From monitoring data to a thermal FE model: inverses, temperature mapper, the chain.

It uses ``fem`` and ``preprocessing``. Start with ``chain/_data_informed.py``, whose ``fit`` is the method, step by
step.
"""

from skthermo.surrogate._fleet_mapper import FleetMapper
from skthermo.surrogate._regression import TemperatureMapper, paper_network
from skthermo.surrogate.chain import DataInformedFEM, FitReport, refitted, resampled, with_model
from skthermo.surrogate.inverse import InverseSurrogate, PosteriorInverse

__all__ = [
    "DataInformedFEM",
    "FitReport",
    "FleetMapper",
    "InverseSurrogate",
    "PosteriorInverse",
    "TemperatureMapper",
    "paper_network",
    "refitted",
    "resampled",
    "with_model",
]
