"""Whether new records are those of the baseline's structure: changes of frequencies with the weather taken out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import f as f_law
from sklearn.base import BaseEstimator, clone

from skthermo._core.arrays import Array
from skthermo._core.frames import correlation_time
from skthermo._core.text import probability_text
from skthermo._core.warnings import without_warnings
from skthermo.detection import CompensatedDetector, TemperatureCompensator
from skthermo.monitoring._threshold import WEEK, blocks_of
from skthermo.residuals.gaussian import Gaussian

CHANCE = 0.01  # probability under an unchanged structure below which a change counts as real
MATTERS = 0.2  # deviations of single records; smaller changes hardly move a detector's rates
HIDDEN = 0.5  # the same of a standard error, from which a change may hide behind weather that is new
FEWEST_MORE = 3  # independent blocks than modes, from which there is a test
N_STEPS = 8  # days of the new period at which a change may have begun


def block_mean(values: Array, blocks: NDArray[np.intp]) -> tuple[float, float]:
    """Mean of the values that are there, and its standard error from the blocks' sums; NaN for fewer than three."""
    known = ~np.isnan(values)
    if not known.any():
        return np.nan, np.nan
    mean = float(values[known].mean())
    used, of_value = np.unique(blocks[known], return_inverse=True)
    n_blocks = len(used)
    if n_blocks < 3:
        return mean, np.nan
    sums = np.bincount(of_value, values[known] - mean)
    return mean, float(np.sqrt((sums**2).sum() * n_blocks / (n_blocks - 1)) / known.sum())


@dataclass(frozen=True)
class WeatherFree:
    """Residuals of a baseline's responses, each record predicted by others from its weather.

    They are relative where a response is positive throughout, and in its own unit elsewhere.
    """

    residuals: pd.DataFrame
    level: pd.Series
    is_relative: pd.Series
    compensator: TemperatureCompensator | None
    block: pd.Timedelta

    @classmethod
    def of(cls, detector: BaseEstimator, records: pd.DataFrame, targets: list[Any]) -> WeatherFree:
        """By the regression within a detector, else by a piecewise-linear one, or the mean if there is no weather."""
        level, is_relative = records[targets].mean(), records[targets].min() > 0
        if len(records.columns) == len(targets):
            return cls((records[targets] - level) / level.where(is_relative, 1.0), level, is_relative, None, WEEK)
        plain = _regression(detector, targets)
        with without_warnings():
            left = np.asarray(plain.fit_transform(records))
        named = pd.DataFrame(left, records.index, list(plain.get_feature_names_out()))[targets]
        is_relative = pd.Series(plain.relative_, plain.get_feature_names_out())[targets]
        return cls(named, level, is_relative, plain, WEEK)

    @property
    def scale(self) -> pd.Series:
        """What residuals are multiples of, in units of the responses."""
        return self.level.where(self.is_relative, 1.0)

    def of_new(self, records: pd.DataFrame) -> pd.DataFrame:
        """The same of other records."""
        targets = list(self.residuals.columns)
        if self.compensator is None:
            return (records[targets] - self.level) / self.scale
        with without_warnings():
            left = np.asarray(self.compensator.transform(records))
        return pd.DataFrame(left, records.index, list(self.compensator.get_feature_names_out()))[targets]


def _regression(detector: BaseEstimator, targets: list[Any]) -> TemperatureCompensator:
    """The regression within a detector, or the default one."""
    for part in (detector, *detector.get_params().values()):
        if isinstance(part, TemperatureCompensator):
            return clone(part)
        if isinstance(part, CompensatedDetector):
            return TemperatureCompensator(part.regressor, targets=part.targets, cv=part.cv)
    return TemperatureCompensator(targets=targets)


