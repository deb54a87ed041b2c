"""Laws of a chain whose mapper states standard deviations."""

import functools
import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import BayesianRidge, Ridge
from sklearn.pipeline import make_pipeline

from skthermo.fem import AffineModel
from skthermo.preprocessing import BiasAligner, LagFeatures
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper
from tests.bayesian import MEAN as FLEET_MEAN
from tests.bayesian import NOISE, WIDTH, BayesianLogs, Logs, basis, weather

pytestmark = pytest.mark.filterwarnings(
    "ignore:.*(outside-prior|outside-training-weather|other-weather|few-records|uncalibrated-model)",
    "ignore:.*few-(independent|baseline)-records",
)

MODEL = AffineModel(
    {("deck",): [[300.0, -100.0], [-100.0, 100.0]], ("pier",): [[200.0, 0.0], [0.0, 0.0]]}, np.eye(2), n_modes=2
)
MEAN = FLEET_MEAN * [0, 1, 1, 1]


def bridge(seed, days, noise=NOISE):
    """Records of a bridge from the fleet that the prior is right for: winter first."""
    rng, T = np.random.default_rng(seed), weather(days, seed)
    beta = MEAN[:, None] + WIDTH[:, None] * rng.standard_normal((4, 2))
    F = MODEL.frequencies(np.exp(basis(T) @ beta)) * (1 + noise * rng.standard_normal((days, 2)))
    return T, pd.DataFrame(F, index=T.index, columns=["f1", "f2"])


def chain(mapper=None, **options):
    prior = BayesianLogs(MEAN, WIDTH, 2 * NOISE)
    inverse = PosteriorInverse(MODEL, noise=NOISE, prior=0.2)
    return DataInformedFEM(MODEL, inverse=inverse, mapper=prior if mapper is None else mapper, **options)


@functools.cache
def fitted():
    T, F = bridge(0, 395)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return chain().fit(T[:30], F[:30]), T, F


def stated(fem, T):
    """Relative standard deviations that the mapper of a chain states, of frequencies."""
    return fem.thermal_.known_deviations(fem.weather(T))


@pytest.mark.nightly
@pytest.mark.parametrize("options", [{}, {"reduce": True}, {"aligner": BiasAligner(MODEL, method="scale")}])
def test_deviations_are_those_of_the_mappers_posterior_behind_the_model(options):
    T, F = bridge(0, 200)
    offset = [1.3, 0.8] if "aligner" in options else 1.0
    fem = chain(**options).fit(T[:30], F[:30] * offset)
    few, mapper = T[30::20], fem.mapper_
    roots, rng = np.linalg.cholesky(mapper.covariance_), np.random.default_rng(1)
    drawn = []
    for _ in range(1500):
        beta = mapper.coef_ + 0.1 * roots @ rng.standard_normal(mapper.coef_.shape)  # parameters are independent
        frequencies = MODEL.frequencies(np.exp(basis(few) @ beta))
        drawn.append(fem.aligner_.inverse_transform(frequencies))
    expected = (np.array(drawn) / np.mean(drawn, axis=0)).std(axis=0) / 0.1
    np.testing.assert_allclose(stated(fem, few), expected, rtol=0.1)


@pytest.mark.one_case
@pytest.mark.parametrize("wrap", [lambda one: make_pipeline(LagFeatures(1), TemperatureMapper(one)), TemperatureMapper])
def test_a_mapper_whose_regressor_states_deviations_widens_those_of_the_chain(wrap):
    T, F = bridge(0, 120)
    silent, stating = (chain(wrap(one)).fit(T[:60], F[:60]) for one in (Ridge(1e-3), BayesianRidge()))
    assert (stated(silent, T) == 0).all()
    assert (np.nan_to_num(stated(stating, T), nan=1.0) > 0).all()
    widths = []
    for fem in (silent, stating):
        lowest, highest = fem.predict_interval(T)
        widths.append([fem.predict(T, return_std=True)[1].mean(), (highest - lowest).mean()])
    assert (np.array(widths[1]) > widths[0]).all()


def test_a_mapper_that_is_certain_changes_nothing():
    T, F = bridge(0, 60)
    silent = chain(Logs(MEAN, WIDTH, 2 * NOISE)).fit(T[:40], F[:40])
    certain = chain(BayesianLogs(MEAN, WIDTH, 2 * NOISE, share=0.0)).fit(T[:40], F[:40])
    assert not stated(certain, T).any()
    ours, theirs = (
        [*one.predict(T, return_std=True), *one.predict_interval(T), one.simulate(T, noise="fitted", random_state=0)]
        for one in (certain, silent)
    )
    np.testing.assert_array_equal(ours, theirs)


def test_deviations_are_the_scatter_and_the_uncertainty_in_quadrature():
    fem, T, _ = fitted()
    later = T[30:]
    frequencies, std = (table.to_numpy() for table in fem.predict(later, return_std=True))
    scatter = np.sqrt((std / frequencies) ** 2 - stated(fem, later) ** 2)
    spread = fem.recorder_.residuals.spread(later.to_numpy())
    np.testing.assert_allclose(scatter, spread, rtol=1e-6)


@pytest.mark.nightly
def test_intervals_after_thirty_days_hold_a_later_year():
    held = []
    for seed in range(12):
        T, F = bridge(seed, 395)
        lowest, highest = chain().fit(T[:30], F[:30]).predict_interval(T[30:])
        held.append(((F[30:] > lowest) & (F[30:] < highest)).to_numpy().mean())
    assert 0.85 < np.mean(held) < 0.95
    assert np.mean(np.array(held) < 0.7) < 0.2


def test_lags_before_the_mapper_and_chains_in_a_compensator_are_seen_through():
    T, F = bridge(0, 120)
    fem = chain(make_pipeline(LagFeatures(2), BayesianLogs(MEAN, WIDTH, 2 * NOISE))).fit(T, F)
    assert stated(fem, T).shape == (120, 2)
    assert list(fem.extrapolation_distance(T)) == list(fem.training_range_.names)
    assert len(fem.training_range_.names) == 4
