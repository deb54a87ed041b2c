"""Other years of weather, on the stamps of some records."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, as_floats
from skthermo._tables.frames import column_names, frame_like
from skthermo._tables.times import has_stamps, row_times

DAY = 24 * 3600e9  # ns
YEAR = 365  # days, so that seasons and whole days are kept
WEEKS = 52  # blocks of rows without stamps, which count as a year
BLOCK = 7  # days that stay together
SEASON = 15  # days by which a block may be earlier or later in the year


def resampled_days(T: Any, random: np.random.RandomState) -> Any:
    """The temperatures of other days of the same season for each row, whole weeks together, at the same time of day.

    Rows keep their stamps, so that onsets of damage and waits keep their meaning. Rows without stamps count as a year.
    """
    if len(T) < 2:
        return T
    times = row_times(T) / DAY if has_stamps(T) else np.arange(len(T)) * (WEEKS * BLOCK / max(len(T), 1))
    if has_stamps(T):
        times = times + (T.index[0].as_unit("ns").value % DAY) / DAY
    order = np.argsort(times, kind="stable")
    taken = np.empty(len(T), dtype=np.intp)
    taken[order] = order[_shifted(times[order], random)]
    return frame_like(T, as_floats(T)[taken])


def _shifted(times: Array, random: np.random.RandomState) -> NDArray[np.intp]:
    """For each of some times in days, in order, the position of the record so many whole days from it."""
    blocks = (np.floor(times).astype(int) + random.randint(BLOCK)) // BLOCK
    years = int((times[-1] - times[0]) // YEAR) + 1
    shifts = np.add.outer(YEAR * np.arange(-years, years + 1), np.arange(-SEASON, SEASON + 1)).ravel()
    wanted = times.copy()
    for block in np.unique(blocks):
        rows = np.flatnonzero(blocks == block)
        inside = shifts[(times[rows[0]] + shifts >= times[0]) & (times[rows[-1]] + shifts <= times[-1])]
        wanted[rows] += random.choice(inside)
    near, distances = _nearest(times, wanted)
    is_there = distances <= np.median(np.diff(times)) / 2 + 1e-9
    return np.where(is_there, near, np.arange(len(times)))


def _nearest(times: Array, wanted: Array) -> tuple[NDArray[np.intp], Array]:
    """Positions of the times, in order, that are nearest to wanted ones, and how far each is."""
    after = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    near = np.where(wanted - times[after - 1] <= times[after] - wanted, after - 1, after)
    return near, np.abs(times[near] - wanted)


def other_years(T: Sequence[Any]) -> list[Any]:
    """Every year of weather on the stamps of the first: row by row, or matched by the time of the year."""
    first = T[0]
    return [first, *(_on_stamps_of(first, one, number) for number, one in enumerate(T[1:], start=1))]


def _on_stamps_of(first: Any, other: Any, number: int) -> Any:
    """Another year of weather on the stamps of the first."""
    if np.ndim(other) != 2 or not len(other) or np.isnan(as_floats(other)).all():
        raise ValueError(f"year {number} of T is {other!r:.200}; expected a table of temperatures, as the first")
    names = [column_names(table, "T") for table in (first, other)]
    if names[0] != names[1]:
        raise ValueError(f"year {number} of T has the sensors {names[1]}; expected those of the first, {names[0]}")
    if len(first) == len(other):
        return frame_like(first, as_floats(other))
    if not (has_stamps(first) and has_stamps(other)):
        raise ValueError(
            f"year {number} of T has {len(other)} rows, the first {len(first)}; expected the same number, or stamps"
        )
    mine, theirs = (table.index.as_unit("ns").asi8 / DAY for table in (first, other))
    order = np.argsort(theirs, kind="stable")
    wanted = mine + YEAR * np.round((theirs.mean() - mine.mean()) / YEAR)
    near, distances = _nearest(theirs[order], wanted)
    far = distances > 1.0
    if far.any():
        raise ValueError(
            f"year {number} of T has no record within a day of the season of {far.sum()} of {len(first)} rows of the "
            "first; expected records of the same season"
        )
    return frame_like(first, as_floats(other)[order[near]])
