"""Frequencies and parameters over temperature and time: what is drawn is what was given."""

import matplotlib.dates as mdates
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb
from sklearn.linear_model import LinearRegression

from skthermo.plotting import DamageIndexDisplay, PredictionDisplay


def drawn(line):
    return np.asarray(line.get_ydata(), dtype=float)


def test_frequencies_over_the_chosen_sensor(fem, later):
    T, F = later.temperatures, later.frequencies
    display = PredictionDisplay.from_estimator(fem, T, F, sensor="T2")
    predicted = fem.predict(T)
    for column, mode in enumerate(F):
        for label, table in (("measured", F), ("predicted", predicted)):
            line = display.lines_[label][column]
            np.testing.assert_array_equal(line.get_xdata(), T["T2"])
            np.testing.assert_array_equal(drawn(line), table[mode])
    assert display.axes_[0].get_xlabel() == "$T_{2}$ (°C)"
    assert display.axes_[0].get_ylabel() == "frequency (Hz)"
    assert display.axes_[1].get_title() == "$f_{2}$"


def test_arrays_have_numbered_sensors_and_records(later):
    T, F = later.temperatures.to_numpy(), later.frequencies.to_numpy()[:, :2]
    display = PredictionDisplay.from_predictions(F, temperature=T[:, 1])
    np.testing.assert_array_equal(display.lines_["measured"][1].get_xdata(), T[:, 1])
    assert display.axes_[0].get_xlabel() == "temperature (°C)"
    for X, sensor in ((T, 3), (later.temperatures, "T9")):
        with pytest.raises(ValueError, match=f"sensor is {sensor!r}; expected"):
            PredictionDisplay.from_estimator(None, X, F, sensor=sensor)
    display = PredictionDisplay.from_predictions(np.arange(10.0), unit="")
    np.testing.assert_array_equal(display.lines_["measured"][0].get_xdata(), np.arange(10))
    assert (display.axes_[0].get_xlabel(), display.axes_[0].get_ylabel()) == ("record", "$f_{1}$")


def test_arrays_beside_frames_have_their_rows_and_columns_are_matched_by_name(fem, later):
    T, F = later.temperatures, later.frequencies
    predicted = fem.predict(T)
    wanted = PredictionDisplay.from_predictions(F, predicted, kind="lines")
    frames = F, predicted[list(F)[::-1]]
    for one, other in (frames, (F, predicted.to_numpy()), (F.to_numpy(), predicted)):
        display = PredictionDisplay.from_predictions(one, other, kind="lines")
        for label, lines in wanted.lines_.items():
            for line, expected in zip(display.lines_[label], lines, strict=True):
                np.testing.assert_array_equal(line.get_xydata(), expected.get_xydata())
    with pytest.raises(ValueError, match="columns"):
        PredictionDisplay.from_predictions(F, predicted.rename(columns={"f1": "g1"}))
    indices = {"frame": F["f1"], "array": F["f1"].to_numpy()}
    first, second = DamageIndexDisplay.from_predictions(indices, 7.5).points_[""]
    np.testing.assert_array_equal(first.get_xdata(), second.get_xdata())
    with pytest.raises(ValueError, match="rows"):
        DamageIndexDisplay.from_predictions(indices | {"short": np.ones(3)}, 7.5)


def test_given_axes_are_used(later):
    figure, axes = plt.subplots(2, 1)
    tables = [table[["f1", "f2"]] for table in (later.frequencies, later.clean_frequencies)]
    for display in (
        PredictionDisplay.from_predictions(tables[0], temperature=later.temperatures["T1"], ax=axes),
        PredictionDisplay.from_predictions(*tables, ax=axes[:, np.newaxis]),
    ):
        assert list(display.axes_) == list(axes)
        assert display.figure_ is figure
    assert plt.get_fignums() == [figure.number]
    for wrong in (axes[:1], "here"):
        with pytest.raises(ValueError, match="expected 2 of matplotlib's axes"):
            PredictionDisplay.from_predictions(*tables, ax=wrong)


def test_histories_of_estimated_and_predicted_parameters(fem, year):
    display = PredictionDisplay.from_estimator(fem, what="parameters")
    for column, name in enumerate(fem.parameter_names_):
        np.testing.assert_allclose(drawn(display.lines_["from frequencies"][column]), fem.parameters_[name])
        learned = fem.predict_parameters(year.temperatures)[name]
        np.testing.assert_array_equal(drawn(display.lines_["from temperatures"][column]), learned)
    assert display.axes_[0].get_ylabel() == "bottom\nmultiple of nominal"


