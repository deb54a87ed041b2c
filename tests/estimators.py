"""Every public estimator, with tables that it learns from."""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, clone
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.svm import OneClassSVM

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import (
    CompensatedDetector,
    DirectionalDetector,
    MahalanobisDetector,
    OutlierDetector,
    TemperatureCompensator,
)
from skthermo.monitoring import Monitor
from skthermo.preprocessing import (
    BiasAligner,
    ExponentialMeans,
    HampelFilter,
    HingeFeatures,
    KNNGapImputer,
    LagFeatures,
    ModeTracker,
    SensorMeans,
)
from skthermo.studies import DetectabilityStudy, sweep
from skthermo.surrogate import DataInformedFEM, FleetMapper, InverseSurrogate, PosteriorInverse, TemperatureMapper
from skthermo.updating import ModelUpdater

TRUSS = make_truss()
YEAR = make_truss_campaign(samples_per_year=90, random_state=0)
T = YEAR.temperatures.reset_index(drop=True)
F = YEAR.frequencies.reset_index(drop=True)
MODES = list(F)
GAPPED = F.mask(np.random.default_rng(0).random(F.shape) < 0.03)
ONE_GAP = F.mask(F["f3"].max() == F)
BOTH = T.join(GAPPED)
FEW = F[MODES[:2]]  # to detectors that draw many samples
MEASURED = F[:5]
STAMPED = T.join(FEW).set_axis(pd.date_range("2025-01-01", periods=len(T), name="time"))
NOMINAL, SHAPES = (values[0] for values in TRUSS.modes(np.ones((1, 4))))
LINEAR = InverseSurrogate(TRUSS, Ridge(), bounds=0.2, n_samples=50, noise=0.01, random_state=0)
CHAIN = DataInformedFEM(TRUSS, inverse=LINEAR, mapper=TemperatureMapper(Ridge()), reduce=True, random_state=0)
COMPENSATOR = TemperatureCompensator(Ridge(), targets=MODES)
COMPENSATED = CompensatedDetector(MahalanobisDetector(), Ridge(), targets=MODES)
PIPELINE = make_pipeline(COMPENSATOR, MahalanobisDetector())


def fitted(estimator, *tables):
    """What an estimator is when it has learned."""
    if isinstance(estimator, DetectabilityStudy):
        chain = fitted_chain()
        estimator.set_params(fem=chain, scenarios=sweep(chain, (0.1,), groups=["bottom"])).run(*tables)
        return estimator
    return estimator.fit() if isinstance(estimator, ModeTracker) else estimator.fit(*tables)


@dataclass
class Case:
    """A public estimator, the tables that it learns from, and what it answers for the first of them."""

    estimator: BaseEstimator
    tables: tuple[pd.DataFrame, ...]
    answers: Callable[[BaseEstimator, pd.DataFrame], dict[str, np.ndarray]]
    needs_frames: bool = False  # settings name columns, or rows have stamps
    is_slow: bool = False

    def results(self, form=pd.DataFrame):
        """What is answered after a fit to tables in some form."""
        tables = [form(table) for table in self.tables]
        return self.answered(fitted(clone(self.estimator), *tables), tables[0])

    def answered(self, fitted, X):
        return {name: np.asarray(values, float) for name, values in self.answers(fitted, X).items()}


def after_fit(*methods):
    return lambda fitted, X: {name: getattr(fitted, name)(X) for name in methods}


def simulated(chain, X):
    (mean, std), ends = chain.predict(X, return_std=True), chain.predict_interval(X)
    drawn = chain.simulate(X, damage={"top": 0.1}, noise="fitted", gaps="fitted", random_state=0)
    return {"predict": mean, "std": std, "lowest": ends[0], "drawn": drawn, "theta": chain.parameters_}


def parameters(updater, X):
    return {"theta": updater.theta_, "covariance": updater.covariance_}


