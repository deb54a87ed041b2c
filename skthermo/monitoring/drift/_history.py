"""Stiffness of groups over years, as `track_parameters` returns it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from skthermo._core.arrays import Array, as_floats, is_real
from skthermo._core.frames import YEAR, frame_like, has_stamps
from skthermo._core.text import SPACE, Sentences, counted, listed, percent, probability_text, significant
from skthermo._core.warnings import warn_each
from skthermo.fem.damage import ALL_GROUPS
from skthermo.monitoring._records import OF_TRAINING
from skthermo.monitoring.drift._explanations import SIGNIFICANT
from skthermo.preprocessing import set_aside

CONFIDENCE = 0.95  # of the bands
N_ERRORS = float(stats.norm.ppf((1 + CONFIDENCE) / 2))
DRAWS = 4000
FARTHEST = 100.0  # years ahead for which a date is given
SHORT = 1.5  # years of records below which season and drift are hardly distinguished


class GroupTrajectory(NamedTuple):
    """Ln stiffness of a group on each day, its standard deviation, and its random walk's in a year.

    ``end`` and ``end_covariance`` are of the level on the last day and the steady rate a year.
    """

    mean: Array
    deviation: Array
    end: Array
    end_covariance: Array
    walk: float

    def with_error_of_effects(self, share: float) -> GroupTrajectory:
        """The same trajectory, of which a share may be an error of the FE model's effects."""
        return self._replace(
            deviation=np.hypot(self.deviation, share * self.mean),
            end_covariance=self.end_covariance + share**2 * np.outer(self.end, self.end),
        )


@dataclass(frozen=True, eq=False)
class DriftResolution:
    """Which drifts the modes and the length of the records would show, and of which groups.

    Parameters
    ----------
    detectable_rates : Series
        Change a year, by group, from which a steady drift is detected with probability 90 %.
    unobservable : list of str
        Groups of which a loss of 5 % over the records would not be detected.
    confounded : mapping of str to list of str
        Groups of which a drift of 5 % is confounded with a drift of others, with these.
    indistinguishable : list of tuple of str
        Groups that cannot be distinguished: in the drift that was found, or by their effects on the modes.
    """

    detectable_rates: pd.Series
    unobservable: list[str]
    confounded: Mapping[str, list[str]]
    indistinguishable: list[tuple[str, ...]]

    def sentences(self, *, has_drift: bool = False, found: Collection[str] = ()) -> Iterator[str]:
        """What is not known, of groups other than those found to drift."""
        known = [one for one in self.detectable_rates.index if one not in self.unobservable]
        if not has_drift and known:
            each = ", ".join(f"{group} {_share(self.detectable_rates[group])}" for group in known)
            yield f"Smallest steady drift a year that is detected with probability 90{SPACE}%: {each}."
        if self.unobservable:
            yield f"A loss of 5{SPACE}% of stiffness in {listed(self.unobservable)} is unobservable in these modes."
        for group, others in self.confounded.items():
            if group not in found:
                yield f"A drift of {group} cannot be distinguished from one of {' or '.join(others)}."

    def __str__(self) -> str:
        return "\n".join(self.sentences())


@dataclass(frozen=True, eq=False)
class ModeShifts:
    """How the modes went, and how well the best explanation fits.

    Parameters
    ----------
    table : DataFrame
        One row a mode: relative shift over the records, ``measured`` (apart from the weather) and ``explained`` by the
        drift, and ``standard_error`` of the measured one.
    by_day : DataFrame
        Shift of ln frequency of each mode by day that the drift causes; 0 without drift.
    misfit_p_value : float
        Probability of trends that differ so much from what the best explanation gives, before errors were widened.
    widening : float
        Factor of the variances because of that difference (Birge's ratio squared).
    """

    table: pd.DataFrame
    by_day: pd.DataFrame
    misfit_p_value: float
    widening: float

    def sentences(self, significance: float = SIGNIFICANT) -> Iterator[str]:
        """What does not fit, and modes that were hardly measured."""
        if self.misfit_p_value < significance:
            yield (
                "One or two groups do not explain all changes of the frequencies, as with added mass: standard errors "
                f"were multiplied by {significant(np.sqrt(self.widening))}."
            )
        missing = self.table.index[self.table["measured"].isna()]
        if len(missing):
            yield f"Measured on too few days to be used: {listed(list(missing))}."

    def __str__(self) -> str:
        return "\n".join([self.table.to_string(), *self.sentences()])


