"""How soon damage is found, in the laws of alarms of which the chances are known."""

import warnings

import numpy as np
import pandas as pd
import pytest

from skthermo.detection import MahalanobisDetector
from skthermo.studies import ProgressiveDamage
from tests.studies.studies import WEATHER, WITHIN, study_of, windowed
from tests.surrogate.chains import F, T, chain, mapper


@pytest.fixture(scope="module")
def fem():
    return chain(random_state=0).fit(T, F)


@pytest.fixture(scope="module")
def study(fem):
    detectors = {
        "single": MahalanobisDetector(),
        "week": windowed(7),
        "month": windowed(30),
    }
    scenarios = [{}, {"bottom": 0.06}, {"bottom": 0.6}, ProgressiveDamage("crack", {"bottom": 0.1}, onset=100)]
    study = study_of(fem, detectors, scenarios, n_repeats=8)
    study.run(WEATHER)
    return study


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


def test_windows_need_several_damaged_records_because_one_cannot_dominate_a_mean(study):
    table = study.time_to_detection(["1D", "30D"], detector="month").set_index("scenario")
    certain = table.loc["bottom 60 %"]
    assert (study.decisions_["single", "bottom 60 %", "simulated"] < 0).all()
    assert certain["1D"] < 0.5
    assert certain["30D"] == 1
    assert pd.Timedelta("1D") < certain["reliable"] <= pd.Timedelta("30D")


def test_windows_after_an_onset_are_those_of_records_that_change_there(study, fem):
    seed = int(np.random.RandomState(0).randint(np.iinfo(np.int32).max, size=(4, 2))[0, 0])
    healthy, damaged = (
        fem.simulate(WEATHER, damage=damage, noise="fitted", random_state=seed) for damage in ({}, {"bottom": 0.06})
    )
    found = study.transitions_["week", "bottom 6 %", "simulated"][0]
    for number, onset in ((0, 7), (3, 49)):
        changed = WEATHER.join(pd.concat([healthy[:onset], damaged[onset:]]))
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
    often, never = ({"d": MahalanobisDetector(0.2)}, {"d": MahalanobisDetector(1e-6, threshold="chi2")})
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
