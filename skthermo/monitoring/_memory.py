"""How far back a fitted detector looks: lags, windows, and both one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, is_dataclass
from datetime import timedelta
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import BaseEstimator
from sklearn.pipeline import Pipeline

from skthermo._tables.arrays import is_model
from skthermo.preprocessing import HampelFilter

Path = tuple[tuple[int, int], ...]
"""Reaches of the steps on one way through a detector, the last step first: (rows, nanoseconds), one of them zero."""


@dataclass(frozen=True)
class Memory:
    """Which earlier records the evaluation of a record needs, on all ways from its records to its damage index."""

    paths: tuple[Path, ...]

    @classmethod
    def of(cls, detector: Any) -> Memory:
        """That of a fitted detector by ``lookback_`` of its parts: those in a row add up, of several ways all count."""
        return cls(tuple(sorted(_paths(detector, set()))))

    @classmethod
    def of_time(cls, duration: pd.Timedelta) -> Memory:
        return cls((((0, duration.value),),))

    def start(self, times: NDArray[np.int64], place: int, time: int | None = None) -> int:
        """Position of the earliest record that is needed for the one at a position, or at a time before it."""
        return min(_back(path, times, place, time) for path in self.paths)

    def duration(self, step: pd.Timedelta) -> pd.Timedelta:
        """The longest of all ways in time, of records that are so far apart."""
        return max(
            sum((n * step + pd.Timedelta(time, "ns") for n, time in path), pd.Timedelta(0)) for path in self.paths
        )

    def __str__(self) -> str:
        """The reaches in words, such as "30 h" or "24 records and 30 h"."""
        rows, time = (max(sum(reach[part] for reach in path) for path in self.paths) for part in (0, 1))
        words = [f"{rows} records"] if rows else []
        words += [f"{time / 3.6e12:.3g} h"] if time else []
        return " and ".join(words) or "nothing"


def _back(path: Path, times: NDArray[np.int64], place: int, time: int | None) -> int:
    for rows, duration in path:
        if rows:
            place, time = max(place - rows, 0), None
        else:
            moment = (times[place] if time is None else time) - duration
            place, time = int(np.searchsorted(times[:place], moment)), None
    return place


def _paths(part: Any, seen: set[int]) -> set[Path]:
    """Ways through a fitted part, each with the reaches on it."""
    if id(part) in seen:
        return {()}
    if isinstance(part, Pipeline):
        ways: set[Path] = {()}
        for _, step in reversed(part.steps):
            ways = {way + more for way in ways for more in _paths(step, seen)}
        return ways
    seen = seen | {id(part)}
    if isinstance(part, HampelFilter):
        raise ValueError(
            f"the detector holds {part!r:.100}, which compares records with later ones; expected steps that look back "
            "only: filter the baseline before fit"
        )
    if hasattr(part, "lookback_"):
        lookback = part.lookback_
        is_time = isinstance(lookback, np.timedelta64 | timedelta)
        reach = (0, pd.Timedelta(lookback).as_unit("ns").value) if is_time else (int(lookback), 0)
        return {(reach,)} if any(reach) else {()}
    found = set().union(*(_paths(inner, seen) for inner in _inner(part)))
    return found or {()}


def _inner(part: Any) -> Iterator[Any]:
    """Estimators and objects of which a part is made."""
    for value in list(getattr(part, "__dict__", {}).values()):
        values = value.values() if isinstance(value, Mapping) else value if isinstance(value, list | tuple) else [value]
        for one in values:
            for inner in one if isinstance(one, tuple) else (one,):
                made = isinstance(inner, BaseEstimator) or (is_dataclass(inner) and not isinstance(inner, type))
                if made and not is_model(inner):
                    yield inner
