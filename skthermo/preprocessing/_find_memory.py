"""Whether exponentially weighted means of earlier temperatures explain frequencies."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import (
    Array,
    means_of_known,
    median,
    piecewise_linear,
    robust_deviation,
    rows_by_pattern,
    spread_evenly,
)
from skthermo._core.estimators import check_array
from skthermo._core.frames import DAY, check_same_rows, column_names, columns_by_sensor, has_stamps
from skthermo._core.saved_frames import SavesFrames
from skthermo.preprocessing._past import ExponentialMeans, trailing_means
from skthermo.preprocessing._weather_lines import WeatherLines, predicted_by_weather, without_far
from skthermo.preprocessing.folds import out_of_fold

TIME_CONSTANTS = ("3h", "12h", "2D", "5D", "10D", "20D", "40D", "60D")


@dataclass(frozen=True, repr=False)
class MemoryFindings(SavesFrames):
    """Result of `find_memory`.

    Parameters
    ----------
    table : DataFrame
        A row for each ``time_constant`` and ``mode``: the ``sensor`` whose mean explains most, mean absolute
        out-of-fold errors of the frequencies without and with this mean (``error_without``, ``error_with``, in their
        unit), the share by which they ``fall``, and whether the mean is ``chosen``.
    features : ExponentialMeans or None
        The transformer to put before a `~skthermo.surrogate.TemperatureMapper`; None where nothing is gained.
    fall : float
        Share by which the out-of-fold error falls by the chosen means, on average over the modes.

    Examples
    --------
    >>> from skthermo.preprocessing import find_memory
    >>> memory = find_memory([[4.0], [5.0]], [[2.1], [2.0]])
    >>> print(memory.summary())
    Earlier temperatures explain no more of the frequencies: their means do not lower the error in periods held out.
    >>> memory.fall
    0.0
    """

    table: pd.DataFrame
    features: ExponentialMeans | None
    fall: float

    def summary(self) -> str:
        """The result in a sentence.

        Returns
        -------
        str
            The means that explain the frequencies, and by how much the error falls.
        """
        if self.features is None:
            return (
                "Earlier temperatures explain no more of the frequencies: their means do not lower the error in "
                "periods held out."
            )
        means = " and ".join(f"{one} of {self._sensors}" for one in self.features.time_constants)
        return (
            "The frequencies depend on earlier temperatures: exponentially weighted means over "
            f"{means} lower the error in periods held out by {self.fall:.0%}."
        )

    @property
    def _sensors(self) -> str:
        return " and ".join(repr(one) for one in self.features.sensors)

    def __repr__(self) -> str:
        return self.summary()


def find_memory(temperatures: ArrayLike, frequencies: ArrayLike) -> MemoryFindings:
    """Look whether exponentially weighted means of earlier temperatures explain frequencies.

    Parameters
    ----------
    temperatures : array-like or DataFrame of shape (n_samples, n_sensors)
        In degrees Celsius; NaN is allowed.
    frequencies : array-like or DataFrame of shape (n_samples, n_modes)
        Of the healthy structure, in Hz, or another quantity that follows the weather; NaN is allowed. A mode with fewer
        than 100 values does not count, where others have more.

    Returns
    -------
    MemoryFindings
        Its ``features`` is the transformer to put in, or None; ``summary()`` is a sentence.

    Raises
    ------
    ValueError
        If the tables differ in length or index, repeat the name of a column, or hold something that is no real number
        or is infinite.

    See Also
    --------
    ExponentialMeans : The transformer.
    check_records : Faults of the records.

    Notes
    -----
    A mean is chosen if it lowers the mean absolute out-of-fold error of a piecewise-linear regression on the weather
    enough, by the rules of :doc:`/guide/records_theory`. Nothing is looked for in records without a DatetimeIndex.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from skthermo.preprocessing import ExponentialMeans, find_memory
    >>> random, days = np.random.default_rng(0), pd.date_range("2023-01-01", periods=1000)
    >>> season = 10 - 10 * np.cos(2 * np.pi * np.arange(1000) / 365.25)
    >>> air = pd.DataFrame({"air": season + 4 * random.standard_normal(1000)}, days)
    >>> soil = ExponentialMeans(["40D"]).fit_transform(air)["air_mean40D"]
    >>> f = pd.DataFrame({"f1": 4 - 0.004 * air["air"] - 0.008 * soil + 0.01 * random.standard_normal(1000)})
    >>> memory = find_memory(air[270:], f[270:])
    >>> round(memory.fall, 1)
    0.7
    >>> memory.features
    ExponentialMeans(sensors=['air'], time_constants=['40D'])
    """
    check_same_rows(temperatures, frequencies, ("temperatures", "frequencies"))
    T = check_array(temperatures, dtype=np.float64, input_name="temperatures")
    F = check_array(frequencies, dtype=np.float64, input_name="frequencies")
    nothing = MemoryFindings(_memory_table([]), None, 0.0)
    if not has_stamps(temperatures):
        return nothing
    stamps = temperatures.index.as_unit("ns").asi8
    order = np.argsort(stamps, kind="stable")
    first = {name: columns[0] for name, columns in columns_by_sensor(temperatures).items()}
    T, F = T[np.ix_(order, list(first.values()))], F[order]
    is_known = ~np.isnan(F) & ~np.isnan(T).all(axis=1)[:, np.newaxis]
    is_scarce = is_known.sum(axis=0) < 100  # too few values to count
    F = np.where(is_scarce & ~is_scarce.all(), np.nan, F)
    usable = np.flatnonzero(is_known[:, ~is_scarce | is_scarce.all()].any(axis=1))
    if len(usable) < 100:
        return nothing
    return MemorySearch(stamps[order], T, F, usable).findings(list(first), column_names(frequencies, "f"))


class MemorySearch:
    """Inputs in rows: the weather, a straight line and a step in time, and the means that are tried.

    Rows are in order of time, at most 3000 of them, in five contiguous folds, so that a season is predicted from
    others. A mean has the positions of its time constant and its sensor as a key.
    """

    def __init__(self, times: NDArray[np.int64], T: Array, F: Array, usable: NDArray[np.intp]):
        rows = spread_evenly(usable, 3000)
        self.ages, self.folds = (times[rows] - times[0]) / DAY.value, np.arange(len(rows)) * 5 // len(rows)
        self.has_all_seasons = pd.Timedelta(np.ptp(times), "ns") >= pd.Timedelta(days=270)
        _, inputs = WeatherLines.learned(T).inputs(T[rows])
        left = F[rows] - predicted_by_weather(inputs, F[rows], self.folds)
        self.scale = robust_deviation(left)
        self.values = without_far(F[rows] - median(F[rows]), left) / np.where(self.scale > 0, self.scale, np.inf)
        self.blocks: dict[Any, Array] = {"weather": inputs, "time": _time_shapes(without_far(left, left))}
        self.means: dict[int, list[tuple[int, int]]] = {}  # keys of each time constant
        sensors = spread_evenly(np.flatnonzero(~np.isnan(T).all(axis=0)), 8)
        for i, one in enumerate(TIME_CONSTANTS):
            constant = pd.Timedelta(one).as_unit("ns").value
            if np.median(np.diff(times)) <= constant <= np.ptp(times) / 4:
                averages = trailing_means(times, T[:, sensors], constant)[rows]
                tried = {
                    (i, int(sensor)): lines_of(column)
                    for sensor, column in zip(sensors, averages.T, strict=True)
                    if np.ptp(column) > 0  # False for NaN
                }
                self.blocks |= tried
                self.means[i] = list(tried)

    def distances(self, known: Sequence[Any], tried: Sequence[Any] = ()) -> Array:
        """Distances from predictions out of fold by known blocks, and by these with each block that is tried: (n_rows,
        1 + n_tried, n_modes), relative to the scale of the mode."""
        widths = [self.blocks[key].shape[1] for key in (*known, *tried)]
        columns = np.split(np.arange(sum(widths)), np.cumsum(widths)[:-1])
        base = np.concatenate(columns[: len(known)])
        sets = [base, *(np.concatenate([base, own]) for own in columns[len(known) :])]
        inputs = np.hstack([self.blocks[key] for key in (*known, *tried)])
        return np.abs(self.values[:, np.newaxis] - predicted_by_ridge(inputs, self.values, self.folds, sets))

    def errors(self, distances: Array, after: float = 0.0) -> Array:
        """Means of distances, (n_rows, n_modes), by fold and mode, from a number of days after the first record on."""
        distances = np.where(self.ages[:, np.newaxis] >= after, distances, np.nan)
        return np.array([means_of_known(distances[self.folds == fold]) for fold in range(5)])

    def chosen(self, first: dict[int, Array]) -> list[tuple[int, int]]:
        """At most two means of one sensor that lower the error clearly, in nearly every part of the records, and
        beside a straight line and a step in time; ``first`` has the distances of each time constant's means alone.

        Records of the first two time constants do not count: their means lack the weather before.
        """
        chosen: list[tuple[int, int]] = []
        while len(chosen) < 2:
            found = []
            for i, tried in self.means.items():
                tried = [one for one in tried if not chosen or (one[1] == chosen[0][1] and one not in chosen)]
                constant, known = pd.Timedelta(TIME_CONSTANTS[i]), ["weather", *chosen]
                after, least = 2 * (constant / DAY), self.least_fall(constant)
                if not tried:
                    continue
                distances = self.distances(known, tried) if chosen else first[i]
                without = self.errors(distances[:, 0], after)
                for place, mean in enumerate(tried, start=1):
                    fall, worst = _fall(without, self.errors(distances[:, place], after))
                    if fall >= least and worst <= 1:
                        beside = self.distances([*known, "time"], [mean])
                        if _fall(*(self.errors(beside[:, n], after) for n in (0, 1)))[0] >= 0.5 * fall:
                            found.append((fall, mean))
            if not found:
                break
            chosen.append(max(found)[1])
        return chosen

    def least_fall(self, constant: pd.Timedelta) -> float:
        """Share by which an error has to fall: more by means that can follow a season, a trend or a step."""
        if constant > DAY and not self.has_all_seasons:  # it extrapolates to other seasons
            return 0.25
        return 0.15 if is_of_weeks(constant) else 0.05

    def findings(self, sensors: list[Hashable], modes: list[Hashable]) -> MemoryFindings:
        """What is chosen, as a table and a transformer."""
        first = {i: self.distances(["weather"], tried) for i, tried in self.means.items() if tried}
        chosen = self.chosen(first)
        without = self.errors(self.distances(["weather"])[:, 0])
        before, table = means_of_known(without), []
        for i, distances in first.items():
            errors = np.array([means_of_known(self.errors(one)) for one in np.moveaxis(distances, 1, 0)[1:]])
            with np.errstate(invalid="ignore", divide="ignore"):  # of modes without an error
                ratios = errors / before
            means = self.means[i]
            place = next((n for n, mean in enumerate(means) if mean in chosen), int(np.nansum(ratios, axis=1).argmin()))
            columns = modes, before * self.scale, errors[place] * self.scale, 1 - ratios[place]
            about = sensors[means[place][1]], means[place] in chosen
            table += [[TIME_CONSTANTS[i], about[0], *row, about[1]] for row in zip(*columns, strict=True)]
        features = None
        if chosen:
            constants = [TIME_CONSTANTS[i] for i, _ in sorted(chosen)]
            features = ExponentialMeans(constants, sensors=[sensors[chosen[0][1]]])
        last = self.errors(self.distances(["weather", *chosen])[:, 0])
        return MemoryFindings(_memory_table(table), features, _fall(without, last)[0])


def is_of_weeks(constant: pd.Timedelta) -> bool:
    """Whether a mean with this time constant can follow a season, a trend or a step."""
    return constant >= pd.Timedelta(days=5)


def _memory_table(rows: list[list[Any]]) -> pd.DataFrame:
    columns = ["time_constant", "sensor", "mode", "error_without", "error_with", "fall", "chosen"]
    return pd.DataFrame(rows, columns=columns)


def lines_of(column: Array) -> Array:
    """Piecewise-linear functions of a standardised column."""
    standard = ((column - column.mean()) / column.std())[:, np.newaxis]
    return piecewise_linear(standard, np.quantile(standard, (0.25, 0.5, 0.75), axis=0))


def _time_shapes(left: Array) -> Array:
    """A straight line, and the step that explains most of residuals, (n_samples, 2)."""
    place = np.arange(len(left)) / len(left)
    shapes = (place[:, np.newaxis] >= np.arange(1, 24) / 24).astype(float)
    shapes -= shapes.mean(axis=0)
    deviation = robust_deviation(left)
    standard = np.nan_to_num((left - median(left)) / np.where(deviation > 0, deviation, np.inf))
    explained = ((shapes.T @ standard) ** 2).sum(axis=1) / (shapes**2).sum(axis=0)
    return np.column_stack([place - 0.5, shapes[:, explained.argmax()]])


def _fall(before: Array, after: Array) -> tuple[float, float]:
    """Share by which errors, (n_folds, n_modes), fall on average over the modes; ratio where they fall least.

    What is not known in a fold is NaN in both.
    """
    known = ~np.isnan(before) & (before > 0)
    if not known.any():
        return 0.0, np.inf
    modes, sums = known.any(axis=0), np.where(known, [before, after], 0.0).sum(axis=1)
    ratios = np.divide(after, before, out=np.full(before.shape, np.nan), where=known)[known.any(axis=1)]
    return 1 - float(np.mean(sums[1, modes] / sums[0, modes])), float(np.nanmean(ratios, axis=1).max())


def products(inputs: Array, values: Array) -> tuple[Array, Array, Array]:
    """Products of inputs with inputs and with each mode, and the number of rows that have an input and a value:
    (n_modes, n_inputs, n_inputs), (n_modes, n_inputs) and (n_modes,). Sums of them are those of all rows."""
    n_modes, n_inputs = values.shape[1], inputs.shape[1]
    gram, targets, counts = np.zeros((n_modes, n_inputs, n_inputs)), np.zeros((n_modes, n_inputs)), np.zeros(n_modes)
    usable = ~np.isnan(inputs).any(axis=1)
    for known, modes in rows_by_pattern(~np.isnan(values.T) & usable):
        X = inputs if known.all() else inputs[known]
        gram[modes], counts[modes] = X.T @ X, len(X)
        targets[modes] = (X.T @ values[np.ix_(known, modes)]).T
    return gram, targets, counts


def ridge_of_sets(gram: Array, targets: Array, counts: Array, sets: Sequence[Sequence[int]] | None = None) -> Array:
    """Ridge coefficients of each mode, (n_modes, n_inputs), from `products`; the first input is a constant.

    With sets of inputs, each of which begins with the constant, the result is (n_sets, n_modes, n_inputs), zero for
    inputs that a set has not.
    """
    n_inputs = gram.shape[-1]
    penalty = np.tile(1e-4 * np.maximum(counts, 1.0)[:, np.newaxis], n_inputs)
    penalty[:, 0] = 1e-9
    penalised = gram + penalty[..., np.newaxis] * np.eye(n_inputs)
    if sets is None:
        return np.linalg.solve(penalised, targets[..., np.newaxis])[..., 0]
    coefficients = np.zeros((len(sets), *targets.shape))
    for own, columns in zip(coefficients, sets, strict=True):
        part = penalised[:, np.asarray(columns)[:, np.newaxis], columns]
        own[:, columns] = np.linalg.solve(part, targets[:, columns, np.newaxis])[..., 0]
    return coefficients


def predicted_by_ridge(
    inputs: Array, values: Array, folds: NDArray[np.intp], sets: Sequence[Sequence[int]] | None = None
) -> Array:
    """Values of each fold, predicted by `ridge_of_sets` from the other folds; with sets, (n_samples, n_sets,
    n_modes)."""
    n_folds = folds.max() + 1
    of_folds = [products(inputs[folds == fold], values[folds == fold]) for fold in range(n_folds)]
    by_fold = [np.stack(parts) for parts in zip(*of_folds, strict=True)]

    def learn(train: NDArray[np.intp]):
        others = np.bincount(folds[train], minlength=n_folds) > 0
        coefficients = ridge_of_sets(*(np.tensordot(others, part, 1) for part in by_fold), sets)
        return lambda test: np.moveaxis(inputs[test] @ np.swapaxes(coefficients, -1, -2), -2, 0)

    return out_of_fold(learn, folds)
