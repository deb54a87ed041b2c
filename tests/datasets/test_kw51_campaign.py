"""The synthetic campaign of KW51: its laws, and what it was tuned to."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pandas.testing import assert_frame_equal
from scipy.stats import kurtosis

from skthermo.datasets import kw51_structure, make_kw51, make_kw51_campaign
from skthermo.fem import mac
from skthermo.studies import Scenario

SHIFTS = np.array([-1.13, -0.58, -1.18, -0.34, 2.07])  # %, modes 2 to 6
COVERAGE = np.array([0.344, 0.950, 0.503, 0.879, 0.965])
LEVELS = np.array([0.003, 0.0017, 0.0016, 0.0026, 0.00115, 0.0013])
CORRELATIONS = np.array([-0.428, -0.553, -0.310, -0.644])  # modes 2 to 5


@pytest.fixture(scope="module")
def campaign():
    return make_kw51_campaign(random_state=0)


@pytest.fixture(scope="module")
def unchanged():
    return make_kw51_campaign(retrofit=False, random_state=0)


@pytest.fixture(scope="module")
def several(unchanged):
    """Campaigns of eight seeds."""
    return [unchanged, *(make_kw51_campaign(retrofit=False, random_state=seed) for seed in range(1, 8))]


@pytest.fixture(scope="module")
def short():
    return make_kw51_campaign(n_hours=60, shapes=True, random_state=2)


def steel_of(campaign):
    """Temperature below the deck in all hours, from what it does to the bearings."""
    return 10 - np.log(campaign.theta["K_bea"]) / 0.012


@pytest.mark.nightly
def test_records_are_those_of_the_bridge(campaign):
    index = pd.date_range("2018-10-01", periods=11328, freq="h", name="time")
    for name in ("temperatures", "frequencies", "clean_frequencies", "damping", "theta", "state"):
        pd.testing.assert_index_equal(campaign[name].index, index)
    assert campaign.state.value_counts().to_dict() == {"before": 5424, "during": 3241, "after": 2663}
    assert campaign.state.index[campaign.state == "after"][0] == pd.Timestamp("2019-09-27 01:00")
    assert_array_equal(campaign.damping.isna(), campaign.frequencies.isna())
    assert campaign.damping.stack().dropna().between(0.001, 0.04).all()
    assert "shapes" not in campaign


@pytest.mark.nightly
def test_one_seed_gives_one_campaign(campaign, unchanged):
    again = make_kw51_campaign(n_hours=500, random_state=0)
    changed = make_kw51_campaign(n_hours=500, noise=0.0, damage={"braces": 0.2}, random_state=0)
    for name in ("temperatures", "damping", "theta"):
        assert_frame_equal(again[name], campaign[name][:500], check_exact=True)
    for name in ("frequencies", "clean_frequencies"):  # eigenvalues round by how many are solved for at once
        assert_frame_equal(again[name], campaign[name][:500], rtol=1e-13, atol=0)
    for other in (changed, unchanged):
        for name in ("temperatures", "damping", "theta"):
            assert_frame_equal(other[name][:500], campaign[name][:500], check_exact=True)
        assert_array_equal(other.frequencies[:500].isna(), campaign.frequencies[:500].isna())
    noise, other_noise = (c.frequencies / c.clean_frequencies - 1 for c in (campaign, unchanged))
    assert_allclose(noise, other_noise, atol=1e-12)
    assert not make_kw51_campaign(n_hours=10, random_state=1).theta.equals(campaign.theta[:10])


@pytest.mark.nightly
def test_truth_model_reproduces_the_clean_frequencies(campaign):
    """Before, after and during the retrofit, and in extreme weather, by the full model."""
    model, clean, theta = campaign.model, campaign.clean_frequencies, campaign.theta
    before = theta[campaign.state == "before"]
    rows = [*before.index[::300], *before.idxmin(), *before.idxmax()]
    assert_allclose(model.frequencies(theta.loc[rows]), clean.loc[rows], rtol=1e-5)
    damage, mass = campaign.retrofit["damage"], campaign.retrofit["mass"]
    strengthened = model.damaged(damage).with_added(mass=mass)
    assert_allclose(strengthened.frequencies(theta.iloc[-20:]), clean.iloc[-20:], rtol=1e-5)
    half = model.damaged({group: s / 2 for group, s in damage.items()}).with_added(mass=mass / 2)
    august = slice("2019-08-01 00:00", "2019-08-01 12:00")
    assert_allclose(half.frequencies(theta[august]), clean[august], rtol=1e-5)


@pytest.mark.nightly
def test_retrofit_shifts_are_the_measured_ones(campaign, unchanged):
    after = campaign.state == "after"
    shifts = 100 * (campaign.clean_frequencies / unchanged.clean_frequencies - 1)
    assert_allclose(shifts[after].mean()[1:], SHIFTS, atol=0.02)
    assert (shifts[campaign.state == "before"] == 0).all(axis=None)
    assert shifts["f6"][campaign.state == "during"].between(-0.4, 2.2).all()
    frequencies = campaign.frequencies
    measured = 100 * (frequencies[after].mean() / frequencies[campaign.state == "before"].mean() - 1)
    assert_allclose(measured[1:], SHIFTS, atol=0.1)
    assert unchanged.state.unique().tolist() == ["before"]


@pytest.mark.nightly
def test_retrofit_serves_the_models_of_the_bridge(campaign):
    model = make_kw51(updated=True)
    retrofitted = model.damaged(campaign.retrofit["damage"]).with_added(mass=campaign.retrofit["mass"])
    shifts = 100 * (retrofitted.frequencies(np.ones((1, 5))) / model.frequencies(np.ones((1, 5))) - 1)
    assert_allclose(shifts[0, 1:], SHIFTS, atol=0.05)
    assert not Scenario("retrofit", **campaign.retrofit).is_healthy
    assert campaign.retrofit["mass"].sum() == pytest.approx(3 * 32 * (353 + 837))


@pytest.mark.nightly
def test_damage_begins_when_it_is_said_to(unchanged):
    options = {"retrofit": False, "n_hours": 1500, "noise": 0.0, "gaps": False, "random_state": 0}
    damaged = make_kw51_campaign(damage={"braces": 0.2}, damage_from="2018-11-20", **options)
    onset = unchanged.theta.index.get_loc("2018-11-20 00:00")
    change = damaged.clean_frequencies / unchanged.clean_frequencies[:1500] - 1
    assert change[:onset].abs().max(axis=None) < 1e-13
    assert (change[onset:].drop(columns="f1") < 0).all(axis=None)
    assert change[onset:].mean().idxmin() == "f6"
    expected = damaged.model.damaged({"braces": 0.2}).frequencies(damaged.theta.iloc[-5:])
    assert_allclose(damaged.clean_frequencies[-5:], expected, rtol=1e-5)
    assert_frame_equal(damaged.frequencies, damaged.clean_frequencies, check_exact=True)
    options["n_hours"] = 24
    from_the_start = make_kw51_campaign(damage={"braces": 0.2}, **options)
    expected = damaged.model.damaged({"braces": 0.2}).frequencies(damaged.theta.iloc[:5])
    assert_allclose(from_the_start.clean_frequencies[:5], expected, rtol=1e-5)


@pytest.mark.nightly
def test_correlations_before_the_retrofit(campaign):
    before = campaign.state == "before"
    found = campaign.frequencies[before].corrwith(campaign.temperatures["tBD31A"][before])
    assert_allclose(found[["f2", "f3", "f4", "f5"]], CORRELATIONS, atol=0.1)
    assert found["f6"] < -0.5


@pytest.mark.nightly
def test_frost_lifts_the_vertical_modes(unchanged):
    """The coldest hours are above the line of the warmer ones, in mode 6 most."""
    temperature, clean = unchanged.temperatures["tBD31A"], unchanged.clean_frequencies
    warm, cold = temperature.between(4, 20), temperature.notna() & (unchanged.theta["I_33g"] > 1.5)
    assert cold.sum() > 10
    excess = {}
    for mode in ("f2", "f6"):
        line = np.polyfit(temperature[warm], clean[mode][warm], 1)
        excess[mode] = (clean[mode][cold] / np.polyval(line, temperature[cold]) - 1).mean()
    assert 0.005 < excess["f6"] < 0.02
    assert abs(excess["f2"]) < 0.001


@pytest.mark.nightly
def test_gaps_cover_as_on_the_bridge(several):
    missing = np.array([one.frequencies.isna() for one in several])
    assert_allclose(1 - missing.mean(axis=(0, 1))[1:], COVERAGE, atol=0.02)
    assert (~missing).all(axis=2).mean() == pytest.approx(0.13, abs=0.02)
    begins = (missing[:, 1:] & ~missing[:, :-1]).sum(axis=(0, 1))
    assert (missing.sum(axis=(0, 1)) / begins > 3).all()  # hours in one block
    hours = np.array([one.temperatures["tBD31A"].isna() for one in several])
    assert 1 - hours.mean() == pytest.approx(0.88, abs=0.01)
    assert hours[:, :4000].mean() == pytest.approx(0.31, abs=0.015)
    assert hours[:, several[0].temperatures.index < "2018-11-21"].all()


@pytest.mark.nightly
def test_weather_is_that_of_the_region(several):
    for campaign in several:
        steel, ballast = steel_of(campaign), campaign.theta["E_b"]
        assert_allclose(campaign.temperatures["tBD31A"].dropna(), steel[campaign.temperatures["tBD31A"].notna()])
        assert steel["2019-01"].min() == pytest.approx(-2.9, abs=1.0)
        assert -8 < steel.min() < -2
        assert 28 < steel.max() < 45
        assert ballast["2019-01"].max() > 1.1  # frozen
        assert (ballast["2019-06":"2019-08"] < 1.01).all()
        daily = steel.resample("D").agg(["min", "max"])
        width = daily["max"] - daily["min"]
        assert width["2019-06":"2019-08"].mean() > 2 * width["2018-12":"2019-01"].mean()


@pytest.mark.nightly
def test_moisture_is_smooth_noise_of_a_closed_form(several):
    noise = np.array([(one.theta["M_b"] - 1) / 0.0033 for one in several])
    lags = np.arange(0, 144, 24)
    found = [(noise[:, lag:] * noise[:, : noise.shape[1] - lag]).mean() for lag in lags]
    assert_allclose(found, (1 + lags / 16) * np.exp(-lags / 16), atol=0.1)


@pytest.mark.nightly
def test_noise_is_correlated_and_has_heavy_tails(several):
    noise = np.concatenate([(one.frequencies / one.clean_frequencies - 1) / LEVELS for one in several])
    assert_allclose(np.nanstd(noise, axis=0), 1.0, atol=0.02)
    assert_allclose([pd.Series(column).autocorr(1) for column in noise.T], 0.15, atol=0.02)
    assert np.median(kurtosis(noise, fisher=False, nan_policy="omit")) == pytest.approx(3 + 6 / (9 - 4), abs=0.3)


def test_the_slab_forgets_the_steels_past_exponentially(short):
    steel = steel_of(short).to_numpy()
    slab = 10 + (1 - short.theta["E_pla"].to_numpy()) / 3.6e-4
    share = np.exp(-1 / 24)
    assert slab[0] == pytest.approx(steel[0])
    assert_allclose(slab[1:], share * slab[:-1] + (1 - share) * steel[1:], atol=1e-9)


def test_shapes_are_those_of_the_model_where_modes_were_identified(short):
    shapes, found = short.shapes, short.frequencies.notna().to_numpy()
    assert shapes.shape == (60, 6, 12)
    assert_array_equal(np.isnan(shapes), np.broadcast_to(~found[..., np.newaxis], shapes.shape))
    assert_allclose(np.linalg.norm(shapes[found], axis=1), 1.0)
    dofs = [kw51_structure().dofs.index((("deck", 16, side), "z")) for side in (0, 4)]
    places = [short.sensors.index(name) for name in ("aBD17Az", "aBD17Cz")]
    for mode in (4, 5):
        first, last = np.flatnonzero(found[:, mode])[[0, -1]]
        expected = short.model.modes(short.theta.iloc[[first]])[1][0][dofs]
        ratio = shapes[first, mode, places[1]] / shapes[first, mode, places[0]]
        if abs(expected[0, mode]) > 0.1 * np.abs(expected).max():
            assert_allclose(ratio, expected[1, mode] / expected[0, mode], atol=0.1)
        assert 0.999 < mac(*shapes[[first, last], mode, :, np.newaxis]).item() < 1
