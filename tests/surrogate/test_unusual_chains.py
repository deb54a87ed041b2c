"""Chains with failing models, wrong modes, unusual labels, parameters that modes hardly tell, and of one mode."""

import warnings
from functools import cache

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import GridSearchCV, KFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from skthermo.detection import TemperatureCompensator
from skthermo.exceptions import RecordsWarning
from skthermo.fem import AffineModel, Beam, CallableModel, Spring, Structure, add_noise
from skthermo.metrics import mape
from skthermo.plotting import PredictionDisplay
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper, refitted, resampled
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
    with pytest.warns(UserWarning, match="15 %: 'f1'.* by more than their mean does.*uncalibrated-model"):
        fem.fit(T[::3], F[::3] * [1.18, 0.94, 1.07, 0.95, 1.06, 0.94])


def test_labels_that_have_no_order():
    labels = [f"r{row}" if row % 2 else row for row in range(120)]
    fem = DataInformedFEM(TRUSS, inverse=PosteriorInverse(noise=0.01, prior=0.05), mapper=PLAIN, random_state=0)
    assert len(fem.fit(T[:120].set_axis(labels), F[:120].set_axis(labels)).recorder_.residuals.values) == 120


@pytest.mark.filterwarnings("ignore:.*uncalibrated-model")
def test_records_with_hardly_any_mode_are_named():
    gaps = np.random.default_rng(0).random(F[::3].shape) < 0.85
    with pytest.warns(UserWarning, match="few-records"):
        DataInformedFEM(TRUSS, inverse=PosteriorInverse(noise=0.001), mapper=PLAIN).fit(T[::3], F[::3].mask(gaps))


@pytest.mark.filterwarnings("ignore:.*uncalibrated-model")
def test_predictions_are_free_of_the_shrinkage_of_the_prior():
    truth = 0.85 * np.exp(-0.002 * (T.to_numpy()[:, :1] - 10)) * np.ones(4)
    clean = TRUSS.frequencies(truth)
    inverse = PosteriorInverse(TRUSS, prior=0.05, noise=0.03)
    chain = DataInformedFEM(TRUSS, inverse=inverse, mapper=PLAIN, aligner="passthrough")
    chain.fit(T.to_numpy(), add_noise(clean, 0.03, random_state=0))
    biases = [(F / clean - 1).mean(axis=0) for F in (TRUSS.frequencies(chain.parameters_), chain.predict(T.to_numpy()))]
    assert biases[0].min() > 0.004
    assert np.abs(biases[1]).max() < 0.0035


def mirror_image():
    """A beam on two springs that are mirror images, each a parameter."""
    section = {"E": 33e9, "G": 14e9, "A": 5.0, "I_yy": 1.6, "I_zz": 20.0, "J": 3.0, "density": 2500.0}
    nodes = {i: (2.5 * i, 0.0, 0.0) for i in range(13)}
    members = {i: Beam(i, i + 1, **section) for i in range(12)}
    members |= {"left": Spring(4, "z", k=4e8), "right": Spring(8, "z", k=4e8)}
    members |= {"start": Spring(0, "z", k=6e8), "end": Spring(12, "z", k=6e8)}
    supports = dict.fromkeys(nodes, "y rx rz") | {0: "x y rx rz"}
    structure = Structure(nodes, members, supports, {"deck": range(12), "left": ["left"], "right": ["right"]})
    return structure.assemble(["deck", "left", "right"], n_modes=4, track=True)


def test_parameters_that_no_mode_tells_apart_stay_near_each_other():
    model = mirror_image()
    temperatures = 10 + 10 * np.random.default_rng(0).uniform(-1, 1, (200, 1))
    truth = np.exp((temperatures - 10) * [-0.004, -0.002, -0.002])
    measured = add_noise(model.frequencies(truth), 0.004, random_state=0)
    chain = DataInformedFEM(model, aligner="passthrough").fit(temperatures, measured)
    assert mape(model.frequencies(truth), chain.predict(temperatures)).max() < 0.2
    theta = chain.predict_parameters(temperatures)
    assert np.abs(np.log(theta[:, 1] / theta[:, 2])).mean() < 0.05


WEATHER, FIRST = T[::4], F[::4]["f1"]
SPRING = AffineModel({("stiffness",): [[(15 * np.pi) ** 2]]}, [[1.0]], n_modes=1)
CHAIN = DataInformedFEM(SPRING, inverse=PosteriorInverse(noise=0.01, prior=0.05), random_state=0)


@cache
def of_vector():
    return clone(CHAIN).fit(WEATHER, FIRST)


@cache
def of_table():
    return clone(CHAIN).fit(WEATHER, FIRST.to_frame())


