"""Temperatures that are missing: filled from the other sensors, and what that costs the prediction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array, as_floats
from skthermo._frames import column_names, frame_like
from skthermo._warnings import warn_user, without_warnings
from skthermo._weather import SensorRegression


@dataclass(frozen=True)
class FillError:
    """Covariance of the error that filled temperatures bring into predictions, (n_rows, n_modes, n_modes).

    ``rows`` are those whose predictions depend on a filled temperature.
    """

    rows: NDArray[np.intp]
    covariances: Array

    @classmethod
    def of(cls, sensors: SensorRegression, raw: Any, filled: Any, predict: Callable[[Any], Array]) -> FillError:
        """Move what was filled by one standard deviation up and down, sensor by sensor, and predict again."""
        moves: list[Array] = []
        middle = np.empty(0)
        for error in sensors.errors(raw):
            with without_warnings():
                middle = middle if moves else predict(filled)
                moves += [predict(frame_like(filled, as_floats(filled) + side)) - middle for side in (-error, error)]
        if not moves:
            return cls(np.empty(0, dtype=np.intp), np.empty((0, 1, 1)))
        moved = np.nan_to_num(moves)
        rows = np.flatnonzero(moved.any(axis=(0, 2)))
        return cls(rows, np.einsum("ijk,ijl->jkl", moved[:, rows], moved[:, rows]) / 2)


def fill_temperatures(sensors: SensorRegression, temperatures: Any) -> Any:
    """Temperatures in which the other sensors fill the gaps, with a warning that counts these by sensor."""
    filled, deviations = sensors.fill(temperatures)
    missing, n_rows = np.isnan(as_floats(temperatures)), len(filled)
    empty = missing.all(axis=1)
    said = [
        f"{name!r} in {rows.sum()} of {n_rows} rows (standard deviation {np.sqrt(np.mean(sizes[rows] ** 2)):.2g})"
        for name, rows, sizes in zip(
            column_names(temperatures, "x"), (missing & ~np.isnan(filled)).T, deviations.T, strict=True
        )
        if rows.any()
    ]
    if said:
        warn_user(
            f"missing temperatures were filled from the other sensors: {', '.join(said)}; the spread of residuals is "
            "widened by what that costs",
            "filled temperatures",
        )
    if empty.any():
        warn_user(
            f"{empty.sum()} of {n_rows} rows have no temperature at all: they are not judged", "without temperature"
        )
    return frame_like(temperatures, filled)
