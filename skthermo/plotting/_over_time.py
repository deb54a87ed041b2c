"""Records, predictions and damage indices over time or over a temperature."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from numbers import Real
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator

import skthermo.plotting._display as shared
from skthermo._core.arrays import Array, as_columns, real_array
from skthermo._core.estimators import check_is_fitted, last_step
from skthermo._core.frames import check_same_rows, check_stamp, midnights_between
from skthermo._core.warnings import collected, warn_each
from skthermo.detection import MahalanobisDetector
from skthermo.plotting._display import AMBER, BLACK, BLUE, COLOURS, DENSE, GREY, LINES, MARKERS, ORANGE, PURPLE, Display

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

Time = str | pd.Timestamp | None
EDGES: dict[tuple[str, bool], tuple[str, dict[str, object]]] = {
    ("y", False): ("v", {"x": 0.99, "y": 0.03, "ha": "right", "va": "bottom"}),
    ("y", True): ("^", {"x": 0.99, "y": 0.96, "ha": "right", "va": "top"}),
    ("x", False): ("<", {"x": 0.02, "y": 0.5, "ha": "left", "va": "center", "rotation": 90}),
    ("x", True): (">", {"x": 0.98, "y": 0.5, "ha": "right", "va": "center", "rotation": 90}),
}
"""Marker of the lower or upper edge of an axis, and how its text stands."""


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
            temperatures = as_table(X, "temperatures", "T")
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
            The same, predicted; several by label. Columns of frames are matched by name, rows of arrays are those of
            the first frame.
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
        by_label = {str(label): one for label, one in by_label.items() if one is not None}
        first = as_table(measured, "measured", beside=[*by_label.values(), lowest, highest])

        def like_first(table: ArrayLike, name: str) -> pd.DataFrame:
            check_same_rows(first, table, ("measured", name))
            found = as_table(table, name, beside=[first])
            if found.shape != first.shape:
                n_columns = f"{first.shape[1]} columns and {name} {found.shape[1]}"
                raise ValueError(f"measured has {n_columns}; expected the same")
            if not isinstance(table, pd.DataFrame) or not isinstance(measured, pd.DataFrame):
                return found.set_axis(first.columns, axis=1)
            if set(found.columns) != set(first.columns):
                names = f"the columns {list(first.columns)} and {name} {list(found.columns)}"
                raise ValueError(f"measured has {names}; expected the same")
            return found[first.columns]

        tables = {label: like_first(one, label) for label, one in by_label.items()}
        ends = () if lowest is None else (like_first(lowest, "lowest"), like_first(highest, "highest"))
        if temperature is not None:
            check_same_rows(temperature, measured, ("temperature", "measured"))
            options["temperature"] = as_table(temperature, "temperature", is_one=True).iloc[:, 0]
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
                date_axis(one, self.measured.index)
            for text, place in (marks or {}).items():
                at = on_axis(place, self.measured.index)
                for one in self.axes_:
                    one.axvline(at, color=GREY, linestyle="--", linewidth=1)
                transform = self.axes_[0].get_xaxis_transform()
                self.axes_[0].text(at, 1.03, f" {shared.shortened(text)}", transform=transform, fontsize="small")
        if not in_time:
            for one, name in zip(self.axes_, names, strict=True):
                one.set_title(name)
                hold_outliers(one, "x")
                hold_outliers(one)
        if len(self.lines_) > 1 or self.bands_:
            shared.legend(self.axes_, ax is None)
        return self

    def _draw_each(self, label: str, x: NDArray, values: NDArray, style: Mapping[str, object]) -> None:
        """Points or lines of each column in its panel, over one x or that of each column."""
        xs = x.T if x.ndim == 2 else [x] * len(self.axes_)
        columns = zip(self.axes_, xs, values.T, strict=True)
        style = {**style, "label": shared.shortened(label)}
        self.lines_[label] = [one.plot(x, column, **style)[0] for one, x, column in columns]

    def _with_unit(self, quantity: str) -> str:
        """Label of an axis."""
        return shared.plain(f"{quantity} ({self.unit})" if self.unit else quantity)

    def _draw_in_time(self, kind: str, names: Sequence[str]) -> None:
        tables = {self.label: self.measured, **(self.predicted or {})}
        for number, (label, table) in enumerate(tables.items()):
            x, values = in_time(table)
            if kind == "points" or (kind == "time" and number == 0):
                self._draw_each(label, x, values, marker_style(number, len(x)))
            else:
                style = {"linestyle": LINES[(number - (kind == "time")) % len(LINES)], "linewidth": 1.0}
                style |= {"color": COLOURS[number % len(COLOURS)], "rasterized": len(x) > DENSE}
                self._draw_each(label, *with_breaks(x, values), style)
        ends: list[NDArray] = []
        if self.lowest is not None and self.highest is not None:
            x = with_breaks(*in_time(self.lowest))[0]
            ends = [with_breaks(*in_time(table))[1] for table in (self.lowest, self.highest)]
            style = {"color": ORANGE if self.predicted else BLUE, "alpha": 0.25, "linewidth": 0, "zorder": 1}
            style |= {"label": shared.shortened(self.interval_label), "rasterized": len(x) > DENSE}
            for one, low, high in zip(self.axes_, *(end.T for end in ends), strict=True):
                self.bands_.append(one.fill_between(x, low, high, where=np.isfinite(low + high), **style))
        for column, (one, name) in enumerate(zip(self.axes_, names, strict=True)):
            one.set_ylabel(self._with_unit(f"{name}\n{self.quantity}" if self.quantity else name))
            hold_outliers(one, also=[end[:, column] for end in ends])

    def _draw_over_temperature(self, n_columns: int) -> None:
        for number, (label, table) in enumerate([(self.label, self.measured), *(self.predicted or {}).items()]):
            style = marker_style(number, len(table)) | {"alpha": 0.7 if number else 1.0}
            self._draw_each(label, self.temperature.to_numpy(), table.to_numpy(), style)
        for number, one in enumerate(self.axes_):
            one.set_xlabel(f"{shared.label_of(self.temperature.name)} (°C)")
            if number % n_columns == 0:
                one.set_ylabel(self._with_unit(self.quantity or "frequency"))

    def _draw_scatter(self) -> None:
        label, predicted = next(iter((self.predicted or {}).items()))
        tables = self.measured.to_numpy(), predicted.to_numpy()
        self._draw_each(label, *tables, marker_style(0, len(self.measured)))
        for one, x, y in zip(self.axes_, *(table.T for table in tables), strict=True):
            known = x[np.isfinite(x + y)]
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


@dataclass(eq=False, repr=False)
class DamageIndexDisplay(Display):
    """Damage index of every record, the threshold above which it is an alarm, the onset of damage, and events.

    Records without an index, which are not evaluated, are grey ticks at the bottom, with their number. A few indices
    far above the others do not stretch the axis: triangles at its edge and a number stand for them. Events are shaded.

    It is best made by `from_estimator` or `from_predictions`.

    Parameters
    ----------
    scenarios : dict of str to dict of str to DataFrame of shape (n_samples, 1)
        Damage indices by the title of their panel and by their label.
    thresholds : dict of str to float or Series
        Threshold of each panel; a Series is a threshold in time.
    onset : time or number, optional
        When damage began; on an axis of time, a number is the position of a record of the first table.
    label : str
        Label of the vertical axes.
    events : DataFrame, optional
        ``kind``, ``start``, ``end`` (NaT while it is open) and ``harmless``.
    watch : float, optional
        A second, lower threshold.

    Attributes
    ----------
    axes_, ax_, figure_ : array of matplotlib's Axes, the first of them, and Figure
        Where it is drawn.
    points_ : dict of str to list of Line2D
        Points of each panel, in the order of their labels.
    threshold_lines_ : list of Line2D
        Threshold of each panel.
    event_spans_ : list of Polygon
        Shades of events.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector
    >>> from skthermo.plotting import DamageIndexDisplay
    >>> healthy, damaged = (make_truss_campaign(damage=damage, random_state=0) for damage in (None, {"bottom": 0.3}))
    >>> detector = MahalanobisDetector().fit(healthy.frequencies)
    >>> display = DamageIndexDisplay.from_estimator(
    ...     detector, {"healthy": healthy.frequencies, "damaged": damaged.frequencies})
    >>> display.ax_.get_ylabel()
    'damage index (Mahalanobis, unsquared)'
    >>> plt.close(display.figure_)
    """

    scenarios: Mapping[str, Mapping[str, pd.DataFrame]]
    thresholds: Mapping[str, float]
    _: KW_ONLY
    onset: object = None
    label: str = "damage index"
    events: pd.DataFrame | None = None
    watch: float | None = None

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: Mapping[str, ArrayLike] | ArrayLike | None = None,
        *,
        start: Time = None,
        end: Time = None,
        by: Literal["day", "record"] = "day",
        **options: object,
    ) -> DamageIndexDisplay:
        """Draw the damage index that a fitted detector gives to records, or that a monitor has given, with its events.

        Parameters
        ----------
        estimator : fitted outlier detector or Monitor
            A detector of this package, one of scikit-learn's with ``score_samples`` and ``offset_``, or a pipeline
            that ends with one; or a `~skthermo.monitoring.Monitor` that has evaluated records.
        X : array-like or DataFrame of shape (n_samples, n_columns), or mapping of str to such
            What the detector evaluates, in Hz for frequencies; several tables by label. Not for a monitor.
        start, end : time, optional
            First and last time of a monitor that are drawn; by default all days in service.
        by : {"day", "record"}, default="day"
            Whether the highest index of each day of a monitor is drawn, or that of every record that it keeps.
        **options : dict
            ``onset`` and ``label`` of the display, and options of `plot`.

        Returns
        -------
        DamageIndexDisplay

        Raises
        ------
        ValueError
            If the detector has no scores or no threshold; if the monitor has no records in this time.
        """
        if X is None:
            return cls.from_predictions(**monitored(estimator, start, end, by), **options)
        last = last_step(estimator)
        if not hasattr(estimator, "score_samples"):
            raise ValueError(f"{estimator!r:.200} has no method 'score_samples'; expected an outlier detector")
        threshold = getattr(last, "threshold_", -getattr(last, "offset_", np.nan))
        tables = X if isinstance(X, Mapping) else {"records": X}
        indices = {
            label: pd.Series(-estimator.score_samples(one), one.index if isinstance(one, pd.DataFrame) else None)
            for label, one in tables.items()
        }
        name = "damage index (Mahalanobis, unsquared)" if isinstance(last, MahalanobisDetector) else "damage index"
        return cls.from_predictions(indices, threshold, **{"label": name, **options})

    @classmethod
    def from_predictions(
        cls,
        index: Mapping[str, Mapping[str, ArrayLike] | ArrayLike] | ArrayLike,
        threshold: float | pd.Series | Mapping[str, float | pd.Series],
        **options: object,
    ) -> DamageIndexDisplay:
        """Draw damage indices.

        Parameters
        ----------
        index : array-like or Series of shape (n_samples,), or mapping of str to such, or of str to such mappings
            Damage index of each record; several by label; or by the title of their panel, and then by label.
        threshold : float or Series, or mapping of str to such
            A damage index above it is an alarm; one for all panels, or one for each title. A Series holds a threshold
            that changes in time.
        **options : dict
            ``onset``, ``label``, ``events`` and ``watch`` of the display, and options of `plot`.

        Returns
        -------
        DamageIndexDisplay

        Raises
        ------
        ValueError
            If an index is not a column of numbers, or a threshold missing or not a number.
        """
        has_panels = isinstance(index, Mapping) and any(isinstance(one, Mapping) for one in index.values())
        by_title = index if has_panels else {"": index if isinstance(index, Mapping) else {"records": index}}
        given = threshold if isinstance(threshold, Mapping) else dict.fromkeys(by_title, threshold)
        tables: dict[str, dict[str, pd.DataFrame]] = {}
        for title, by_label in by_title.items():
            if not isinstance(by_label, Mapping) or not by_label:
                raise ValueError(f"damage index is {by_label!r:.200}; expected one or more by label")
            beside = list(by_label.values())
            tables[title] = {
                str(label): as_table(one, f"damage index {label!r}", is_one=True, beside=beside)
                for label, one in by_label.items()
            }
            value, what = given.get(title), f"threshold{f' of {title!r}' if title else ''}"
            values = real_array(value, what)
            if values.ndim != int(isinstance(value, pd.Series)) or not values.size or not np.isfinite(values).all():
                raise ValueError(f"{what} is {value!r}; expected a number")
        return cls._drawn(tables, {title: given[title] for title in tables}, **options)

    def plot(
        self,
        ax: Axes | np.ndarray | None = None,
        *,
        n_columns: int = 1,
        colours: Mapping[str, str] | None = None,
    ) -> DamageIndexDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes or array of Axes, optional
            One for each scenario. A new figure by default.
        n_columns : int, default=1
            Panels beside each other in a new figure.
        colours : mapping of str to str, optional
            Colours by label; by default those of the palette in their order.

        Returns
        -------
        DamageIndexDisplay
            Itself.

        Raises
        ------
        ValueError
            If the onset or an event is not on the axis.
        """
        titles, is_own_figure = list(self.scenarios), ax is None
        labels = list(dict.fromkeys(label for by_label in self.scenarios.values() for label in by_label))
        height = 3.4 if len(titles) == 1 else 2.6
        size = (9.0 if n_columns == 1 else 4.6), height
        self.axes_ = shared.panels(ax, titles, size, n_columns, share_x=True)
        self.points_: dict[str, list[Line2D]] = {}
        self.threshold_lines_: list[Line2D] = []
        self.event_spans_: list[Polygon] = []
        for number, (one, title) in enumerate(zip(self.axes_, titles, strict=True)):
            index = next(iter(self.scenarios[title].values())).index
            self._draw_events(one, index)
            self.points_[title], unknown = [], {}
            for label, table in self.scenarios[title].items():
                x, values = in_time(table)
                style = marker_style(labels.index(label), len(x)) | {"label": shared.shortened(label)}
                style["color"] = (colours or {}).get(label, style["color"])
                self.points_[title] += one.plot(x, values[:, 0], **style)
                unknown[style["label"]] = x[np.isnan(values[:, 0])]
            mark_not_evaluated(one, unknown)
            highest = self._draw_threshold(one, self.thresholds[title])
            if self.onset is not None:
                at = on_axis(self.onset, index)
                one.axvline(at, color=GREY, linewidth=1.2, label="onset of damage")
            one.set_title(shared.shortened(title))
            one.set_ylim(bottom=0)
            hold_outliers(one, keep=(0.0, highest))
            if [text.get_gid() for text in one.texts] == ["not evaluated"]:  # it stands above the points
                one.set_ylim(top=1.2 * one.get_ylim()[1])
            if not is_own_figure or number % n_columns == 0:
                one.set_ylabel(shared.plain(self.label if height > 3 else self.label.replace(" (", "\n(")))
            if not is_own_figure or number >= len(titles) - n_columns:
                date_axis(one, index)
        shared.legend(self.axes_, is_own_figure, n_columns=5)
        return self

    def _draw_threshold(self, ax: Axes, threshold: float | pd.Series) -> float:
        """A line, in steps where the threshold changes, and that of a watch; the highest value."""
        style = {"color": BLACK, "linestyle": "--", "linewidth": 1, "label": "threshold"}
        highest = float(np.max(threshold))
        if isinstance(threshold, pd.Series) and threshold.nunique() > 1:
            x, values = in_time(threshold.to_frame())
            self.threshold_lines_ += ax.plot(x, values[:, 0], drawstyle="steps-post", **style)
        else:
            self.threshold_lines_.append(ax.axhline(highest, **style))
        if self.watch is not None:
            ax.axhline(self.watch, color=GREY, linestyle=":", linewidth=1, label="threshold of a watch")
        return highest

    def _draw_events(self, ax: Axes, index: pd.Index) -> None:
        """Shades from the start of each event to its end or, of an open one, to the last record."""
        shades = {"damage": (ORANGE, ""), "watch": (AMBER, "\\\\"), "drift": (PURPLE, "//"), "harmless": (GREY, "..")}
        for event in () if self.events is None else self.events.to_dict("records"):
            kind = "harmless" if event.get("harmless", False) else event["kind"]
            colour, hatch = shades.get(kind, (GREY, "xx"))
            style = {"facecolor": (colour, 0.2), "edgecolor": (colour, 0.5), "hatch": hatch, "linewidth": 1}
            label = "event marked as harmless" if kind == "harmless" else f"{kind} event"
            ends = event["start"], index.max() if pd.isna(event["end"]) else event["end"]
            places = (on_axis(one, index) for one in ends)
            self.event_spans_.append(ax.axvspan(*places, label=label, **style))


