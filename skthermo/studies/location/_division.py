"""A damage group divided into pieces, and the stretches of neighbouring pieces that may be damaged."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from skthermo._arrays import Array

WHOLE = 0.25  # prior probability that a damaged group is damaged throughout, by one severity
LARGEST_SCALE = 3.0
"""Most that the severities of a short stretch may scatter more widely than those of a whole group."""

Piece = tuple[Hashable, ...]


@dataclass(frozen=True)
class Division:
    """Pieces of a group, line by line; each consists of members that follow each other."""

    group: str
    lines: tuple[tuple[Piece, ...], ...]

    @classmethod
    def of(cls, group: str, lines: Sequence[Sequence[Hashable]], most: int) -> Division:
        """At most so many pieces, or one for each line, of about equal numbers of members."""
        size = int(np.ceil(sum(map(len, lines)) / most))
        return cls(group, tuple(_cut(line, int(np.ceil(len(line) / size))) for line in lines))

    @property
    def pieces(self) -> list[Piece]:
        """All pieces in order."""
        return [piece for line in self.lines for piece in line]

    @property
    def members(self) -> list[Hashable]:
        """All members in order."""
        return [member for piece in self.pieces for member in piece]

    def finer(self, chosen: Sequence[bool]) -> Division:
        """The division with the chosen pieces cut into halves."""
        flags = iter(chosen)
        lines = [
            [half for piece in line for half in (_cut(piece, 2) if next(flags) else [piece])] for line in self.lines
        ]
        return Division(self.group, tuple(map(tuple, lines)))

    def stretches(self) -> Iterator[tuple[tuple[int, ...], float, float]]:
        """Positions of the pieces, prior probability and scale of severities of each stretch.

        A stretch is a run of neighbouring pieces of a line, or the whole group, which comes first. It stands for all
        runs of members that begin in its first and end in its last piece; every length is less probable the longer it
        is, and every place of a run equally probable.
        """
        n_members = len(self.members)
        yield tuple(range(len(self.pieces))), WHOLE if len(self.pieces) > 1 else 1.0, 1.0
        found, first = [], 0
        for line in self.lines:
            edges = np.cumsum([0, *map(len, line)])
            priors = _priors_of_runs(edges) * (edges[-1] / n_members)
            for i in range(len(line)):
                for j in range(i, len(line)):
                    if j - i + 1 < len(self.pieces):
                        found.append((tuple(range(first + i, first + j + 1)), priors[i, j], edges[j + 1] - edges[i]))
            first += len(line)
        total = sum(prior for _, prior, _ in found)
        for positions, prior, size in found:
            yield positions, (1 - WHOLE) * prior / total, min(np.sqrt(n_members / size), LARGEST_SCALE)


def _cut(members: Sequence[Hashable], n_pieces: int) -> tuple[Piece, ...]:
    """Neighbouring members in pieces of about equal size."""
    edges = np.linspace(0, len(members), min(n_pieces, len(members)) + 1).round().astype(int)
    return tuple(tuple(members[low:high]) for low, high in pairwise(edges))


def _priors_of_runs(edges: Array) -> Array:
    """Prior of the runs of members that begin in piece i and end in piece j, (n_pieces, n_pieces)."""
    n = edges[-1]
    first, last = np.arange(n)[:, np.newaxis], np.arange(n)
    length = last - first + 1
    priors = np.where(length > 0, 1 / np.maximum(length * (n - length + 1), 1), 0.0)
    return np.add.reduceat(np.add.reduceat(priors, edges[:-1], axis=0), edges[:-1], axis=1)
