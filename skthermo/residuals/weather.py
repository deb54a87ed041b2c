"""Weather of records: its range, and similar records."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.decomposition import PCA
from sklearn.neighbors import NearestNeighbors
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from skthermo._core.arrays import Array, as_floats, means_of_known
from skthermo._core.frames import column_names
from skthermo.exceptions import SkthermoWarning, UnevaluatedRowsWarning, WeatherWarning

FAR_OUTSIDE = 0.25  # ranges of the training temperatures beyond which a temperature counts as unknown weather
NUMBERS_AT_ONCE = 4_000_000  # held in memory
BEYOND = 0.05  # ranges of the other folds' temperatures, outside which they have not seen a record's weather


@dataclass(frozen=True)
class TrainingRange:
    """Lowest and highest value of every input of the rows that trained a mapper."""

    lowest: Array
    highest: Array
    names: Sequence[Any]

    @classmethod
    def spanned(cls, inputs: Any, trained: Array) -> TrainingRange:
        """The range of a mapper's inputs, over the rows that trained it."""
        values = as_floats(inputs)[trained]
        return cls(np.fmin.reduce(values), np.fmax.reduce(values), column_names(inputs, "T"))

    def excess(self, inputs: Any) -> Array:
        """How far each value is outside, in units of the range of its column; 0 inside, NaN where it is missing."""
        values = as_floats(inputs)
        beyond = np.maximum(np.maximum(self.lowest - values, values - self.highest), 0.0)
        return beyond / self.width + np.where(np.isnan(values), np.nan, 0.0)

    @property
    def width(self) -> Array:
        """Width of each column, 1 where it is constant."""
        width = self.highest - self.lowest
        return np.where(width > 0, width, 1.0)

    def ends(self, values: Array) -> Array:
        """How far each row is below and above, by its farthest column, (n_rows, 2); 0 where a value is missing."""
        excess = np.nan_to_num(self.excess(values))
        sides = values < self.lowest, values > self.highest
        return np.column_stack([np.where(side, excess, 0.0).max(axis=1) for side in sides])

    def doubts(self, inputs: Any) -> list[WeatherWarning]:
        """The finding that rows are far outside the range, in units of it."""
        values = as_floats(inputs)
        known = values[~np.isnan(values).any(axis=1)]
        far = (np.nan_to_num(self.excess(known)) > FAR_OUTSIDE).any(axis=0)
        if not far.any():
            return []
        names = ", ".join(repr(name) for name, is_far in zip(self.names, far, strict=True) if is_far)
        kelvin = " (these look like kelvin)" if np.nanmin(known) > 150 else ""
        return [
            WeatherWarning(
                f"temperatures are outside the training range by more than {FAR_OUTSIDE:.0%} of it: {names}. "
                f"Predictions there are extrapolated (extrapolation_distance says how far). Give degrees Celsius"
                f"{kelvin}, or train on such weather",
                "other-weather",
            )
        ]


@dataclass(frozen=True)
class Extrapolation:
    """How residuals scatter outside the weather that a regression has learned.

    Where the farthest input of a record is e ranges below the lowest value of the baseline, or above the highest, the
    variance of its residuals is 1 + growth ln(1 + e^2) times the one inside; ``growth``, (2,), has a value for each
    end.
    """

    reach: TrainingRange
    growth: Array

    @classmethod
    def learned(
        cls,
        reach: TrainingRange,
        weather: Array,
        residuals_of: Callable[[NDArray[np.intp], NDArray[np.intp]], Array],
        *,
        usual: float = 9.0,
    ) -> Extrapolation:
        """Learn from the coldest and from the warmest fifth of the records of a range.

        ``residuals_of(others, fifth)`` are residuals of records, in their usual standard deviations, by a regression on
        the others. The usual growth has the weight of a record at 0.6 ranges.
        """
        warmth = means_of_known((weather - reach.lowest) / reach.width, axis=1)
        coldest_first = np.argsort(warmth)[: (~np.isnan(warmth)).sum()]
        n_apart, growth = len(coldest_first) // 5, np.full(2, usual)
        for end, order in enumerate((coldest_first, coldest_first[::-1])):
            fifth, others = np.sort(order[:n_apart]), np.sort(order[n_apart:])
            if not n_apart:
                continue
            added = np.log1p(TrainingRange.spanned(weather, others).ends(weather[fifth])[:, end] ** 2)
            excess = means_of_known(residuals_of(others, fifth) ** 2, axis=1) - 1
            known = ~np.isnan(excess)
            growth[end] = max((added[known] @ excess[known] + 0.1 * usual) / (added[known] @ added[known] + 0.1), 0.0)
        return cls(reach, growth)

    def variances(self, weather: Any) -> Array:
        """Variance of the residuals of each row, in terms of the one inside; unknown weather counts as inside."""
        return 1 + np.log1p(self.reach.ends(as_floats(weather)) ** 2) @ self.growth


