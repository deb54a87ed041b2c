"""How far inputs lie outside the range that a mapper was trained on."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sklearn.pipeline import Pipeline

from skthermo._arrays import Array, as_floats
from skthermo._frames import column_names

FAR = 0.25
"""An input farther outside the training range than this many times its width counts as unknown weather."""


@dataclass(frozen=True)
class TrainingRange:
    """Lowest and highest value of every input of the rows that trained a mapper."""

    lowest: Array
    highest: Array
    names: Sequence[Any]

    @classmethod
    def of(cls, inputs: Any, trained: Array) -> "TrainingRange":
        """The range of a mapper's inputs, over the rows that trained it."""
        values = as_floats(inputs)[trained]
        return cls(values.min(axis=0), values.max(axis=0), column_names(inputs, "T"))

    def excess(self, inputs: Any) -> Array:
        """How far each value is outside, in units of the range of its column; 0 inside, NaN where it is missing."""
        values, width = as_floats(inputs), self.highest - self.lowest
        beyond = np.maximum(np.maximum(self.lowest - values, values - self.highest), 0.0)
        return beyond / np.where(width > 0, width, 1.0) + np.where(np.isnan(values), np.nan, 0.0)

    def warning(self, inputs: Any) -> str:
        """Text of the warning if rows are far outside the range, else an empty string."""
        values = as_floats(inputs)
        known = ~np.isnan(values).any(axis=1)
        if not known.any():
            return f"none of {len(values)} rows can be predicted: each lacks a temperature or a lagged one"
        excess = np.where(known[:, np.newaxis], self.excess(inputs), 0.0)
        rows = (excess > FAR).any(axis=1)
        if not rows.any():
            return ""
        column = int(excess.max(axis=0).argmax())
        row = int(excess[:, column].argmax())
        kelvin = " (these look like kelvin)" if np.nanmin(values[known]) > 150 else ""
        value, lowest, highest = values[row, column], self.lowest[column], self.highest[column]
        return (
            f"{rows.sum()} of {len(rows)} rows have temperatures far outside those that the mapper was trained on: "
            f"{self.names[column]!r} is {value:.4g} in row {row}, trained from {lowest:.4g} to {highest:.4g}; expected "
            f"degrees Celsius{kelvin}, and records of such weather to train on"
        )


def mapper_inputs(mapper: Any, T: Any) -> Any:
    """Inputs of the last step of a fitted mapper, such as lagged temperatures."""
    mapper = getattr(mapper, "best_estimator_", mapper)
    return mapper[:-1].transform(T) if isinstance(mapper, Pipeline) and len(mapper) > 1 else T


def last_step(mapper: Any) -> Any:
    """The step of a fitted mapper that learns from the inputs that `mapper_inputs` gives."""
    mapper = getattr(mapper, "best_estimator_", mapper)
    return mapper[-1] if isinstance(mapper, Pipeline) else mapper
