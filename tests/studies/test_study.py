"""Detectability studies of the truss."""

import warnings
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.metrics import probability_of_detection, time_to_detection
from skthermo.studies import ProgressiveDamage, Scenario, compare_extensions, detection_task, sweep
from skthermo.surrogate import TemperatureMapper
from tests.studies.studies import (
    LATER,
    MODES,
    SIDE_BY_SIDE,
    WEATHER,
    WITHIN,
    YEAR,
    compensated,
    ran,
    study_of,
    windowed,
)
from tests.surrogate.chains import chain

ONLY = "MahalanobisDetector"  # name of the only detector of a study


def first_seed(random_state):
    return int(np.random.RandomState(random_state).randint(np.iinfo(np.int32).max, size=(1, 2))[0, 0])


@pytest.mark.one_case
@pytest.mark.parametrize("noise", ["fitted", 0.01])
def test_records_are_those_that_the_chain_simulates(fem, noise):
    scenarios = [Scenario("healthy"), Scenario("a fifth", {"bottom": 0.2})]
    study = study_of(fem, MahalanobisDetector(), scenarios, n_repeats=1, noise=noise, random_state=3)
    results = study.run(WEATHER).set_index("scenario")
    detector = MahalanobisDetector().fit(YEAR.frequencies)
    assert study.thresholds_[ONLY] == pytest.approx(detector.threshold_, rel=1e-9)
    for name, damage in (("healthy", None), ("a fifth", {"bottom": 0.2})):
        records = fem.simulate(WEATHER, damage=damage, noise=noise, random_state=first_seed(3))
        index = detector.damage_index(records)
        pd.testing.assert_series_equal(study.indices_[ONLY, name, "simulated"], index, **WITHIN)
        assert results.loc[name, "rate"] == probability_of_detection(index, detector.threshold_)
        wait = time_to_detection(index, detector.threshold_)
        assert results.loc[name, "time_to_detection"] == wait
    assert results["measure"].tolist() == ["PFA", "POD"]


def test_all_scenarios_share_the_noise_and_repeats_do_not(fem):
    scenarios = [Scenario("one", {"top": 0.2}), Scenario("other", {"top": 0.2})]
    study = study_of(fem, MahalanobisDetector(), scenarios, n_repeats=3)
    one, other = study.run(WEATHER).drop(columns="scenario").itertuples(index=False)
    assert one == other
    decisions = study.decisions_[ONLY, "one", "simulated"]
    assert one.n_alarms == (decisions < 0).sum()
    assert all((first != second).mean() > 0.95 for first, second in combinations(decisions, 2))
    fewer = ran(fem, scenarios)
    np.testing.assert_array_equal(fewer.decisions_[ONLY, "one", "simulated"], decisions[:2])


def test_without_a_baseline_the_detector_learns_what_the_chain_has_learned(fem):
    for detector, baseline in ((MahalanobisDetector(), YEAR.frequencies), (compensated(), SIDE_BY_SIDE)):
        study = study_of(fem, detector, [{"top": 0.2}], n_repeats=1)
        pd.testing.assert_frame_equal(study.run(WEATHER), study.run(WEATHER, baseline))


def test_a_detector_that_compensates_gets_the_simulated_temperatures(fem):
    scenarios = sweep(fem, (0.1,), ["top"])
    study = study_of(fem, compensated(), scenarios, n_repeats=1)
    study.run(WEATHER, SIDE_BY_SIDE[[*MODES, "T2", "T1", "T3"]])
    detector = compensated().fit(SIDE_BY_SIDE[[*MODES, "T2", "T1", "T3"]])
    records = fem.simulate(WEATHER, damage={"top": 0.1}, noise=0.01, random_state=first_seed(0))
    expected = -detector.score_samples(records.join(WEATHER)[[*MODES, "T2", "T1", "T3"]])
    np.testing.assert_allclose(study.indices_[ONLY, "top 10 %", "simulated"], expected, **WITHIN)


