"""Measured rates of alarms beside simulated ones, for several detectors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

from skthermo._formatting import share_text
from skthermo.plotting._axes import Axes, figure_legend, panels
from skthermo.plotting._style import BLACK, BLUE, GREY, ORANGE, label_of, marker_style, shortened
from skthermo.plotting._tables import check_study
from skthermo.plotting.comparison._rows import (
    both_ends,
    in_percent,
    name_rows,
    note,
    places_of,
    read_table,
    size_of_rows,
    small_rates,
)

NEEDED = ("detector", "scenario", "source", "measure", "rate", "band_lowest", "band_highest")
SIMULATED, REFERENCE = "data-informed", "reference"
RATES = ["band_lowest", "band_highest", "simulated", "measured"]
FEWEST = 3  # detectors from which on their ranks are compared


@dataclass(eq=False, repr=False)
class AgreementDisplay:
    """Measured rates of alarms beside those that a study has simulated.

    One row for each detector and one panel for each scenario of which there are measured records: false alarms of the
    healthy structure, and found damage. A bar is the band in which the rate of one measured campaign should lie, the
    line in it the mean of all simulated ones; a reference of several repeats is a mean, too, and not compared with the
    band. Detectors are in the order of the damage that they find in simulation. Those that failed are told in words,
    and so are shares of records that are not judged, which count neither as healthy nor as alarms. The axis of false
    alarms is even in their square root, so that small ones are told apart.

    It is best made by `from_estimator` or `from_predictions`.

    Parameters
    ----------
    table : DataFrame
        One row for each ``detector`` and ``scenario``: ``measure`` ("PFA" or "POD"), ``simulated``, ``band_lowest``,
        ``band_highest`` and ``measured``, as shares of the records; ``inside``, whether the measured rate lies in the
        band (1, 0, or NaN where one of the two is not known, or the measured one is a mean of several repeats);
        ``not_judged`` and ``not_judged_measured``, shares of all records.
    errors : dict of str to str, optional
        What kept detectors from being tested, by their names.
    groups : mapping of str to str, optional
        Group of each detector, such as "raw" or "compensated": headings of rows, or colours of points.

    Attributes
    ----------
    axes_ : ndarray of Axes of shape (n_scenarios,)
        One panel for each scenario.
    figure_ : Figure
        Their figure.
    agreement_ : DataFrame
        By scenario, over the detectors that have both rates: their number ``n_detectors``, how many measured rates lie
        in the band, ``n_inside``, of how many that have one, ``n_bands``, and Spearman's ``rank_correlation`` of the
        measured rates with the simulated ones (NaN for less than three detectors).
    bands_ : dict of str to BarContainer
        Bands of the simulated rates, by scenario.
    simulated_ : dict of str to Line2D
        Means of the simulated rates, by scenario.
    measured_ : dict of str to list of Line2D
        Measured rates by scenario: those in their bands or without one, which are filled, and those outside, which are
        not.
    points_ : dict of str to list of ErrorbarContainer
        In a scatter plot, points with their bands by scenario, one for each group.

    See Also
    --------
    skthermo.studies.DetectabilityStudy : Simulates records, and counts the alarms of detectors.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import pandas as pd
    >>> from skthermo.plotting import AgreementDisplay
    >>> columns = ["detector", "scenario", "source", "measure", "rate", "band_lowest", "band_highest"]
    >>> results = pd.DataFrame([
    ...     ["raw", "healthy", "data-informed", "PFA", 0.01, 0.0, 0.02],
    ...     ["raw", "healthy", "reference", "PFA", 0.03, float("nan"), float("nan")],
    ...     ["whitened", "healthy", "data-informed", "PFA", 0.02, 0.01, 0.04],
    ...     ["whitened", "healthy", "reference", "PFA", 0.03, float("nan"), float("nan")]], columns=columns)
    >>> display = AgreementDisplay.from_predictions(results)
    >>> display.agreement_[["n_detectors", "n_inside"]]
              n_detectors  n_inside
    scenario
    healthy             2         1
    >>> plt.close(display.figure_)
    """

    table: pd.DataFrame
    _: KW_ONLY
    errors: Mapping[str, str] | None = None
    groups: Mapping[str, str] | None = None

    @classmethod
    def from_estimator(cls, study: Any, *, groups: Mapping[str, str] | None = None, **options: Any) -> AgreementDisplay:
        """Draw what a study has simulated beside its measured records.

        Parameters
        ----------
        study : DetectabilityStudy
            With the results of a run with a ``reference``.
        groups : mapping of str to str, optional
            Group of each detector.
        **options : dict
            Options of `plot`.

        Returns
        -------
        AgreementDisplay

        Raises
        ------
        NotFittedError
            If the study has no results.
        ValueError
            If no scenario has both simulated and measured records.
        """
        check_study(study)
        return cls.from_predictions(study.results_, groups=groups, **options)

    @classmethod
    def from_predictions(
        cls, results: pd.DataFrame, *, groups: Mapping[str, str] | None = None, **options: Any
    ) -> AgreementDisplay:
        """Draw rates of a table.

        Parameters
        ----------
        results : DataFrame
            What `~skthermo.studies.DetectabilityStudy.run` returned, or rows of several such tables, for example false
            alarms in one weather and found damage in another.
        groups : mapping of str to str, optional
            Group of each detector.
        **options : dict
            Options of `plot`.

        Returns
        -------
        AgreementDisplay

        Raises
        ------
        ValueError
            If no scenario has both simulated and measured records, or a detector has two rates of one scenario.
        """
        results = read_table(results, NEEDED, "the table of results")
        failed = results["scenario"].isna()
        errors = {row["detector"]: str(row.get("error", "")) for _, row in results[failed].iterrows()}
        return cls(both_rates(results[~failed]), errors=errors, groups=groups).plot(**options)

    def plot(
        self,
        ax: Axes = None,
        *,
        kind: Literal["rows", "scatter"] = "rows",
        scenarios: Sequence[str] | None = None,
        n_columns: int = 2,
    ) -> AgreementDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes or array of Axes, optional
            One for each scenario. A new figure by default.
        kind : {"rows", "scatter"}, default="rows"
            One row for each detector; or a point for each, the measured rate over the simulated one, with the diagonal
            on which they are equal, and without names.
        scenarios : sequence of str, optional
            Those that are drawn, in this order. By default all, false alarms first.
        n_columns : int, default=2
            Panels beside each other in a new figure.

        Returns
        -------
        AgreementDisplay
            Itself.

        Raises
        ------
        ValueError
            If ``kind`` is something else, or a scenario or a detector of a group is not in the table.
        """
        if kind not in ("rows", "scatter"):
            raise ValueError(f"kind is {kind!r}; expected 'rows' or 'scatter'")
        names = self._names_of(scenarios)
        detectors = self._in_order(names)
        places = places_of(detectors, self.groups)
        size = size_of_rows(places, min(n_columns, len(names))) if kind == "rows" else (4.0, 4.2)
        self.axes_ = panels(ax, names, size, n_columns)
        self.figure_ = self.axes_[0].figure
        self.agreement_ = self._agreement(names)
        self.bands_, self.simulated_, self.measured_, self.points_ = {}, {}, {}, {}
        for one, name in zip(self.axes_, names, strict=True):
            rows = self.table[self.table["scenario"] == name].set_index("detector")
            if kind == "rows":
                self._draw_rows(one, name, rows, places)
            else:
                self._draw_points(one, name, rows)
            one.set_title(f"{self._title(name, names)}\n{self._words(name)}".rstrip(), fontsize="medium")
        figure_legend(self.axes_, ax is None)
        if kind == "scatter":
            style = {"ha": "right", "va": "bottom", "fontsize": "small", "color": GREY}
            self.axes_[0].text(0.98, 0.02, self._lacking(), transform=self.axes_[0].transAxes, **style)
        return self

    def _names_of(self, scenarios: Sequence[str] | None) -> list[str]:
        """Scenarios that are drawn, false alarms first."""
        is_healthy = self._measures() == "PFA"
        known = [*is_healthy.index[is_healthy], *is_healthy.index[~is_healthy]]
        names = known if scenarios is None else [scenarios] if isinstance(scenarios, str) else list(scenarios)
        if not names or not set(names) <= set(known):
            raise ValueError(f"scenarios is {names}; expected some of {known}, which have simulated and measured rates")
        return names

    def _measures(self) -> pd.Series:
        """Measure by scenario."""
        return self.table.groupby("scenario", sort=False)["measure"].first()

    def _in_order(self, names: Sequence[str]) -> list[Any]:
        """Detectors by the damage that they find in simulation, the best first, and those that failed at last."""
        rows = self.table[self.table["scenario"].isin(names)]
        rows = rows[rows["measure"] == "POD"] if (rows["measure"] == "POD").any() else rows
        found = rows.groupby("detector", sort=False)["simulated"].mean().sort_values(ascending=False, kind="stable")
        return list(dict.fromkeys([*found.index, *self.table["detector"], *(self.errors or {})]))

    def _agreement(self, names: Sequence[str]) -> pd.DataFrame:
        found = []
        for name in names:
            rows = self.table[self.table["scenario"] == name].dropna(subset=["simulated", "measured"])
            pairs, inside = rows[["simulated", "measured"]].to_numpy(), rows["inside"].dropna()
            can_rank = len(rows) >= FEWEST and (np.ptp(pairs, axis=0) > 0).all()
            correlation = float(spearmanr(*pairs.T)[0]) if can_rank else float("nan")
            found.append([len(rows), int(inside.sum()), len(inside), correlation])
        columns = ["n_detectors", "n_inside", "n_bands", "rank_correlation"]
        return pd.DataFrame(found, index=pd.Index(names, name="scenario"), columns=columns)

    def _title(self, name: str, names: Sequence[str]) -> str:
        measures = self._measures()[list(names)]
        if measures[name] != "PFA":
            return f"damage found: {shortened(name)}"
        return "false alarms" if (measures == "PFA").sum() == 1 else f"false alarms: {shortened(name)}"

    def _words(self, name: str) -> str:
        """How many measured rates lie in their bands, and how well the ranks agree."""
        row = self.agreement_.loc[name]
        texts = [f"{row['n_inside']:.0f} of {row['n_bands']:.0f} in the band"] if row["n_bands"] else []
        if np.isfinite(row["rank_correlation"]):
            texts.append(f"rank correlation {row['rank_correlation']:.2f}")
        return ", ".join(texts)

    def _lacking(self) -> str:
        """How many detectors failed, or leave records unjudged."""
        n_partly = self.table.loc[
            (self.table[["not_judged", "not_judged_measured"]] > 0).any(axis=1), "detector"
        ].nunique()
        texts = [f"{len(self.errors)} failed"] if self.errors else []
        texts += [f"{n_partly} do not judge all records"] if n_partly else []
        return "\n".join(texts)

    def _draw_rows(self, ax: Axes, name: str, rows: pd.DataFrame, places: Mapping[tuple[Any, Any], int]) -> None:
        name_rows(ax, places)
        is_healthy = rows["measure"].iloc[0] == "PFA"
        if is_healthy:
            small_rates(ax, in_percent(rows[RATES]))
        else:
            ax.set_xlim(-1, 101)
        ax.set_xlabel("records in alarm (%)")
        heights = {detector: height for (_, detector), height in places.items() if detector is not None}
        y = rows.index.map(heights).to_numpy(dtype=float)
        low, high, simulated, measured = in_percent(rows[RATES]).T
        label = "band of single simulated campaigns"
        self.bands_[name] = ax.barh(y, high - low, 0.62, low, color=ORANGE, alpha=0.35, label=label)
        style = {"linestyle": "", "marker": "|", "markersize": 10, "markeredgewidth": 2, "color": ORANGE}
        self.simulated_[name] = ax.plot(simulated, y, **style, label="simulated, mean")[0]
        style = {"linestyle": "", "marker": "o", "markersize": 5.5, "color": BLUE}
        is_outside = (rows["inside"] == 0).to_numpy()
        self.measured_[name] = [
            ax.plot(measured[~is_outside], y[~is_outside], **style, label="measured")[0],
            ax.plot(
                measured[is_outside], y[is_outside], **style, markerfacecolor="white", label="measured, not in the band"
            )[0],
        ]
        left = np.nanmin([low, simulated, measured], axis=0)
        right = ax.get_xlim()[1] - np.nanmax([high, simulated, measured], axis=0)
        for detector, height in heights.items():
            if detector in rows.index:
                place = rows.index.get_loc(detector)
                note(ax, height, _unjudged(rows.iloc[place]), is_right=bool(right[place] > left[place]))
            elif ax is self.axes_[0] or detector in set(self.table["detector"]):
                note(ax, height, self._reason(detector), is_right=False)

    def _reason(self, detector: Any) -> str:
        """Why a detector has no rates."""
        error = (self.errors or {}).get(detector)
        return "no measured records" if error is None else f"failed: {error}"

    def _draw_points(self, ax: Axes, name: str, rows: pd.DataFrame) -> None:
        """Measured rates over simulated ones, each group in a colour and with a marker of its own."""
        is_healthy = rows["measure"].iloc[0] == "PFA"
        for direction in "xy":
            if is_healthy:
                small_rates(ax, in_percent(rows[RATES]), direction)
            else:
                both_ends(ax, direction)
        diagonal = np.linspace(*ax.get_xlim(), 200)
        ax.plot(diagonal, diagonal, color=BLACK, linestyle="--", linewidth=0.8)
        what = "false alarms" if is_healthy else "found"
        ax.set(xlabel=f"{what}, simulated (%)", ylabel=f"{what}, measured (%)", aspect="equal")
        groups = self.groups or {}
        self.points_[name] = []
        for number, group in enumerate(dict.fromkeys([*groups.values(), None])):
            some = rows[[groups.get(detector) == group for detector in rows.index]].dropna(subset=["measured"])
            low, high, simulated, measured = in_percent(some[RATES]).T
            ends = np.clip([simulated - low, high - simulated], 0, None)
            style = marker_style(number, 1) | {"clip_on": False, "elinewidth": 0.8}
            if len(some):
                label = label_of(group) if group is not None else "others" if groups else None
                self.points_[name].append(ax.errorbar(simulated, measured, xerr=ends, **style, label=label))


