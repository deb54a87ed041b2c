"""Gaps and outliers of simulated records, which come as in the training records."""

import warnings

import numpy as np
import pandas as pd
import pytest

from skthermo.preprocessing import HampelFilter
from skthermo.surrogate import resampled
from skthermo.surrogate._records import ServiceRecords
from tests.surrogate.chains import F, T, chain


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


def records_with(missing, outliers=None, places=None):
    outliers = np.full(missing.shape, np.nan) if outliers is None else outliers
    places = np.random.default_rng(0).normal(size=(len(missing), 2)) if places is None else places
    return ServiceRecords(missing, outliers, places)


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


@pytest.fixture(scope="module")
def flawless():
    return chain(random_state=0).fit(T, F)


@pytest.mark.parametrize("knows_weather", [True, False])
def test_markov_gaps_come_as_often_and_last_as_long(knows_weather):
    missing = np.column_stack([lasting(3000, share, length, seed=1) for share, length in ((0.2, 8), (0.05, 2))])
    weather = np.random.default_rng(1).normal(size=(1500, 2)) if knows_weather else np.full((1500, 2), np.nan)
    records, random = records_with(missing), np.random.RandomState(0)
    drawn = [missing[records.draw(weather, random)] for _ in range(30)]
    for column in (0, 1):
        shares = np.array([one[:, column].mean() for one in drawn])
        lengths = np.concatenate([run_lengths(one[:, column]) for one in drawn])
        trained = run_lengths(missing[:, column])
        assert abs(shares.mean() - missing[:, column].mean()) < 4 * shares.std() / np.sqrt(len(drawn))
        assert abs(lengths.mean() - trained.mean()) < 4 * lengths.std() / np.sqrt(len(trained))


def test_outages_stay_whole():
    missing = (np.arange(1000) % 50 < 7)[:, np.newaxis]
    drawn = missing[records_with(missing).draw(np.zeros((2000, 2)), np.random.RandomState(0))]
    assert set(run_lengths(drawn[:, 0])[1:-1]) == {7}


def test_gaps_follow_the_weather():
    cold = np.random.default_rng(0).normal(size=3000)
    missing = (cold > 1)[:, np.newaxis]
    records = records_with(missing, places=cold[:, np.newaxis])
    share = [missing[records.draw(np.full((400, 1), at), np.random.RandomState(0))][:1].mean() for at in (-2.0, 2.0)]
    assert share == [0.0, 1.0]


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


def test_outliers_come_as_often_in_the_same_mode_and_in_runs(in_service, spoiled):
    noise = [
        in_service.recorder_.noise(in_service.weather(T), gaps="fitted", outliers="fitted", random_state=seed)
        for seed in range(40)
    ]
    with np.errstate(invalid="ignore"):
        far = [one > 0.08 for one in noise]
    trained = (spoiled[1]["f4"] / F["f4"] > 1.1).to_numpy()
    shares = np.array([one[:, 3].mean() for one in far])
    assert abs(shares.mean() - trained.mean()) < 3 * shares.std() / np.sqrt(len(shares))
    assert not np.delete(far, 3, axis=2).any()
    lengths = np.concatenate([run_lengths(one[:, 3]) for one in far])
    assert 0.75 < lengths.mean() / run_lengths(trained).mean() < 1.25


def test_shares_of_single_gaps_and_outliers(flawless):
    noise = np.vstack(
        [
            flawless.recorder_.noise(flawless.weather(T), 0.01, gaps=0.1, outliers=0.05, random_state=seed)
            for seed in range(5)
        ]
    )
    assert np.isnan(noise).mean() == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / noise.size))
    known = noise[~np.isnan(noise)]
    assert np.mean(known**2) == pytest.approx(0.01**2 * (1 + 0.05 * 99), rel=0.15)
    assert not np.isnan(flawless.recorder_.noise(flawless.weather(T), 0.01, gaps=0, random_state=0)).any()


def test_fitted_noise_without_gaps_or_outliers(in_service):
    complete = in_service.recorder_.noise(in_service.weather(T), gaps=0, outliers=0, random_state=0)
    assert np.abs(complete).max() < 0.08
    assert np.abs(in_service.recorder_.noise(in_service.weather(T), gaps=0, random_state=0)).max() > 0.1
    usual = in_service.recorder_.residuals.usual
    ratio = complete.std(axis=0) / usual.std(axis=0, where=~np.isnan(usual))
    np.testing.assert_allclose(ratio, 1, atol=0.15)


def test_complete_records_have_no_gaps_and_the_same_noise(flawless):
    expected = flawless.simulate(T, noise="fitted", random_state=0)
    found = flawless.simulate(T, noise="fitted", gaps="fitted", outliers="fitted", random_state=0)
    pd.testing.assert_frame_equal(found, expected)
    assert not np.hstack(flawless.recorder_.gaps(flawless.weather(T), random_state=0)).any()


@pytest.mark.nightly
def test_what_cleaning_took_comes_back(spoiled):
    temperatures, raw = spoiled
    cleaned = HampelFilter(targets=list(raw)).fit(temperatures.join(raw)).transform(temperatures.join(raw))[list(raw)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fem = chain(random_state=0).fit(temperatures, cleaned)
    taken = (cleaned.isna() & raw.notna()).to_numpy()
    for outliers, expected in (("fitted", 0.0), (raw, taken[:, 3].mean())):
        noise = [
            fem.recorder_.noise(fem.weather(T), gaps="fitted", outliers=outliers, random_state=seed)
            for seed in range(30)
        ]
        with np.errstate(invalid="ignore"):
            shares = np.array([(one[:, 3] > 0.08).mean() for one in noise])
        assert abs(shares.mean() - expected) <= 3 * shares.std() / np.sqrt(len(shares))


def test_resampled_chains_have_the_gaps_and_outliers_of_the_records(in_service):
    other = resampled(in_service, 3)
    for name in ("missing", "outliers"):
        np.testing.assert_array_equal(
            getattr(other.recorder_.service, name), getattr(in_service.recorder_.service, name)
        )
    service = in_service.recorder_.service
    expected = in_service.simulate(T, outliers="fitted", gaps="fitted", noise="fitted", random_state=0)
    found = in_service.simulate(T, outliers=service, gaps="fitted", noise="fitted", random_state=0)
    pd.testing.assert_frame_equal(found, expected)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"gaps": "always"}, "gaps is 'always'; expected 'fitted', the share"),
        ({"gaps": 1.0}, "gaps is 1.0; expected"),
        ({"gaps": True}, "gaps is True; expected"),
        ({"outliers": -0.1}, "outliers is -0.1; expected 'fitted', the share"),
        ({"outliers": F[:10]}, r"outliers has shape \(10, 6\); expected the frequencies that the chain was fitted on"),
        ({"outliers": F.set_axis(F.index[::-1])}, "have different indices"),
    ],
)
def test_what_is_no_share_is_refused(flawless, options, message):
    with pytest.raises(ValueError, match=message):
        flawless.simulate(T, **options)


def test_no_gaps_are_drawn_for_none(flawless):
    with pytest.raises(ValueError, match="gaps is None; expected 'fitted'"):
        flawless.recorder_.gaps(flawless.weather(T), None)


@pytest.mark.parametrize("known", [0.1, "fitted", F[:10]])
def test_records_are_known_by_the_frequencies_of_fit_alone(flawless, known):
    with pytest.raises(ValueError, match="expected"):
        flawless.recorder_.service_of(known)
