"""Chains fitted to one year of the truss, which all tests of studies share; no test changes them."""

import pytest
from sklearn.linear_model import LinearRegression

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper


def fitted(as_arrays=False, every=1, **options):
    year = make_truss_campaign(random_state=0)
    records = year.temperatures[::every], year.frequencies[::every]
    T, F = (table.to_numpy() for table in records) if as_arrays else records
    inverse = PosteriorInverse(noise=0.01)
    return DataInformedFEM(make_truss(), inverse=inverse, random_state=0, **options).fit(T, F)


@pytest.fixture(scope="session")
def fem():
    return fitted()


@pytest.fixture(scope="session")
def fem_of_arrays():
    """A chain of every third record, fitted to tables without names."""
    return fitted(as_arrays=True, every=3)


@pytest.fixture(scope="session")
def fem_of_few():
    """A chain of every third record, with a regression that is fitted quickly."""
    return fitted(every=3, mapper=TemperatureMapper(LinearRegression()))


@pytest.fixture(scope="session")
def reduced_fem():
    """The same chain with a reduced model."""
    return fitted(reduce=True)
