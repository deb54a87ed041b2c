"""Drift of groups: the filter and smoother are exact, what is there is found, and what is not there is not claimed."""

import warnings
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from sklearn.exceptions import NotFittedError

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import AffineModel, add_noise
from skthermo.monitoring import track_parameters
from skthermo.monitoring.drift import DriftFollower
from skthermo.surrogate import DataInformedFEM

GROUPS = ["bottom", "top", "diagonal"]
WEEK = "7D"


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
    return track_parameters(fem, campaign.temperatures, campaign.frequencies, GROUPS, WEEK, random_state=0)


@pytest.fixture(scope="module")
def healthy():
    campaign = make_truss_campaign(2, random_state=1)
    return campaign, trained(campaign)


def test_a_known_drift_is_recovered(history):
    truth = 1 - 0.02 * 7 * np.arange(len(history.days)) / 365
    table, rate = history.table["bottom"], history.rates.loc["bottom"]
    assert history.has_drift
    assert history.explanations["groups"].iloc[0] == ("bottom",)
    assert abs(table["estimate"].iloc[-1] - truth[-1]) < 2.5 * rate["change_error"]
    assert ((table["ci_low"] <= truth) & (truth <= table["ci_high"])).mean() > 0.9
    assert history.rates["drifts"].to_dict() == {"bottom": "yes", "top": "no sign", "diagonal": "no sign"} | {
        "all groups": "no sign"
    }
    assert "bottom loses" in history.summary()
    assert "bottom" in repr(history)
    assert_allclose(history.modes.table["measured"], history.modes.table["explained"], atol=0.02)


def test_without_drift_none_is_claimed(healthy):
    campaign, fem = healthy
    found = track_parameters(fem, campaign.temperatures, campaign.frequencies, GROUPS, WEEK, random_state=0)
    assert not found.has_drift
    assert set(found.rates["drifts"]) == {"no sign"}
    assert (found.resolution.detectable_rates > 0).all()
    assert found.summary().startswith("No significant drift")
    pd.testing.assert_frame_equal(found.remove_drift(campaign.frequencies), campaign.frequencies)
    bands = found.table.iloc[-1].unstack()
    assert ((bands["ci_low"] < 1) & (bands["ci_high"] > 1)).all()


def test_one_year_is_reported_with_wide_bands(ageing):
    campaign, fem = ageing
    T, F = campaign.temperatures[:365], campaign.frequencies[:365]
    found = track_parameters(fem, T, F, GROUPS, WEEK, random_state=0)
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
    assert reached["earliest"] < expected < reached["latest"]
    past = history.reaches(-0.03).loc["bottom", "date"]
    assert abs(past - (history.days[0] + pd.Timedelta(days=547))) < pd.Timedelta(days=120)
    with pytest.raises(ValueError, match="limit is 0"):
        history.reaches(0)


def test_order_of_groups_and_of_rows_does_not_matter(ageing, history):
    campaign, fem = ageing
    mixed = np.random.RandomState(0).permutation(len(campaign.temperatures))
    T, F = campaign.temperatures.iloc[mixed], campaign.frequencies.iloc[mixed]
    other = track_parameters(fem, T, F, GROUPS[::-1], WEEK, random_state=0)
    assert_allclose(other.table["bottom"], history.table["bottom"], rtol=1e-5)
    assert other.p_value == history.p_value


def test_days_and_modes_may_be_missing(ageing, history):
    campaign, fem = ageing
    F = campaign.frequencies.copy()
    F.iloc[400:600] = np.nan
    F.iloc[::2, 0] = np.nan
    kept = np.r_[0:700, 720 : len(F)]
    found = track_parameters(fem, campaign.temperatures.iloc[kept], F.iloc[kept], GROUPS, WEEK, random_state=0)
    assert len(found.days) == len(history.days)
    table = found.table["bottom"]
    assert found.has_drift
    assert found.explanations["groups"].iloc[0] == ("bottom",)
    assert table["ci_low"].iloc[-1] < 1 - 0.02 * 7 * (len(found.days) - 1) / 365 < table["ci_high"].iloc[-1]


def test_filled_temperatures_are_reported_once(healthy):
    campaign, fem = healthy
    T, F = campaign.temperatures.copy(), campaign.frequencies
    T.iloc[30:50, 0] = np.nan
    for follow in (lambda: track_parameters(fem, T, F, GROUPS, WEEK), lambda: DriftFollower.of(fem, T, F, GROUPS)):
        with pytest.warns(UserWarning, match="other sensors: 'T1'.*filled-temperatures") as given:
            follow()
        assert len(given) == 1
        assert given[0].filename == __file__


