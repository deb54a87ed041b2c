"""From monitoring data to a thermal FE model: inverse surrogate, temperature mapper, the chain."""

from skthermo.surrogate._data_informed import DataInformedFEM
from skthermo.surrogate._inverse import InverseSurrogate
from skthermo.surrogate._mapper import TemperatureMapper
from skthermo.surrogate._networks import paper_network
from skthermo.surrogate._report import FitReport

__all__ = ["DataInformedFEM", "FitReport", "InverseSurrogate", "TemperatureMapper", "paper_network"]
