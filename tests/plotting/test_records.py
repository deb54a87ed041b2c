"""Frequencies and parameters over temperature and time: what is drawn is what was given."""

import copy
from io import BytesIO

import matplotlib.dates as mdates
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression

from skthermo.plotting import FitReportDisplay, FrequencyTemperatureDisplay, HistoryDisplay, PredictionDisplay


def drawn(line):
    return np.asarray(line.get_ydata(), dtype=float)


def test_frequencies_over_the_chosen_sensor(fem, later):
    T, F = later.temperatures, later.frequencies
    display = FrequencyTemperatureDisplay.from_estimator(fem, T, F, sensor="T2")
    predicted = fem.predict(T)
    for column, mode in enumerate(F):
        for label, table in (("measured", F), ("predicted", predicted)):
            line = display.points_[label][column]
            np.testing.assert_array_equal(line.get_xdata(), T["T2"])
            np.testing.assert_array_equal(drawn(line), table[mode])
    assert display.axes_[0].get_xlabel() == "$T_{2}$ (°C)"
    assert display.axes_[0].get_ylabel() == "frequency (Hz)"
    assert display.axes_[1].get_title() == "$f_{2}$"


def test_arrays_have_numbered_sensors(later):
    T, F = later.temperatures.to_numpy(), later.frequencies.to_numpy()
    display = FrequencyTemperatureDisplay.from_predictions(T[:, 1], F)
    np.testing.assert_array_equal(display.points_["measured"][2].get_xdata(), T[:, 1])
    assert display.axes_[0].get_xlabel() == "temperature (°C)"
    with pytest.raises(ValueError, match="sensor is 3; expected a column's number from 0 to 2"):
        FrequencyTemperatureDisplay.from_estimator(None, T, F, sensor=3)
    with pytest.raises(ValueError, match=r"sensor is 'T9'; expected one of \['T1', 'T2', 'T3'\]"):
        FrequencyTemperatureDisplay.from_estimator(None, later.temperatures, later.frequencies, sensor="T9")


def test_given_axes_are_used(later):
    figure, axes = plt.subplots(2, 3)
    tables = {"a": later.frequencies, "b": later.clean_frequencies}
    for display in (
        FrequencyTemperatureDisplay.from_predictions(later.temperatures["T1"], later.frequencies, ax=axes),
        HistoryDisplay.from_predictions(tables, ax=axes),
        PredictionDisplay.from_predictions(*tables.values(), ax=axes.ravel()),
    ):
        assert list(display.axes_) == list(axes.ravel())
        assert display.figure_ is figure
    assert plt.get_fignums() == [figure.number]
    with pytest.raises(ValueError, match="ax holds 2 axes; expected 6"):
        HistoryDisplay.from_predictions(tables, ax=axes[0, :2])
    with pytest.raises(ValueError, match="ax is 'here'; expected matplotlib's axes"):
        HistoryDisplay.from_predictions(tables, ax="here")


def test_histories_of_estimated_and_predicted_parameters(fem, year, later):
    display = HistoryDisplay.from_estimator(fem)
    for column, name in enumerate(fem.parameter_names_):
        np.testing.assert_allclose(drawn(display.lines_["from frequencies"][column]), fem.parameters_[name])
        learned = fem.predict_parameters(year.temperatures)[name]
        np.testing.assert_array_equal(drawn(display.lines_["from temperatures"][column]), learned)
    assert display.axes_[0].get_ylabel() == "bottom\nmultiplier"
    later_only = HistoryDisplay.from_estimator(fem, later.temperatures)
    assert list(later_only.lines_) == ["from temperatures"]


def test_histories_of_measured_and_predicted_frequencies(fem, year):
    display = HistoryDisplay.from_estimator(fem, what="frequencies")
    np.testing.assert_array_equal(drawn(display.lines_["measured"][3]), year.frequencies["f4"])
    np.testing.assert_array_equal(drawn(display.lines_["predicted"][3]), fem.predict(year.temperatures)["f4"])
    with pytest.raises(ValueError, match="what is 'theta'; expected 'parameters' or 'frequencies'"):
        HistoryDisplay.from_estimator(fem, what="theta")


