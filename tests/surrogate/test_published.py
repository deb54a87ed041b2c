"""The networks and the chain as published."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.metrics import r2_score
from sklearn.neural_network import MLPRegressor
from sklearn.utils.estimator_checks import check_estimator

from skthermo.datasets import make_truss_campaign
from skthermo.preprocessing import BiasAligner, KNNGapImputer
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, paper_chain, paper_network
from tests.surrogate.chains import TRUSS, F, T

LATER = make_truss_campaign(random_state=1)
RANDOM = np.random.RandomState(0)
X = RANDOM.standard_normal((200, 3))
Y = np.column_stack([X @ [1.0, -0.5, 0.2], np.abs(X[:, 0])]) + 0.1 * RANDOM.standard_normal((200, 2))
TABLES = {1: "truss", 4: "kw51-inverse", 6: "kw51-mapper"}


@pytest.mark.parametrize(("table", "n_layers", "dropout"), [(1, 6, True), (4, 5, False), (6, 4, True)])
def test_a_network_trains_for_all_epochs_without_a_warning(table, n_layers, dropout):
    network = paper_network(TABLES[table], dropout=dropout, max_iter=12, random_state=0)
    assert network.get_params() == paper_network(table, dropout=dropout, max_iter=12, random_state=0).get_params()
    assert isinstance(network, MLPRegressor) == (not dropout)
    noise, constant = RANDOM.standard_normal((300, 1)), np.zeros((300, 2))  # of which nothing can be learned for long
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert network.fit(noise, constant).n_iter_ == 12
    assert len(network.coefs_) == n_layers + 1


def test_a_network_that_the_paper_has_not_is_refused():
    with pytest.raises(ValueError, match=r"network is 2; expected one of \['truss', .* tables \[1, 4, 6\]"):
        paper_network(2)
    with pytest.raises(ValueError, match="network is 'kw51-mapper'; expected one of"):
        paper_chain(TRUSS, network="kw51-mapper")


@pytest.mark.nightly
@pytest.mark.parametrize("purpose", TABLES.values())
def test_networks_follow_scikit_learn(purpose):
    small = {"hidden_layer_sizes": (32, 16, 8), "max_iter": 60, "learning_rate_init": 0.01, "batch_size": 16}
    check_estimator(paper_network(purpose, **small), on_skip=None)


def test_a_step_of_adam_is_against_the_slope_of_the_loss():
    """In the first step, each weight moves by the learning rate; slopes are central differences of the loss."""
    settings = {"hidden_layer_sizes": (5, 4), "batch_size": 200, "validation_fraction": 0.0, "random_state": 0}
    before, after = (paper_network("kw51-inverse", max_iter=n, **settings).fit(X, Y) for n in (0, 1))
    for weights, moved in zip(before.coefs_ + before.intercepts_, after.coefs_ + after.intercepts_, strict=True):
        for place in np.ndindex(weights.shape):
            losses, kept = [], weights[place]
            for step in (-1e-3, 1e-3):
                weights[place] = kept + step
                losses.append(((before.predict(X) - Y) ** 2).sum())
            weights[place] = kept
            if abs(losses[1] - losses[0]) > 1e-3:
                assert moved[place] - kept == pytest.approx(-0.001 * np.sign(losses[1] - losses[0]), rel=1e-3)


@pytest.mark.nightly
def test_dropout_of_inputs_is_ridge_regression():
    """Without hidden layers, the mean loss over all masks has the ridge penalty rate / (1 - rate) X'X, its diagonal."""
    rate = 0.3
    settings = {"hidden_layer_sizes": (), "max_iter": 3000, "validation_fraction": 0.0, "learning_rate_init": 0.002}
    linear = paper_network("truss", batch_size=200, random_state=0, **settings)
    network = clone(linear).set_params(dropout=(rate,)).fit(X, Y)
    centred, penalty = X - X.mean(axis=0), rate / (1 - rate) * np.diag(np.diag(X.T @ X))
    expected = np.linalg.solve(centred.T @ centred + penalty, centred.T @ Y)
    np.testing.assert_allclose(network.coefs_[0], expected, atol=0.05)
    assert np.abs(linear.set_params(dropout=()).fit(X, Y).coefs_[0] - expected).max() > 0.2


