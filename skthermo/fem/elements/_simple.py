"""Bars, springs and point masses."""

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np

from skthermo._core.arrays import Array
from skthermo.fem.elements._element import ByProperties, Dof, PhysicalElement


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


@dataclass(frozen=True)
class Spring(PhysicalElement):
    """Spring between a node and the ground, or between two nodes, which may be at one place, as in a joint.

    Parameters
    ----------
    node : hashable
        Name of its node.
    direction : str
        "x", "y" or "z", or, against rotation about an axis, "rx", "ry" or "rz".
    k : float
        Stiffness in N/m, or N m/rad against rotation.
    to : hashable, optional
        The other node; by default the ground.

    Examples
    --------
    >>> from skthermo.fem import Spring
    >>> Spring("abutment", "x", k=3e9).dofs(dimension=3)
    [('abutment', 'x')]
    """

    node: Hashable
    direction: str
    k: float
    to: Hashable | None = None

    _properties = ("k",)

    @property
    def nodes(self) -> tuple[Hashable, ...]:
        """Its node, or both."""
        return (self.node,) if self.to is None else (self.node, self.to)

    def dofs(self, dimension: int) -> list[Dof]:
        """Its one direction."""
        return [(node, self.direction) for node in self.nodes]

    def ends(self, coordinates: Array) -> Array:
        """Where its first node is: a spring has no length."""
        return coordinates[:1]

    def stiffness(self, coordinates: Array) -> ByProperties:
        """Its stiffness in N/m, or in N m/rad for a rotation."""
        stretch = np.array([1.0, -1.0])[: len(self.nodes)]
        return {("k",): self.k * np.outer(stretch, stretch)}

    def mass(self, coordinates: Array) -> ByProperties:
        """A spring has no mass."""
        return {}


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
