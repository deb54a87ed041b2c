"""Tasks on which searches tune a detector."""

import warnings

import numpy as np
import pandas as pd
import pytest
import sklearn
from sklearn.base import BaseEstimator, OutlierMixin, clone
from sklearn.ensemble import IsolationForest
from sklearn.experimental import enable_halving_search_cv  # noqa: F401
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.neighbors import LocalOutlierFactor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from skthermo.detection import MahalanobisDetector
from skthermo.preprocessing import LagFeatures
from skthermo.studies import ProgressiveDamage, Scenario, detection_task, sweep
from tests.studies.studies import LATER, MODES, SIDE_BY_SIDE, YEAR, windowed

WEATHER, OTHER = LATER.temperatures[:120], LATER.temperatures[120:240]
LAGS = "regressor__lagfeatures"
SCENARIOS = [Scenario("healthy"), Scenario("a tenth", {"bottom": 0.1}), Scenario("a fifth", {"top": 0.2})]


def task_of(fem, scenarios=SCENARIOS, T=WEATHER, **options):
    return detection_task(fem, T, scenarios, **{"n_repeats": 2, "random_state": 3, "noise": 0.01} | options)


def with_memory(window, lags=4, targets=MODES):
    """A detector in which lags and windows reach back."""
    return windowed(window, make_pipeline(LagFeatures(lags), LinearRegression()), targets)


def rows_of(task, scenario, repeat):
    return np.flatnonzero((task.states["scenario"] == scenario) & (task.states["repeat"] == repeat))


class Noted(OutlierMixin, BaseEstimator):
    """A detector with given decisions for the rows of X."""

    def __init__(self, decisions=None):
        self.decisions = decisions

    def fit(self, X, y=None):
        return self

    def decision_function(self, X):
        return self.decisions[X.index].to_numpy()

    score_samples = decision_function


def noted(task, values):
    return Noted(pd.Series(values, task.X.index))


@pytest.fixture(scope="module")
def task(fem):
    return task_of(fem, noise="fitted")


def test_the_baseline_is_measured_and_the_rest_is_what_the_chain_simulates(fem, task):
    pd.testing.assert_frame_equal(task.baseline, SIDE_BY_SIDE)
    pd.testing.assert_frame_equal(task.X[:365], SIDE_BY_SIDE, check_freq=False)
    assert (task.y[:365] == 1).all()
    assert task.states["scenario"][:365].isna().all()
    seeds = np.random.RandomState(3).randint(np.iinfo(np.int32).max, size=(2, 2))[:, 0]
    for repeat, seed in enumerate(seeds):
        for one in SCENARIOS:
            records = fem.simulate(WEATHER, damage=one.damage or None, noise="fitted", random_state=int(seed))
            rows = rows_of(task, one.name, repeat)
            np.testing.assert_allclose(task.X.iloc[rows], WEATHER.join(records), rtol=4e-6)  # of frequency surfaces
            assert (task.y.iloc[rows] == (1 if one.name == "healthy" else -1)).all()


def test_same_seed_same_bits(fem, task):
    again, other = (task_of(fem, noise="fitted", random_state=seed) for seed in (3, 4))
    pd.testing.assert_frame_equal(again.X, task.X)
    assert (other.X[MODES][365:] != task.X[MODES][365:]).to_numpy().mean() > 0.95


def test_splits_train_on_the_baseline_and_evaluate_all_scenarios_of_different_repeats(fem):
    task = task_of(fem, n_repeats=5, n_splits=3)
    assert len(task.cv) == 3
    repeats = []
    for train, test in task.cv:
        np.testing.assert_array_equal(train, np.arange(365))
        states = task.states.iloc[test]
        counts = states.groupby(["repeat", "scenario"], observed=False).size()
        assert counts.size == states["repeat"].nunique() * 3
        assert (counts == 120).all()
        repeats += [states["repeat"].unique()]
    assert sorted(np.concatenate(repeats)) == list(range(5))


