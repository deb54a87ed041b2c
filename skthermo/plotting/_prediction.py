"""Measured and predicted frequencies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from skthermo._frames import check_same_rows
from skthermo._warnings import warnings_once
from skthermo.plotting._axes import Axes, date_axis, draw_marks, figure_legend, panel_names, panels, size_in_time
from skthermo.plotting._limits import hold_outliers
from skthermo.plotting._style import BLACK, BLUE, ORANGE, line_style, marker_style, plain, with_unit
from skthermo.plotting._tables import as_table, check_like, in_time, with_breaks


@dataclass(eq=False, repr=False)
class PredictionDisplay:
    """Measured and predicted frequencies or parameters, in time with intervals, or one over the other.

    A few values far from the others do not stretch the axes: triangles at the edge and a number stand for them.

    It is best made by `from_estimator` or `from_predictions`.

    Parameters
    ----------
    measured, predicted : DataFrame of shape (n_samples, n_columns)
        One panel for each column.
    lowest, highest : DataFrame of shape (n_samples, n_columns), optional
        Intervals of the predictions.
    labels : tuple of str, default=("measured", "predicted")
        Legend of the two.
    interval_label : str, default="interval"
        Legend of the intervals.
    unit : str, default="Hz"
        Unit of the values.

    Attributes
    ----------
    axes_ : ndarray of Axes of shape (n_columns,)
        One panel for each column.
    figure_ : Figure
        Their figure.
    measured_, predicted_ : list of Line2D
        What is drawn, panel by panel; ``predicted_`` is empty in a scatter plot.
    bands_ : list of PolyCollection
        Intervals, panel by panel; empty where there are none.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.plotting import PredictionDisplay
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> display = PredictionDisplay.from_estimator(fem, later.temperatures, later.frequencies, confidence=0.9)
    >>> len(display.axes_), display.axes_[0].get_ylabel(), display.bands_[0].get_label()
    (6, '$f_{1}$ (Hz)', 'interval, 90 %')
    >>> plt.close(display.figure_)
    """

    measured: pd.DataFrame
    predicted: pd.DataFrame
    lowest: pd.DataFrame | None = None
    highest: pd.DataFrame | None = None
    _: KW_ONLY
    labels: tuple[str, str] = ("measured", "predicted")
    interval_label: str = "interval"
    unit: str = "Hz"

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: ArrayLike, y: ArrayLike, *, confidence: float | None = 0.9, **options: Any
    ) -> PredictionDisplay:
        """Draw measured frequencies and what a fitted estimator predicts.

        Parameters
        ----------
        estimator : fitted regressor
            From temperatures to frequencies, such as `~skthermo.surrogate.DataInformedFEM`.
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        y : array-like or DataFrame of shape (n_samples, n_modes)
            Measured frequencies in Hz.
        confidence : float, optional
            Probability of the intervals, for an estimator with ``predict_interval``; None draws none.
        **options : dict
            Options of `plot`.

        Returns
        -------
        PredictionDisplay

        Raises
        ------
        ValueError
            If temperatures and frequencies have different rows, or intervals are asked of an estimator without any.

        Warns
        -----
        UserWarning
            Once for each kind of doubt about the weather, such as rows without temperatures.
        """
        check_same_rows(X, y, ("temperatures", "frequencies"))
        if confidence is not None and not hasattr(estimator, "predict_interval"):
            raise ValueError(
                f"confidence is {confidence!r}, and {estimator!r:.200} has no method 'predict_interval'; expected an "
                "estimator with one, such as DataInformedFEM, or confidence=None"
            )
        if confidence is None or options.get("kind") == "scatter":
            return cls.from_predictions(y, estimator.predict(X), **options)
        with warnings_once():
            predicted, (lowest, highest) = estimator.predict(X), estimator.predict_interval(X, confidence)
        label = f"interval, {100 * confidence:g} %"
        return cls.from_predictions(y, predicted, lowest, highest, **{"interval_label": label, **options})

    @classmethod
    def from_predictions(
        cls,
        measured: ArrayLike,
        predicted: ArrayLike,
        lowest: ArrayLike | None = None,
        highest: ArrayLike | None = None,
        *,
        labels: tuple[str, str] = ("measured", "predicted"),
        interval_label: str = "interval",
        unit: str = "Hz",
        **options: Any,
    ) -> PredictionDisplay:
        """Draw measured and predicted values, or true and estimated ones.

        Parameters
        ----------
        measured : array-like or DataFrame of shape (n_samples, n_columns)
            Frequencies in Hz, or another quantity.
        predicted : array-like or DataFrame of shape (n_samples, n_columns)
            The same, predicted.
        lowest : array-like or DataFrame of shape (n_samples, n_columns), optional
            Lower ends of the intervals.
        highest : array-like or DataFrame of shape (n_samples, n_columns), optional
            Upper ends of the intervals.
        labels : tuple of str, default=("measured", "predicted")
            Legend of the two.
        interval_label : str, default="interval"
            Legend of the intervals.
        unit : str, default="Hz"
            Unit of the values; an empty string for none.
        **options : dict
            Options of `plot`.

        Returns
        -------
        PredictionDisplay

        Raises
        ------
        ValueError
            If the tables have different rows or columns, or only one end of the intervals is given.
        """
        if (lowest is None) != (highest is None):
            raise ValueError("only one of lowest and highest is given; expected both or none")
        tables = {"predicted": predicted, "lowest": lowest, "highest": highest}
        for name, table in tables.items():
            if table is not None:
                check_like(measured, table, ("measured", name))
        read = [None if table is None else as_table(table, name) for name, table in tables.items()]
        display = cls(as_table(measured, "measured"), *read, labels=labels, interval_label=interval_label, unit=unit)
        return display.plot(**options)

    def plot(
        self,
        ax: Axes = None,
        *,
        kind: Literal["time", "scatter"] = "time",
        titles: Sequence[str] | None = None,
        marks: Mapping[str, Any] | None = None,
        n_columns: int | None = None,
    ) -> PredictionDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes or array of Axes, optional
            One for each column. A new figure by default.
        kind : {"time", "scatter"}, default="time"
            Both in time, or the predicted value over the measured one.
        titles : sequence of str, optional
            Names of the panels; by default those of the columns.
        marks : mapping of str to time or number, optional
            Vertical lines by their label, for ``kind="time"``; on an axis of time, a number is a record's position.
        n_columns : int, optional
            Panels beside each other in a new figure; by default 1 in time and 3 in a scatter plot.

        Returns
        -------
        PredictionDisplay
            Itself.

        Raises
        ------
        ValueError
            If ``kind`` is something else, or a mark is not on the axis.
        """
        if kind not in ("time", "scatter"):
            raise ValueError(f"kind is {kind!r}; expected 'time' or 'scatter'")
        names = panel_names(titles, list(self.measured.columns))
        n_columns = n_columns or (1 if kind == "time" else 3)
        size = (3.4, 3.3) if kind == "scatter" else size_in_time(len(names), n_columns)
        self.axes_ = panels(ax, names, size, n_columns, share_x=kind == "time")
        self.figure_ = self.axes_[0].figure
        self.measured_: list[Any] = []
        self.predicted_: list[Any] = []
        self.bands_: list[Any] = []
        if kind == "scatter":
            self._draw_scatter(names)
            return self
        self._draw_time()
        for one, name in zip(self.axes_, names, strict=True):
            one.set_ylabel(with_unit(name, self.unit))
        bands = [table.to_numpy() for table in (self.lowest, self.highest) if table is not None]
        for column, one in enumerate(self.axes_):
            hold_outliers(one, also=[band[:, column] for band in bands])
        for one in self.axes_[-n_columns:] if ax is None else self.axes_:
            date_axis(one, self.measured.index)
        draw_marks(self.axes_, marks, self.measured.index)
        figure_legend(self.axes_, ax is None)
        return self

    def _draw_time(self) -> None:
        x, measured = in_time(self.measured)
        x_line, predicted = with_breaks(*in_time(self.predicted))
        points = marker_style(0, len(x))
        for column, one in enumerate(self.axes_):
            self.measured_ += one.plot(x, measured[:, column], **points, label=plain(self.labels[0]))
            style = line_style(1)
            self.predicted_ += one.plot(x_line, predicted[:, column], **style, label=plain(self.labels[1]))
        if self.lowest is None or self.highest is None:
            return
        lowest, highest = (with_breaks(*in_time(table))[1] for table in (self.lowest, self.highest))
        is_known = np.isfinite(lowest) & np.isfinite(highest)
        for column, one in enumerate(self.axes_):
            ends = lowest[:, column], highest[:, column]
            style = {"color": ORANGE, "alpha": 0.25, "linewidth": 0, "zorder": 1, "label": plain(self.interval_label)}
            self.bands_.append(one.fill_between(x_line, *ends, where=is_known[:, column], **style))

    def _draw_scatter(self, names: Sequence[str]) -> None:
        points = {**marker_style(0, len(self.measured)), "color": BLUE}
        for column, (one, name) in enumerate(zip(self.axes_, names, strict=True)):
            pair = self.measured.iloc[:, column].to_numpy(), self.predicted.iloc[:, column].to_numpy()
            self.measured_ += one.plot(*pair, **points)
            known = np.isfinite(pair[0]) & np.isfinite(pair[1])
            if known.any():
                one.axline((np.mean(pair[0][known]),) * 2, slope=1, color=BLACK, linewidth=0.8, linestyle="--")
            one.set(title=name)
            one.set_xlabel(with_unit(self.labels[0], self.unit))
            one.set_ylabel(with_unit(self.labels[1], self.unit))
            for direction in "xy":
                hold_outliers(one, direction=direction)
