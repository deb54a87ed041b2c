"""Gaps and outliers that are asked for in simulated records."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array, is_real
from skthermo.surrogate.chain._service import ServiceRecords

TIMES_WIDER = 10.0  # noise of an outlier over that of other values, where the share of outliers is given
LARGEST_SEED = np.iinfo(np.int32).max


@dataclass(frozen=True, eq=False)
class Faults:
    """Gaps and outliers: "fitted", the share of the values, or None; outliers may be of ``raw`` frequencies."""

    gaps: Any
    outliers: Any
    raw: Any = None
    service: ServiceRecords | None = None

    @classmethod
    def asked(cls, gaps: Any, outliers: Any) -> Faults:
        """Checked; what is neither a text nor a number is a table of raw frequencies."""
        _check(gaps, "gaps", "'fitted', the share of the values that are missing, such as 0.1, or None")
        if isinstance(outliers, ServiceRecords):
            return cls(gaps, "fitted", service=outliers)
        if np.ndim(outliers):
            return cls(gaps, "fitted", outliers)
        _check(
            outliers,
            "outliers",
            "'fitted', the share of the values that are outliers, such as 0.01, the frequencies that the chain was "
            "fitted on before they were cleaned, or None",
        )
        return cls(gaps, outliers)

    def streams(self, random_state: np.random.RandomState) -> list[np.random.RandomState]:
        """Random states of the records drawn from, of gaps and of outliers, beside the one of the noise.

        They are the same whatever noise is drawn, and noise is the same without any faults.
        """
        return [np.random.RandomState(seed) for seed in deepcopy(random_state).randint(LARGEST_SEED, size=3)]

    def noise(self, residuals: Any, weather: Array, random_state: np.random.RandomState) -> Array:
        """Residuals for rows of weather in order of time, complete if anything is asked for."""
        if self.gaps is None and self.outliers is None:
            return np.asarray(residuals.draw(weather, random_state))
        return np.asarray(residuals.draw_complete(weather, random_state, self.outliers is not None))

    def added(
        self,
        noise: Array,
        is_fitted: bool,
        draw: Callable[[], tuple[Any, NDArray[np.intp]]],
        streams: list[np.random.RandomState],
    ) -> Array:
        """Noise with outliers, NaN where a mode is missing; ``draw`` gives records to take these from.

        Fitted noise that is complete because outliers are asked for has the gaps of the records that they are of.
        """
        gaps = "fitted" if self.gaps is None and is_fitted and self.outliers is not None else self.gaps
        service, taken = draw() if "fitted" in (gaps, self.outliers) else (None, None)
        if self.outliers == "fitted":
            outliers = service.drawn_outliers(taken, streams[2])
            noise = np.where(np.isnan(outliers), noise, outliers)
        elif self.outliers is not None:
            noise = noise * np.where(streams[2].uniform(size=noise.shape) < self.outliers, TIMES_WIDER, 1.0)
        if gaps == "fitted":
            return np.where(service.missing[taken, -noise.shape[1] :], np.nan, noise)
        return noise if gaps is None else np.where(self.single_gaps(noise.shape, streams), np.nan, noise)

    def single_gaps(self, shape: tuple[int, int], streams: list[np.random.RandomState]) -> NDArray[np.bool_]:
        """Which values are missing, each by itself."""
        return streams[1].uniform(size=shape) < self.gaps


def _check(value: Any, what: str, expected: str) -> None:
    """Raise an error for what is neither None nor "fitted" nor a share."""
    is_share = is_real(value) and 0 <= value < 1
    if value is not None and not is_share and not (isinstance(value, str) and value == "fitted"):
        raise ValueError(f"{what} is {value!r:.100}; expected {expected}")
