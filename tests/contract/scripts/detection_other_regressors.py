"""Any regressor removes the temperature, also of columns that are not all temperatures; names and rows stay."""

import numpy as np
from sklearn.linear_model import LinearRegression
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator

campaigns = [make_truss_campaign(random_state=0), make_truss_campaign(damage={"top": 0.1}, random_state=1)]
baseline, later = (campaign.temperatures.join(campaign.frequencies) for campaign in campaigns)
modes, found = list(campaigns[0].frequencies), {}
for regressor in (LinearRegression(), KNeighborsRegressor()):
    compensator = TemperatureCompensator(regressor, targets=modes)
    detector = make_pipeline(compensator, MahalanobisDetector()).fit(baseline)
    found[type(regressor).__name__] = float((detector.predict(later) == -1).mean())
residuals = detector[0].transform(later)
arrays = make_pipeline(TemperatureCompensator(LinearRegression(), targets=range(3, 9)), MahalanobisDetector())
answers = arrays.fit(baseline.to_numpy()).predict(later.to_numpy())
RESULTS = {
    "found": found,
    "columns": len(list(residuals)),
    "rows": bool((residuals.index == later.index).all()),
    "of arrays": float(np.mean(answers == -1)),
    "far": int(np.sum(detector[0].extrapolated(later + 100))),
}
TOLERANCES = {"found": {"atol": 0.06}, "of arrays": {"atol": 0.06}}
