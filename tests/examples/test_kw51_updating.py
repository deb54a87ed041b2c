"""The updating of KW51: modes followed, a false match refused."""

import numpy as np
import pytest

from skthermo.datasets import make_kw51
from tests.examples.pages import recipes

EXAMPLE = recipes("kw51_appendix")

pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def tracked():
    """The bridge within the widest limits."""
    return EXAMPLE.bridge(True, EXAMPLE.bounds(E_bot=0.3))


@pytest.fixture(scope="module")
def followed(tracked):
    return EXAMPLE.update(tracked, EXAMPLE.bounds(), 2)


def mean_error(updater, when="after"):
    return updater.table_[f"error_{when}"].abs().mean()


def test_the_design_variables_are_those_of_the_model(tracked):
    theta = np.linspace(0.9, 1.1, 11)
    model = make_kw51(list(EXAMPLE.DESIGN))
    for ours, theirs in zip(tracked.matrices(theta), model.matrices(theta), strict=True):
        np.testing.assert_allclose(ours.toarray(), theirs.toarray(), rtol=1e-9)


def test_updating_brings_the_model_to_the_measured_frequencies(tracked, followed):
    followed, _ = followed
    wide, _ = EXAMPLE.update(tracked, EXAMPLE.bounds(E_bot=0.3), 1)
    assert mean_error(followed, "before") > 6
    assert mean_error(followed) < 2.5
    assert mean_error(wide) < 1.2
    assert (followed.starts_["optimum"] == 0).all()
    assert np.isinf(np.diag(followed.covariance_)).any()  # six frequencies cannot tell eleven parameters


def test_the_better_fit_of_sorted_modes_is_refused(followed):
    followed, messages = followed
    false, refused = EXAMPLE.update(EXAMPLE.bridge(False, EXAMPLE.bounds()), EXAMPLE.bounds(), 2)
    assert false.starts_["objective"].min() < followed.starts_["objective"].min()
    assert not messages
    assert len(refused) == 1
    assert "['f4', 'f5']" in refused[0]
