"""Replicates: structures that could have given the training records of a chain, each in weather of its own."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import positive_integer
from skthermo.exceptions import ResultWarning
from skthermo.studies.replicates._models import checked_models, drawn_models
from skthermo.studies.replicates._weather import other_years, resampled_days

PARTS = ("noise", "weather", "baseline", "model")
"""What a replicate draws, in the order in which one is added to the others."""

ALL = "all"
LEAST_WORLDS = 2
LARGEST_SEED = np.iinfo(np.int32).max


@dataclass(frozen=True, eq=False)
class Replicates:
    """What may vary beside the noise, ``parts``; years of weather, of which the first is that of the study; models.

    Every replicate is drawn from its own seed alone. Without "noise" among what varies, all replicates have the same.
    """

    fem: Any
    parts: Sequence[str]
    with_noise: bool
    years: Sequence[Any]
    models: Sequence[Any]
    seeds: Sequence[int]

    @classmethod
    def of(cls, fem: Any, uncertainty: Any, T: Any, models: Any, number: Any, seed: Any) -> "Replicates":
        """So many replicates in which the named parts vary; without models, these are drawn from the training
        records."""
        asked = checked_parts(uncertainty)
        years = other_years(T) if isinstance(T, list | tuple) and len(T) and np.ndim(T[0]) == 2 else [T]
        if positive_integer(number, "n_replicates") < LEAST_WORLDS:
            raise ValueError(
                f"n_replicates is {number}; expected at least {LEAST_WORLDS}, 20 or more for bands of 90 %"
            )
        random = np.random.RandomState(seed)
        seeds = random.randint(LARGEST_SEED, size=number + 1)
        if models is not None:
            models = checked_models(fem, models)
            if "model" not in asked:
                raise ValueError(
                    f"models came, but uncertainty is {uncertainty!r}; expected 'model' among it, or 'all'"
                )
        elif "model" in asked:
            models = _models_of(fem, number, int(seeds[-1]), is_needed=not _is_all(uncertainty))
        varied = [part for part in PARTS[1:] if part in asked and (part != "model" or models)]
        return cls(fem, varied, "noise" in asked, years, models or [], [int(one) for one in seeds[:-1]])

    def replicate(self, number: int) -> Iterator[tuple[str, Any, Any]]:
        """One part after the other, with a chain and temperatures in which it and those before vary.

        Other training records are those that the chain's structure could have given as well in the same weather.
        """
        weather, records = np.random.RandomState(self.seeds[number]).randint(LARGEST_SEED, size=2)
        chain, T, n_years = self.fem, self.years[0], len(self.years)
        for part in self.parts:
            if part == "weather":
                T = self.years[number % n_years] if n_years > 1 else resampled_days(T, np.random.RandomState(weather))
            elif part == "baseline":
                chain = self.fem.resampled(int(records))
            else:
                chain = self.fem.refitted(model=self.models[number % len(self.models)])
                chain = chain.resampled(int(records)) if "baseline" in self.parts else chain
            yield part, chain, T


def _models_of(fem: Any, number: int, seed: int, is_needed: bool) -> list[Any]:
    """Models drawn from the training records; none, with a warning, where they cannot be drawn and need not."""
    try:
        return drawn_models(fem, number, seed)
    except ValueError as error:
        if is_needed:
            raise
        warn_user(f"bands hold no error of the model: {error}", ResultWarning, "bands without models")
        return []


def checked_parts(uncertainty: Any) -> list[str]:
    """What varies, or an error."""
    if _is_all(uncertainty):
        return list(PARTS)
    is_one = isinstance(uncertainty, str | Mapping) or not isinstance(uncertainty, Iterable)
    asked = [uncertainty] if is_one else list(uncertainty)
    if not asked or not all(isinstance(part, str) and part in PARTS for part in asked):
        raise ValueError(f"uncertainty is {uncertainty!r:.200}; expected 'all', or some of {list(PARTS)}")
    return asked


def _is_all(uncertainty: Any) -> bool:
    return isinstance(uncertainty, str) and uncertainty == ALL
