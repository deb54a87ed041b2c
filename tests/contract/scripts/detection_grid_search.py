"""Regressions and detectors are compared by the likelihood of healthy records that were not learned."""

from sklearn.dummy import DummyRegressor
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.preprocessing import BlockedKFold

year = make_truss_campaign(samples_per_year=180, random_state=0)
baseline = year.temperatures.join(year.frequencies)
lines = TemperatureCompensator(LinearRegression(), targets=list(year.frequencies))
grid = {"temperaturecompensator__estimator": [DummyRegressor(), LinearRegression()]}
search = GridSearchCV(make_pipeline(lines, MahalanobisDetector()), grid, cv=BlockedKFold(3)).fit(baseline)
scores = search.cv_results_["mean_test_score"]
RESULTS = {"scores": len(scores), "best": type(search.best_params_["temperaturecompensator__estimator"]).__name__}