def monitored(monitor: Any, start: Time, end: Time, by: str) -> dict[str, Any]:
    """Indices of a monitor's days or records, those in alarm apart, with its thresholds and events."""
    if not hasattr(monitor, "evaluations_"):
        raise ValueError(f"{monitor!r:.200} has no evaluations; expected a fitted Monitor, or records for a detector")
    if by not in ("day", "record"):
        raise ValueError(f"by is {by!r}; expected 'day' or 'record'")
    evaluated, is_daily = monitor.evaluations_, by == "day"
    ends = {"start": start, "end": end}
    shown = slice(*(None if at is None else check_stamp(at, evaluated.index, name) for name, at in ends.items()))
    if is_daily:
        table = monitor.days_.loc[shown]
        table = table.reindex(midnights_between(table.index[0], table.index[-1])) if len(table) else table
        index, is_alarm = table["index_max"], table["n_alarms"].fillna(0) > 0
    else:
        index, is_alarm = evaluated.loc[shown, "index"], evaluated.loc[shown, "state"] == "alarm"
    if not len(index):
        raise ValueError(f"there is no {by} between {shown.start} and {shown.stop}; expected a time with records")
    names = ("highest of the day", "day with an alarm") if is_daily else ("record", "record in alarm")
    parts = {name: index[rows].astype(float) for name, rows in zip(names, (~is_alarm, is_alarm), strict=True)}
    first, last = index.index[0], index.index[-1] + pd.Timedelta("1D" if is_daily else "0s")
    events, threshold = monitor.events_, evaluated["threshold"].loc[first:last].astype(float)
    events = events.assign(start=events["start"].clip(lower=first), end=events["end"].fillna(last).clip(upper=last))
    return {
        "index": {name: part for name, part in parts.items() if len(part)},
        "threshold": threshold if len(threshold) else float(monitor.threshold_),
        "events": events[events["start"] <= events["end"]],
        "watch": getattr(monitor, "watch_threshold_", None),
        "label": "damage index",
    }


