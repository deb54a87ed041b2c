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
from skthermo.monitoring.drift._explanations import Explanations, ModeTrends
from skthermo.monitoring.drift._kalman import DailyNoise, DailySteps, DayShown, State
from skthermo.monitoring.drift._observations import observation, shapes_of_time
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


def small_case(n_days=12, seed=0):
    """Two levels with slopes, two constants and two disturbances, seen by two modes with gaps."""
    random = np.random.RandomState(seed)
    memory, renewal = np.array([0.8, 0.3]), np.array([[0.5, 0.1], [0.1, 0.4]])
    steps = DailySteps(0.1, np.diag([0.2, 0.05]), np.diag([0.1, 0.3]), memory, renewal)
    root = random.standard_normal((8, 8))
    start = State(random.standard_normal(8), root @ root.T / 8)
    days = []
    for day in range(n_days):
        present = [[], [0], [1], [0, 1]][random.randint(4) if day else 3]
        design = random.standard_normal((2, 8))[present]
        days.append(DayShown(random.standard_normal(len(present)), design, 0.3 * np.eye(len(present))))
    return steps, start, days


def dense(steps, start, days):
    """Mean and covariance of the states of all days, given all values, by one Gaussian conditional."""
    n, n_days = len(start.mean), len(days)
    transition = np.eye(n)
    transition[:2, 2:4] = steps.length * np.eye(2)
    transition[-2:, -2:] = np.diag(steps.memory)
    added = np.zeros((n, n))
    added[:2, :2], added[2:4, 2:4], added[-2:, -2:] = steps.walk, steps.turn, steps.renewal
    powers = [np.linalg.matrix_power(transition, k) for k in range(n_days)]
    mean = np.concatenate([power @ start.mean for power in powers])
    covariance = np.zeros((n * n_days, n * n_days))
    for i in range(n_days):
        for j in range(n_days):
            block = powers[i] @ start.covariance @ powers[j].T
            block = block + sum(powers[i - k] @ added @ powers[j - k].T for k in range(1, min(i, j) + 1))
            covariance[n * i : n * (i + 1), n * j : n * (j + 1)] = block
    design = np.zeros((sum(len(day.values) for day in days), n * n_days))
    noise, row = np.zeros((len(design), len(design))), 0
    for place, day in enumerate(days):
        rows = slice(row, row + len(day.values))
        design[rows, n * place : n * (place + 1)], noise[rows, rows] = day.design, day.noise
        row = rows.stop
    values = np.concatenate([day.values for day in days])
    gain = np.linalg.solve(design @ covariance @ design.T + noise, design @ covariance).T
    return mean + gain @ (values - design @ mean), covariance - gain @ design @ covariance


def test_the_filter_equals_the_dense_conditional():
    steps, start, days = small_case()
    mean, covariance = dense(steps, start, days)
    n = len(start.mean)
    state = steps.filtered(start, days)
    assert_allclose(state.mean, mean[-n:], atol=1e-9)
    assert_allclose(state.covariance, covariance[-n:, -n:], atol=1e-9)


def test_memory_and_variances_of_noise_are_recovered():
    random = np.random.RandomState(0)
    n_days, memory, fading, fresh = 3000, 0.85, 0.02, 0.01
    states = np.zeros((n_days, 2))
    for day in range(1, n_days):
        states[day] = memory * states[day - 1] + fading * np.sqrt(1 - memory**2) * random.standard_normal(2)
    values = states + fresh * random.standard_normal((n_days, 2))
    values[random.uniform(size=values.shape) < 0.2] = np.nan
    noise = DailyNoise.of(values, np.ones((n_days, 2, 1)), (~np.isnan(values)).astype(float))
    assert_allclose(noise.memory, memory, atol=0.11)
    assert_allclose(noise.fading, fading, rtol=0.2)
    assert_allclose(noise.fresh, fresh, rtol=0.3)
    assert abs(noise.correlation[0, 1]) < 0.1


def test_errors_of_long_means_are_those_of_the_noise():
    random = np.random.RandomState(0)
    n_days, n_modes, memory = 2500, 8, 0.9
    values = np.zeros((n_days, n_modes))
    for day in range(1, n_days):
        values[day] = memory * values[day - 1] + np.sqrt(1 - memory**2) * random.standard_normal(n_modes)
    noise = DailyNoise.of(values, np.ones((n_days, n_modes, 1)), np.ones((n_days, n_modes)))
    lasting = (noise.fading**2 * (1 + noise.memory) / (1 - noise.memory) + noise.fresh**2) ** 0.5
    truth = np.sqrt((1 + memory) / (1 - memory))
    chance, grid = np.sqrt((1 + memory) / (1 - memory) / n_days), 0.3 / np.sqrt(12)
    assert np.sqrt(np.mean((lasting / truth - 1) ** 2)) < 1.5 * np.hypot(chance, grid)


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
        with pytest.warns(UserWarning, match="'T1' in 20 of 730 rows") as given:
            follow()
        assert len(given) == 1
        assert given[0].filename == __file__


def trends_of(change, slopes, error=1e-3, years=4.0):
    n_modes, n_shapes = len(slopes), 5
    mean = np.kron(slopes @ np.asarray(change, dtype=float), np.eye(n_shapes)[0])
    return ModeTrends(mean, error**2 * np.eye(n_modes * n_shapes), slopes, years)


