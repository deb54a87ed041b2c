"""Damage indices, curves of detection, sensitivities and identified damage: what is drawn is what was given."""

from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from scipy.special import expit
from scipy.stats import binomtest
from sklearn.ensemble import IsolationForest
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from skthermo.datasets import make_truss
from skthermo.detection import MahalanobisDetector
from skthermo.plotting import DamageIndexDisplay, IdentifiedDamageDisplay, PODCurveDisplay, SensitivityDisplay
from skthermo.studies import pod_curve
from skthermo.updating import sensitivity


@pytest.fixture(scope="module")
def detector(year):
    return MahalanobisDetector().fit(year.frequencies)


def test_points_threshold_and_onset(detector, year, later):
    F = later.frequencies
    display = DamageIndexDisplay.from_estimator(detector, {"healthy": year.frequencies, "later": F}, onset=F.index[9])
    for line, frame in zip(display.points_[""], (year.frequencies, F), strict=True):
        np.testing.assert_array_equal(line.get_ydata(), detector.damage_index(frame))
        assert line.get_linestyle() == "None"
    assert display.threshold_lines_[0].get_ydata()[0] == detector.threshold_
    assert display.ax_.lines[-1].get_xdata()[0] == F.index[9].to_datetime64()
    assert display.ax_.get_ylabel() == "damage index (Mahalanobis, unsquared)"
    markers = {line.get_marker() for line in display.points_[""]}
    assert len(markers) == 2  # told apart without colour


def test_any_outlier_detector_and_pipelines(later):
    F = later.frequencies.to_numpy()
    forest = IsolationForest(n_estimators=10, random_state=0).fit(F)
    display = DamageIndexDisplay.from_estimator(forest, F, onset=7)
    np.testing.assert_array_equal(display.points_[""][0].get_ydata(), -forest.score_samples(F))
    assert display.threshold_lines_[0].get_ydata()[0] == -forest.offset_
    assert display.ax_.lines[-1].get_xdata()[0] == 7
    assert display.ax_.get_ylabel() == "damage index"
    pipeline = make_pipeline(StandardScaler(), MahalanobisDetector()).fit(F)
    display = DamageIndexDisplay.from_estimator(pipeline, F)
    np.testing.assert_array_equal(display.points_[""][0].get_ydata(), -pipeline.score_samples(F))
    assert display.threshold_lines_[0].get_ydata()[0] == pipeline[-1].threshold_
    assert "unsquared" in display.ax_.get_ylabel()


def test_a_panel_for_each_scenario():
    index = np.array([1.0, np.nan, 3.0])
    scenarios = {"SH-0": {"true": index, "simulated": index + 1}, "SB-20": {"true": 2 * index}, "SB-30": 3 * index}
    display = DamageIndexDisplay.from_scenarios(scenarios, {"SH-0": 2.0, "SB-20": 3.0, "SB-30": 4.0}, n_columns=2)
    assert [ax.get_title() for ax in display.axes_] == list(scenarios)
    assert [line.get_ydata()[0] for line in display.threshold_lines_] == [2.0, 3.0, 4.0]
    np.testing.assert_array_equal(display.points_["SH-0"][1].get_ydata(), index + 1)
    np.testing.assert_array_equal(display.points_["SB-30"][0].get_ydata(), 3 * index)
    assert display.axes_[0].get_ylim()[0] == 0
    for ax in DamageIndexDisplay.from_scenarios(scenarios, 2.0, log=True, colours={"true": "#555555"}).axes_:
        assert ax.get_yscale() == "log"
        assert ax.lines[0].get_color() in ("#555555", "#009E73")  # of "true" and, the third label, "records"


@pytest.mark.parametrize(
    ("index", "threshold", "message"),
    [
        (np.ones((3, 2)), 1.0, "'records' has 2 columns; expected one"),
        ([1.0], None, "threshold is None; expected a number"),
        ({}, 1.0, "damage index is empty"),
    ],
)
def test_wrong_indices_are_named(index, threshold, message):
    with pytest.raises(ValueError, match=message):
        DamageIndexDisplay.from_predictions(index, threshold)


