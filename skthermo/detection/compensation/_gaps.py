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
    """Temperatures in which the other sensors fill the gaps; one warning names the sensors that had some."""
    filled, deviations = sensors.fill(temperatures)
    values, n_rows = as_floats(temperatures), len(filled)
    missing, empty = np.isnan(values), np.isnan(values).all(axis=1)
    said = [
        f"{name!r} is missing in {rows.sum()} of {n_rows} rows: filled from the other sensors, standard deviation "
        f"{np.sqrt(np.mean(deviations[rows, column] ** 2)):.2g}"
        for column, name in enumerate(column_names(temperatures, "x"))
        if (rows := missing[:, column] & ~np.isnan(filled[:, column])).any()
    ]
    if empty.any():
        said.append(f"{empty.sum()} of {n_rows} rows have no temperature at all: they are not judged")
    if said:
        warn_user("; ".join(said), "filled temperatures")
    return frame_like(temperatures, filled)
