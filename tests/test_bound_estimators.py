"""scikit-learn's laws for estimators that are bound to a model, on data that fit them."""

import functools
import pickle
from copy import deepcopy

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError

from skthermo.preprocessing import BiasAligner
from tests.estimators import CHAIN, LINEAR, NOMINAL, TRUSS, F, T

# A linear inverse scatters with the noise, and folds of contiguous rows predict weather not seen.
pytestmark = pytest.mark.filterwarnings("ignore:.*(outside-bounds|other-weather|few-records)")
ALIGNED = clone(CHAIN).set_params(aligner=BiasAligner(NOMINAL))
CASES = {
    "BiasAligner(vector)": (BiasAligner(NOMINAL), (F,), "transform"),
    "BiasAligner(model)": (BiasAligner(TRUSS, method="scale"), (F,), "transform"),
    "InverseSurrogate(model)": (LINEAR, (F,), "transform"),
    "DataInformedFEM": (ALIGNED, (T, F), "predict"),
}


@functools.cache
def fitted(name):
    """The estimator of a case, fitted, and its output for the records; not to be changed."""
    estimator, data, method = CASES[name]
    estimator = clone(estimator).fit(*data)
    return estimator, getattr(estimator, method)(data[0])


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

    def test_fit_returns_itself_forgets_and_leaves_parameters_and_data_alone(self, name):
        estimator, data, method = CASES[name]
        fresh, before = clone(estimator), [table.copy() for table in data]
        parameters = {key: repr(value) for key, value in fresh.get_params().items()}
        assert fresh.fit(*[table.iloc[:60] for table in data]).fit(*data) is fresh
        np.testing.assert_array_equal(getattr(fresh, method)(data[0]), fitted(name)[1])
        assert {key: repr(value) for key, value in fresh.get_params().items()} == parameters
        for table, copy in zip(data, before, strict=True):
            np.testing.assert_array_equal(table, copy)

    def test_pickle_and_deepcopy_keep_outputs(self, name):
        _, data, method = CASES[name]
        estimator, expected = fitted(name)
        for twin in (pickle.loads(pickle.dumps(estimator)), deepcopy(estimator)):
            np.testing.assert_array_equal(getattr(twin, method)(data[0]), expected)

    def test_names_and_number_of_features_are_remembered_and_read_only_input_serves(self, name):
        estimator, data, method = CASES[name]
        learned, expected = fitted(name)
        assert list(learned.feature_names_in_) == list(data[0].columns)
        assert learned.n_features_in_ == data[0].shape[1]
        with pytest.raises(ValueError, match="feature names"):
            getattr(learned, method)(data[0].rename(columns=lambda column: column + "!"))
        arrays = [table.to_numpy(copy=True) for table in data]
        for array in arrays:
            array.flags.writeable = False
        of_arrays = clone(estimator).fit(*arrays)
        np.testing.assert_allclose(getattr(of_arrays, method)(arrays[0]), expected, rtol=1e-12)
        with pytest.raises(ValueError, match="features"):
            getattr(of_arrays, method)(arrays[0][:, :2])

    def test_rows_are_independent_and_their_order_is_kept(self, name):
        _, data, method = CASES[name]
        estimator, whole = fitted(name)
        shuffled = data[0].sample(frac=1, random_state=0)
        rtol = 1e-10  # rounding errors of one row and of many differ, and steps of a refinement carry them on
        np.testing.assert_allclose(getattr(estimator, method)(shuffled), whole.loc[shuffled.index], rtol=rtol)
        np.testing.assert_allclose(getattr(estimator, method)(data[0].iloc[:1]), whole.iloc[:1], rtol=rtol)


def test_output_names_of_transformers():
    inverse = fitted("InverseSurrogate(model)")[0]
    assert list(inverse.get_feature_names_out()) == list(TRUSS.parameter_names)
    assert list(fitted("BiasAligner(vector)")[0].get_feature_names_out()) == list(F.columns)
    plain = clone(LINEAR).set_output(transform="pandas").fit(F.to_numpy()).transform(F.to_numpy())
    assert list(plain.columns) == list(TRUSS.parameter_names)