@dataclass(frozen=True)
class LevelShift:
    """A change of frequencies that follows a profile in time, from 0 to 1, and that weather does not explain.

    ``change`` and ``standard_error`` are those of `WeatherFree` by mode; ``size`` is the length of the change in
    standard deviations of single records, ``p_value`` the probability of one as large if nothing has changed (NaN with
    too few weeks).
    """

    what: str
    change: pd.Series
    standard_error: pd.Series
    scatter: pd.Series
    is_relative: pd.Series
    size: float
    p_value: float

    @property
    def is_real(self) -> bool:
        """Whether it is more than chance."""
        return self.p_value < CHANCE

    @property
    def matters(self) -> bool:
        """Whether it is more than chance, and large enough to move the rates of a detector."""
        return self.is_real and self.size > MATTERS

    @property
    def is_hidden(self) -> bool:
        """Whether the weather of the new records is so new that a change could hardly be distinguished from it."""
        return bool((self.standard_error / self.scatter).median() > HIDDEN)

    @classmethod
    def along(cls, profiles: dict[str, Array], free: WeatherFree, weather: pd.DataFrame) -> list[LevelShift]:
        """The change along each profile, beside what the weather explains of it and of the frequencies.

        Residuals are regressed on the part of the profile that weather does not explain, so that a season that only one
        period has is not taken for a change. Standard errors are those of blocks of time, which may depend within.
        """
        left = _beside(weather, profiles)
        return [cls._of(what, one, free) for what, one in zip(profiles, left.T, strict=True)]

    @classmethod
    def _of(cls, what: str, left: Array, free: WeatherFree) -> LevelShift:
        values = free.residuals.to_numpy()
        known = ~np.isnan(values) & ~np.isnan(left)[:, np.newaxis]
        counts = np.maximum(known.sum(axis=0), 1)
        x, y = (np.where(known, part, 0.0) for part in (left[:, np.newaxis], values))
        x, y = (np.where(known, part - part.sum(axis=0) / counts, 0.0) for part in (x, y))
        weight = np.maximum((x**2).sum(axis=0), 1e-300)
        change = (x * y).sum(axis=0) / weight
        rest = np.where(known, y - x * change, np.nan)
        blocks = blocks_of(free.residuals.index, free.block)
        covariance, n_independent = _of_means(rest, x / weight, blocks)
        scatter = Gaussian.fitted(rest).covariance
        size = float(Gaussian(np.zeros(len(change)), scatter).distances(change[np.newaxis])[0])
        of_mode = (
            pd.Series(one, free.residuals.columns)
            for one in (change, np.sqrt(np.diag(covariance)), np.sqrt(np.diag(scatter)))
        )
        return cls(what, *of_mode, free.is_relative, size, _p_value(change, covariance, n_independent))

    def sentence(self) -> str:
        worst = (self.change / self.standard_error).abs().idxmax()
        factor, unit = (100, " %") if self.is_relative[worst] else (1, " (its unit)")
        return (
            f"{self.what}, with the weather taken out, {worst} changes by {factor * self.change[worst]:+.2g} +- "
            f"{factor * self.standard_error[worst]:.1g}{unit}, all modes together by {self.size:.2g} standard "
            f"deviations of a record (p value {probability_text(self.p_value)})"
        )