def test_groups_with_like_effects_are_named_together():
    slopes = np.array([[0.3, 0.3, 0.0], [0.1, 0.1001, 0.3], [0.2, 0.2, -0.1], [0.0, 0.0, 0.2]])
    found = Explanations.of(trends_of([-0.04, 0, 0], slopes), 100.0, np.random.RandomState(0))
    assert found.p_value < 0.01
    assert found.instead(found.sets[0][0]) == [0, 1]
    assert found.confounded == {0: [1], 1: [0]}
    apart = Explanations.of(trends_of([0, 0, -0.04], slopes), 100.0, np.random.RandomState(0))
    assert apart.sets[0] == (2,)
    assert apart.instead(2) == [2]


def test_two_groups_that_drift_are_both_found():
    slopes = np.random.RandomState(0).uniform(0, 0.4, size=(6, 4))
    found = Explanations.of(trends_of([-0.05, 0, 0.04, 0], slopes), 100.0, np.random.RandomState(0))
    assert found.sets[0] == (0, 2)


def test_p_values_without_drift_are_uniform():
    random, slopes = np.random.RandomState(0), np.random.RandomState(1).uniform(0, 0.4, size=(4, 2))
    p_values = []
    for _ in range(40):
        trends = trends_of([0, 0], slopes)
        noisy = ModeTrends(1e-3 * random.standard_normal(len(trends.mean)), trends.covariance, slopes, 4.0)
        p_values.append(Explanations.of(noisy, 1000.0, random).p_value)
    assert np.mean(np.array(p_values) < 0.2) < 0.35
    assert 0.35 < np.mean(p_values) < 0.75


def test_the_filter_follows_a_drift(ageing):
    campaign, fem = ageing
    T, F = campaign.temperatures, campaign.frequencies
    follower = DriftFollower.of(fem, T[:365], F[:365], GROUPS)
    known, daily = follower.start().known, follower.records.means(T[365:], F[365:], F.index[365:])
    for day in range(len(F) - 365):
        known = follower.next_day(known, observation(daily, day, follower.noise, follower.slopes))
    found = follower.estimate(known).loc["bottom"]
    truth = np.log(1 - 0.02 * 3) - np.log(1 - 0.02 * 0.5)
    assert abs(found["change"] - truth) < 3 * found["standard_error"]
    drift, covariance = follower.frequency_drift(known)
    middle = make_truss_campaign(3, random_state=0).clean_frequencies
    shift = np.log(campaign.clean_frequencies / middle).to_numpy()
    assert (np.abs(drift - (shift[-1] - shift[:365].mean(axis=0))) < 3.5 * np.sqrt(np.diag(covariance))).all()
    rates = slice(len(GROUPS), 2 * len(GROUPS))
    assert np.array_equal(follower.next_day(known, None).mean[rates], known.mean[rates])


@pytest.mark.one_case
@pytest.mark.parametrize(
    "drift", [{"bottom": 0.02}, dict.fromkeys(("bottom", "top", "diagonal", "vertical"), 0.01), {}]
)
def test_a_monitors_drift_and_the_history_tell_one_story(drift):
    campaign = make_truss_campaign(3, drift=drift or None, random_state=3)
    fem, T, F = trained(campaign), campaign.temperatures, campaign.frequencies
    history = track_parameters(fem, T, F, freq=WEEK, random_state=0)
    follower = DriftFollower.of(fem, T[:365], F[:365])
    daily, start = follower.records.means(T[365:], F[365:], F.index[365:]), follower.start()
    known = start.known
    for day in range(len(F) - 365):
        known = follower.next_day(known, observation(daily, day, follower.noise, follower.slopes))
    report = follower.report(replace(start, known=known, learned=F.index[-1]))
    expected = ["all groups"] if len(drift) > 1 else list(drift)
    assert report.index[report["significant"]].tolist() == expected
    assert (report["p_value"].max() <= 0.01) == history.has_drift == bool(drift)
    assert history.rates.index[history.rates["drifts"] == "yes"].tolist() == expected
    for group in expected:
        together = np.hypot(report.loc[group, "per_year_error"], history.rates.loc[group, "standard_error"])
        assert abs(report.loc[group, "per_year"] - history.rates.loc[group, "per_year"]) < 3 * together


def test_days_are_those_of_the_calendar_where_clocks_change(healthy):
    campaign, fem = healthy
    index = campaign.temperatures.index.tz_localize("Europe/Brussels")
    T, F = campaign.temperatures.set_axis(index), campaign.frequencies.set_axis(index)
    follower = DriftFollower.of(fem, T[:440], F[:440], GROUPS)
    state = follower.start()
    for day in range(439, 460):  # over the end of March
        state = follower.advance(state, T[day : day + 1], F[day : day + 1])
        assert state.day == index[day]


def test_shapes_of_time_are_those_of_a_random_walk():
    shapes = shapes_of_time(200, 40)[:, 1:] / (np.pi * (np.arange(1, 40) - 0.5))
    share = np.arange(200) / 199
    assert_allclose(shapes @ shapes.T, np.minimum(share[:, np.newaxis], share), atol=0.02)


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