def unseen_weather(weather: Any, folds: NDArray[np.intp], consequence: str) -> list[WeatherWarning]:
    """The finding that a fold has many records in weather that the other folds, from 0, have not seen.

    That is a tenth of its records, and at least ten.
    """
    values, names = as_floats(weather), column_names(weather, "T")
    found = np.zeros(values.shape[1], dtype=bool)
    for fold in np.unique(folds[folds >= 0]):
        test = folds == fold
        outside = np.nan_to_num(TrainingRange.spanned(weather, ~test).excess(values[test])) > BEYOND
        n_outside = outside.any(axis=1).sum()
        if n_outside >= 10 and n_outside > 0.1 * test.sum():
            found |= outside.any(axis=0)
    if not found.any():
        return []
    listed = ", ".join(repr(name) for name, is_found in zip(names, found, strict=True) if is_found)
    return [
        WeatherWarning(
            f"records of a fold are in weather that the other folds lack: {listed}. {consequence}. Train on a whole "
            "year, in folds that each have all seasons, such as blocks of a week",
            "other-weather",
        )
    ]


def unpredicted_findings(unknown: NDArray[np.bool_], weather: Array) -> list[SkthermoWarning]:
    """The finding of rows that cannot be predicted, for want of weather or of earlier records."""
    if not unknown.any():
        return []
    empty = np.isnan(weather).all(axis=1)
    causes = {
        "without any temperature": (unknown & empty, "A row needs a temperature of at least one sensor"),
        "with lags that reach to no record": (unknown & ~empty, "Lags need the records before a row: give these, too"),
    }
    found = {cause: need for cause, (rows, need) in causes.items() if rows.any()}
    text = f"rows {', and rows '.join(found)} cannot be predicted and are NaN. {'. '.join(found.values())}"
    return [UnevaluatedRowsWarning(text, "not-evaluated")]


def weather_coordinates(weather: Array, explained: float = 0.99) -> Pipeline:
    """Principal components of the standardised weather, in which similar records are near each other."""
    with np.errstate(divide="ignore", invalid="ignore"):  # of weather that is always the same
        return make_pipeline(StandardScaler(), PCA(explained)).fit(weather)


def nearest_in_parts(
    places: Array, wanted: Array, number: int, n_columns: int = 1
) -> Iterator[tuple[slice, NDArray[np.intp]]]:
    """Positions of the nearest places, nearest first, for some of the wanted ones after others: memory is bounded, also
    where each place has several columns."""
    number = min(number, len(places))
    tree = NearestNeighbors(n_neighbors=number).fit(places)
    for part in parts(len(wanted), number * n_columns):
        yield part, tree.kneighbors(wanted[part], return_distance=False)


def mean_of_nearest(places: Array, values: Array, used: Array, wanted: Array, number: int) -> Array:
    """Mean of each column's values at the places nearest to each wanted one, among those where the column is used.

    One search for all columns, of a quarter more places than a column with gaps in a third of them needs, finds enough
    places for most rows; the others have a search for each column.
    """
    means, shares = np.full((len(wanted), values.shape[1]), np.nan), used.mean(axis=0) if len(used) else np.zeros(0)
    if not len(places):
        return means
    enough = number if shares.min() == 1 else int(np.ceil(1.25 * number / max(shares.min(), 1 / 3)))
    filled = np.where(used, values, 0.0)
    for part, near in nearest_in_parts(places, wanted, enough, n_columns=values.shape[1]):
        known = used[near]
        known &= known.cumsum(axis=1, dtype=np.int32) <= number
        is_enough = known.sum(axis=1) == number
        means[part] = np.where(is_enough, np.einsum("nkm,nkm->nm", filled[near], known) / number, np.nan)
    for column, is_used in enumerate(used.T):
        few = np.flatnonzero(np.isnan(means[:, column]))
        if is_used.any() and len(few):
            own = values[is_used, column]
            for part, near in nearest_in_parts(places[is_used], wanted[few], number):
                means[few[part], column] = own[near].mean(axis=1)
    return means


def parts(n_rows: int, numbers_per_row: int) -> Iterator[slice]:
    """Slices of rows that need little memory each."""
    step = max(NUMBERS_AT_ONCE // int(numbers_per_row), 1)
    for first in range(0, n_rows, step):
        yield slice(first, min(first + step, n_rows))


def one_in_each_part(n_records: int, most: int) -> NDArray[np.intp]:
    """Positions of all records or, if there are more, of one by chance in each of that many equal parts of them.

    Records at equal distances could all be of the same hour.
    """
    if n_records <= most:
        return np.arange(n_records)
    shares = np.arange(most) + np.random.RandomState(0).uniform(size=most)
    return (shares * n_records / most).astype(np.intp)
