"""Errors, offsets and doubts of a fitted chain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from skthermo.plotting._axes import LETTER, Axes, panels
from skthermo.plotting._style import BLACK, BLUE, GREY, LIGHT, ORANGE, label_of
from skthermo.surrogate import FitReport

WIDTH, LETTERS = 4.6, 8
"""Inches of a panel whose bars have names of up to so many letters; longer names make it wider."""


@dataclass(eq=False, repr=False)
class FitReportDisplay:
    """Errors and offsets of each mode, and what is doubtful about each parameter, as the report of a fit has them.

    It is best made by `from_estimator`.

    Parameters
    ----------
    report : FitReport
        The report.

    Attributes
    ----------
    axes_ : ndarray of Axes of shape (4,)
        Errors and offsets by mode, smallest deviations and rows outside the bounds by parameter.
    figure_ : Figure
        Their figure.
    bars_ : dict of str to BarContainer
        By ``"errors"``, ``"errors of the mean"``, ``"offsets"``, ``"deviations"`` and ``"outside"``, all in percent.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.plotting import FitReportDisplay
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year = make_truss_campaign(random_state=0)
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> display = FitReportDisplay.from_estimator(fem)
    >>> [ax.get_xlabel() for ax in display.axes_]
    ['MAPE (%)', 'measured against model (%)', 'standard deviation of the estimate (%)', 'rows (%)']
    >>> plt.close(display.figure_)
    """

    report: FitReport

    @classmethod
    def from_estimator(cls, estimator: Any, **options: Any) -> FitReportDisplay:
        """Draw the report of a fitted chain.

        Parameters
        ----------
        estimator : fitted DataInformedFEM
            With the attribute ``report_``.
        **options : dict
            Options of `plot`.

        Returns
        -------
        FitReportDisplay

        Raises
        ------
        ValueError
            If the estimator has no report.
        """
        if not isinstance(getattr(estimator, "report_", None), FitReport):
            raise ValueError(f"{estimator!r:.200} has no report_; expected a fitted DataInformedFEM")
        return cls(estimator.report_).plot(**options)

    def plot(self, ax: Axes = None) -> FitReportDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : array of matplotlib's Axes of shape (4,), optional
            A new figure by default.

        Returns
        -------
        FitReportDisplay
            Itself.
        """
        report = self.report
        longest = max(len(report.offsets), len(report.deviations))
        n_letters = max(len(label_of(name)) for name in (*report.offsets.index, *report.deviations.index))
        size = (WIDTH + LETTER * max(n_letters - LETTERS, 0), 1.2 + 0.32 * longest)
        self.axes_ = panels(ax, ["errors", "offsets", "deviations", "outside"], size, 2)
        self.figure_ = self.axes_[0].figure
        errors, offsets, deviations, outside = self.axes_
        styles = {
            "errors": (report.errors["MAPE"], {"color": ORANGE, "label": "chain"}),
            "errors of the mean": (
                report.errors["MAPE of the mean"],
                {"color": LIGHT, "hatch": "///", "label": "mean"},
            ),
        }
        self.bars_ = {
            name: draw_bars(errors, values, shift, 0.4, **style)
            for shift, (name, (values, style)) in zip((-0.2, 0.2), styles.items(), strict=True)
        }
        errors.margins(x=0.6)
        errors.legend(frameon=False, fontsize="small", loc="center right")
        errors.set(title="error in the training records", xlabel="MAPE (%)")
        self.bars_["offsets"] = draw_bars(offsets, report.offsets, color=BLUE)
        offsets.axvline(0, color=BLACK, linewidth=0.8)
        offsets.set(title="offset of the mean frequencies", xlabel="measured against model (%)")
        self.bars_["deviations"] = draw_bars(deviations, 100 * report.deviations, color=GREY)
        deviations.set(title="smallest possible, from one record", xlabel="standard deviation of the estimate (%)")
        self.bars_["outside"] = draw_bars(outside, 100 * report.outside, color=GREY)
        bounds = "without bounds" if report.n_outside is None else f"{report.n_outside} of {report.n_rows} rows"
        outside.set(title=f"outside the bounds: {bounds}", xlabel="rows (%)")
        if ax is None:
            self.figure_.suptitle(f"{report.n_trained} of {report.n_rows} rows trained the temperature mapper")
        return self


def draw_bars(ax: Axes, values: pd.Series, shift: float = 0.0, height: float = 0.7, **style: Any) -> Any:
    """Horizontal bars with their numbers; an infinite value has the length 0 and says that it is not determined."""
    numbers = values.to_numpy(dtype=float)
    known = np.isfinite(numbers)
    places = np.arange(len(numbers))
    bars = ax.barh(places + shift, np.where(known, numbers, 0.0), height=height, **style)
    labels = [f"{number:.2f}" if one else "not determined" for number, one in zip(numbers, known, strict=True)]
    ax.bar_label(bars, labels, padding=2, fontsize="x-small")
    ax.set_yticks(places, [label_of(name) for name in values.index])
    ax.set_ylim(len(numbers) - 0.4, -0.6)
    ax.margins(x=0.15)
    return bars
