"""What an identification says about its inputs: each doubt once, each error in plain words."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.exceptions import ConvergenceWarning, NotFittedError
from sklearn.neural_network import MLPRegressor

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.studies import identify_damage
from skthermo.surrogate import DataInformedFEM, TemperatureMapper

YEAR = make_truss_campaign(random_state=0)
LATER = make_truss_campaign(random_state=1)
T, F = LATER.temperatures[::10], LATER.frequencies[::10]
GROUPS = ["bottom", "top", "diagonal"]
FOREIGN, UNNAMED = "outside-training-weather", "temperature-names"
LEFT_OUT = "5 of 37\xa0records could not be compared: 5 in weather far outside"


def warned(fem, T, F, **options):
    """Severities, and the texts of all warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = identify_damage(fem, T, F, GROUPS, random_state=0, **options)
    return found.severities, [str(warning.message) for warning in caught], [warning.filename for warning in caught]


def assert_each_once(texts, kinds):
    assert len(texts) == len(kinds), texts
    for text, kind in zip(texts, kinds, strict=True):
        assert kind in text


@pytest.mark.parametrize(
    ("make_T", "kinds"),
    [
        (lambda: T, []),
        (lambda: T.to_numpy(), [UNNAMED]),
        (lambda: T.set_axis(range(3), axis=1), [UNNAMED]),
    ],
    ids=["as in fit", "arrays", "numbered columns"],
)
def test_each_kind_of_warning_comes_once(fem, make_T, kinds):
    found, texts, files = warned(fem, make_T(), F)
    assert_each_once(texts, kinds)
    assert set(files) <= {__file__}
    pd.testing.assert_series_equal(found, warned(fem, T, F)[0])


def test_frames_for_a_chain_without_names(fem, fem_of_arrays):
    found, texts, _ = warned(fem_of_arrays, T, F.to_numpy(), noise=0.01)
    assert_each_once(texts, [UNNAMED])
    np.testing.assert_allclose(found, warned(fem, T, F, noise=0.01)[0], rtol=1e-6, atol=1e-9)


@pytest.mark.filterwarnings("ignore")
def test_networks_that_have_not_converged_say_so():
    network = MLPRegressor(hidden_layer_sizes=(5,), max_iter=5, random_state=0)
    fem = DataInformedFEM(make_truss(), mapper=TemperatureMapper(network), random_state=0)
    fem.fit(YEAR.temperatures[::4], YEAR.frequencies[::4])
    with pytest.warns(ConvergenceWarning):
        identify_damage(fem, T, F, GROUPS, random_state=0)


def test_records_in_foreign_weather_are_not_compared(fem, reduced_fem):
    foreign = T.copy()
    foreign.iloc[:5] += 60
    for chain in (fem, reduced_fem):
        found, texts, _ = warned(chain, foreign, F)
        assert_each_once([text for text in texts if "outside-reduced-model" not in text], [FOREIGN, LEFT_OUT])
        pd.testing.assert_series_equal(found, warned(chain, T[5:], F[5:])[0], atol=1e-6)
    with (
        pytest.warns(UserWarning, match=FOREIGN),
        pytest.raises(ValueError, match=r"none of 37\srecords can be compared .*: 37 in weather far outside"),
    ):
        identify_damage(fem, T + 60, F, GROUPS)


def test_what_is_no_fitted_chain_is_named():
    with pytest.raises(ValueError, match=r"fem is AffineModel.*expected a fitted DataInformedFEM"):
        identify_damage(make_truss(), T, F)
    with pytest.raises(NotFittedError):
        identify_damage(DataInformedFEM(make_truss()), T, F)


@pytest.mark.filterwarnings("ignore:.*feature names")
def test_temperatures_of_other_sensors_are_errors(fem):
    with pytest.raises(ValueError, match="X has 2 features, but DataInformedFEM is expecting 3"):
        identify_damage(fem, T.to_numpy()[:, :2], F)
    with pytest.raises(ValueError, match="feature names should match"):
        identify_damage(fem, T.set_axis(list("abc"), axis=1), F)