@pytest.mark.parametrize("n_repeats", [2, 44])
def test_states_have_stamps_of_their_own(fem, n_repeats):
    task = task_of(fem, T=LATER.temperatures[::30], n_repeats=n_repeats, scenarios=sweep(fem, (0.1,)))
    stamps = task.X.index
    assert stamps.is_monotonic_increasing
    assert stamps.is_unique
    state = 5 * task.states["repeat"] + task.states["scenario"].cat.codes
    steps = np.diff(stamps)[np.diff(state) != 0]
    assert (steps >= pd.Timedelta(days=30)).all()
    assert len(steps) == 5 * n_repeats
    moved = stamps[365:].to_numpy().reshape(-1, 13) - LATER.temperatures.index[::30].to_numpy()
    days = moved / np.timedelta64(1, "D")
    assert (days == days[:, :1]).all()
    assert (days % 1 == 0).all()
    if n_repeats == 2:  # whole years fit
        assert (np.abs(days / 365.2425 - np.round(days / 365.2425)) * 365.2425 <= 1).all()


@pytest.mark.nightly
def test_no_lag_and_no_window_reaches_from_one_state_into_another(fem, task):
    detector = task.refit(with_memory("5D"))
    found = task.scoring.decisions(detector, task.X[365:]).values
    assert np.isnan(found).any()
    assert not np.isnan(found).all()
    apart = WEATHER.index + pd.Timedelta(days=10000)
    warnings.filterwarnings("ignore", ".*not-evaluated")  # the first rows alone; pytest restores the filters
    for start in range(0, len(found), 120):
        alone = pd.DataFrame(task.X[365:].iloc[start : start + 120].to_numpy(), apart, task.X.columns)
        np.testing.assert_allclose(found[start : start + 120], detector.decision_function(alone), rtol=1e-9)
    np.testing.assert_allclose(detector.decision_function(task.X[365:]), found, rtol=1e-9)  # stamps keep states apart


def test_rows_without_stamps_are_consecutive_within_a_state(fem_of_arrays):
    task = task_of(fem_of_arrays, T=WEATHER.to_numpy()[:40])
    assert list(task.X.index) == list(range(122 + 6 * 40))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*(no-earlier-records|other-weather)")
        detector = task.refit(with_memory(3, targets=[3, 4, 5, 6, 7, 8]))
        found = task.scoring.decisions(detector, task.X[122:]).values
        for start in range(0, len(found), 40):
            alone = task.X[122:].iloc[start : start + 40].reset_index(drop=True)
            np.testing.assert_array_equal(found[start : start + 40], detector.decision_function(alone))


@pytest.mark.one_case
@pytest.mark.parametrize(("own", "expected"), [(0.2, 0.02), (0.02, 0.02), (0.005, 0.005)])
def test_random_numbers_find_no_more_than_the_limit(fem, own, expected):
    task = task_of(fem, n_repeats=40, columns=MODES)
    decisions = np.random.default_rng(0).uniform(size=len(task.X)) - own
    found = task.scoring.decisions(noted(task, decisions), task.X[365:])
    assert abs(found.found(0.02) - expected) < 4 * np.sqrt(2 * expected / (40 * 120))
    score = task.scoring(noted(task, decisions), task.X[365:], task.y[365:])
    lowest, highest = (found.false_alarms()[name] for name in ("ci_low", "ci_high"))
    assert lowest < own < highest
    assert score == pytest.approx(found.found(0.02) * min(0.02 / lowest, 1))


def test_a_raised_threshold_keeps_the_limit(fem):
    task = task_of(fem, columns=MODES)
    random = np.random.default_rng(1)
    values = random.standard_normal(len(task.X)).round(1)  # with ties
    for limit in (0.01, 0.05, 0.3):
        found = task.scoring.decisions(noted(task, values), task.X[365:])
        raised = found.raised(limit)
        healthy = values[365:][(task.y[365:] == 1).to_numpy()]
        assert (healthy < raised).mean() <= limit < (healthy < raised + 0.11).mean()
    strict = task.scoring.decisions(noted(task, values + 10), task.X[365:])
    assert strict.raised(0.05) == 0  # a threshold that keeps the limit is left alone


