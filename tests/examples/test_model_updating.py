"""The example of model updating finds what it put in."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib").use("Agg")

PATH = Path(__file__).parents[2] / "examples" / "plot_model_updating.py"
SPEC = importlib.util.spec_from_file_location(PATH.stem, PATH)
EXAMPLE = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(EXAMPLE)


@pytest.fixture(scope="module")
def results():
    return EXAMPLE.update(EXAMPLE.frame(), n_starts=4)


def test_error_bars_hold_the_truth(results):
    updater = results[1]["frequencies and shapes"]
    errors = (updater.theta_ - [*EXAMPLE.TRUTH.values()]) / np.sqrt(np.diag(updater.covariance_))
    assert np.abs(errors).max() < 3


def test_shapes_make_every_parameter_more_certain(results):
    _, _, predicted = results
    alone, both = (known.deviations for known in predicted.values())
    assert (both < alone).all()
