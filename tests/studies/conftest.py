"""Chains fitted to one year of the truss, which all tests of studies share; no test changes them."""

import pytest

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.surrogate import DataInformedFEM, PosteriorInverse


def fitted(as_arrays=False, **options):
    year = make_truss_campaign(random_state=0)
    records = year.temperatures, year.frequencies
    T, F = (table.to_numpy() for table in records) if as_arrays else records
    inverse = PosteriorInverse(noise=0.01)
    return DataInformedFEM(make_truss(), inverse=inverse, random_state=0, **options).fit(T, F)


@pytest.fixture(scope="session")
def fem():
    return fitted()


@pytest.fixture(scope="session")
def fem_of_arrays():
    """The same chain, fitted to tables without names."""
    return fitted(as_arrays=True)


@pytest.fixture(scope="session")
def reduced_fem():
    """The same chain with a reduced model."""
    return fitted(reduce=True)
