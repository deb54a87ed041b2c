import numpy as np
import pandas as pd
from scipy.spatial.distance import mahalanobis
from sklearn.dummy import DummyRegressor
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.neighbors import KNeighborsRegressor, LocalOutlierFactor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import OneClassSVM

from skthermo.datasets import make_truss
from skthermo.detection import (
    DamageDetector,
    DirectionalDetector,
    MahalanobisDetector,
    OutlierDetector,
    TemperatureCompensator,
)
from skthermo.preprocessing import BlockedKFold
from skthermo.surrogate import TemperatureMapper
from tests.contract.truss import campaign, records_of


def detection_compensated():
    """A regression removes the temperature; the Mahalanobis distance and both kinds of directions find 8 % of a chord.

    The rate of the model is of 0.3, which looks for losses of section too, and so finds those of stiffness less often.
    """
    healthy, other, damaged = map(records_of, (campaign(), campaign(1), campaign(damage={"bottom": 0.08})))
    regression = TemperatureCompensator(TemperatureMapper(), targets=[f"f{n}" for n in range(1, 7)])
    detectors = {
        "any": MahalanobisDetector(),
        "softening": DirectionalDetector(),
        "model": DirectionalDetector(make_truss()),
    }
    fitted = {name: make_pipeline(regression, detector).fit(healthy) for name, detector in detectors.items()}
    return {
        "false alarms": {name: float((one.predict(other) == -1).mean()) for name, one in fitted.items()},
        "found": {name: float((one.predict(damaged) == -1).mean()) for name, one in fitted.items()},
    }, {"false alarms": {"atol": 0.03}, "found": {"atol": 0.06}}


def detection_directions():
    """What the directions of a model find, how large it is, and which groups look alike.

    What is found is of 0.3, which looks for losses of section too, and so finds those of stiffness less often.
    """
    year = campaign()
    damaged = campaign(1, damage={"bottom": 0.12})
    regression = TemperatureCompensator(TemperatureMapper(), targets=list(year.frequencies))
    detector = make_pipeline(regression, DirectionalDetector(make_truss()))
    detector.fit(records_of(year))
    residuals = detector[0].transform(records_of(damaged))
    severities = detector[-1].severities(residuals)
    groups = ["bottom", "top", "diagonal"]
    return {
        "smallest": detector[-1].minimum_detectable_damage()[groups],
        "pod": detector[-1].pod([0.05, 0.1, 0.2])[groups],
        "severities": severities.mean()[groups],
        "directions": detector[-1].directions_.loc[[*groups, "vertical"]],
        "explained": float(detector[-1].explained(residuals).mean()),
    }, {
        "smallest": {"atol": 0.015},
        "pod": {"atol": 0.06},
        "severities": {"atol": 0.012},
        "directions": {"rtol": 0.02},
        "explained": {"atol": 0.08},
    }


def detection_gaps():
    """Missing modes and temperatures: what cannot be evaluated is 0, and false alarms stay as they were."""
    baseline, later = (records_of(campaign(seed, 2)) for seed in (0, 1))
    modes, random = [f"f{n}" for n in range(1, 7)], np.random.default_rng(0)
    for table in (baseline, later):
        table[modes] = table[modes].where(random.random((len(table), 6)) > 0.1)
    later.iloc[5, 3:], later.iloc[6, :3], later.iloc[7, 0] = np.nan, np.nan, np.nan
    detector = make_pipeline(TemperatureCompensator(Ridge(), targets=modes), MahalanobisDetector()).fit(baseline)
    answers, index = detector.predict(later), detector[-1].damage_index(detector[0].transform(later))
    return {
        "answers": answers[5:8],
        "missing": np.isnan(np.asarray(index))[5:8],
        "false alarms": float((answers == -1).mean()),
        "not evaluated": float((answers == 0).mean()),
    }, {"false alarms": {"atol": 0.03}, "not evaluated": {"atol": 0.01}}


def detection_grid_search():
    """Regressions and detectors are compared by the likelihood of healthy records that were not learned."""
    year = campaign(0, samples_per_year=180)
    baseline = records_of(year)
    lines = TemperatureCompensator(LinearRegression(), targets=list(year.frequencies))
    grid = {"temperaturecompensator__estimator": [DummyRegressor(), LinearRegression()]}
    search = GridSearchCV(make_pipeline(lines, MahalanobisDetector()), grid, cv=BlockedKFold(3)).fit(baseline)
    scores = search.cv_results_["mean_test_score"]
    return {"scores": len(scores), "best": type(search.best_params_["temperaturecompensator__estimator"]).__name__}


