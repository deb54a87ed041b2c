"""Drift of groups over years: what is there is found, and what is not there is not claimed."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import AffineModel, add_noise
from skthermo.monitoring import track_parameters
from skthermo.surrogate import DataInformedFEM

GROUPS = ["bottom", "top", "diagonal"]


def trained(campaign, n_days=365):
    T, F = campaign.temperatures, campaign.frequencies
    return DataInformedFEM(make_truss(), random_state=0).fit(T[:n_days], F[:n_days])


@pytest.fixture(scope="module")
def ageing():
    """Three years of a truss that loses 2 % of its bottom chord a year, and a chain of the first year."""
    campaign = make_truss_campaign(3, drift={"bottom": 0.02}, random_state=0)
    return campaign, trained(campaign)


@pytest.fixture(scope="module")
def history(ageing):
    campaign, fem = ageing
    return track_parameters(fem, campaign.temperatures, campaign.frequencies, GROUPS)


@pytest.fixture(scope="module")
def healthy():
    campaign = make_truss_campaign(2, random_state=1)
    return campaign, trained(campaign)


def test_a_known_drift_is_recovered(history):
    truth = 1 - 0.02 * np.arange(len(history.days)) / 365
    table, rate = history.table["bottom"], history.rates.loc["bottom"]
    assert history.has_drift
    assert history.explanations["groups"].iloc[0] == ("bottom",)
    assert abs(table["estimate"].iloc[-1] - truth[-1]) < 2.5 * rate["change_error"]
    assert ((table["ci_low"] <= truth) & (truth <= table["ci_high"])).mean() > 0.9
    others = dict.fromkeys(["top", "diagonal", "all groups"], "no sign")
    assert history.rates["drifts"].to_dict() == {"bottom": "yes"} | others
    assert "bottom loses" in history.summary()
    assert "bottom" in repr(history)
    modes = history.modes
    assert_allclose(modes["measured"], modes["explained"], atol=4 * modes["standard_error"].max())


def test_without_drift_none_is_claimed(healthy):
    campaign, fem = healthy
    found = track_parameters(fem, campaign.temperatures, campaign.frequencies, GROUPS)
    assert not found.has_drift
    assert set(found.rates["drifts"]) == {"no sign"}
    assert (found.rates["detectable_rates"] > 0).all()
    assert found.summary().startswith("No significant drift")
    pd.testing.assert_frame_equal(found.remove_drift(campaign.frequencies), campaign.frequencies)
    bands = found.table.iloc[-1].unstack()
    assert ((bands["ci_low"] < 1) & (bands["ci_high"] > 1)).all()


@pytest.mark.nightly
def test_noise_that_lasts_for_weeks_is_no_drift():
    """A disturbance of 40 days, such as moisture, and little noise beside it: without allowance all would drift."""
    campaign, random = make_truss_campaign(2, noise=0.001, random_state=2), np.random.default_rng(0)
    T, F, fem = campaign.temperatures, campaign.frequencies, trained(campaign)
    claimed = 0
    for _ in range(10):
        slow = pd.Series(random.normal(size=len(F) + 400)).ewm(halflife=28, adjust=False).mean()[400:]
        wet = F.mul(np.exp(0.002 * slow / slow.std()).to_numpy(), axis=0)
        claimed += track_parameters(fem, T, wet, GROUPS).has_drift
    assert claimed <= 1


def test_one_year_is_reported_with_wide_bands(ageing):
    campaign, fem = ageing
    found = track_parameters(fem, campaign.temperatures[:365], campaign.frequencies[:365], GROUPS)
    bottom = found.table["bottom"].iloc[-1]
    assert bottom["ci_low"] < 0.98 < bottom["ci_high"]
    assert "Records of 1.0 years" in found.summary()


def test_removed_drift_leaves_the_weather(ageing, history):
    campaign, _ = ageing
    steady = make_truss_campaign(3, random_state=0).clean_frequencies
    removed = history.remove_drift(campaign.clean_frequencies)
    before = np.abs(campaign.clean_frequencies / steady - 1).to_numpy()[-1].max()
    assert np.abs(removed / steady - 1).to_numpy()[-1].max() < 0.25 * before


def test_a_limit_is_reached_when_the_rate_says(history):
    reached = history.reaches(-0.2).loc["bottom"]
    assert reached["earliest"] < reached["date"] < reached["latest"]
    expected = history.days[0] + pd.Timedelta(days=365 * 10)
    assert abs(reached["date"] - expected) < pd.Timedelta(days=365)  # ln stiffness goes on, not stiffness
    assert reached["probability"] > 0.9
    past = history.reaches(-0.03).loc["bottom", "date"]
    assert abs(past - (history.days[0] + pd.Timedelta(days=547))) < pd.Timedelta(days=120)
    with pytest.raises(ValueError, match="limit is 0"):
        history.reaches(0)


def test_order_of_groups_and_of_rows_does_not_matter(ageing, history):
    campaign, fem = ageing
    mixed = np.random.RandomState(0).permutation(len(campaign.temperatures))
    T, F = campaign.temperatures.iloc[mixed], campaign.frequencies.iloc[mixed]
    other = track_parameters(fem, T, F, GROUPS[::-1], "7D")
    assert_allclose(other.table["bottom"], history.table["bottom"][::7], rtol=1e-9)
    assert_allclose(other.p_value, history.p_value, rtol=1e-6)


def test_days_and_modes_may_be_missing_and_a_mode_that_is_hardly_measured_is_left_out(ageing, history):
    campaign, fem = ageing
    T, F = campaign.temperatures, campaign.frequencies.copy()
    F.iloc[10:, 1] = np.nan
    found = track_parameters(fem, T, F, GROUPS)
    assert "Measured on too few days to be used: f2." in found.summary()
    F.iloc[400:600] = np.nan
    F.iloc[::2, 0] = np.nan
    kept = np.r_[0:700, 720 : len(F)]
    for one in (found, track_parameters(fem, T.iloc[kept], F.iloc[kept], GROUPS)):
        assert len(one.days) == len(history.days)
        assert one.explanations["groups"].iloc[0] == ("bottom",)
        rate, last = one.rates.loc["bottom"], one.table["bottom"].iloc[-1]
        assert_allclose(rate["per_year"], -0.02, atol=3 * rate["standard_error"])
        assert last["ci_low"] < 1 - 0.02 * (len(one.days) - 1) / 365 < last["ci_high"]
    with pytest.raises(ValueError, match="too few days"):
        track_parameters(fem, T[:20], F[:20])


@pytest.mark.nightly
def test_mirror_images_are_named_together():
    """Springs in a row between two walls: no frequency tells the first from the last."""
    elongations = np.vstack([np.eye(5)[0], np.diff(np.eye(5), axis=0), -np.eye(5)[-1]])
    stiffness = {(f"k{k}",): 1e4 * np.outer(one, one) for k, one in enumerate(elongations, 1)}
    model = AffineModel(stiffness, np.eye(5), n_modes=4)
    days = pd.date_range("2025-01-01", periods=730)
    random = np.random.RandomState(0)
    T = pd.DataFrame({"T": 12 * np.sin(2 * np.pi * np.arange(730) / 365) + random.normal(0, 3, 730)}, days)
    theta = np.tile(1 - 0.002 * T.to_numpy(), (1, 6))
    theta[:, 0] *= 1 - 0.02 * np.arange(730) / 365
    F = pd.DataFrame(add_noise(model.frequencies(theta), 0.003, random_state=random), days, list("abcd"))
    fem = DataInformedFEM(model, random_state=0).fit(T[:365], F[:365])
    history = track_parameters(fem, T, F)
    assert (history.rates.loc[["k1", "k6"], "drifts"] == "perhaps").all()
    assert history.alternatives == {"k1": ["k1", "k6"]} or history.alternatives == {"k6": ["k1", "k6"]}
    assert_allclose(history.rates.loc["k1", "per_year"], -0.02, atol=3 * history.rates.loc["k1", "standard_error"])
