"""The whole chain, from records of temperatures and frequencies to simulated records, and the report of its fit."""

from skthermo.surrogate.chain._data_informed import DataInformedFEM, refitted, resampled, with_model
from skthermo.surrogate.chain._fit_report import FitReport

__all__ = ["DataInformedFEM", "FitReport", "refitted", "resampled", "with_model"]
