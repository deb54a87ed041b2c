"""Drift that is followed in service is taken out of the frequencies; what changes at once is not."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.monitoring.drift import DriftFollower
from skthermo.preprocessing import LagFeatures
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper

NOISE, PER_YEAR, FIRST = 0.002, 365, 365
DELAY = 30  # days that wait before they are learned from


@pytest.fixture(scope="module")
def steady():
    return make_truss_campaign(2, noise=NOISE, random_state=0)


@pytest.fixture(scope="module")
def chain(steady):
    fem = DataInformedFEM(make_truss(), inverse=PosteriorInverse(noise=0.01), random_state=0)
    return fem.fit(steady.temperatures[:FIRST], steady.frequencies[:FIRST])


@pytest.fixture(scope="module")
def follower(chain, steady):
    return DriftFollower.of(chain, steady.temperatures[:FIRST], steady.frequencies[:FIRST])


@pytest.fixture(scope="module")
def second_year(follower, steady):
    """Daily means of the year after the baseline."""
    T, F = steady.temperatures, steady.frequencies[FIRST:]
    return follower.records.means(T, F, F.index)


def followed(follower, daily, changes):
    """States of the follower day by day, where ln stiffness of the diagonals changes by so much."""
    state, slopes = follower.start(), follower.slopes[:, 2]
    for row, change in enumerate(changes):
        day = daily[row : row + 1]
        state = follower._with_day(state, replace(day, values=day.values + change * slopes))
        yield state


def with_drift(follower, lost, error):
    """A state in which one group has lost a share of its stiffness, known to an error, and the others nothing."""
    start = follower.start()
    mean, covariance = map(np.zeros_like, start.known)
    mean[0], covariance[:4, :4] = np.log1p(-lost), error**2 * np.eye(4)
    return replace(start, known=type(start.known)(mean, covariance))


def test_clear_drift_is_taken_out_and_doubtful_drift_is_not(follower, steady):
    F = steady.frequencies[-5:]
    clear, doubtful = (with_drift(follower, 0.03, error) for error in (1e-5, 0.03))
    shift = follower.slopes[:, 0] * np.log(0.97)
    pd.testing.assert_frame_equal(follower.corrected(clear, F), F * np.exp(-shift), rtol=1e-9)
    pd.testing.assert_frame_equal(follower.corrected(doubtful, F), F)
    swapped = F.iloc[:, ::-1]
    pd.testing.assert_frame_equal(follower.corrected(clear, swapped), (F * np.exp(-shift)).iloc[:, ::-1], rtol=1e-9)
    errors = np.geomspace(1e-4, 0.1, 50)
    shares = [follower.share(with_drift(follower, 0.03, error)) for error in errors]
    assert (np.diff(shares) <= 0).all()
    assert shares[0] > 0.99
    assert shares[-1] == 0


def test_report_says_whether_and_where_there_is_a_drift(follower):
    clear, doubtful = (with_drift(follower, 0.06, error) for error in (1e-4, 0.06))
    assert follower.taken_out(clear).tolist() == pytest.approx([-0.06, 0, 0, 0], abs=1e-4)
    assert not follower.taken_out(doubtful).any()
    clear, doubtful = follower.report(clear), follower.report(doubtful)
    assert clear["change"].tolist() == pytest.approx([-0.06, 0, 0, 0], abs=1e-3)
    assert clear["significant"].tolist() == clear["beyond_limit"].tolist() == [True, False, False, False]
    assert clear["p_value"].unique() == [0.001]
    assert doubtful["change"].tolist() == pytest.approx([-0.06, 0, 0, 0])
    assert not doubtful[["significant", "beyond_limit"]].any(axis=None)
    assert (doubtful["p_value"] > 0.05).all()


def test_an_even_drift_is_one_of_all_groups(follower):
    """All groups lose 1.2 %: each alone is hardly known, their common change is."""
    start, error = follower.start(), 0.004
    mean, covariance = map(np.zeros_like, start.known)
    mean[:4], covariance[:4, :4] = np.log1p(-0.012), error**2 * np.eye(4)
    report = follower.report(replace(start, known=type(start.known)(mean, covariance)))
    assert report.index[report["significant"]].tolist() == ["all groups"]
    assert report.loc["all groups", "change"] == pytest.approx(-0.012, abs=1e-6)
    assert report.loc["all groups", "standard_error"] < error


def test_slow_drift_is_followed(follower, second_year):
    """Also one that begins after the baseline, which the follower has not seen before."""
    changes = -0.02 * np.arange(PER_YEAR) / PER_YEAR
    states = list(followed(follower, second_year, changes))
    report = follower.report(states[-1])
    assert report["significant"].tolist() == [False, False, True, False]
    assert changes[-1] < follower.taken_out(states[-1])["diagonal"] < changes[-1] / 2
    assert not any(state.sudden.any() for state in states)


def test_sudden_damage_is_not_learned_as_drift(follower, second_year):
    onset = 150
    states = list(followed(follower, second_year, np.where(np.arange(PER_YEAR) < onset, 0.0, np.log(0.88))))
    assert states[onset + 7].sudden.all()
    assert states[-1].n_left_out >= PER_YEAR - onset - DELAY
    before, later = (follower.report(states[day])["change"]["diagonal"] for day in (onset - 1, onset + 120))
    assert abs(later - before) < 0.03 * 0.12


def test_drift_goes_on_after_a_passing_change(follower, second_year):
    days = np.arange(4 * DELAY)
    passing = np.where((days >= 10) & (days < 15), 0.2, 0.0)
    (*_, state), (*_, expected) = (followed(follower, second_year, changes) for changes in (passing, 0 * passing))
    assert not state.sudden.any()
    assert state.n_left_out == 0
    found, errors = (follower.report(state)[what] for what in ("change", "standard_error"))
    assert (np.abs(found - follower.report(expected)["change"]) < errors).all()


def test_days_without_records_pass(follower, steady):
    T, F = steady.temperatures, steady.frequencies
    start = follower.start()
    assert follower.advance(start, T[:0], F[:0]) is start
    assert follower.advance(start, T[FIRST - 1 : FIRST], F[FIRST - 1 : FIRST]) is start  # the baseline's last day
    later = follower.advance(start, T[FIRST + 9 : FIRST + 10], F[FIRST + 9 : FIRST + 10])
    assert later.day == T.index[FIRST + 9]
    assert np.isnan(later.waiting.values[:-1]).all()
    assert not np.isnan(later.waiting.values[-1]).any()
    rows = slice(FIRST + 10, FIRST + 11)
    unknown = follower.advance(later, T[rows], F[rows] * np.nan)
    assert np.isnan(unknown.waiting.values[-1]).all()
    assert unknown.day == T.index[FIRST + 10]


def test_lags_see_the_days_before():
    hourly = make_truss_campaign(
        1, samples_per_year=4 * 50, samples_per_day=4, noise=NOISE, correlation=0.5, random_state=0
    )
    T, F = hourly.temperatures.tz_localize("Europe/Brussels"), hourly.frequencies.tz_localize("Europe/Brussels")
    mapper = make_pipeline(LagFeatures(5, freq="6h"), TemperatureMapper())
    fem = DataInformedFEM(make_truss(), inverse=PosteriorInverse(noise=0.01), mapper=mapper, random_state=0)
    n_first = 4 * 40
    fem.fit(T[:n_first], F[:n_first])
    follower = DriftFollower.of(fem, T[:n_first], F[:n_first])
    state = follower.start()
    for _, day in F[n_first:].groupby(F.index[n_first:].normalize()):
        state = follower.advance(state, T.loc[day.index], day)
    apart = (np.log(F) - np.log(fem.predict(T)))[n_first:]
    expected = apart.groupby(apart.index.normalize()).mean()
    np.testing.assert_allclose(state.waiting.values, expected, rtol=1e-9)
    assert state.day == expected.index[-1]


def test_states_are_saved_without_types_of_others(follower, steady):
    skops = pytest.importorskip("skops.io")
    state = follower.advance(follower.start(), steady.temperatures[FIRST : FIRST + 1], steady.frequencies[FIRST:][:1])
    file = skops.dumps(state)
    unknown = skops.get_untrusted_types(data=file)
    assert all(name.startswith("skthermo.") for name in unknown)
    again = skops.loads(file, trusted=unknown)
    assert (again.day, again.n_left_out) == (state.day, 0)
    pd.testing.assert_frame_equal(follower.report(again), follower.report(state), check_exact=True)
