"""Outlier detectors of scikit-learn with a threshold for stated false alarms."""

from sklearn.ensemble import IsolationForest
from sklearn.neighbors import LocalOutlierFactor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import OneClassSVM

from skthermo.datasets import make_truss_campaign
from skthermo.detection import OutlierDetector

healthy, other = (make_truss_campaign(random_state=seed).frequencies for seed in (0, 1))
damaged = make_truss_campaign(damage={"bottom": 0.3}, random_state=1).frequencies
estimators = {
    "svm": make_pipeline(StandardScaler(), OneClassSVM()),
    "neighbours": LocalOutlierFactor(novelty=True),
    "forest": IsolationForest(n_estimators=20, random_state=0),
}
fitted = {name: OutlierDetector(estimator, contamination=0.05).fit(healthy) for name, estimator in estimators.items()}
RESULTS = {
    "false alarms": {name: float((one.predict(other) == -1).mean()) for name, one in fitted.items()},
    "found": {name: float((one.predict(damaged) == -1).mean()) for name, one in fitted.items() if name != "forest"},
}
TOLERANCES = {"*": {"atol": 0.05}}
