"""Curves of the probability of detection."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from skthermo._core.arrays import Array
from skthermo.plotting import _display as shared
from skthermo.plotting._display import COLOURS, GREY, LINES, MARKERS, Display

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

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
        shared.check_study(study)
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
        self.axes_ = shared.panels(ax, ["one display"], (6.5, 4.2))
        ax, curve = self.ax_, self.curve
        number = sum(line.get_gid() == "POD" for line in ax.lines)
        marker, line, colour = (styles[number % len(styles)] for styles in (MARKERS, LINES, COLOURS))
        severities, n_detected, n_records = np.broadcast_arrays(
            *(np.asarray(values, dtype=float) for values in (curve.severities, curve.n_detected, curve.n_records))
        )
        share = n_detected / n_records
        errors = 100 * np.abs(np.array(wilson(n_detected, n_records)) - share)
        label = None if number else "tested, with 95 % interval"
        style = {"linestyle": "", "markersize": 5, "capsize": 2, "elinewidth": 0.8, "color": colour, "label": label}
        self.errorbar_ = ax.errorbar(100 * severities, 100 * share, errors, marker=marker, **style)
        drawn = np.linspace(severities.min(), severities.max(), 200)
        pod, lowest, highest = (100 * np.asarray(values, dtype=float) for values in curve.predict(drawn))
        style = {"color": colour, "linestyle": line, "label": shared.shortened(self.label or "fitted curve")}
        self.line_ = ax.plot(100 * drawn, pod, gid="POD", **style)[0]
        label = None if number else f"its {100 * getattr(curve, 'confidence', 0.95):g} % interval"
        style = {"color": colour, "alpha": 0.15, "linewidth": 0, "label": label}
        self.band_ = ax.fill_between(100 * drawn, lowest, highest, **style)
        self.replicates_ = None
        if getattr(curve, "replicates", ()):
            ends = (100 * np.asarray(values) for values in curve.prediction_interval(drawn))
            style = {"color": colour, "alpha": 0.12, "linestyle": "--", "linewidth": 0.8, "zorder": 0}
            label = "prediction interval of one campaign"
            self.replicates_ = ax.fill_between(100 * drawn, *ends, label=label, **style)
        self.marks_ = self._draw_marks(colour) if marks else {}
        ax.set(xlabel="severity: loss of stiffness (%)", ylabel="probability of detection (%)", ylim=(-3, 103))
        ax.legend(framealpha=0.8, edgecolor="none", fontsize="small", loc="best")
        return self

    def _draw_marks(self, colour: str) -> dict[str, Artist]:
        """Vertical lines from the axis up to 90 %, or the bracket of a curve that the records do not determine."""
        drawn: dict[str, Any] = {}
        for name, text, dashes in (("a90", "$a_{90}$", ":"), ("a90_95", "$a_{90/95}$", "-.")):
            value = getattr(self.curve, name)
            if value is not None and np.isfinite(value):
                style = {"color": colour, "linestyle": dashes, "linewidth": 1, "label": f"{text} = {100 * value:.1f} %"}
                drawn[name] = self.ax_.plot([100 * value] * 2, [-3, 90], **style)[0]
        sign = np.sign(np.asarray(self.curve.severities)[-1])
        low, high = 100 * sign * np.array(getattr(self.curve, "bracket", (np.nan, np.nan)), dtype=float)
        if drawn:
            self.ax_.axhline(90, color=GREY, linewidth=0.6, linestyle=":")
        elif np.isnan(self.curve.a90) and np.isfinite([low, high]).all():
            label = f"$a_{{90}}$ between {min(low, high):.1f} and {max(low, high):.1f} %"
            drawn["bracket"] = self.ax_.axvspan(low, high, facecolor=colour, alpha=0.15, hatch="//", label=label)
        elif np.isnan(self.curve.a90) and np.isfinite(low):
            drawn["bracket"] = self.ax_.plot([], [], " ", label=f"$a_{{90}}$ beyond {low:.1f} %")[0]
        return drawn


def wilson(n_detected: Array, n_records: Array) -> tuple[Array, Array]:
    """Wilson's interval of 95 % of a share of independent records."""
    quantile = 1.959964
    square = quantile**2
    middle = (n_detected + square / 2) / (n_records + square)
    half = quantile / (n_records + square) * np.sqrt(n_detected * (n_records - n_detected) / n_records + square / 4)
    return middle - half, middle + half
