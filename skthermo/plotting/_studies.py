"""Results of studies: curves of the probability of detection, and bars with errors."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
from scipy.stats import binomtest

import skthermo.plotting._display as shared
from skthermo._core.arrays import check_names
from skthermo._core.text import chance_text, percent, printable, share_text
from skthermo.plotting._display import BLACK, BLUE, COLOURS, GREY, LINES, MARKERS, ORANGE, Display

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.collections import PathCollection
    from matplotlib.container import BarContainer

    from skthermo.studies import DetectabilityStudy, PODCurve

RATES = ["low", "high", "value", "mark"]
BLANK = ("", "", "", "")


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
        """
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
        tests = (binomtest(int(k), int(n)) for k, n in zip(n_detected, n_records, strict=True))
        errors = 100 * np.abs(np.transpose([test.proportion_ci(method="wilson") for test in tests]) - share)
        label = None if number else "tested, with 95 % interval"
        style = {"linestyle": "", "markersize": 5, "capsize": 2, "elinewidth": 0.8, "color": colour, "label": label}
        self.errorbar_ = ax.errorbar(100 * severities, 100 * share, errors, marker=marker, **style)
        drawn = np.linspace(severities.min(), severities.max(), 200)
        pod, lowest, highest = (100 * np.asarray(values, dtype=float) for values in curve.predict(drawn))
        is_fitted, name = np.isfinite(pod).any(), shared.shortened(self.label or "fitted curve")
        style = {"color": colour, "linestyle": line, "label": name if is_fitted else f"{name}: no curve fits"}
        self.line_ = ax.plot(100 * drawn, pod, gid="POD", **style)[0]
        label = None if number or not is_fitted else f"its {100 * getattr(curve, 'confidence', 0.95):g} % interval"
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


@dataclass(frozen=True, eq=False)
class RatesPanel:
    """What one panel shows of each detector: ``rates``, indexed by detector, has the columns ``low``, ``high``,
    ``value``, ``mark`` (in percent) and ``is_open``, whether the mark is not filled; ``notes`` are by detector."""

    title: str
    label: str
    rates: pd.DataFrame
    notes: Mapping[Hashable, str] = field(default_factory=dict)
    axis: Literal["small", "shares", "free"] = "shares"
    limit: float | None = None
    mark_colour: str = BLUE


