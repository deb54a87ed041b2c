"""Inversions of the records that an inverse surrogate was fitted to, which its memory keeps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import joblib
from joblib import Memory
from sklearn.utils import Bunch

from skthermo._arrays import Array
from skthermo.surrogate._memory import content_of, folder_of, remembered
from skthermo.surrogate.refinement import Refinement


@dataclass(frozen=True)
class Inversions:
    """Inversions by a refinement; those of the records of `InverseSurrogate.fit` are read from its memory.

    ``content`` tells the refinement from others, and ``seen`` the inputs of `fit`; both are empty without a memory.
    """

    refinement: Refinement
    memory: str | Memory | None = None
    content: str = ""
    seen: str = ""

    @classmethod
    def of(cls, memory: str | Memory | None, refinement: Refinement, inputs: Array) -> Inversions:
        """Inversions of the inputs of `fit` by a refinement."""
        if folder_of(memory) is None:
            return cls(refinement)
        settings = replace(refinement, n_jobs=None, recent=[])
        return cls(refinement, memory, content_of(settings), joblib.hash(inputs))

    def found(self, inputs: Array, guess: Array, scatter: Array) -> Bunch:
        """What `Refinement.refined` gives."""
        folder = folder_of(self.memory)
        is_kept = folder is not None and folder.is_dir() and joblib.hash(inputs) == self.seen
        return remembered(
            self.memory if is_kept else None,
            "inversion",
            lambda: self.refinement.refined(inputs, guess, scatter),
            lambda: (self.content, self.seen, guess, scatter),
        )

    def scatter(self, inputs: Array, guess: Array) -> Array:
        """What `Refinement.estimated_scatter` gives for the inputs of `fit`."""
        is_stated = bool(self.refinement.noise.all())
        return remembered(
            None if is_stated else self.memory,
            "scatter",
            lambda: self.refinement.estimated_scatter(inputs, guess),
            lambda: (self.content, self.seen, guess),
        )
