"""The example of model updating finds what it put in."""

import numpy as np
import pytest

from tests.examples.pages import run

pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    return run("model_updating", "--starts", 4, "--figures", tmp_path_factory.mktemp("figures"))


def test_error_bars_hold_the_truth(page):
    updater = page["updaters"]["frequencies and shapes"]
    errors = (updater.theta_ - [*page["TRUTH"].values()]) / np.sqrt(np.diag(updater.covariance_))
    assert np.abs(errors).max() < 3


def test_shapes_make_every_parameter_more_certain(page):
    alone, both = (known.deviations for known in page["predicted"].values())
    assert (both < alone).all()
