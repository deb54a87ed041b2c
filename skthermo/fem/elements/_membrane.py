"""Membranes in plane stress."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from skthermo._core.arrays import Array, is_real
from skthermo.fem.elements._element import ByProperties, PhysicalElement

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
GAUSS_POINTS = CORNERS / np.sqrt(3)


@dataclass(frozen=True)
class Membrane(PhysicalElement):
    """Flat quadrilateral in plane stress: stiffness in its plane only, mass in every direction.

    Parameters
    ----------
    corners : sequence of 4 hashable
        Names of its nodes, in order around the edge; in one plane to a thousandth of its size.
    E : float
        Young's modulus in Pa.
    t : float
        Thickness in m.
    nu : float, default=0.3
        Poisson's ratio, which cannot be a parameter: stiffness is not affine in it.
    density : float, default=0.0
        In kg/m3.
    lumped : bool, default=False
        Each node's share of the mass at that node instead of the consistent mass matrix.

    Notes
    -----
    Bilinear displacements, 2 x 2 Gauss points [Hug87]_. Constant strain is exact; bending in the plane is too stiff
    unless there are several elements across. Membranes have no stiffness out of their plane: other members must hold
    their nodes.

    Examples
    --------
    Forces of a strip in tension, E t b / L times its elongation:

    >>> import numpy as np
    >>> from skthermo.fem import Membrane
    >>> strip = Membrane(("a", "b", "c", "d"), E=210e9, t=0.015, nu=0.0, density=7850.0)
    >>> corners = np.array([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0.0]])
    >>> stretch = np.array([0, 0, 0, 1e-3, 0, 0, 1e-3, 0, 0, 0, 0, 0])
    >>> (strip.stiffness(corners)["E", "t"] @ stretch).round()[:4]
    array([-787500.,       0.,       0.,  787500.])
    """

    corners: tuple[Hashable, Hashable, Hashable, Hashable]
    E: float
    t: float
    nu: float = 0.3
    density: float = 0.0
    lumped: bool = False

    _properties = ("E", "t", "density")
    _may_be_zero = ("density",)

    def __post_init__(self) -> None:
        if isinstance(self.corners, str | type) or not isinstance(self.corners, Sequence):
            raise ValueError(f"corners is {self.corners!r:.100}; expected four nodes")
        if not is_real(self.nu) or not -1 < self.nu < 0.5:
            raise ValueError(f"nu is {self.nu!r}; expected a number between -1 and 0.5")

    @property
    def nodes(self) -> tuple[Hashable, ...]:
        """Its four nodes."""
        return tuple(self.corners)

    def ends(self, coordinates: Array) -> Array:
        """The corners, which must make a flat quadrilateral without a corner pointing inwards."""
        if len(coordinates) != 4:
            raise ValueError(f"membrane at nodes {self.nodes}: expected four nodes")
        edges = coordinates - coordinates[0]
        if np.linalg.svd(edges[[1, 3]], compute_uv=False)[-1] > 1e-6 * np.abs(edges).max():
            plane = plane_axes(coordinates)
            flat = edges @ plane.T
            if np.abs(flat @ plane - edges).max() > 1e-3 * np.abs(edges).max():
                raise ValueError(f"membrane at nodes {self.nodes}: expected four nodes in one plane")
            if min(np.linalg.det(slopes(corner) @ flat) for corner in CORNERS) > 1e-6 * np.abs(edges).max() ** 2:
                return coordinates
        raise ValueError(f"membrane at nodes {self.nodes}: expected a convex quadrilateral, nodes in order around it")

    def stiffness(self, coordinates: Array) -> ByProperties:
        """Integral of B' C B over the area, times thickness."""
        plane = plane_axes(coordinates)
        flat = (coordinates - coordinates[0]) @ plane.T
        hooke = self.E / (1 - self.nu**2) * np.array([[1, self.nu, 0], [self.nu, 1, 0], [0, 0, (1 - self.nu) / 2]])
        total = np.zeros((8, 8))
        for point in GAUSS_POINTS:
            jacobian = slopes(point) @ flat
            strain = strains(np.linalg.solve(jacobian, slopes(point)))
            total += strain.T @ hooke @ strain * np.linalg.det(jacobian)
        to_plane = np.kron(np.eye(4), plane)
        return {("E", "t"): self.t * to_plane.T @ total @ to_plane}

    def mass(self, coordinates: Array) -> ByProperties:
        """density t times the area, the same in every direction."""
        flat = (coordinates - coordinates[0]) @ plane_axes(coordinates).T
        share = sum(
            np.outer(shape(point), shape(point)) * np.linalg.det(slopes(point) @ flat) for point in GAUSS_POINTS
        )
        if self.lumped:
            share = np.diag(share.sum(axis=1))
        return {("density", "t"): self.density * self.t * np.kron(share, np.eye(coordinates.shape[1]))}


def shape(point: Array) -> Array:
    """The four bilinear functions."""
    return (1 + CORNERS[:, 0] * point[0]) * (1 + CORNERS[:, 1] * point[1]) / 4


def slopes(point: Array) -> Array:
    """Their derivatives along the two natural coordinates, (2, 4)."""
    xi, eta = CORNERS.T
    return np.array([xi * (1 + eta * point[1]), eta * (1 + xi * point[0])]) / 4


def strains(gradients: Array) -> Array:
    """Matrix B from the in-plane displacements of the nodes to normal and shear strains, (3, 8)."""
    matrix = np.zeros((3, 8))
    matrix[0, 0::2], matrix[1, 1::2] = gradients
    matrix[2, 0::2], matrix[2, 1::2] = gradients[::-1]
    return matrix


def plane_axes(coordinates: Array) -> Array:
    """Two unit vectors that span the plane: along the first edge, and across it towards the last node."""
    first, last = coordinates[1] - coordinates[0], coordinates[3] - coordinates[0]
    along = first / np.linalg.norm(first)
    across = last - (last @ along) * along
    return np.array([along, across / np.linalg.norm(across)])
