"""Identified damage: explanations of the shifts, how probable that is, and how severe."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from skthermo._core.text import chance_text
from skthermo.plotting._display import BLACK, BLUE, GREY, LIGHT, ORANGE, Display, drawing, label_of, plain, shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.container import BarContainer, ErrorbarContainer

    from skthermo.studies import IdentifiedDamage

N_ERRORS = 2  # standard errors on either side of a measured shift
LINE = 120  # number of letters of a line of the heading
LABEL = 46  # number of letters of a line above a bar
MOST_BARS = 5  # largest number of explanations that have a bar of their own
SHORT_NAME = 8  # number of letters up to which names of modes fit beside each other
ROOM = 0.18  # share of the axis of shifts that is left free for the legend


@dataclass(eq=False, repr=False)
class IdentifiedDamageDisplay(Display):
    """Explanations with their probabilities, severity of each group, and shift of each mode.

    It is best made by `from_predictions`.

    Parameters
    ----------
    identified : IdentifiedDamage
        With the frames ``explanations`` (in rows, the most probable first; probability, text), ``table`` (causes in
        rows; probability, severity, ci_low, ci_high, and perhaps highest_if_damaged) and ``shifts`` (modes in rows;
        measured, explained, standard_error; relative), and perhaps the names ``unobservable`` of causes that the modes
        do not show. The first sentence of its ``answer()``, if it has one, heads a figure of its own.

    Attributes
    ----------
    axes_, ax_, figure_ : array of matplotlib's Axes, the first of them, and Figure
        Where it is drawn.
    bars_ : BarContainer
        Probabilities of the explanations in percent; those beyond the fifth, and those that are not listed, share the
        last bar.
    severities_ : ErrorbarContainer
        Severities in percent, averaged over all explanations, with their 90 % bands; a pale bar reaches to the severity
        that a damaged group has not exceeded with a probability of 95 %. A group of which these modes tell nothing is a
        dotted line from end to end.
    shifts_ : ErrorbarContainer
        Measured shifts in percent, with two standard errors.
    explained_ : Line2D
        Explained shifts in percent.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import pandas as pd
    >>> from types import SimpleNamespace
    >>> from skthermo.plotting import IdentifiedDamageDisplay
    >>> identified = SimpleNamespace(
    ...     explanations=pd.DataFrame({"probability": [0.8, 0.2], "text": ["piers 20 %", "deck 4 %, piers 12 %"]}),
    ...     table=pd.DataFrame(
    ...         {"probability": [0.2, 1.0], "severity": [0.01, 0.18], "ci_low": [0, 0.1], "ci_high": [0.04, 0.22]},
    ...         ["deck", "piers"]),
    ...     shifts=pd.DataFrame(
    ...         {"measured": [-0.01, -0.05], "explained": [-0.012, -0.049], "standard_error": [0.002, 0.003]},
    ...         ["f1", "f2"]))
    >>> display = IdentifiedDamageDisplay.from_predictions(identified)
    >>> [ax.get_title() for ax in display.axes_]
    ['explanations of the shifts', 'mean severity', 'shift of frequencies']
    >>> plt.close(display.figure_)
    """

    identified: IdentifiedDamage

    @classmethod
    def from_predictions(cls, identified: IdentifiedDamage, **options: object) -> IdentifiedDamageDisplay:
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
            If a frame is missing.
        """
        cls._check_has(identified, ("explanations", "table", "shifts"), "identified", "an IdentifiedDamage")
        return cls(identified).plot(**options)

    def plot(self, ax: np.ndarray | None = None) -> IdentifiedDamageDisplay:
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
        has_long_labels = self.identified.explanations["text"][:MOST_BARS].astype(str).str.len().max() > LABEL
        height = max(4.9 if has_long_labels else 3.8, 1.4 + 0.3 * len(self.identified.table))
        names = ["explanations", "severities", "shifts"]
        explanations, severities, shifts = self._take_axes(ax, names, (4.6, height), n_columns=3)
        self.bars_ = self._draw_explanations(explanations)
        self.severities_ = self._draw_severities(severities)
        self._draw_shifts(shifts)
        if ax is None and hasattr(self.identified, "answer"):
            head = textwrap.fill(self.identified.answer()[0], LINE)
            self.figure_.suptitle(plain(head), fontsize="medium")
        return self

    def _draw_explanations(self, ax: Axes) -> BarContainer:
        """Bars with the causes above and the probability behind them."""
        probabilities = 100 * self.identified.explanations.set_index("text")["probability"].astype(float)
        shown = probabilities.iloc[:MOST_BARS]
        if (others := 100 - shown.sum()) >= 0.1:
            shown = pd.concat([shown, pd.Series({"all others": others})])
        places = np.arange(len(shown))
        colours = [ORANGE] + [LIGHT] * (len(shown) - 1)
        bars = ax.barh(places, shown.to_numpy(), height=0.36, color=colours, edgecolor=GREY, linewidth=0.6)
        for place, (label, probability) in enumerate(shown.items()):
            text = "\n".join(textwrap.wrap(str(label), LABEL, max_lines=2, placeholder=" ..."))
            ax.text(0.8, place - 0.22, plain(text), ha="left", va="bottom", fontsize="small")
            ax.text(probability + 1.5, place, chance_text(probability / 100), ha="left", va="center", fontsize="small")
        ax.set_yticks([])
        ax.set(title="explanations of the shifts", xlabel="probability (%)", xlim=(0, 118))
        ax.set_xticks(range(0, 101, 20))
        ax.set_ylim(max(len(shown), 3) - 0.5, -1.0)
        ax.spines[["top", "right"]].set_visible(False)
        return bars

    def _draw_severities(self, ax: Axes) -> ErrorbarContainer:
        """Severities with their bands, darker the more probable a cause is, and this probability at the right."""
        table, unobservable = self.identified.table, set(getattr(self.identified, "unobservable", ()))
        places, is_known = np.arange(len(table)), ~table.index.isin(unobservable)
        severity, lowest, highest = 100 * table[["severity", "ci_low", "ci_high"]].to_numpy(dtype=float).T
        probability, side = table["probability"].to_numpy(dtype=float), ax.get_yaxis_transform()
        if "highest_if_damaged" in table:
            possible = np.where(is_known, 100 * table["highest_if_damaged"].to_numpy(dtype=float), np.nan)
            ax.barh(places, possible, height=0.5, color=LIGHT, alpha=0.5, label="if damaged, up to here (95 %)")
        errors = np.clip([severity - lowest, highest - severity], 0, None)[:, is_known]
        style = {"linestyle": "", "color": GREY, "capsize": 3, "elinewidth": 1.2, "label": "credible interval, 90 %"}
        drawn = ax.errorbar(severity[is_known], places[is_known], xerr=errors, **style)
        shades = drawing("matplotlib.colors").to_rgba_array([(ORANGE, share) for share in probability[is_known]])
        style = {"c": shades, "edgecolors": ORANGE, "s": 50, "zorder": 3}
        ax.scatter(severity[is_known], places[is_known], **style)
        for place, known, share in zip(places, is_known, probability, strict=True):
            if not known:  # it may be anything
                ax.axhline(place, color=GREY, linestyle=":", linewidth=1.2)
                style = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"}
                ax.text(
                    0.5, place, "unobservable", transform=side, ha="center", va="center", fontsize="small", bbox=style
                )
            else:
                ax.text(1.02, place, chance_text(share), transform=side, ha="left", va="center", fontsize="small")
        ax.text(1.02, 1.0, "probability", transform=ax.transAxes, ha="left", va="bottom", fontsize="small")
        ax.axvline(0, color=BLACK, linewidth=0.8)
        ax.set_yticks(places, [shortened(name) for name in table.index])
        is_damage = "kind" not in table or table["kind"].eq("damage").all()
        label = "loss of stiffness (%)" if is_damage else "loss of stiffness, or change (%)"
        ax.set(title="mean severity", xlabel=label, ylim=(len(table) - 0.5, -0.5))
        right = max(ax.get_xlim()[1], 1.0)
        ax.set_xlim(min(ax.get_xlim()[0], -0.03 * right), right)
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, frameon=False, fontsize="small")
        return drawn

    def _draw_shifts(self, ax: Axes) -> None:
        shifts = 100 * self.identified.shifts[["measured", "explained", "standard_error"]].astype(float)
        places = np.arange(len(shifts))
        errors = N_ERRORS * shifts["standard_error"].to_numpy()
        style = {
            "linestyle": "",
            "marker": "o",
            "color": BLUE,
            "capsize": 3,
            "label": f"measured, ± {N_ERRORS} standard errors",
        }
        known = np.where(np.isfinite(errors), errors, 0)
        self.shifts_ = ax.errorbar(places - 0.1, shifts["measured"].to_numpy(), yerr=known, **style)
        style = {"linestyle": "", "marker": "D", "color": ORANGE, "label": "explained"}
        self.explained_ = ax.plot(places + 0.1, shifts["explained"].to_numpy(), **style)[0]
        ax.axhline(0, color=BLACK, linewidth=0.8)
        is_long = max(len(str(name)) for name in shifts.index) > SHORT_NAME
        leaning = {"rotation": 45, "ha": "right", "rotation_mode": "anchor"} if is_long else {}
        ax.set_xticks(places, [label_of(name) for name in shifts.index], **leaning)
        ax.set(
            title="shift of frequencies", ylabel="shift from the healthy prediction (%)", xlim=(-0.5, len(shifts) - 0.5)
        )
        low, high = ax.get_ylim()
        ax.set_ylim(low - ROOM * (high - low), high)
        ax.legend(loc="lower center", ncols=2, frameon=False, fontsize="small")