def test_days_are_those_of_the_calendar_where_clocks_change(healthy):
    campaign, fem = healthy
    index = campaign.temperatures.index.tz_localize("Europe/Brussels")
    T, F = campaign.temperatures.set_axis(index), campaign.frequencies.set_axis(index)
    follower = DriftFollower.of(fem, T[:440], F[:440], GROUPS)
    state = follower.start()
    for day in range(439, 460):  # over the end of March
        state = follower.advance(state, T[day : day + 1], F[day : day + 1])
        assert state.day == index[day]


def test_wrong_input_is_refused(healthy):
    campaign, fem = healthy
    T, F = campaign.temperatures, campaign.frequencies
    with pytest.raises(ValueError, match="expected a DataFrame with a DatetimeIndex"):
        track_parameters(fem, T.to_numpy(), F.to_numpy())
    with pytest.raises(ValueError, match="expected a fitted DataInformedFEM"):
        track_parameters(make_truss(), T, F)
    with pytest.raises(ValueError, match="too few days"):
        track_parameters(fem, T[:20], F[:20])
    with pytest.raises(ValueError, match="unknown damage groups"):
        track_parameters(fem, T, F, ["deck"])
    with pytest.raises(ValueError, match="significance is 2"):
        track_parameters(fem, T, F, significance=2)
    with pytest.raises(ValueError, match=r"of which the baseline lacks \['f1', .* among the temperatures \['T1'"):
        DriftFollower.of(fem, T, F.add_prefix("mode "))
    with pytest.raises(NotFittedError):
        DriftFollower.of(DataInformedFEM(make_truss()), T, F)
    with pytest.raises(ValueError, match="0 sample"):
        track_parameters(fem, T[:0], F[:0])
    for freq in ("month", "ME", 7, "0D", "NaT"):
        with pytest.raises(ValueError, match=f"freq is {freq!r}; expected a day or some days"):
            track_parameters(fem, T, F, freq=freq)


def test_more_groups_than_modes_are_said_to_be_a_limit(history):
    assert "modes do not determine" not in history.summary()
    fewer = replace(history, modes=replace(history.modes, table=history.modes.table[:1]))
    assert "do not determine which group drifts" in fewer.summary()


@pytest.mark.parametrize("n_measured", [0, 10])
def test_a_mode_that_is_hardly_measured_is_left_out(ageing, n_measured):
    campaign, fem = ageing
    F = campaign.frequencies.copy()
    F.iloc[n_measured:, 1] = np.nan
    with nullcontext() if n_measured else pytest.warns(UserWarning, match="left-out"):
        found = track_parameters(fem, campaign.temperatures, F, GROUPS, WEEK, random_state=0)
    assert found.explanations["groups"].iloc[0] == ("bottom",)
    assert "Measured on too few days to be used: f2." in found.summary()
    error = found.rates.loc["bottom", "standard_error"]
    assert_allclose(found.rates.loc["bottom", "per_year"], -0.02, atol=3 * error)


def test_columns_that_say_nothing_and_repeated_records_change_nothing_of_the_others(ageing):
    campaign, fem = ageing
    T, F = campaign.temperatures[::7], campaign.frequencies[::7]
    with pytest.warns(UserWarning, match="left-out"):
        missing = track_parameters(fem, T, F.assign(f2=np.nan), GROUPS, WEEK, random_state=0)
    with pytest.warns(UserWarning, match="left-out"):
        constant = track_parameters(fem, T, F.assign(f2=F["f2"].iloc[0]), GROUPS, WEEK, random_state=0)
    pd.testing.assert_frame_equal(constant.rates, missing.rates)
    again = [*range(len(F)), *range(9)]
    with pytest.warns(UserWarning, match="repeated-stamps"):
        repeated = track_parameters(fem, T.iloc[again], F.iloc[again], GROUPS, WEEK, random_state=0)
    once = track_parameters(fem, T, F, GROUPS, WEEK, random_state=0)
    pd.testing.assert_frame_equal(repeated.rates, once.rates)
    for doubtful in (F["f3"], pd.Series(np.where(np.arange(len(F)) % 2, 27.5, 27.6), F.index)):
        with pytest.warns(UserWarning, match=r"\[(equal-columns|few-values)\]"):
            track_parameters(fem, T, F.assign(f2=doubtful), GROUPS, WEEK, random_state=0)


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
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # four modes do not determine six parameters
        fem = DataInformedFEM(model, random_state=0).fit(T[:365], F[:365])
        history = track_parameters(fem, T, F, freq=WEEK, random_state=0)
    assert history.resolution.indistinguishable == [("k1", "k6"), ("k2", "k5"), ("k3", "k4")]
    assert_allclose(*history.rates.loc[["k1", "k6"], "probability"])
    assert (history.rates.loc[["k1", "k6"], "drifts"] == "perhaps").all()
    assert_allclose(history.rates.loc["k1", "per_year"], -0.02, atol=3 * history.rates.loc["k1", "standard_error"])
