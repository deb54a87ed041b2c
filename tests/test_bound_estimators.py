"""scikit-learn's laws for estimators that are bound to a model, on data that fit them."""

import pickle
from copy import deepcopy

import joblib
import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import Ridge

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.preprocessing import BiasAligner
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper

# A linear or quadratic inverse scatters with the noise, and folds of contiguous rows predict weather not seen.
pytestmark = pytest.mark.filterwarnings(r"ignore:\d+ of \d+ rows (give parameters|have temperatures) far outside")

TRUSS = make_truss()
YEAR = make_truss_campaign(random_state=0)
T, F = YEAR.temperatures, YEAR.frequencies
NOMINAL = TRUSS.frequencies(np.ones((1, 4)))[0]
INVERSE = InverseSurrogate(TRUSS, Ridge(), bounds=0.2, n_samples=100, noise=0.01, random_state=0)
CHAIN = DataInformedFEM(TRUSS, inverse=INVERSE, mapper=TemperatureMapper(Ridge()), aligner=BiasAligner(NOMINAL))

CASES = [
    pytest.param(BiasAligner(NOMINAL), (F,), "transform", id="BiasAligner(vector)"),
    pytest.param(BiasAligner(TRUSS, method="scale"), (F,), "transform", id="BiasAligner(model)"),
    pytest.param(INVERSE, (F,), "transform", id="InverseSurrogate(model)"),
    pytest.param(CHAIN, (T, F), "predict", id="DataInformedFEM"),
]


@pytest.mark.parametrize(("estimator", "data", "method"), CASES)
class TestLaws:
    def output(self, estimator, data, method):
        return getattr(clone(estimator).fit(*data), method)(data[0])

    def test_clone_has_equal_parameters_and_shares_the_model(self, estimator, data, method):
        twin = clone(clone(estimator).fit(*data))
        assert repr(twin) == repr(estimator)
        with pytest.raises(NotFittedError):
            getattr(twin, method)(data[0])
        for name in ("model", "reference"):
            if getattr(estimator, name, None) is TRUSS:
                assert getattr(twin, name) is TRUSS

    def test_fit_returns_itself_is_idempotent_and_leaves_parameters_and_data_alone(self, estimator, data, method):
        fresh, before = clone(estimator), [table.copy() for table in data]
        parameters = {name: repr(value) for name, value in fresh.get_params().items()}
        assert fresh.fit(*data) is fresh
        first = getattr(fresh, method)(data[0])
        np.testing.assert_array_equal(getattr(fresh.fit(*data), method)(data[0]), first)
        assert {name: repr(value) for name, value in fresh.get_params().items()} == parameters
        for table, copy in zip(data, before, strict=True):
            np.testing.assert_array_equal(table, copy)

    def test_fitting_anew_forgets(self, estimator, data, method):
        half = [table.iloc[:180] for table in data]
        refitted = clone(estimator).fit(*half).fit(*data)
        np.testing.assert_array_equal(getattr(refitted, method)(data[0]), self.output(estimator, data, method))

    def test_pickle_and_deepcopy_keep_outputs(self, estimator, data, method):
        fitted = clone(estimator).fit(*data)
        expected = getattr(fitted, method)(data[0])
        for twin in (pickle.loads(pickle.dumps(fitted)), deepcopy(fitted)):
            np.testing.assert_array_equal(getattr(twin, method)(data[0]), expected)

    def test_parameters_can_be_set_and_read(self, estimator, data, method):
        fresh = clone(estimator)
        parameters = fresh.get_params(deep=False)
        assert fresh.set_params(**parameters) is fresh
        with pytest.raises(ValueError, match="Invalid parameter 'no_such'"):
            fresh.set_params(no_such=1)

    def test_names_and_number_of_features_are_remembered(self, estimator, data, method):
        fitted = clone(estimator).fit(*data)
        assert list(fitted.feature_names_in_) == list(data[0].columns)
        assert fitted.n_features_in_ == data[0].shape[1]
        with pytest.raises(ValueError, match="feature names"):
            getattr(fitted, method)(data[0].rename(columns=lambda name: name + "!"))
        with pytest.raises(ValueError, match="features"):
            clone(estimator).fit(*[t.to_numpy() for t in data]).__getattribute__(method)(data[0].to_numpy()[:, :2])

    def test_rows_are_independent_and_their_order_is_kept(self, estimator, data, method):
        fitted = clone(estimator).fit(*data)
        whole = getattr(fitted, method)(data[0])
        shuffled = data[0].sample(frac=1, random_state=0)
        rtol = 1e-10  # rounding errors of one row and of many differ, and steps of a refinement carry them on
        np.testing.assert_allclose(getattr(fitted, method)(shuffled), whole.loc[shuffled.index], rtol=rtol)
        np.testing.assert_allclose(getattr(fitted, method)(data[0].iloc[:1]), whole.iloc[:1], rtol=rtol)

    def test_read_only_input_serves(self, estimator, data, method):
        arrays = [table.to_numpy(copy=True) for table in data]
        for array in arrays:
            array.flags.writeable = False
        result = getattr(clone(estimator).fit(*arrays), method)(arrays[0])
        np.testing.assert_allclose(result, self.output(estimator, data, method), rtol=1e-12)

    def test_two_processes_give_the_bits_of_one(self, estimator, data, method):
        expected = self.output(estimator, data, method)
        results = joblib.Parallel(n_jobs=2)(joblib.delayed(self.output)(estimator, data, method) for _ in range(2))
        for result in results:
            np.testing.assert_array_equal(result, expected)


def test_output_names_of_transformers():
    assert list(clone(INVERSE).fit(F).get_feature_names_out()) == list(TRUSS.parameter_names)
    assert list(BiasAligner(NOMINAL).fit(F).get_feature_names_out()) == list(F.columns)
    plain = clone(INVERSE).set_output(transform="pandas").fit(F.to_numpy()).transform(F.to_numpy())
    assert list(plain.columns) == list(TRUSS.parameter_names)
