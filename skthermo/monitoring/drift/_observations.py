"""What daily means of records show of the stiffness of groups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import PolynomialFeatures

from skthermo._core.arrays import Array, as_floats, refuse_no_table, spread_evenly
from skthermo._core.estimators import check_is_fitted
from skthermo._core.frames import DAY, YEAR, frame_like, has_stamps, midnight, midnights_between
from skthermo._core.warnings import warn_each, warnings_once, without_warnings
from skthermo.fem.damage import ALL_GROUPS, read_groups
from skthermo.monitoring.drift._kalman import DailyNoise, DayShown
from skthermo.preprocessing import ExponentialMeans, set_aside
from skthermo.residuals.weather import WeatherFunctions

if TYPE_CHECKING:
    from skthermo.surrogate.effects import FrequencyEffects

SMALL = 0.003  # change of ln stiffness whose effect counts as linear
MIRRORED = 1e-6  # difference of the cosine of two effects from 1, below which they are the same
ACCURATE = 2e-5  # error of ln frequencies up to which a quadratic function of the parameters takes the model's place
MISLEARNED = 0.1  # prior standard deviation of ln frequency that the chain has mislearned, for each function of weather


@dataclass(frozen=True)
class DailyMeans:
    """Daily means of the logarithm of measured over predicted frequencies.

    ``values`` and ``counts``, (n_days, n_modes), are means and numbers of records; ``basis``, (n_days, n_modes, size),
    is the mean of the `WeatherFunctions` over the records of each mode, and last the first weather coordinate of the
    day before.
    """

    values: Array
    counts: Array
    basis: Array

    @classmethod
    def of(
        cls,
        ratios: Array,
        temperatures: Array,
        times: pd.DatetimeIndex,
        basis: WeatherFunctions,
        days: pd.DatetimeIndex,
        before: float = np.nan,
    ) -> DailyMeans:
        """Means of ln(measured / predicted), (n_records, n_modes), over days that begin at ``days``.

        ``before`` is the `weather` of the day before the first, if it is known.
        """
        of_day = days.searchsorted(times, side="right") - 1
        n_days, n_modes = len(days), ratios.shape[1]
        functions = basis.values(temperatures)
        known = ~np.isnan(functions).any(axis=1)
        usual = _means(functions[known, 1], of_day[known], n_days)
        earlier = np.append(before, usual[:-1])
        earlier = np.where(np.isnan(earlier), np.where(np.isnan(usual), 0.0, usual), earlier)
        values, counts = np.full((n_days, n_modes), np.nan), np.zeros((n_days, n_modes))
        means = np.zeros((n_days, n_modes, basis.size + 1))
        for mode in range(n_modes):
            rows = known & ~np.isnan(ratios[:, mode])
            counts[:, mode] = np.bincount(of_day[rows], minlength=n_days)
            values[:, mode] = _means(ratios[rows, mode], of_day[rows], n_days)
            for column in range(basis.size):
                means[:, mode, column] = _means(functions[rows, column], of_day[rows], n_days)
            means[:, mode, -1] = earlier
        return cls(values, counts, np.nan_to_num(means))

    @property
    def known(self) -> NDArray[np.bool_]:
        return ~np.isnan(self.values)

    @property
    def weather(self) -> float:
        """First coordinate of the last day's mean weather, NaN if it is not known."""
        there = self.basis[-1, self.known[-1], 1]
        return float(there[0]) if len(there) else np.nan

    def __getitem__(self, days: slice) -> DailyMeans:
        return DailyMeans(self.values[days], self.counts[days], self.basis[days])

    def followed_by(self, later: DailyMeans) -> DailyMeans:
        parts = ((getattr(one, name) for one in (self, later)) for name in ("values", "counts", "basis"))
        return DailyMeans(*(np.concatenate(list(part)) for part in parts))


