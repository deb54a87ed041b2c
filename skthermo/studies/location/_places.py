"""Where along its lines a set of members lies, in words."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from skthermo._formatting import counted
from skthermo.fem import Structure


@dataclass(frozen=True)
class Places:
    """The lines of a group's members, in the words "elements 4 to 6 of 16"."""

    structure: Structure
    lines: Sequence[Sequence[Hashable]]

    @property
    def numbers(self) -> dict[Hashable, int]:
        """Number of each member on its line, from 1."""
        return {member: number for line in self.lines for number, member in enumerate(line, 1)}

    @property
    def members(self) -> list[Hashable]:
        """All members."""
        return [member for line in self.lines for member in line]

    def text(self, chosen: Collection[Hashable], *, alternatives: bool = False) -> str:
        """Members as ranges of neighbours; as alternatives, if the damage is in one of them."""
        chosen = set(chosen)
        if chosen >= set(self.members):
            return f"all {counted(len(self.members), 'element')}"
        ranges = [self._range(line, first, last) for line in self.lines for first, last in _runs(line, chosen)]
        joined = " or " if alternatives else " and "
        return joined.join([", ".join(ranges[:-1]), ranges[-1]] if len(ranges) > 1 else ranges)

    def _range(self, line: Sequence[Hashable], first: int, last: int) -> str:
        which = f"element {first + 1}" if first == last else f"elements {first + 1} to {last + 1}"
        of_line = "" if len(self.lines) == 1 else f" of line {self.lines.index(line) + 1}"
        return f"{which} of {len(line)}{of_line}{self._extent(line, line[first : last + 1])}"

    def _extent(self, line: Sequence[Hashable], members: Sequence[Hashable]) -> str:
        """Coordinates between which members lie, along the axis on which their line extends most."""
        corners = [self._corners(some) for some in (line, members)]
        axis = int(np.ptp(corners[0], axis=0).argmax())
        low, high = corners[1][:, axis].min(), corners[1][:, axis].max()
        along = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
        return f" ({'xyz'[axis]} = {along} m)"

    def _corners(self, members: Sequence[Hashable]) -> np.ndarray:
        return np.array([self.structure.nodes[node] for m in members for node in self.structure.members[m].nodes])


def _runs(line: Sequence[Hashable], chosen: Collection[Hashable]) -> Iterator[tuple[int, int]]:
    """First and last position of each run of chosen members."""
    first = None
    for position, member in enumerate([*line, None]):
        inside = position < len(line) and member in chosen
        if inside and first is None:
            first = position
        if not inside and first is not None:
            yield first, position - 1
            first = None