def test_scenarios_count_alike_and_what_is_not_evaluated_is_not_found(fem):
    late = ProgressiveDamage("late", {"bottom": 0.1}, onset=WEATHER.index[100])
    task = task_of(fem, [Scenario("healthy"), Scenario("early", {"top": 0.1}), late], columns=MODES)
    assert (task.y[task.states["scenario"] == "late"] == 1).sum() == 200
    for name, share in (("early", 0.5), ("late", 0.5)):
        values = np.where((task.states["scenario"] == name) & (task.y == -1), -1.0, 1.0)
        assert task.scoring(noted(task, values), task.X[365:], task.y[365:]) == share
    values = np.where(task.y == -1, -1.0, 1.0)
    values[rows_of(task, "early", 0)] = np.nan
    assert task.scoring(noted(task, values), task.X[365:], task.y[365:]) == 0.75
    values[task.y == 1] = np.nan
    with pytest.raises(ValueError, match="none of 240 healthy records is evaluated"):
        task.scoring(noted(task, values), task.X[365:], task.y[365:])


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*few-records")  # means of a week in half a year
def test_a_search_finds_what_each_setting_scores(task):
    detector = with_memory("1D")
    few, many = ({"window": w, f"{LAGS}__lags": n} for w, n in (("1D", 1), ("7D", 3)))
    grid = [{name: [value] for name, value in setting.items()} for setting in (few, many)]
    search = GridSearchCV(detector, grid, cv=task.cv, scoring=task.scoring, refit=False).fit(task.X, task.y)
    for setting, score in zip(search.cv_results_["params"], search.cv_results_["mean_test_score"], strict=True):
        fitted = clone(detector).set_params(**setting).fit(SIDE_BY_SIDE)
        scores = [task.scoring(fitted, task.X.iloc[test], task.y.iloc[test]) for _, test in task.cv]
        assert np.mean(scores) == pytest.approx(score, abs=1e-12)
    assert search.best_params_["window"] == "7D"
    assert task.refit(search).threshold_ == clone(detector).set_params(**many).fit(SIDE_BY_SIDE).threshold_
    two = clone(search).set_params(n_jobs=2).fit(task.X, task.y)
    np.testing.assert_array_equal(two.cv_results_["mean_test_score"], search.cv_results_["mean_test_score"])
    with sklearn.config_context(enable_metadata_routing=True):
        routed = clone(search).fit(task.X, task.y)
    np.testing.assert_array_equal(routed.cv_results_["mean_test_score"], search.cv_results_["mean_test_score"])


@pytest.mark.parametrize(
    "detector",
    [
        LocalOutlierFactor(novelty=True),
        make_pipeline(StandardScaler(), IsolationForest(n_estimators=20, random_state=0)),
    ],
)
def test_other_detectors_are_evaluated_too(fem, detector):
    task = task_of(fem, columns=MODES)
    assert list(task.X) == MODES
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*LocalOutlierFactor was fitted with feature names")
        scores = cross_val_score(detector, task.X, task.y, cv=task.cv, scoring=task.scoring)
    assert ((scores >= 0) & (scores < 1)).all()
    only = task_of(fem, baseline=YEAR.frequencies)
    pd.testing.assert_frame_equal(only.X, task.X)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*few-records")  # a line leaves residuals that follow the season
def test_confirmation_evaluates_fresh_noise_and_weather(fem):
    task = task_of(fem, n_repeats=3, n_splits=1, noise="fitted")
    grid = {"window": [None, 7]}
    search = GridSearchCV(windowed(), grid, cv=task.cv, scoring=task.scoring, refit=False).fit(task.X, task.y)
    table = task.confirm({"tuned": search, "single": windowed()}, OTHER, random_state=3)
    assert list(table.index) == ["tuned", "single"]
    tuned = table.loc["tuned"]
    assert tuned["tuned"] == pytest.approx(search.best_score_)
    assert tuned["optimism"] == pytest.approx(tuned["tuned"] - tuned["fresh"])
    seeds = np.random.RandomState(3).randint(np.iinfo(np.int32).max, size=(3, 2))[:, 1]  # the task has the others
    detector = windowed(7).fit(SIDE_BY_SIDE)
    T = OTHER.set_axis(OTHER.index + pd.Timedelta(days=1000))  # as in the task, windows begin in the baseline

    def decisions(one):
        changes = one.changes(T) | {"noise": "fitted"}
        drawn = (fem.simulate(T, **changes, random_state=int(seed)) for seed in seeds)
        return np.array([detector.decision_function(T.join(records)) for records in drawn])

    healthy, *damaged = map(decisions, SCENARIOS)
    known = np.sort(healthy[~np.isnan(healthy)])
    limit = min(known[int(0.02 * len(known))], 0)
    assert tuned["fresh"] == pytest.approx(np.mean([np.mean(each < limit) for each in damaged]))
    assert tuned["false_alarms"] == pytest.approx((known < 0).mean())
    assert tuned["not_evaluated"] == pytest.approx(np.isnan(healthy).mean())
    assert tuned["fresh_ci_low"] < tuned["fresh"] < tuned["fresh_ci_high"]
    assert tuned["within_limit"] == (tuned["false_alarms_ci_low"] <= 0.02)
    single = task.confirm(windowed(), OTHER, random_state=3)
    pd.testing.assert_series_equal(single.loc["CompensatedDetector"], table.loc["single"], check_names=False)


