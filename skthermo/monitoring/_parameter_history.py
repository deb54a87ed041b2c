"""Stiffness of damage groups over years, apart from weather and noise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from skthermo._core.arrays import Array, as_floats, check_probability, is_real, refuse_no_table
from skthermo._core.estimators import check_is_fitted
from skthermo._core.frames import DAY, YEAR, frame_like, has_stamps
from skthermo._core.text import SPACE, Sentences, counted, listed, percent, probability_text, significant
from skthermo._core.warnings import warn_each
from skthermo.fem.damage import ALL_GROUPS
from skthermo.monitoring._drift import (
    DailyWeather,
    DriftExplanation,
    ModeTrends,
    bending_line,
    daily_means,
    rate_errors,
    read_slopes,
    regressed,
)
from skthermo.preprocessing import set_aside


def track_parameters(
    fem: Any,
    T: pd.DataFrame,
    F: pd.DataFrame,
    groups: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
    freq: str = "1D",
    *,
    significance: float = 0.01,
) -> ParameterHistory:
    """Stiffness of damage groups over years, apart from weather and noise.

    Parameters
    ----------
    fem : DataInformedFEM
        Fitted to records of this structure, also to some of these; its model can be damaged.
    T : DataFrame of shape (n_samples, n_sensors)
        Temperatures in degrees Celsius on a ``DatetimeIndex``.
    F : DataFrame of shape (n_samples, n_modes)
        Measured frequencies in Hz on the same index; NaN is allowed.
    groups : sequence of str, or mapping of str to sequence of str, optional
        Damage groups of the model; a mapping joins several under a new name, with one change. By default all groups of
        the model, without those that other groups make up.
    freq : str, default="1D"
        Step of the table: a day or some days, such as "7D".
    significance : float, default=0.01
        Probability with which a structure that does not age counts as drifting.

    Returns
    -------
    ParameterHistory
        Relative stiffness of each group by day with bands, rates a year, and when a limit is reached.

    Raises
    ------
    ValueError
        If fem is not a fitted chain or its model cannot be damaged, T and F are no frames with times, differ in rows or
        have other columns than in fit, a group is unknown, the step is not a day or some days, or no mode was
        measured on enough days.

    See Also
    --------
    Monitor : Follows drift day by day.
    skthermo.studies.identify_damage : Which damage explains a sudden shift.

    Notes
    -----
    Daily means of ln f are regressed on a cubic of the weather and on a line that may bend once a year. The covariance
    of its coefficients allows for residuals that last for days (Newey and West) or for months. By the derivatives of
    the FE model, the slopes of the line are changes of groups; the largest one in its standard errors says whether
    there is a drift. Changes of one or two groups explain it.

    Bands allow for an error of 3 % of the FE model's effects; if it is less accurate than that, they are too narrow.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.monitoring import track_parameters
    >>> from skthermo.surrogate import DataInformedFEM
    >>> years = make_truss_campaign(3, drift={"bottom": 0.02}, random_state=0)
    >>> T, F = years.temperatures, years.frequencies
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(T[:365], F[:365])
    >>> history = track_parameters(fem, T, F, freq="7D")
    >>> history.has_drift, history.rates["per_year"].idxmin()
    (True, 'bottom')
    """
    check_probability(significance, "significance")
    step = _step_of(freq)
    T, F = _checked(fem, T, F)
    names, slopes = read_slopes(fem, groups)
    daily_T, daily_F = daily_means(T, np.log(F))
    days, y = daily_F.index, daily_F.to_numpy()
    years = np.arange(len(days)) * (DAY / YEAR)
    line = bending_line(years, np.arange(1, int(years[-1])))
    X = DailyWeather.fitted(daily_T.to_numpy()).of_days(daily_T.to_numpy())[0]
    n_known = (~np.isnan(y) & ~np.isnan(X[:, :1])).sum(axis=0)
    few = n_known < 3 * (X.shape[1] + line.shape[1])
    if few.all():
        counts = ", ".join(f"{mode} {number}" for mode, number in zip(F, n_known, strict=True))
        least = 3 * (X.shape[1] + line.shape[1])
        raise ValueError(f"modes were measured, with temperatures, on too few days: {counts}; expected {least} or more")
    equations, noise = regressed(np.hstack([X, line]), y[:, ~few], line.shape[1])
    freedom = noise.independent(n_known.max()) - X.shape[1]
    trends = ModeTrends.fitted(equations, noise, slopes[~few], line.shape[1], freedom)
    steady = ModeTrends.fitted(equations.first(X.shape[1] + 1), noise, slopes[~few], 1, freedom)
    p_value, explanation = steady.p_value(), DriftExplanation.weighed(trends, names)
    best = explanation.sets[0] if p_value <= significance else ()
    alternatives = explanation.alternatives() if best else {}
    changes = {}
    for group, name in enumerate(names):
        beside = [one for one in best if one != group and name not in alternatives[names[one]]]
        changes[name] = explanation.change(group, beside, line)
    at_end = np.kron(np.eye(len(trends.slopes)), line[-1:])
    errors = np.sqrt(np.diag(at_end @ trends.covariance @ at_end.T))
    shifts = sum((np.outer(changes[names[group]][0], slopes[:, group]) for group in best), np.zeros(y.shape))
    modes = pd.DataFrame(np.nan, pd.Index(F.columns, name="mode"), ["measured", "explained", "standard_error"])
    modes.loc[~few] = np.column_stack([at_end @ trends.mean, shifts[-1, ~few], errors])
    return ParameterHistory(
        table=pd.DataFrame(
            {
                (name, what): np.exp(mean + side * deviation)[::step]
                for name, (mean, deviation) in changes.items()
                for what, side in zip(
                    ["estimate", "ci_low", "ci_high"], stats.norm.ppf([0.5, 0.025, 0.975]), strict=True
                )
            },
            days[::step],
        ),
        rates=_rates(explanation, alternatives, changes, rate_errors(steady), years[-1], significance),
        p_value=p_value,
        significance=significance,
        explanations=pd.DataFrame(
            {
                "groups": [tuple(names[group] for group in one) for one in explanation.sets],
                "probability": explanation.probabilities,
                "log_evidence": explanation.evidence,
            }
        ),
        alternatives=alternatives,
        modes=modes,
        shifts=pd.DataFrame(shifts, days, F.columns),
    )


def _rates(
    explanation: DriftExplanation,
    alternatives: Mapping[str, list[str]],
    changes: Mapping[str, tuple[Array, Array]],
    alone: Array,
    years: float,
    significance: float,
) -> pd.DataFrame:
    """One row a group, as in `ParameterHistory`; ``alone`` are standard errors of yearly changes."""
    names = explanation.names
    levels, deviations = np.array([(mean[-1], deviation[-1]) for mean, deviation in changes.values()]).T
    drifts = np.where(2 * alone * years > 0.05, "unobservable", "no sign").astype(object)
    for others in alternatives.values():
        drifts[[names.index(name) for name in others]] = "yes" if len(others) == 1 else "perhaps"
    change, errors = np.expm1(levels), np.exp(levels) * deviations
    return pd.DataFrame(
        {
            "change": change,
            "change_error": errors,
            "per_year": change / years,
            "standard_error": errors / years,
            "p_value": 2 * stats.norm.sf(np.abs(levels) / np.maximum(deviations, 1e-300)),
            "probability": [
                sum(p for one, p in zip(explanation.sets, explanation.probabilities, strict=True) if group in one)
                for group in range(len(names))
            ],
            "drifts": drifts,
            "detectable_rates": (stats.norm.isf(significance / (2 * len(names))) + 1.28) * alone,
        },
        index=pd.Index(names, name="group"),
    )


@dataclass(frozen=True, eq=False)
class ParameterHistory(Sentences):
    """Stiffness of groups over years, with bands.

    It is returned by `track_parameters`.

    Parameters
    ----------
    table : DataFrame
        Relative stiffness by day, 1 on the first: columns (group, "estimate" | "ci_low" | "ci_high"), at 95 %.
    rates : DataFrame
        One row a group: ``change`` over the records, relative, and ``change_error``; ``per_year`` and
        ``standard_error``; ``p_value`` of no change in this group; ``probability`` that it drifts if any group does;
        ``drifts``: "yes", "perhaps" (or another group in its place), "no sign", or "unobservable" (a loss of 5 % over
        the records would not be detected); ``detectable_rates``: change a year that is detected with probability 90 %.
    p_value : float
        Probability that records without any drift have such trends.
    significance : float
        Largest ``p_value`` that counts as a drift.
    explanations : DataFrame
        Sets of one or two groups that may drift, the best first: ``groups``; ``probability``, if any of the sets
        drifts; ``log_evidence`` against no drift.
    alternatives : mapping of str to list of str
        Groups that may drift in the place of each of the best explanation, itself among them; empty without drift.
    modes : DataFrame
        One row a mode: shift of ln f over the records, ``measured`` (apart from the weather) and ``explained`` by the
        drift, and ``standard_error`` of the measured one; NaN for a mode that was measured on too few days.
    shifts : DataFrame
        Shift of ln f of each mode by day that the drift causes; 0 without drift.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.monitoring import track_parameters
    >>> from skthermo.surrogate import DataInformedFEM
    >>> years = make_truss_campaign(3, drift={"bottom": 0.02}, random_state=0)
    >>> T, F = years.temperatures, years.frequencies
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(T[:365], F[:365])
    >>> history = track_parameters(fem, T, F, freq="7D")
    >>> history.has_drift, history.explanations["groups"].iloc[0]
    (True, ('bottom',))
    >>> history.table["bottom"].columns.tolist()
    ['estimate', 'ci_low', 'ci_high']
    """

    table: pd.DataFrame = field(repr=False)
    rates: pd.DataFrame = field(repr=False)
    p_value: float
    significance: float
    explanations: pd.DataFrame = field(repr=False)
    alternatives: Mapping[str, list[str]]
    modes: pd.DataFrame = field(repr=False)
    shifts: pd.DataFrame = field(repr=False)

    @property
    def has_drift(self) -> bool:
        """Whether there is a drift: chance alone would hardly give such trends."""
        return bool(self.p_value <= self.significance)

    @property
    def days(self) -> pd.DatetimeIndex:
        """Beginning of each day of the table."""
        return self.table.index

    @property
    def groups(self) -> list[str]:
        """Names of the groups."""
        return list(self.rates.index)

    @property
    def years(self) -> float:
        """Length of the records."""
        return (self.shifts.index[-1] - self.shifts.index[0]) / YEAR

    def reaches(self, limit: float = -0.1) -> pd.DataFrame:
        """When the stiffness of each group reaches a limit, if its mean rate over the records goes on.

        Parameters
        ----------
        limit : float, default=-0.1
            Relative change since the first day: -0.1 is a loss of 10 %.

        Returns
        -------
        DataFrame
            One row a group: ``date``, before which it is reached with probability one half; ``earliest`` and
            ``latest``, between which it is reached with 95 %; ``probability`` that it is reached within 10 years of the
            last day. NaT where that takes more than 100 years, and for groups that are unobservable.

        Raises
        ------
        ValueError
            If the limit is not between -1 and 1, or 0.
        """
        if not is_real(limit) or not -1 < limit < 1 or limit == 0:
            raise ValueError(f"limit is {limit!r}; expected a relative change, such as -0.1 for a loss of 10 %")
        change, errors = self.rates["change"], self.rates["change_error"]
        hidden = (self.rates["drifts"] == "unobservable").to_numpy()
        error = np.maximum((errors / (1 + change) / self.years).to_numpy(), 1e-12)
        towards, needed = np.sign(limit) * (np.log1p(change) / self.years).to_numpy(), abs(np.log1p(limit))
        first, found = self.shifts.index[0], {}
        for name, share in {"date": 0.5, "earliest": 0.975, "latest": 0.025}.items():
            rate = stats.norm.ppf(share, towards, error)
            years = np.where((rate > 0) & ~hidden, needed / np.where(rate > 0, rate, np.nan), np.inf)
            found[name] = [
                first + round(365.25 * after) * DAY if after - self.years <= 100 else pd.NaT for after in years
            ]
        chance = np.where(hidden, np.nan, stats.norm.sf(needed / (self.years + 10), towards, error))
        return pd.DataFrame(found | {"probability": chance}, self.rates.index)

    def remove_drift(self, F: pd.DataFrame) -> pd.DataFrame:
        """Frequencies as they would be without the drift since the first day; unchanged where there is none.

        Parameters
        ----------
        F : DataFrame of shape (n_samples, n_modes)
            Measured frequencies in Hz on a ``DatetimeIndex``. Records before the first day or after the last count as
            taken on these.

        Returns
        -------
        DataFrame of shape (n_samples, n_modes)
            In Hz. A chain that is fitted to them learns the weather's effect free of the drift.

        Raises
        ------
        ValueError
            If F is no frame with times, or has other modes; if values are no frequencies, all of which it lists.
        """
        if not has_stamps(F) or list(getattr(F, "columns", [])) != list(self.shifts.columns):
            raise ValueError(
                f"frequencies are a {type(F).__name__} with the columns {list(getattr(F, 'columns', []))}; expected a "
                f"DataFrame on a DatetimeIndex with {list(self.shifts.columns)}"
            )
        found = set_aside(
            frequencies=F, exclude={"no-rows", "missing-column", "constant"}, needs_all=True, is_baseline=False
        )
        warn_each(found.others.warnings())
        days = self.shifts.index
        of_day = np.clip(days.searchsorted(F.index, side="right") - 1, 0, len(days) - 1)
        return frame_like(F, as_floats(found.frequencies) * np.exp(-self.shifts.to_numpy()[of_day]))

    def __repr__(self) -> str:
        drifting = self.rates[self.rates["drifts"].isin(["yes", "perhaps"])]
        found = ", ".join(
            f"{name} {row['per_year']:+.2%} ± {2 * row['standard_error']:.2%} a year"
            for name, row in drifting.iterrows()
        )
        return f"ParameterHistory({found or 'no drift'})"

    def _answer(self) -> Iterator[str]:
        first, last = (f"{self.shifts.index[end]:%Y-%m-%d}" for end in (0, -1))
        found = "The" if self.has_drift else "No significant"
        is_it = " is significant" if self.has_drift else ""
        chance = probability_text(self.p_value)
        yield f"{found} drift of stiffness from {first} to {last}{is_it} (p value {chance})."
        for group, others in self.alternatives.items():
            rate = self.rates.loc[group]
            verb = "loses" if rate["per_year"] < 0 else "gains"
            yearly = f"{_share(rate['per_year'])} (±{SPACE}{_share(2 * rate['standard_error'])})"
            yield f"{group} {verb} {yearly} of its stiffness a year, {percent(rate['change'], '+.2g')} in all."
            others = [other for other in others if other != group]
            if others:
                yield f"A drift of {listed(others)} explains these frequencies equally well."

    def _limits(self) -> Iterator[str]:
        is_hidden = self.rates["drifts"] == "unobservable"
        hidden, seen = list(self.rates.index[is_hidden]), self.rates["detectable_rates"][~is_hidden]
        if not self.has_drift and len(seen):
            each = ", ".join(f"{group} {_share(rate)}" for group, rate in seen.items())
            yield f"Smallest steady drift a year that is detected with probability 90{SPACE}%: {each}."
        if hidden:
            yield f"A loss of 5{SPACE}% of stiffness in {listed(hidden)} is unobservable in these modes."
        n_groups, n_modes = len(self.rates.index.drop(ALL_GROUPS, errors="ignore")), len(self.modes)
        if n_groups > n_modes:
            yield f"{n_groups} groups and {counted(n_modes, 'mode')} do not determine which group drifts."
        if self.years < 1.5:
            yield f"Records of {self.years:.1f} years hardly distinguish season and drift."
        missing = list(self.modes.index[self.modes["measured"].isna()])
        if missing:
            yield f"Measured on too few days to be used: {listed(missing)}."


def _checked(fem: Any, T: Any, F: Any) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Records in order of time without values that cannot be and columns that say nothing, the first of each time."""
    if isinstance(fem, type) or not hasattr(fem, "simulator_"):
        raise ValueError(f"fem is {fem!r:.200}; expected a fitted DataInformedFEM")
    check_is_fitted(fem)
    for what, table in (("temperatures", T), ("frequencies", F)):
        if not has_stamps(table):
            raise ValueError(f"the {what} are a {type(table).__name__}; expected a DataFrame with a DatetimeIndex")
        refuse_no_table(table, what)
    if T.shape[1] != fem.n_features_in_:
        raise ValueError(f"T has {T.shape[1]} columns, {list(T.columns)}; expected {fem.n_features_in_}, as in fit")
    if list(F.columns) != fem.mode_names_:
        raise ValueError(f"the frequencies have the columns {list(F.columns)}; expected {fem.mode_names_}, as in fit")
    if not len(F):
        raise ValueError("F has 0 samples; expected at least one record")
    found = set_aside(T, F, model=fem.model, exclude={"no-rows"})
    warn_each(found.others.warnings(exclude={"unsorted-stamps"}))
    T, F = (
        table.drop(columns=list(found.left_out), errors="ignore")
        .reindex(columns=table.columns)[~table.index.duplicated()]
        .sort_index()
        for table in (found.temperatures, found.frequencies)
    )
    return T.dropna(axis=1, how="all"), F


def _step_of(freq: Any) -> int:
    """Days of a step; an error for what is no period of whole days."""
    try:
        step = pd.Timedelta(freq) / DAY if isinstance(freq, str) else np.nan
    except ValueError:
        step = np.nan
    if not step >= 1 or step % 1:
        raise ValueError(f"freq is {freq!r:.100}; expected a day or some days, such as '1D' or '7D'")
    return int(step)


def _share(value: float) -> str:
    return f"{significant(100 * abs(float(value)))}{SPACE}%"
