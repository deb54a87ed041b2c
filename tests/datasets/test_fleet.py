"""Laws of synthetic fleets: reproducible, weather by date, damage, climates, thermal laws."""

import pickle
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from pandas.testing import assert_frame_equal

from skthermo.datasets import make_fleet
from skthermo.preprocessing import SensorMeans


@pytest.fixture(scope="module")
def fleet():
    return make_fleet(6, random_state=0)


@pytest.fixture(scope="module", params=["bridge 000", "bridge 001", "bridge 002"])
def bridge(request, fleet):
    return fleet[request.param]


@pytest.mark.nightly
def test_a_bridge_is_the_same_in_a_larger_fleet_and_after_pickling(fleet):
    larger = make_fleet(40, random_state=0)
    sent = pickle.loads(pickle.dumps(fleet))
    for name in fleet:
        assert fleet[name] == larger[name] == sent[name]
        for other in (larger[name], sent[name]):
            assert_frame_equal(fleet[name].records(30).frequencies, other.records(30).frequencies)
            nominal = np.ones((1, len(other.model.parameter_names)))
            np.testing.assert_array_equal(fleet[name].model.frequencies(nominal), other.model.frequencies(nominal))
        assert larger[name].covariates == fleet[name].covariates


def test_seeds_give_other_bridges(fleet):
    others = make_fleet(6, random_state=1)
    assert set(fleet) == set(others)
    assert all(fleet[name].covariates != other.covariates for name, other in others.items())
    assert make_fleet(2, random_state=None)["bridge 000"] != make_fleet(2, random_state=None)["bridge 000"]


@pytest.mark.parametrize("atypical", [0.3, 1.0])
def test_the_share_of_atypical_bridges_holds_in_every_kind(atypical):
    fleet = make_fleet(300, atypical=atypical, random_state=3)
    drawn = pd.DataFrame([(bridge.kind, bridge.is_atypical) for bridge in fleet.values()], columns=["kind", "atypical"])
    assert (drawn.groupby("kind")["atypical"].sum() - 100 * atypical).abs().max() <= 1
    assert {bridge.atypical_law for bridge in fleet.values()} >= {"reversed", "doubled", "knee elsewhere"}


@pytest.mark.one_case
def test_records_depend_on_their_date_alone(bridge):
    year = bridge.records(365)
    for part, days in ((bridge.records(20), slice(0, 20)), (bridge.records(9, "2025-11-03"), slice(306, 315))):
        for what in ("temperatures", "frequencies", "clean_frequencies", "theta"):
            assert_frame_equal(part[what], year[what].iloc[days], check_freq=False)
    across = bridge.records(20, "2025-12-22")
    assert_frame_equal(across.temperatures.iloc[:10], year.temperatures.iloc[-10:], check_freq=False)
    # the next year's weather is another one
    new_year = bridge.records(10, "2026-01-01")
    assert_frame_equal(across.clean_frequencies.iloc[10:], new_year.clean_frequencies, check_freq=False, rtol=1e-9)
    assert np.nanmax(np.abs(new_year.temperatures.to_numpy() - year.temperatures.iloc[:10].to_numpy())) > 1


@pytest.mark.one_case
def test_another_seed_of_records_is_another_history_of_the_same_bridge(bridge):
    first, same, other = (bridge.records(40, random_state=seed) for seed in (1, 1, 2))
    assert_frame_equal(first.frequencies, same.frequencies)
    assert (first.temperatures - other.temperatures).std().min() > 1
    assert list(first.temperatures) == list(bridge.roles)


@pytest.mark.nightly
def test_damage_lowers_frequencies_and_leaves_the_weather(bridge):
    healthy = bridge.records(60)
    for group in bridge.groups:
        damaged, worse = (bridge.records(60, damage={group: severity}) for severity in (0.1, 0.3))
        assert_frame_equal(damaged.temperatures, healthy.temperatures)
        assert_frame_equal(damaged.frequencies.isna(), healthy.frequencies.isna())
        ratios = (damaged.clean_frequencies / healthy.clean_frequencies).to_numpy()
        assert (ratios <= 1 + 1e-9).all()
        assert ratios.min() < 0.999
        assert (worse.clean_frequencies <= damaged.clean_frequencies * (1 + 1e-9)).all(axis=None)
        # disturbances are relative and the same
        disturbed = (damaged.frequencies / healthy.frequencies).to_numpy()
        np.testing.assert_allclose(disturbed[~np.isnan(disturbed)], ratios[~np.isnan(disturbed)])
        assert group in bridge.model.groups


def test_truth_is_the_model_of_the_zones_at_the_weather(bridge):
    records = bridge.records(10)
    np.testing.assert_allclose(records.clean_frequencies, bridge.truth.frequencies(records.theta), rtol=1e-12)
    assert list(records.theta) == list(bridge.truth.parameter_names)


@pytest.mark.nightly
def test_the_users_model_is_a_little_wrong():
    for bridge in make_fleet(12, random_state=1).values():
        nominal = bridge.truth.frequencies(np.ones((1, len(bridge.truth.parameter_names))))
        ratio = bridge.model.frequencies(np.ones((1, len(bridge.model.parameter_names)))) / nominal
        assert 1e-4 < np.abs(ratio - 1).max() < 0.1
        assert set(bridge.model.parameter_names).isdisjoint(set(bridge.truth.parameter_names) - {"bearings", "soil"})
        assert (np.diff(nominal) > 0.05 * nominal[:, :-1]).all()  # modes keep their order