def test_who_takes_no_labels_is_named_after_a_search(fem):
    task = task_of(fem, columns=MODES)
    forest = IsolationForest(n_estimators=10, random_state=0)
    search = GridSearchCV(forest, {"max_samples": [50]}, cv=task.cv, scoring=task.scoring).fit(task.X, task.y)
    with pytest.warns(UserWarning, match="search-refits"):
        task.refit(search)


@pytest.mark.filterwarnings("ignore")
def test_a_search_without_any_score_has_no_best_detector(fem):
    task = task_of(fem)  # whose columns have temperatures, which a forest takes for frequencies
    forest = IsolationForest(n_estimators=10, random_state=0)
    options = {"cv": task.cv, "scoring": task.scoring, "refit": False}
    search = GridSearchCV(forest, {"max_samples": [50]}, **options).fit(task.X, task.y)
    assert np.isnan(search.best_score_)
    with pytest.raises(ValueError, match="no number"):
        task.refit(search)


def test_confirmation_in_the_same_weather_says_so(fem):
    task = task_of(fem, columns=MODES)
    with pytest.warns(UserWarning, match="other-weather"):
        table = task.confirm(MahalanobisDetector(), WEATHER, random_state=3)
    assert table["optimism"].item() != 0  # also with the seed of the task, the noise is fresh


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scenarios": [Scenario("healthy")]}, "has damaged records"),
        ({"scenarios": [Scenario("damaged", {"top": 0.1})]}, "has healthy records"),
        ({"scenarios": [Scenario("one"), Scenario("one", {"top": 0.1})]}, "each with a name of its own"),
        ({"scenarios": [Scenario("one"), Scenario("two", {"roof": 0.1})]}, "damage groups"),
        ({"n_splits": 3}, "n_splits is 3 for 2 repeats"),
        ({"columns": ["f1", "f9"]}, "columns names"),
        ({"columns": ["T1"]}, "modes among them"),
        ({"baseline": SIDE_BY_SIDE.rename(columns={"f1": "g1"})}, "the baseline has the columns"),
        ({"T": WEATHER.to_numpy()}, "T on a DatetimeIndex as well"),
        ({"T": WEATHER.tz_localize("UTC")}, "time zone"),
        ({"n_repeats": 4000, "T": WEATHER}, "after the year 2262"),
    ],
)
def test_what_is_wrong_is_said(fem, options, message):
    with pytest.raises(ValueError, match=message):
        task_of(fem, **options)


@pytest.mark.filterwarnings("ignore:.*few-records")  # of temperatures, which are no residuals
def test_a_scorer_refuses_other_rows_and_what_it_cannot_evaluate(fem, task):
    detector = task.refit(with_memory("5D"))
    with pytest.raises(ValueError, match="365 of 365 rows are no simulated records"):
        task.scoring(detector, SIDE_BY_SIDE, np.ones(365))
    with pytest.raises(ValueError, match="expected a frame"):
        task.scoring(detector, task.X.to_numpy(), task.y)
    with pytest.raises(ValueError, match="temperatures"):
        task.scoring(MahalanobisDetector().fit(task.baseline), task.X[365:], task.y[365:])
    with pytest.raises(ValueError, match="rows is damaged"):
        task.scoring(detector, task.X.iloc[rows_of(task, "healthy", 0)], np.ones(120))
    with pytest.raises(ValueError, match="expected an outlier detector"):
        task.scoring(LinearRegression(), task.X[365:], task.y[365:])
    with pytest.raises(ValueError, match="expected a search that is fitted"):
        task.refit(GridSearchCV(with_memory(1), {}))
    with pytest.raises(ValueError, match="detectors is empty"):
        task.confirm({}, OTHER)
