"""Frequencies over temperature."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from skthermo._frames import check_same_rows, column_names
from skthermo.plotting._axes import Axes, figure_legend, panel_names, panels
from skthermo.plotting._limits import hold_outliers
from skthermo.plotting._style import label_of, marker_style, plain, with_unit
from skthermo.plotting._tables import as_table, check_like


@dataclass(eq=False, repr=False)
class FrequencyTemperatureDisplay:
    """Frequencies over the temperature of one sensor, a panel for each mode, measured and predicted.

    A few values far from the others do not stretch the axes: triangles at the edge and a number stand for them.

    It is best made by `from_estimator` or `from_predictions`.

    Parameters
    ----------
    temperature : Series of shape (n_samples,)
        In degrees Celsius; its name becomes part of the label.
    measured : DataFrame of shape (n_samples, n_modes)
        In Hz.
    predicted : DataFrame of shape (n_samples, n_modes), optional
        In Hz.
    labels : tuple of str, default=("measured", "predicted")
        Legend of the two.
    quantity, unit : str
        Label of the vertical axis, and its unit.

    Attributes
    ----------
    axes_ : ndarray of Axes of shape (n_modes,)
        One panel for each mode.
    figure_ : Figure
        Their figure.
    points_ : dict of str to list of Line2D
        Points of each label, panel by panel.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.plotting import FrequencyTemperatureDisplay
    >>> year = make_truss_campaign(random_state=0)
    >>> display = FrequencyTemperatureDisplay.from_predictions(year.temperatures["T1"], year.frequencies)
    >>> len(display.axes_), display.axes_[0].get_xlabel()
    (6, '$T_{1}$ (°C)')
    >>> plt.close(display.figure_)
    """

    temperature: pd.Series
    measured: pd.DataFrame
    predicted: pd.DataFrame | None = None
    _: KW_ONLY
    labels: tuple[str, str] = ("measured", "predicted")
    quantity: str = "frequency"
    unit: str = "Hz"

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: ArrayLike, y: ArrayLike, *, sensor: Hashable | None = None, **options: Any
    ) -> FrequencyTemperatureDisplay:
        """Draw measured frequencies, and those that a fitted estimator predicts.

        Parameters
        ----------
        estimator : fitted regressor
            From temperatures to frequencies, such as `~skthermo.surrogate.DataInformedFEM`.
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        y : array-like or DataFrame of shape (n_samples, n_modes)
            Measured frequencies in Hz.
        sensor : hashable or int, optional
            Name of the temperature on the horizontal axis, or its number in an array; by default the first.
        **options : dict
            Options of `plot`.

        Returns
        -------
        FrequencyTemperatureDisplay

        Raises
        ------
        ValueError
            If the sensor is unknown, or temperatures and frequencies have different rows.
        """
        check_same_rows(X, y, ("temperatures", "frequencies"))
        temperatures = as_table(X, "temperatures", "T")
        return cls.from_predictions(chosen_sensor(X, temperatures, sensor), y, estimator.predict(X), **options)

    @classmethod
    def from_predictions(
        cls,
        temperature: ArrayLike,
        measured: ArrayLike,
        predicted: ArrayLike | None = None,
        *,
        labels: tuple[str, str] = ("measured", "predicted"),
        quantity: str = "frequency",
        unit: str = "Hz",
        **options: Any,
    ) -> FrequencyTemperatureDisplay:
        """Draw frequencies, or parameters, over a temperature.

        Parameters
        ----------
        temperature : array-like or Series of shape (n_samples,)
            In degrees Celsius.
        measured : array-like or DataFrame of shape (n_samples, n_modes)
            Measured frequencies in Hz, or any other quantity.
        predicted : array-like or DataFrame of shape (n_samples, n_modes), optional
            Predicted frequencies in Hz.
        labels : tuple of str, default=("measured", "predicted")
            Legend of the two.
        quantity : str, default="frequency"
            Label of the vertical axis.
        unit : str, default="Hz"
            Its unit; an empty string for none.
        **options : dict
            Options of `plot`.

        Returns
        -------
        FrequencyTemperatureDisplay

        Raises
        ------
        ValueError
            If the tables have different rows or columns.
        """
        check_same_rows(temperature, measured, ("temperature", "measured"))
        weather = as_table(temperature, "temperature", "T")
        if weather.shape[1] != 1:
            raise ValueError(f"temperature has {weather.shape[1]} columns; expected one sensor")
        table = as_table(measured, "measured")
        if predicted is not None:
            check_like(measured, predicted, ("measured", "predicted"))
            predicted = as_table(predicted, "predicted")
        is_named = getattr(temperature, "name", None) is not None or isinstance(temperature, pd.DataFrame)
        series = weather.iloc[:, 0].rename(weather.columns[0] if is_named else None)
        display = cls(series, table, predicted, labels=labels, quantity=quantity, unit=unit)
        return display.plot(**options)

    def plot(
        self, ax: Axes = None, *, titles: Sequence[str] | None = None, n_columns: int = 4
    ) -> FrequencyTemperatureDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes or array of Axes, optional
            One for each mode. A new figure by default.
        titles : sequence of str, optional
            Titles of the panels; by default the names of the modes.
        n_columns : int, default=4
            Panels beside each other in a new figure.

        Returns
        -------
        FrequencyTemperatureDisplay
            Itself.
        """
        names = panel_names(titles, list(self.measured.columns))
        n_columns = n_columns if len(names) != 6 else min(n_columns, 3)
        self.axes_ = panels(ax, names, (3.3, 3.2), n_columns)
        self.figure_ = self.axes_[0].figure
        tables = dict(zip(self.labels, (self.measured, self.predicted), strict=True))
        self.points_ = {}
        for number, (label, table) in enumerate(tables.items()):
            if table is not None:
                style = {**marker_style(number, len(table)), "label": plain(label), "alpha": 0.7 if number else 1.0}
                self.points_[label] = [
                    one.plot(self.temperature.to_numpy(), table.iloc[:, column].to_numpy(), **style)[0]
                    for column, one in enumerate(self.axes_)
                ]
        sensor = "temperature" if self.temperature.name is None else label_of(self.temperature.name)
        for number, (one, name) in enumerate(zip(self.axes_, names, strict=True)):
            one.set(title=name, xlabel=with_unit(sensor, "°C"))
            hold_outliers(one, direction="x")
            hold_outliers(one)
            if number % n_columns == 0:
                one.set_ylabel(with_unit(self.quantity, self.unit))
        if self.predicted is not None:
            figure_legend(self.axes_, ax is None)
        return self


def chosen_sensor(X: Any, temperatures: pd.DataFrame, sensor: Hashable | None) -> pd.Series:
    """One column of the temperatures, by its name or, in an array, by its number."""
    if sensor is None:
        return temperatures.iloc[:, 0]
    if isinstance(X, pd.DataFrame):
        if sensor not in X:
            raise ValueError(f"sensor is {sensor!r}; expected one of {column_names(X, 'T')}")
        return temperatures[sensor]
    if not isinstance(sensor, int | np.integer) or not 0 <= sensor < temperatures.shape[1]:
        raise ValueError(f"sensor is {sensor!r}; expected a column's number from 0 to {temperatures.shape[1] - 1}")
    return temperatures.iloc[:, sensor]
