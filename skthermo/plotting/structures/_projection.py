"""Plane or space: the directions in which a structure is drawn."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from skthermo._tables.arrays import Array
from skthermo.fem import Structure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AXES = "xyz"
NORMALS = "yzx"  # a structure along one line is drawn with z upwards, if it moves there


@dataclass(frozen=True)
class Projection:
    """A structure seen along the normal of its plane, or in space."""

    structure: Structure
    directions: str
    """Those of the horizontal and the vertical axis, such as "xz", or "xyz"."""

    @classmethod
    def of(cls, structure: Structure, ax: Axes | np.ndarray | None = None) -> Projection:
        """In the plane that nodes and motions lie in, if there is one; in space if such axes are given."""
        if structure.dimension == 2:
            return cls(structure, "xy")
        if not any(hasattr(one, "get_zlim") for one in np.ravel(np.asarray(ax, dtype=object))):
            moving = {direction for _, direction in structure.dofs}
            extent = np.ptp(list(structure.nodes.values()), axis=0)
            for normal in NORMALS:
                plane = AXES.replace(normal, "")
                if extent[AXES.index(normal)] == 0 and moving <= {*plane, f"r{normal}"}:
                    return cls(structure, plane)
        return cls(structure, AXES)

    @property
    def is_space(self) -> bool:
        """Whether three directions are drawn."""
        return len(self.directions) == 3

    @property
    def nodes(self) -> dict[Hashable, Array]:
        """Coordinates of every node along the directions."""
        columns = [AXES.index(direction) for direction in self.directions]
        return {node: place[columns] for node, place in self.structure.nodes.items()}

    @property
    def supports(self) -> dict[Hashable, bool]:
        """Nodes that are held in a direction in which others move, and whether in every such direction."""
        moving = {direction for _, direction in self.structure.dofs}.intersection(self.directions)
        held = {node: moving.intersection(along) for node, along in self.structure.supports.items()}
        return {node: fixed == moving for node, fixed in held.items() if fixed}
