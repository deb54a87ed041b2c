"""Likelihood of healthy records, in the units of the measurement whatever a compensator before has made of them."""

from collections.abc import Callable
from typing import Any
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array
from skthermo.exceptions import UnevaluatedRowsWarning

_volumes: dict[int, tuple[ref, tuple[int, ...], Callable[[], Array]]] = {}
"""Arrays by the address of their numbers while they exist, their shapes, and the `log_volumes` of their rows."""


def with_log_volumes(values: Array, volumes: Callable[[], Array]) -> Array:
    """The array, of which `log_volumes` knows by which factors a transformation has changed the volume of each row.

    The factors are computed if they are asked for.
    """
    address = _address(values)
    _volumes[address] = ref(values, lambda _: _volumes.pop(address, None)), values.shape, volumes
    return values


def log_volumes(table: Any) -> Array:
    """Logarithms of those factors, also of a frame of the array; zero where none are known."""
    values = np.asarray(table)
    _, shape, volumes = _volumes.get(_address(values), (None, None, None))
    return np.zeros(len(values)) if volumes is None or shape != values.shape else volumes()


def mean_log_density(densities: Array, present: NDArray[np.bool_]) -> float:
    """Mean over the values that are there, from the logarithm of the density of each row; NaN without any value.

    A warning says so where most rows have none.
    """
    known = present.any(axis=1)
    if 2 * known.sum() < len(known):
        warn_user(
            f"the score is of {known.sum()} of {len(known)} rows: the others have no value. Compare scores of the same "
            "rows only",
            UnevaluatedRowsWarning,
            "rows-not-scored",
        )
    return float(densities[known].sum() / present.sum()) if known.any() else float("nan")


def _address(values: NDArray) -> int:
    address: int = values.__array_interface__["data"][0]
    return address
