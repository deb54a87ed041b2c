"""Curves of the probability of detection."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING

import numpy as np

from skthermo._core.arrays import Array
from skthermo.plotting._display import (
    COLOURS,
    GREY,
    LINES,
    MARKERS,
    Display,
    check_study,
    panels,
    shortened,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection

    from skthermo.studies import DetectabilityStudy, PODCurve


@dataclass(eq=False, repr=False)
class PODCurveDisplay(Display):
    """Probability of detection over severity: observed shares, fitted curve and its confidence bounds.

    It is best made by `from_estimator` or `from_predictions`. Several curves can be drawn into the same axes; each gets
    its own colour, marker and dashes.

    Parameters
    ----------
    curve : PODCurve
        With the attributes ``severities``, ``n_detected``, ``n_records``, ``a90`` and ``a90_95`` and the method
        ``predict(severity)``, which returns the probability of detection and its lowest and highest values.
    label : str, optional
        Legend of the curve.

    Attributes
    ----------
    axes_, ax_, figure_ : array of matplotlib's Axes, the first of them, and Figure
        Where it is drawn.
    line_ : Line2D
        The curve.
    band_ : PolyCollection
        Its bounds.
    replicates_ : PolyCollection or None
        The band in which the curve of a measured campaign should lie, ``curve.prediction_interval(severity)``, where
        the study has replicates: paler, with dashed edges.
    errorbar_ : ErrorbarContainer
        Observed shares with Wilson's intervals of 95 %, which hold for independent records.
    marks_ : dict of str to artist
        Lines at ``"a90"`` and ``"a90_95"`` where they are finite; or, where the records determine no curve, the
        ``"bracket"`` of the curve, between whose severities a90 lies.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import numpy as np
    >>> from scipy.special import expit
    >>> from skthermo.plotting import PODCurveDisplay
    >>> class Curve:
    ...     severities, n_detected, n_records = np.array([0.1, 0.2, 0.3]), np.array([10, 50, 95]), 100
    ...     a90, a90_95 = 0.28, 0.30
    ...     def predict(self, severity):
    ...         return tuple(expit(25 * (np.asarray(severity) - middle)) for middle in (0.19, 0.21, 0.17))
    >>> display = PODCurveDisplay.from_predictions(Curve(), label="bottom")
    >>> display.ax_.get_xlabel(), display.ax_.get_ylabel(), sorted(display.marks_)
    ('severity: loss of stiffness (%)', 'probability of detection (%)', ['a90', 'a90_95'])
    >>> plt.close(display.figure_)
    """

    curve: PODCurve
    _: KW_ONLY
    label: str | None = None

    @classmethod
    def from_estimator(
        cls,
        study: DetectabilityStudy,
        family: str,
        *,
        detector: str | None = None,
        source: str = "simulated",
        label: str | None = None,
        **options: object,
    ) -> PODCurveDisplay:
        """Draw the curve of one family of scenarios of a study.

        Parameters
        ----------
        study : DetectabilityStudy
            With results.
        family : str
            Of the scenarios.
        detector : str, optional
            Name of the detector, where there are several; draw one after the other into the same axes to compare them.
        source : str, default="simulated"
            "simulated" or "reference".
        label : str, optional
            Legend of the curve; by default the name of the detector, or the family where none is named.
        **options : dict
            Options of `plot`.

        Returns
        -------
        PODCurveDisplay

        Raises
        ------
        NotFittedError
            If the study has no results.
        ValueError
            If there is no such family or detector, several detectors and none is named, or the curve cannot be fitted.

        Warns
        -----
        UserWarning
            If the curve has no finite slope, or lies outside the bounds of some tested severities.
        """
        check_study(study)
        curve = study.pod_curve(family, source, detector=detector)
        return cls.from_predictions(curve, label=label or detector or family, **options)

    @classmethod
    def from_predictions(cls, curve: PODCurve, **options: object) -> PODCurveDisplay:
        """Draw a curve.

        Parameters
        ----------
        curve : PODCurve
            As in `PODCurveDisplay`.
        **options : dict
            ``label`` of the display, and options of `plot`.

        Returns
        -------
        PODCurveDisplay

        Raises
        ------
        ValueError
            If the curve lacks an attribute or method.
        """
        needed = ("severities", "n_detected", "n_records", "a90", "a90_95", "predict")
        if missing := [name for name in needed if not hasattr(curve, name)]:
            raise ValueError(f"curve is a {type(curve).__name__} without {missing}; expected a PODCurve")
        return cls._drawn(curve, **options)

    def plot(self, ax: Axes | None = None, *, marks: bool = True) -> PODCurveDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes, optional
            Those of another curve, for example. A new figure by default.
        marks : bool, default=True
            Whether the severities that are detected with a probability of 90 %, and so with a confidence of 95 %, are
            marked.

        Returns
        -------
        PODCurveDisplay
            Itself.
        """
        self.axes_ = panels(ax, ["one display"], (6.5, 4.2))
        number = sum(line.get_gid() == "POD" for line in self.ax_.lines)
        colour = COLOURS[number % len(COLOURS)]
        marker, dashes = MARKERS[number % len(MARKERS)], LINES[number % len(LINES)]
        severities = np.asarray(self.curve.severities, dtype=float)
        self._draw_shares(severities, colour, marker, number > 0)
        drawn = np.linspace(severities.min(), severities.max(), 200)
        pod, lowest, highest = (100 * np.asarray(values, dtype=float) for values in self.curve.predict(drawn))
        style = {"color": colour, "linestyle": dashes, "label": shortened(self.label or "fitted curve"), "gid": "POD"}
        self.line_ = self.ax_.plot(100 * drawn, pod, **style)[0]
        label = None if number else f"its {100 * getattr(self.curve, 'confidence', 0.95):g} % interval"
        band = {"color": colour, "alpha": 0.15, "linewidth": 0, "label": label}
        self.band_ = self.ax_.fill_between(100 * drawn, lowest, highest, **band)
        self.replicates_ = self._draw_campaigns(drawn, colour)
        self.marks_ = self._draw_marks(colour) if marks else {}
        self.ax_.set(xlabel="severity: loss of stiffness (%)", ylabel="probability of detection (%)", ylim=(-3, 103))
        self.ax_.legend(framealpha=0.8, edgecolor="none", fontsize="small", loc="best")
        return self

    def _draw_campaigns(self, drawn: Array, colour: str) -> PolyCollection | None:
        if not getattr(self.curve, "replicates", ()):
            return None
        low, high = (100 * np.asarray(values) for values in self.curve.prediction_interval(drawn))
        style = {"facecolor": colour, "edgecolor": colour, "alpha": 0.12, "linestyle": "--", "linewidth": 0.8}
        return self.ax_.fill_between(
            100 * drawn, low, high, label="prediction interval of one campaign", zorder=0, **style
        )

    def _draw_shares(self, severities: Array, colour: str, marker: str, is_later: bool) -> None:
        """Observed shares; the legend names those of the first curve."""
        n_detected, n_records, severities = np.broadcast_arrays(
            np.asarray(self.curve.n_detected, dtype=float), np.asarray(self.curve.n_records, dtype=float), severities
        )
        share = n_detected / n_records
        ends = wilson(n_detected, n_records)
        errors = 100 * np.abs(np.array(ends) - share)
        self.errorbar_ = self.ax_.errorbar(
            *(100 * severities, 100 * share, errors),
            linestyle="",
            marker=marker,
            markersize=5,
            color=colour,
            capsize=2,
            elinewidth=0.8,
            label=None if is_later else "tested, with 95 % interval",
        )

    def _draw_marks(self, colour: str) -> dict[str, Artist]:
        """Vertical lines from the axis up to 90 %."""
        drawn = {}
        for name, text, dashes in (("a90", "$a_{90}$", ":"), ("a90_95", "$a_{90/95}$", "-.")):
            value = getattr(self.curve, name)
            if value is not None and np.isfinite(value):
                style = {"color": colour, "linestyle": dashes, "linewidth": 1}
                label = f"{text} = {100 * value:.1f} %"
                drawn[name] = self.ax_.plot([100 * value] * 2, [-3, 90], **style, label=label)[0]
        ends = np.array(getattr(self.curve, "bracket", (np.nan, np.nan)), dtype=float)
        if not drawn and np.isnan(self.curve.a90) and np.isfinite(ends).all():
            low, high = np.sort(100 * ends * np.sign(np.asarray(self.curve.severities)[-1]))
            style = {"facecolor": colour, "alpha": 0.15, "hatch": "//"}
            label = f"$a_{{90}}$ between {low:.1f} and {high:.1f} %"
            drawn["bracket"] = self.ax_.axvspan(low, high, **style, label=label)
        elif not drawn and np.isnan(self.curve.a90) and np.isfinite(ends[0]):
            above = 100 * ends[0] * np.sign(np.asarray(self.curve.severities)[-1])
            drawn["bracket"] = self.ax_.plot([], [], " ", label=f"$a_{{90}}$ beyond {above:.1f} %")[0]
        if drawn and not any(line.get_gid() == "90" for line in self.ax_.lines):
            self.ax_.axhline(90, color=GREY, linewidth=0.6, linestyle=":", gid="90")
        return drawn


def wilson(n_detected: Array, n_records: Array) -> tuple[Array, Array]:
    """Wilson's interval of 95 % of a share of independent records."""
    quantile = 1.959964
    square = quantile**2
    middle = (n_detected + square / 2) / (n_records + square)
    half = quantile / (n_records + square) * np.sqrt(n_detected * (n_records - n_detected) / n_records + square / 4)
    return middle - half, middle + half