def test_time_goes_on_a_date_axis_in_order_and_lines_break_in_gaps():
    index = pd.date_range("2020-01-01", periods=50, freq="h", tz="Europe/Brussels").delete(slice(20, 40))
    values = pd.DataFrame({"f1": np.arange(30.0)}, index)
    values.iloc[5, 0] = np.nan
    shuffled = values.sample(frac=1, random_state=0)
    line = PredictionDisplay.from_predictions(shuffled, kind="lines").lines_["measured"][0]
    ax = line.axes
    assert isinstance(ax.xaxis.get_major_formatter(), mdates.ConciseDateFormatter)
    y = drawn(line)
    assert np.isnan(y).sum() == 2  # the missing value, and one in the gap
    np.testing.assert_array_equal(y[~np.isnan(y)], values["f1"].dropna())
    assert np.isnan(y[20])
    assert (np.diff(mdates.date2num(line.get_xdata())) > 0).all()
    assert line.get_xdata()[0] == np.datetime64("2020-01-01T00:00")  # local time


def test_marks_stand_at_a_time_or_at_a_record(later):
    F = later.frequencies[["f1", "f2"]]
    at = F.index[100]
    for place in (at, str(at), 100):
        display = PredictionDisplay.from_predictions(F, marks={"hold-out": place})
        for ax in display.axes_:
            assert ax.lines[-1].get_xdata()[0] == at.to_datetime64()
        assert display.axes_[0].texts[0].get_text().strip() == "hold-out"
    for records, place in ((F, 999), (F.to_numpy(), at)):
        with pytest.raises(ValueError, match="expected"):
            PredictionDisplay.from_predictions(records, marks={"x": place})


def test_predictions_with_intervals_in_time(fem, later):
    T, F = later.temperatures, later.frequencies
    display = PredictionDisplay.from_estimator(fem, T, F, confidence=0.8)
    lowest, highest = fem.predict_interval(T, 0.8)
    predicted = fem.predict(T)
    for column, mode in enumerate(F):
        np.testing.assert_array_equal(drawn(display.lines_["measured"][column]), F[mode])
        np.testing.assert_array_equal(drawn(display.lines_["predicted"][column]), predicted[mode])
        corners = display.bands_[column].get_paths()[0].vertices[:, 1]
        assert corners.min() == pytest.approx(lowest[mode].min())
        assert corners.max() == pytest.approx(highest[mode].max())
    assert display.lines_["measured"][0].get_color() == "#0072B2"
    assert display.lines_["predicted"][0].get_color() == "#D55E00"
    texts = [text.get_text() for text in display.figure_.legends[0].get_texts()]
    assert texts == ["measured", "predicted", "interval, 80 %"]
    assert PredictionDisplay.from_estimator(fem, T, F, confidence=None).bands_ == []
    with pytest.raises(ValueError, match=r"LinearRegression\(\) has no method 'predict_interval'; expected"):
        PredictionDisplay.from_estimator(LinearRegression().fit(T, F), T, F, confidence=0.8)


@pytest.mark.parametrize(
    ("change", "said"), [(lambda T: T * np.nan, "not-evaluated"), (lambda T: T + 60, "other-weather")]
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
    alone = PredictionDisplay.from_predictions(np.ones(10), None, np.zeros(10), np.full(10, 2.0), kind="lines")
    assert alone.bands_[0].get_facecolor()[0, :3] == pytest.approx(to_rgb(alone.lines_["measured"][0].get_color()))


def test_predicted_over_measured(later):
    measured, predicted = (table[["f5", "f6"]] for table in (later.frequencies, later.clean_frequencies))
    display = PredictionDisplay.from_predictions(measured, predicted, kind="scatter", unit="Hz")
    line = display.lines_["predicted"][1]
    np.testing.assert_array_equal(line.get_xdata(), measured["f6"])
    np.testing.assert_array_equal(line.get_ydata(), predicted["f6"])
    assert [display.axes_[1].get_xlabel(), display.axes_[1].get_ylabel()] == ["measured (Hz)", "predicted (Hz)"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"lowest": 0}, "only one of lowest and highest"),
        ({"predicted": slice(1, None)}, "measured has 365 rows and predicted 364"),
        ({"predicted": np.s_[:, :5]}, "measured has 6 columns and predicted 5"),
        ({"titles": ["a"]}, r"titles is \['a'\]; expected 6"),
        ({"kind": "bar"}, "kind is 'bar'"),
        ({"temperature": pd.Series(0.0, pd.date_range("2000", periods=365))}, "different indices"),
    ],
)
def test_tables_and_options_that_do_not_fit_are_refused(later, options, message):
    F = later.frequencies
    if "predicted" in options:
        options = {"predicted": F.iloc[options["predicted"]]}
    with pytest.raises(ValueError, match=message):
        PredictionDisplay.from_predictions(F, **options)
    with pytest.raises(ValueError, match="what is 'theta'"):
        PredictionDisplay.from_estimator(None, F, F, what="theta")
