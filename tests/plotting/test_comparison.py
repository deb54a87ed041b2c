"""Several detectors beside each other: what is drawn is what the study found, and nothing is left unsaid."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import spearmanr
from sklearn.decomposition import PCA
from sklearn.ensemble import IsolationForest
from sklearn.exceptions import NotFittedError
from sklearn.metrics import roc_auc_score
from sklearn.pipeline import make_pipeline

from skthermo.detection import MahalanobisDetector
from skthermo.plotting import AgreementDisplay, DamageIndexDisplay, PODCurveDisplay, RankingDisplay, ROCDisplay
from skthermo.studies import DetectabilityStudy, ProgressiveDamage, Scenario, pod_curve

FOUND = "piers 18 %"


def results_of(simulated, measured, scenario="healthy", measure="PFA", half=0.02):
    """Rows of a study with one scenario; a rate that is None is not there."""
    rows = []
    for source, rates in (("data-informed", simulated), ("reference", measured)):
        for detector, rate in rates.items():
            row = {"detector": detector, "scenario": scenario, "source": source, "measure": measure, "rate": rate}
            row |= {"n_records": 200, "n_not_judged": 0, "error": ""}
            if source == "data-informed":
                row |= {"band_lowest": max(rate - half, 0), "band_highest": min(rate + half, 1)}
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


def rows_named(ax):
    return [text.get_text() for text in ax.get_yticklabels()]


def test_measured_rates_stand_beside_bands_and_are_counted():
    display = AgreementDisplay.from_predictions(BOTH)
    healthy, damaged = display.axes_
    assert healthy.get_title().startswith("false alarms\n3 of 4 in the band")
    assert damaged.get_title().startswith(f"damage found: {FOUND}\n")
    names = rows_named(healthy)
    assert names == ["raw, a", "whitened", "raw, b", "linear"]  # by the damage that they find
    for detector, bar in zip(SIMULATED, display.bands_["healthy"], strict=True):
        row = HEALTHY[(HEALTHY["detector"] == detector) & (HEALTHY["source"] == "data-informed")].iloc[0]
        low, width = bar.get_x(), bar.get_width()
        np.testing.assert_allclose([low, low + width], 100 * row[["band_lowest", "band_highest"]].astype(float))
        assert bar.get_y() + bar.get_height() / 2 == pytest.approx(names.index(detector))
    inside, outside = display.measured_["healthy"]
    drawn = {names[int(y)]: x for line in (inside, outside) for x, y in line.get_xydata()}
    assert drawn == pytest.approx({name: 100 * rate for name, rate in MEASURED.items()})
    assert outside.get_xydata().tolist() == [[26.0, 2.0]]
    assert (inside.get_markerfacecolor(), outside.get_markerfacecolor()) == ("#0072B2", "white")
    row = display.agreement_.loc["healthy"]
    expected = spearmanr(list(SIMULATED.values()), list(MEASURED.values()))[0]
    assert row.tolist() == [4, 3, 4, pytest.approx(expected)]
    assert np.isnan(display.agreement_.loc[FOUND, "rank_correlation"])  # all measured rates are the same


def test_a_band_without_repeats_says_neither_inside_nor_outside():
    display = AgreementDisplay.from_predictions(HEALTHY.assign(band_lowest=np.nan, band_highest=np.nan))
    assert display.agreement_.loc["healthy", ["n_inside", "n_bands"]].tolist() == [0, 0]
    assert "in the band" not in display.axes_[0].get_title()
    assert len(display.measured_["healthy"][1].get_xdata()) == 0


def test_means_of_several_repeats_are_not_compared_with_the_band_of_single_ones():
    means = HEALTHY.assign(n_repeats=np.where(HEALTHY["source"] == "reference", 20, 40))
    assert AgreementDisplay.from_predictions(means).agreement_.loc["healthy", "n_bands"] == 0
    single = HEALTHY.assign(n_repeats=np.where(HEALTHY["source"] == "reference", 1, 40))
    assert AgreementDisplay.from_predictions(single).agreement_.loc["healthy", "n_bands"] == 4


def test_points_of_a_scatter_plot_lie_over_the_simulated_rates():
    groups = {name: "raw" for name in SIMULATED if name.startswith("raw")}
    display = AgreementDisplay.from_predictions(BOTH, groups=groups, kind="scatter")
    raw, others = display.points_["healthy"]
    np.testing.assert_allclose(raw[0].get_xydata(), [[1, 2], [20, 26]])
    np.testing.assert_allclose(others[0].get_xydata(), [[2, 0], [30, 31]])
    np.testing.assert_allclose(raw[2][0].get_segments()[1], [[18, 26], [22, 26]])
    assert raw[0].get_color() != others[0].get_color()
    assert raw[0].get_marker() != others[0].get_marker()
    for ax in display.axes_:
        diagonal = ax.lines[0].get_xydata()
        np.testing.assert_array_equal(diagonal[:, 0], diagonal[:, 1])
        assert ax.get_xlim() == ax.get_ylim()


def test_groups_are_headings():
    groups = {name: "raw" if name.startswith("raw") else "compensated" for name in SIMULATED}
    display = AgreementDisplay.from_predictions(BOTH, groups=groups)
    labels = display.axes_[0].get_yticklabels()
    assert [text.get_text() for text in labels] == ["raw", "raw, a", "raw, b", "compensated", "whitened", "linear"]
    assert [text.get_fontweight() == "bold" for text in labels] == [True, False, False, True, False, False]
    with pytest.raises(ValueError, match=r"groups names the detectors \['other'\]; expected some of"):
        AgreementDisplay.from_predictions(BOTH, groups={"other": "raw"})


@pytest.mark.parametrize("kind", ["rows", "scatter"])
def test_failures_and_records_that_are_not_judged_are_told(kind):
    results = pd.concat([BOTH, FAILED], ignore_index=True)
    results.loc[(results["detector"] == "linear") & (results["source"] == "reference"), "n_not_judged"] = 50
    display = AgreementDisplay.from_predictions(results, kind=kind)
    if kind == "scatter":
        assert texts(display.axes_[0]) == ["1 failed\n1 do not judge all records"]
        return
    assert rows_named(display.axes_[0])[-1] == "cointegration"
    assert texts(display.axes_[0]) == ["20\N{NO-BREAK SPACE}% not judged", "failed: LinAlgError: singular"]
    assert texts(display.axes_[1]) == ["20\N{NO-BREAK SPACE}% not judged"]


def test_a_detector_that_failed_in_one_of_two_studies_is_told_there():
    results = BOTH[(BOTH["detector"] != "linear") | (BOTH["scenario"] == "healthy")]
    results = pd.concat([results, pd.DataFrame([{"detector": "linear", "error": "ValueError: no"}])])
    healthy, damaged = AgreementDisplay.from_predictions(results).axes_
    assert (texts(healthy), texts(damaged)) == ([], ["failed: ValueError: no"])


def test_scenarios_can_be_chosen_and_those_without_measured_records_are_not_drawn():
    other = results_of(SIMULATED, {}, "deck 5 %", "POD")
    results = pd.concat([BOTH, other], ignore_index=True)
    assert list(AgreementDisplay.from_predictions(results).agreement_.index) == ["healthy", FOUND]
    assert list(AgreementDisplay.from_predictions(results, scenarios=[FOUND]).agreement_.index) == [FOUND]
    with pytest.raises(ValueError, match=r"expected some of \['healthy', 'piers 18 %'\]"):
        AgreementDisplay.from_predictions(results, scenarios=["deck 5 %"])
    with pytest.raises(ValueError, match=r"no scenario of \['deck 5 %'\] has both simulated and measured records"):
        AgreementDisplay.from_predictions(other)


def test_two_rates_of_one_scenario_are_refused():
    with pytest.raises(ValueError, match=r"'raw, a' has 2 rows of scenario 'healthy', source 'data-informed'"):
        AgreementDisplay.from_predictions(pd.concat([BOTH, HEALTHY]))


def test_what_is_no_result_is_named():
    with pytest.raises(ValueError, match=r"the table of results lacks the columns \['detector'\]"):
        AgreementDisplay.from_predictions(BOTH.drop(columns="detector"))
    with pytest.raises(ValueError, match="the table of results is"):
        AgreementDisplay.from_predictions(None)
    with pytest.raises(ValueError, match="kind is 'bars'; expected 'rows' or 'scatter'"):
        AgreementDisplay.from_predictions(BOTH, kind="bars")
    with pytest.raises(ValueError, match="study is None; expected a DetectabilityStudy"):
        AgreementDisplay.from_estimator(None)
    with pytest.raises(NotFittedError):
        AgreementDisplay.from_estimator(DetectabilityStudy(None, None, []))


def ranking_of(**rows):
    """A ranking of detectors by their false alarms, found damage, found damage at equal false alarms, and distance."""
    table = pd.DataFrame(rows, index=["false_alarms", "pod", "pod_equal", "behind"], dtype=float).T
    for name in ("false_alarms", "pod", "behind"):
        table[f"{name}_lowest"], table[f"{name}_highest"] = table[name] - 0.01, table[name] + 0.01
    table["keeps_limit"], table["clearly_behind"] = table["false_alarms"] < 0.03, table["behind_lowest"] > 0
    return table.assign(not_judged=0.0, error="")


RANKING = ranking_of(
    whitened=[0.01, 0.9, 0.92, 0.0],
    raw=[0.02, 0.5, 0.5, 0.42],
    good=[0.01, 0.9, 0.915, 0.005],
    loud=[0.3, 1, 0.7, 0.22],
)


def test_a_ranking_says_who_is_behind_who_is_loud_and_who_failed():
    failed = pd.DataFrame({"error": "LinAlgError: singular", "keeps_limit": False, "clearly_behind": False}, ["none"])
    ranking = pd.concat([RANKING, failed])
    ranking.loc["raw", "not_judged"] = 0.25
    display = RankingDisplay.from_predictions(ranking)
    names = rows_named(display.axes_[0])
    assert names == [
        *("best, or not clearly behind", "whitened", "good", "clearly behind", "raw"),
        *("more than 2\N{NO-BREAK SPACE}% false alarms", "loud", "failed", "none"),
    ]
    assert texts(display.axes_[0]) == ["LinAlgError: singular"]
    assert texts(display.axes_[1]) == ["25\N{NO-BREAK SPACE}% not judged"]
    assert display.limit_line_.get_xdata()[0] == 2
    heights = [names.index(name) for name in RANKING.index]
    for name, points in display.points_.items():
        np.testing.assert_allclose(points.get_offsets(), np.c_[100 * RANKING[name], heights])
    for name, bounds in display.bounds_.items():
        ends = [segment[:, 0] for segment in bounds.get_segments()]
        np.testing.assert_allclose(ends, 100 * RANKING[[f"{name}_lowest", f"{name}_highest"]])
    colours = [tuple(colour) for colour in display.bounds_["pod"].get_colors()]
    assert colours[0] == colours[2]
    assert len(set(colours)) == 3


def test_a_ranking_comes_from_a_study_with_the_limit_that_was_asked():
    asked = []
    study = SimpleNamespace(scenarios=[], results_=None)
    study.ranking = lambda *given, by: asked.append((*given, by)) or RANKING
    display = RankingDisplay.from_estimator(study, max_false_alarms=0.05, source="reference")
    assert asked == [(0.05, "reference", "pod")]
    assert display.limit_line_.get_xdata()[0] == 5
    bounds = ["behind_lowest", "behind_highest"]
    display = RankingDisplay.from_predictions(RANKING.assign(clearly_behind=False, **dict.fromkeys(bounds, np.nan)))
    assert rows_named(display.axes_[0])[0] == "order not sure: one repeat"
    with pytest.raises(ValueError, match=r"the ranking lacks the columns \['behind'\]"):
        RankingDisplay.from_predictions(RANKING.drop(columns="behind"))


def test_a_curve_passes_its_own_threshold_and_has_the_area_of_scikit_learn():
    random = np.random.default_rng(0)
    y = np.repeat([1, -1], [300, 200])
    good, poor = random.normal(size=(2, 500)) + 1.5
    good[300:] -= 2
    unjudged = np.where(np.arange(500) % 10 == 0, np.nan, poor)
    display = ROCDisplay.from_predictions(y, {"poor": poor, "good": good, "partly": unjudged})
    assert next(iter(display.auc_)) == "good"
    judged = ~np.isnan(unjudged)
    assert display.auc_["good"] == pytest.approx(roc_auc_score(y, good))
    assert display.auc_["partly"] == pytest.approx(roc_auc_score(y[judged], poor[judged]))
    ((x, found),) = display.thresholds_["good"].get_xydata()
    assert (x, found) == pytest.approx((100 * (good[:300] < 0).mean(), 100 * (good[300:] < 0).mean()))
    curve = display.lines_["good"].get_xydata()
    assert np.interp(x, *curve.T) >= found - 1e-9
    legend = [text.get_text() for text in display.ax_.get_legend().get_texts()]
    assert sum("10\N{NO-BREAK SPACE}% not judged" in text for text in legend) == 1
    assert display.ax_.lines[-2].get_label() == "chance: AUC 0.5"


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
            key = (detector, scenario.name, "data-informed")
            decisions[key] = (random.normal(size=(3, 20)) + 1 - number).astype("f4")
            row = {"detector": detector, "scenario": scenario.name, "source": key[2], "error": ""}
            rows.append(row | {"measure": "POD" if number else "PFA", "rate": (decisions[key] < 0).mean()})
    indices = {key: pd.Series(np.zeros(20)) for key in decisions}
    return SimpleNamespace(
        scenarios=scenarios,
        scenarios_=scenarios,
        results_=pd.DataFrame(rows),
        decisions_=decisions,
        indices_=indices,
    )


def test_curves_of_a_study_are_of_records_from_the_onset_on():
    study = made_study()
    display = ROCDisplay.from_estimator(study)
    for name in ("raw", "whitened"):
        healthy, deck, later = (study.decisions_[name, s.name, "data-informed"] for s in study.scenarios)
        damaged = np.concatenate([deck.ravel(), later[:, 5:].ravel()])
        y = np.repeat([1, -1], [healthy.size, damaged.size])
        assert display.auc_[name] == pytest.approx(roc_auc_score(y, np.r_[healthy.ravel(), damaged]))
    display = ROCDisplay.from_estimator(study, detectors=["raw"], scenarios="later")
    assert [len(part) for part in display.decisions["raw"]] == [60, 45]
    with pytest.raises(ValueError, match=r"detectors are \['other'\]; expected some of \['raw', 'whitened'\]"):
        ROCDisplay.from_estimator(study, detectors=["other"])
    with pytest.raises(ValueError, match=r"scenarios are \['healthy'\]; expected some of"):
        ROCDisplay.from_estimator(study, scenarios=["healthy"])


@pytest.mark.parametrize(
    ("y", "decisions", "message"),
    [
        ([1, 0], {"a": [1, 2]}, "y is .1, 0.; expected 1 for each healthy record"),
        ([1, -1], {"a": [1, 2, 3]}, r"decisions of 'a' have shape \(3,\); expected \(2,\), as y"),
        ([1, -1], [1, 2], "decisions is .1, 2.; expected a mapping"),
        ([1, -1], {"a": [1, np.nan]}, "'a' has judged 1 healthy and 0 damaged records; expected some of both"),
    ],
)
def test_wrong_decisions_are_named(y, decisions, message):
    with pytest.raises(ValueError, match=message):
        ROCDisplay.from_predictions(y, decisions)


def test_damage_indices_of_a_study_have_a_panel_for_each_detector():
    study, random = made_study(), np.random.default_rng(1)
    study.indices_ = {key: pd.Series(random.uniform(1, 3, 20)) for key in study.indices_}
    study.thresholds_ = {"raw": 2.0, "whitened": 2.5}
    study.detectors_ = {"raw": MahalanobisDetector(), "whitened": make_pipeline(PCA(), MahalanobisDetector())}
    display = DamageIndexDisplay.from_study(study, ["healthy", "deck"])
    assert [ax.get_title() for ax in display.axes_] == ["raw", "whitened"]
    assert [line.get_ydata()[0] for line in display.threshold_lines_] == [2.0, 2.5]
    for name, points in display.points_.items():
        for line, state in zip(points, ["healthy", "deck"], strict=True):
            np.testing.assert_array_equal(line.get_ydata(), study.indices_[name, state, "data-informed"])
    assert "unsquared" in display.axes_[0].get_ylabel()
    study.detectors_["raw"] = IsolationForest()
    assert "unsquared" not in DamageIndexDisplay.from_study(study).axes_[0].get_ylabel()
    with pytest.raises(ValueError, match=r"scenarios are \['other'\]; expected some of \['healthy', 'deck', 'later'\]"):
        DamageIndexDisplay.from_study(study, ["other"])
    study.thresholds_["raw"] = None
    with pytest.raises(ValueError, match="threshold of 'raw' is None"):
        DamageIndexDisplay.from_study(study)


def test_a_curve_of_a_study_is_that_of_the_detector_that_is_named():
    study = made_study()
    curves = {"raw": pod_curve([0.1, 0.2], [3, 17], [20, 20]), "whitened": pod_curve([0.1, 0.2], [5, 19], [20, 20])}
    study.pod_curve = lambda family, source, detector: curves[detector]
    first = PODCurveDisplay.from_estimator(study, "deck", detector="raw")
    second = PODCurveDisplay.from_estimator(study, "deck", detector="whitened", ax=first.ax_)
    assert (first.curve, second.curve) == (curves["raw"], curves["whitened"])
    assert (first.line_.get_label(), second.line_.get_label()) == ("raw", "whitened")


def test_many_curves_have_their_legend_beside_them_and_differ():
    y = np.repeat([1, -1], 50)
    decisions = {f"detector {k}": np.r_[np.ones(50), np.linspace(-1, k, 50)] for k in range(10)}
    display = ROCDisplay.from_predictions(y, decisions)
    styles = {(line.get_color(), line.get_linestyle()) for line in display.lines_.values()}
    assert len(styles) == 10
    display.figure_.canvas.draw()
    assert display.ax_.get_legend().get_window_extent().x0 > display.ax_.get_window_extent().x1
