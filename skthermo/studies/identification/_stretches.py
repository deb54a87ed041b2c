"""Stretches of neighbouring members of a group as causes."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, depth_first_order

from skthermo._core.arrays import Array
from skthermo.fem import Structure
from skthermo.studies.identification._causes import Cause

Line = list[Hashable]


def members_of(model: Any, names: Sequence[str]) -> Line:
    """Members of a structure whose stiffness some damage groups of a model scale."""
    positions = dict.fromkeys(position for name in names for position in model.groups[name])
    return list(dict.fromkeys(member for position in positions for member, _ in model.contents[position]))


def lines_of(structure: Structure, members: Sequence[Hashable]) -> list[Line]:
    """Members that common nodes connect, line by line, each from its end of lower coordinates.

    Members that no other one touches, such as stays or bearings, are one line together; so are all members where
    there are more than four lines, as in a grid of beams.
    """
    ends = [structure.members[member].nodes for member in members]
    middles = np.array([np.mean([structure.nodes[node] for node in nodes], axis=0) for nodes in ends])
    places = {node: place for place, node in enumerate(dict.fromkeys(node for nodes in ends for node in nodes))}
    touches = np.zeros((len(ends), len(places)))
    for row, nodes in zip(touches, ends, strict=True):
        row[[places[node] for node in nodes if len(nodes) > 1]] = 1
    neighbours = touches @ touches.T > 0
    np.fill_diagonal(neighbours, False)
    labels = connected_components(csr_array(neighbours), directed=False)[1]
    connected = [np.flatnonzero(labels == label) for label in np.unique(labels)]
    lines = [_in_order(one, neighbours, middles) for one in connected if len(one) > 1]
    alone = [int(one[0]) for one in connected if len(one) == 1]
    if len(lines) > 4:
        lines, alone = [], list(range(len(members)))
    lines += [_by_place(np.array(alone), middles)] if alone else []
    return [[members[place] for place in line] for line in sorted(lines, key=lambda line: tuple(middles[line[0]]))]


def _in_order(line: Array, neighbours: Array, middles: Array) -> list[int]:
    """Members followed from an end; by place where they branch or form a ring."""
    by_place, number = _by_place(line, middles), neighbours[line].sum(axis=1)
    tips = [place for place in by_place if neighbours[place].sum() == 1]
    if len(tips) != 2 or number.max() > 2:
        return by_place
    return depth_first_order(csr_array(neighbours), tips[0], directed=False)[0].tolist()


def _by_place(line: Array, middles: Array) -> list[int]:
    """Members by their coordinate along the axis on which they extend most."""
    axes = np.argsort(np.ptp(middles[line], axis=0), kind="stable")
    return line[np.lexsort(middles[line][:, axes].round(9).T)].tolist()


def pieces_of(lines: Sequence[Line], most: int = 24) -> list[list[Line]]:
    """Pieces of lines, about so many in all, each of members that follow each other."""
    size, found = -(-sum(map(len, lines)) // most), []
    for line in lines:
        edges = np.linspace(0, len(line), -(-len(line) // size) + 1).round().astype(int)
        found.append([line[low:high] for low, high in pairwise(edges)])
    return found


def stretches(
    group: str, of: Sequence[str], lines: Sequence[Sequence[Line]], names: Sequence[str], *, whole: float = 0.25
) -> list[Cause]:
    """The whole group, and each run of pieces of its lines, which have these names in the divided model, as causes.

    Every length is less probable the longer it is, and every place of a length equally probable.
    """
    members = tuple(member for line in lines for piece in line for member in piece)
    runs, first = [], 0
    for line in lines:
        for i in range(len(line)):
            for j in range(i + 1, len(line) + 1):
                if j - i < len(names):
                    rows = [member for piece in line[i:j] for member in piece]
                    runs.append((rows, names[first + i : first + j], len(line) / (j - i) / (len(line) - (j - i) + 1)))
        first += len(line)
    total = sum(share for *_, share in runs)
    found = [Cause(group, of=tuple(of), rows=members, group=group, share=whole if runs else 1.0)]
    for rows, pieces, share in runs:
        which = f"{rows[0]} to {rows[-1]}" if len(rows) > 1 else f"{rows[0]}"
        options = {"group": group, "share": (1 - whole) * share / total, "alone": True}
        scale = float(min(np.sqrt(len(members) / len(rows)), 3.0))  # what is smaller may be more severe
        found.append(Cause(f"{group}: {which}", of=tuple(pieces), rows=tuple(rows), scale=scale, **options))
    return found
