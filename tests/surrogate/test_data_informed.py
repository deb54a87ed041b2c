"""The whole chain and its laws; the chain in searches, worker processes and pipelines."""

import joblib
import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from sklearn.base import clone
from sklearn.compose import TransformedTargetRegressor
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.tree import ExtraTreeRegressor

from skthermo.datasets import make_truss_campaign
from skthermo.exceptions import WeatherWarning
from skthermo.fem import CallableModel
from skthermo.metrics import mape
from skthermo.preprocessing import BiasAligner
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, PosteriorInverse, TemperatureMapper
from tests.surrogate.chains import TRUSS, YEAR, F, T, chain, fitted, inverse, mapper, trained

# A linear or quadratic inverse scatters with the noise, and folds of contiguous rows predict weather not seen.
pytestmark = pytest.mark.filterwarnings("ignore:.*(outside-bounds|other-weather)")

LATER = make_truss_campaign(random_state=1)


def test_predicts_other_temperatures_to_a_fraction_of_the_noise():
    assert mape(LATER.clean_frequencies, fitted().predict(LATER.temperatures)).max() < 1.0
    assert fitted().score(LATER.temperatures, LATER.clean_frequencies) > 0.9
    np.testing.assert_array_equal(fitted().simulate(T), fitted().predict(T))  # without damage and noise


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*uncalibrated-model")
def test_the_discrepancy_is_what_the_model_cannot_follow():
    """Modes that the weather moves unlike any parameter does."""
    slope = np.linspace(-0.002, 0.002, 6)
    unlike = np.exp(slope * (T[["T1"]].to_numpy() - 15))
    fem, plain = (chain(discrepancy=discrepancy).fit(T, F * unlike) for discrepancy in ("auto", None))
    truth = LATER.clean_frequencies * np.exp(slope * (LATER.temperatures[["T1"]].to_numpy() - 15))
    errors = [mape(truth, one.predict(LATER.temperatures)).mean() for one in (fem, plain)]
    assert errors[0] < 0.5 * errors[1]


def test_a_discrepancy_that_knows_only_noise_costs_little():
    """Leaves of one record repeat its noise."""
    fem, plain = (chain(discrepancy=one).fit(T, F) for one in (ExtraTreeRegressor(random_state=0), None))
    errors = [mape(LATER.clean_frequencies, one.predict(LATER.temperatures)).mean() for one in (fem, plain)]
    assert errors[0] < 1.2 * errors[1]


@pytest.mark.nightly
def test_noise_is_estimated_out_of_fold_whatever_the_outliers_and_the_memory():
    random = np.random.default_rng(0)
    true = np.array([0.002, 0.004, 0.006, 0.008, 0.01, 0.012])
    for outliers, memory in ((0.0, 0.0), (0.01, 0.0), (0.0, 0.5)):
        shocks = random.standard_normal((465, 6))
        noise = lfilter([np.sqrt(1 - memory**2)], [1, -memory], shocks, axis=0)[100:]
        noise[random.random(noise.shape) < outliers] *= 20
        fem = chain().fit(T, YEAR.clean_frequencies * (1 + true * noise))
        np.testing.assert_allclose(fem.noise_, true, rtol=0.2)
        np.testing.assert_array_equal(fem.report_.modes["noise"], 100 * fem.noise_)


@pytest.mark.nightly
def test_an_inverse_takes_the_noise_of_the_records_unless_it_is_stated():
    auto = chain(inverse=trained(noise="auto")).fit(T, F)
    np.testing.assert_array_equal(auto.inverse_.noise_, auto.noise_)
    for one in (inverse(noise=0.02, prior="learned"), trained(noise=0.02)):
        np.testing.assert_array_equal(chain(inverse=one).fit(T, F).inverse_.noise_, 0.02)
    learned = chain(inverse=inverse(noise="auto", prior="learned")).fit(T, F)
    np.testing.assert_array_equal(learned.report_.modes["misfit"], 100 * learned.inverse_.noise_)
    assert (learned.inverse_.noise_ > 0.8 * learned.noise_).all()


@pytest.mark.nightly
def test_outliers_do_not_move_the_model():
    random = np.random.default_rng(0)
    raw = F * np.where(random.random(F.shape) < 0.01, 1.2, 1.0)
    fem, cleaned = (chain(inverse=trained()).fit(T, table) for table in (raw, F.where(raw == F)))
    np.testing.assert_array_equal(fem.report_.findings.outliers, raw != F)
    np.testing.assert_allclose(fem.predict(LATER.temperatures), cleaned.predict(LATER.temperatures), rtol=1e-9)
    np.testing.assert_array_equal(fem.records_.frequencies, raw)