def test_the_history_of_a_chain_fitted_to_arrays_names_its_parameters(fem, year):
    from_arrays = type(fem)(fem.model, random_state=0).fit(year.temperatures.to_numpy(), year.frequencies.to_numpy())
    display = HistoryDisplay.from_estimator(from_arrays)
    assert [ax.get_ylabel().split("\n")[0] for ax in display.axes_] == fem.parameter_names_
    assert display.axes_[-1].get_xlabel() == "record"


def test_time_goes_on_a_date_axis_in_order_and_lines_break_in_gaps():
    index = pd.date_range("2020-01-01", periods=50, freq="h", tz="Europe/Brussels").delete(slice(20, 40))
    values = pd.DataFrame({"f1": np.arange(30.0)}, index)
    values.iloc[5, 0] = np.nan
    shuffled = values.sample(frac=1, random_state=0)
    line = HistoryDisplay.from_predictions({"a": shuffled}, kind="lines").lines_["a"][0]
    ax = line.axes
    assert isinstance(ax.xaxis.get_major_formatter(), mdates.ConciseDateFormatter)
    y = drawn(line)
    assert np.isnan(y).sum() == 2  # the missing value, and one in the gap
    np.testing.assert_array_equal(y[~np.isnan(y)], values["f1"].dropna())
    assert np.isnan(y[20])
    assert (np.diff(mdates.date2num(line.get_xdata())) > 0).all()
    assert line.get_xdata()[0] == np.datetime64("2020-01-01T00:00")  # local time


def test_records_of_arrays_are_numbered():
    display = HistoryDisplay.from_predictions(np.arange(10.0), unit="")
    np.testing.assert_array_equal(display.lines_[""][0].get_xdata(), np.arange(10))
    assert (display.axes_[0].get_xlabel(), display.axes_[0].get_ylabel()) == ("record", "$f_{1}$")


@pytest.mark.parametrize(
    ("histories", "message"),
    [
        ({}, "history is empty"),
        ({"a": [[1, 2]], "b": [[1]]}, "history 'b' has 1 columns and 'a' 2"),
        ({"a": ["x"]}, "history 'a' is .*expected numbers"),
        (np.zeros((2, 2, 2)), r"has shape \(2, 2, 2\)"),
    ],
)
def test_wrong_histories_are_named(histories, message):
    with pytest.raises(ValueError, match=message):
        HistoryDisplay.from_predictions(histories)


def test_marks_stand_at_a_time_or_at_a_record(later):
    at = later.frequencies.index[100]
    for place in (at, str(at), 100):
        display = HistoryDisplay.from_predictions(later.frequencies, marks={"hold-out": place})
        for ax in display.axes_:
            assert ax.lines[-1].get_xdata()[0] == at.to_datetime64()
        assert display.axes_[0].texts[0].get_text().strip() == "hold-out"
    with pytest.raises(ValueError, match="no record number 999; expected a time, or 0 to 364"):
        HistoryDisplay.from_predictions(later.frequencies, marks={"x": 999})
    with pytest.raises(ValueError, match="is not a number"):
        HistoryDisplay.from_predictions(later.frequencies.to_numpy(), marks={"x": at})


def test_predictions_with_intervals_in_time(fem, later):
    T, F = later.temperatures, later.frequencies
    display = PredictionDisplay.from_estimator(fem, T, F, confidence=0.8)
    lowest, highest = fem.predict_interval(T, 0.8)
    predicted = fem.predict(T)
    for column, mode in enumerate(F):
        np.testing.assert_array_equal(drawn(display.measured_[column]), F[mode])
        np.testing.assert_array_equal(drawn(display.predicted_[column]), predicted[mode])
        corners = display.bands_[column].get_paths()[0].vertices[:, 1]
        assert corners.min() == pytest.approx(lowest[mode].min())
        assert corners.max() == pytest.approx(highest[mode].max())
    assert display.measured_[0].get_color() == "#0072B2"
    assert display.predicted_[0].get_color() == "#D55E00"
    texts = [text.get_text() for text in display.figure_.legends[0].get_texts()]
    assert texts == ["measured", "predicted", "interval, 80 %"]
    assert PredictionDisplay.from_estimator(fem, T, F, confidence=None).bands_ == []
    with pytest.raises(ValueError, match=r"LinearRegression\(\) has no method 'predict_interval'; expected"):
        PredictionDisplay.from_estimator(LinearRegression().fit(T, F), T, F, confidence=0.8)


