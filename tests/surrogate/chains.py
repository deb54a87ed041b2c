"""A small chain and its records, for tests."""

import functools
import warnings

import numpy as np
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.preprocessing import BiasAligner, LagFeatures
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, PosteriorInverse, TemperatureMapper

TRUSS = make_truss()
YEAR = make_truss_campaign(random_state=0)
T, F = YEAR.temperatures, YEAR.frequencies


def inverse(**options):
    return PosteriorInverse(**({"model": TRUSS, "noise": 0.01, "prior": 0.05} | options))


def trained(**options):
    """An inverse that is trained on simulations."""
    quadratic = make_pipeline(PolynomialFeatures(2), Ridge(1e-6))
    settings = {"bounds": 0.2, "n_samples": 200, "noise": 0.01, "random_state": 3}
    return InverseSurrogate(**({"model": TRUSS, "regressor": quadratic} | settings | options))


def mapper(lags=2):
    return make_pipeline(LagFeatures(lags), TemperatureMapper(LinearRegression()))


def chain(**options):
    defaults = {"inverse": inverse(), "mapper": mapper(), "aligner": BiasAligner(TRUSS)}
    return DataInformedFEM(TRUSS, **(defaults | options))


@functools.cache
def fitted():
    """The chain that all tests share; none changes it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return chain().fit(T, F)


def as_measured(fem, frequencies, temperatures):
    """Frequencies of the FE model in the measured domain, times the discrepancy in the weather."""
    return fem.aligner_.inverse_transform(np.asarray(frequencies)) * np.exp(fem.discrepancy_(temperatures))
