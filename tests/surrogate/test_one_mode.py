"""Chains of one mode, which learn a vector of frequencies as scikit-learn's regressors do."""

from functools import cache

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.model_selection import KFold

from skthermo.detection import TemperatureCompensator
from skthermo.fem import AffineModel
from skthermo.plotting import PredictionDisplay
from skthermo.surrogate import DataInformedFEM, refitted, resampled
from tests.surrogate.chains import TRUSS, YEAR

T, F = YEAR.temperatures[::4], YEAR.frequencies[::4]
CHAIN = DataInformedFEM(AffineModel({("stiffness",): [[(15 * np.pi) ** 2]]}, [[1.0]], n_modes=1), random_state=0)


@cache
def of_vector():
    return clone(CHAIN).fit(T, F["f1"])


@cache
def of_table():
    return clone(CHAIN).fit(T, F[["f1"]])


def test_a_vector_gives_the_vectors_of_a_table_of_one_column():
    def values(chain):
        return chain.predict(T), *chain.predict(T, return_std=True), *chain.predict_interval(T)

    for vector, table in zip(values(of_vector()), values(of_table()), strict=True):
        assert type(vector) is np.ndarray
        assert list(table) == ["f1"]
        np.testing.assert_array_equal(vector, table["f1"])
    for one, other in (
        (of_vector(), of_table()),
        (refitted(of_vector()), refitted(of_table())),
        (resampled(of_vector(), 0), resampled(of_table(), 0)),
    ):
        np.testing.assert_array_equal(one.predict(T), other.predict(T)["f1"])
    pd.testing.assert_frame_equal(of_vector().simulate(T), of_table().simulate(T))


def test_names_come_from_the_series():
    names = [clone(CHAIN).fit(T, F["f1"].rename(name)).mode_names_ for name in (None, "bending")]
    assert [of_vector().mode_names_, *names] == [["f1"], ["f1"], ["bending"]]
    with pytest.raises(ValueError, match="1 columns for 6 modes"):
        DataInformedFEM(TRUSS).fit(T, F["f1"])


def test_compensators_and_displays_take_it():
    compensated = TemperatureCompensator(CHAIN, targets=["f1"], cv=KFold(2, shuffle=True, random_state=0)).fit(
        T.join(F[["f1"]])
    )
    counted = compensated.transform(T.join(F[["f1"]]))["f1"] / np.log(F["f1"] / of_vector().predict(T))
    assert (counted < 1 + 1e-9).all()  # less where the chain is less certain than usual
    assert (counted > 1 - 1e-9).mean() > 0.5
    PredictionDisplay.from_estimator(of_vector(), T, F["f1"], confidence=0.9)
