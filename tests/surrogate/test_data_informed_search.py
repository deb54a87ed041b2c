"""The chain in searches, worker processes and pipelines."""

import joblib
import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import GridSearchCV, KFold, cross_val_predict

from skthermo.fem import AffineModel
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper
from tests.surrogate.chains import TRUSS, F, Logged, T, chain, fitted, inverse

# A linear or quadratic inverse scatters with the noise, and folds of contiguous rows predict weather not seen.
pytestmark = pytest.mark.filterwarnings(r"ignore:\d+ of \d+ rows (give parameters|have temperatures) far outside")
FITTED = fitted()


@pytest.mark.nightly
def test_grid_search_over_nested_parameters_on_two_jobs(tmp_path):
    grid = {"mapper__lagfeatures__lags": [1, 2], "inverse__noise": [0.0, 0.01]}
    quarter = T[::4], F[::4]
    searches = [
        GridSearchCV(chain(inverse=inverse(memory=str(tmp_path))), grid, cv=KFold(2), n_jobs=n_jobs).fit(*quarter)
        for n_jobs in (1, 2)
    ]
    np.testing.assert_array_equal(*(search.cv_results_["mean_test_score"] for search in searches))
    np.testing.assert_array_equal(*(search.predict(T) for search in searches))


@pytest.mark.nightly
def test_processes_that_search_together_simulate_once(tmp_path):
    model = Logged(tmp_path / "solved.txt")
    air = np.linspace(0, 30, 60)[:, np.newaxis]
    measured = np.sqrt(1 - 0.005 * air)
    simulated = InverseSurrogate(model, LinearRegression(), n_samples=77, memory=str(tmp_path / "memory"))
    estimator = DataInformedFEM(model, inverse=simulated, mapper=TemperatureMapper(LinearRegression()), random_state=0)
    search = GridSearchCV(estimator, {"inverse__noise": [0.0, 0.001, 0.002, 0.003]}, cv=KFold(3), n_jobs=2)
    search.fit(air, measured)
    solved = model.log.read_text().split()
    assert solved.count("77") == 1
    assert len(solved) > 12  # predictions go through the model too


@pytest.mark.nightly
def test_an_outer_seed_leaves_a_seeded_parts_inside_to_that_part():
    trees = ExtraTreesRegressor(3)
    parts = {
        "inverse": InverseSurrogate(TRUSS, trees, bounds=0.2, n_samples=50, random_state=1),
        "mapper": TemperatureMapper(trees, random_state=2),
    }
    first, second = (chain(**parts, random_state=seed).fit(T, F).predict(T) for seed in (0, 9))
    pd.testing.assert_frame_equal(first, second)


@pytest.mark.nightly
def test_same_seed_same_bits():
    model = DataInformedFEM(TRUSS, inverse=InverseSurrogate(bounds=0.2, noise=0.01, n_samples=300), random_state=0)
    alone = clone(model).fit(T, F).predict(T)
    with joblib.parallel_config("loky"):
        for _ in range(2):
            spread = clone(model).set_params(inverse__n_jobs=2).fit(T, F).predict(T)
            np.testing.assert_array_equal(spread, alone)
    other = clone(model).set_params(random_state=1).fit(T, F).predict(T)
    assert not np.array_equal(other, alone)


def test_seed_fills_only_what_has_none():
    seeded = DataInformedFEM(TRUSS, inverse=inverse(), random_state=0).fit(T, F)
    assert seeded.inverse_.random_state == 3
    assert isinstance(seeded.mapper_.random_state, int)
    assert seeded.mapper is None


@pytest.mark.filterwarnings("ignore:the aligner hides offsets")
def test_large_models_work_in_worker_processes():
    """Matrices above 1 MB reach workers as read-only memory maps."""
    n = 380
    chain_of_springs = np.diag(np.full(n, 2.0)) - np.diag(np.ones(n - 1), 1) - np.diag(np.ones(n - 1), -1)
    model = AffineModel({("k",): 1e4 * chain_of_springs, ("g",): np.eye(n)}, np.eye(n), n_modes=2)
    warm = pd.DataFrame({"T": np.linspace(0, 30, 40)})
    measured = model.frequencies(np.column_stack([1 - 0.005 * warm["T"], 1 + 0 * warm["T"]]))
    estimator = DataInformedFEM(
        model,
        inverse=InverseSurrogate(regressor=LinearRegression(), n_samples=30, bounds=0.2),
        mapper=TemperatureMapper(LinearRegression()),
        random_state=0,
    )
    alone, spread = (cross_val_predict(estimator, warm, measured, cv=2, n_jobs=n_jobs) for n_jobs in (1, 2))
    np.testing.assert_array_equal(spread, alone)
    np.testing.assert_allclose(alone, measured, rtol=0.02)