@dataclass(frozen=True)
class ShiftsTried:
    """What weather does not explain: between the baseline and new records, from some day on, or steadily."""

    tried: tuple[LevelShift, ...]

    @classmethod
    def of(cls, free: WeatherFree, weather: pd.DataFrame, since: pd.Timestamp) -> ShiftsTried:
        """Steps at some days of the new period, which begins at ``since``, and steady changes in it and over all."""
        times = weather.index
        new = times[times >= since]
        days = new[np.unique(np.linspace(0, 0.85 * (len(new) - 1), N_STEPS).astype(int))]
        profiles = {f"from {day:%Y-%m-%d} on": (times >= day).astype(float) for day in days}
        for what, first in (("steadily over the new records", since), ("steadily over all records", times[0])):
            profile = np.asarray((times - first) / (times[-1] - first), dtype=float)
            profiles[what] = np.maximum(profile, 0.0)
        return cls(tuple(LevelShift.along(profiles, free, weather)))

    @property
    def step(self) -> LevelShift:
        """The change from the baseline to all new records."""
        return self.tried[0]

    @property
    def trend(self) -> LevelShift:
        """The steady change over all records."""
        return self.tried[-1]

    @property
    def clearest(self) -> LevelShift:
        """The least likely of all, by its probability among so many."""
        best = min(self.tried, key=lambda one: np.nan_to_num(one.p_value, nan=1.0))
        return replace(best, p_value=min(best.p_value * len(self.tried), 1.0))

    def objections(self) -> Iterator[str]:
        """What speaks against learning from the new records."""
        if self.clearest.matters:
            what = f"the new records are not those of the baseline's structure: {self.clearest.sentence()}"
            yield f"{what}; a detector fitted to them would not detect that change"

    def notes(self) -> Iterator[str]:
        """What the engineer should know besides."""
        if self.clearest.is_real and not self.clearest.matters:
            yield f"small but significant change: {self.clearest.sentence()}"
        if np.isnan(self.clearest.p_value):
            yield "the records cover too few weeks to test whether they differ from the baseline beyond the weather"
        elif self.step.is_hidden:
            error = 100 * self.step.standard_error.median()
            yield (
                "the new records have hardly any weather in common with the baseline: a change between the two of up "
                f"to {2 * error:.2g} % of a frequency could not be distinguished from weather"
            )

    def table(self, years: float) -> pd.DataFrame:
        """Changes by mode between the baseline and the new records, and a year."""
        return pd.DataFrame(
            {
                "change": self.step.change,
                "standard_error": self.step.standard_error,
                "per_year": self.trend.change / years,
                "per_year_error": self.trend.standard_error / years,
            }
        )


def _of_means(rest: Array, weights: Array, blocks: NDArray[np.intp]) -> tuple[Array, float]:
    """Covariance of weighted sums of residuals, and as how many independent blocks of time they count.

    All blocks show how much their mean residuals scatter, and for how long they stay alike: a change of late is seen by
    few blocks, whose own scatter would say little.
    """
    n_blocks, n_modes = int(blocks.max()) + 1, rest.shape[1]
    counts, sums, weight = (np.zeros((n_blocks, n_modes)) for _ in range(3))
    for total, values in ((counts, ~np.isnan(rest)), (sums, np.nan_to_num(rest)), (weight, weights)):
        np.add.at(total, blocks, values)
    means = np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)
    if n_blocks < n_modes + 3 or np.isnan(means).all(axis=0).any():
        return np.full((n_modes, n_modes), np.nan), 0.0
    lasting = max(float(np.mean([correlation_time(column) for column in means.T])), 1.0)
    together = Gaussian.fitted(means).covariance * n_blocks / (n_blocks - 1)
    return together * np.sqrt(np.outer(*2 * [(weight**2).sum(axis=0)])) * lasting, n_blocks / lasting


def _p_value(change: Array, covariance: Array, n_independent: float) -> float:
    """Of a change in all modes, by Hotelling's law."""
    n_modes = len(change)
    freedom = n_independent - n_modes
    if freedom < FEWEST_MORE:
        return np.nan
    squared = float(Gaussian(np.zeros(n_modes), covariance).distances(change[np.newaxis])[0]) ** 2
    return float(f_law.sf(squared * freedom / (n_modes * (n_independent - 1)), n_modes, freedom))


def _beside(weather: pd.DataFrame, profiles: dict[str, Array]) -> Array:
    """What weather does not explain of profiles in time, each record predicted by others, (n_records, n_profiles)."""
    together = pd.DataFrame(profiles, weather.index)
    if not len(weather.columns):
        return (together - together.mean()).to_numpy()
    with without_warnings():
        below_zero = together - 2  # so that residuals are differences
        return np.asarray(TemperatureCompensator(targets=list(profiles)).fit_transform(weather.join(below_zero)))
