"""Detectors in their order of preference, with what each of them promises."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd

from skthermo._formatting import percent, share_text
from skthermo.plotting._axes import Axes, figure_legend, panels
from skthermo.plotting._style import BLACK, BLUE, GREY, ORANGE
from skthermo.plotting._tables import check_study
from skthermo.plotting.comparison._rows import (
    in_percent,
    name_rows,
    note,
    places_of,
    read_table,
    size_of_rows,
    small_rates,
)

NEEDED = (
    *("false_alarms", "false_alarms_lowest", "false_alarms_highest", "keeps_limit", "pod", "pod_lowest", "pod_highest"),
    *("pod_equal", "behind", "behind_lowest", "behind_highest", "clearly_behind"),
)
LEVEL = "best, or not clearly behind"
ONE_REPEAT = "order not sure: one repeat"
BEHIND = "clearly behind"
FAILED = "failed"


@dataclass(eq=False, repr=False)
class RankingDisplay:
    """Detectors in their order of preference: their false alarms, and the damage that they find.

    One row for each detector, and three panels: false alarms with their limit; found damage, the mean over all damaged
    scenarios, at the detector's own threshold and with thresholds moved to equal false alarms; and how much less than
    the best each one finds, with bounds for all comparisons together. Headings say which detectors are not clearly
    behind the best, which are (grey), which raise clearly more false alarms than the limit (orange), and which failed.
    Shares of records that are not judged are told in words. The axis of false alarms is even in their square root, so
    that small ones are told apart.

    It is best made by `from_estimator` or `from_predictions`.

    Parameters
    ----------
    ranking : DataFrame
        One row for each detector, the best first, as `~skthermo.studies.DetectabilityStudy.ranking` returns it.
    max_false_alarms : float, default=0.02
        Limit of the share of false alarms.
    by : {"pod", "pod_equal"}, default="pod"
        What was compared with the best: detectors as they are, or with thresholds moved to equal false alarms.

    Attributes
    ----------
    axes_ : ndarray of Axes of shape (3,)
        False alarms, found damage, and distance from the best.
    figure_ : Figure
        Their figure.
    bounds_ : dict of str to LineCollection
        Bounds of ``"false_alarms"``, ``"pod"`` and ``"behind"``.
    points_ : dict of str to PathCollection
        Marks of these, and of ``"pod_equal"``.
    limit_line_ : Line2D
        Limit of the false alarms.

    See Also
    --------
    ROCDisplay : Found damage over false alarms, for all thresholds.
    AgreementDisplay : Measured rates beside simulated ones.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import pandas as pd
    >>> from skthermo.plotting import RankingDisplay
    >>> ranking = pd.DataFrame(
    ...     {"false_alarms": [0.01, 0.02], "false_alarms_lowest": [0.0, 0.01], "false_alarms_highest": [0.02, 0.03],
    ...      "keeps_limit": True, "pod": [0.9, 0.5], "pod_lowest": [0.8, 0.4], "pod_highest": [1.0, 0.6],
    ...      "pod_equal": [0.92, 0.5], "behind": [0.0, 0.42], "behind_lowest": [0.0, 0.3], "behind_highest": [0.0, 0.5],
    ...      "clearly_behind": [False, True]}, index=["whitened", "raw"])
    >>> display = RankingDisplay.from_predictions(ranking)
    >>> [text.get_text() for text in display.axes_[0].get_yticklabels()]
    ['best, or not clearly behind', 'whitened', 'clearly behind', 'raw']
    >>> plt.close(display.figure_)
    """

    ranking: pd.DataFrame
    _: KW_ONLY
    max_false_alarms: float = 0.02
    by: Literal["pod", "pod_equal"] = "pod"

    @classmethod
    def from_estimator(
        cls,
        study: Any,
        *,
        max_false_alarms: float = 0.02,
        source: str = "data-informed",
        by: Literal["pod", "pod_equal"] = "pod",
        **options: Any,
    ) -> RankingDisplay:
        """Draw the ranking of the detectors of a study.

        Parameters
        ----------
        study : DetectabilityStudy
            With results.
        max_false_alarms : float, default=0.02
            Limit of the share of false alarms.
        source : str, default="data-informed"
            Records that rank the detectors: "data-informed" (simulated) or "reference".
        by : {"pod", "pod_equal"}, default="pod"
            What is compared: detectors as they are, or with thresholds moved to equal false alarms.
        **options : dict
            Options of `plot`.

        Returns
        -------
        RankingDisplay

        Raises
        ------
        NotFittedError
            If the study has no results.
        ValueError
            If the study has no healthy scenario, or the limit is not a share.
        """
        check_study(study)
        ranking = study.ranking(max_false_alarms, source, by=by)
        return cls.from_predictions(ranking, max_false_alarms=max_false_alarms, by=by, **options)

    @classmethod
    def from_predictions(
        cls,
        ranking: pd.DataFrame,
        *,
        max_false_alarms: float = 0.02,
        by: Literal["pod", "pod_equal"] = "pod",
        **options: Any,
    ) -> RankingDisplay:
        """Draw a ranking.

        Parameters
        ----------
        ranking : DataFrame
            What `~skthermo.studies.DetectabilityStudy.ranking` returned.
        max_false_alarms : float, default=0.02
            Limit of the share of false alarms with which it was made.
        by : {"pod", "pod_equal"}, default="pod"
            What was compared with the best in it.
        **options : dict
            Options of `plot`.

        Returns
        -------
        RankingDisplay

        Raises
        ------
        ValueError
            If the table lacks columns.
        """
        ranking = read_table(ranking, NEEDED, "the ranking")
        return cls(ranking, max_false_alarms=max_false_alarms, by=by).plot(**options)

    def plot(self, ax: Axes = None) -> RankingDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : array of matplotlib's Axes of shape (3,), optional
            A new figure by default.

        Returns
        -------
        RankingDisplay
            Itself.
        """
        kinds = self._kinds()
        places = places_of(list(self.ranking.index), kinds)
        self.axes_ = panels(ax, ["false alarms", "damage found", "behind the best"], size_of_rows(places, 3), 3)
        self.figure_ = self.axes_[0].figure
        for one in self.axes_:
            name_rows(one, places)
        rows = self.ranking[[kinds[name] != FAILED for name in self.ranking.index]]
        heights = {name: height for (_, name), height in places.items() if name is not None}
        y = rows.index.map(heights).to_numpy(dtype=float)
        colours = [{LEVEL: BLUE, ONE_REPEAT: BLUE, BEHIND: GREY}.get(kinds[name], ORANGE) for name in rows.index]
        self.bounds_, self.points_ = {}, {}
        markers = "oo" + ("o" if self.by == "pod" else "D")
        for one, name, marker in zip(self.axes_, ("false_alarms", "pod", "behind"), markers, strict=True):
            value, low, high = in_percent(rows[[name, f"{name}_lowest", f"{name}_highest"]]).T
            self.bounds_[name] = one.hlines(y, low, high, colors=colours, linewidth=1.5)
            style = {"s": 30, "zorder": 3, "marker": marker, "edgecolors": colours}
            faces, label = (colours, "at its own threshold, with bounds") if marker == "o" else ("white", None)
            self.points_[name] = one.scatter(value, y, **style, facecolors=faces, label=label)
        alarms, found, behind = self.axes_
        equal = in_percent(rows["pod_equal"])
        label = f"at equal false alarms ({percent(self.max_false_alarms)})" if np.isfinite(equal).any() else None
        style = {"s": 30, "zorder": 3, "marker": "D", "edgecolors": colours, "facecolors": "white"}
        self.points_["pod_equal"] = found.scatter(equal, y, **style, label=label)
        limit = 100 * self.max_false_alarms
        line = {"color": BLACK, "linestyle": "--", "linewidth": 1}
        self.limit_line_ = alarms.axvline(limit, **line, label="limit of false alarms")
        behind.axvline(0, color=BLACK, linewidth=0.8)
        small_rates(alarms, np.append(in_percent(rows[["false_alarms", "false_alarms_highest"]]), limit))
        found.set_xlim(-2, 102)
        alarms.set(title="false alarms", xlabel="healthy records in alarm (%)")
        found.set(title="damage found", xlabel="damaged records in alarm (%)")
        how = "at their own thresholds" if self.by == "pod" else "at equal false alarms"
        behind.set(title="less found than by the best", xlabel=f"{how} (percentage points)")
        self._write_notes(heights, kinds)
        figure_legend(self.axes_, ax is None)
        return self

    def _kinds(self) -> dict[Any, str]:
        """Heading of each detector, the best ones first."""
        limit = f"more than {percent(self.max_false_alarms)} false alarms"
        level = LEVEL if self.ranking["behind_lowest"].notna().any() else ONE_REPEAT
        kinds = {}
        for name, row in self.ranking.iterrows():
            is_tested = np.isfinite(row["false_alarms"])
            kinds[name] = FAILED if not is_tested else BEHIND if row["clearly_behind"] else level
            if is_tested and not row["keeps_limit"]:
                kinds[name] = limit
        order = [level, BEHIND, limit, FAILED]
        return dict(sorted(kinds.items(), key=lambda one: order.index(one[1])))

    def _write_notes(self, heights: Mapping[Any, int], kinds: Mapping[Any, str]) -> None:
        """What kept detectors from being tested, and shares of records that are not judged."""
        for name, height in heights.items():
            row = self.ranking.loc[name]
            if kinds[name] == FAILED:
                note(self.axes_[0], height, str(row.get("error", "")), is_right=False)
            elif row.get("not_judged", 0) > 0:
                place = "right" if not row["pod_highest"] > 0.5 else "left"
                note(self.axes_[1], height, f"{share_text(row['not_judged'])} not judged", is_right=place == "right")