def test_a_reference_that_equals_the_simulation_has_its_rates(fem):
    scenarios = sweep(fem, (0.1,), ["top"])

    def truth(scenario, seed):
        if scenario.is_healthy:
            return None
        return fem.simulate(WEATHER, **scenario.changes(WEATHER), noise=0.01, random_state=seed)

    study = study_of(fem, MahalanobisDetector(), scenarios, n_repeats=3)
    results = study.run(WEATHER, reference=truth)
    assert results["source"].tolist() == ["simulated", "simulated", "reference"]
    simulated, true = results[results["scenario"] == "top 10 %"].itertuples()
    simulated_index, true_index = (study.indices_[ONLY, "top 10 %", source] for source in results["source"][1:])
    assert (simulated_index != true_index).all()  # other seeds
    assert true.ci_low < simulated.rate < true.ci_high
    np.testing.assert_array_equal(results["n_repeats"], 3)


def test_measured_records_may_have_rows_gaps_and_temperatures_of_their_own(fem):
    measured = make_truss_campaign(2, damage={"top": 0.3}, random_state=5)
    frequencies = measured.frequencies.mask(np.random.RandomState(0).uniform(size=(730, 6)) < 0.1)
    frequencies.iloc[10:30] = np.nan
    side_by_side = measured.temperatures.join(frequencies)
    scenarios = [{"top": 0.3}]
    for detector, records in ((MahalanobisDetector(), frequencies), (compensated(), side_by_side)):
        study = study_of(fem, detector, scenarios, n_repeats=1)
        results = study.run(WEATHER, reference={"top 30 %": records}).set_index(["scenario", "source"])
        row = results.loc[("top 30 %", "reference")]
        decision = study.detectors_[study.detector_name()].decision_function(records)
        assert row["n_records"] == np.count_nonzero(~np.isnan(decision)) == 710
        assert row["rate"] == np.mean(decision[~np.isnan(decision)] < 0)
        assert row["n_repeats"] == 1
        pd.testing.assert_index_equal(study.indices_[ONLY, "top 30 %", "reference"].index, measured.frequencies.index)
        expected = -study.detectors_[study.detector_name()].score_samples(records)
        np.testing.assert_array_equal(study.indices_[ONLY, "top 30 %", "reference"], expected)


def test_a_reference_on_the_same_rows_takes_their_temperatures(fem):
    study = study_of(fem, compensated(), [{"top": 0.3}], n_repeats=1)
    damaged = make_truss_campaign(damage={"top": 0.3}, random_state=1)
    T, F = damaged.temperatures[::3], damaged.frequencies[::3]
    alone = study.run(WEATHER, reference={"top 30 %": F})
    for records in (T.join(F), F.to_numpy()):
        pd.testing.assert_frame_equal(study.run(WEATHER, reference={"top 30 %": records}), alone)


def test_progressive_damage_counts_from_its_onset(fem):
    onset = WEATHER.index[20]
    scenarios = [
        ProgressiveDamage("by time", {"top": 0.4}, onset, WEATHER.index[81]),
        ProgressiveDamage("by number", {"top": 0.4}, 20, 81),
    ]
    study = study_of(fem, MahalanobisDetector(), scenarios, n_repeats=1)
    results = study.run(WEATHER)
    assert results[["pi_low", "pi_high"]].isna().all(axis=None)  # one repeat has no band
    results = results.drop(columns=["scenario", "pi_low", "pi_high"])
    by_time, by_number = results.itertuples(index=False)
    assert by_time == by_number
    index = study.indices_[ONLY, "by time", "simulated"]
    assert by_time.rate == probability_of_detection(index[index.index >= onset], study.thresholds_[ONLY])
    assert by_time.n_records == 102
    assert by_time.time_to_detection == time_to_detection(index, study.thresholds_[ONLY], onset)
    assert index[61:81].mean() > 2 * index[20:40].mean()