def test_what_is_no_detector_is_named(later):
    with pytest.raises(ValueError, match="has no method 'score_samples'"):
        DamageIndexDisplay.from_estimator(StandardScaler(), later.frequencies)
    with pytest.raises(ValueError, match="threshold of 'b' is None"):
        DamageIndexDisplay.from_scenarios({"a": [1.0], "b": [1.0]}, {"a": 1.0})


class Curve:
    """A logistic curve with bounds to its left and right."""

    severities = np.array([0.0, 0.1, 0.2, 0.3, 0.4])
    n_records = 200

    def __init__(self, middle, a90_95=0.35):
        self.middle, self.a90, self.a90_95 = middle, middle + np.log(9) / 25, a90_95
        self.n_detected = np.round(200 * expit(25 * (self.severities - middle)))

    def predict(self, severity):
        return tuple(expit(25 * (np.asarray(severity) - self.middle - shift)) for shift in (0, 0.02, -0.02))


def test_a_curve_with_its_shares_bounds_and_marks():
    curve = Curve(0.2)
    display = PODCurveDisplay.from_predictions(curve, label="bottom")
    x, y = display.line_.get_data()
    np.testing.assert_allclose(y, 100 * curve.predict(x / 100)[0])
    shares, _, bars = display.errorbar_
    np.testing.assert_allclose(shares.get_xydata(), 100 * np.c_[curve.severities, curve.n_detected / 200])
    for k, segment in zip(curve.n_detected, bars[0].get_segments(), strict=True):
        interval = binomtest(int(k), 200).proportion_ci(method="wilson")
        np.testing.assert_allclose(segment[:, 1] / 100, interval, atol=1e-6)
    assert display.marks_["a90"].get_xdata()[0] == pytest.approx(100 * curve.a90)
    assert display.marks_["a90_95"].get_xdata()[0] == 35
    band = display.band_.get_paths()[0].vertices[:, 1]
    assert band.max() == pytest.approx(100 * curve.predict(0.4)[2])


def test_several_curves_in_one_axes_differ_without_colour():
    first = PODCurveDisplay.from_predictions(Curve(0.1), label="bottom")
    second = PODCurveDisplay.from_predictions(Curve(0.2, a90_95=np.inf), label="top", ax=first.ax_)
    assert second.ax_ is first.ax_
    assert first.line_.get_color() != second.line_.get_color()
    assert first.line_.get_linestyle() != second.line_.get_linestyle()
    assert list(second.marks_) == ["a90"]
    assert PODCurveDisplay.from_predictions(Curve(0.3, a90_95=None), marks=False).marks_ == {}
    with pytest.raises(ValueError, match=r"SimpleNamespace without \['severities'"):
        PODCurveDisplay.from_predictions(SimpleNamespace())


def test_curves_of_strengthenings_and_of_records_without_a_slope():
    display = PODCurveDisplay.from_predictions(pod_curve([-0.1, -0.2, -0.3], [10, 60, 99], [100] * 3))
    assert display.line_.get_xdata()[[0, -1]].tolist() == [-30.0, -10.0]
    assert display.marks_["a90"].get_xdata()[0] == pytest.approx(100 * display.curve.a90)
    with pytest.warns(UserWarning, match="a90 lies between 0.1 and 0.2"):
        steep = pod_curve([0.1, 0.2, 0.3], [0, 100, 100], [100] * 3)
    display = PODCurveDisplay.from_predictions(steep)
    assert list(display.marks_) == ["bracket"]
    assert display.marks_["bracket"].get_label() == "$a_{90}$ between 10.0 and 20.0 %"
    with pytest.warns(UserWarning, match="a90 lies above 0.2"):
        missed = pod_curve([0.1, 0.2], [0, 0], [100] * 2)
    assert PODCurveDisplay.from_predictions(missed).marks_["bracket"].get_label() == "$a_{90}$ beyond 20.0 %"