def marker_style(number: int, n_points: int) -> dict[str, object]:
    """Options of plot for unconnected points: colour, and a marker that tells them apart in greyscale too."""
    marker, colour = MARKERS[number % len(MARKERS)], COLOURS[number % len(COLOURS)]
    size = 5.0 if n_points <= 100 else 3.5 if n_points <= 1000 else 2.0
    style = {"linestyle": "", "marker": marker, "markersize": size, "color": colour, "rasterized": n_points > DENSE}
    return style | {"markeredgewidth": 0.8 if marker in "x+" else 0.0}


def date_axis(ax: Axes, index: pd.Index) -> None:
    """Ticks and label of an axis of time, or of the number of the record."""
    if not isinstance(index, pd.DatetimeIndex):
        ax.set_xlabel(shared.shortened(index.name or "record"))
        return
    dates = shared.drawing("matplotlib.dates")
    locator = dates.AutoDateLocator()
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(dates.ConciseDateFormatter(locator))
    ax.set_xlabel("date")


def on_axis(place: object, index: pd.Index) -> float | np.datetime64:
    """A time in the zone of the index, or a number; on an axis of time, a number is the position of a record."""
    is_number, is_time = isinstance(place, Real), isinstance(index, pd.DatetimeIndex)
    if (is_number and is_time and not 0 <= place < len(index)) or not (is_number or is_time):
        expected = f"a time, or a record's number from 0 to {len(index) - 1}" if is_time else "a number"
        raise ValueError(f"{place!r} is not on the axis; expected {expected}")
    if not is_time:
        return place
    time = index[int(place)] if is_number else pd.Timestamp(place)
    if time.tz is not None and index.tz is not None:
        time = time.tz_convert(index.tz)
    return time.tz_localize(None).to_datetime64()


