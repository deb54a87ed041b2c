"""Replicates: structures that could have given the training records of a chain, each in weather of its own."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skthermo._estimators.warnings import warn_user, without_warnings
from skthermo._tables.arrays import Array, as_floats, positive_integer
from skthermo._tables.frames import Table, column_names, frame_like, has_stamps, row_times
from skthermo.exceptions import ResultWarning
from skthermo.fem import FEModel
from skthermo.surrogate import FittedChain, refitted, resampled
from skthermo.updating import ModelUpdater

DEVIATION = 0.005  # relative, of measured mean frequencies from those of a perfect model
SPREAD = 0.15  # relative deviation of stiffnesses before anything is measured
HALF_WIDTH = 0.6  # of the box in which stiffnesses are looked for


def drawn_models(fem: FittedChain, number: int, seed: int) -> list[FEModel]:
    """Models calibrated to the mean of the training records, as far as these determine stiffnesses."""
    mean = np.nanmean(as_floats(fem.records_.frequencies), axis=0)
    with without_warnings():
        try:
            updater = ModelUpdater(fem.model, bounds=HALF_WIDTH, prior=SPREAD).fit(mean, frequency_std=DEVIATION * mean)
            return list(updater.sample_models(number, spread=SPREAD, random_state=seed))
        except (AttributeError, TypeError, ValueError) as error:
            raise ValueError(
                f"other models like {fem.model!r:.200} cannot be drawn from the training records ({error}); expected "
                "models=[...], or uncertainty without 'model', such as ('noise', 'baseline', 'weather')"
            ) from error


def checked_models(fem: FittedChain, models: Any) -> list[FEModel]:
    """Models that a chain can be refitted with, or an error."""
    if isinstance(models, str) or not isinstance(models, Sequence) or not len(models):
        raise ValueError(
            f"models is {models!r:.200}; expected a list of FE models, as ModelUpdater.sample_models gives"
        )
    wanted = list(fem.model.parameter_names), fem.model.n_modes
    for number, model in enumerate(models):
        found = list(getattr(model, "parameter_names", [])), getattr(model, "n_modes", None)
        if found != wanted:
            raise ValueError(
                f"model {number} of models is {model!r:.200} with parameters {found[0]} and {found[1]} modes; expected "
                f"the chain's {wanted[0]} and {wanted[1]} modes"
            )
    return list(models)


DAY = 24 * 3600e9  # ns
YEAR = 365  # days, so that seasons and whole days are kept
WEEKS = 52  # blocks of rows without stamps, which count as a year
BLOCK = 7  # days that stay together
SEASON = 15  # days by which a block may be earlier or later in the year


def resampled_days(T: Table, random: np.random.RandomState) -> Table:
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


def other_years(T: Sequence[Table]) -> list[FEModel]:
    """Every year of weather on the stamps of the first: row by row, or matched by the time of the year."""
    first = T[0]
    return [first, *(_on_stamps_of(first, one, number) for number, one in enumerate(T[1:], start=1))]


def _on_stamps_of(first: Table, other: Table, number: int) -> Table:
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


PARTS = ("noise", "weather", "baseline", "model")
"""What a replicate draws, in the order in which one is added to the others."""

ALL, AUTO = "all", "auto"
N_DRAWS = 2  # draws of the noise in each replicate, to separate its share from that of what else varies
FEWEST_REPLICATES = 2
LARGEST_SEED = np.iinfo(np.int32).max


@dataclass(frozen=True, eq=False)
class Replicates:
    """What may vary beside the noise, ``parts``; years of weather, of which the first is that of the study; models.

    Every replicate is drawn from its own seed alone. Without "noise" among what varies, all replicates have the same.
    """

    fem: FittedChain
    parts: Sequence[str]
    with_noise: bool
    years: Sequence[Table]
    models: Sequence[FEModel]
    seeds: Sequence[int]

    @classmethod
    def of(
        cls, fem: FittedChain, uncertainty: str | Sequence[str], T: Table, models: Any, number: Any, seed: Any
    ) -> Replicates:
        """So many replicates in which the named parts vary; without models, these are drawn from the training
        records."""
        asked = checked_parts(uncertainty, with_models=models is not None)
        years = other_years(T) if isinstance(T, list | tuple) and len(T) and np.ndim(T[0]) == 2 else [T]
        if positive_integer(number, "n_replicates") < FEWEST_REPLICATES:
            raise ValueError(
                f"n_replicates is {number}; expected at least {FEWEST_REPLICATES}, 10 or more for bands of 90 %"
            )
        random = np.random.RandomState(seed)
        seeds = random.randint(LARGEST_SEED, size=number + 1)
        if models is not None:
            models = checked_models(fem, models)
            if "model" not in asked:
                raise ValueError(
                    f"models came, but uncertainty is {uncertainty!r}; expected 'model' among it, 'auto' or 'all'"
                )
        elif "model" in asked:
            models = _models_of(fem, number, int(seeds[-1]), is_needed=not _is_all(uncertainty))
        varied = [part for part in PARTS[1:] if part in asked and (part != "model" or models)]
        return cls(fem, varied, "noise" in asked, years, models or [], [int(one) for one in seeds[:-1]])

    def replicate(self, number: int) -> Iterator[tuple[str, FittedChain, Table]]:
        """One part after the other, with a chain and temperatures in which it and those before vary.

        Other training records are those that the chain's structure could have given as well in the same weather.
        """
        weather, records = np.random.RandomState(self.seeds[number]).randint(LARGEST_SEED, size=2)
        chain, T, n_years = self.fem, self.years[0], len(self.years)
        for part in self.parts:
            if part == "weather":
                T = self.years[number % n_years] if n_years > 1 else resampled_days(T, np.random.RandomState(weather))
            elif part == "baseline":
                chain = resampled(self.fem, int(records))
            else:
                chain = refitted(self.fem, model=self.models[number % len(self.models)])
                chain = resampled(chain, int(records)) if "baseline" in self.parts else chain
            yield part, chain, T

    def predicted_time(self, seconds: float, n_repeats: int, share: float) -> str:
        """How long up to so many repeats and all replicates take, if one repeat takes so many seconds, and a draw of a
        replicate a share of them."""
        text = f"up to {n_repeats} more repeats take about {n_repeats * seconds:.1f} s of one core"
        if self.parts:
            n_evaluated = N_DRAWS * len(self.parts) * len(self.seeds)
            text += f", {len(self.seeds)} replicates about {n_evaluated * share * seconds:.1f} s"
        return text + (", and the refits of their chains" if "model" in self.parts else "")

    def noise_levels(self, number: int) -> Array:
        """Factors of the noise of each mode, (n_modes,), which the training records determine up to an error."""
        errors = self.fem.recorder_.residuals.level_errors
        return np.exp(errors * np.random.RandomState([self.seeds[number], 1]).standard_normal(len(errors)))

    def fault_stream(self, number: int) -> np.random.RandomState:
        """Random numbers of the gaps and outliers that other training records have."""
        return np.random.RandomState([self.seeds[number], 2])


def _models_of(fem: FittedChain, number: int, seed: int, is_needed: bool) -> list[FEModel]:
    """Models drawn from the training records; none, with a warning, where they cannot be drawn and need not."""
    try:
        return drawn_models(fem, number, seed)
    except ValueError as error:
        if is_needed:
            raise
        warn_user(f"bands do not include the error of the model: {error}", ResultWarning, "bands-without-models")
        return []


def checked_parts(uncertainty: str | Sequence[str], with_models: bool = False) -> list[str]:
    """What varies, or an error; "auto" is all but models, and models too where they are given."""
    if _is_all(uncertainty) or (isinstance(uncertainty, str) and uncertainty == AUTO and with_models):
        return list(PARTS)
    if isinstance(uncertainty, str) and uncertainty == AUTO:
        return list(PARTS[:-1])
    is_one = isinstance(uncertainty, str | Mapping) or not isinstance(uncertainty, Iterable)
    asked = [uncertainty] if is_one else list(uncertainty)
    if not asked or not all(isinstance(part, str) and part in PARTS for part in asked):
        raise ValueError(f"uncertainty is {uncertainty!r:.200}; expected 'auto', 'all', or some of {list(PARTS)}")
    return asked


def _is_all(uncertainty: str | Sequence[str]) -> bool:
    return isinstance(uncertainty, str) and uncertainty == ALL