@pytest.mark.one_case
def test_noise_is_as_strong_and_lasts_as_long_as_said(bridge):
    records = bridge.records(3 * 365, gaps=0, outliers=0, noise=0.005)
    noise = (records.frequencies / records.clean_frequencies - 1).to_numpy()
    np.testing.assert_allclose(noise.std(axis=0), 0.005, rtol=0.1)
    correlation = (noise[1:] * noise[:-1]).mean() / (noise**2).mean()
    assert correlation == pytest.approx(0.4 * np.exp(-0.5), abs=0.05)
    quiet = bridge.records(30, gaps=0, outliers=0, noise=0)
    assert_frame_equal(quiet.frequencies, quiet.clean_frequencies)


@pytest.mark.nightly
@pytest.mark.parametrize("gaps", [0.0, 0.05, 0.3])
def test_gaps_and_outliers_have_their_shares(bridge, gaps):
    records = bridge.records(4 * 365, gaps=gaps, outliers=0.01, noise=0.001)
    assert records.frequencies.isna().mean().mean() == pytest.approx(gaps, rel=0.25, abs=1e-12)
    assert records.temperatures.isna().mean().mean() == pytest.approx(0.2 * gaps, rel=0.5, abs=1e-12)
    off = (records.frequencies / records.clean_frequencies - 1).abs().stack()
    assert (off > 0.02).mean() == pytest.approx(0.01, abs=0.004)


@pytest.mark.one_case
def test_means_of_hours_are_those_of_days(bridge):
    daily, hourly = (bridge.records(20, samples_per_day=n, gaps=0, noise=0) for n in (1, 24))
    days = hourly.clean_frequencies.resample("D").mean()
    np.testing.assert_allclose(days, daily.clean_frequencies, rtol=2e-3)
    assert len(hourly.temperatures) == 480
    swing = hourly.temperatures.mean(axis=1).groupby(hourly.temperatures.index.hour).mean()
    assert 11 <= swing.idxmax() <= 18


@pytest.mark.one_case
def test_weather_has_the_climate_of_its_place(bridge):
    climate = replace(bridge.climate, latitude=50.0, mean=9.0, season=8.0, swing=3.0, scatter=3.0, memory_hours=72.0)
    weather = climate.weather(pd.Timestamp("2000-01-01"), pd.Timestamp("2039-12-31"), (1,))
    assert weather["air"].mean() == pytest.approx(9.0, abs=0.3)
    months = weather["air"].groupby(weather.index.month).mean()
    assert months.idxmin() == 1
    assert months.idxmax() == 7
    assert (months.max() - months.min()) / 2 == pytest.approx(8.0, rel=0.1)
    daily = weather["air"].resample("D").mean()
    anomaly = daily - daily.groupby(daily.index.day_of_year).transform("mean")
    assert anomaly.std() == pytest.approx(3.0, rel=0.1)
    assert anomaly.autocorr(3) == pytest.approx(np.exp(-1), abs=0.06)
    hours = weather["air"].groupby(weather.index.hour).mean()
    assert (hours.max() - hours.min()) / 2 == pytest.approx(3.0, rel=0.05)
    assert hours.idxmax() == 15
    assert weather["sun"].between(0, 1).all()
    assert (weather["sun"][weather.index.hour == 0] == 0).all()
    assert weather["sun"]["2001-06"].mean() > 3 * weather["sun"]["2001-12"].mean()


def test_laws_are_lines_above_the_knee_and_level_off_in_frost(bridge):
    for law in bridge.laws.values():
        warm, frozen = np.array([60.0, 61.0]), np.array([-4000.0, -4001.0])
        assert np.diff(law.log_multiplier(warm))[0] == pytest.approx(law.slope, abs=1e-9)
        rise = law.log_multiplier(frozen) - law.slope * (frozen - 10)
        np.testing.assert_allclose(rise, law.limit if law.gain else 0.0, rtol=1e-3)


def test_coefficients_scatter_about_the_family():
    bridges = list(make_fleet(400, atypical=0.0, random_state=0).values())
    slopes = np.log([-bridge.laws["bearings"].slope for bridge in bridges if "bearings" in bridge.laws])
    assert len(slopes) > 200
    assert not any(bridge.is_atypical for bridge in bridges)
    assert slopes.mean() == pytest.approx(np.log(3e-3), abs=0.06)
    assert slopes.std() == pytest.approx(0.3, rel=0.1)


def test_laws_of_atypical_bridges_are_not_those_of_the_family(bridge):
    T = np.linspace(-20, 30, 11)
    normal = replace(bridge, atypical_law=None).laws
    reversed_, doubled, elsewhere = (
        replace(bridge, atypical_law=how).laws for how in ("reversed", "doubled", "knee elsewhere")
    )
    for zone, law in normal.items():
        np.testing.assert_allclose(reversed_[zone].log_multiplier(T), -law.log_multiplier(T))
        np.testing.assert_allclose(doubled[zone].log_multiplier(T), 2 * law.log_multiplier(T))
        assert elsewhere[zone].knee == law.knee + 14


def test_bridges_with_other_thermometers_have_the_same_inputs(fleet):
    tables = [SensorMeans(b.roles).fit_transform(b.records(2).temperatures) for b in fleet.values()]
    assert len({tuple(b.roles) for b in fleet.values()}) > 2
    assert all(list(table) == ["air", "deck"] for table in tables)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"samples_per_day": 7}, "expected a divisor of 24"),
        ({"start": "2025-01-01 00:30"}, "expected a full hour"),
        ({"start": "2025-01-01T00:00Z"}, "without time zone"),
    ],
)
def test_wrong_records_are_refused(fleet, wrong, message):
    with pytest.raises(ValueError, match=message):
        fleet["bridge 001"].records(**({"days": 3} | wrong))
