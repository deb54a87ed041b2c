"""A Dask cluster gives the bits of one process."""

import os
from operator import itemgetter

import joblib
import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, KFold
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.fem import CallableModel, sample
from skthermo.metrics import frequency_scorer
from skthermo.monitoring import Monitor, fit_fleet
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper
from tests.fem.frames import FRAME

distributed = pytest.importorskip("distributed", reason="Dask is not installed: the extra 'distributed' brings it")
pytestmark = pytest.mark.filterwarnings(
    "default",  # Dask's own warnings are not tested
    "ignore:.*(outside-bounds|other-weather)",
    "ignore:.*mode-order",
)

TRUSS = make_truss()


@pytest.fixture(scope="module", autouse=True)
def cluster():
    """Two workers on this machine; its client."""
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.mark.nightly
@pytest.mark.parametrize(
    "model",
    [TRUSS, FRAME, FRAME.reduced(0.2, random_state=0), CallableModel(FRAME.frequencies, FRAME.parameter_names, 6)],
    ids=["dense", "sparse", "reduced", "program"],
)
def test_samples_are_those_of_one_process(model):
    n_samples = 600 if model is TRUSS else 24
    expected = sample(model, 0.2, n_samples, random_state=0)
    with joblib.parallel_config("dask"):
        drawn = sample(model, 0.2, n_samples, random_state=0)
    np.testing.assert_array_equal(drawn.theta, expected.theta)
    np.testing.assert_array_equal(drawn.frequencies, expected.frequencies)


def test_samples_are_solved_by_the_workers(cluster):
    where = CallableModel(lambda row: [os.getpid()], ["E"], 1)
    with joblib.parallel_config("dask"):
        processes = set(sample(where, 0.2, 64, random_state=0).frequencies.ravel())
    assert processes <= set(cluster.run(os.getpid).values())


def test_a_model_is_sent_once():
    sent = []

    class Program:
        def __call__(self, row):
            return row[:1]

        def __reduce__(self):
            sent.append(self)
            return itemgetter, (slice(0, 1),)

    model = CallableModel(Program(), ["E"], 1)
    with joblib.parallel_config("dask"):
        drawn = sample(model, 0.2, 20 * model.rows_per_chunk, random_state=0)
    np.testing.assert_array_equal(drawn.frequencies, drawn.theta)
    assert 1 <= len(sent) <= 2  # one for each worker at most


@pytest.mark.nightly
def test_a_grid_search_is_that_of_one_process():
    year = make_truss_campaign(samples_per_year=100, random_state=0)
    chain = DataInformedFEM(
        TRUSS, inverse=PosteriorInverse(noise=0.01), mapper=TemperatureMapper(Ridge()), random_state=0
    )
    grid = {"mapper__regressor__alpha": [0.1, 10.0]}
    search = GridSearchCV(chain, grid, cv=KFold(2), scoring=frequency_scorer, refit="neg_mape")
    here = clone(search).fit(year.temperatures, year.frequencies)
    with joblib.parallel_config("dask"):
        there = clone(search).fit(year.temperatures, year.frequencies)
    for scores in ("split0_test_neg_mape", "split1_test_neg_mape"):
        np.testing.assert_array_equal(there.cv_results_[scores], here.cv_results_[scores])
    weather = make_truss_campaign(samples_per_year=100, random_state=1).temperatures
    np.testing.assert_array_equal(there.predict(weather), here.predict(weather))


@pytest.mark.nightly
def test_a_fleet_is_that_of_one_process():
    years = {name: make_truss_campaign(samples_per_year=100, random_state=seed) for seed, name in enumerate("ab")}
    chain = DataInformedFEM(TRUSS, inverse=PosteriorInverse(noise=0.01), mapper=TemperatureMapper())
    given = dict.fromkeys(years, chain), {n: (one.temperatures, one.frequencies) for n, one in years.items()}
    later = make_truss_campaign(2, samples_per_year=100, random_state=3)
    new = dict.fromkeys(years, (later.temperatures[100:], later.frequencies[100:]))

    def watch(chain):
        detector = make_pipeline(
            TemperatureCompensator(Ridge(), targets=list(later.frequencies)), MahalanobisDetector()
        )
        return Monitor(detector, sensors=False)

    here = fit_fleet(*given, monitor=watch)
    with joblib.parallel_config("dask"):
        there = fit_fleet(*given, monitor=watch)
        answers = there.update(new)
    pd.testing.assert_frame_equal(answers, here.update(new))
    for name, year in years.items():
        first, other = (fleet.chains[name].predict(year.temperatures) for fleet in (here, there))
        np.testing.assert_array_equal(other, first)
    assert set(there.warnings["bridge"]) == set(years)
    assert (there.warnings["kind"] == "not-kept").all()  # Dask works in threads
    assert there.table["is_fitted"].all()