def test_changes_that_are_no_damage_can_be_detected_too(fem):
    scenarios = [
        Scenario("ballast", mass=np.full(23, 500.0), family="mass", severity=0.1),
        Scenario("stiffer", parameters={"top": 1.3}),
    ]
    results = study_of(fem, MahalanobisDetector(), scenarios).run(WEATHER)
    assert (results["measure"] == "POD").all()
    assert (results["rate"] > 0.2).all()


@pytest.fixture(scope="module")
def swept(fem):
    """A study of damage, of strengthening, and of damage that is too small to be found."""
    found = [*sweep(fem, (-0.3, -0.2, -0.1, 0.1, 0.2, 0.3), ["bottom"]), *sweep(fem, (0.1, 0.2, 0.3), ["top"])[1:]]
    scenarios = [*found, *sweep(fem, (0.001, 0.002), ["vertical"])[1:]]
    study = study_of(fem, MahalanobisDetector(), scenarios, n_repeats=5)
    study.run(WEATHER, confidence=0.9)
    return study


def smallest_of(study):
    """The smallest detectable damage by grid and by curve."""
    grid = study.minimum_detectable_damage()
    with pytest.warns(UserWarning, match="'vertical'.*outliers.*no-curve"):
        return grid, study.minimum_detectable_damage(method="curve")


def test_smallest_detectable_damage_by_grid_and_by_curve(fem, swept):
    rates, (grid, curve) = swept.results_.set_index("scenario")["rate"], smallest_of(swept)
    for group in ("bottom", "top"):
        smallest = next(s for s in (0.1, 0.2, 0.3) if rates[f"{group} {100 * s:g} %"] >= 0.9)
        assert grid.loc[(group, "simulated"), "mdd"] == smallest
        found = curve.loc[(group, "simulated")]
        assert smallest - 0.1 < found["mdd"] < smallest
        assert found["ci_low"] < found["mdd"] < found["ci_high"]
        fitted = swept.pod_curve(group)
        assert found["mdd"] == fitted.a90
        assert found["ci_high"] == fitted.a90_95  # two-sided 90 % bounds
    assert np.isnan(swept.minimum_detectable_damage(level=0.999).loc[("top", "simulated"), "mdd"])
    alone = study_of(fem, MahalanobisDetector(), sweep(fem, (0.1, 0.2, 0.3), ["bottom"]), n_repeats=5)
    alone.run(WEATHER, confidence=0.9)
    for method, found in (("grid", grid), ("curve", curve)):
        found = found["mdd"].droplevel("source")
        assert found.index.tolist() == ["bottom strengthened", "bottom", "top", "vertical"]
        assert -0.4 < found["bottom strengthened"] < 0 < found["bottom"] < 0.4
        assert found["bottom"] == pytest.approx(alone.minimum_detectable_damage(method=method)["mdd"].iloc[0])


def test_a_family_that_is_not_found_leaves_the_others_their_curves(fem, swept):
    assert [swept.is_undetected(family) for family in ("bottom", "vertical")] == [False, True]
    unknown = smallest_of(swept)[1].loc[("vertical", "simulated")]
    assert (np.isnan(unknown["mdd"]), unknown["ci_low"], np.isnan(unknown["ci_high"])) == (True, 0.002, True)
    few = [*sweep(fem, (0.1, 0.2), ["bottom"]), *sweep(fem, (0.001, 0.002), ["vertical"])[1:]]
    study = ran(fem, few)
    table = compare_extensions(study, WEATHER, modes=[], baseline_factors=(2,)).set_index("family")
    assert np.isfinite(table["gain"]["bottom"])
    assert np.isnan(table["gain"]["vertical"])


@pytest.mark.parametrize(
    ("severities", "group", "bracket"), [((0.1, 0.5), "diagonal", (0.1, 0.5)), ((0.4,), "bottom", (0.0, 0.4))]
)
@pytest.mark.filterwarnings("ignore:.*no-curve")
def test_without_a_slope_damage_is_bracketed(fem, severities, group, bracket):
    study = ran(fem, sweep(fem, severities, [group]))
    found = study.minimum_detectable_damage(method="curve").iloc[0]
    assert np.isnan(found["mdd"])
    assert (found["ci_low"], found["ci_high"]) == bracket


