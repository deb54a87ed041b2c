"""Damage indices, curves of detection, sensitivities and identified damage: what is drawn is what was given."""

import numpy as np
import pytest
from scipy.special import expit
from scipy.stats import binomtest
from sklearn.ensemble import IsolationForest
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from skthermo.detection import MahalanobisDetector
from skthermo.plotting import DamageIndexDisplay, PODCurveDisplay
from skthermo.studies import pod_curve


@pytest.mark.filterwarnings("ignore:.*few-records")  # frequencies in standard deviations are read as residuals
@pytest.mark.parametrize(
    "estimator",
    [
        MahalanobisDetector(),
        make_pipeline(StandardScaler(), MahalanobisDetector()),
        IsolationForest(n_estimators=10, random_state=0),
    ],
)
def test_points_threshold_and_onset_of_any_outlier_detector(estimator, year, later):
    detector, F = estimator.fit(year.frequencies), later.frequencies
    display = DamageIndexDisplay.from_estimator(detector, {"healthy": year.frequencies, "later": F}, onset=F.index[9])
    for line, frame in zip(display.points_[""], (year.frequencies, F), strict=True):
        np.testing.assert_array_equal(line.get_ydata(), -detector.score_samples(frame))
        assert line.get_linestyle() == "None"
    last = detector[-1] if isinstance(detector, Pipeline) else detector
    threshold = last.threshold_ if isinstance(last, MahalanobisDetector) else -last.offset_
    assert display.threshold_lines_[0].get_ydata()[0] == threshold
    assert display.ax_.lines[-1].get_xdata()[0] == F.index[9].to_datetime64()
    assert ("unsquared" in display.ax_.get_ylabel()) == isinstance(last, MahalanobisDetector)
    assert len({line.get_marker() for line in display.points_[""]}) == 2  # distinguished without colour


def test_a_panel_for_each_scenario():
    index = np.array([1.0, np.nan, 3.0])
    scenarios = {
        "SH-0": {"true": index, "simulated": index + 1},
        "SB-20": {"true": 2 * index},
        "SB-30": {"records": 3 * index},
    }
    display = DamageIndexDisplay.from_predictions(scenarios, {"SH-0": 2.0, "SB-20": 3.0, "SB-30": 4.0}, n_columns=2)
    assert [ax.get_title() for ax in display.axes_] == list(scenarios)
    assert [line.get_ydata()[0] for line in display.threshold_lines_] == [2.0, 3.0, 4.0]
    np.testing.assert_array_equal(display.points_["SH-0"][1].get_ydata(), index + 1)
    np.testing.assert_array_equal(display.points_["SB-30"][0].get_ydata(), 3 * index)
    assert display.axes_[0].get_ylim()[0] == 0
    for ax in DamageIndexDisplay.from_predictions(scenarios, 2.0, colours={"true": "#555555"}).axes_:
        assert ax.lines[0].get_color() in ("#555555", "#009E73")  # of "true" and, the third label, "records"


@pytest.mark.parametrize(
    ("index", "threshold", "message"),
    [
        (np.ones((3, 2)), 1.0, "'records' has shape .*expected one column"),
        ([1.0], None, "threshold is None; expected numbers"),
        ({}, 1.0, "expected one or more by label"),
    ],
)
def test_wrong_indices_are_named(index, threshold, message):
    with pytest.raises(ValueError, match=message):
        DamageIndexDisplay.from_predictions(index, threshold)


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


def test_the_legend_has_no_band_where_no_curve_fits():
    fitted, without = Curve(0.2), Curve(np.nan, a90_95=np.nan)
    without.n_detected = fitted.n_detected
    bands = [PODCurveDisplay.from_predictions(one).band_.get_label() for one in (fitted, without)]
    assert [band.startswith("_") for band in bands] == [False, True]  # such labels are in no legend


def test_curves_of_strengthenings_and_of_records_without_a_slope():
    display = PODCurveDisplay.from_predictions(pod_curve([-0.1, -0.2, -0.3], [10, 60, 99], [100] * 3))
    assert display.line_.get_xdata()[[0, -1]].tolist() == [-30.0, -10.0]
    assert display.marks_["a90"].get_xdata()[0] == pytest.approx(100 * display.curve.a90)
    with pytest.warns(UserWarning, match="between 0.1 and 0.2.*no-curve"):
        steep = pod_curve([0.1, 0.2, 0.3], [0, 100, 100], [100] * 3)
    display = PODCurveDisplay.from_predictions(steep)
    assert list(display.marks_) == ["bracket"]
    assert display.marks_["bracket"].get_label() == "$a_{90}$ between 10.0 and 20.0 %"
    with pytest.warns(UserWarning, match="above 0.2.*no-curve"):
        missed = pod_curve([0.1, 0.2], [0, 0], [100] * 2)
    assert PODCurveDisplay.from_predictions(missed).marks_["bracket"].get_label() == "$a_{90}$ beyond 20.0 %"