@dataclass(eq=False, repr=False)
class DetectorsDisplay(Display):
    """Bars with errors, a row for each detector, cause, explanation or mode.

    Of a ranking, three panels show false alarms with their limit; the probability of detection (POD), the mean over all
    damaged scenarios, at the detector's own threshold and, as circles, with thresholds moved to equal false alarms; and
    by how much it is below that of the best. Headings say which detectors are not significantly worse than the best,
    which have a significantly lower POD (grey), which exceed the limit of false alarms (orange), and which failed.

    Of results with measured records, there is a panel for each scenario. A bar is the prediction interval of the rate
    of one measured campaign, the line in it the simulated mean, a dot the measured rate, open outside the interval. A
    title counts the rates within their interval, unless a reference of several repeats is a mean. Detectors are in the
    order of their simulated POD.

    Failures, and shares of records that are not evaluated, are written beside the rates. The axis of false alarms has a
    square-root scale.

    Of identified damage, one panel shows the probability of each cause and one its mean severity with a credible
    interval of 90 % and, as circles, the severity that it does not exceed, if it is there, with a probability of 95 %;
    or a panel shows the probability of each explanation, or the measured shift of each mode with two standard errors
    beside the explained one. Of smallest changes, a bar is as long as the change.

    It is best made by `from_estimator` or `from_predictions`.

    Parameters
    ----------
    panels : dict of str to RatesPanel
        What is drawn, by name.
    places : dict of (heading, detector) to int
        Rows from above; a heading is in the row (heading, None).
    colours : dict of str to str
        Colour of each detector's bounds.
    labels : sequence of str
        Legend of bounds, values, filled marks and open marks.

    Attributes
    ----------
    axes_, ax_, figure_ : array of matplotlib's Axes, the first of them, and Figure
        Where it is drawn.
    bars_ : dict of str to BarContainer
        Bounds or bands, by panel.
    values_ : dict of str to PathCollection
        Rates, by panel.
    marks_ : dict of str to list of PathCollection
        Filled and open marks, by panel.

    See Also
    --------
    skthermo.studies.DetectabilityStudy.labelled_scores : Scores for ROC curves, which scikit-learn draws.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import pandas as pd
    >>> from skthermo.plotting import DetectorsDisplay
    >>> ranking = pd.DataFrame(
    ...     {"false_alarms": [0.01, 0.02], "false_alarms_ci_low": [0.0, 0.01], "false_alarms_ci_high": [0.02, 0.03],
    ...      "within_limit": True, "pod": [0.9, 0.5], "pod_ci_low": [0.8, 0.4], "pod_ci_high": [1.0, 0.6],
    ...      "pod_at_equal_pfa": [0.92, 0.5], "pod_deficit": [0.0, 0.42], "pod_deficit_ci_low": [0.0, 0.3],
    ...      "pod_deficit_ci_high": [0.0, 0.5], "significantly_worse": [False, True]}, index=["whitened", "raw"])
    >>> display = DetectorsDisplay.from_predictions(ranking)
    >>> [text.get_text() for text in display.axes_[0].get_yticklabels()]
    ['not significantly worse', 'whitened', 'significantly lower POD', 'raw']
    >>> plt.close(display.figure_)
    """

    panels: Mapping[str, RatesPanel]
    places: Mapping[tuple[Hashable, Hashable], int]
    _: KW_ONLY
    colours: Mapping[Hashable, str]
    labels: Sequence[str]

    @classmethod
    def from_estimator(
        cls,
        study: DetectabilityStudy,
        what: Literal["ranking", "agreement"] = "ranking",
        *,
        max_false_alarms: float = 0.02,
        source: str = "simulated",
        **options: object,
    ) -> DetectorsDisplay:
        """Draw the ranking of the detectors of a study, or its simulated rates beside measured ones.

        Parameters
        ----------
        study : DetectabilityStudy
            With results.
        what : {"ranking", "agreement"}, default="ranking"
            What is drawn; "agreement" needs a run with a ``reference``.
        max_false_alarms : float, default=0.02
            Limit of the share of false alarms in a ranking.
        source : str, default="simulated"
            Records of a ranking: "simulated" or "reference".
        **options : dict
            Options of `from_predictions` and of `plot`.

        Returns
        -------
        DetectorsDisplay

        Raises
        ------
        NotFittedError
            If the study has no results.
        ValueError
            If ``what`` is something else, or the study has no healthy scenario to rank by, or no measured records.
        """
        if what not in ("ranking", "agreement"):
            raise ValueError(f"what is {what!r}; expected 'ranking' or 'agreement'")
        if what == "agreement":
            return cls.from_predictions(study.results_, **options)
        ranking = study.ranking(max_false_alarms, source)
        return cls.from_predictions(ranking, max_false_alarms=max_false_alarms, **options)

    @classmethod
    def from_predictions(
        cls,
        table: pd.DataFrame,
        *,
        max_false_alarms: float = 0.02,
        scenarios: Sequence[str] | None = None,
        groups: Mapping[str, str] | None = None,
        **options: object,
    ) -> DetectorsDisplay:
        """Draw a ranking, results with measured records, identified damage, or smallest changes.

        Parameters
        ----------
        table : DataFrame or Series
            What `~skthermo.studies.DetectabilityStudy.ranking` or `~skthermo.studies.DetectabilityStudy.run` returned,
            or rows of several results, for example false alarms in one weather and detected damage in another; of
            `~skthermo.studies.identify_damage`, the causes (``table``), the ``shifts``, or explanations with their
            ``probability``; or a Series of the smallest change that is found by group, as
            `~skthermo.detection.DirectionalDetector.minimum_detectable_damage` gives it.
        max_false_alarms : float, default=0.02
            Limit of the share of false alarms with which a ranking was made.
        scenarios : sequence of str, optional
            Scenarios of results that are drawn, in this order. By default all, false alarms first.
        groups : mapping of str to str, optional
            Group of each detector of results, such as "raw" or "compensated", which becomes a heading.
        **options : dict
            Options of `plot`.

        Returns
        -------
        DetectorsDisplay

        Raises
        ------
        ValueError
            If the table lacks columns, or is empty; if no scenario has both simulated and measured records, or a
            detector has two rates of one scenario; if a scenario or a detector of a group is not in the table.
        """
        if isinstance(table, pd.Series) and len(table):
            return cls(**of_changes(table)).plot(**options)
        columns = set(table.columns) if isinstance(table, pd.DataFrame) and len(table) else set()
        bounded = {f"{name}{end}" for name in ("pod", "pod_deficit") for end in ("", "_ci_low", "_ci_high")}
        known = (
            (bounded | {"false_alarms", "within_limit"}, partial(of_ranking, limit=max_false_alarms)),
            ({"detector", "scenario", "rate", "pi_low"}, partial(of_results, scenarios=scenarios, groups=groups or {})),
            ({"probability", "severity", "ci_low", "ci_high"}, of_causes),
            ({"measured", "explained", "standard_error"}, of_shifts),
            ({"probability"}, of_explanations),
        )
        made = next((made for needed, made in known if needed <= columns), None)
        if made is None:
            got = f"has the columns {sorted(map(str, columns))}" if columns else f"is {table!r:.200}"
            raise ValueError(f"table {got}; expected a ranking, results, identified damage, or smallest changes")
        return cls(**made(table)).plot(**options)

    def plot(self, ax: Axes | np.ndarray | None = None) -> DetectorsDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes or array of Axes, optional
            One for each panel. A new figure by default.

        Returns
        -------
        DetectorsDisplay
            Itself.
        """
        n_columns = min(2 if len(self.panels) == 4 else 3, len(self.panels))
        n_letters = max(len(shared.label_of(name)) for _, name in self.places if name is not None)
        width = (3.6 if n_columns > 1 else 5.0) + shared.LETTER * n_letters / n_columns
        size = width, max(0.26 * len(self.places) + 1.5, 2.4)  # inches
        self.axes_ = shared.panels(ax, list(self.panels), size, n_columns)
        self.bars_: dict[str, BarContainer] = {}
        self.values_: dict[str, PathCollection] = {}
        self.marks_: dict[str, list[PathCollection]] = {}
        for one, (name, panel) in zip(self.axes_, self.panels.items(), strict=True):
            one.set_title(panel.title, fontsize="medium")
            one.set_xlabel(panel.label)
            self._name_rows(one)
            self._draw_rates(one, name, panel)
            self._write_notes(one, panel)
        shared.legend(self.axes_, ax is None)
        return self

    def _name_rows(self, ax: Axes) -> None:
        """Names of the detectors left of the panels, headings of groups in bold type, and an empty frame."""
        texts = [shared.label_of(group if name is None else name) for group, name in self.places]
        ax.set_yticks(list(self.places.values()), texts)
        for text, (_, name) in zip(ax.get_yticklabels(), self.places, strict=True):
            text.set_fontweight("bold" if name is None else "normal")
        ax.set_ylim(len(self.places) - 0.4, -0.6)
        cell = ax.get_subplotspec()
        ax.tick_params(axis="y", length=0, labelleft=cell is None or cell.is_first_col())
        ax.spines[["top", "right", "left"]].set_visible(False)
        ax.grid(axis="x", color="#DDDDDD", linewidth=0.6)
        ax.set_axisbelow(True)

    def _draw_rates(self, ax: Axes, name: str, panel: RatesPanel) -> None:
        heights = {detector: height for (_, detector), height in self.places.items() if detector is not None}
        y = panel.rates.index.map(heights).to_numpy(dtype=float)
        low, high, value, mark = panel.rates[RATES].to_numpy(dtype=float).T
        colours = [self.colours[detector] for detector in panel.rates.index]
        if panel.axis == "small":  # a square-root scale spreads small rates
            largest = float(np.clip(1.08 * np.nanmax([*high, *value, *mark, panel.limit or 0.0]), 2.0, 101.0))
            ax.set_xscale("function", functions=(lambda x: np.sign(x) * np.sqrt(np.abs(x)), lambda x: x * np.abs(x)))
            ax.set_xlim(-0.0004 * largest, largest)
            ticks = [tick for tick in (0, 0.5, 2, 5, 10, 20, 40, 60, 80, 100) if tick <= largest]
            ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        elif panel.axis == "shares":
            ax.set_xlim(-1, 101)
        if panel.limit is not None:
            ax.axvline(panel.limit, color=BLACK, linestyle="--", linewidth=1, label="limit of the false-alarm rate")
        bounds, mean, filled, empty = (text or None for text in self.labels)
        label = bounds if np.isfinite(high - low).any() else None
        self.bars_[name] = ax.barh(y, high - low, 0.62, low, color=colours, alpha=0.35, label=label)
        label = mean if np.isfinite(value).any() else None
        style = {"marker": "|", "s": 100, "linewidths": 2, "color": colours, "zorder": 3, "label": label}
        self.values_[name] = ax.scatter(value, y, **style)
        self.marks_[name] = []
        is_open = panel.rates["is_open"].to_numpy(dtype=bool)
        for rows, face, label in ((~is_open, panel.mark_colour, filled), (is_open, "white", empty)):
            rows = rows & np.isfinite(mark)
            style = {"s": 30, "edgecolors": panel.mark_colour, "facecolors": face, "zorder": 4}
            self.marks_[name].append(ax.scatter(mark[rows], y[rows], **style, label=label if rows.any() else None))

    def _write_notes(self, ax: Axes, panel: RatesPanel) -> None:
        """Small texts at that end of their rows where there is more room."""
        left, right = ax.get_xlim()
        for (_, detector), height in self.places.items():
            text = printable(panel.notes.get(detector, ""))
            drawn = panel.rates[RATES].astype(float).T.get(detector, pd.Series(np.inf))
            is_right = bool(right - drawn.max() > drawn.min() - left)
            place = {"x": 0.99 if is_right else 0.01, "ha": "right" if is_right else "left"}
            style = {"fontsize": "x-small", "color": GREY, "va": "center", "clip_on": True, "in_layout": False}
            text = shared.plain(text if len(text) <= 45 else f"{text[:45].rstrip()} ...")
            if text:
                ax.text(y=height, s=text, transform=ax.get_yaxis_transform(), **place, **style)


def of_ranking(ranking: pd.DataFrame, limit: float) -> dict[str, object]:
    """Contents of a display of a ranking."""
    has_bounds = ranking["pod_deficit_ci_low"].notna().any()
    level = "not significantly worse" if has_bounds else "order uncertain: one repeat"
    worse, loud, broken = "significantly lower POD", f"more than {percent(limit)} false alarms", "failed"
    is_tested = np.isfinite(ranking["false_alarms"].astype(float))
    kinds = ranking["significantly_worse"].astype(bool).map({True: worse, False: level})
    kinds = kinds.where(ranking["within_limit"].astype(bool), loud).where(is_tested, broken)
    kinds = kinds.sort_values(key=lambda names: names.map([level, worse, loud, broken].index), kind="stable")
    tested = ranking[is_tested]

    def rates(name: str, mark: object = np.nan) -> pd.DataFrame:
        ends = {side: tested.get(f"{name}_ci_{side}", np.nan) for side in ("low", "high")}
        return in_percent(tested.index, is_open=True, value=tested[name], mark=mark, **ends)

    errors = ranking.loc[~is_tested, "error"].to_dict() if "error" in ranking else {}
    unknown = tested.get("not_evaluated", pd.Series(dtype=float))
    notes = {name: f"{share_text(share)} not evaluated" for name, share in unknown.items() if share > 0}
    false, found = "healthy in alarm (%, square-root scale)", "damaged in alarm (%)"
    panels = {
        "false_alarms": RatesPanel("false alarms", false, rates("false_alarms"), errors, "small", 100 * limit),
        "pod": RatesPanel("probability of detection", found, rates("pod", tested["pod_at_equal_pfa"]), notes),
        "pod_deficit": RatesPanel("POD below that of the best", "percentage points", rates("pod_deficit"), axis="free"),
    }
    colours = {name: {level: BLUE, worse: GREY}.get(kind, ORANGE) for name, kind in kinds.items()}
    labels = ["confidence interval", "at its own threshold", "", f"at equal false alarms ({percent(limit)})"]
    places = places_of(list(ranking.index), kinds.to_dict())
    return {"panels": panels, "places": places, "colours": colours, "labels": labels}


def drawn_by_row(panels: dict[str, RatesPanel], colour: str, labels: Sequence[str]) -> dict[str, object]:
    """Contents of a display without headings: all rows in one colour, in the order of the first panel."""
    names = list(next(iter(panels.values())).rates.index)
    return {"panels": panels, "places": places_of(names, {}), "colours": dict.fromkeys(names, colour), "labels": labels}


def in_percent(index: pd.Index, is_open: bool = False, **columns: object) -> pd.DataFrame:
    """Rates of a panel from shares; columns that are not given are empty."""
    table = pd.DataFrame({name: columns.get(name, np.nan) for name in RATES}, index).astype(float)
    return (100 * table).assign(is_open=is_open)


def of_causes(table: pd.DataFrame) -> dict[str, object]:
    """Contents of a display of the causes of a shift."""
    probability = table["probability"]
    notes = {name: chance_text(share) for name, share in probability.items()}
    is_damage = "kind" not in table or table["kind"].eq("damage").all()
    label = "loss of stiffness (%)" if is_damage else "loss of stiffness, or change (%)"
    columns = {"low": table["ci_low"], "high": table["ci_high"], "value": table["severity"]}
    severity = in_percent(table.index, is_open=True, mark=table.get("highest_if_damaged", np.nan), **columns)
    shown = in_percent(table.index, mark=probability)
    panels = {
        "probability": RatesPanel("probability of a change", "probability (%)", shown, notes, mark_colour=ORANGE),
        "severity": RatesPanel("mean severity", label, severity, axis="free", mark_colour=ORANGE),
    }
    names = ["credible interval, 90 %", "mean", "probability", "not exceeded, if there (95 %)"]
    return drawn_by_row(panels, ORANGE, names)


def of_shifts(table: pd.DataFrame) -> dict[str, object]:
    """Contents of a display of measured and explained shifts."""
    errors = 2 * table["standard_error"].fillna(0)
    ends = {"low": table["measured"] - errors, "high": table["measured"] + errors}
    rates = in_percent(table.index, value=table["measured"], mark=table["explained"], **ends)
    label = "shift from the healthy prediction (%)"
    panels = {"shift": RatesPanel("shift of frequencies", label, rates, axis="free", mark_colour=ORANGE)}
    return drawn_by_row(panels, BLUE, ["± 2 standard errors", "measured", "explained", ""])


def of_explanations(table: pd.DataFrame) -> dict[str, object]:
    """Contents of a display of the most probable explanations; the last row has the sum of the others."""
    probability = table["probability"].set_axis(table.get("text", table.index))
    shown = probability.iloc[:5]
    if (others := 1 - shown.sum()) >= 0.001:
        shown = pd.concat([shown, pd.Series({"all others": others})])
    notes = {name: chance_text(share) for name, share in shown.items()}
    rates = in_percent(shown.index, low=0.0, high=shown)
    panels = {"probability": RatesPanel("explanations of the shifts", "probability (%)", rates, notes)}
    return drawn_by_row(panels, ORANGE, BLANK)


def of_changes(changes: pd.Series) -> dict[str, object]:
    """Contents of a display of the smallest changes that are found."""
    known = changes.astype(float).where(np.isfinite(changes.astype(float)))
    notes = dict.fromkeys(changes.index[known.isna()], "not found")
    rates = in_percent(changes.index, low=0.0, high=known, value=known)
    panels = {"smallest": RatesPanel("smallest change found", "loss of stiffness (%)", rates, notes, "free")}
    return drawn_by_row(panels, BLUE, BLANK)


def of_results(results: pd.DataFrame, scenarios: Sequence[str] | None, groups: Mapping[str, str]) -> dict[str, object]:
    """Contents of a display of measured rates beside simulated ones."""
    failed = results[results["scenario"].isna()].set_index("detector")
    errors = {name: f"failed: {text}" for name, text in failed.get("error", pd.Series("", failed.index)).items()}
    table = both_rates(results[results["scenario"].notna()])
    measures = table.groupby("scenario", sort=False)["measure"].first()
    known = measures.sort_values(key=lambda measure: measure != "PFA", kind="stable").index
    names = check_names(known if scenarios is None else scenarios, "scenarios", known)
    rows = table[table["scenario"].isin(names)]
    rows = rows[rows["measure"] == "POD"] if (rows["measure"] == "POD").any() else rows
    found = rows.groupby("detector", sort=False)["value"].mean().sort_values(ascending=False, kind="stable")
    order = list(dict.fromkeys([*found.index, *table["detector"], *errors]))
    panels = {}
    for number, name in enumerate(names):
        rates = table[table["scenario"] == name].set_index("detector")
        lacking = [one for one in order if one not in rates.index and (number == 0 or one in set(table["detector"]))]
        notes = rates["note"].to_dict() | {one: errors.get(one, "no measured records") for one in lacking}
        is_healthy, inside = measures[name] == "PFA", rates["inside"].dropna()
        title = f"{'false alarms' if is_healthy else 'POD'}: {shared.shortened(name)}"
        title += f"\n{inside.sum():.0f} of {len(inside)} within the prediction interval" if len(inside) else ""
        is_open = (rates["mark"] < rates["low"]) | (rates["mark"] > rates["high"])
        shown = in_percent(rates.index, is_open=is_open, **rates[RATES])
        label = f"records in alarm (%{', square-root scale' if is_healthy else ''})"
        panels[name] = RatesPanel(title, label, shown, notes, "small" if is_healthy else "shares")
    labels = ["prediction interval of one campaign", "simulated mean", "measured", "measured, outside the interval"]
    colours = dict.fromkeys(order, ORANGE)
    return {"panels": panels, "places": places_of(order, groups), "colours": colours, "labels": labels}


def both_rates(results: pd.DataFrame) -> pd.DataFrame:
    """Simulated rates with their bands (value, low, high) and measured ones (mark), of scenarios that have both."""
    keys = ["detector", "scenario"]
    if (twice := results.duplicated([*keys, "source"])).any():
        row = results[twice].iloc[0]
        raise ValueError(
            f"detector {row['detector']!r} has several rates of scenario {row['scenario']!r}; expected one: of each "
            "study, keep the scenarios that are to be compared"
        )
    n_unknown = results.get("n_not_evaluated", pd.Series(0, results.index))
    results = results.assign(unknown=n_unknown / (results.get("n_records", 0) + n_unknown))
    simulated, measured = (results[results["source"] == source] for source in ("simulated", "reference"))
    measured = measured.reindex(columns=[*keys, "rate", "unknown", "n_repeats"])
    simulated = simulated[simulated["scenario"].isin(measured["scenario"])].drop(columns="n_repeats", errors="ignore")
    if not len(simulated):
        known = results["scenario"].unique().tolist()
        raise ValueError(f"no scenario of {known} has both simulated and measured records; expected a run with both")
    table = simulated.rename(columns={"rate": "value", "pi_low": "low", "pi_high": "high"})
    table = table.merge(measured.rename(columns={"rate": "mark"}), "left", on=keys, suffixes=("", "_measured"))
    is_single = table[["low", "high", "mark"]].notna().all(axis=1) & (table["n_repeats"].fillna(1) == 1)
    inside = table["mark"].between(table["low"], table["high"]).astype(float).where(is_single)
    shares = {"unknown_measured": "", "unknown": " of simulated"}
    notes = table[list(shares)].apply(
        lambda row: ", ".join(
            f"{share_text(row[name])}{of} not evaluated" for name, of in shares.items() if row[name] > 0
        ),
        axis=1,
    )
    return table.assign(inside=inside, note=notes)


def places_of(names: Sequence[Hashable], groups: Mapping[Hashable, Hashable]) -> dict[tuple[Hashable, Hashable], int]:
    """Height of each row from above by group and detector; the row (group, None) is the heading of a group.

    Groups come in the order of their names in the mapping, detectors without a group before them.
    """
    unknown = [name for name in groups if name not in names]
    if unknown:
        raise ValueError(f"groups names the detectors {unknown}; expected some of {list(names)}")
    rows: list[tuple[Hashable, Hashable]] = [(None, name) for name in names if name not in groups]
    for group in dict.fromkeys(groups.values()):
        rows += [(group, None), *((group, name) for name in names if groups.get(name) == group)]
    return {row: height for height, row in enumerate(rows)}
