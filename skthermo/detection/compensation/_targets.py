"""Which columns are frequencies."""

from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._frames import check_temperatures, frame_like, warn_of_markers
from skthermo._warnings import warn_user


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
        raise ValueError(f"targets is {targets}; expected names of columns or their indexes, not both")
    if len(set(positions)) < len(positions):
        raise ValueError(f"targets {targets} repeat a column; expected each once")
    if not 0 < len(positions) < n_columns:
        raise ValueError(
            f"targets are {len(positions)} of the {n_columns} columns of X; expected at least one, and at least one "
            "other column to predict them from"
        )
    return np.array(positions, dtype=np.intp)


def split_columns(X: Any, values: NDArray, targets: NDArray[np.intp]) -> tuple[Any, Any]:
    """The other columns and the targets, as frames if X is one."""
    columns = np.asarray(getattr(X, "columns", range(values.shape[1])), dtype=object)
    others = np.delete(np.arange(len(columns)), targets)
    temperatures, frequencies = (frame_like(X, values[:, part], columns[part]) for part in (others, targets))
    warn_of_markers(pd.DataFrame(frequencies, copy=False).set_axis(columns[targets], axis=1))
    try:
        check_temperatures(pd.DataFrame(temperatures, copy=False).set_axis(columns[others], axis=1))
    except ValueError as error:  # only a warning, as another column may be something else than a temperature
        warn_user(str(error), "temperatures")
    return temperatures, frequencies