def test_sensitivities_as_a_map_with_numbers():
    model = make_truss()
    theta = [1.1, 0.9, 1.0, 1.0]
    ax = plt.figure().add_subplot()
    display = SensitivityDisplay.from_model(model, theta, ax=ax)
    table = sensitivity(model, theta)
    assert display.ax_ is ax
    np.testing.assert_allclose(display.image_.get_array(), table.T)
    assert [tick.get_text() for tick in ax.get_yticklabels()] == list(table.columns)
    shown = {(t.get_position()): t.get_text() for t in ax.texts}
    assert shown[0, 0] == f"{table.iloc[0, 0]:.2f}"
    assert (0, 3) not in shown  # 0.001 is below the smallest number shown
    low, high = display.image_.get_clim()
    assert -low == high == pytest.approx(np.abs(table.to_numpy()).max())
    assert display.colorbar_.ax.get_ylabel() == "normalised sensitivity"
    with pytest.raises(ValueError, match="sensitivity is a ndarray of shape"):
        SensitivityDisplay.from_predictions(table.to_numpy())


def identified():
    groups = ["deck", "piers", "soil"]
    return SimpleNamespace(
        table=pd.DataFrame(
            {
                "severity": [0.01, 0.2, 0.1],
                "standard_error": [0.02, 0.03, np.inf],
                "significant": [False, True, False],
            },
            groups,
        ),
        similarity=pd.DataFrame(np.eye(3), groups, groups),
        shifts=pd.DataFrame(
            {"measured": [-0.01, -0.05], "explained": [-0.012, -0.04], "standard_error": [0.002, 0.003]}, ["f1", "f2"]
        ),
    )


def test_identified_damage_is_drawn_in_percent_with_two_standard_errors():
    given = identified()
    display = IdentifiedDamageDisplay.from_predictions(given)
    severities, shifts, collinearity = display.axes_
    spans = [segment[:, 0] for segment in display.severities_[2][0].get_segments()]
    np.testing.assert_allclose(spans, [[-3, 5], [14, 26]])
    assert severities.get_yticklabels()[2].get_text() == "soil\n(not determined)"
    faces = {
        line.get_markerfacecolor(): line.get_xdata().tolist() for line in severities.lines if line.get_marker() == "o"
    }
    assert faces == {"#D55E00": [20.0], "white": [1.0]}
    (anything,) = (
        line for line in severities.lines if line.get_linestyle() == ":"
    )  # what is not determined has no mark
    assert list(anything.get_ydata()) == [2, 2]
    np.testing.assert_allclose(display.shifts_[0].get_ydata(), [-1, -5])
    np.testing.assert_allclose(display.explained_.get_ydata(), [-1.2, -4])
    np.testing.assert_allclose(display.shifts_[2][0].get_segments()[1][:, 1], [-5.6, -4.4])
    np.testing.assert_array_equal(display.image_.get_array(), np.eye(3))
    assert shifts.get_ylabel() == "shift (%)"
    assert severities.get_xlabel() == "severity (%)"
    assert display.image_.get_clim() == (-1, 1)
    assert collinearity.get_title() == "cosine between groups"
    assert not severities.texts
    given.unseen = ["vertical"]
    text = IdentifiedDamageDisplay.from_predictions(given).axes_[0].texts[0].get_text()
    assert text == "left out, as these modes do not show them: vertical"


def test_incomplete_results_are_named():
    broken = identified()
    broken.shifts = broken.shifts.drop(columns="explained")
    with pytest.raises(ValueError, match=r"'shifts' is missing or lacks \['explained'\]"):
        IdentifiedDamageDisplay.from_predictions(broken)