@pytest.mark.parametrize(
    ("detector", "arguments", "message"),
    [
        (compensated(), {"baseline": YEAR.frequencies}, "compensates for temperature, and the baseline has none"),
        (MahalanobisDetector(), {"baseline": YEAR.frequencies.add_suffix(" Hz")}, "expected modes"),
        (MahalanobisDetector(), {"baseline": YEAR.temperatures}, "expected modes"),
        (MahalanobisDetector(), {"baseline": YEAR.frequencies.to_numpy()[:, :4]}, "expected modes"),
        (MahalanobisDetector(), {"confidence": 95}, "confidence is 95"),
        (MahalanobisDetector(), {"reference": {"top": YEAR.frequencies}}, r"reference has the scenarios \['top'\]"),
        (MahalanobisDetector(), {"reference": YEAR.frequencies.to_numpy()}, "expected {name of scenario: frequencies}"),
        (MahalanobisDetector(), {"reference": {"healthy": YEAR.frequencies[["f1"]]}}, "lacks the columns"),
        (MahalanobisDetector(), {"reference": {"healthy": YEAR.frequencies * np.nan}}, "none of 365 records"),
        (MahalanobisDetector(), {"reference": lambda scenario, seed: YEAR.frequencies[:9]}, "expected frequencies for"),
        (compensated(), {"reference": {"healthy": YEAR.frequencies[:99]}}, "lacks the columns"),
    ],
)
@pytest.mark.filterwarnings("ignore:365 of 365.*not-evaluated")  # before the error
def test_records_that_do_not_fit_are_errors(fem, detector, arguments, message):
    study = study_of(fem, detector, [Scenario("healthy")], n_repeats=1)
    with pytest.raises(ValueError, match=message):
        study.run(WEATHER, **arguments)


def test_a_study_must_be_run_before_it_is_asked(fem):
    study = study_of(fem, MahalanobisDetector(), sweep(fem, (0.1, 0.2), ["top"]), n_repeats=1)
    for ask in (study.minimum_detectable_damage, lambda: study.is_undetected("top")):
        with pytest.raises(ValueError, match="expected a call of run before"):
            ask()
    study.run(WEATHER)
    with pytest.raises(ValueError, match="family 'bottom', source 'simulated' is not in the results"):
        study.pod_curve("bottom")
    with pytest.raises(ValueError, match="level is 90"):
        study.minimum_detectable_damage(level=90)
    with pytest.raises(ValueError, match="expected 'grid' or 'curve'"):
        study.minimum_detectable_damage(method="spline")


@pytest.fixture(scope="module")
def in_service():
    """A chain whose training records have an outage, and a sensor that failed."""
    T, F = YEAR.temperatures[::3].copy(), YEAR.frequencies[::3].copy()
    T.iloc[60:80, 1] = np.nan
    F.iloc[15:25] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the gaps, which are meant
        return chain(mapper=TemperatureMapper(LinearRegression()), random_state=0).fit(T, F)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*faulty-sensor", "ignore:.*not-evaluated")
def test_a_repeat_has_the_same_gaps_in_all_scenarios_and_other_repeats_have_others(in_service):
    scenarios = [{}, {"bottom": 0.2}]
    study = study_of(in_service, compensated(), scenarios, n_repeats=3, gaps="fitted")
    results = study.run(WEATHER)
    healthy, damaged = (np.isnan(one) for one in study.decisions_.values())
    np.testing.assert_array_equal(healthy, damaged)
    assert (results["n_not_evaluated"] == healthy.sum()).all()
    assert (healthy[0] != healthy[1]).any()
    assert healthy.any()
    seeds = np.random.RandomState(0).randint(np.iinfo(np.int32).max, size=(3, 2))[:, 0]
    outages = [
        in_service.recorder_.gaps(in_service.weather(WEATHER), random_state=int(seed))[1].all(axis=1) for seed in seeds
    ]
    np.testing.assert_array_equal(healthy, outages)


