"""Display objects, as scikit-learn has them; matplotlib is imported when something is drawn."""

from skthermo.plotting._damage_index import DamageIndexDisplay
from skthermo.plotting._fit_report import FitReportDisplay
from skthermo.plotting._frequency_temperature import FrequencyTemperatureDisplay
from skthermo.plotting._history import HistoryDisplay
from skthermo.plotting._identified_damage import IdentifiedDamageDisplay
from skthermo.plotting._monitor import MonitorDisplay
from skthermo.plotting._parameter_history import ParameterHistoryDisplay
from skthermo.plotting._pod_curve import PODCurveDisplay
from skthermo.plotting._prediction import PredictionDisplay
from skthermo.plotting._sensitivity import SensitivityDisplay
from skthermo.plotting.comparison import AgreementDisplay, FleetPriorDisplay, RankingDisplay, ROCDisplay
from skthermo.plotting.structures import ModeShapesDisplay, StructureDisplay

__all__ = [
    "AgreementDisplay",
    "DamageIndexDisplay",
    "FitReportDisplay",
    "FleetPriorDisplay",
    "FrequencyTemperatureDisplay",
    "HistoryDisplay",
    "IdentifiedDamageDisplay",
    "ModeShapesDisplay",
    "MonitorDisplay",
    "PODCurveDisplay",
    "ParameterHistoryDisplay",
    "PredictionDisplay",
    "ROCDisplay",
    "RankingDisplay",
    "SensitivityDisplay",
    "StructureDisplay",
]
