"""Several detectors beside each other: what is drawn is what the study found, and nothing is left unsaid."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from sklearn.exceptions import NotFittedError

from skthermo.plotting import DetectorsDisplay, PODCurveDisplay
from skthermo.studies import DetectabilityStudy, ProgressiveDamage, Scenario, pod_curve

FOUND = "piers 18 %"


def results_of(simulated, measured, scenario="healthy", measure="PFA", half=0.02):
    """Rows of a study with one scenario; a rate that is None is not there."""
    rows = []
    for source, rates in (("simulated", simulated), ("reference", measured)):
        for detector, rate in rates.items():
            row = {"detector": detector, "scenario": scenario, "source": source, "measure": measure, "rate": rate}
            row |= {"n_records": 200, "n_not_evaluated": 0, "error": ""}
            if source == "simulated":
                row |= {"pi_low": max(rate - half, 0), "pi_high": min(rate + half, 1)}
            rows.append(row)
    return pd.DataFrame(rows)


SIMULATED = {"raw, a": 0.01, "raw, b": 0.2, "whitened": 0.02, "linear": 0.3}
MEASURED = {"raw, a": 0.02, "raw, b": 0.26, "whitened": 0.0, "linear": 0.31}
HEALTHY = results_of(SIMULATED, MEASURED)
DAMAGED = results_of({k: 1 - 2 * v for k, v in SIMULATED.items()}, dict.fromkeys(SIMULATED, 0.9), FOUND, "POD")
BOTH = pd.concat([DAMAGED, HEALTHY], ignore_index=True)
FAILED = pd.DataFrame([{"detector": "cointegration", "error": "LinAlgError: singular"}])


def texts(ax):
    return [text.get_text() for text in ax.texts if text.get_text()]


def limit_of(display):
    return display.axes_[0].lines[-1].get_xdata()[0]


def rows_named(ax):
    return [text.get_text() for text in ax.get_yticklabels()]


def test_measured_rates_stand_beside_bands_and_are_counted():
    display = DetectorsDisplay.from_predictions(BOTH)
    healthy, damaged = display.axes_
    assert "3 of 4" in healthy.get_title()
    assert FOUND in damaged.get_title()
    names = rows_named(healthy)
    assert names == ["raw, a", "whitened", "raw, b", "linear"]  # by the damage that they find
    for detector, bar in zip(SIMULATED, display.bars_["healthy"], strict=True):
        row = HEALTHY[(HEALTHY["detector"] == detector) & (HEALTHY["source"] == "simulated")].iloc[0]
        low, width = bar.get_x(), bar.get_width()
        np.testing.assert_allclose([low, low + width], 100 * row[["pi_low", "pi_high"]].astype(float))
        assert bar.get_y() + bar.get_height() / 2 == pytest.approx(names.index(detector))
    inside, outside = display.marks_["healthy"]
    drawn = {names[int(y)]: x for points in (inside, outside) for x, y in points.get_offsets()}
    assert drawn == pytest.approx({name: 100 * rate for name, rate in MEASURED.items()})
    assert outside.get_offsets().tolist() == [[26.0, 2.0]]
    assert inside.get_facecolor().tolist() != outside.get_facecolor().tolist() == [[1, 1, 1, 1]]


@pytest.mark.parametrize(
    ("changed", "n_counted", "n_open"),
    [
        ({"pi_low": np.nan, "pi_high": np.nan}, 0, 0),
        ({"n_repeats": [20 if source == "reference" else 40 for source in HEALTHY["source"]]}, 0, 1),  # a mean
        ({"n_repeats": [1 if source == "reference" else 40 for source in HEALTHY["source"]]}, 4, 1),
    ],
)
def test_marks_outside_their_band_are_open_and_titles_count_single_campaigns(changed, n_counted, n_open):
    display = DetectorsDisplay.from_predictions(HEALTHY.assign(**changed))
    assert (f"of {n_counted}" in display.axes_[0].get_title()) == (n_counted > 0)
    assert len(display.marks_["healthy"][1].get_offsets()) == n_open


def test_groups_are_headings():
    groups = {name: "raw" if name.startswith("raw") else "compensated" for name in SIMULATED}
    display = DetectorsDisplay.from_predictions(BOTH, groups=groups)
    labels = display.axes_[0].get_yticklabels()
    assert [text.get_text() for text in labels] == ["raw", "raw, a", "raw, b", "compensated", "whitened", "linear"]
    assert [text.get_fontweight() == "bold" for text in labels] == [True, False, False, True, False, False]
    with pytest.raises(ValueError, match=r"groups names the detectors \['other'\]; expected some of"):
        DetectorsDisplay.from_predictions(BOTH, groups={"other": "raw"})


def test_failures_and_records_that_are_not_evaluated_are_reported():
    results = pd.concat([BOTH, FAILED], ignore_index=True)
    results.loc[(results["detector"] == "linear") & (results["source"] == "reference"), "n_not_evaluated"] = 50
    display = DetectorsDisplay.from_predictions(results)
    assert rows_named(display.axes_[0])[-1] == "cointegration"
    assert texts(display.axes_[0]) == ["20\N{NO-BREAK SPACE}% not evaluated", "failed: LinAlgError: singular"]
    assert texts(display.axes_[1]) == ["20\N{NO-BREAK SPACE}% not evaluated"]
    results = BOTH[(BOTH["detector"] != "linear") | (BOTH["scenario"] == "healthy")]
    results = pd.concat([results, pd.DataFrame([{"detector": "linear", "error": "ValueError: no"}])])
    healthy, damaged = DetectorsDisplay.from_predictions(results).axes_
    assert (texts(healthy), texts(damaged)) == ([], ["failed: ValueError: no"])


def test_scenarios_can_be_chosen_and_those_without_measured_records_are_not_drawn():
    other = results_of(SIMULATED, {}, "deck 5 %", "POD")
    results = pd.concat([BOTH, other], ignore_index=True)
    assert list(DetectorsDisplay.from_predictions(results).panels) == ["healthy", FOUND]
    assert list(DetectorsDisplay.from_predictions(results, scenarios=[FOUND]).panels) == [FOUND]
    with pytest.raises(ValueError, match=r"expected some of \['healthy', 'piers 18 %'\]"):
        DetectorsDisplay.from_predictions(results, scenarios=["deck 5 %"])
    with pytest.raises(ValueError, match=r"no scenario of \['deck 5 %'\] has both simulated and measured records"):
        DetectorsDisplay.from_predictions(other)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (BOTH.drop(columns="detector"), "expected a ranking, results"),
        (None, "table is None"),
        (pd.concat([BOTH, HEALTHY]), r"detector 'raw, a' has several rates of scenario 'healthy'"),
    ],
)
def test_what_is_no_result_is_named(table, message):
    with pytest.raises(ValueError, match=message):
        DetectorsDisplay.from_predictions(table)
    with pytest.raises(ValueError, match="what is 'bars'"):
        DetectorsDisplay.from_estimator(made_study(), "bars")
    with pytest.raises(NotFittedError):
        DetectorsDisplay.from_estimator(DetectabilityStudy(None, None, []))


def ranking_of(**rows):
    """A ranking of detectors by their false alarms, found damage, found damage at equal false alarms, and distance."""
    table = pd.DataFrame(rows, index=["false_alarms", "pod", "pod_at_equal_pfa", "pod_deficit"], dtype=float).T
    for name in ("false_alarms", "pod", "pod_deficit"):
        table[f"{name}_ci_low"], table[f"{name}_ci_high"] = table[name] - 0.01, table[name] + 0.01
    table["within_limit"], table["significantly_worse"] = table["false_alarms"] < 0.03, table["pod_deficit_ci_low"] > 0
    return table.assign(not_evaluated=0.0, error="")


RANKING = ranking_of(
    whitened=[0.01, 0.9, 0.92, 0.0],
    raw=[0.02, 0.5, 0.5, 0.42],
    good=[0.01, 0.9, 0.915, 0.005],
    loud=[0.3, 1, 0.7, 0.22],
)


def test_a_ranking_says_who_is_behind_who_is_loud_and_who_failed():
    failed = pd.DataFrame(
        {"error": "LinAlgError: singular", "within_limit": False, "significantly_worse": False}, ["none"]
    )
    ranking = pd.concat([RANKING, failed])
    ranking.loc["raw", "not_evaluated"] = 0.25
    display = DetectorsDisplay.from_predictions(ranking)
    names = rows_named(display.axes_[0])
    assert names == [
        *("not significantly worse", "whitened", "good", "significantly lower POD", "raw"),
        *("more than 2\N{NO-BREAK SPACE}% false alarms", "loud", "failed", "none"),
    ]
    assert texts(display.axes_[0]) == ["LinAlgError: singular"]
    assert texts(display.axes_[1]) == ["25\N{NO-BREAK SPACE}% not evaluated"]
    assert limit_of(display) == 2
    heights = [names.index(name) for name in RANKING.index]
    for name, points in {**display.values_, "pod_at_equal_pfa": display.marks_["pod"][1]}.items():
        np.testing.assert_allclose(points.get_offsets(), np.c_[100 * RANKING[name], heights])
    for name, bars in display.bars_.items():
        ends = [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in bars]
        np.testing.assert_allclose(ends, 100 * RANKING[[f"{name}_ci_low", f"{name}_ci_high"]])
    colours = [bar.get_facecolor() for bar in display.bars_["pod"]]
    assert colours[0] == colours[2]
    assert len(set(colours)) == 3


def test_a_ranking_comes_from_a_study_with_the_limit_that_was_asked():
    asked = []
    study = SimpleNamespace(scenarios=[], results_=None)
    study.ranking = lambda *given: asked.append(given) or RANKING
    display = DetectorsDisplay.from_estimator(study, max_false_alarms=0.05, source="reference")
    assert asked == [(0.05, "reference")]
    assert limit_of(display) == 5
    bounds = ["pod_deficit_ci_low", "pod_deficit_ci_high"]
    display = DetectorsDisplay.from_predictions(
        RANKING.assign(significantly_worse=False, **dict.fromkeys(bounds, np.nan))
    )
    assert rows_named(display.axes_[0])[0] == "order uncertain: one repeat"
    with pytest.raises(ValueError, match="expected a ranking"):
        DetectorsDisplay.from_predictions(RANKING.drop(columns="pod_deficit"))


def made_study():
    """Decisions of two detectors on a healthy and two damaged states, one of which begins with the record 5."""
    scenarios = [
        Scenario("healthy"),
        Scenario("deck", {"deck": 0.1}),
        ProgressiveDamage("later", {"deck": 0.1}, onset=5),
    ]
    random, rows, decisions = np.random.default_rng(0), [], {}
    for detector in ("raw", "whitened"):
        for number, scenario in enumerate(scenarios):
            key = (detector, scenario.name, "simulated")
            decisions[key] = (random.normal(size=(3, 20)) + 1 - number).astype("f4")
            row = {"detector": detector, "scenario": scenario.name, "source": key[2], "error": ""}
            rows.append(row | {"measure": "POD" if number else "PFA", "rate": (decisions[key] < 0).mean()})
    indices = {key: pd.Series(np.zeros(20)) for key in decisions}
    return SimpleNamespace(
        scenarios=scenarios, scenarios_=scenarios, results_=pd.DataFrame(rows), decisions_=decisions, indices_=indices
    )


def test_a_curve_of_a_study_is_that_of_the_detector_that_is_named():
    study = made_study()
    curves = {"raw": pod_curve([0.1, 0.2], [3, 17], [20, 20]), "whitened": pod_curve([0.1, 0.2], [5, 19], [20, 20])}
    study.pod_curve = lambda family, source, detector: curves[detector]
    first = PODCurveDisplay.from_estimator(study, "deck", detector="raw")
    second = PODCurveDisplay.from_estimator(study, "deck", detector="whitened", ax=first.ax_)
    assert (first.curve, second.curve) == (curves["raw"], curves["whitened"])
    assert (first.line_.get_label(), second.line_.get_label()) == ("raw", "whitened")


def causes(n_groups=3):
    """Causes of a shift by hand; the first one is certain."""
    values = np.vstack([[1.0, 0.2, 0.15, 0.25, 0.25], *[[0.3, 0.05, 0.0, 0.1, 0.18]] * (n_groups - 1)])
    columns = ["probability", "severity", "ci_low", "ci_high", "highest_if_damaged"]
    return pd.DataFrame(values, [f"E_{number}" for number in range(n_groups)], columns)


def test_causes_have_their_probability_and_a_severity_with_its_interval():
    display = DetectorsDisplay.from_predictions(causes())
    assert [ax.get_title() for ax in display.axes_] == ["probability of a change", "mean severity"]
    np.testing.assert_allclose(display.marks_["probability"][0].get_offsets()[:, 0], [100, 30, 30])
    spans = [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in display.bars_["severity"]]
    np.testing.assert_allclose(spans, [(15, 25), (0, 10), (0, 10)])
    np.testing.assert_allclose(display.values_["severity"].get_offsets()[:, 0], [20, 5, 5])
    np.testing.assert_allclose(display.marks_["severity"][1].get_offsets()[:, 0], [25, 18, 18])


def test_measured_shifts_have_two_standard_errors_beside_the_explained_ones():
    columns = {"measured": [-0.01, -0.05], "explained": [-0.012, -0.04], "standard_error": [0.002, np.nan]}
    display = DetectorsDisplay.from_predictions(pd.DataFrame(columns, ["f1", "f2"]))
    spans = [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in display.bars_["shift"]]
    np.testing.assert_allclose(spans, [(-1.4, -0.6), (-5, -5)])
    np.testing.assert_allclose(display.marks_["shift"][0].get_offsets()[:, 0], [-1.2, -4])


def test_explanations_beyond_the_fifth_share_a_row_and_changes_that_are_not_found_are_said():
    probabilities = [0.5, 0.2, 0.1, 0.08, 0.06, 0.05]
    display = DetectorsDisplay.from_predictions(pd.DataFrame({"probability": probabilities}, list("abcdef")))
    np.testing.assert_allclose([bar.get_width() for bar in display.bars_["probability"]], [50, 20, 10, 8, 6, 6])
    assert display.ax_.get_yticklabels()[-1].get_text() == "all others"
    display = DetectorsDisplay.from_predictions(pd.Series({"deck": 0.12, "piers": np.inf}))
    np.testing.assert_allclose([bar.get_width() for bar in display.bars_["smallest"]], [12, np.nan])
    assert [text.get_text() for text in display.ax_.texts] == ["not found"]
