"""Networks with dropout learn, as both surrogates, where their packages are installed."""

import os

import numpy as np
import pytest
from sklearn.base import clone

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import sample
from skthermo.metrics import mape
from skthermo.surrogate import InverseSurrogate, TemperatureMapper
from tests.drop_ins.recipes import run_recipe

pytestmark = pytest.mark.filterwarnings(
    "ignore::DeprecationWarning", "ignore::FutureWarning", "ignore:.*outside-bounds"
)
PAGE = "drop_ins.rst"
TRUSS = make_truss()
YEAR = make_truss_campaign(noise=0.001, random_state=0)


@pytest.fixture(scope="module")
def torch():
    found = pytest.importorskip("torch")
    found.set_num_threads(1)
    found.manual_seed(0)
    return found


@pytest.fixture(scope="module")
def with_skorch(torch):
    pytest.importorskip("skorch")
    return run_recipe(PAGE, "recipe-records", "recipe-torch-networks", "recipe-torch-chain")


@pytest.fixture(scope="module")
def with_keras():
    if "tensorflow" not in os.environ.get("KERAS_BACKEND", ""):
        pytest.importorskip("torch").set_num_threads(1)
        os.environ["KERAS_BACKEND"] = "torch"
    pytest.importorskip("scikeras")
    names = run_recipe(PAGE, "recipe-keras-networks")
    names["keras"].utils.set_random_seed(0)
    return names


def assert_learns(inverse_network, mapper_network):
    """Both networks explain what they have not seen; M1 is better than a guess, and its refined estimates are exact."""
    fresh = sample(TRUSS, 0.2, 100, random_state=1)
    inverse = InverseSurrogate(TRUSS, inverse_network, bounds=0.2, n_samples=500, random_state=0).fit()
    assert inverse.score(fresh.frequencies, fresh.theta) > 0.6
    theta = np.exp(-0.002 * YEAR.temperatures.to_numpy() @ [[1, 0.5, 0], [0, 0.5, 1], [0, 0, 0]])[:, :2]
    mapper = TemperatureMapper(mapper_network).fit(YEAR.temperatures[::2], theta[::2])
    assert mapper.score(YEAR.temperatures[1::2], theta[1::2]) > 0.9
    one = TemperatureMapper(mapper_network).fit(YEAR.temperatures[::2], theta[::2, 0])
    assert one.score(YEAR.temperatures[1::2], theta[1::2, 0]) > 0.9


def test_skorch(with_skorch):
    short = {"max_epochs": 100, "callbacks": None}
    assert_learns(*(clone(with_skorch[name]).set_params(**short) for name in ("table_1", "table_6")))


def test_skorch_has_the_layers_of_the_paper(with_skorch, torch):
    for name, rates in {"table_1": [0.05], "table_6": [0.0, 0.2, 0.2]}.items():
        layers = list(clone(with_skorch[name]).initialize().module_)
        assert [layer.p for layer in layers if isinstance(layer, torch.nn.Dropout)] == rates
    assert [layer.out_features for layer in layers if isinstance(layer, torch.nn.Linear)] == [256, 128, 64, 32, 1]


def test_skorch_as_both_surrogates_of_a_chain(with_skorch):
    fem = clone(with_skorch["paper"])
    fem.set_params(inverse__n_samples=200, inverse__regressor__max_epochs=20, mapper__regressor__max_epochs=150)
    fem.fit(YEAR.temperatures, YEAR.frequencies)
    assert mape(YEAR.clean_frequencies, fem.predict(YEAR.temperatures)).mean() < 1.0
    assert clone(fem).get_params()["mapper__regressor__max_epochs"] == 150


def test_scikeras(with_keras):
    assert_learns(*(clone(with_keras[name]).set_params(epochs=100) for name in ("table_1", "table_6")))


def test_scikeras_rates_of_dropout_are_the_papers(with_keras):
    meta = {"n_features_in_": 3, "n_outputs_": 4}
    for name, rates in {"table_1": [0.05], "table_6": [0.0, 0.2, 0.2]}.items():
        network = with_keras["build"](meta, with_keras[name].hidden, with_keras[name].dropout)
        dropout = with_keras["keras"].layers.Dropout
        assert [layer.rate for layer in network.layers if isinstance(layer, dropout)] == rates
        assert network.output_shape == (None, 4)