@pytest.mark.parametrize(
    ("change", "said"),
    [(lambda T: T * np.nan, "365 of 365 rows cannot be predicted"), (lambda T: T + 60, "far outside")],
)
def test_doubts_about_the_weather_are_said_once(fem, later, change, said):
    with pytest.warns(UserWarning, match=said) as caught:
        display = PredictionDisplay.from_estimator(fem, change(later.temperatures), later.frequencies)
    assert len(caught) == 1
    assert caught[0].filename == __file__
    assert len(display.bands_) == 6


def test_bands_break_where_an_end_is_unknown():
    lowest, highest = np.full(10, 0.0), np.full(10, 2.0)
    highest[4] = np.nan
    lowest[7] = -np.inf
    display = PredictionDisplay.from_predictions(np.ones(10), np.ones(10), lowest, highest)
    assert len(display.bands_[0].get_paths()) == 3


def test_predicted_over_measured(fem, later):
    predicted = fem.predict(later.temperatures)
    display = PredictionDisplay.from_predictions(later.frequencies, predicted, kind="scatter", unit="Hz")
    line = display.measured_[5]
    np.testing.assert_array_equal(line.get_xdata(), later.frequencies["f6"])
    np.testing.assert_array_equal(line.get_ydata(), predicted["f6"])
    assert display.axes_[5].get_xlabel() == "measured (Hz)"
    assert display.axes_[5].get_ylabel() == "predicted (Hz)"


def test_tables_that_do_not_fit_are_refused(later):
    F = later.frequencies
    with pytest.raises(ValueError, match="only one of lowest and highest"):
        PredictionDisplay.from_predictions(F, F, F)
    with pytest.raises(ValueError, match="measured has 365 rows and predicted 364"):
        PredictionDisplay.from_predictions(F, F[1:])
    with pytest.raises(ValueError, match="measured has 6 columns and predicted 5"):
        PredictionDisplay.from_predictions(F, F.iloc[:, :5])
    with pytest.raises(ValueError, match=r"titles is \['a'\]; expected 6"):
        PredictionDisplay.from_predictions(F, F, titles=["a"])
    with pytest.raises(ValueError, match="kind is 'bar'"):
        PredictionDisplay.from_predictions(F, F, kind="bar")
    with pytest.raises(ValueError, match="different indices"):
        FrequencyTemperatureDisplay.from_predictions(later.temperatures["T1"], F.shift(freq="1h"))


def test_the_report_of_a_fit(fem):
    display = FitReportDisplay.from_estimator(fem)
    report = fem.report_
    expected = {
        "errors": report.errors["MAPE"],
        "errors of the mean": report.errors["MAPE of the mean"],
        "offsets": report.offsets,
        "deviations": 100 * report.deviations,
        "outside": 100 * report.outside,
    }
    for name, values in expected.items():
        np.testing.assert_allclose([bar.get_width() for bar in display.bars_[name]], values)
    with pytest.raises(ValueError, match="has no report_; expected a fitted DataInformedFEM"):
        FitReportDisplay.from_estimator(type(fem)(fem.model))


@pytest.mark.parametrize("name", ["f{}", "frequency of the mode number {} of the deck above the river"])
def test_titles_of_a_report_lie_within_the_figure(fem, name):
    report = copy.deepcopy(fem.report_)
    for table in (report.errors, report.offsets, report.deviations, report.outside):
        table.index = [name.format(number) for number in range(len(table))]
    figure = FitReportDisplay(report).plot().figure_
    figure.savefig(BytesIO(), format="png")
    for ax in figure.axes:
        title = ax.title.get_window_extent()
        assert figure.bbox.x0 <= title.x0
        assert title.x1 <= figure.bbox.x1
