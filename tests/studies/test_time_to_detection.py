"""How soon damage is found, in the laws of alarms of which the chances are known."""

import warnings

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.stats import norm

from skthermo.detection import MahalanobisDetector, WindowedAlarm
from skthermo.studies import ProgressiveDamage, Scenario
from skthermo.studies.detectability._rates import EvaluatedRecords
from skthermo.studies.detectability._simulation import damaged_rows, onsets_of
from skthermo.studies.detectability._waits import Waits
from tests.studies.studies import WEATHER, WITHIN, study_of
from tests.surrogate.chains import F, T, chain, mapper


def evaluated(decisions, index=None, scenario=None):
    index = pd.date_range("2030-01-01", periods=decisions.shape[1], freq="D") if index is None else index
    scenario = scenario or Scenario("a tenth", {"bottom": 0.1})
    return EvaluatedRecords("detector", scenario, "simulated", pd.Series(0.0, index), decisions)


def decisions_with(rate, memory=0.0, shape=(20, 400), seed=0):
    """Decisions that are negative at this rate, with a normal memory from record to record."""
    shocks = np.random.default_rng(seed).standard_normal((shape[0], shape[1] + 200))
    values = lfilter([np.sqrt(1 - memory**2)], [1, -memory], shocks, axis=1)[:, 200:]
    return values - norm.ppf(rate)


@pytest.fixture(scope="module")
def fem():
    return chain(random_state=0).fit(T, F)


@pytest.fixture(scope="module")
def study(fem):
    detectors = {
        "single": MahalanobisDetector(),
        "week": WindowedAlarm(7),
        "three of three": WindowedAlarm(3, rule="m-of-n", m=3),
    }
    scenarios = [{}, {"bottom": 0.06}, {"bottom": 0.6}, ProgressiveDamage("crack", {"bottom": 0.1}, onset=100)]
    study = study_of(fem, detectors, scenarios, n_repeats=8)
    study.run(WEATHER)
    return study


@pytest.mark.parametrize("rate", [0.02, 0.1, 0.4])
def test_independent_records_follow_the_geometric_law(rate):
    waits = Waits.of(evaluated(decisions_with(rate, shape=(300, 400))))
    for number in (1, 7, 30):
        found, lowest, highest = waits.found(number, 0.999)
        assert lowest <= 1 - (1 - rate) ** number <= highest
        assert highest - lowest < 0.06
        assert lowest < found < highest or found > 0.9999
    expected = np.ceil(np.log(0.5) / np.log(1 - rate))
    assert waits.within(0.5) == pytest.approx(expected, abs=1, rel=0.03)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 40), st.floats(0.02, 0.9))
def test_waits_are_those_of_a_count_from_each_onset(seed, n_records, rate):
    alarms = np.random.default_rng(seed).random((2, n_records)) < rate
    found = Waits.of(evaluated(np.where(alarms, -1.0, 1.0))).steps
    for repeat in range(2):
        for onset in range(n_records):
            following = np.roll(alarms[repeat], -onset)
            expected = following.argmax() + 1 if following.any() else np.inf
            assert found[repeat, onset] == expected


def test_dependence_makes_waits_longer_and_bounds_wider():
    single, lasting = (Waits.of(evaluated(decisions_with(0.1, memory))) for memory in (0.0, 0.95))
    assert lasting.found(7, 0.95)[0] < single.found(7, 0.95)[0] - 0.1
    assert lasting.within(0.5) > 1.5 * single.within(0.5)
    widths = [np.ptp(one.found(7, 0.95)[1:]) for one in (lasting, single)]
    assert widths[0] > 1.2 * widths[1]


@pytest.mark.one_case
@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_bounds_hold_the_long_run(memory):
    truth = Waits.of(evaluated(decisions_with(0.1, memory, (2000, 400), seed=99))).found(7, 0.9)[0]
    bounds = [Waits.of(evaluated(decisions_with(0.1, memory, (5, 200), seed))).found(7, 0.9)[1:] for seed in range(100)]
    assert np.mean([lowest <= truth <= highest for lowest, highest in bounds]) >= 0.83


