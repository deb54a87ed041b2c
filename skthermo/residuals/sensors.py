"""Sensors of the weather that predict each other: gaps that are filled, what that adds to errors, doubts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array, as_floats, spread_evenly
from skthermo._core.frames import frame_like, row_times
from skthermo._core.warnings import collected
from skthermo.exceptions import RecordsWarning, SkthermoWarning
from skthermo.residuals.gaussian import Gaussian
from skthermo.residuals.weather import FAR_OUTSIDE, TrainingRange, parts


@dataclass(frozen=True)
class SensorRegression:
    """What each sensor shows, given any others, as learned from records.

    ``usual`` holds the largest mean departure of each sensor, (n_sensors,), in 36 consecutive training records and in a
    tenth of all of them, by that number; nothing where these are fewer than ten means.
    """

    gaussian: Gaussian
    learned: NDArray[np.bool_]
    reach: TrainingRange
    usual: dict[int, Array] = field(default_factory=dict)

    @classmethod
    def fitted(cls, temperatures: Any) -> SensorRegression:
        """Learn from records; a sensor without any value is not learned."""
        values = as_floats(temperatures)
        learned = ~np.isnan(values).all(axis=0)
        complete = np.flatnonzero(~np.isnan(values).any(axis=1))
        rows = complete if 2 * len(complete) >= len(values) else np.arange(len(values))
        found = Gaussian.fitted(values[np.ix_(spread_evenly(rows, 20_000), learned)])
        variances = np.diag(found.covariance)
        own = np.diag(1e-9 * np.where(variances > 0, variances, 1.0))  # also where two sensors show the same
        gaussian, reach = Gaussian(found.mean, found.covariance + own), TrainingRange.spanned(temperatures, slice(None))
        sensors = cls(gaussian, learned, reach)
        lengths = {36, len(values) // 10} if len(values) >= 360 else set()
        usual = {length: np.fmax.reduce(sensors._lasting(temperatures, length)) for length in sorted(lengths)}
        return cls(gaussian, learned, reach, usual)

    def fill(self, temperatures: Any) -> tuple[Array, Array]:
        """Temperatures with gaps filled from the other sensors, and the standard deviations of the filled values.

        These are zero where a sensor has a value. Rows without any value stay NaN. Sensors that were not learned are
        zero throughout, which says nothing.
        """
        values = as_floats(temperatures).copy()
        deviations = np.where(np.isnan(values), np.nan, 0.0)
        gaps = np.flatnonzero(np.isnan(values[:, self.learned]).any(axis=1))
        for part in parts(len(gaps), self.learned.sum() ** 2):
            rows = np.ix_(gaps[part], self.learned)
            values[rows], deviations[rows] = self.gaussian.completed(values[rows])
        values[:, ~self.learned] = deviations[:, ~self.learned] = 0.0
        return values, deviations

    def departures(self, temperatures: Any) -> Array:
        """Value of each sensor minus its prediction from the other sensors of the record; NaN in records with gaps."""
        values = as_floats(temperatures)
        departures = np.full(values.shape, np.nan)
        if self.learned.sum() > 1:
            precision = np.linalg.inv(self.gaussian.covariance)
            centred = values[:, self.learned] - self.gaussian.mean
            departures[:, self.learned] = centred @ precision / np.diag(precision)
        return departures

    def doubts(self, temperatures: Any) -> list[RecordsWarning]:
        """The finding that a sensor departs from the others as it did not in training.

        Records count in which the others are within their training range and it is not far outside. The mean departure
        of consecutive ones has to be three times the largest in training (a season that these lack gives two), at least
        a degree, below which thermometers may differ without a fault, and at least 3 % of the training range, below
        which predictions hardly move.
        """
        least = np.maximum(0.03 * (self.reach.highest - self.reach.lowest), 1.0)
        excess = np.zeros(len(least))
        for length, usual in self.usual.items():
            lasting = np.fmax.reduce(self._lasting(temperatures, length), initial=0.0)
            excess = np.fmax(excess, lasting / np.fmax(3 * usual, least))
        if excess.max() <= 1:
            return []
        return [
            RecordsWarning(
                f"{self.reach.names[int(excess.argmax())]!r} departs from the other sensors' prediction more than it "
                "did in training. It drifts, is stuck or was moved, which moves predictions and gives false alarms. "
                "Put NaN where it is wrong: the other sensors fill it",
                "faulty-sensor",
            )
        ]

    def _lasting(self, temperatures: Any, length: int) -> Array:
        """Size of the mean departure in so many consecutive records, NaN where fewer than half of them count."""
        order = np.argsort(row_times(temperatures), kind="stable")
        values = as_floats(temperatures)[order]
        beyond = np.nan_to_num(self.reach.excess(values))
        outside = beyond > 0
        counts = (outside.sum(axis=1, keepdims=True) == outside) & (beyond <= FAR_OUTSIDE)
        departures = pd.DataFrame(np.where(counts, self.departures(values), np.nan))
        return departures.rolling(length, min_periods=length // 2).mean().abs().to_numpy()

    def errors(self, temperatures: Any) -> Iterator[Array]:
        """Independent errors of the values that `fill` fills in, of one standard deviation each, like the temperatures.

        There is one for each sensor with gaps; zero where a sensor has a value.
        """
        values = as_floats(temperatures)
        missing = np.isnan(values[:, self.learned])
        gaps = missing.any(axis=1) & ~missing.all(axis=1)
        roots, of_row = self.gaussian.error_roots(values[np.ix_(gaps, self.learned)])
        for sensor in np.flatnonzero(missing[gaps].any(axis=0)):
            error = np.zeros_like(values)
            error[np.ix_(gaps, self.learned)] = roots[of_row, :, sensor]
            yield error

    def variances_of_fills(
        self, raw: Any, filled: Any, predict: Callable[[Any], Array], outcome: Callable[[Array], Array]
    ) -> Array:
        """Variances of predictions because temperatures were filled, (n_rows, n_outcomes), or a column of zeros.

        Filled values are moved by one standard deviation up and down, sensor by sensor, and predicted again. The
        ``outcome`` of each prediction that has moved counts.
        """
        variances, middle = np.zeros((len(filled), 1)), None
        with collected():
            for error in self.errors(raw):
                middle = predict(filled) if middle is None else middle
                for side in (error, -error):
                    moved = predict(frame_like(filled, as_floats(filled) + side))
                    rows = np.nan_to_num(moved - middle).any(axis=1)
                    changes = outcome(moved[rows]) - outcome(middle[rows])
                    added = np.zeros((len(filled), changes.shape[1]))
                    added[rows] = np.nan_to_num(changes) ** 2 / 2
                    variances = variances + added
        return variances


def filled_findings(deviations: Array, names: Sequence[Any], consequence: str) -> list[SkthermoWarning]:
    """The finding that sensors were filled, from standard deviations."""
    filled = (deviations > 0).any(axis=0)
    if not filled.any():
        return []
    listed = ", ".join(repr(name) for name, is_filled in zip(names, filled, strict=True) if is_filled)
    text = (
        f"missing temperatures were filled from the other sensors: {listed}. {consequence}. If a sensor has failed, "
        "leave it out and fit again"
    )
    return [RecordsWarning(text, "faulty-sensor")]
