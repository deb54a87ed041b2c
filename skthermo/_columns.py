"""Columns that users choose, by name or by position."""

from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import NDArray


def check_positions_are_names(targets: Any, columns: Any) -> None:
    """Refuse integer targets where they could be names of columns as well as positions."""
    integers = all(isinstance(name, Integral) for name in (*columns, *targets))
    if integers and list(columns) not in ([], list(range(len(columns)))):
        raise ValueError(
            f"targets are the integers {list(targets)}, which may be names or positions of the columns {list(columns)}"
            "; expected columns named by text, or 0, 1, 2, ..."
        )


def positions_of(targets: Any, n_columns: int, names: NDArray[np.object_] | None) -> NDArray[np.intp]:
    """Positions of the targets, which are given by name or by position."""
    targets = list(targets)
    if targets and all(isinstance(target, str) for target in targets):
        if names is None:
            raise ValueError(f"targets are the names {targets}, but X has no column names; expected a frame or indexes")
        columns = list(names)
        unknown = [target for target in targets if columns.count(target) != 1]
        if unknown:
            raise ValueError(f"targets {unknown} are not columns of X, or more than one; expected some of {columns}")
        positions = [columns.index(target) for target in targets]
    elif all(isinstance(target, Integral) and not isinstance(target, bool) for target in targets):
        positions = [int(target) for target in targets]
        outside = [position for position in positions if not 0 <= position < n_columns]
        if outside:
            raise ValueError(f"targets {outside} are not columns of X; expected indexes from 0 to {n_columns - 1}")
    else:
        raise ValueError(f"targets is {targets}; expected names of columns, or integers that are their indexes")
    if len(set(positions)) < len(positions):
        raise ValueError(f"targets {targets} repeat a column; expected each once")
    if not 0 < len(positions) < n_columns:
        raise ValueError(
            f"targets are {len(positions)} of the {n_columns} columns of X; expected at least one, and at least one "
            "other column to predict them from"
        )
    return np.array(positions, dtype=np.intp)