def test_records_that_are_not_evaluated_delay():
    decisions = decisions_with(0.2, shape=(300, 400))
    every = Waits.of(evaluated(decisions))
    decisions[:, ::2] = np.nan
    second = Waits.of(evaluated(decisions))
    assert second.share_not_evaluated == 0.5
    assert second.found(10, 0.95)[0] == pytest.approx(every.found(5, 0.95)[0], abs=0.02)
    assert np.isinf(Waits.of(evaluated(np.full((2, 50), np.nan))).steps).all()


def test_stamps_that_are_absent_delay_as_an_outage_does():
    stamps = pd.date_range("2030-01-01", periods=390, freq="h")
    decisions, kept = decisions_with(0.2, shape=(20, 390)), np.arange(390) % 40 < 30
    absent = Waits.of(evaluated(decisions[:, kept], stamps[kept]))
    empty = Waits.of(evaluated(np.where(kept, decisions, np.nan), stamps))
    assert absent.length == pd.Timedelta("1h")
    np.testing.assert_array_equal(absent.steps, empty.steps)
    assert absent.count(pd.Timedelta("1D")) == 24


def test_clocks_that_are_not_exact_and_records_out_of_order_change_nothing():
    stamps = pd.date_range("2030-01-01", periods=100, freq="D")
    decisions, shuffled = decisions_with(0.2, shape=(3, 100)), np.random.default_rng(0).permutation(100)
    late = stamps + pd.to_timedelta(np.random.default_rng(1).uniform(0, 600, 100), "s")
    expected, found = Waits.of(evaluated(decisions)), Waits.of(evaluated(decisions[:, shuffled], late[shuffled]))
    np.testing.assert_array_equal(found.steps, expected.steps)
    assert [found.count(pd.Timedelta(days=days)) for days in (1, 7, 30)] == [1, 7, 30]


def test_a_table_has_a_row_for_each_detector_and_scenario(study):
    table = study.time_to_detection().set_index(["detector", "scenario"])
    assert len(table) == 12
    for name in ("1D", "7D", "30D"):
        between = table[f"{name} ci_low"].le(table[name]) & table[name].le(table[f"{name} ci_high"])
        assert between.all()
    single = table.loc["single"]
    assert single.loc["bottom 6 %", "1D"] == study.results_.loc[1, "rate"]
    assert (single["7D healthy"] == single.loc["healthy", "7D"])[:3].all()
    for sooner, later in (("median", "reliable"), ("reliable", "reliable highest")):
        known = table[table[later].notna()]
        assert (known[sooner] <= known[later]).all()
        assert len(known)


def test_damage_with_an_onset_begins_there(study):
    table = study.time_to_detection(["10D"], detector="single").set_index("scenario")
    decisions = study.decisions_["single", "crack", "simulated"]
    assert table.loc["crack", "10D"] == (decisions[:, 100:110] < 0).any(axis=1).mean()
    healthy = study.decisions_["single", "healthy", "simulated"]
    assert table.loc["crack", "10D healthy"] == (healthy[:, 100:110] < 0).any(axis=1).mean()


def test_windows_need_as_many_damaged_records_as_their_rule(study):
    table = study.time_to_detection(["2D", "3D"], detector="three of three").set_index("scenario")
    certain = table.loc["bottom 60 %"]
    assert (study.decisions_["single", "bottom 60 %", "simulated"] < 0).all()
    assert certain["2D"] < 0.5
    assert [certain["3D"], certain["reliable"]] == [1, pd.Timedelta("3D")]


