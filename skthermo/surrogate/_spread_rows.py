"""A few hundred rows that stand for all."""

import numpy as np
from numpy.typing import NDArray

MOST = 365


def spread_rows(chosen: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Positions of at most a few hundred rows, spread evenly over the chosen ones."""
    rows = np.flatnonzero(chosen)
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST)).astype(int))]