def test_a_detector_sees_temperatures_with_their_gaps(in_service):
    task = detection_task(in_service, WEATHER, [{}, {"top": 0.2}], gaps="fitted", n_repeats=2, random_state=0)
    gaps = task.X["T2"][len(task.baseline) :].isna().to_numpy().reshape(2, 2, -1)
    np.testing.assert_array_equal(gaps[:, 0], gaps[:, 1])
    assert gaps.any()
    assert (gaps[0] != gaps[1]).any()


def test_repeats_grow_until_rates_are_as_certain_as_asked(fem):
    numbers, options = [], {"uncertainty": "weather", "n_replicates": 2}
    for tol in (0.2, 0.04, 0.001):
        scenarios = [{}] if tol == 0.001 else sweep(fem, (0.1, 0.2), ["bottom"])
        study = study_of(fem, MahalanobisDetector(), scenarios, n_repeats="auto", tol=tol, **options)
        results = study.run(WEATHER)
        (number,) = results["n_repeats"].unique()
        numbers.append(number)
        if number < 20:
            assert (results["ci_high"] - results["ci_low"]).max() / 2 < 1.15 * tol
            fixed = study_of(fem, MahalanobisDetector(), scenarios, n_repeats=int(number), **options).run(WEATHER)
            pd.testing.assert_frame_equal(results, fixed)
    assert numbers == sorted(numbers)
    assert (numbers[0], numbers[-1]) == (3, 20)
    assert study_of(fem, MahalanobisDetector(), [{}], n_repeats="auto").run(WEATHER[:9])["n_repeats"].item() == 20
    with pytest.raises(ValueError, match="n_repeats"):
        study_of(fem, MahalanobisDetector(), scenarios, n_repeats="many").run(WEATHER)
    with pytest.raises(ValueError, match="tol"):
        study_of(fem, MahalanobisDetector(), scenarios, n_repeats="auto", tol=0.0).run(WEATHER)


# Studies of which little can be said


def test_a_baseline_in_other_units_gives_false_alarms_that_are_said(fem):
    wrong = study_of(fem, MahalanobisDetector(), [Scenario("healthy")])
    with pytest.warns(UserWarning, match="100% .*'healthy'.*many-false-alarms"):
        wrong.run(WEATHER, YEAR.frequencies * 2 * np.pi)
    assert any("many-false-alarms" in text for text in wrong.warnings_)


@pytest.mark.parametrize("is_named", [False, True])
def test_weather_by_a_longer_step_than_the_baselines_leaves_windows_without_values(fem, is_named):
    thinned = WEATHER[:30] if is_named else LATER.temperatures[:2]
    with pytest.raises(ValueError, match=r"none of .* can be evaluated") as raised:
        study_of(fem, windowed("5D"), [Scenario("healthy")], n_repeats=1).run(thinned)
    assert ("every 3 days, records of the baseline every 1 day" in str(raised.value)) == is_named


def test_a_blind_detector_is_said_to_be_blind(fem):
    blind = study_of(fem, MahalanobisDetector(), sweep(fem, (0.05, 0.1), ["bottom"]))
    results = blind.run(WEATHER)
    for rate in (results["rate"][0], 0.0):
        results["rate"] = rate
        with pytest.warns(UserWarning, match="outliers of the baseline raise the threshold.*no-curve") as caught:
            minimum = blind.minimum_detectable_damage(method="curve")
        assert len(caught) == 1
        assert minimum["mdd"].isna().all()


def test_errors_name_the_family_with_damage_and_strengthening(fem):
    mixed = study_of(
        fem, MahalanobisDetector(), [Scenario(f"bottom {severity}", {"bottom": severity}) for severity in (-0.1, 0.2)]
    )
    mixed.run(WEATHER)
    for ask in (mixed.minimum_detectable_damage, lambda: mixed.pod_curve("bottom")):
        with pytest.raises(ValueError, match=r"family 'bottom': severities are \[-0.1, 0.2\]"):
            ask()
