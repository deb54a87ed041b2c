"""The truss campaign against its equations."""

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss, make_truss_campaign, steel_modulus
from skthermo.fem import add_noise


def test_modulus_is_equation_10():
    np.testing.assert_allclose(steel_modulus([20, 0, -20, 40]), [1, 1.1, 1 + 0.2 * np.exp(0.2), 1 - 0.1 * np.exp(-0.4)])


def test_temperatures_are_equations_11_to_13_and_lasting_noise_has_its_spread_and_memory():
    campaign = make_truss_campaign(40, correlation=0.9, random_state=0)
    s = np.arange(1, 40 * 365 + 1)
    season = 2 * np.pi * s / 365
    expected = np.column_stack(
        [15 + 15 * np.sin(season), 15 + 20 * np.sin(season), 17 + 25 * np.sin(season + np.pi / 6) + 10]
    )
    residual = campaign.temperatures - expected
    np.testing.assert_allclose(residual.mean(), 0, atol=0.3)
    np.testing.assert_allclose(residual.std(), [3, 2, 8], rtol=0.03)
    noise = campaign.frequencies / campaign.clean_frequencies - 1
    np.testing.assert_allclose(noise.std(), 0.01, rtol=0.1)
    for lag in (1, 5):
        np.testing.assert_allclose([noise[mode].autocorr(lag) for mode in noise], 0.9**lag, atol=0.05)


def test_hourly_campaigns_have_a_day():
    hourly = make_truss_campaign(samples_per_year=24 * 365, samples_per_day=24, random_state=0)
    assert hourly.temperatures.index[1] - hourly.temperatures.index[0] == pd.Timedelta("1h")
    by_hour = hourly.temperatures["T1"].groupby(hourly.temperatures.index.hour).mean()
    assert np.ptp(by_hour) == pytest.approx(40, abs=1)


def test_frequencies_are_the_models_with_noise():
    campaign = make_truss_campaign(5, damage={"top": 0.2}, random_state=0)
    clean = campaign.model.damaged({"top": 0.2}).frequencies(campaign.theta)
    np.testing.assert_array_equal(campaign.clean_frequencies, clean)
    np.testing.assert_allclose((campaign.frequencies / clean - 1).std(), 0.01, rtol=0.1)
    np.testing.assert_array_equal(campaign.theta, steel_modulus(campaign.temperatures))


def test_the_thermo_mechanical_model_is_the_truss():
    campaign = make_truss_campaign(random_state=0)
    np.testing.assert_allclose(
        campaign.model.frequencies(np.ones((1, 3))), make_truss().frequencies(np.ones((1, 4))), rtol=1e-12
    )
    np.testing.assert_allclose(
        campaign.model.damaged({"diagonal": 0.3}).frequencies(np.ones((1, 3))),
        make_truss().damaged({"diagonal": 0.3}).frequencies(np.ones((1, 4))),
        rtol=1e-12,
    )


def test_one_seed_gives_one_weather_whatever_the_damage():
    healthy, damaged = (make_truss_campaign(damage=d, random_state=4) for d in (None, {"bottom": 0.5}))
    pd.testing.assert_frame_equal(healthy.temperatures, damaged.temperatures)
    pd.testing.assert_frame_equal(healthy.frequencies, make_truss_campaign(random_state=4).frequencies)
    np.testing.assert_array_equal(make_truss_campaign(noise=0, random_state=4).frequencies, healthy.clean_frequencies)
    assert not np.array_equal(add_noise(healthy.clean_frequencies, 0.01), healthy.frequencies)


def test_drift_and_sudden_damage_are_those_of_the_damaged_model():
    options = {"samples_per_year": 50, "noise": 0, "random_state": 1}
    steady, ageing = (
        make_truss_campaign(3, drift=drift, **options) for drift in (None, {"bottom": 0.02, "top": -0.01})
    )
    pd.testing.assert_frame_equal(ageing.theta, steady.theta, check_exact=True)
    np.testing.assert_allclose(ageing.frequencies.iloc[0], steady.frequencies.iloc[0], rtol=1e-12)
    lost = {"bottom": 0.02 * 149 / 50, "top": -0.01 * 149 / 50}
    expected = ageing.model.damaged(lost).frequencies(ageing.theta.iloc[[-1]])
    np.testing.assert_allclose(ageing.frequencies.iloc[[-1]], expected, rtol=1e-12)
    onset = ageing.theta.index[100]
    damaged = make_truss_campaign(
        3, drift={"bottom": 0.02}, damage={"bottom": 0.12}, damage_from=onset, **options
    ).frequencies
    drifting = make_truss_campaign(3, drift={"bottom": 0.02}, **options).frequencies
    np.testing.assert_array_equal(damaged[:100], drifting[:100])
    expected = ageing.model.damaged({"bottom": 1 - 0.88 * (1 - 0.02 * 2)}).frequencies(ageing.theta.iloc[[100]])
    np.testing.assert_allclose(damaged.iloc[[100]], expected, rtol=1e-12)
    late = make_truss_campaign(3, damage={"top": 0.2}, damage_from=onset, **options).frequencies
    whole = make_truss_campaign(3, damage={"top": 0.2}, **options).frequencies
    np.testing.assert_allclose(late[100:], whole[100:], rtol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"damage": {"deck": 0.2}}, "unknown damage group 'deck'"),
        ({"drift": {"deck": 0.01}}, "drift is .*'deck'.*expected a mapping whose keys are some of .*'bottom'"),
        ({"drift": {"top": 0.6}, "n_years": 2}, "drift of group 'top' takes away"),
        ({"damage": {"top": 0.1}, "damage_from": "2025-01-05T00:00Z"}, "without a time zone"),
        ({"damage": {"top": 0.1}, "damage_from": "2024-12-31"}, "damage_from is '2024-12-31'; expected a time from"),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        make_truss_campaign(**arguments)