@dataclass(frozen=True, eq=False)
class ParameterHistory(Sentences):
    """Stiffness of groups over years, with bands.

    It is returned by `track_parameters`.

    Parameters
    ----------
    days : DatetimeIndex
        Beginning of each day.
    trajectories : mapping of str to GroupTrajectory
        Ln stiffness of each group, and of each set of indistinguishable groups if all of them change alike; 0 on the
        first day.
    p_value : float
        Probability that records without any drift give one group as much evidence.
    significance : float
        Largest ``p_value`` that counts as a drift.
    explanations : DataFrame
        Sets of one or two groups that may drift, the best first: ``groups``; ``probability``, if any of the sets
        drifts; ``log_evidence`` against no drift.
    alternatives : mapping of str to list of str
        Groups that may drift in the place of each of the best explanation, itself among them; empty without drift.
    resolution : DriftResolution
        Which drifts would be seen: ``detectable_rates`` (Series by group: change a year that is detected with
        probability 90 %), ``unobservable`` groups, ``confounded`` ones (each with the others), and sets of
        ``indistinguishable`` ones.
    modes : ModeShifts
        ``table`` (one row a mode: relative shift over the records, ``measured`` apart from the weather, ``explained``
        by the drift, and ``standard_error``), ``by_day`` (shift of ln frequency that the drift causes),
        ``misfit_p_value`` and ``widening`` (factor of the variances because of the misfit).
    seed : int
        Of the draws of `reaches`.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.monitoring import track_parameters
    >>> from skthermo.surrogate import DataInformedFEM
    >>> years = make_truss_campaign(3, drift={"bottom": 0.02}, random_state=0)
    >>> T, F = years.temperatures, years.frequencies
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(T[:365], F[:365])
    >>> history = track_parameters(fem, T, F, freq="7D", random_state=0)
    >>> history.has_drift, history.explanations["groups"].iloc[0]
    (True, ('bottom',))
    >>> history.table["bottom"].columns.tolist()
    ['estimate', 'ci_low', 'ci_high']
    """

    days: pd.DatetimeIndex
    trajectories: Mapping[str, GroupTrajectory] = field(repr=False)
    p_value: float
    significance: float
    explanations: pd.DataFrame = field(repr=False)
    alternatives: Mapping[str, list[str]]
    resolution: DriftResolution = field(repr=False)
    modes: ModeShifts = field(repr=False)
    seed: int = field(repr=False)

    @property
    def has_drift(self) -> bool:
        """Whether there is a drift: chance alone would hardly give one group so much evidence."""
        return bool(self.p_value <= self.significance)

    @property
    def groups(self) -> list[str]:
        """Names of the groups."""
        return list(self.resolution.detectable_rates.index)

    @property
    def years(self) -> float:
        """Length of the records."""
        return (self.days[-1] - self.days[0]) / YEAR

    @property
    def table(self) -> pd.DataFrame:
        """Relative stiffness by day, 1 on the first: columns (group, "estimate" | "ci_low" | "ci_high"), at 95 %."""
        columns = {}
        for name, trajectory in self.trajectories.items():
            for what, side in (("estimate", 0.0), ("ci_low", -N_ERRORS), ("ci_high", N_ERRORS)):
                columns[name, what] = np.exp(trajectory.mean + side * trajectory.deviation)
        return pd.DataFrame(columns, index=self.days)

    @property
    def rates(self) -> pd.DataFrame:
        """Change of each group and of each set that changes alike.

        ``change`` over the records, relative, and ``change_error``; ``per_year`` and ``standard_error``; ``p_value`` of
        no change in this group; ``probability`` that it drifts if any group does; ``drifts``: "yes", "perhaps" (or
        another one of its set), "no sign", or "unobservable"; ``detectable_rates``.
        """
        levels, deviations = np.array([(one.mean[-1], one.deviation[-1]) for one in self.trajectories.values()]).T
        change, errors = np.expm1(levels), np.exp(levels) * deviations
        names, weights = list(self.trajectories), self.explanations
        shares = [
            weights.loc[[name in groups for groups in weights["groups"]], "probability"].sum()
            if name in self.groups
            else np.nan
            for name in names
        ]
        columns = {
            "change": change,
            "change_error": errors,
            "per_year": change / self.years,
            "standard_error": errors / self.years,
            "p_value": 2 * stats.norm.sf(np.abs(levels) / np.maximum(deviations, np.finfo(float).tiny)),
            "probability": shares,
            "drifts": [self._drifts(name) for name in names],
            "detectable_rates": self.resolution.detectable_rates.reindex(names).to_numpy(),
        }
        return pd.DataFrame(columns, index=pd.Index(names, name="group"))

    def reaches(self, limit: float = -0.1) -> pd.DataFrame:
        """When the stiffness of each group reaches a limit, if its drift goes on.

        Parameters
        ----------
        limit : float, default=-0.1
            Relative change since the first day: -0.1 is a loss of 10 %.

        Returns
        -------
        DataFrame
            One row a group or set: ``date``, before which it is reached with probability one half; ``earliest`` and
            ``latest``, between which it is reached with 95 %; ``probability`` that it is reached within 10 years of the
            last day. NaT where that takes more than 100 years, and for groups that are unobservable.

        Raises
        ------
        ValueError
            If the limit is not between -1 and 1, or 0.
        """
        if not is_real(limit) or not -1 < limit < 1 or limit == 0:
            raise ValueError(f"limit is {limit!r}; expected a relative change, such as -0.1 for a loss of 10 %")
        random, rows = np.random.RandomState(self.seed), {}
        for name, trajectory in self.trajectories.items():
            years = self._first_passages(trajectory, float(np.log1p(limit)), random)
            if name in self.resolution.unobservable:
                rows[name] = [pd.NaT, pd.NaT, pd.NaT, np.nan]
                continue
            dates = [self._date(years, share) for share in (0.5, (1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2)]
            rows[name] = [*dates, float((years <= 10).mean())]
        index = pd.Index(list(rows), name="group")
        return pd.DataFrame(list(rows.values()), index, ["date", "earliest", "latest", "probability"])

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
        shifts = self.modes.by_day
        if not has_stamps(F) or list(getattr(F, "columns", [])) != list(shifts.columns):
            raise ValueError(
                f"frequencies are a {type(F).__name__} with the columns {list(getattr(F, 'columns', []))}; expected a "
                f"DataFrame on a DatetimeIndex with {list(shifts.columns)}"
            )
        found = set_aside(frequencies=F, exclude=OF_TRAINING, needs_all=True, is_baseline=False)
        warn_each(found.others.warnings())
        F = found.frequencies
        of_day = np.clip(self.days.searchsorted(F.index, side="right") - 1, 0, len(self.days) - 1)
        return frame_like(F, as_floats(F) * np.exp(-shifts.to_numpy()[of_day]))

    def __repr__(self) -> str:
        rates = self.rates
        found = ", ".join(
            f"{name} {row['per_year']:+.2%} ± {2 * row['standard_error']:.2%} a year"
            for name, row in rates[rates["drifts"].isin(["yes", "perhaps"])].iterrows()
        )
        return f"ParameterHistory({found or 'no drift'})"

    def _drifts(self, name: str) -> str:
        if name in self.resolution.unobservable:
            return "unobservable"
        members = [others for others in self.alternatives.values() if name in others]
        if members:
            return "yes" if len(members[0]) == 1 else "perhaps"
        is_set = any(" and ".join(others) == name for others in self.alternatives.values())
        return "perhaps" if is_set else "no sign"

    def _first_passages(self, trajectory: GroupTrajectory, level: float, random: np.random.RandomState) -> Array:
        """Years after the last day at which ln stiffness first reaches a level, in draws; infinite if it never does."""
        beyond = trajectory.mean <= level if level < 0 else trajectory.mean >= level
        if beyond[-1]:
            return np.full(DRAWS, (self.days[beyond.argmax()] - self.days[-1]) / YEAR)
        start, rate = random.multivariate_normal(
            trajectory.end, trajectory.end_covariance, DRAWS, check_valid="ignore"
        ).T
        ahead, towards = np.abs(level - start), np.sign(level) * rate
        ahead = np.where(np.sign(level) * (level - start) > 0, ahead, 0.0)
        speed = np.maximum(towards, 1e-6)
        if trajectory.walk > 0:  # the first passage of a walk with a rate has an inverse Gaussian law
            years = random.wald(np.maximum(ahead, 1e-12) / speed, np.maximum(ahead, 1e-12) ** 2 / trajectory.walk**2)
        else:
            years = ahead / speed
        return np.where((towards <= 0) & (ahead > 0), np.inf, years)

    def _date(self, years: Array, share: float) -> pd.Timestamp | Any:
        ahead = float(np.quantile(years, share, method="nearest"))
        return self.days[-1] + round(365.25 * ahead) * pd.Timedelta(days=1) if ahead <= FARTHEST else pd.NaT

    def _answer(self) -> Iterator[str]:
        chance, rates = probability_text(self.p_value), self.rates
        first, last = f"{self.days[0]:%Y-%m-%d}", f"{self.days[-1]:%Y-%m-%d}"
        if not self.has_drift:
            yield f"No significant drift of stiffness from {first} to {last} (p value {chance})."
            return
        yield f"The drift of stiffness from {first} to {last} is significant (p value {chance})."
        for group, others in self.alternatives.items():
            rate = rates.loc[group]
            verb = "loses" if rate["per_year"] < 0 else "gains"
            yearly = f"{_share(rate['per_year'])} (±{SPACE}{_share(2 * rate['standard_error'])})"
            yield f"{group} {verb} {yearly} of its stiffness a year, {percent(rate['change'], '+.2g')} in all."
            others = [other for other in others if other != group]
            if others:
                each = ", ".join(f"{other} {percent(rates.loc[other, 'per_year'], '+.2g')} a year" for other in others)
                yield f"A drift of {listed(others)} ({each}) explains these frequencies equally well."

    def _limits(self) -> Iterator[str]:
        yield from self.resolution.sentences(has_drift=self.has_drift, found=self.alternatives)
        n_groups, n_modes = sum(group != ALL_GROUPS for group in self.groups), len(self.modes.table)
        if n_groups > n_modes:
            yield (
                f"{n_groups} groups and {counted(n_modes, 'mode')} do not determine which group drifts: the named "
                "group may be wrong, such as the mirror image of the right one."
            )
        if self.years < SHORT:
            yield (
                f"Records of {self.years:.1f} years hardly distinguish season and drift: confidence intervals are wide."
            )
        yield from self.modes.sentences(self.significance)


def _share(value: float) -> str:
    return f"{significant(100 * abs(float(value)))}{SPACE}%"
