"""What a fleet tells of a new bridge."""

import pytest
from numpy.testing import assert_allclose

from skthermo.fleet import FleetPrior
from tests.fleet.prior.fleets import records


@pytest.fixture(scope="module")
def prior():
    return FleetPrior().fit({f"bridge {seed}": records(seed)[:2] for seed in range(12)})


def test_a_fleet_of_one_law_is_pooled(prior):
    assert prior.comparison_["is_pooled"].all()
    assert (prior.bridges_["follows"] > 0.9).all()


def test_a_unit_changes_nothing_but_the_level(prior):
    T, F, _ = records(50, 40)
    hertz, rpm = (prior.mapper().fit(T, F * unit) for unit in (1.0, 60.0))
    assert_allclose(rpm.predict(T), 60 * hertz.predict(T))
    assert_allclose(rpm.predict_covariance(T), 3600 * hertz.predict_covariance(T))
