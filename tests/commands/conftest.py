"""A truss with a monitor made by commands alone, which no test changes."""

import pytest

from tests.commands.folders import made_bridge
from tests.monitoring.nightly import truss_records


@pytest.fixture
def one_detector(monkeypatch):
    """``init`` need not choose a detector where its files are what matters."""
    one = {"kind": "MahalanobisDetector", "compensator": {}, "text": "each record for itself", "said": "", "size": 1.0}
    monkeypatch.setattr("skthermo.commands._proposal.Proposal.detectors", [one])


@pytest.fixture(scope="session")
def records():
    records = truss_records()
    return records.set_axis(records.index.as_unit("ns").rename(None))


@pytest.fixture(scope="session")
def fitted(shared_folder, records):
    """The folder of the truss, whose monitor is fitted to two years."""
    return shared_folder("commands", lambda folder: made_bridge(folder, records)) / "bridge"