def hold_outliers(ax: Axes, direction: str = "y", keep: Iterable[float] = (), also: Iterable[Array] = ()) -> None:
    """End an axis ("x" or "y") where the points of its lines end but for those that would make it more than three times
    as long; these are marked at the edge and counted. Values in ``keep`` and those of bands in ``also`` stay in view.
    """
    for mark in [*ax.lines, *ax.texts]:
        if mark.get_gid() == f"beyond {direction}":
            mark.remove()
    lines = [line for line in ax.lines if line.get_transform() == ax.transData]
    columns = [getattr(line, f"get_{direction}data")(orig=False).astype(float) for line in lines]
    middles = [middle_of(values) for values in [*columns, *also] if np.isfinite(values).any()]
    if not middles:
        return
    middle, seen = np.concatenate([*middles, [*keep]]), np.concatenate([*columns, *also, [*keep]])
    low, high = middle.min() - np.ptp(middle), middle.max() + np.ptp(middle)
    beyond = {False: [values < low for values in columns], True: [values > high for values in columns]}
    if not any(rows.any() for sides in beyond.values() for rows in sides):
        return
    seen = seen[(seen >= low) & (seen <= high)]
    margin = 0.05 * np.ptp(seen)
    lowest = seen.min() if seen.min() in keep else seen.min() - margin
    getattr(ax, f"set_{direction}lim")(lowest, seen.max() + margin)
    transform = ax.get_xaxis_transform() if direction == "y" else ax.get_yaxis_transform()
    for is_upper, sides in beyond.items():
        (marker, place), far = EDGES[direction, is_upper], []
        for line, values, rows in zip(lines, columns, sides, strict=True):
            points = np.column_stack(line.get_data(orig=False))[rows]
            points[:, "xy".index(direction)] = float(is_upper)
            style = {"linestyle": "", "marker": marker, "color": line.get_color(), "rasterized": len(points) > DENSE}
            if len(points):
                ax.plot(*points.T, transform=transform, gid=f"beyond {direction}", ms=5, mew=0, **style)
            far += values[rows].tolist()
        if far:
            text = f"{len(far)} beyond, {'up' if is_upper else 'down'} to {max(far) if is_upper else min(far):.4g}"
            _write(ax, text, gid=f"beyond {direction}", **place)


