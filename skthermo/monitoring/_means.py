"""A test of slow changes: the mean of the last days, each week, by the statistic of `identify_damage`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from skthermo._core.arrays import Array, median, robust_deviation
from skthermo._core.frames import DAY, days_later, midnights
from skthermo._core.saved_frames import SavesFrames
from skthermo.monitoring._evaluation import DetectorParts
from skthermo.monitoring._events import leading, table_of
from skthermo.residuals.cones import project_on_cones
from skthermo.residuals.mean_errors import MeanErrors, chance_of


@dataclass(frozen=True)
class MeanTest(SavesFrames):
    """Whether the mean of the residuals of the last ``n_days`` has stayed as in the baseline.

    ``errors`` are the errors of means of days, None where the baseline is too short to tell them. ``chance`` is the
    largest probability of a mean that counts as moved, and ``scales`` are standard deviations of what the detector
    sees. ``directions`` are relative changes of the modes by a loss of each damage group, None without; those that
    cannot be distinguished are ``joined`` under one name.
    """

    errors: MeanErrors | None
    chance: float
    names: list[Any]
    scales: Array
    directions: pd.DataFrame | None
    joined: dict[str, str]
    n_days: int = 30

    @classmethod
    def learned(
        cls,
        parts: DetectorParts,
        per_year: float,
        since: pd.Timestamp | None = None,
        crossings: float = 16.0,
    ) -> MeanTest:
        """From residuals of what a detector was trained on, for so many false alarms a year.

        The days ``since`` an intervention alone tell the level after it.

        A level that a mean exceeds with probability p is exceeded in about 16 p events a year, as means of neighbouring
        weeks share most of their days: measured with independent and with correlated residuals of three and six modes.
        """
        groups = parts.groups
        directions = None if groups is None else groups.drop(columns=["sensitivity", "joined"])
        joined = {} if groups is None else groups["joined"].to_dict()
        errors = cls._errors(parts, since)
        return cls(errors, per_year / crossings, parts.targets, parts.scales, directions, joined)

    @classmethod
    def _errors(cls, parts: DetectorParts, since: pd.Timestamp | None) -> MeanErrors | None:
        """Errors of means of days, None where there are fewer than half a mean for each of a dozen parts."""
        least = 12 * cls.n_days / 2
        if midnights(parts.trained.index).nunique() < least:
            return None
        rest = parts.out_of_fold(cls.n_days * DAY)
        means = rest.groupby(midnights(rest.index)).mean()
        if means.notna().any(axis=1).sum() < least:
            return None
        errors = MeanErrors.learned(means.to_numpy())
        if since is None:
            return errors
        n_own = np.maximum(means[means.index >= since].count().to_numpy() / errors.for_one, 1.0)
        return replace(errors, n_trained=np.minimum(errors.n_trained, n_own))

    def weeks(self, means: pd.DataFrame, times: Sequence[pd.Timestamp]) -> pd.DataFrame:
        """A row for each of some times, by daily means of residuals before it.

        ``level`` is the statistic over its limit, NaN where fewer than half of the days have a value; ``p_value``; the
        ``modes`` that have moved most; and departures of modes, effects and losses of groups, as of records.
        """
        groups = list(dict.fromkeys(self.joined.values()))
        columns = [f"departure {name}" for name in self.names]
        columns += [f"{what} {group}" for what in ("effect", "loss") for group in groups]
        types = dict.fromkeys(["level", "p_value", *columns], float) | {"modes": object}
        index = pd.DatetimeIndex(times) if len(times) else means.index[:0]
        return table_of([self._tested(means, time) for time in times], types, index)

    def _tested(self, means: pd.DataFrame, time: pd.Timestamp) -> list[Any]:
        """Level, probability, what the mean of the days before a time departs by, and modes."""
        nothing = [np.nan, np.nan, *[0.0] * (len(self.names) + 2 * len(set(self.joined.values()))), ""]
        days = means[(means.index >= days_later(time, -self.n_days)) & (means.index < time)].to_numpy()
        if self.errors is None or 2 * (~np.isnan(days).all(axis=1)).sum() < self.n_days:
            return nothing
        reach = np.fmax((self.errors.limits[1] - self.errors.limits[0]) / 2, 6 * robust_deviation(days))
        days = np.where(np.abs(days - median(days)) > reach, np.nan, days)
        number = np.where(self.errors.known, (~np.isnan(days)).sum(axis=0), 0)
        some = number > self.n_days / 4
        if not some.any():
            return nothing
        own = np.sqrt(np.fmax(np.nanvar(days[:, some], axis=0) / self.errors.deviations[some] ** 2, 1.0))
        scatter = np.ones(len(some))
        scatter[some] = own  # of noisier days, as in frost, the mean is less certain
        covariance, freedom = self.errors.of_mean(np.where(some, number, 0), scatter)
        covariance, mean = covariance[np.ix_(some, some)], np.nanmean(days[:, some], axis=0)
        root = np.linalg.cholesky(covariance)
        white = np.linalg.solve(root, mean)
        squared, n_free = float(white @ white), int(some.sum())
        limit = n_free * stats.f.isf(self.chance, n_free, freedom)
        departures, sizes = np.zeros(len(some)), np.round(np.abs(mean) / np.sqrt(np.diag(covariance)), 2)
        departures[some] = np.round(mean / self.scales[some], 4)
        modes = leading(dict(zip(np.array(self.names, dtype=object)[some], sizes, strict=True)))
        level, p_value = np.sqrt(squared / limit), chance_of(squared, n_free, freedom)
        return [np.round(level, 6), np.round(p_value, 6), *departures, *self._explained(root, white, some), modes]

    def _explained(self, root: Array, white: Array, some: NDArray[np.bool_]) -> list[float]:
        """Effects of the groups in standard errors of the mean, then their losses; none where they explain less than
        half of it."""
        if self.directions is None:
            return []
        effects = np.linalg.solve(root, self.directions.to_numpy()[:, some].T)
        lengths = np.sqrt((effects**2).sum(axis=0))
        losses, length = project_on_cones(
            (effects.T @ effects)[np.newaxis], (white @ effects)[np.newaxis], np.array([0])
        )
        is_explained = 2 * float(length[0]) ** 2 >= float(white @ white)
        table = pd.DataFrame({"effect": losses[0] * lengths, "loss": losses[0]}, self.directions.index) * is_explained
        table = table.groupby(self.joined).sum().reindex(list(dict.fromkeys(self.joined.values())))
        return [*table["effect"].round(2), *table["loss"].round(6)]
