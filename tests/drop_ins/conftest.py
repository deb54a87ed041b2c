"""What recipes need to run."""

import pytest


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working directory, for what recipes write."""
    monkeypatch.chdir(tmp_path)
    return tmp_path
