"""Axes that outliers do not stretch, marks that count them, and records that are not evaluated."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from skthermo.plotting import DamageIndexDisplay, PredictionDisplay

THRESHOLD = 4.0


@pytest.fixture
def index():
    """A year of damage indices between 1 and 3."""
    times = pd.date_range("2024-01-01", periods=365, freq="D")
    return pd.Series(np.random.default_rng(0).uniform(1, 3, len(times)), times)


def edge_marks(ax):
    return [line for line in ax.lines if str(line.get_gid()).startswith("beyond")]


def texts(ax):
    return [text.get_text() for text in ax.texts]


def test_indices_far_above_the_others_are_counted_at_the_edge_where_they_are(index):
    index.iloc[[40, 200]] = [50.0, np.inf]
    display = DamageIndexDisplay.from_predictions(index, THRESHOLD)
    low, high = display.ax_.get_ylim()
    assert (low, high) == (0.0, pytest.approx(1.05 * THRESHOLD))
    (mark,) = edge_marks(display.ax_)
    np.testing.assert_array_equal(mark.get_xdata(orig=False), display.points_[""][0].get_xdata(orig=False)[[40, 200]])
    assert texts(display.ax_) == ["2 beyond, up to inf"]


@pytest.mark.parametrize("n_damaged", [0, 20, 180])
def test_a_group_of_high_indices_is_no_outlier(index, n_damaged):
    index.iloc[len(index) - n_damaged :] += 20
    display = DamageIndexDisplay.from_predictions(index, THRESHOLD)
    assert display.ax_.get_ylim()[1] > index.max()
    assert not edge_marks(display.ax_)
    assert not texts(display.ax_)


def test_every_point_is_in_view_or_counted(index):
    random = np.random.default_rng(1)
    for heavy in (random.standard_cauchy(500), np.exp(2 * random.normal(size=500)), np.r_[np.full(499, 2.0), 9.0]):
        display = PredictionDisplay.from_predictions(heavy)
        low, high = display.axes_[0].get_ylim()
        n_beyond = ((heavy < low) | (heavy > high)).sum()
        assert sum(int(text.split()[0]) for text in texts(display.axes_[0])) == n_beyond
        assert sum(len(mark.get_xdata()) for mark in edge_marks(display.axes_[0])) == n_beyond
        assert n_beyond <= 2 * np.ceil(0.02 * len(heavy))


def test_records_without_an_index_are_grey_ticks_with_their_number(index):
    index.iloc[[3, 4, 5, 300]] = np.nan
    panels = {"first": {"healthy": index}, "second": {"healthy": index, "damaged": index[:3]}}
    display = DamageIndexDisplay.from_predictions(panels, THRESHOLD)
    assert [texts(ax) for ax in display.axes_] == [["4 not evaluated"], ["healthy: 4 not evaluated"]]
    (ticks,) = (line for line in display.ax_.lines if line.get_gid() == "not evaluated")
    np.testing.assert_array_equal(ticks.get_xdata(), index.index[[3, 4, 5, 300]])
    assert ticks.get_color() == "#555555"
    for ax in display.axes_:  # no point lies behind the number
        (number,) = ax.texts
        below = number.get_window_extent().y0
        assert ax.transData.transform((0, index.max()))[1] < below
    assert texts(DamageIndexDisplay.from_predictions(index * np.nan, THRESHOLD).ax_) == ["365 not evaluated"]


def test_one_legend_names_the_labels_of_all_panels_which_keep_their_colours(index):
    panels = {"first": {"healthy": index}, "second": {"damaged": index, "healthy": index}}
    display = DamageIndexDisplay.from_predictions(panels, THRESHOLD)
    (legend,) = display.figure_.legends
    assert [text.get_text() for text in legend.get_texts()] == ["healthy", "threshold", "damaged"]
    assert not any(ax.get_legend() for ax in display.axes_)
    (first,), (damaged, healthy) = display.points_.values()
    assert first.get_color() == healthy.get_color() != damaged.get_color()


def test_failed_sensors_do_not_stretch_the_temperatures(later):
    T, F = later.temperatures["T1"].copy(), later.frequencies[["f1"]].copy()
    T.iloc[7], F.iloc[9, 0] = -999.0, 0.0
    ax = PredictionDisplay.from_predictions(F, temperature=T).axes_[0]
    assert ax.get_xlim()[0] > T.drop(T.index[7]).min() - 5
    assert ax.get_ylim()[0] > F["f1"].drop(F.index[9]).min() - 0.5
    assert {"1 beyond, down to -999", "1 beyond, down to 0"} <= set(texts(ax))


def test_intervals_stay_in_view_and_outliers_of_measurements_do_not_stretch_them(later):
    measured, clean = later.frequencies[["f2", "f3"]].copy(), later.clean_frequencies[["f2", "f3"]]
    measured.iloc[[5, 50], 1] *= 10
    display = PredictionDisplay.from_predictions(measured, clean, 0.9 * clean, 1.1 * clean)
    low, high = display.axes_[1].get_ylim()
    assert 0.85 * clean["f3"].min() < low < 0.9 * clean["f3"].min()
    assert 1.1 * clean["f3"].max() < high < 1.15 * clean["f3"].max()
    assert texts(display.axes_[1])[0].startswith("2 beyond, up to")
    assert not texts(display.axes_[0])


def test_drawing_again_counts_anew(later):
    figure, ax = plt.subplots()
    F = later.frequencies[["f1"]].copy()
    F.iloc[3, 0] = 1e3
    for _ in range(2):
        PredictionDisplay.from_predictions(F, ax=ax)
    assert texts(ax) == ["2 beyond, up to 1000"]
    assert plt.get_fignums() == [figure.number]


def test_many_records_are_all_drawn_in_a_small_file(tmp_path):
    """Files of vectors hold them as an image, in which each alarm and the extremes have their place."""
    n_records, random = 30_000, np.random.default_rng(0)
    index = pd.Series(random.uniform(1, 3, n_records), pd.date_range("2024", periods=n_records, freq="10min"))
    alarms = random.choice(n_records, 50, replace=False)
    index.iloc[alarms] = 5.0
    display = DamageIndexDisplay.from_predictions(index, THRESHOLD)
    display.figure_.savefig(tmp_path / "drawn.svg")
    assert (tmp_path / "drawn.svg").stat().st_size < 1e6
    figure, ax = display.figure_, display.ax_
    figure.canvas.draw()
    image = np.asarray(figure.canvas.buffer_rgba())[::-1, :, :3]
    x = display.points_[""][0].get_xdata(orig=False)
    places = np.round(ax.transData.transform(np.column_stack([x, index.to_numpy()]))).astype(int)
    lowest, highest = index.argmin(), index[index < THRESHOLD].argmax()
    for column, row in places[[*alarms, lowest, highest]]:
        assert (image[row, column] < 200).any()