def tracked(tracker, X):
    modes = tracker.transform({"frequencies": X, "shapes": np.tile(SHAPES.T, (len(X), 1, 1))})
    return {"frequencies": modes.frequencies, "mac": modes.mac}


def rates(study, X):
    return {"rates": study.results_["rate"]}


def evaluated(monitor, X):
    later = X[:10].set_axis(X.index[:10] + pd.Timedelta(days=365))
    return {"index": monitor.update(later)["index"]}


@functools.cache
def fitted_chain():
    return clone(CHAIN).fit(T, F)


TRANSFORMED = after_fit("transform")
DETECTED = after_fit("predict", "score_samples", "damage_index")
BY_POSITION = TemperatureCompensator(Ridge(), targets=[3])
STUDY = DetectabilityStudy(None, MahalanobisDetector(), [], n_repeats=2, uncertainty="noise", random_state=0)
CASES = {
    "lags": Case(LagFeatures(3), (BOTH,), TRANSFORMED),
    "lags of days": Case(LagFeatures(3), (STAMPED,), TRANSFORMED, needs_frames=True),
    "means": Case(ExponentialMeans(half_lives=[3]), (BOTH,), TRANSFORMED),
    "outliers": Case(HampelFilter(), (BOTH,), TRANSFORMED),
    "hinges": Case(HingeFeatures(), (T,), TRANSFORMED),
    "sensors": Case(SensorMeans(), (T,), TRANSFORMED),
    "gaps": Case(KNNGapImputer(), (BOTH,), TRANSFORMED),
    "shift": Case(BiasAligner(NOMINAL), (GAPPED,), TRANSFORMED),
    "scale": Case(BiasAligner(NOMINAL, method="scale"), (GAPPED,), TRANSFORMED),
    "modes": Case(ModeTracker((NOMINAL, SHAPES)), (F,), tracked),
    "inverse": Case(LINEAR, (F,), TRANSFORMED),
    "posterior inverse": Case(PosteriorInverse(TRUSS), (GAPPED,), TRANSFORMED),
    "mapper": Case(TemperatureMapper(), (T, F / F.mean()), after_fit("predict")),
    "fleet mapper": Case(FleetMapper(), (T, F / F.mean()), after_fit("predict")),
    "updater": Case(ModelUpdater(TRUSS), (MEASURED,), parameters),
    "chain": Case(DataInformedFEM(TRUSS, random_state=0), (T, ONE_GAP), simulated, is_slow=True),
    "study": Case(STUDY, (T[:40],), rates, is_slow=True),
    "Mahalanobis": Case(MahalanobisDetector(), (F,), DETECTED),
    "Mahalanobis, gaps": Case(MahalanobisDetector(), (GAPPED,), DETECTED),
    "softening": Case(DirectionalDetector(), (FEW,), DETECTED, is_slow=True),
    "directions": Case(DirectionalDetector(TRUSS), (GAPPED,), DETECTED, is_slow=True),
    "novelty": Case(OutlierDetector(OneClassSVM()), (F,), DETECTED),
    "compensator by position": Case(BY_POSITION, (BOTH,), TRANSFORMED, is_slow=True),
    "compensator": Case(COMPENSATOR, (BOTH,), TRANSFORMED, needs_frames=True, is_slow=True),
    "pipeline": Case(PIPELINE, (BOTH,), after_fit("predict", "score_samples"), needs_frames=True, is_slow=True),
    "compensated": Case(COMPENSATED, (BOTH,), DETECTED, needs_frames=True, is_slow=True),
    "monitor": Case(
        Monitor(MahalanobisDetector(), targets=list(FEW)), (STAMPED[:60],), evaluated, needs_frames=True, is_slow=True
    ),
}


def assert_same(found, expected, **tolerance):
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        assert not np.isnan(values).all()
        if tolerance:
            np.testing.assert_allclose(found[name], values, **tolerance, err_msg=name)
        else:
            np.testing.assert_array_equal(found[name], values, err_msg=name)