def _means(values: Array, of_day: NDArray[np.intp], n_days: int) -> Array:
    """Mean of the values of each day, NaN where there is none."""
    number = np.bincount(of_day, minlength=n_days)
    sums = np.bincount(of_day, weights=values, minlength=n_days)
    return np.divide(sums, number, out=np.full(n_days, np.nan), where=number > 0)


def calendar(times: pd.DatetimeIndex, freq: Any) -> pd.DatetimeIndex:
    """Beginnings of the days from the first record to the last."""
    length = pd.Timedelta(freq)
    if length >= DAY and not length % DAY:
        return midnights_between(times.min(), times.max())[:: length // DAY].rename(times.name)
    first = midnight(times.min()) if length >= DAY else times.min().tz_convert("UTC").floor(freq).tz_convert(times.tz)
    return pd.date_range(first, times.max(), freq=freq, name=times.name)


@dataclass(frozen=True)
class QuadraticFrequencies:
    """Ln frequencies as quadratic functions of ln parameters, where these lie within what they were fitted to.

    ``coefficients`` are empty where the functions are not accurate enough, and all rows are solved by the model.
    """

    fem: Any
    ends: Array
    coefficients: Array

    @classmethod
    def of(cls, fem: Any, theta: Array) -> QuadraticFrequencies:
        """Fit to some of the rows of theta, and try it on others."""
        known = theta[~np.isnan(theta).any(axis=1)]
        ends, none = np.array([known.min(axis=0), known.max(axis=0)]), np.empty((0, 0))
        exact = cls(fem, ends, none)
        n_terms = (theta.shape[1] + 1) * (theta.shape[1] + 2) // 2
        if len(known) <= 10 * n_terms:
            return exact
        rows = known[spread_evenly(np.arange(len(known)), 8 * n_terms)]
        values = exact(rows)
        tried = np.arange(len(rows)) % 4 == 3
        coefficients = np.linalg.lstsq(exact.terms(rows[~tried]), values[~tried], rcond=None)[0]
        errors = np.abs(exact.terms(rows[tried]) @ coefficients - values[tried])
        return replace(exact, coefficients=coefficients) if errors.max() <= ACCURATE else exact

    def terms(self, theta: Array) -> Array:
        """Constant, linear and quadratic terms of each row."""
        lowest, highest = np.log(self.ends)
        width = np.where(highest > lowest, highest - lowest, 1.0)
        return PolynomialFeatures(2).fit_transform(2 * (np.log(theta) - lowest) / width - 1)

    def __call__(self, theta: Array) -> Array:
        """Ln frequencies in the measured domain, (n_rows, n_modes)."""
        values = np.full((len(theta), len(self.fem.mode_names_)), np.nan)
        margin = 0.05 * (self.ends[1] - self.ends[0])
        inside = ((theta >= self.ends[0] - margin) & (theta <= self.ends[1] + margin)).all(axis=1)
        inside &= bool(self.coefficients.size)
        if inside.any():
            values[inside] = self.terms(theta[inside]) @ self.coefficients
        others = ~inside & ~np.isnan(theta).any(axis=1)
        if others.any():
            from skthermo.surrogate.effects import healthy_frequencies  # what a job without a drift has no need to load

            values[others] = np.log(healthy_frequencies(self.fem, theta[others]))
        return values


@dataclass(frozen=True)
class DailyRecords:
    """How daily means are made of records, for a chain: its predictions, and the weather."""

    fem: Any
    basis: WeatherFunctions
    surface: QuadraticFrequencies

    @classmethod
    def of(cls, fem: Any, T: Any) -> DailyRecords:
        """Learn the weather, and the frequencies in it."""
        return cls(fem, WeatherFunctions.fitted(weather(fem, T)), QuadraticFrequencies.of(fem, parameters(fem, T)))

    def means(self, T: Any, F: Any, days: pd.DatetimeIndex, before: float = np.nan) -> DailyMeans:
        """Daily means of records; T may begin with earlier rows than F, which lags need."""
        predicted = (self.surface(parameters(self.fem, T)) + self.fem.discrepancy_(T))[-len(F) :]
        ratios = np.log(as_floats(F)) - predicted
        lacking = np.any([np.zeros(len(T), dtype=bool), *(step.lacks_past(T) for step in means_of(self.fem))], axis=0)
        lacking = lacking[-len(F) :]
        ratios[lacking & ~lacking.all()] = np.nan  # their predictions would pass for drift
        return DailyMeans.of(ratios, weather(self.fem, T)[-len(F) :], F.index, self.basis, days, before)


def weather(fem: Any, T: Any) -> Array:
    """Temperatures with gaps filled from the other sensors, and the means of earlier ones that the mapper is given."""
    filled = frame_like(T, fem.sensors_.fill(T)[0])
    with without_warnings():  # the chain tells of records without a past
        means = [as_floats(step.transform(filled))[:, filled.shape[1] :] for step in means_of(fem)]
    return np.hstack([as_floats(filled), *means])


def means_of(fem: Any) -> list[ExponentialMeans]:
    """Steps of a chain's mapper that give it means of earlier temperatures."""
    steps = fem.mapper_[:-1] if isinstance(fem.mapper_, Pipeline) else []
    return [step for step in steps if isinstance(step, ExponentialMeans)]


def parameters(fem: Any, T: Any) -> Array:
    """Parameters that a chain gives for temperatures, with each kind of warning once."""
    with warnings_once():
        return as_floats(fem.predict_parameters(T))


@dataclass(frozen=True)
class GroupEffects:
    """Relative change of each mode's frequency per relative change of the stiffness of each group.

    ``slopes`` are (n_modes, n_groups), averaged over the weather of some records; ``members`` are the model's groups
    behind each, and ``incidence``, (n_of_model, n_groups), says which are.
    """

    slopes: Array
    members: Mapping[str, Sequence[str]]
    frequencies: FrequencyEffects = field(repr=False)
    incidence: Array = field(repr=False)

    @property
    def even(self) -> list[int]:
        """Position of an even change of all groups, if it is one of them."""
        return [place for place, name in enumerate(self.members) if name == ALL_GROUPS]

    @property
    def names(self) -> list[str]:
        return list(self.members)

    def without_even(self) -> GroupEffects:
        kept = [place for place in range(len(self.members)) if place not in self.even]
        members = {name: joined for name, joined in self.members.items() if name != ALL_GROUPS}
        return replace(self, slopes=self.slopes[:, kept], members=members, incidence=self.incidence[:, kept])

    @classmethod
    def of(cls, fem: Any, T: Any, F: Any, groups: Any) -> GroupEffects:
        """Effects at the parameters that the chain gives for records, for small changes.

        Those of the groups, then those of an even change of all groups.
        """
        from skthermo.surrogate.effects import FrequencyEffects, StructuralChanges

        members = dict(read_groups(fem.model, groups))
        if len(members) > 1:
            members[ALL_GROUPS] = list(dict.fromkeys(name for joined in members.values() for name in joined))
        of_model = list(dict.fromkeys(name for joined in members.values() for name in joined))
        frequencies = FrequencyEffects.averaged(
            fem, parameters(fem, T), as_floats(F), StructuralChanges.of_damage(fem.model, of_model)
        )
        incidence = np.array([[float(name in joined) for joined in members.values()] for name in of_model])
        unchanged = np.zeros(len(of_model))
        slopes, nominal = (-effects(unchanged)[1] @ incidence for effects in (frequencies, frequencies.nominal()))
        return cls(with_mirror_images(slopes, nominal), members, frequencies, incidence)

    def of_changes(self, changes: Mapping[int, float]) -> Array:
        """The slopes, but of some groups those of the chord to a larger change of their ln stiffness."""
        slopes = self.slopes.copy()
        for group, change in changes.items():
            if abs(change) > SMALL:
                slopes[:, group] = self.frequencies(-np.expm1(change * self.incidence[:, group]))[0] / change
        return slopes


def with_mirror_images(slopes: Array, nominal: Array) -> Array:
    """Effects in which groups that have the same at the model's nominal state have their mean.

    A chain may have left the symmetry of its structure: mirror images would then seem to differ.
    """
    unit = nominal / np.maximum(np.linalg.norm(nominal, axis=0), np.finfo(float).tiny)
    images = (unit.T @ unit > 1 - MIRRORED).astype(float)
    return slopes @ (images / images.sum(axis=0))


def checked_records(fem: Any, T: Any, F: Any) -> tuple[Any, Any]:
    """Records without values that cannot be and columns that say nothing, the first of each time; an error for what is
    no fitted chain, or no records of it with times."""
    if isinstance(fem, type) or not hasattr(fem, "simulator_"):
        raise ValueError(f"fem is {fem!r:.200}; expected a fitted DataInformedFEM")
    check_is_fitted(fem)
    for what, table in (("temperatures", T), ("frequencies", F)):
        if not has_stamps(table):
            raise ValueError(f"the {what} are a {type(table).__name__}; expected a DataFrame with a DatetimeIndex")
    refuse_no_table(T, "T")
    refuse_no_table(F, "F")
    if T.shape[1] != fem.n_features_in_:
        raise ValueError(f"T has {T.shape[1]} columns, {list(T.columns)}; expected {fem.n_features_in_}, as in fit")
    if list(F.columns) != fem.mode_names_:
        raise ValueError(f"the frequencies have the columns {list(F.columns)}; expected {fem.mode_names_}, as in fit")
    if not len(F):
        raise ValueError("F has 0 samples; expected at least one record")
    found = set_aside(T, F, model=fem.model, exclude={"no-rows"})
    warn_each(found.others.warnings(exclude={"unsorted-stamps"}))
    T, F = (
        table[~table.index.duplicated()] * np.where(table.columns.isin(list(found.left_out)), np.nan, 1.0)
        for table in (found.temperatures, found.frequencies)
    )
    return T, F


def length_of(freq: str) -> float:
    """Years between two daily means; an error for what is no period."""
    try:
        length = pd.Timedelta(freq) / YEAR if isinstance(freq, str) else np.nan
    except ValueError:
        length = np.nan
    if not length > 0:
        raise ValueError(f"freq is {freq!r:.100}; expected a day or some days, such as '1D' or '7D'")
    return length


def observation(daily: DailyMeans, number: int, noise: DailyNoise, slopes: Array) -> DayShown:
    """The daily mean of a day as the states show in it: levels and slopes of groups, constants, disturbances."""
    present = np.flatnonzero(daily.known[number])
    n_modes, n_groups = slopes.shape
    size = daily.basis.shape[2]
    design = np.zeros((len(present), 2 * n_groups + n_modes * size + n_modes))
    design[:, :n_groups] = slopes[present]
    for row, mode in enumerate(present):
        first = 2 * n_groups + mode * size
        design[row, first : first + size] = daily.basis[number, mode]
        design[row, mode - n_modes] = 1.0
    return DayShown(daily.values[number, present], design, noise.of_day(daily.counts[number], present))


def with_time(daily: DailyMeans, n_shapes: int) -> Array:
    """The basis of daily means with shapes of time beside it, (n_days, n_modes, size + n_shapes)."""
    shapes = np.broadcast_to(
        shapes_of_time(len(daily.values), n_shapes)[:, np.newaxis], (*daily.values.shape, n_shapes)
    )
    return np.concatenate([daily.basis, shapes], axis=2)


def shapes_of_time(n_days: int, number: int) -> Array:
    """A line from 0 to 1, and the leading components of a random walk of the same length, (n_days, number)."""
    share = np.arange(n_days) / max(n_days - 1, 1)
    waves = [np.sqrt(2) * np.sin((k - 0.5) * np.pi * share) for k in range(1, number)]
    return np.column_stack([share, *waves])
