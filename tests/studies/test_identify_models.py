"""Explanations averaged over an ensemble of models."""

import numpy as np
import pytest
from joblib import parallel_config
from sklearn.linear_model import LinearRegression

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.studies import identify_damage
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper

TRUSS, GROUPS = make_truss(), ["top", "diagonal"]


@pytest.fixture(scope="module")
def fem():
    year = make_truss_campaign(random_state=0)
    inverse = PosteriorInverse(noise=0.01)
    chain = DataInformedFEM(
        TRUSS,
        inverse=inverse,
        mapper=TemperatureMapper(LinearRegression()),
        aligner="passthrough",  # so that the parameters make up for a wrong model
        random_state=0,
    )
    return chain.fit(year.temperatures, year.frequencies)


@pytest.fixture(scope="module")
def later():
    campaign = make_truss_campaign(samples_per_year=120, damage={"diagonal": 0.1}, random_state=1)
    return campaign.temperatures, campaign.frequencies


@pytest.mark.nightly
def test_models_like_the_chains_own_change_nothing_and_jobs_neither(fem, later):
    alone = identify_damage(fem, *later, GROUPS, random_state=0).table
    same = identify_damage(fem, *later, GROUPS, models=[TRUSS, TRUSS], random_state=0).table
    columns = ["probability", "severity", "standard_error", "ci_low", "ci_high"]
    np.testing.assert_allclose(same[columns], alone[columns], atol=0.006)
    with parallel_config("threading"):
        again = identify_damage(fem, *later, GROUPS, models=[TRUSS, TRUSS], n_jobs=2, random_state=0).table
    np.testing.assert_array_equal(same, again)


@pytest.mark.nightly
def test_severities_are_averages_over_models_and_bands_hold_what_each_says(fem, later):
    stiff, soft = (TRUSS.with_added(stiffness=factor * of_diagonal()) for factor in (0.3, -0.2))
    found = [identify_damage(fem, *later, GROUPS, models=models, random_state=0) for models in ([stiff], [soft])]
    both = identify_damage(fem, *later, GROUPS, models=[stiff, soft], random_state=0)
    one, other = (result.table.loc["diagonal"] for result in found)
    average = both.table.loc["diagonal"]
    assert one["severity"] > 1.2 * other["severity"]
    assert average["severity"] == pytest.approx((one["severity"] + other["severity"]) / 2, rel=0.03)
    assert average["ci_high"] == pytest.approx(one["ci_high"], rel=0.05)
    assert average["ci_low"] == pytest.approx(other["ci_low"], rel=0.05)
    assert average["standard_error"] > 1.5 * max(one["standard_error"], other["standard_error"])


def of_diagonal():
    """Stiffness of the diagonals, which damage does not reduce where it is added as a constant."""
    whole, half = (model.matrices(np.ones(4))[0] for model in (TRUSS, TRUSS.damaged({"diagonal": 0.5})))
    return 2 * (whole - half)


def test_errors_say_which_models_are_expected(fem, later):
    with pytest.raises(ValueError, match="expected a list of FE models"):
        identify_damage(fem, *later, models=[])
    with pytest.raises(ValueError, match=r"model 1 of models is .* expected the chain.s"):
        identify_damage(fem, *later, models=[TRUSS, TRUSS.with_parameters(["top"])])
