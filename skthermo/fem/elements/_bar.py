"""Bars."""

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np

from skthermo._core.arrays import Array
from skthermo.fem.elements._element import ByProperties, PhysicalElement


@dataclass(frozen=True)
class Bar(PhysicalElement):
    """Straight bar that carries axial force only, in 2-D or 3-D.

    Parameters
    ----------
    start, end : hashable
        Names of its two nodes.
    E : float
        Young's modulus in Pa.
    A : float
        Cross-sectional area in m2.
    density : float, default=0.0
        In kg/m3.
    lumped : bool, default=False
        Half the mass at either end instead of the consistent mass matrix.

    Examples
    --------
    >>> from skthermo.fem import Bar
    >>> Bar("a", "b", E=210e9, A=0.01, density=7850.0).nodes
    ('a', 'b')
    """

    start: Hashable
    end: Hashable
    E: float
    A: float
    density: float = 0.0
    lumped: bool = False

    _properties = ("E", "A", "density")
    _may_be_zero = ("density",)

    @property
    def nodes(self) -> tuple[Hashable, Hashable]:
        """Its two nodes."""
        return self.start, self.end

    def stiffness(self, coordinates: Array) -> ByProperties:
        """E A / L along the axis."""
        axis = coordinates[1] - coordinates[0]
        length = np.linalg.norm(axis)
        strain = np.concatenate([-axis, axis]) / length**2
        return {("E", "A"): self.E * self.A * length * np.outer(strain, strain)}

    def mass(self, coordinates: Array) -> ByProperties:
        """density A L, the same in every direction."""
        length = np.linalg.norm(coordinates[1] - coordinates[0])
        share = np.eye(2) / 2 if self.lumped else np.array([[2.0, 1.0], [1.0, 2.0]]) / 6
        total = self.density * self.A * length
        return {("density", "A"): total * np.kron(share, np.eye(coordinates.shape[1]))}
