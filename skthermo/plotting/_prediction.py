"""Measured and predicted frequencies or parameters."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator

from skthermo._core.estimators import check_is_fitted
from skthermo._core.frames import check_same_rows
from skthermo._core.warnings import collected, warn_each
from skthermo.plotting import _display as shared
from skthermo.plotting._display import BLACK, BLUE, COLOURS, DENSE, GREY, LINES, ORANGE, Display

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.lines import Line2D


@dataclass(eq=False, repr=False)
class PredictionDisplay(Display):
    """Measured and predicted frequencies or parameters: in time, over a temperature, or one over the other.

    There is a panel for each mode or parameter. A few values far from the others do not stretch the axes: triangles at
    the edge and a number stand for them. Lines break at NaN and in long gaps of time. From 10,000 points on, lines and
    points are images in files of vectors, such as SVG; no point is left out.

    It is best made by `from_estimator` or `from_predictions`.

    Parameters
    ----------
    measured : DataFrame of shape (n_samples, n_columns)
        One panel for each column.
    predicted : dict of str to DataFrame of shape (n_samples, n_columns), optional
        By label; there may be several, or none.
    lowest, highest : DataFrame of shape (n_samples, n_columns), optional
        Intervals of the first of them, or of what is measured if nothing is predicted.
    temperature : Series of shape (n_samples,), optional
        In degrees Celsius; what is drawn then goes over it. Its name becomes part of the label.
    label : str, default="measured"
        Legend of what is measured.
    interval_label : str, default="interval"
        Legend of the intervals.
    quantity : str, optional
        What the values are, beside the names of the panels.
    unit : str, default="Hz"
        Unit of the values; an empty string for none.

    Attributes
    ----------
    axes_, ax_, figure_ : array of matplotlib's Axes, the first of them, and Figure
        Where it is drawn.
    lines_ : dict of str to list of Line2D
        Points or lines of each label, panel by panel; in a scatter plot, under the label of what is predicted.
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
    >>> display = PredictionDisplay.from_predictions(year.frequencies, temperature=year.temperatures["T1"])
    >>> display.axes_[0].get_xlabel()
    '$T_{1}$ (°C)'
    >>> plt.close("all")
    """

    measured: pd.DataFrame
    predicted: Mapping[str, pd.DataFrame] | None = None
    lowest: pd.DataFrame | None = None
    highest: pd.DataFrame | None = None
    _: KW_ONLY
    temperature: pd.Series | None = None
    label: str = "measured"
    interval_label: str = "interval"
    quantity: str = ""
    unit: str = "Hz"

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: ArrayLike | None = None,
        y: ArrayLike | None = None,
        *,
        what: Literal["frequencies", "parameters"] = "frequencies",
        sensor: Hashable | None = None,
        confidence: float | None = 0.9,
        **options: object,
    ) -> PredictionDisplay:
        """Draw measured frequencies and what a fitted estimator predicts, or the parameters that a chain finds in both.

        Parameters
        ----------
        estimator : fitted regressor
            From temperatures to frequencies, such as `~skthermo.surrogate.DataInformedFEM`.
        X : array-like or DataFrame of shape (n_samples, n_sensors), optional
            Temperatures in degrees Celsius; by default the records that a chain was fitted to.
        y : array-like or DataFrame of shape (n_samples, n_modes), optional
            Measured frequencies in Hz; needed if X is given.
        what : {"frequencies", "parameters"}, default="frequencies"
            Parameters are those that a chain estimates from the frequencies, and predicts from the temperatures.
        sensor : hashable, optional
            Name of a temperature, "T1", "T2", ... in an array: what is drawn goes over it instead of in time.
        confidence : float, optional
            Probability of the intervals of frequencies in time, for an estimator with ``predict_interval``; None draws
            none.
        **options : dict
            Options of `from_predictions` and of `plot`.

        Returns
        -------
        PredictionDisplay

        Raises
        ------
        ValueError
            If temperatures and frequencies have different rows, the sensor is unknown, intervals are asked of an
            estimator without any, or ``what`` is something else.

        Warns
        -----
        UserWarning
            Once for each kind of doubt about the weather, such as rows without temperatures.
        """
        if X is None:
            check_is_fitted(estimator)
            X, y = estimator.records_.temperatures, estimator.records_.frequencies
        check_same_rows(X, y, ("temperatures", "frequencies"))
        if what not in ("frequencies", "parameters"):
            raise ValueError(f"what is {what!r}; expected 'frequencies' or 'parameters'")
        if sensor is not None:
            temperatures = shared.as_table(X, "temperatures", "T")
            if sensor not in temperatures:
                raise ValueError(f"sensor is {sensor!r}; expected one of {list(temperatures)}")
            options["temperature"] = temperatures[sensor]
        if what == "parameters":
            tables = (estimator.estimate_parameters(y), estimator.predict_parameters(X))
            tables = [pd.DataFrame(table, columns=estimator.parameter_names_) for table in tables]
            words = {"labels": ("from frequencies", "from temperatures"), "quantity": "multiple of nominal", "unit": ""}
            return cls.from_predictions(*tables, **(words | options))
        ends: Sequence[ArrayLike] = ()
        with collected() as findings:
            predicted = estimator.predict(X)
            if confidence is not None and sensor is None and options.get("kind") != "scatter":
                if not hasattr(estimator, "predict_interval"):
                    raise ValueError(f"{estimator!r:.200} has no method 'predict_interval'; expected confidence=None")
                ends = estimator.predict_interval(X, confidence)
                options = {"interval_label": f"interval, {100 * confidence:g} %"} | options
        warn_each(findings)
        return cls.from_predictions(y, predicted, *ends, **options)

    @classmethod
    def from_predictions(
        cls,
        measured: ArrayLike,
        predicted: ArrayLike | Mapping[str, ArrayLike] | None = None,
        lowest: ArrayLike | None = None,
        highest: ArrayLike | None = None,
        *,
        temperature: ArrayLike | None = None,
        labels: tuple[str, str] = ("measured", "predicted"),
        **options: object,
    ) -> PredictionDisplay:
        """Draw measured and predicted values, or true and estimated ones.

        Parameters
        ----------
        measured : array-like or DataFrame of shape (n_samples, n_columns)
            Frequencies in Hz, or another quantity.
        predicted : array-like or DataFrame of shape (n_samples, n_columns), or mapping of str to such, optional
            The same, predicted; several by label.
        lowest : array-like or DataFrame of shape (n_samples, n_columns), optional
            Lower ends of the intervals.
        highest : array-like or DataFrame of shape (n_samples, n_columns), optional
            Upper ends of the intervals.
        temperature : array-like or Series of shape (n_samples,), optional
            In degrees Celsius: what is drawn goes over it instead of in time.
        labels : tuple of str, default=("measured", "predicted")
            Legend of the two.
        **options : dict
            ``interval_label``, ``quantity`` and ``unit`` of the display, and options of `plot`.

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
        by_label = predicted if isinstance(predicted, Mapping) else {labels[1]: predicted}
        given = {str(label): table for label, table in by_label.items()} | {"lowest": lowest, "highest": highest}
        first, tables = shared.as_table(measured, "measured"), {}
        for name, table in given.items():
            if table is not None:
                check_same_rows(measured, table, ("measured", name))
                tables[name] = shared.as_table(table, name)
                if tables[name].shape != first.shape:
                    n_columns = f"{first.shape[1]} columns and {name} {tables[name].shape[1]}"
                    raise ValueError(f"measured has {n_columns}; expected the same")
        ends = tables.pop("lowest", None), tables.pop("highest", None)
        if temperature is not None:
            check_same_rows(temperature, measured, ("temperature", "measured"))
            table = shared.as_table(temperature, "temperature")
            if table.shape[1] != 1:
                raise ValueError(f"temperature has {table.shape[1]} columns; expected one sensor")
            is_named = isinstance(temperature, pd.DataFrame) or getattr(temperature, "name", None) is not None
            options["temperature"] = table.iloc[:, 0].rename(table.columns[0] if is_named else "temperature")
        return cls._drawn(first, tables, *ends, label=labels[0], **options)

    def plot(
        self,
        ax: Axes | np.ndarray | None = None,
        *,
        kind: Literal["time", "points", "lines", "scatter"] = "time",
        titles: Sequence[str] | None = None,
        marks: Mapping[str, object] | None = None,
        n_columns: int | None = None,
    ) -> PredictionDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes or array of Axes, optional
            One for each column. A new figure by default.
        kind : {"time", "points", "lines", "scatter"}, default="time"
            "time" draws measured points and predicted lines, "points" or "lines" both so, and all of them in time where
            no temperature is given; "scatter" draws the first predicted value over the measured one.
        titles : sequence of str, optional
            Names of the panels; by default those of the columns.
        marks : mapping of str to time or number, optional
            Vertical lines in time by their label; on an axis of time, a number is a record's position.
        n_columns : int, optional
            Panels beside each other in a new figure; by default 1 in time, and 3 or 4 otherwise.

        Returns
        -------
        PredictionDisplay
            Itself.

        Raises
        ------
        ValueError
            If ``kind`` is something else, or a mark is not on the axis.
        """
        if kind not in (kinds := ("time", "points", "lines", "scatter")):
            raise ValueError(f"kind is {kind!r}; expected one of {kinds}")
        columns = list(self.measured.columns)
        if titles is not None and len(titles) != len(columns):
            raise ValueError(f"titles is {list(titles)}; expected {len(columns)}, for {columns}")
        names = [shared.label_of(name) for name in (columns if titles is None else titles)]
        in_time = kind != "scatter" and self.temperature is None
        n_columns = n_columns or (1 if in_time else 3 if kind == "scatter" or len(names) == 6 else 4)
        n_rows = -(-len(names) // n_columns)  # panels over time are wide, and taller if there are few
        size = (9.0 if n_columns == 1 else 5.5, 3.4 if n_rows == 1 else 2.5 if n_rows == 2 else 1.9)
        self.axes_ = shared.panels(ax, names, size if in_time else (3.3, 3.2), n_columns, share_x=in_time)
        self.lines_: dict[str, list[Line2D]] = {}
        self.bands_: list[PolyCollection] = []
        if kind == "scatter":
            self._draw_scatter()
        elif not in_time:
            self._draw_over_temperature(n_columns)
        else:
            self._draw_in_time(kind, names)
            for one in self.axes_[-n_columns:] if ax is None else self.axes_:
                shared.date_axis(one, self.measured.index)
            for text, place in (marks or {}).items():
                at = shared.on_axis(place, self.measured.index)
                for one in self.axes_:
                    one.axvline(at, color=GREY, linestyle="--", linewidth=1)
                transform = self.axes_[0].get_xaxis_transform()
                self.axes_[0].text(at, 1.03, f" {shared.shortened(text)}", transform=transform, fontsize="small")
        if not in_time:
            for one, name in zip(self.axes_, names, strict=True):
                one.set_title(name)
                shared.hold_outliers(one, "x")
                shared.hold_outliers(one)
        if len(self.lines_) > 1 or self.bands_:
            shared.legend(self.axes_, ax is None)
        return self

    def _draw_each(self, label: str, x: NDArray, values: NDArray, style: Mapping[str, object]) -> None:
        """Points or lines of each column in its panel."""
        style = {**style, "label": shared.shortened(label)}
        self.lines_[label] = [one.plot(x, column, **style)[0] for one, column in zip(self.axes_, values.T, strict=True)]

    def _with_unit(self, quantity: str) -> str:
        """Label of an axis."""
        return shared.plain(f"{quantity} ({self.unit})" if self.unit else quantity)

    def _draw_in_time(self, kind: str, names: Sequence[str]) -> None:
        tables = {self.label: self.measured, **(self.predicted or {})}
        for number, (label, table) in enumerate(tables.items()):
            x, values = shared.in_time(table)
            if kind == "points" or (kind == "time" and number == 0):
                self._draw_each(label, x, values, shared.marker_style(number, len(x)))
            else:
                style = {"linestyle": LINES[(number - (kind == "time")) % len(LINES)], "linewidth": 1.0}
                style |= {"color": COLOURS[number % len(COLOURS)], "rasterized": len(x) > DENSE}
                self._draw_each(label, *with_breaks(x, values), style)
        ends: list[NDArray] = []
        if self.lowest is not None and self.highest is not None:
            x = with_breaks(*shared.in_time(self.lowest))[0]
            ends = [with_breaks(*shared.in_time(table))[1] for table in (self.lowest, self.highest)]
            style = {"color": ORANGE if self.predicted else BLUE, "alpha": 0.25, "linewidth": 0, "zorder": 1}
            style |= {"label": shared.shortened(self.interval_label), "rasterized": len(x) > DENSE}
            for one, low, high in zip(self.axes_, *(end.T for end in ends), strict=True):
                self.bands_.append(one.fill_between(x, low, high, where=np.isfinite(low + high), **style))
        for column, (one, name) in enumerate(zip(self.axes_, names, strict=True)):
            one.set_ylabel(self._with_unit(f"{name}\n{self.quantity}" if self.quantity else name))
            shared.hold_outliers(one, also=[end[:, column] for end in ends])

    def _draw_over_temperature(self, n_columns: int) -> None:
        for number, (label, table) in enumerate([(self.label, self.measured), *(self.predicted or {}).items()]):
            style = shared.marker_style(number, len(table)) | {"alpha": 0.7 if number else 1.0}
            self._draw_each(label, self.temperature.to_numpy(), table.to_numpy(), style)
        for number, one in enumerate(self.axes_):
            one.set_xlabel(f"{shared.label_of(self.temperature.name)} (°C)")
            if number % n_columns == 0:
                one.set_ylabel(self._with_unit(self.quantity or "frequency"))

    def _draw_scatter(self) -> None:
        label, predicted = next(iter((self.predicted or {}).items()))
        style = shared.marker_style(0, len(self.measured))
        pairs = list(zip(self.measured.to_numpy().T, predicted.to_numpy().T, strict=True))
        self.lines_[label] = [one.plot(*pair, **style)[0] for one, pair in zip(self.axes_, pairs, strict=True)]
        for one, pair in zip(self.axes_, pairs, strict=True):
            known = pair[0][np.isfinite(pair).all(axis=0)]
            if known.size:
                one.axline((known.mean(),) * 2, slope=1, color=BLACK, linewidth=0.8, linestyle="--")
            one.set(xlabel=self._with_unit(self.label), ylabel=self._with_unit(label))


def with_breaks(x: NDArray, values: NDArray) -> tuple[NDArray, NDArray]:
    """The same with NaN in gaps of more than ten usual steps of time, so that a line breaks there."""
    if not np.issubdtype(x.dtype, np.datetime64) or len(x) < 3:
        return x, values
    steps = np.diff(x)
    usual = np.median(steps)
    before = np.flatnonzero(steps > 10 * usual)
    return np.insert(x, before + 1, x[before] + usual), np.insert(values, before + 1, np.nan, axis=0)