def middle_of(values: Array) -> Array:
    """All values but 2 % at either end, in order; of values that hardly differ otherwise, and of few values, all."""
    known = np.sort(values[np.isfinite(values)])
    n_few = int(np.ceil(0.02 * len(known))) if len(known) >= 10 else 0
    middle = known[n_few : len(known) - n_few]
    return middle if middle[0] < middle[-1] else known


def mark_not_evaluated(ax: Axes, places: dict[str, Array]) -> None:
    """Grey ticks at the bottom where records of each label are not evaluated, and a text that counts them."""
    for x in places.values():
        style = {"linestyle": "", "marker": "|", "color": GREY, "rasterized": len(x) > DENSE, "gid": "not evaluated"}
        if len(x):
            ax.plot(x, np.full(len(x), 0.02), transform=ax.get_xaxis_transform(), ms=7, mew=0.8, **style)
    texts = [
        f"{f'{label}: ' if len(places) > 1 else ''}{len(x)} not evaluated" for label, x in places.items() if len(x)
    ]
    if texts:
        _write(ax, "; ".join(texts), x=0.01, y=0.95, ha="left", va="top", gid="not evaluated")


def _write(ax: Axes, text: str, x: float, y: float, **style: object) -> None:
    """A small text in shares of the axes, on a ground that keeps points off it."""
    box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.0}
    ax.text(x, y, text, transform=ax.transAxes, fontsize="small", color=GREY, bbox=box, **style)


