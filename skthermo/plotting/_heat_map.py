"""Tables of numbers as maps of colours."""

import numpy as np
import pandas as pd

from skthermo.plotting._axes import Axes
from skthermo.plotting._style import label_of

DARK = 0.55
"""Share of the limit above which a cell is so dark that its number is white."""


def draw_heat_map(ax: Axes, table: pd.DataFrame, limit: float | None, smallest: float = 0.0) -> Axes:
    """Draw cells coloured from -limit to limit with their numbers; values below ``smallest`` stay without a number."""
    values = table.to_numpy(dtype=float)
    known = np.abs(values[np.isfinite(values)])
    largest = limit or (known.max() if known.size and known.max() > 0 else 1.0)
    image = ax.imshow(values, cmap="RdBu_r", vmin=-largest, vmax=largest, aspect="auto")
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value) and abs(value) >= smallest:
            colour = "white" if abs(value) > DARK * largest else "black"
            ax.text(column, row, f"{value:.2f}", ha="center", va="center", fontsize="small", color=colour)
    ax.set_xticks(range(table.shape[1]), [label_of(name) for name in table.columns])
    ax.set_yticks(range(table.shape[0]), [label_of(name) for name in table.index])
    ax.tick_params(length=0)
    return image
