"""Laws of the study of regressors, at its smallest size."""

import functools

import numpy as np
import pytest
from pandas.testing import assert_frame_equal
from sklearn.base import clone

from skthermo.surrogate import InverseSurrogate, TemperatureMapper, paper_network
from tests.examples.frozen_bridge import frozen_bridge
from tests.examples.pages import recipes

EXAMPLE = recipes("regressors")
SIZE = EXAMPLE.Size(simulations=100, fresh=20, days=60)

pytestmark = pytest.mark.filterwarnings(
    "ignore::sklearn.exceptions.ConvergenceWarning",
    "ignore:Got `batch_size` less than 1 or larger",
    "ignore:.*(other-weather|outside-bounds)",
)


@pytest.fixture(scope="module", autouse=True)
def _little_learning():
    """The laws hold for a paper's network that has hardly learned, and for chains of few simulations."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(EXAMPLE, "paper_network", functools.partial(paper_network, max_iter=20))
        patch.setattr(EXAMPLE, "InverseSurrogate", functools.partial(InverseSurrogate, n_samples=200))
        yield


@pytest.fixture(scope="module")
def models():
    return EXAMPLE.structures()


@pytest.fixture(scope="module")
def campaign():
    return EXAMPLE.truss_campaign(0, SIZE)


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["truss", "KW51", "Z24"])
def test_solving_is_exact_without_noise(models, name):
    table = EXAMPLE.inverse_results(*models[name], noise=0.0, seed=0, size=SIZE)
    assert list(table.index) == [*EXAMPLE.STYLES, EXAMPLE.SOLVED]
    assert table.notna().all(axis=None)
    assert table.loc[EXAMPLE.SOLVED, "error"] < 1e-3


@pytest.mark.nightly
def test_with_noise_no_regressor_errs_less_than_solving(models):
    errors = EXAMPLE.inverse_results(*models["Z24"], noise=0.005, seed=0, size=SIZE)["error"]
    assert errors.idxmin() == EXAMPLE.SOLVED


def test_piecewise_linear_regression_is_the_default_of_the_mapper(campaign):
    T, later = campaign.train[0], campaign.test[0]
    lines = EXAMPLE.fitted_chain(campaign, EXAMPLE.regressors("truss")["piecewise-linear"], seed=0)
    default = clone(lines).set_params(mapper=TemperatureMapper()).fit(*campaign.train)
    assert_frame_equal(lines.predict(T), default.predict(T))
    assert_frame_equal(lines.predict(later), default.predict(later))


def test_the_small_network_is_the_default_of_the_inverse(campaign):
    default = InverseSurrogate(campaign.model, n_samples=10, random_state=0).fit()
    small = clone(default).set_params(regressor=EXAMPLE.regressors("truss")["small network"]).fit()
    np.testing.assert_array_equal(default.transform(campaign.train[1]), small.transform(campaign.train[1]))


def test_trees_stay_at_their_last_value_and_lines_go_on(campaign):
    T, found = campaign.train[0], EXAMPLE.regressors("truss")
    found["random forest"].set_params(n_estimators=10)
    changes = {
        name: EXAMPLE.beyond(EXAMPLE.fitted_chain(campaign, found[name], seed=0).predict, T, -1)
        for name in ("random forest", "piecewise-linear")
    }
    assert EXAMPLE.beyond(campaign.law, T, -1) > 5
    assert changes["random forest"] < 2 < changes["piecewise-linear"]


@pytest.mark.nightly
def test_mappers_have_complete_tables(models, tmp_path, monkeypatch):
    """Of all regressors on Z24, of two on KW51."""
    path = tmp_path / "z24_monitoring.csv"
    frozen_bridge(n_healthy=100, n_damaged=20).to_csv(path, index=False)
    assert EXAMPLE.find(tmp_path) == path
    assert EXAMPLE.find(tmp_path / "elsewhere") is None
    regressors, few = EXAMPLE.regressors, ["quadratic", "piecewise-linear"]
    for campaign, names in (
        (EXAMPLE.z24_campaign(models["Z24"][0], path), list(EXAMPLE.STYLES)),
        (EXAMPLE.kw51_campaign(models["KW51"][0], 0, EXAMPLE.Size(100, 20, 20)), few),
    ):
        table = EXAMPLE.averaged([EXAMPLE.mapper_results(campaign, seed=0)])
        assert list(table.index) == names
        monkeypatch.setattr(EXAMPLE, "regressors", lambda network: {name: regressors(network)[name] for name in few})
        assert np.isfinite(table).all(axis=None)
        assert (table["± over seeds"] == 0).all()


def test_frost_stiffens_the_first_parameter():
    theta = EXAMPLE.kw51_parameters([[-10.0], [11.0], [21.0]])
    np.testing.assert_allclose(theta[1], 1)
    np.testing.assert_allclose(theta[2], 0.996)
    np.testing.assert_allclose(theta[0], [1.0584, 1.0084, 1.0084, 1.0084, 1.0084])