def as_table(
    values: ArrayLike, what: str, prefix: str = "f", *, is_one: bool = False, beside: Sequence[Any] = ()
) -> pd.DataFrame:
    """A frame of floats; the columns of an array are called f1, f2, ..., a single one by what it is. Its rows are those
    of the first frame beside it, if there is any, else numbers from 0."""
    if isinstance(values, pd.Series):
        values = values.to_frame((what if is_one else f"{prefix}1") if values.name is None else values.name)
    real_array(values, what)
    columns = as_columns(values)
    if columns.ndim != 2 or not columns.size or (is_one and columns.shape[1] > 1):
        expected = "one column" if is_one else "one or more records (rows) and columns"
        raise ValueError(f"{what} has shape {np.shape(values)}; expected {expected}")
    if isinstance(values, pd.DataFrame):
        return pd.DataFrame(columns, values.index, values.columns)
    index = next((one.index for one in beside if isinstance(one, pd.DataFrame | pd.Series)), None)
    if index is not None and len(index) != len(columns):
        raise ValueError(f"{what} has {len(columns)} rows and a frame beside it {len(index)}; expected the same number")
    names = [what] if is_one else [f"{prefix}{i + 1}" for i in range(columns.shape[1])]
    return pd.DataFrame(columns, index, names)


def in_time(table: pd.DataFrame) -> tuple[NDArray, NDArray]:
    """Place of each record on the horizontal axis, (n_records,), and the values, in order of time where it is known."""
    values, index = table.to_numpy(), table.index
    if isinstance(index, pd.PeriodIndex):
        index = index.to_timestamp()
    if isinstance(index, pd.DatetimeIndex):
        order = np.argsort(index.to_numpy(), kind="stable")
        return index.tz_localize(None).to_numpy()[order], values[order]
    return (index.to_numpy() if pd.api.types.is_numeric_dtype(index) else np.arange(len(index))), values
