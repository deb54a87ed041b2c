"""Regressors, intervals, detectors and searches of other packages, against the plain way of doing the same."""

import math

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.compose import TransformedTargetRegressor
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, KFold
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neighbors import LocalOutlierFactor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from skthermo.datasets import make_truss_campaign
from skthermo.detection import OutlierDetector
from skthermo.metrics import mape
from skthermo.surrogate import TemperatureMapper
from tests.drop_ins.recipes import run_recipe

pytestmark = pytest.mark.filterwarnings("default")  # warnings of other packages are not tested
PAGE = "drop_ins.rst"


@pytest.fixture(scope="module")
def trees():
    pytest.importorskip("xgboost")
    pytest.importorskip("lightgbm")
    return run_recipe(PAGE, "recipe-records", "recipe-boosted-trees")


@pytest.mark.parametrize("name", ["boosted", "light"])
def test_trees_predict_in_a_mapper_what_they_predict_alone(trees, name):
    regressor, T = clone(trees[name]).set_params(random_state=0, n_estimators=30), trees["T"].to_numpy()
    theta = np.exp(-0.002 * T @ [[1, 0.5], [0, 0.5], [0, 0]])
    weights = np.random.default_rng(0).uniform(0.2, 1, len(T))
    logarithm = FunctionTransformer(np.log, np.exp)
    alone = TransformedTargetRegressor(
        make_pipeline(StandardScaler(), MultiOutputRegressor(regressor)),
        transformer=make_pipeline(logarithm, StandardScaler()),
        check_inverse=False,
    ).fit(T, theta, multioutputregressor__sample_weight=weights)
    mapper = TemperatureMapper(regressor).fit(T, theta, sample_weight=weights)
    later = trees["later"].temperatures.to_numpy()
    np.testing.assert_allclose(mapper.predict(later), alone.predict(later), rtol=1e-6)
    unweighted = TemperatureMapper(regressor).fit(T, theta)
    assert np.abs(unweighted.predict(later) / mapper.predict(later) - 1).max() > 1e-4


@pytest.mark.parametrize("name", ["XGBoost", "LightGBM"])
def test_chains_of_trees_predict_and_leave_gaps(trees, name):
    chain, later = trees["chains"][name], trees["later"]
    predicted = chain.predict(later.temperatures)
    modelled = chain.aligner_.inverse_transform(chain.model.frequencies(chain.mapper_.predict(later.temperatures)))
    np.testing.assert_allclose(predicted, modelled * np.exp(chain.discrepancy_(later.temperatures)), rtol=1e-12)
    regressor = chain.mapper_.regressor_
    assert all(part.random_state is not None for part in getattr(regressor, "estimators_", [regressor]))
    assert mape(later.clean_frequencies, predicted).mean() < 0.6
    holed = later.temperatures.copy()
    holed.iloc[3] = np.nan
    with pytest.warns(UserWarning, match="not-evaluated"):
        predicted = chain.predict(holed)
    assert np.isnan(predicted).all(axis=1).tolist() == [row == 3 for row in range(len(holed))]


def test_mapie(folder):
    pytest.importorskip("mapie")
    recipe = run_recipe(PAGE, "recipe-records", "recipe-mapie-intervals")
    held_out = np.abs(recipe["F"] - recipe["fem"].predict(recipe["T"]))["f1"][240:]
    half_width = np.sort(held_out)[math.ceil(0.9 * (len(held_out) + 1)) - 1]
    frequency, interval = recipe["frequency"], recipe["interval"][:, :, 0]
    np.testing.assert_allclose(interval, frequency[:, np.newaxis] + half_width * np.array([-1, 1]))
    later = recipe["later"].frequencies["f1"].to_numpy()
    assert 0.85 < ((interval[:, 0] <= later) & (later <= interval[:, 1])).mean() < 0.97


@pytest.mark.nightly
def test_stacking():
    recipe = run_recipe(PAGE, "recipe-records", "recipe-stacking")
    later = recipe["later"].clean_frequencies["f1"].to_numpy()
    assert recipe["predicted"].shape == later.shape
    assert 100 * np.abs(recipe["predicted"] / later - 1).mean() < 0.5


def test_pyod():
    pytest.importorskip("pyod")
    recipe = run_recipe(PAGE, "recipe-records", "recipe-pyod-detectors")
    ours = IsolationForest(random_state=0), LocalOutlierFactor(n_neighbors=20, novelty=True)
    for detector, same in zip((recipe["forest"], recipe["factor"]), ours, strict=True):
        expected = OutlierDetector(same).fit(recipe["F"])
        np.testing.assert_array_equal(detector.predict(recipe["damaged"]), expected.predict(recipe["damaged"]))
        offset = detector.threshold_ - expected.threshold_  # the forest's scores are shifted
        index = expected.damage_index(recipe["damaged"]) + offset
        np.testing.assert_allclose(detector.damage_index(recipe["damaged"]), index)
    healthy = make_truss_campaign(random_state=2).frequencies
    assert min(recipe["alarms"]) > 0.9 > 0.1 > (recipe["forest"].predict(healthy) == -1).mean()


def test_optuna(folder):
    optuna = pytest.importorskip("optuna")
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    recipe = run_recipe(PAGE, "recipe-records", "recipe-optuna-search")
    values = [trial.value for trial in recipe["study"].trials]
    assert len(values) == 3
    assert recipe["best"].inverse.noise == recipe["study"].best_params["noise"]
    assert recipe["study"].best_value == max(values) > 0.3
    assert (folder / "known").is_dir()

    names = {"noise": "inverse__noise", "alpha": "mapper__regressor__alpha"}
    tried = [{names[name]: [value] for name, value in trial.params.items()} for trial in recipe["study"].trials[:2]]
    search = GridSearchCV(recipe["fem"], tried, cv=KFold(3), refit=False).fit(recipe["T"], recipe["F"])
    np.testing.assert_array_equal(search.cv_results_["mean_test_score"], values[:2])
    assert isinstance(recipe["fem"].mapper.regressor, Ridge)
