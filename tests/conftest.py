"""A monitor that tests of several packages read and copy; more examples of chance at night."""

import pytest
from hypothesis import settings

from skthermo.monitoring import load_monitor
from tests.monitoring.nightly import fitted_monitor, truss_records

settings.register_profile("nightly", max_examples=200)


@pytest.fixture(scope="session")
def truss_monitor(shared_folder):
    """The monitor of the truss after its baseline, fitted once for all workers; no test changes it."""
    folder = shared_folder("monitor", lambda folder: fitted_monitor(truss_records()).save(folder / "truss.joblib"))
    return load_monitor(folder / "truss.joblib")
