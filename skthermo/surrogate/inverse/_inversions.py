"""Inversions of the records that an inverse surrogate was fitted to, which its memory keeps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import joblib
import numpy as np
from joblib import Memory
from sklearn.utils import Bunch

from skthermo._tables.arrays import Array
from skthermo.surrogate._memory import content_of, folder_of, remembered
from skthermo.surrogate._simulator import Simulator
from skthermo.surrogate.refinement import Refinement, ResponseSurface


@dataclass(frozen=True)
class Inversions:
    """Inversions by a refinement; those of the records of `InverseSurrogate.fit` are read from its memory.

    ``content`` tells refinement, inputs and guess of `fit` from others, and ``seen`` the inputs; both are empty without
    a memory.
    """

    refinement: Refinement
    memory: str | Memory | None = None
    content: str = ""
    seen: str = ""

    @classmethod
    def of(cls, memory: str | Memory | None, refinement: Refinement, inputs: Array, guess: Array) -> Inversions:
        """Inversions by a refinement that is adapted to the inputs of `fit` and the regressor's guess."""
        if folder_of(memory) is None:
            return cls(refinement.adapted(inputs, guess))
        content = content_of(replace(refinement, n_jobs=None), inputs, guess)
        simulator, surface = remembered(
            memory, "adaptation", lambda: _changes(refinement, refinement.adapted(inputs, guess)), lambda: (content,)
        )
        if simulator is not None:
            simulator = replace(simulator, model=refinement.simulator.model)  # not the copy that was read
        adapted = replace(refinement, simulator=simulator or refinement.simulator, surface=surface)
        return cls(adapted, memory, content, joblib.hash(inputs))

    def found(self, inputs: Array, guess: Array, scatter: Array) -> Bunch:
        """What `Refinement.refined` gives."""
        folder = folder_of(self.memory)
        is_kept = folder is not None and folder.is_dir() and joblib.hash(inputs) == self.seen
        return remembered(
            self.memory if is_kept else None,
            "inversion",
            lambda: self.refinement.refined(inputs, guess, scatter),
            lambda: (self.content, self.refinement.noise, guess, scatter),
        )

    def scatter(self, inputs: Array, guess: Array) -> Array:
        """What `Refinement.estimated_scatter` gives for the inputs of `fit`."""
        is_stated = bool(self.refinement.noise.all())
        return remembered(
            None if is_stated else self.memory,
            "scatter",
            lambda: self.refinement.estimated_scatter(inputs, guess),
            lambda: (self.content,),
        )

    def tells_noise(self, inputs: Array) -> bool:
        """Whether the scatter of the inputs of `fit` was estimated from them, and not stated or assumed."""
        n_modes, n_parameters = len(self.refinement.noise), len(self.refinement.prior.mean)
        complete = ~np.isnan(inputs).any(axis=1)
        return not self.refinement.noise.all() and n_modes > n_parameters and complete.sum() > n_parameters

    def with_noise(self, noise: Array) -> Inversions:
        """The same inversions of frequencies with noise."""
        return replace(self, refinement=replace(self.refinement, noise=noise, recent=[]))


def _changes(before: Refinement, after: Refinement) -> tuple[Simulator | None, ResponseSurface | None]:
    """What an adapted refinement has of its own; no simulator where it has the same as before."""
    return None if after.simulator is before.simulator else after.simulator, after.surface