@pytest.mark.one_case
@pytest.mark.parametrize("seeded", [True, False])
def test_equals_scikit_learns_transformed_target_regressor(seeded):
    quarter = T[::4], F[::4]
    plain = InverseSurrogate(TRUSS, bounds=0.2, noise=0.01, random_state=5), TemperatureMapper(random_state=6)
    parts = (trained(), mapper()) if seeded else plain
    transformer = make_pipeline(BiasAligner(TRUSS), parts[0])
    words = TransformedTargetRegressor(parts[1], transformer=transformer, check_inverse=False).fit(*quarter)
    whole = chain(inverse=parts[0], mapper=parts[1], discrepancy=None).fit(*quarter)
    np.testing.assert_allclose(whole.predict(LATER.temperatures), words.predict(LATER.temperatures), rtol=1e-12)


def test_frames_in_frames_out_arrays_in_arrays_out():
    for method in ("predict", "simulate", "predict_parameters"):
        assert getattr(fitted(), method)(T).index.equals(T.index)
    assert list(fitted().predict(T).columns) == list(F.columns)
    assert list(fitted().predict_parameters(T).columns) == list(TRUSS.parameter_names)
    arrays = chain().fit(T.to_numpy(), F.to_numpy())
    assert isinstance(arrays.predict(T.to_numpy()), np.ndarray)
    assert isinstance(arrays.estimate_parameters(F.to_numpy()), np.ndarray)
    np.testing.assert_allclose(arrays.predict(T.to_numpy()), fitted().predict(T), rtol=1e-12)


def test_third_party_models_are_held_by_reference():
    class OwnModel:
        parameter_names = TRUSS.parameter_names
        n_modes = 6

        def frequencies(self, theta):
            return TRUSS.frequencies(theta)

        def __deepcopy__(self, memo):
            raise AssertionError("copied")

    own = OwnModel()
    inverse = InverseSurrogate(own, LinearRegression())
    model = clone(DataInformedFEM(own, inverse=inverse, aligner=BiasAligner(own), mapper=mapper()))
    assert model.inverse.model is own
    assert clone(model.fit(T, F).aligner).reference is own
    with pytest.raises(ValueError, match="has no method 'damaged'"):
        model.simulate(T, damage={"top": 0.1})


def test_impossible_parameters_are_nan_with_a_warning():
    class Wild(TemperatureMapper):
        def predict(self, X):
            theta = np.array(super().predict(X))
            theta[[2, 5], 0] = [-1.0, np.inf]
            return theta

    model = chain(inverse=trained(), mapper=Wild(LinearRegression())).fit(T, F)
    with pytest.warns(UserWarning, match="outside-bounds"):
        predicted = model.predict(T)
    np.testing.assert_array_equal(np.flatnonzero(predicted.isna().all(axis=1)), [2, 5])


def test_an_inverse_of_another_models_parameters_is_refused():
    other = CallableModel(TRUSS.frequencies, TRUSS.parameter_names[::-1], 6)
    with pytest.raises(ValueError, match=r"the inverse's model has the parameters \['vertical', "):
        chain(inverse=inverse(model=other)).fit(T, F)


@pytest.mark.nightly
def test_parts_without_a_model_get_that_of_the_chain():
    within = make_pipeline(FunctionTransformer(check_inverse=False), BiasAligner())
    bare, inside = (chain(aligner=aligner).fit(T[::4], F[::4]) for aligner in (BiasAligner(), within))
    assert bare.aligner_.reference is inside.aligner_[-1].reference is TRUSS
    assert bare.aligner.reference is None
    nested = chain(inverse=make_pipeline(inverse(model=None))).fit(T[::4], F[::4])
    assert nested.inverse_[0].model is TRUSS
    np.testing.assert_array_equal(nested.predict(T), bare.predict(T))


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


def test_parameters_in_unseen_weather_stay_where_records_have_shown_them_or_near_nominal():
    """A part that froze to four times its stiffness is not carried on; 30 % is allowed to any parameter."""
    random = np.random.default_rng(0)
    air = random.permutation(np.linspace(-8, 30, 300))
    theta = np.column_stack([1 - 0.001 * (air - 10), 1 + 3 / (1 + np.exp((air - 2) / 3))])
    model = TRUSS.with_parameters(["bottom", "diagonal"]).with_modes(range(5))
    noisy = model.frequencies(theta) * (1 + 0.002 * random.standard_normal((300, 5)))
    F = pd.DataFrame(noisy, columns=[f"f{i + 1}" for i in range(5)])
    fem = DataInformedFEM(model, aligner="passthrough", inverse=PosteriorInverse(noise=0.002, prior=0.5))
    fem.fit(pd.DataFrame({"air": air}), F)
    with pytest.warns(WeatherWarning):
        far = fem.predict_parameters(pd.DataFrame({"air": [-300.0, -12.0, 500.0]}))
    assert far["diagonal"].iloc[:2].to_numpy() == pytest.approx(fem.parameters_["diagonal"].max())
    assert far["bottom"].iloc[[0, 2]].to_numpy() == pytest.approx([np.exp(0.3), np.exp(-0.3)], rel=0.1)
