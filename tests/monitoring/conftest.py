"""Records of the truss, and its monitor after the baseline, which a test may change."""

import copy

import pytest

from tests.monitoring.nightly import truss_records


@pytest.fixture(scope="session")
def records():
    return truss_records()


@pytest.fixture
def monitor(truss_monitor):
    return copy.deepcopy(truss_monitor)
