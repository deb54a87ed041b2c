"""A monitor that tests of several packages read and copy. The package is imported where it is needed: the process that
only hands out tests does without it."""

import pytest


@pytest.fixture(scope="session")
def truss_monitor(shared_folder):
    """The monitor of the truss after its baseline, fitted once for all workers; no test changes it."""
    from skthermo.monitoring import load_monitor
    from tests.monitoring.nightly import fitted_monitor, truss_records

    folder = shared_folder("monitor", lambda folder: fitted_monitor(truss_records()).save(folder / "truss.joblib"))
    return load_monitor(folder / "truss.joblib")
