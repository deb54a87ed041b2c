"""Simulated records: of a changed structure, and with gaps and outliers that come as in the training records."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import Ridge

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.preprocessing import HampelFilter
from skthermo.surrogate import DataInformedFEM, TemperatureMapper, resampled
from tests.surrogate.chains import TRUSS, F, T, as_measured, chain, fitted, inverse


def lasting(n_records, share, length, seed):
    """A Markov chain of gaps that take this share of the records, and last for so many on the average."""
    chances = np.random.default_rng(seed).random(n_records)
    states = np.zeros(n_records, dtype=bool)
    for row in range(1, n_records):
        begins = share / (1 - share) / length
        states[row] = chances[row] < (1 - 1 / length if states[row - 1] else begins)
    return states


def run_lengths(states):
    edges = np.diff(np.r_[0, np.asarray(states, dtype=int), 0])
    return np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1)


def without(table, rows, columns=slice(None)):
    table = table.copy()
    table.loc[rows, columns] = np.nan
    return table


def drawn_gaps(fem, weather, n_seeds):
    """Which frequencies are missing in histories of this weather, (n_seeds, n_rows, n_modes)."""
    known = fem.weather(weather)
    return np.array([fem.recorder_.gaps(known, random_state=seed)[1] for seed in range(n_seeds)])


def drawn_noise(fem, n_seeds, **options):
    return [fem.recorder_.noise(fem.weather(T), random_state=seed, **options) for seed in range(n_seeds)]


@pytest.fixture(scope="module")
def spoiled():
    """A year in which modes 2 and 3 and a sensor fail for a while, records drop out, and mode 4 jumps."""
    frequencies, temperatures = F.copy(), T.copy()
    frequencies.loc[lasting(365, 0.2, 8, 0), ["f2", "f3"]] = np.nan
    frequencies.loc[lasting(365, 0.1, 5, 1)] = np.nan
    temperatures.loc[lasting(365, 0.15, 10, 2), "T2"] = np.nan
    frequencies.loc[lasting(365, 0.08, 4, 3), "f4"] *= 1.15
    return temperatures, frequencies


@pytest.fixture(scope="module")
def in_service(spoiled):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the faults, which are meant
        return chain(random_state=0).fit(*spoiled)


@pytest.mark.one_case
@pytest.mark.filterwarnings("ignore:.*not-evaluated")
@pytest.mark.parametrize("knows_weather", [True, False])
def test_markov_gaps_come_as_often_and_last_as_long(in_service, spoiled, knows_weather):
    weather = T if knows_weather else without(T, np.arange(len(T)) % 3 > 0)
    drawn, trained = drawn_gaps(in_service, weather, 30)[..., 1], spoiled[1]["f2"].isna()
    shares, lengths = drawn.mean(axis=1), np.concatenate([run_lengths(one) for one in drawn])
    assert abs(shares.mean() - trained.mean()) <= 4 * shares.std() / np.sqrt(len(drawn)) + 1e-9
    known = run_lengths(trained)
    assert abs(lengths.mean() - known.mean()) < 4 * lengths.std() / np.sqrt(len(known))


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*uncalibrated-model")
def test_outages_stay_whole_and_gaps_follow_the_weather():
    heat = T.mean(axis=1)
    warm = heat.rank(pct=True) > 0.7
    outages, in_heat = without(F, np.arange(len(F)) % 50 < 7), without(F, warm, "f2")
    whole = drawn_gaps(chain(random_state=0).fit(T, outages), T, 5)[..., 0]
    assert {length for one in whole for length in run_lengths(one)[1:-1]} == {7}
    hot = chain(mapper=TemperatureMapper(Ridge()), random_state=0).fit(T, in_heat)  # whose first row has known weather
    share = [drawn_gaps(hot, T[part], 40)[:, 0, 1].mean() for part in (heat == heat.max(), heat == heat.min())]
    assert share == [1.0, 0.0]


def test_modes_and_sensors_are_missing_together(in_service, spoiled):
    temperatures, frequencies = spoiled
    seen = {tuple(row) for row in np.hstack([temperatures.isna(), frequencies.isna()])}
    of_sensors, of_modes = in_service.recorder_.gaps(in_service.weather(T), random_state=0)
    assert {tuple(row) for row in np.hstack([of_sensors, of_modes])} <= seen
    assert of_modes.all(axis=1).any()


def test_gaps_are_the_same_whatever_the_noise(in_service):
    expected = in_service.recorder_.gaps(in_service.weather(T), random_state=4)[1]
    for options in ({"noise": "fitted"}, {"noise": 0.01}, {"noise": "fitted", "damage": {"top": 0.3}}):
        found = in_service.simulate(T, gaps="fitted", random_state=4, **options)
        np.testing.assert_array_equal(found.isna(), expected)
    assert (in_service.recorder_.gaps(in_service.weather(T), random_state=5)[1] != expected).any()


@pytest.mark.nightly
def test_outliers_come_as_often_in_the_same_mode_and_in_runs(in_service, spoiled):
    far = [one > 0.08 for one in drawn_noise(in_service, 40, gaps="fitted", outliers="fitted")]
    trained = (spoiled[1]["f4"] / F["f4"] > 1.1).to_numpy()
    shares = np.array([one[:, 3].mean() for one in far])
    assert abs(shares.mean() - trained.mean()) < 0.02
    assert not np.delete(far, 3, axis=2).any()
    lengths = np.concatenate([run_lengths(one[:, 3]) for one in far])
    assert 0.75 < lengths.mean() / run_lengths(trained).mean() < 1.25


@pytest.mark.nightly
def test_shares_of_single_gaps_and_outliers():
    noise = np.vstack(drawn_noise(fitted(), 5, noise=0.01, gaps=0.1, outliers=0.05))
    assert np.isnan(noise).mean() == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / noise.size))
    known = noise[~np.isnan(noise)]
    assert np.mean(known**2) == pytest.approx(0.01**2 * (1 + 0.05 * 99), rel=0.15)
    assert not np.isnan(fitted().recorder_.noise(fitted().weather(T), 0.01, gaps=0, random_state=0)).any()


def test_fitted_noise_without_gaps_or_outliers(in_service):
    (complete,), (jumping,) = drawn_noise(in_service, 1, gaps=0, outliers=0), drawn_noise(in_service, 1, gaps=0)
    assert np.abs(complete).max() < 0.08
    assert np.abs(jumping).max() > 0.1
    usual = in_service.recorder_.residuals.usual
    ratio = complete.std(axis=0) / usual.std(axis=0, where=~np.isnan(usual))
    np.testing.assert_allclose(ratio, 1, atol=0.15)


def test_complete_records_have_no_gaps_and_the_same_noise():
    expected = fitted().simulate(T, noise="fitted", random_state=0)
    found = fitted().simulate(T, noise="fitted", gaps="fitted", outliers="fitted", random_state=0)
    pd.testing.assert_frame_equal(found, expected)
    assert not np.hstack(fitted().recorder_.gaps(fitted().weather(T), random_state=0)).any()


@pytest.mark.nightly
def test_what_cleaning_took_comes_back(spoiled):
    temperatures, raw = spoiled
    cleaned = HampelFilter(targets=list(raw)).fit(temperatures.join(raw)).transform(temperatures.join(raw))[list(raw)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fem = chain(random_state=0).fit(temperatures, cleaned)
    taken = (cleaned.isna() & raw.notna()).to_numpy()
    for outliers, expected in (("fitted", 0.0), (raw, taken[:, 3].mean())):
        noise = drawn_noise(fem, 30, gaps="fitted", outliers=outliers)
        shares = np.array([(one[:, 3] > 0.08).mean() for one in noise])
        assert abs(shares.mean() - expected) <= 3 * shares.std() / np.sqrt(len(shares)) + 1e-9


def test_resampled_chains_have_the_gaps_and_outliers_of_the_records(in_service):
    service, again = in_service.recorder_.service, resampled(in_service, 3).recorder_.service
    np.testing.assert_array_equal(again.missing, service.missing)
    np.testing.assert_array_equal(again.outliers, service.outliers)
    expected = in_service.simulate(T, outliers="fitted", gaps="fitted", noise="fitted", random_state=0)
    found = in_service.simulate(T, outliers=service, gaps="fitted", noise="fitted", random_state=0)
    pd.testing.assert_frame_equal(found, expected)


def test_what_is_no_share_is_refused():
    for options, message in (
        ({"gaps": True}, "gaps is True; expected 'fitted', the share"),
        ({"outliers": F[:10]}, r"outliers has shape \(10, 6\); expected the frequencies that the chain was fitted on"),
        ({"outliers": F.set_axis(F.index[::-1])}, "have different indices"),
    ):
        with pytest.raises(ValueError, match=message):
            fitted().simulate(T[:9], **options)
    for known in (0.1, "fitted", F[:10]):
        with pytest.raises(ValueError, match="expected"):
            fitted().recorder_.service_of(known)
    with pytest.raises(ValueError, match="gaps is None; expected 'fitted'"):
        fitted().recorder_.gaps(fitted().weather(T), None)


@pytest.fixture(scope="module", params=[False, True], ids=["full", "reduced"])
def fem(request):
    return DataInformedFEM(TRUSS, inverse=inverse(), reduce=request.param, random_state=0).fit(T, F)


@pytest.fixture(scope="module")
def weather():
    return make_truss_campaign(random_state=1).temperatures[:60]


def test_each_row_may_have_its_own_severity(fem, weather):
    growing = np.linspace(0, 0.5, 60)
    found = fem.simulate(weather, damage={"bottom": growing, "top": 0.1})
    for row in (0, 30, 59):
        expected = fem.simulate(weather[row : row + 1], damage={"bottom": growing[row], "top": 0.1})
        np.testing.assert_allclose(found[row : row + 1], expected, rtol=2e-5)


def test_factors_multiply_the_parameters(fem, weather):
    found = fem.simulate(weather, parameters={"diagonal": 0.95})
    theta = fem.predict_parameters(weather) * [1, 1, 0.95, 1]
    np.testing.assert_allclose(found, as_measured(fem, fem.model.frequencies(theta), weather), rtol=2e-5)


def test_a_retrofit_changes_stiffness_and_mass(fem, weather):
    mass, stiffness = np.full(fem.model.n_dof, 30.0), np.eye(fem.model.n_dof) * 1e5
    found = fem.simulate(weather, stiffness=stiffness, mass=mass, damage={"top": -0.1})
    expected = fem.model.with_added(stiffness, mass).damaged({"top": -0.1}).frequencies(fem.predict_parameters(weather))
    np.testing.assert_allclose(found, as_measured(fem, expected, weather), rtol=2e-5)


@pytest.mark.parametrize("noise", [0.02, "fitted"])
def test_noise_is_what_draw_noise_gives(fem, weather, noise):
    clean = fem.simulate(weather, damage={"top": 0.2})
    found = fem.simulate(weather, damage={"top": 0.2}, noise=noise, random_state=3)
    np.testing.assert_allclose(found, clean * (1 + fem.recorder_.noise(fem.weather(weather), noise, random_state=3)))


def test_a_factor_in_percent_is_doubted(fem, weather):
    with pytest.warns(UserWarning, match="'top' .*102.*doubtful-factor"):
        fem.simulate(weather, parameters={"top": 102})


def test_other_modes_are_those_of_the_model_at_the_same_parameters(fem, weather):
    seven = make_truss(7).damaged({"top": 0.3}).frequencies(fem.predict_parameters(weather))
    found = fem.thermal_.simulated(fem.weather(weather), [6, 1], damage={"top": 0.3})
    np.testing.assert_allclose(found, seven[:, [6, 1]], rtol=2e-5)
    assert fem.model.with_modes([6, 1]).mode_ranks == (6, 1)
    with pytest.raises(ValueError, match="is none of the model's"):
        fem.thermal_.simulated(fem.weather(weather), [fem.model.n_available])
