"""Simulated records of a changed structure."""

import numpy as np
import pytest

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.surrogate import DataInformedFEM
from tests.surrogate.chains import TRUSS, F, T, as_measured, inverse


@pytest.fixture(scope="module", params=[False, True], ids=["full", "reduced"])
def fem(request):
    return DataInformedFEM(TRUSS, inverse=inverse(), reduce=request.param, random_state=0).fit(T, F)


@pytest.fixture(scope="module")
def weather():
    return make_truss_campaign(random_state=1).temperatures[:60]


@pytest.mark.nightly
def test_each_row_may_have_its_own_severity(fem, weather):
    growing = np.linspace(0, 0.5, 60)
    found = fem.simulate(weather, damage={"bottom": growing, "top": 0.1})
    for row in (0, 30, 59):
        expected = fem.simulate(weather, damage={"bottom": growing[row], "top": 0.1})
        np.testing.assert_allclose(found.iloc[row], expected.iloc[row], rtol=2e-5)


def test_factors_multiply_the_parameters(fem, weather):
    found = fem.simulate(weather, parameters={"diagonal": 0.95})
    theta = fem.predict_parameters(weather) * [1, 1, 0.95, 1]
    np.testing.assert_allclose(found, as_measured(fem, fem.model.frequencies(theta), weather), rtol=2e-5)


def test_a_retrofit_changes_stiffness_and_mass(fem, weather):
    mass = np.full(fem.model.n_dof, 30.0)
    stiffness = np.eye(fem.model.n_dof) * 1e5
    found = fem.simulate(weather, stiffness=stiffness, mass=mass, damage={"top": -0.1})
    expected = fem.model.with_added(stiffness, mass).damaged({"top": -0.1}).frequencies(fem.predict_parameters(weather))
    np.testing.assert_allclose(found, as_measured(fem, expected, weather), rtol=2e-5)


@pytest.mark.parametrize("noise", [0.02, "fitted"])
def test_noise_is_what_draw_noise_gives(fem, weather, noise):
    clean = fem.simulate(weather, damage={"top": 0.2})
    found = fem.simulate(weather, damage={"top": 0.2}, noise=noise, random_state=3)
    np.testing.assert_allclose(found, clean * (1 + fem.recorder_.noise(fem.weather(weather), noise, random_state=3)))


def test_a_factor_in_percent_is_doubted(fem, weather):
    with pytest.warns(UserWarning, match="'top' .*102.*doubtful-factor"):
        fem.simulate(weather, parameters={"top": 102})


def test_other_modes_are_those_of_the_model_at_the_same_parameters(fem, weather):
    seven = make_truss(7).damaged({"top": 0.3}).frequencies(fem.predict_parameters(weather))
    found = fem.thermal_.simulated(fem.weather(weather), [6, 1], damage={"top": 0.3})
    np.testing.assert_allclose(found, seven[:, [6, 1]], rtol=2e-5)
    assert fem.model.with_modes([6, 1]).mode_ranks == (6, 1)
    with pytest.raises(ValueError, match="is none of the model's"):
        fem.thermal_.simulated(fem.weather(weather), [fem.model.n_available])
