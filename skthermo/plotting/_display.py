"""What all displays share: how they are made, and the axes that they draw into."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from skthermo.plotting._axes import panels
from skthermo.plotting._style import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Display:
    """A display as scikit-learn has them: made and drawn in one call, with its axes and its figure as attributes."""

    axes_: np.ndarray

    @classmethod
    def _drawn(cls, *data: object, **options: Any) -> Self:
        """A display that is drawn: options that it has as parameters are its own, all others are those of `plot`."""
        own = {field.name: options.pop(field.name) for field in fields(cls) if field.name in options}
        return cls(*data, **own).plot(**options)

    def _take_axes(
        self, ax: Axes | np.ndarray | None, names: Sequence[object], size: tuple[float, float], **options: Any
    ) -> np.ndarray:
        """One axes for each name: those that are given, or those of a new figure with panels of this size."""
        self.axes_ = panels(ax, names, size, **options)
        return self.axes_

    def _head(self, result: object, width: int) -> None:
        """The first sentence of a result that has an answer, above all panels."""
        if hasattr(result, "answer"):
            self.figure_.suptitle(plain(textwrap.fill(result.answer()[0], width)), fontsize="medium")

    @property
    def ax_(self) -> Axes:
        """The only axes, or the first of several."""
        return self.axes_[0]

    @property
    def figure_(self) -> Figure:
        """The figure of the axes."""
        return self.axes_[0].figure
