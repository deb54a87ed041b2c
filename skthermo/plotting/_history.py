"""Histories of frequencies or parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, Literal

import pandas as pd
from numpy.typing import ArrayLike

from skthermo.plotting._axes import Axes, date_axis, draw_marks, figure_legend, panel_names, panels, size_in_time
from skthermo.plotting._limits import hold_outliers
from skthermo.plotting._style import line_style, marker_style, shortened, with_unit
from skthermo.plotting._tables import as_tables, in_time, with_breaks


@dataclass(eq=False, repr=False)
class HistoryDisplay:
    """Histories of frequencies or parameters, one panel for each column.

    A few values far from the others do not stretch the axes: triangles at the edge and a number stand for them.

    It is best made by `from_estimator` or `from_predictions`.

    Parameters
    ----------
    histories : dict of str to DataFrame of shape (n_samples, n_columns)
        Tables by label. The rows may differ, the number of columns may not.
    quantity, unit : str
        Label of the vertical axes, and their unit.

    Attributes
    ----------
    axes_ : ndarray of Axes of shape (n_columns,)
        One panel for each column.
    figure_ : Figure
        Their figure.
    lines_ : dict of str to list of Line2D
        Points or lines of each label, panel by panel.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.plotting import HistoryDisplay
    >>> year = make_truss_campaign(random_state=0)
    >>> tables = {"measured": year.frequencies, "without noise": year.clean_frequencies}
    >>> display = HistoryDisplay.from_predictions(tables)
    >>> display.axes_[0].get_ylabel(), sorted(display.lines_)
    ('$f_{1}$ (Hz)', ['measured', 'without noise'])
    >>> plt.close(display.figure_)
    """

    histories: Mapping[str, pd.DataFrame]
    _: KW_ONLY
    quantity: str = ""
    unit: str = "Hz"

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: ArrayLike | None = None,
        y: ArrayLike | None = None,
        *,
        what: Literal["parameters", "frequencies"] = "parameters",
        **options: Any,
    ) -> HistoryDisplay:
        """Draw what a fitted chain estimates from frequencies, and what it predicts from temperatures.

        Parameters
        ----------
        estimator : fitted DataInformedFEM
            The chain.
        X : array-like or DataFrame of shape (n_samples, n_sensors), optional
            Temperatures in degrees Celsius; by default those of ``fit``.
        y : array-like or DataFrame of shape (n_samples, n_modes), optional
            Measured frequencies in Hz; by default those of ``fit``, if X is not given either.
        what : {"parameters", "frequencies"}, default="parameters"
            What is drawn.
        **options : dict
            Options of `plot`.

        Returns
        -------
        HistoryDisplay

        Raises
        ------
        ValueError
            If ``what`` is something else.
        """
        if what not in ("parameters", "frequencies"):
            raise ValueError(f"what is {what!r}; expected 'parameters' or 'frequencies'")
        X, y = estimator.training_records_ if X is None else (X, y)
        if what == "frequencies":
            first, label, predicted = y, "measured", estimator.predict(X)
        else:
            first = None if y is None else estimator.estimate_parameters(y)
            label, predicted = "from frequencies", estimator.predict_parameters(X)
        tables = {} if first is None else {label: first}
        if not isinstance(predicted, pd.DataFrame):
            names = estimator.mode_names_ if what == "frequencies" else estimator.parameter_names_
            tables = {key: pd.DataFrame(table, columns=names) for key, table in tables.items()}
            predicted = pd.DataFrame(predicted, columns=names)
        tables["predicted" if what == "frequencies" else "from temperatures"] = predicted
        if what == "frequencies":
            return cls.from_predictions(tables, **options)
        return cls.from_predictions(tables, **{"unit": "", "quantity": "multiplier", **options})

    @classmethod
    def from_predictions(
        cls, histories: Mapping[str, ArrayLike] | ArrayLike, *, unit: str = "Hz", quantity: str = "", **options: Any
    ) -> HistoryDisplay:
        """Draw tables over time, or over the number of the record.

        Parameters
        ----------
        histories : mapping of str to table, or table of shape (n_samples, n_columns)
            Arrays or frames by label; NaN where a value is missing.
        unit : str, default="Hz"
            Unit of the vertical axes; an empty string for none.
        quantity : str, default=""
            What the columns are, added to their names.
        **options : dict
            Options of `plot`.

        Returns
        -------
        HistoryDisplay

        Raises
        ------
        ValueError
            If the tables are not numbers, or have different numbers of columns.
        """
        return cls(as_tables(histories, "history"), quantity=quantity, unit=unit).plot(**options)

    def plot(
        self,
        ax: Axes = None,
        *,
        titles: Sequence[str] | None = None,
        kind: Literal["auto", "points", "lines"] = "auto",
        marks: Mapping[str, Any] | None = None,
        n_columns: int = 1,
    ) -> HistoryDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes or array of Axes, optional
            One for each column. A new figure by default.
        titles : sequence of str, optional
            Names of the panels; by default those of the columns.
        kind : {"auto", "points", "lines"}, default="auto"
            How records are drawn: "auto" draws the first table as points and the others as lines. Lines break at NaN
            and in long gaps of time.
        marks : mapping of str to time or number, optional
            Vertical lines by their label; on an axis of time, a number is the position of a record of the first table.
        n_columns : int, default=1
            Panels beside each other in a new figure.

        Returns
        -------
        HistoryDisplay
            Itself.

        Raises
        ------
        ValueError
            If ``kind`` is something else, or a mark is not on the axis.
        """
        if kind not in ("auto", "points", "lines"):
            raise ValueError(f"kind is {kind!r}; expected 'auto', 'points' or 'lines'")
        first = next(iter(self.histories.values()))
        names = panel_names(titles, list(first.columns))
        self.axes_ = panels(ax, names, size_in_time(len(names), n_columns), n_columns, share_x=True)
        self.figure_ = self.axes_[0].figure
        self.lines_ = {}
        for number, (label, table) in enumerate(self.histories.items()):
            has_points = kind == "points" or (kind == "auto" and number == 0)
            x, values = in_time(table) if has_points else with_breaks(*in_time(table))
            style = marker_style(number, len(x)) if has_points else line_style(number, number - (kind == "auto"))
            self.lines_[label] = [
                one.plot(x, values[:, column], **style, label=shortened(label))[0]
                for column, one in enumerate(self.axes_)
            ]
        for one, name in zip(self.axes_, names, strict=True):
            one.set_ylabel(with_unit(f"{name}\n{self.quantity}" if self.quantity else name, self.unit))
            hold_outliers(one)
        for one in self.axes_[-n_columns:] if ax is None else self.axes_:
            date_axis(one, first.index)
        draw_marks(self.axes_, marks, first.index)
        if len(self.histories) > 1:
            figure_legend(self.axes_, ax is None)
        return self
