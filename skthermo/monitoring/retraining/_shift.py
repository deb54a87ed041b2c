"""Whether new records are those of the baseline's structure: changes of frequencies with the weather taken out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import f as f_law
from sklearn.base import BaseEstimator, clone

from skthermo._arrays import Array
from skthermo._gaussian import Gaussian
from skthermo._warnings import without_warnings
from skthermo.detection import TemperatureCompensator
from skthermo.monitoring.retraining._blocks import WEEK, blocks_of
from skthermo.surrogate import TemperatureMapper

YEAR = pd.Timedelta("365.25D")
CHANCE = 0.01  # probability under an unchanged structure below which a change counts as real
MATTERS = 0.2  # deviations of single records; smaller changes hardly move a detector's rates


@dataclass(frozen=True)
class WeatherFree:
    """Relative residuals of a baseline's frequencies, each record predicted by others from its weather."""

    residuals: pd.DataFrame
    level: pd.Series
    compensator: TemperatureCompensator | None
    block: pd.Timedelta

    @classmethod
    def of(cls, detector: BaseEstimator, records: pd.DataFrame, targets: list[Any]) -> WeatherFree:
        """By the regression within a detector, by broken lines if it has none, by the mean if there is no weather."""
        level = records[targets].mean()
        if len(records.columns) == len(targets):
            return cls(records[targets] / level - 1, level, None, WEEK)
        within = [one for one in detector.get_params().values() if isinstance(one, TemperatureCompensator)]
        plain = clone(within[0]).set_params(scale=None) if within else _broken_lines(targets)
        with without_warnings():
            left = np.asarray(plain.fit_transform(records))
        named = pd.DataFrame(left, records.index, list(plain.get_feature_names_out()))[targets]
        block = plain.block_ if isinstance(plain.block_, np.timedelta64) else WEEK
        return cls(_relative(records[targets], named), level, plain, max(pd.Timedelta(block), WEEK))

    def of_new(self, records: pd.DataFrame) -> pd.DataFrame:
        """Relative residuals of other records."""
        targets = list(self.residuals.columns)
        if self.compensator is None:
            return records[targets] / self.level - 1
        with without_warnings():
            left = np.asarray(self.compensator.transform(records))
        named = pd.DataFrame(left, records.index, list(self.compensator.get_feature_names_out()))
        return _relative(records[targets], named[targets])


def _relative(measured: pd.DataFrame, residuals: pd.DataFrame) -> pd.DataFrame:
    return residuals / (measured - residuals)


def _broken_lines(targets: list[Any]) -> TemperatureCompensator:
    return TemperatureCompensator(TemperatureMapper(), targets=targets)


@dataclass(frozen=True)
class Shift:
    """A change of frequencies that weather does not explain.

    ``change`` and ``standard_error`` are relative, by mode; ``size`` is the length of the change in standard deviations
    of single records, ``p_value`` the probability of one as large if nothing has changed (NaN with too few weeks).
    """

    change: pd.Series
    standard_error: pd.Series
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
    def worst(self) -> Any:
        """The mode that it is clearest in."""
        return (self.change / self.standard_error).abs().idxmax()

    @classmethod
    def along(cls, course: Array, free: WeatherFree, weather: pd.DataFrame) -> Shift:
        """The change per unit of a course in time (a step, or years), beside what the weather explains of both.

        Residuals are regressed on what weather does not tell of the course, so that a season that only one period has
        is not taken for a change. Standard errors are those of blocks of time, which may depend within.
        """
        left, values = _beside(weather, course), free.residuals.to_numpy()
        known = ~np.isnan(values) & ~np.isnan(left)[:, np.newaxis]
        x, y = np.where(known, left[:, np.newaxis], 0.0), np.where(known, values, 0.0)
        y = np.where(known, y - y.sum(axis=0) / np.maximum(known.sum(axis=0), 1), 0.0)
        x = np.where(known, x - x.sum(axis=0) / np.maximum(known.sum(axis=0), 1), 0.0)
        weight = np.maximum((x**2).sum(axis=0), 1e-300)
        change = (x * y).sum(axis=0) / weight
        blocks = blocks_of(free.residuals.index, free.block)
        scores = np.zeros((blocks.max() + 1, values.shape[1]))
        np.add.at(scores, blocks, x * (y - x * change) / weight)
        n_blocks = len(scores)
        covariance = scores.T @ scores * n_blocks / max(n_blocks - 1, 1)
        scatter = Gaussian.of(np.where(known, y - x * change, np.nan))
        size = float(Gaussian(np.zeros(len(change)), scatter.covariance).distances(change[np.newaxis])[0])
        names = free.residuals.columns
        error = np.sqrt(np.diag(covariance))
        return cls(pd.Series(change, names), pd.Series(error, names), size, _p_value(change, covariance, n_blocks))

    def sentence(self) -> str:
        """The change in words."""
        worst = self.worst
        return (
            f"{worst} by {100 * self.change[worst]:+.2g} +- {100 * self.standard_error[worst]:.1g} %, all modes "
            f"together {self.size:.2g} standard deviations of a record (probability by chance {self.p_value:.1g})"
        )


def _p_value(change: Array, covariance: Array, n_blocks: int) -> float:
    """Of a change in all modes, by Hotelling's law."""
    n_modes = len(change)
    if n_blocks < n_modes + 3:
        return np.nan
    squared = float(Gaussian(np.zeros(n_modes), covariance).distances(change[np.newaxis])[0]) ** 2
    freedom = n_blocks - n_modes
    return float(f_law.sf(squared * freedom / (n_modes * (n_blocks - 1)), n_modes, freedom))


def _beside(weather: pd.DataFrame, course: Array) -> Array:
    """What weather does not tell of a course in time, each record predicted by others."""
    if not len(weather.columns) or np.ptp(course) == 0:
        return course - course.mean()
    span = (course - course.min()) / np.ptp(course)
    lines = _broken_lines(["course"])
    with without_warnings():
        left = np.asarray(lines.fit_transform(weather.assign(course=1 + span)))[:, 0]
    return left * np.ptp(course)


def years_of(times: pd.DatetimeIndex) -> Array:
    """Time of each record since the first in years."""
    return np.asarray((times - times[0]) / YEAR, dtype=float)
