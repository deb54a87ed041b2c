"""Members of a group in the order in which they follow each other along the structure."""

from collections import defaultdict
from collections.abc import Collection, Hashable

import numpy as np

from skthermo._arrays import Array
from skthermo.fem import Structure

Line = list[Hashable]

MOST_LINES = 4  # more lines than these, as in a grid of beams, are no lines along which damage extends


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