def both_rates(results: pd.DataFrame) -> pd.DataFrame:
    """Simulated and measured rates side by side, of scenarios that have both."""
    keys = ["detector", "scenario"]
    twice = results[results.duplicated([*keys, "source"], keep=False)]
    if len(twice):
        first = twice.iloc[0]
        n_rows = int((twice[[*keys, "source"]] == first[[*keys, "source"]]).all(axis=1).sum())
        raise ValueError(
            f"detector {first['detector']!r} has {n_rows} rows of scenario {first['scenario']!r}, source "
            f"{first['source']!r}; expected one: of each study, keep the scenarios that are to be compared"
        )
    results = results.assign(not_judged=_share_not_judged(results))
    simulated, measured = (results[results["source"] == source] for source in (SIMULATED, REFERENCE))
    both = set(simulated["scenario"]) & set(measured["scenario"])
    if not both:
        raise ValueError(
            f"no scenario of {results['scenario'].unique().tolist()} has both simulated and measured records; expected "
            "the results of a run with a reference"
        )
    left = simulated.rename(columns={"rate": "simulated"})
    left = left[[*keys, "measure", "simulated", "band_lowest", "band_highest", "not_judged"]]
    right = measured.set_index(keys)
    is_single = right.get("n_repeats", pd.Series(1, right.index)) == 1
    right = right[["rate", "not_judged"]].set_axis(["measured", "not_judged_measured"], axis=1).assign(single=is_single)
    table = left[left["scenario"].isin(both)].join(right, on=keys).reset_index(drop=True)
    known = table[["band_lowest", "band_highest", "measured"]].notna().all(axis=1) & (table.pop("single") == 1)
    inside = table["measured"].between(table["band_lowest"], table["band_highest"]).astype(float)
    return table.assign(inside=inside.where(known))


def _share_not_judged(results: pd.DataFrame) -> Any:
    """Share of the records of each row that is not judged, where the table counts them."""
    if not {"n_records", "n_not_judged"} <= set(results.columns):
        return float("nan")
    return results["n_not_judged"] / (results["n_records"] + results["n_not_judged"])


def _unjudged(row: pd.Series) -> str:
    """What share of the measured and of the simulated records is not judged; nothing if all are."""
    measured, simulated = row["not_judged_measured"], row["not_judged"]
    if measured > 0:
        return f"{share_text(measured)} not judged{f' (simulated {share_text(simulated)})' if simulated > 0 else ''}"
    return f"{share_text(simulated)} of simulated not judged" if simulated > 0 else ""
