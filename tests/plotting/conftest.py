"""A fitted chain, and figures that are closed after each test."""

import matplotlib.pyplot as plt
import pytest

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.surrogate import DataInformedFEM


@pytest.fixture(autouse=True)
def _close_figures():
    yield
    plt.close("all")


@pytest.fixture(scope="session")
def year():
    return make_truss_campaign(random_state=0)


@pytest.fixture(scope="session")
def later():
    return make_truss_campaign(random_state=1)


@pytest.fixture(scope="session")
def fem(year):
    return DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
