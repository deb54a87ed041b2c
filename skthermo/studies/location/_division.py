"""Members of a damage group along their lines, in pieces, and stretches of neighbouring pieces that may be damaged."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Hashable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from skthermo._tables.arrays import Array
from skthermo.fem import Structure

Line = list[Hashable]

MOST_LINES = 4  # more lines than these, as in a grid of beams, are no lines along which damage extends

WHOLE = 0.25  # prior probability that a damaged group is damaged throughout, by one severity
LARGEST_SCALE = 3.0
"""Most that the severities of a short stretch may scatter more widely than those of a whole group."""
Piece = tuple[Hashable, ...]


def lines_of(structure: Structure, members: Collection[Hashable]) -> list[Line]:
    """Members that are connected, line by line, each from its end of lower coordinates.

    Members that no other one touches, such as stays or bearings, are one line together; so are all members where
    there are more than a few lines.
    """
    ends = {member: structure.members[member].nodes for member in members}
    middles = {member: np.mean([structure.nodes[node] for node in nodes], axis=0) for member, nodes in ends.items()}
    at_node = defaultdict(list)
    for member, nodes in ends.items():
        for node in nodes if len(nodes) > 1 else ():
            at_node[node].append(member)
    lines: list[Line] = []
    left = dict.fromkeys(members)
    while left:
        line = _connected(next(iter(left)), ends, at_node)
        left = dict.fromkeys(member for member in left if member not in line)
        lines.append(line)
    if len(lines) - sum(len(line) == 1 for line in lines) > MOST_LINES:
        return [_by_place(list(members), middles)]
    alone = [line[0] for line in lines if len(line) == 1]
    lines = [_in_order(line, ends, at_node, middles) for line in lines if len(line) > 1]
    lines += [_by_place(alone, middles)] if alone else []
    return sorted(lines, key=lambda line: tuple(middles[line[0]].round(6)))


def _connected(first: Hashable, ends: dict, at_node: dict) -> Line:
    """The members that a chain of common nodes connects to the first one, in the order in which they are reached."""
    reached = {first: None}
    waiting = [first]
    while waiting:
        for node in ends[waiting.pop()]:
            new = [member for member in at_node[node] if member not in reached]
            reached.update(dict.fromkeys(new))
            waiting += new
    return list(reached)


def _in_order(line: Line, ends: dict, at_node: dict, middles: dict[Hashable, Array]) -> Line:
    """A line followed from its end; by place where members branch or form a ring."""
    by_place = _by_place(line, middles)
    touching = {member: {other for node in ends[member] for other in at_node[node]} - {member} for member in line}
    tips = [member for member in by_place if len(touching[member]) == 1]
    if len(tips) != 2 or max(map(len, touching.values())) > 2:
        return by_place
    ordered = tips[:1]
    while len(ordered) < len(line):
        ordered.append(next(other for other in touching[ordered[-1]] if other not in ordered[-2:]))
    return ordered


def _by_place(line: Line, middles: dict[Hashable, Array]) -> Line:
    """Members by their coordinate along the axis on which they extend most."""
    places = np.array([middles[member] for member in line])
    axes = np.argsort(-np.ptp(places, axis=0), kind="stable")
    order = np.lexsort(places[:, axes[::-1]].round(9).T)
    return [line[i] for i in order]


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
        return [piece for line in self.lines for piece in line]

    @property
    def members(self) -> list[Hashable]:
        return [member for piece in self.pieces for member in piece]

    def finer(self, chosen: Sequence[bool]) -> Division:
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
