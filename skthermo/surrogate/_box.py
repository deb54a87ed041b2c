"""The box of parameters that an inverse was trained in."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skthermo._arguments import check_bounds
from skthermo._arrays import Array, Bounds

NEAR_HALF_WIDTHS = 2.0  # from the middle up to which parameters are near the box; a surrogate extrapolates well there
MANY_FAR_ROWS = 0.05  # share of rows far outside the box that gives a warning


@dataclass(frozen=True)
class Box:
    """Lowest and highest multiplier of each parameter, (n_parameters, 2)."""

    bounds: Array
    names: tuple[str, ...]

    @classmethod
    def of(cls, bounds: Bounds, names: Sequence[str]) -> "Box":
        """The box of bounds in any of the ways that an estimator takes them."""
        return cls(check_bounds(bounds, names), tuple(names))

    @property
    def near(self) -> Array:
        """Bounds of the region in or near the box; all positive."""
        middle, half = self.bounds.mean(axis=1), np.diff(self.bounds, axis=1)[:, 0] / 2
        lowest = np.maximum(middle - NEAR_HALF_WIDTHS * half, self.bounds[:, 0] / 2)
        return np.column_stack([lowest, middle + NEAR_HALF_WIDTHS * half])

    def outside(self, theta: Array) -> NDArray[np.bool_]:
        """Which parameters of each row are outside the box; NaN is not."""
        lowest, highest = self.bounds.T
        return (theta < lowest) | (theta > highest)

    def far_outside(self, theta: Array) -> NDArray[np.bool_]:
        """Which parameters of each row are not even near the box; NaN is not."""
        return Box(self.near, self.names).outside(theta)

    def warning(self, theta: Array, far: NDArray[np.bool_]) -> str:
        """Text of the warning if parameters are far outside the box in many rows, else an empty string."""
        known = ~np.isnan(theta).any(axis=1)
        far = far[known]
        rows = far.any(axis=1)
        if not rows.size or rows.mean() <= MANY_FAR_ROWS:
            return ""
        worst = int(far.sum(axis=0).argmax())
        values = theta[known][far[:, worst], worst]
        lowest, highest = self.bounds[worst]
        return (
            f"{rows.sum()} of {rows.size} rows give parameters far outside the bounds that the inverse was trained in: "
            f"{self.names[worst]!r} is {values.min():.3g} to {values.max():.3g} in {len(values)} rows, trained in "
            f"{lowest:.6g} to {highest:.6g}; expected frequencies in Hz in the order of the model's modes, wider "
            "bounds, or the noise of the measurement"
        )
