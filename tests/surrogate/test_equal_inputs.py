"""Equal tables give equal bits, whatever holds them."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import BayesianRidge, Ridge

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, PosteriorInverse, TemperatureMapper

TRUSS = make_truss()
YEAR = make_truss_campaign(samples_per_year=120, random_state=0)
# numbers of single precision, which are the same in both
T, F = (table.to_numpy().astype(np.float32).astype(float) for table in (YEAR.temperatures, YEAR.frequencies))
THETA = YEAR.theta.to_numpy().astype(np.float32).astype(float)


def sliced(table):
    """A view of some rows and columns of a larger array."""
    larger = np.full((2 * len(table), table.shape[1] + 3), 7.0)
    larger[::2, 1:-2] = table
    return larger[::2, 1:-2]


HOLDERS = {
    "copy": np.copy,
    "slice": sliced,
    "columns": np.asfortranarray,
    "lists": lambda table: table.tolist(),
    "frame": pd.DataFrame,
    "pickle": lambda table: pickle.loads(pickle.dumps(table)),
    "single precision": lambda table: table.astype(np.float32),
    "read only": lambda table: np.frombuffer(table.tobytes()).reshape(table.shape),
}


def chain(X, y, new):
    fem = DataInformedFEM(TRUSS, random_state=0).fit(X, y)
    drawn = fem.simulate(new, damage={"top": 0.1}, noise="fitted", gaps="fitted", random_state=0)
    return [fem.parameters_, *fem.predict(new, return_std=True), *fem.predict_interval(new), drawn]


def paper(X, y, new):
    inverse = InverseSurrogate(regressor=Ridge(1e-3), n_samples=100)
    fem = DataInformedFEM(TRUSS, inverse=inverse, mapper=TemperatureMapper(BayesianRidge()), random_state=0).fit(X, y)
    return [fem.parameters_, *fem.predict(new, return_std=True)]


def posterior(X, y, new):
    return PosteriorInverse(TRUSS).fit(y).transform(y, return_std=True)


def trained(X, y, new):
    return [InverseSurrogate(TRUSS, Ridge(1e-3), n_samples=100, random_state=0).fit(y).transform(y)]


def mapper(X, y, new):
    fitted = TemperatureMapper(BayesianRidge()).fit(X, THETA)
    return [*fitted.predict(new, return_std=True)]


ESTIMATORS = [chain, paper, posterior, trained, mapper]
pytestmark = pytest.mark.filterwarnings("ignore:.*(outside-bounds|uncalibrated-model|few-records)")


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_equal_tables_give_equal_bits(estimator):
    expected = estimator(T, F, T[:40])
    for name, held in HOLDERS.items():
        found = estimator(held(T), held(F), held(T[:40]))
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(np.asarray(one), other, name)


def test_another_thread_and_a_second_time_give_equal_bits():
    expected = chain(T, F, T[:40])
    with ThreadPoolExecutor(2) as pool:
        found = [*pool.map(lambda _: chain(T, F, T[:40]), range(2)), chain(T, F, T[:40])]
    for tables in found:
        for one, other in zip(tables, expected, strict=True):
            np.testing.assert_array_equal(one, other)


def test_polars_frames_give_the_same_to_rounding():
    polars = pytest.importorskip("polars")
    held = [polars.DataFrame(table, schema=[f"c{i}" for i in range(table.shape[1])]) for table in (T, F, T[:40])]
    for one, other in zip(chain(*held), chain(T, F, T[:40]), strict=True):
        np.testing.assert_allclose(np.asarray(one), other, rtol=1e-9)
