"""Point masses."""

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np

from skthermo._core.arrays import Array
from skthermo.fem.elements._element import ByProperties, PhysicalElement


@dataclass(frozen=True)
class PointMass(PhysicalElement):
    """Mass lumped at a node, the same in every direction.

    Parameters
    ----------
    node : hashable
        Name of its node.
    m : float
        Mass in kg.

    Examples
    --------
    >>> from skthermo.fem import PointMass
    >>> PointMass("deck", m=250.0).dofs(dimension=2)
    [('deck', 'x'), ('deck', 'y')]
    """

    node: Hashable
    m: float

    _properties = ("m",)

    @property
    def nodes(self) -> tuple[Hashable]:
        """Its node."""
        return (self.node,)

    def stiffness(self, coordinates: Array) -> ByProperties:
        """A point mass has no stiffness."""
        return {}

    def mass(self, coordinates: Array) -> ByProperties:
        """m in every direction."""
        return {("m",): self.m * np.eye(coordinates.shape[1])}
