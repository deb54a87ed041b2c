"""From monitoring data to a thermal FE model: inverses, temperature mapper, the chain.

It uses ``fem`` and ``preprocessing``. Start with ``_data_informed.py``, whose ``fit`` is the method, step by
step.
"""

from skthermo.surrogate._data_informed import DataInformedFEM, refitted, resampled, with_model
from skthermo.surrogate._fit_report import FitReport
from skthermo.surrogate._fleet_mapper import FleetMapper
from skthermo.surrogate._inverse import InverseSurrogate
from skthermo.surrogate._posterior import PosteriorInverse
from skthermo.surrogate._published import paper_chain, paper_network
from skthermo.surrogate._regression import TemperatureMapper

__all__ = [
    "DataInformedFEM",
    "FitReport",
    "FleetMapper",
    "InverseSurrogate",
    "PosteriorInverse",
    "TemperatureMapper",
    "paper_chain",
    "paper_network",
    "refitted",
    "resampled",
    "with_model",
]