def test_a_vector_gives_the_vectors_of_a_table_of_one_column():
    def values(chain):
        return chain.predict(WEATHER), *chain.predict(WEATHER, return_std=True), *chain.predict_interval(WEATHER)

    for vector, table in zip(values(of_vector()), values(of_table()), strict=True):
        assert type(vector) is np.ndarray
        assert list(table) == ["f1"]
        np.testing.assert_array_equal(vector, table["f1"])
    for change in (lambda fem: fem, refitted, lambda fem: resampled(fem, 0)):
        one, other = change(of_vector()), change(of_table())
        np.testing.assert_array_equal(one.predict(WEATHER), other.predict(WEATHER)["f1"])
    pd.testing.assert_frame_equal(of_vector().simulate(WEATHER), of_table().simulate(WEATHER))


def test_names_come_from_the_series():
    names = [clone(CHAIN).fit(WEATHER, FIRST.rename(name)).mode_names_ for name in (None, "bending")]
    assert [of_vector().mode_names_, *names] == [["f1"], ["f1"], ["bending"]]
    with pytest.raises(ValueError, match="1 columns for 6 modes"):
        DataInformedFEM(TRUSS).fit(WEATHER, FIRST)


def test_compensators_and_displays_take_it():
    records, folds = WEATHER.join(FIRST), KFold(2, shuffle=True, random_state=0)
    compensated = TemperatureCompensator(CHAIN, targets=["f1"], cv=folds).fit(records)
    counted = compensated.transform(records)["f1"] / np.log(FIRST / of_vector().predict(WEATHER))
    assert (counted < 1 + 1e-9).all()  # less where the chain is less certain than usual
    assert (counted > 1 - 1e-9).mean() > 0.5
    PredictionDisplay.from_estimator(of_vector(), WEATHER, FIRST, confidence=0.9)


class Diverged(RegressorMixin, BaseEstimator):
    """A regressor whose training has failed without an error."""

    def fit(self, X, y):
        self.n_outputs_ = np.shape(y)[1]
        return self

    def predict(self, X):
        return np.full((len(X), self.n_outputs_), np.nan)


@pytest.mark.filterwarnings("ignore::RuntimeWarning", "ignore:.*uncalibrated-model")
def test_a_mapper_that_cannot_predict_the_parameters_is_refused():
    for mapper, match in ((Diverged(), "0 finite rows"), (HistGradientBoostingRegressor(), "TemperatureMapper")):
        with pytest.raises(ValueError, match=match):
            DataInformedFEM(TRUSS, mapper=mapper, random_state=0).fit(T, F)
    trees = TemperatureMapper(HistGradientBoostingRegressor(max_iter=5))
    assert np.isfinite(DataInformedFEM(TRUSS, mapper=trees, random_state=0).fit(T, F).predict(T)).all(axis=None)


def test_features_behind_a_pipeline_need_not_be_temperatures():
    """A chain is the same whatever the scale of features that transformers make of temperatures, flags among them."""

    def chain(*steps):
        return DataInformedFEM(TRUSS, mapper=make_pipeline(*steps, PLAIN), random_state=0)

    def scaled(T, factor, flag):
        return np.column_stack([factor * np.asarray(T), np.full(len(T), flag)])

    with warnings.catch_warnings():
        warnings.simplefilter("error", RecordsWarning)
        plain, large = (
            chain(FunctionTransformer(scaled, kw_args={"factor": factor, "flag": flag})).fit(T, F)
            for factor, flag in ((1.0, 0.0), (1e3, 1.0))
        )
    assert large.report_.rows.trained == plain.report_.rows.trained == len(T)
    np.testing.assert_allclose(large.predict(T), plain.predict(T), rtol=1e-9)


def test_a_parameter_that_moves_no_mode_is_not_said_to_be_moved_by_temperature():
    model = CallableModel(lambda theta: np.array([2.0, 3.0]) * np.sqrt(theta[0]), ["deck", "dead"], 2)
    air = pd.DataFrame({"air": np.linspace(-10.0, 30.0, 120)})
    measured = add_noise(
        model.frequencies(np.column_stack([1 - 1e-3 * air["air"], np.ones(120)])), 1e-3, random_state=0
    )
    report = DataInformedFEM(model, mapper=PLAIN, random_state=0).fit(air, measured).report_
    moved = report.parameters.table["moved by itself (%)"]
    assert np.isnan(moved["dead"])
    assert moved["deck"] > 0
    assert "'dead' by itself" not in str(report)


def test_features_in_a_search_need_not_be_temperatures_either():
    pipeline = make_pipeline(FunctionTransformer(lambda T: 1e3 * T), PLAIN)
    chain = DataInformedFEM(TRUSS, random_state=0)
    found = clone(chain).set_params(mapper=GridSearchCV(pipeline, {}, cv=KFold(3), error_score="raise")).fit(T, F)
    np.testing.assert_allclose(found.predict(T), clone(chain).set_params(mapper=PLAIN).fit(T, F).predict(T), rtol=1e-9)