@pytest.mark.nightly
def test_the_rows_that_are_held_out_are_scored():
    """A network that learns pure noise by heart knows four fifths of it."""
    noise, settings = np.random.RandomState(10).standard_normal((200, 1)), {"batch_size": 32, "random_state": 0}
    network = paper_network("kw51-inverse", max_iter=300, learning_rate_init=0.003, **settings).fit(X, noise)
    by_heart = np.abs(network.predict(X) - noise).ravel() < 0.2
    assert 0.7 < by_heart.mean() < 0.87
    assert network.validation_score_ == pytest.approx(r2_score(noise[~by_heart], network.predict(X[~by_heart])), abs=1)
    assert network.validation_score_ < 0


def quick(lags=None, **settings):
    """The chain with few simulations and epochs."""
    chain = paper_chain(TRUSS, bounds=0.2, n_samples=100, lags=lags, random_state=0)
    mapper = "mapper" if lags is None else "mapper__temperaturemapper"
    epochs = {"inverse__regressor__max_iter": 30, f"{mapper}__regressor__max_iter": 30}
    return chain.set_params(**epochs | settings)


def gappy(table, seed):
    return table.mask(np.random.default_rng(seed).random(table.shape) < 0.1)


def test_the_chain_makes_the_papers_choices():
    chain = paper_chain(TRUSS, network="kw51", lags=24)
    assert isinstance(chain, DataInformedFEM)
    assert chain.inverse.regressor.get_params() == paper_network(4).get_params()
    lags, mapper = (step for _, step in chain.mapper.steps)
    assert mapper.regressor.get_params() == paper_network(6).get_params()
    assert (lags.lags, mapper.means, chain.discrepancy, chain.reduce) == (24, None, None, False)
    assert (chain.inverse.bounds, chain.inverse.n_samples, chain.inverse.noise) == (0.3, 1000, 0.0)
    assert paper_chain(TRUSS).mapper.regressor.get_params() == paper_network(1).get_params()


@pytest.mark.filterwarnings("ignore:.*uncalibrated-model")
def test_mean_frequencies_become_those_of_the_simulations_that_taught_the_inverse():
    fem = quick().fit(T, F)
    simulated = fem.inverse_.samples_.frequencies.mean(axis=0)
    np.testing.assert_allclose(fem.aligner_.transform(F).mean(), simulated, rtol=1e-12)
    table = BiasAligner(fem.inverse_.samples_.frequencies).fit(F)
    np.testing.assert_allclose(table.transform(F), fem.aligner_.transform(F), rtol=1e-12)
    np.testing.assert_array_equal(fem.parameters_, fem.inverse_.transform(fem.aligner_.transform(F)))
    modelled = fem.aligner_.inverse_transform(TRUSS.frequencies(fem.predict_parameters(LATER.temperatures)))
    np.testing.assert_allclose(fem.predict(LATER.temperatures), modelled, rtol=1e-12)


def test_simulations_as_a_reference_need_an_inverse_that_has_some():
    for inverse in (None, PosteriorInverse()):
        with pytest.raises(ValueError, match=r"'simulations', but PosteriorInverse.* has none"):
            DataInformedFEM(TRUSS, inverse=inverse, aligner=BiasAligner("simulations")).fit(T[:90], F[:90])
    with pytest.raises(ValueError, match="no InverseSurrogate has simulated any"):
        BiasAligner("simulations").fit(F)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*(no-earlier-records|uncalibrated-model)")
def test_gaps_of_temperatures_and_frequencies_are_filled_together_so_that_all_rows_train():
    holed_T, holed_F = gappy(T, 0), gappy(F, 1)
    fem = quick(lags=3).fit(holed_T, holed_F)
    assert fem.report_.rows.trained == len(T)
    assert fem.report_.rows.filled.empty
    filled = KNNGapImputer(n_neighbors=10).fit_transform(np.hstack([holed_T, holed_F]))
    np.testing.assert_array_equal(fem.records_.inputs[:, ::3], filled[:, :3])
    whole = quick(lags=3).fit(
        pd.DataFrame(filled[:, :3], T.index, T.columns), pd.DataFrame(filled[:, 3:], T.index, F.columns)
    )
    np.testing.assert_allclose(whole.predict(LATER.temperatures), fem.predict(LATER.temperatures), rtol=1e-12)