def detection_other_regressors():
    """Any regressor removes the temperature, also of columns that are not all temperatures; names and rows stay."""
    baseline, later = map(records_of, (campaign(), campaign(1, damage={"top": 0.1})))
    modes, found = [f"f{n}" for n in range(1, 7)], {}
    for regressor in (LinearRegression(), KNeighborsRegressor()):
        compensator = TemperatureCompensator(regressor, targets=modes)
        detector = make_pipeline(compensator, MahalanobisDetector()).fit(baseline)
        found[type(regressor).__name__] = float((detector.predict(later) == -1).mean())
    residuals = detector[0].transform(later)
    arrays = make_pipeline(TemperatureCompensator(LinearRegression(), targets=range(3, 9)), MahalanobisDetector())
    answers = arrays.fit(baseline.to_numpy()).predict(later.to_numpy())
    return {
        "found": found,
        "columns": len(list(residuals)),
        "rows": bool((residuals.index == later.index).all()),
        "of arrays": float(np.mean(answers == -1)),
        "far": int(np.sum(detector[0].extrapolated(later + 100))),
    }, {"found": {"atol": 0.06}, "of arrays": {"atol": 0.06}}


def detection_outlier_detectors():
    """Outlier detectors of scikit-learn with a threshold for stated false alarms."""
    healthy, other = (campaign(seed).frequencies for seed in (0, 1))
    damaged = campaign(1, damage={"bottom": 0.3}).frequencies
    estimators = {
        "svm": make_pipeline(StandardScaler(), OneClassSVM()),
        "neighbours": LocalOutlierFactor(novelty=True),
        "forest": IsolationForest(n_estimators=20, random_state=0),
    }
    fitted = {
        name: OutlierDetector(estimator, contamination=0.05).fit(healthy) for name, estimator in estimators.items()
    }
    return {
        "false alarms": {name: float((one.predict(other) == -1).mean()) for name, one in fitted.items()},
        "found": {name: float((one.predict(damaged) == -1).mean()) for name, one in fitted.items() if name != "forest"},
    }, {"*": {"atol": 0.05}}


def detection_own_detector():
    """A detector of one's own: three methods."""

    class LargestDeviation(DamageDetector):
        def _learn(self, F, times):
            self.mean_, self.std_ = np.nanmean(F, axis=0), np.nanstd(F, axis=0)
            return self._index(F)

        def _limit(self, index):
            return np.quantile(index, 1 - self.contamination)

        def _index(self, F):
            return np.fmax.reduce(np.abs(F - self.mean_) / self.std_, axis=1)

    year = campaign()
    detector = LargestDeviation().fit(year.frequencies)
    return {"alarms": float((detector.predict(year.frequencies) == -1).mean())}, {"alarms": {"atol": 0.005}}


def detection_own_directions():
    """Directions from a table, and a share of the false alarms for all others."""
    random = np.random.default_rng(0)
    names = ["f1", "f2", "f3"]
    baseline, later = (pd.DataFrame([4, 5, 7] * random.normal(1, 0.01, (400, 3)), columns=names) for _ in range(2))
    directions = pd.DataFrame([[-0.5, -0.1, 0.0], [0.0, -0.4, -0.2]], ["deck", "pier"], names)
    detectors = {share: DirectionalDetector(directions, omnibus=share).fit(baseline) for share in (0.0, 0.2, 1.0)}
    fallen, risen = (later * (1 + 0.06 * sign * directions.loc["deck"]) for sign in (1, -1))
    return {
        "false alarms": {str(share): float((one.predict(later) == -1).mean()) for share, one in detectors.items()},
        "fallen": {str(share): float((one.predict(fallen) == -1).mean()) for share, one in detectors.items()},
        "risen": {str(share): float((one.predict(risen) == -1).mean()) for share, one in detectors.items()},
        "severities": detectors[0.2].severities(fallen).mean(),
        "smallest": detectors[0.2].minimum_detectable_damage(),
    }, {"*": {"atol": 0.05}, "severities": {"rtol": 0.05}, "smallest": {"rtol": 0.08}}


def detection_raw_frequencies():
    """The Mahalanobis distance of raw frequencies finds a loss of 30 %, and false alarms are near 2 %."""
    healthy, other = (campaign(seed).frequencies for seed in (0, 1))
    damaged = campaign(1, damage={"bottom": 0.3}).frequencies
    detectors = {name: MahalanobisDetector(threshold=name).fit(healthy) for name in ("conformal", "quantile", "chi2")}
    index = detectors["quantile"].damage_index(other)
    inverse = np.linalg.inv(np.cov(healthy.to_numpy(), rowvar=False))
    distances = [mahalanobis(row, healthy.mean(), inverse) for row in other.to_numpy()]
    return {
        "false alarms": {name: float((one.predict(other) == -1).mean()) for name, one in detectors.items()},
        "found": {name: float((one.predict(damaged) == -1).mean()) for name, one in detectors.items()},
        "unsquared": float(np.median(index / distances)),
        "index": [type(index).__name__, len(index)],
        "signs": bool(
            ((detectors["chi2"].decision_function(other) < 0) == (detectors["chi2"].predict(other) == -1)).all()
        ),
    }, {"false alarms": {"atol": 0.03}, "found": {"atol": 0.03}, "unsquared": {"atol": 0.02}}
