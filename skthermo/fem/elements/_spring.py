"""Springs."""

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np

from skthermo._core.arrays import Array
from skthermo.fem.elements._element import ByProperties, Dof, PhysicalElement


@dataclass(frozen=True)
class Spring(PhysicalElement):
    """Spring between a node and the ground.

    Parameters
    ----------
    node : hashable
        Name of its node.
    direction : str
        "x", "y" or "z", or, against rotation about an axis, "rx", "ry" or "rz".
    k : float
        Stiffness in N/m, or N m/rad against rotation.

    Examples
    --------
    >>> from skthermo.fem import Spring
    >>> Spring("abutment", "x", k=3e9).dofs(dimension=3)
    [('abutment', 'x')]
    """

    node: Hashable
    direction: str
    k: float

    _properties = ("k",)

    @property
    def nodes(self) -> tuple[Hashable]:
        """Its node."""
        return (self.node,)

    def dofs(self, dimension: int) -> list[Dof]:
        """Its one direction."""
        return [(self.node, self.direction)]

    def stiffness(self, coordinates: Array) -> ByProperties:
        """Its stiffness in N/m, or in N m/rad for a rotation."""
        return {("k",): np.array([[self.k]])}

    def mass(self, coordinates: Array) -> ByProperties:
        """A spring has no mass."""
        return {}
