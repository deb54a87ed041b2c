"""Chains with failing models, wrong modes, unusual mappers and unusual labels."""

import warnings

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression

from skthermo.fem import CallableModel
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper
from tests.surrogate.chains import TRUSS, F, T

PLAIN = TemperatureMapper(LinearRegression())


def failing(lowest, highest, track):
    def program(theta):
        return np.array([np.nan]) if lowest < theta[0] < highest else 3.0 * np.sqrt(theta)

    model = CallableModel(program, ["k"], 1)
    model.track = track
    return model


@pytest.mark.filterwarnings("ignore:.*no-solution")
@pytest.mark.parametrize("place", [(0.95, 1.06, False), (1.05, 1.15, True)])
def test_rows_that_never_had_frequencies_are_counted_and_weigh_a_number(place):
    measured = 3.0 * np.sqrt(np.linspace(0.9, 1.2, 40)[:, np.newaxis])
    inverse = PosteriorInverse(failing(*place)).fit(measured)
    assert np.isfinite(inverse.invert(measured).weight).all()
    chain = DataInformedFEM(inverse.model, mapper=PLAIN, aligner="passthrough")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fem = chain.fit(np.linspace(0, 30, 40)[:, np.newaxis], measured)
    assert np.isfinite(fem.report_.modes["MAPE"]).all()


def test_a_chain_that_misses_its_own_records_by_more_than_their_mean_says_so():
    paper = {"aligner": "passthrough", "discrepancy": None}
    fem = DataInformedFEM(TRUSS, mapper=PLAIN, random_state=0, **paper)
    with pytest.warns(UserWarning, match="by more than their mean does.*uncalibrated-model"):
        fem.fit(T, F * [1.08, 0.94, 1.07, 0.95, 1.06, 0.94])


def test_labels_that_have_no_order():
    labels = [f"r{row}" if row % 2 else row for row in range(365)]
    fem = DataInformedFEM(TRUSS, mapper=PLAIN, random_state=0)
    assert len(fem.fit(T.set_axis(labels), F.set_axis(labels)).recorder_.residuals.values) == 365


@pytest.mark.filterwarnings("ignore:.*uncalibrated-model")
def test_records_with_hardly_any_mode_are_named():
    gaps = np.random.default_rng(0).random(F.shape) < 0.85
    with pytest.warns(UserWarning, match="few-records"):
        DataInformedFEM(TRUSS, inverse=PosteriorInverse(noise=0.001), mapper=PLAIN).fit(T, F.mask(gaps))
