"""From monitoring data to a thermal FE model: inverse surrogate, temperature mapper, the chain."""

from skthermo.surrogate._mapper import TemperatureMapper
from skthermo.surrogate._networks import paper_network
from skthermo.surrogate.chain import DataInformedFEM, FitReport
from skthermo.surrogate.inverse import InverseSurrogate

__all__ = [
    "DataInformedFEM",
    "FitReport",
    "InverseSurrogate",
    "TemperatureMapper",
    "paper_network",
]
