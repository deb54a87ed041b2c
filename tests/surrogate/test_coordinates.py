"""Coordinates and weights in which the temperature mapper learns."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures

from skthermo.fem import Beam, Spring, Structure, add_noise
from skthermo.metrics import mape
from skthermo.surrogate import DataInformedFEM, FrequencyCoordinates, InverseSurrogate, TemperatureMapper
from skthermo.surrogate._standardiser import Standardiser
from tests.surrogate.chains import TRUSS, F, T


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), n_parameters=st.integers(1, 4), extra=st.integers(0, 3))
def test_coordinates_and_back_are_the_identity(seed, n_parameters, extra):
    rng = np.random.default_rng(seed)
    A = np.vstack([np.eye(n_parameters), np.zeros((extra, n_parameters))])
    A = A + 0.3 * rng.uniform(-1, 1, A.shape) / n_parameters
    values = rng.uniform(0.5, 2, (10, n_parameters))
    standardiser = Standardiser.fitted(values, log=True, coordinates=FrequencyCoordinates(A))
    np.testing.assert_allclose(standardiser.inverse_transform(standardiser.transform(values)), values, rtol=1e-9)


def test_what_coordinates_do_not_see_stays_at_the_mean():
    values = np.exp(np.random.default_rng(0).normal(0, 0.1, (20, 2)))
    one_mode = Standardiser.fitted(values, log=True, coordinates=FrequencyCoordinates(np.array([[1.0, 0.0]])))
    back = one_mode.inverse_transform(one_mode.transform(values))
    np.testing.assert_allclose(back[:, 0], values[:, 0])
    np.testing.assert_allclose(np.log(back[:, 1]), np.log(values[:, 1]).mean())


def test_damping_shrinks_towards_the_mean():
    values, sensitivity, damping = np.exp(np.random.default_rng(0).normal(0, 0.1, (20, 2))), 3.0, np.array([0.0, 4.0])
    coordinates = FrequencyCoordinates(sensitivity * np.eye(2), damping)
    damped = Standardiser.fitted(values, log=True, coordinates=coordinates)
    back, x = np.log(damped.inverse_transform(damped.transform(values))), np.log(values)
    share = sensitivity**2 / (sensitivity**2 + damping)
    np.testing.assert_allclose(back - x.mean(axis=0), share * (x - x.mean(axis=0)), atol=1e-12)


def thetas():
    rng = np.random.default_rng(5)
    return np.exp(-0.002 * T.to_numpy() @ rng.uniform(0.5, 1.5, (3, 4)) + 0.003 * rng.standard_normal((len(T), 4)))


def test_linear_mapper_does_not_depend_on_coordinates():
    theta, coordinates = thetas(), FrequencyCoordinates(np.random.default_rng(0).normal(size=(6, 4)))
    plain = TemperatureMapper(LinearRegression()).fit(T, theta)
    turned = TemperatureMapper(LinearRegression(), coordinates=coordinates).fit(T, theta)
    np.testing.assert_allclose(turned.predict(T), plain.predict(T), rtol=1e-9)


@pytest.mark.parametrize("coordinates", [None, FrequencyCoordinates(np.eye(4))], ids=["plain", "coordinates"])
def test_weight_of_a_row_is_how_often_it_counts(coordinates):
    theta, weights = thetas(), np.random.default_rng(1).integers(0, 4, len(T))

    def fitted(rows, **options):
        mapper = TemperatureMapper(LinearRegression(), coordinates=coordinates)
        return mapper.fit(T.to_numpy()[rows], theta[rows], **options).predict(T.to_numpy())

    weighted = fitted(np.arange(len(T)), sample_weight=weights)
    np.testing.assert_allclose(weighted, fitted(np.repeat(np.arange(len(T)), weights)), rtol=1e-9)
    assert np.abs(weighted / fitted(np.arange(len(T))) - 1).max() > 1e-5


def test_chain_gives_rows_with_gaps_less_weight_if_the_inverse_refines():
    class Spy(LinearRegression):
        def fit(self, X, y, sample_weight=None):
            self.weights_ = sample_weight
            return super().fit(X, y, sample_weight)

    year = F.mask(np.random.default_rng(0).random(F.shape) < 0.2)
    weighted, alike = (
        DataInformedFEM(
            TRUSS,
            inverse=InverseSurrogate(TRUSS, Ridge(), noise=0.01, n_samples=50, refine=refine, random_state=0),
            mapper=TemperatureMapper(Spy()),
        ).fit(T, records)
        for refine, records in ((None, year), (0, F))
    )
    some = year.notna().any(axis=1).to_numpy()
    given_weights = weighted.mapper_.regressor_.weights_
    np.testing.assert_allclose(given_weights, weighted.inverse_.invert(year).weight[some])
    np.testing.assert_array_equal(given_weights == 1, year.notna().all(axis=1)[some])
    assert alike.mapper_.regressor_.weights_ is None


def test_the_mapper_learns_parameters_without_the_shrinkage_of_the_prior():
    truth = 0.85 * np.exp(-0.002 * (T.to_numpy()[:, :1] - 10)) * np.ones(4)
    clean = TRUSS.frequencies(truth)
    inverse = InverseSurrogate(TRUSS, Ridge(), bounds=0.2, noise=0.03, n_samples=50, random_state=0)
    chain = DataInformedFEM(TRUSS, inverse=inverse, mapper=TemperatureMapper(LinearRegression()))
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
    quadratic = make_pipeline(PolynomialFeatures(2), Ridge(1e-6))
    inverse = InverseSurrogate(model, quadratic, noise=0.004, n_samples=200, random_state=0)
    chain = DataInformedFEM(model, inverse=inverse).fit(temperatures, measured)
    assert mape(model.frequencies(truth), chain.predict(temperatures)).max() < 0.2
    theta = chain.predict_parameters(temperatures)
    np.testing.assert_allclose(theta[:, 1], theta[:, 2], rtol=0.05)


def test_coordinates_of_other_parameters_or_values_are_refused():
    T, theta = np.linspace(0, 30, 20)[:, np.newaxis], np.linspace(0.9, 1.1, 40).reshape(20, 2)
    for sensitivities, message in (
        ([1.0, 2.0], r"sensitivities have shape \(2,\); expected finite numbers"),
        ([[1.0, np.nan]], r"sensitivities have shape \(1, 2\); expected finite numbers"),
    ):
        with pytest.raises(ValueError, match=message):
            FrequencyCoordinates(sensitivities)
    with pytest.raises(ValueError, match=r"damping is \[1. 2. 3.\]; expected one number from 0, or 2"):
        FrequencyCoordinates(np.eye(2), [1.0, 2.0, 3.0])
    mapper = TemperatureMapper(coordinates=FrequencyCoordinates(np.eye(3)))
    with pytest.raises(ValueError, match="theta has 2 columns; expected the 3 of the sensitivities"):
        mapper.fit(T, theta)
    mapper = TemperatureMapper(coordinates=FrequencyCoordinates(np.eye(2)))
    with pytest.raises(ValueError, match=r"theta falls to -0\.1; expected positive multipliers"):
        mapper.fit(T, theta - 1)
