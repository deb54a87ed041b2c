"""Finite elements as data sheets: nodes, properties, stiffness and mass.

Every element gives its matrices by the product of properties that multiplies them, so that
any of these properties can become a parameter.
"""

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass
from math import isfinite
from numbers import Real
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Dof = tuple[Hashable, str]
ByProperties = dict[tuple[str, ...], Array]

TRANSLATIONS = ("x", "y", "z")
ROTATIONS = ("rx", "ry", "rz")


class Element(Protocol):
    """What `Structure` assembles."""

    @property
    def nodes(self) -> tuple[Hashable, ...]:
        """Names of its nodes."""

    def dofs(self, dimension: int) -> list[Dof]:
        """(node, direction) of every row of the matrices."""

    def properties(self) -> Iterator[tuple[str, float, bool]]:
        """Name, value and whether zero is allowed, of every physical property."""

    def ends(self, coordinates: Array) -> Array:
        """Where the element itself has its ends or corners, given its nodes."""

    def stiffness(self, coordinates: Array) -> ByProperties:
        """Stiffness matrices in N/m by the product of properties that multiplies each."""

    def mass(self, coordinates: Array) -> ByProperties:
        """Mass matrices in kg by the product of properties that multiplies each."""


class Sheet:
    """What elements share: names and values of their physical properties."""

    _properties: tuple[str, ...]
    _may_be_zero: tuple[str, ...] = ()

    def properties(self) -> Iterator[tuple[str, float, bool]]:
        for name in self._properties:
            yield name, getattr(self, name), name in self._may_be_zero

    def ends(self, coordinates: Array) -> Array:
        """Where the element itself has its ends or corners, given its nodes."""
        return coordinates


@dataclass(frozen=True)
class Bar(Sheet):
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

    def dofs(self, dimension: int) -> list[Dof]:
        """Translations of both nodes."""
        return [(node, direction) for node in self.nodes for direction in TRANSLATIONS[:dimension]]

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
class Spring(Sheet):
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
        """k."""
        return {("k",): np.array([[self.k]])}

    def mass(self, coordinates: Array) -> ByProperties:
        """None."""
        return {}


@dataclass(frozen=True)
class PointMass(Sheet):
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

    def dofs(self, dimension: int) -> list[Dof]:
        """Translations of the node."""
        return [(self.node, direction) for direction in TRANSLATIONS[:dimension]]

    def stiffness(self, coordinates: Array) -> ByProperties:
        """None."""
        return {}

    def mass(self, coordinates: Array) -> ByProperties:
        """m in every direction."""
        return {("m",): self.m * np.eye(coordinates.shape[1])}


def check_element(name: Hashable, element: Element, coordinates: Mapping[Hashable, Array]) -> None:
    """Refuse an element with unknown nodes, no length, or a property that is not positive."""
    if not hasattr(element, "nodes"):
        raise ValueError(f"member {name!r} is {element!r}; expected an element such as Bar(...)")
    for node in element.nodes:
        if node not in coordinates:
            raise ValueError(f"member {name!r} ends at node {node!r}, which is not among the nodes")
    ends = element.ends(np.array([coordinates[node] for node in element.nodes]))
    if len(ends) == 2 and np.array_equal(*ends):
        first, last = element.nodes
        raise ValueError(f"member {name!r} from node {first!r} to node {last!r} has zero length")
    for symbol, value, may_be_zero in element.properties():
        expected = "zero or more" if may_be_zero else "a positive number"
        if not (isinstance(value, Real) and isfinite(value) and (value > 0 or (may_be_zero and value == 0))):
            raise ValueError(f"member {name!r} has {symbol} = {value!r}; expected {expected}")
