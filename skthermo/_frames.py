"""Tables of records: pandas frames in and out, and checks of rows and columns."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._arrays import as_floats
from skthermo._validation import _num_samples

PREFIXES = {"temperature": "T", "frequency": "f"}


def frame_like(X: Any, values: NDArray, columns: Sequence[str]) -> Any:
    """Values as a frame with X's index where X is a frame, else as they are."""
    if not isinstance(X, pd.DataFrame):
        return values
    return pd.DataFrame(values, index=X.index, columns=list(columns), copy=False)


def column_names(X: Any, default: str) -> list[str]:
    """Names of X's columns, for messages and outputs: a frame's own, else default1, default2, ..."""
    if isinstance(X, pd.DataFrame):
        return [str(name) for name in X.columns]
    return [f"{default}{i + 1}" for i in range(np.shape(X)[1])]


def check_columns(X: ArrayLike, what: str, *, varying: bool = False) -> None:
    """Refuse columns that hold no value, or (``varying``) only one value in two or more rows.

    Raises
    ------
    ValueError
        Names the column.
    """
    for name, column in zip(column_names(X, PREFIXES[what]), as_floats(X).T, strict=True):
        present = column[~np.isnan(column)]
        if not present.size:
            raise ValueError(f"{what} column {name!r} is NaN in all {len(column)} rows; expected values")
        if varying and len(column) > 1 and np.ptp(present) == 0:
            raise ValueError(
                f"{what} column {name!r} is constant ({present[0]:g} in all {present.size} rows with a value); "
                "expected one that varies: leave it out"
            )


def check_same_rows(X: Any, y: Any, names: tuple[str, str]) -> None:
    """Refuse two tables of different length or, where both are frames, of different index.

    Raises
    ------
    ValueError
        Names the first row that differs.
    """
    if _num_samples(X) != _num_samples(y):
        raise ValueError(
            f"{names[0]} has {_num_samples(X)} rows and {names[1]} {_num_samples(y)}; expected the same number"
        )
    if not isinstance(X, pd.DataFrame) or not isinstance(y, pd.DataFrame | pd.Series) or X.index.equals(y.index):
        return
    for row, (left, right) in enumerate(zip(X.index, y.index, strict=True)):
        if left != right:
            raise ValueError(
                f"{names[0]} and {names[1]} have different indices (row {row}: {left} and {right}); expected the same"
            )
