"""Identified damage: how severe, what it explains, and what cannot be told apart."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import Any

import numpy as np

from skthermo.plotting._axes import Axes, draw_heat_map, panels
from skthermo.plotting._style import BLACK, BLUE, GREY, ORANGE, label_of, shortened

NEEDED = {
    "table": {"severity", "standard_error", "significant"},
    "similarity": set(),
    "shifts": {"measured", "explained", "standard_error"},
}
N_ERRORS = 2  # standard errors on either side of an estimate
LINE = 120  # number of letters of a line of the heading
SHORT_NAME = 8  # number of letters up to which names of modes fit beside each other


@dataclass(eq=False, repr=False)
class IdentifiedDamageDisplay:
    """Severity of each group, shift of each mode beside what the damage explains, and collinearity of the groups.

    It is best made by `from_predictions`.

    Parameters
    ----------
    identified : IdentifiedDamage
        With the frames ``table`` (groups in rows; severity, standard_error, significant), ``shifts`` (modes in rows;
        measured, explained, standard_error; relative) and ``similarity`` (cosine between groups), and perhaps the names
        ``unseen`` of groups that are left out. The first sentence of its ``answer()``, if it has one, heads a figure of
        its own.

    Attributes
    ----------
    axes_ : ndarray of Axes of shape (3,)
        Severities, shifts, collinearity.
    figure_ : Figure
        Their figure.
    severities_, shifts_ : ErrorbarContainer
        Severities and measured shifts in percent, with two standard errors. A severity that is not determined is a
        dotted line from end to end.
    explained_ : Line2D
        Explained shifts in percent.
    image_ : AxesImage
        Cosines.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import pandas as pd
    >>> from types import SimpleNamespace
    >>> from skthermo.plotting import IdentifiedDamageDisplay
    >>> groups = ["deck", "piers"]
    >>> identified = SimpleNamespace(
    ...     table=pd.DataFrame(
    ...         {"severity": [0.01, 0.2], "standard_error": [0.02, 0.03], "significant": [False, True]}, groups),
    ...     similarity=pd.DataFrame([[1.0, 0.4], [0.4, 1.0]], groups, groups),
    ...     shifts=pd.DataFrame(
    ...         {"measured": [-0.01, -0.05], "explained": [-0.012, -0.049], "standard_error": [0.002, 0.003]},
    ...         ["f1", "f2"]))
    >>> display = IdentifiedDamageDisplay.from_predictions(identified)
    >>> [ax.get_title() for ax in display.axes_]
    ['severity ± 2 standard errors', 'shift of frequencies', 'cosine between groups']
    >>> plt.close(display.figure_)
    """

    identified: Any

    @classmethod
    def from_predictions(cls, identified: Any, **options: Any) -> IdentifiedDamageDisplay:
        """Draw identified damage.

        Parameters
        ----------
        identified : IdentifiedDamage
            As in `IdentifiedDamageDisplay`.
        **options : dict
            Options of `plot`.

        Returns
        -------
        IdentifiedDamageDisplay

        Raises
        ------
        ValueError
            If a frame or a column is missing.
        """
        for name, columns in NEEDED.items():
            frame = getattr(identified, name, None)
            missing = columns - set(getattr(frame, "columns", ()))
            if frame is None or missing:
                raise ValueError(
                    f"identified is a {type(identified).__name__} whose {name!r} is missing or lacks "
                    f"{sorted(missing)}; expected an IdentifiedDamage"
                )
        return cls(identified).plot(**options)

    def plot(self, ax: Axes = None) -> IdentifiedDamageDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : array of matplotlib's Axes of shape (3,), optional
            A new figure by default.

        Returns
        -------
        IdentifiedDamageDisplay
            Itself.
        """
        self.axes_ = panels(ax, ["severity", "shifts", "similarity"], (4.3, 3.6), 3)
        self.figure_ = self.axes_[0].figure
        self.severities_ = self._draw_severities(self.axes_[0])
        self._draw_shifts(self.axes_[1])
        similarity = self.identified.similarity
        self.image_ = draw_heat_map(self.axes_[2], similarity, 1.0)
        self.axes_[2].set_title("cosine between groups")
        if len(similarity) > 3:
            lean(self.axes_[2])
        answer = getattr(self.identified, "answer", None)
        if ax is None and answer is not None:
            self.figure_.suptitle(textwrap.fill(answer()[0], LINE), fontsize="medium")
        self.figure_.colorbar(self.image_, ax=self.axes_[2], shrink=0.8)
        return self

    def _draw_severities(self, ax: Axes) -> Any:
        table = self.identified.table
        places = np.arange(len(table))
        severity = 100 * table["severity"].to_numpy(dtype=float)
        errors = N_ERRORS * 100 * table["standard_error"].to_numpy(dtype=float)
        known = np.isfinite(errors)
        style = {"linestyle": "", "color": GREY, "capsize": 3, "elinewidth": 1.2}
        drawn = ax.errorbar(severity[known], places[known], xerr=errors[known], **style)
        significant = table["significant"].to_numpy(dtype=bool)
        for is_found, face, label in ((True, ORANGE, "significant"), (False, "white", "not significant")):
            rows = (significant == is_found) & known
            style = {"marker": "o", "color": ORANGE, "markerfacecolor": face, "markersize": 7, "label": label}
            if rows.any():
                ax.plot(severity[rows], places[rows], linestyle="", **style)
        for place in places[~known]:  # it may be anything
            ax.axhline(place, color=GREY, linestyle=":", linewidth=1.2)
        ax.axvline(0, color=BLACK, linewidth=0.8)
        names = [
            shortened(name) + ("" if one else "\n(not determined)")
            for name, one in zip(table.index, known, strict=True)
        ]
        ax.set_yticks(places, names)
        ax.set(title=f"severity ± {N_ERRORS} standard errors", xlabel="severity (%)", ylim=(len(table) - 0.5, -0.5))
        ax.legend(framealpha=0.8, edgecolor="none", fontsize="small")
        unseen = list(getattr(self.identified, "unseen", ()))
        if unseen:
            text = f"left out, as these modes do not show them: {', '.join(map(shortened, unseen))}"
            ax.text(0.5, -0.2, text, transform=ax.transAxes, ha="center", va="top", fontsize="small", wrap=True)
        return drawn

    def _draw_shifts(self, ax: Axes) -> None:
        shifts = 100 * self.identified.shifts[["measured", "explained", "standard_error"]].astype(float)
        places = np.arange(len(shifts))
        errors = N_ERRORS * shifts["standard_error"].to_numpy()
        style = {"linestyle": "", "marker": "o", "color": BLUE, "capsize": 3, "label": "measured"}
        known = np.where(np.isfinite(errors), errors, 0)
        self.shifts_ = ax.errorbar(places - 0.1, shifts["measured"].to_numpy(), yerr=known, **style)
        style = {"linestyle": "", "marker": "D", "color": ORANGE, "label": "explained by the damage"}
        self.explained_ = ax.plot(places + 0.1, shifts["explained"].to_numpy(), **style)[0]
        ax.axhline(0, color=BLACK, linewidth=0.8)
        ax.set_xticks(places, [label_of(name) for name in shifts.index])
        if max(len(str(name)) for name in shifts.index) > SHORT_NAME:
            lean(ax)
        ax.set(title="shift of frequencies", ylabel="shift (%)", xlim=(-0.5, len(shifts) - 0.5))
        ax.legend(frameon=False, fontsize="small")


def lean(ax: Axes) -> None:
    """Turn the labels of the horizontal axis so that long ones end below their ticks."""
    for label in ax.get_xticklabels():
        label.set(rotation=45, ha="right", rotation_mode="anchor")
