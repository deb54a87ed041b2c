"""Stiffness of groups over years, with bands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING

import numpy as np

from skthermo.plotting._axes import date_axis, size_in_time
from skthermo.plotting._display import Display
from skthermo.plotting._style import BLACK, BLUE, GREY, ORANGE, shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.lines import Line2D

    from skthermo.monitoring import ParameterHistory

LINE = 100  # number of letters of a line of the heading


@dataclass(eq=False, repr=False)
class ParameterHistoryDisplay(Display):
    """Stiffness of each group over years, with its band, and a limit.

    It is best made by `from_history`.

    Parameters
    ----------
    history : ParameterHistory
        With the frame ``table``, whose columns are pairs of a group and "estimate", "lower" or "upper" (relative
        stiffness by day), and perhaps the frame ``rates``, whose column ``drifts`` says which groups drift, and
        ``answer()``, whose first sentence heads a figure of its own.
    groups : sequence of str, optional
        Groups to draw; by default all but those that are not seen.

    Attributes
    ----------
    axes_ : ndarray of Axes of shape (n_groups,)
        One panel for each group.
    figure_ : Figure
        Their figure.
    lines_ : dict of str to Line2D
        Change of each group in percent.
    bands_ : dict of str to PolyCollection
        Its bands.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import pandas as pd
    >>> from types import SimpleNamespace
    >>> from skthermo.plotting import ParameterHistoryDisplay
    >>> table = pd.DataFrame(
    ...     {("deck", "estimate"): [1.0, 0.98], ("deck", "lower"): [1.0, 0.97], ("deck", "upper"): [1.0, 0.99]},
    ...     pd.date_range("2025", periods=2, freq="YS"))
    >>> display = ParameterHistoryDisplay.from_history(SimpleNamespace(table=table), limit=-0.1)
    >>> display.axes_[0].get_ylabel()
    'deck (%)'
    >>> plt.close(display.figure_)
    """

    history: ParameterHistory
    _: KW_ONLY
    groups: Sequence[str] | None = None

    @classmethod
    def from_history(
        cls, history: ParameterHistory, *, groups: Sequence[str] | None = None, **options: object
    ) -> ParameterHistoryDisplay:
        """Draw what `~skthermo.monitoring.track_parameters` found.

        Parameters
        ----------
        history : ParameterHistory
            As in `ParameterHistoryDisplay`.
        groups : sequence of str, optional
            Groups to draw.
        **options : dict
            Options of `plot`.

        Returns
        -------
        ParameterHistoryDisplay

        Raises
        ------
        ValueError
            If the table or a group is missing.
        """
        columns = getattr(getattr(history, "table", None), "columns", None)
        if columns is None or getattr(columns, "nlevels", 1) != 2:
            raise ValueError(
                f"history is a {type(history).__name__} without a table of groups; expected a ParameterHistory"
            )
        known = list(dict.fromkeys(columns.get_level_values(0)))
        unknown = [group for group in groups or () if group not in known]
        if unknown or (groups is not None and not len(groups)):
            raise ValueError(f"groups is {groups!r}; expected some of {known}")
        return cls(history, groups=groups).plot(**options)

    def plot(
        self, ax: Axes | np.ndarray | None = None, *, limit: float | None = None, n_columns: int = 1
    ) -> ParameterHistoryDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes or array of Axes, optional
            One for each group. A new figure by default.
        limit : float, optional
            Relative change that is drawn as a line: -0.1 for a loss of 10 %.
        n_columns : int, default=1
            Panels beside each other in a new figure.

        Returns
        -------
        ParameterHistoryDisplay
            Itself.
        """
        table, rates = self.history.table, getattr(self.history, "rates", None)
        drifts = {} if rates is None else rates["drifts"].to_dict()
        names = list(dict.fromkeys(table.columns.get_level_values(0)))
        shown = [name for name in names if drifts.get(name) != "not seen"] if self.groups is None else list(self.groups)
        shown = shown or names
        self._take_axes(ax, shown, size_in_time(len(shown), n_columns), n_columns=n_columns, share_x=True)
        self.lines_: dict[str, Line2D] = {}
        self.bands_: dict[str, PolyCollection] = {}
        for one, name in zip(self.axes_, shown, strict=True):
            change = 100 * (table[name] - 1)
            colour = ORANGE if drifts.get(name, "") in ("yes", "perhaps") else BLUE
            self.lines_[name] = one.plot(table.index, change["estimate"], color=colour)[0]
            lower, upper = (change[side].to_numpy(dtype=float) for side in ("lower", "upper"))
            self.bands_[name] = one.fill_between(table.index, lower, upper, color=colour, alpha=0.25, linewidth=0)
            one.axhline(0, color=BLACK, linewidth=0.8)
            if limit is not None:
                one.axhline(100 * limit, color=GREY, linestyle="--", linewidth=1.2)
            said = drifts.get(name, "")
            one.set_title(f"drifts: {said}" if said else "", fontsize="small", loc="right")
            one.set_ylabel(f"{shortened(name)} (%)")
            one.set_xlim(table.index[0], table.index[-1])
        for one in self.axes_[-n_columns:] if ax is None else self.axes_:
            date_axis(one, table.index)
        if ax is None:
            self._head(self.history, LINE)
        return self
