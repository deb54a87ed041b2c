"""scikit-learn's laws for estimators that are bound to a model, on data that fit them."""

import functools
import pickle
from copy import deepcopy

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import Ridge

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.preprocessing import BiasAligner
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper

# A linear or quadratic inverse scatters with the noise, and folds of contiguous rows predict weather not seen.
pytestmark = pytest.mark.filterwarnings("ignore:.*(outside-bounds|other-weather)")

TRUSS = make_truss()
YEAR = make_truss_campaign(random_state=0)
T, F = YEAR.temperatures, YEAR.frequencies
NOMINAL = TRUSS.frequencies(np.ones((1, 4)))[0]
INVERSE = InverseSurrogate(TRUSS, Ridge(), bounds=0.2, n_samples=100, noise=0.01, random_state=0)
CHAIN = DataInformedFEM(TRUSS, inverse=INVERSE, mapper=TemperatureMapper(Ridge()), aligner=BiasAligner(NOMINAL))

CASES = {
    "BiasAligner(vector)": (BiasAligner(NOMINAL), (F,), "transform"),
    "BiasAligner(model)": (BiasAligner(TRUSS, method="scale"), (F,), "transform"),
    "InverseSurrogate(model)": (INVERSE, (F,), "transform"),
    "DataInformedFEM": (CHAIN, (T, F), "predict"),
}


@functools.cache
def fitted(name):
    """The estimator of a case, fitted, and its output for the records; not to be changed."""
    estimator, data, method = CASES[name]
    estimator = clone(estimator).fit(*data)
    return estimator, getattr(estimator, method)(data[0])


def output(name):
    """The output for the records of an estimator that is fitted anew."""
    return fitted.__wrapped__(name)[1]


@pytest.mark.parametrize("name", CASES)
class TestLaws:
    def test_clone_has_equal_parameters_and_shares_the_model(self, name):
        estimator, data, method = CASES[name]
        twin = clone(fitted(name)[0])
        assert repr(twin) == repr(estimator)
        with pytest.raises(NotFittedError):
            getattr(twin, method)(data[0])
        for part in ("model", "reference"):
            if getattr(estimator, part, None) is TRUSS:
                assert getattr(twin, part) is TRUSS

    def test_fit_returns_itself_is_idempotent_and_leaves_parameters_and_data_alone(self, name):
        estimator, data, method = CASES[name]
        fresh, before = clone(estimator), [table.copy() for table in data]
        parameters = {key: repr(value) for key, value in fresh.get_params().items()}
        assert fresh.fit(*data) is fresh
        first = getattr(fresh, method)(data[0])
        np.testing.assert_array_equal(getattr(fresh.fit(*data), method)(data[0]), first)
        assert {key: repr(value) for key, value in fresh.get_params().items()} == parameters
        for table, copy in zip(data, before, strict=True):
            np.testing.assert_array_equal(table, copy)

    def test_fitting_anew_forgets(self, name):
        estimator, data, method = CASES[name]
        half = [table.iloc[:180] for table in data]
        refitted = clone(estimator).fit(*half).fit(*data)
        np.testing.assert_array_equal(getattr(refitted, method)(data[0]), fitted(name)[1])

    def test_pickle_and_deepcopy_keep_outputs(self, name):
        _, data, method = CASES[name]
        estimator, expected = fitted(name)
        for twin in (pickle.loads(pickle.dumps(estimator)), deepcopy(estimator)):
            np.testing.assert_array_equal(getattr(twin, method)(data[0]), expected)

    def test_parameters_can_be_set_and_read(self, name):
        fresh = clone(CASES[name][0])
        parameters = fresh.get_params(deep=False)
        assert fresh.set_params(**parameters) is fresh
        with pytest.raises(ValueError, match="Invalid parameter 'no_such'"):
            fresh.set_params(no_such=1)

    def test_names_and_number_of_features_are_remembered(self, name):
        estimator, data, method = CASES[name]
        learned, _ = fitted(name)
        assert list(learned.feature_names_in_) == list(data[0].columns)
        assert learned.n_features_in_ == data[0].shape[1]
        with pytest.raises(ValueError, match="feature names"):
            getattr(learned, method)(data[0].rename(columns=lambda column: column + "!"))
        of_arrays = clone(estimator).fit(*[table.to_numpy() for table in data])
        with pytest.raises(ValueError, match="features"):
            getattr(of_arrays, method)(data[0].to_numpy()[:, :2])

    def test_rows_are_independent_and_their_order_is_kept(self, name):
        _, data, method = CASES[name]
        estimator, whole = fitted(name)
        shuffled = data[0].sample(frac=1, random_state=0)
        rtol = 1e-10  # rounding errors of one row and of many differ, and steps of a refinement carry them on
        np.testing.assert_allclose(getattr(estimator, method)(shuffled), whole.loc[shuffled.index], rtol=rtol)
        np.testing.assert_allclose(getattr(estimator, method)(data[0].iloc[:1]), whole.iloc[:1], rtol=rtol)

    def test_read_only_input_serves(self, name):
        estimator, data, method = CASES[name]
        arrays = [table.to_numpy(copy=True) for table in data]
        for array in arrays:
            array.flags.writeable = False
        result = getattr(clone(estimator).fit(*arrays), method)(arrays[0])
        np.testing.assert_allclose(result, fitted(name)[1], rtol=1e-12)


def test_output_names_of_transformers():
    assert list(clone(INVERSE).fit(F).get_feature_names_out()) == list(TRUSS.parameter_names)
    assert list(BiasAligner(NOMINAL).fit(F).get_feature_names_out()) == list(F.columns)
    plain = clone(INVERSE).set_output(transform="pandas").fit(F.to_numpy()).transform(F.to_numpy())
    assert list(plain.columns) == list(TRUSS.parameter_names)