def test_windows_after_an_onset_are_those_of_records_that_change_there(study, fem):
    seed = int(np.random.RandomState(0).randint(np.iinfo(np.int32).max, size=(4, 2))[0, 0])
    healthy, damaged = (
        fem.simulate(WEATHER, damage=damage, noise="fitted", random_state=seed) for damage in ({}, {"bottom": 0.06})
    )
    found = study.transitions_["week", "bottom 6 %", "simulated"][0]
    for number, onset in ((0, 7), (3, 49)):
        changed = pd.concat([healthy[:onset], damaged[onset:]])
        expected = study.detectors_["week"].decision_function(changed)[onset : onset + 7]
        np.testing.assert_allclose(found[number], expected, **WITHIN)
    assert not any(key[0] == "single" for key in study.transitions_)


def test_rows_without_stamps_are_counted():
    arrays = chain(mapper=mapper(1), random_state=0).fit(T.to_numpy(), F.to_numpy())
    study = study_of(arrays, MahalanobisDetector(), [{"bottom": 0.3}])
    study.run(WEATHER.to_numpy()[:100])
    row = study.time_to_detection().iloc[0]
    assert row["7"] == 1
    assert row["median"] == 1.0
    assert np.isnan(row["7 healthy"])
    assert np.isnan(study.time_to_detection([101]).iloc[0]["101"])
    with pytest.raises(ValueError, match="within has '7D'; expected numbers of records"):
        study.time_to_detection(["7D"])


def test_the_smallest_damage_that_is_soon_found_is_described_in_words(study):
    every = study.time_to_detection(detector="single").set_index("scenario")
    healthy, certain = every.loc["healthy"], every.loc["bottom 60 %"]
    assert f"{round(100 * healthy['7D'])} within 7 days" in healthy["text"]
    false = f"false alarms in that time: {100 * healthy['1D']:.0f} of 100"
    assert certain["text"] == f"is detected within 1 day in 95 of 100 cases; {false}"
    soon = study.time_to_detection(detector="single", smallest=True).set_index("scenario")
    assert list(soon.index) == ["healthy", "crack"]
    assert every.loc["bottom 6 %", "reliable"] > pd.Timedelta("30D") >= soon.loc["crack", "reliable"]
    smallest = study.time_to_detection(detector=study.ranking().index[0], smallest=True)
    sentences = [f"{row['scenario']!r} {row['text']}." for _, row in smallest.iterrows()]
    assert "\n".join(sentences) in study.summary()


def test_damage_that_is_not_found_or_as_often_as_chance_is_called_so(fem):
    scenarios = [{}, {"bottom": 0.001}]
    often, never = ({"d": MahalanobisDetector(0.2)}, {"d": WindowedAlarm(60, contamination=0.001)})
    words = []
    for detectors in (often, never):
        study = study_of(fem, detectors, scenarios, n_repeats=3)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of thresholds learned from too few windows
            study.run(WEATHER)
        words.append(study.time_to_detection().set_index("scenario").loc["bottom 0.1 %", "text"])
    assert words[0].endswith("so that such an alarm is weak evidence")
    assert words[1] == "is detected in fewer than 95 of 100 cases within the 365 days of the records"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"within": [7]}, "within has 7; expected times such as '7D'"),
        ({"within": "soon"}, "within has 'soon'; expected times"),
        ({"within": ["-1D"]}, "within has '-1D'"),
        ({"within": []}, r"within is \[\]; expected one or more times, each once"),
        ({"within": ["7D", "7D"]}, r"within is \['7D', '7D'\]; expected one or more times, each once"),
        ({"level": 95}, "level"),
        ({"source": "measured"}, r"source is 'measured'; expected one of \['simulated'\]"),
        ({"detector": "none"}, "detector is 'none'"),
    ],
)
def test_what_is_no_time_is_refused(study, options, message):
    with pytest.raises(ValueError, match=message):
        study.time_to_detection(**options)


@pytest.mark.parametrize(("n_records", "n_window"), [(1, 3), (7, 4), (12, 3), (13, 3), (50, 7), (8, 8)])
def test_damage_lasts_a_window_after_each_onset(n_records, n_window):
    onsets = onsets_of(n_records, n_window)
    expected = [any(0 <= row - onset < n_window for onset in onsets) for row in range(n_records)]
    np.testing.assert_array_equal(damaged_rows(n_records, n_window), expected)
