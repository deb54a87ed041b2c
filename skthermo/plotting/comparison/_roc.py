"""Found damage over false alarms, for all thresholds of several detectors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.metrics import auc, roc_curve

from skthermo._arrays import Array
from skthermo._formatting import share_text
from skthermo._times import row_times, time_of
from skthermo.plotting._axes import Axes, one_axes
from skthermo.plotting._style import COLOURS, GREY, LINES, MARKERS, label_of
from skthermo.plotting._tables import check_study, names_from
from skthermo.plotting.comparison._rows import in_percent, small_rates

MOST_INSIDE = 6  # number of curves up to which their legend stands within the axes


@dataclass(eq=False, repr=False)
class ROCDisplay:
    """Receiver operating characteristic (ROC): found damage over false alarms, for all thresholds of each detector.

    A mark shows the detector's own threshold. The legend gives the area under each curve (AUC), from 0.5 of chance to
    1, and the share of records that are not judged, which are not in the curves. The axis of false alarms is even in
    their square root, so that small ones are told apart.

    It is best made by `from_estimator` or `from_predictions`.

    Parameters
    ----------
    decisions : dict of str to (ndarray, ndarray)
        By detector, the decision function for healthy and for damaged records: negative is an alarm at the detector's
        own threshold, NaN is not judged.

    Attributes
    ----------
    ax_, figure_ : matplotlib's Axes and Figure
        Where it is drawn.
    lines_ : dict of str to Line2D
        Curves by detector, the one with the largest area first.
    thresholds_ : dict of str to Line2D
        Marks at the detectors' own thresholds.
    auc_ : dict of str to float
        Areas under the curves.

    See Also
    --------
    RankingDisplay : Rates at the detectors' own thresholds and at equal false alarms, with bounds.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from skthermo.plotting import ROCDisplay
    >>> y = [1, 1, 1, -1, -1, -1]  # healthy, damaged
    >>> display = ROCDisplay.from_predictions(y, {"good": [2, 1, 3, -1, -2, -1], "poor": [1, -1, 2, 1.5, -2, 3]})
    >>> {name: round(area, 2) for name, area in display.auc_.items()}
    {'good': 1.0, 'poor': 0.44}
    >>> plt.close(display.figure_)
    """

    decisions: Mapping[str, tuple[Array, Array]]

    @classmethod
    def from_estimator(
        cls,
        study: Any,
        *,
        detectors: Sequence[str] | None = None,
        scenarios: Sequence[str] | None = None,
        source: str = "data-informed",
        **options: Any,
    ) -> ROCDisplay:
        """Draw the curves of the detectors of a study.

        Parameters
        ----------
        study : DetectabilityStudy
            With results, and a healthy scenario.
        detectors : sequence of str, optional
            Those that are drawn; by default all that did not fail.
        scenarios : sequence of str, optional
            Damaged states whose records are put together, from the onset of damage on; by default all.
        source : str, default="data-informed"
            Records of the curves: "data-informed" (simulated) or "reference".
        **options : dict
            Options of `plot`.

        Returns
        -------
        ROCDisplay

        Raises
        ------
        NotFittedError
            If the study has no results.
        ValueError
            If a detector or scenario is not in the study, or there are no healthy or no damaged records.
        """
        check_study(study)
        rows = study.results_[study.results_["source"] == source]
        chosen = names_from(detectors, rows["detector"].unique(), "detectors")
        damaged = names_from(scenarios, rows.loc[rows["measure"] == "POD", "scenario"].unique(), "scenarios")
        healthy = rows.loc[rows["measure"] == "PFA", "scenario"].unique()
        by_name = {scenario.name: scenario for scenario in study.scenarios_}

        def judged(detector: str, names: Iterable[str]) -> Array:
            keys = [(detector, name, source) for name in names if (detector, name, source) in study.decisions_]
            parts = [study.decisions_[key][:, since(study.indices_[key], by_name[key[1]].onset)] for key in keys]
            return np.concatenate([part.ravel() for part in parts] or [np.empty(0)])

        return cls({name: (judged(name, healthy), judged(name, damaged)) for name in chosen}).plot(**options)

    @classmethod
    def from_predictions(cls, y: ArrayLike, decisions: Mapping[str, ArrayLike], **options: Any) -> ROCDisplay:
        """Draw the curves of decision functions.

        Parameters
        ----------
        y : array-like of shape (n_records,)
            1 for healthy records, -1 for damaged ones.
        decisions : mapping of str to array-like of shape (n_records,)
            Decision function of each detector for these records: negative is an alarm, and NaN is not judged.
        **options : dict
            Options of `plot`.

        Returns
        -------
        ROCDisplay

        Raises
        ------
        ValueError
            If there are no healthy or no damaged records, or the shapes differ.
        """
        if not isinstance(decisions, Mapping) or not decisions:
            raise ValueError(f"decisions is {decisions!r:.200}; expected a mapping of names to decision functions")
        labels = np.asarray(y)
        if labels.ndim != 1 or not np.isin(labels, (-1, 1)).all():
            raise ValueError(f"y is {y!r:.200}; expected 1 for each healthy record and -1 for each damaged one")
        parts = {}
        for name, values in decisions.items():
            values = np.asarray(values, dtype=float)
            if values.shape != labels.shape:
                raise ValueError(f"decisions of {name!r} have shape {values.shape}; expected {labels.shape}, as y")
            parts[name] = values[labels == 1], values[labels == -1]
        return cls(parts).plot(**options)

    def plot(self, ax: Axes = None) -> ROCDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes, optional
            A new figure by default.

        Returns
        -------
        ROCDisplay
            Itself.

        Raises
        ------
        ValueError
            If a detector has judged no healthy or no damaged record.
        """
        curves = {name: self._curve(name) for name in self.decisions}
        self.auc_ = {name: float(auc(*curve)) for name, curve in curves.items()}
        self.auc_ = dict(sorted(self.auc_.items(), key=lambda one: -one[1]))
        many = len(curves) > MOST_INSIDE
        self.ax_ = one_axes(ax, (8.5, 5.0) if many else (6.0, 5.0))
        self.figure_ = self.ax_.figure
        self.lines_, self.thresholds_ = {}, {}
        for number, (name, area) in enumerate(self.auc_.items()):
            colour = COLOURS[number % len(COLOURS)]
            dashes = LINES[number // len(COLOURS) % len(LINES)]
            label = f"{label_of(name)}: AUC {area:.3f}{self._unjudged(name)}"
            x, y = in_percent(curves[name])
            self.lines_[name] = self.ax_.plot(x, y, color=colour, linestyle=dashes, label=label)[0]
            own = [100 * float((part[~np.isnan(part)] < 0).mean()) for part in self.decisions[name]]
            style = {"marker": MARKERS[number % len(MARKERS)], "color": colour, "zorder": 3}
            self.thresholds_[name] = self.ax_.plot(*own, linestyle="", **style)[0]
        chance = np.linspace(0, 100, 200)
        self.ax_.plot(chance, chance, color=GREY, linestyle=":", linewidth=1, label="chance: AUC 0.5")
        self.ax_.plot([], [], linestyle="", marker="o", color=GREY, label="mark: own threshold")
        small_rates(self.ax_, np.array([100.0]))
        self.ax_.set(
            xlabel="false alarms (% of healthy records)", ylabel="found (% of damaged records)", ylim=(-2, 102)
        )
        place = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0)} if many else {"loc": "lower right"}
        self.ax_.legend(frameon=not many, framealpha=0.8, edgecolor="none", fontsize="small", **place)
        return self

    def _curve(self, name: str) -> tuple[Array, Array]:
        """Shares of false alarms and of found damage."""
        healthy, damaged = (part[~np.isnan(part)] for part in self.decisions[name])
        if not len(healthy) or not len(damaged):
            raise ValueError(
                f"detector {name!r} has judged {len(healthy)} healthy and {len(damaged)} damaged records; expected "
                "some of both"
            )
        is_damaged = np.r_[np.zeros(len(healthy)), np.ones(len(damaged))]
        return roc_curve(is_damaged, -np.r_[healthy, damaged])[:2]

    def _unjudged(self, name: str) -> str:
        share = float(np.isnan(np.concatenate(self.decisions[name])).mean())
        return f", {share_text(share)} not judged" if share else ""


def since(rows: Any, onset: Any) -> Any:
    """Which records are from the onset of damage on."""
    return row_times(rows) >= (-np.inf if onset is None else time_of(rows, onset, "onset"))
