"""Euler-Bernoulli beams in 3-D."""

import math
from collections.abc import Collection, Hashable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skthermo._core.arrays import Array, is_real, real_array
from skthermo.fem.elements._element import ROTATIONS, TRANSLATIONS, ByProperties, Dof, PhysicalElement

DIRECTIONS = (*TRANSLATIONS, *ROTATIONS)


class Action(NamedTuple):
    """One of the four uncoupled deformations of a beam: tension, torsion and bending in two planes."""

    dofs: list[int]  # positions among the 12 local degrees of freedom
    stiffness_of: tuple[str, str]
    stiffness: Array  # of unit properties
    mass_of: tuple[str, str]
    mass: Array


def actions(length: float, *, lumped: bool) -> list[Action]:
    """Tension, torsion, bending in the local x-y and x-z planes."""
    rod = np.array([[1.0, -1.0], [-1.0, 1.0]]) / length
    rod_mass = length * (np.eye(2) / 2 if lumped else np.array([[2.0, 1.0], [1.0, 2.0]]) / 6)
    bending, bending_mass = bending_stiffness(length), hermite_mass(length, lumped=lumped)
    mirror = np.outer([1, -1, 1, -1], [1, -1, 1, -1])  # a positive slope of w is a negative rotation about y
    return [
        Action([0, 6], ("E", "A"), rod, ("density", "A"), rod_mass),
        Action([3, 9], ("G", "J"), rod, ("density", "I_p"), rod_mass),
        Action([1, 5, 7, 11], ("E", "I_zz"), bending, ("density", "A"), bending_mass),
        Action([2, 4, 8, 10], ("E", "I_yy"), mirror * bending, ("density", "A"), mirror * bending_mass),
    ]


def bending_stiffness(length: float) -> Array:
    """Integral of the curvatures of the Hermite cubics: displacement and slope at both ends."""
    h = length
    return (
        np.array(
            [
                [12, 6 * h, -12, 6 * h],
                [6 * h, 4 * h**2, -6 * h, 2 * h**2],
                [-12, -6 * h, 12, -6 * h],
                [6 * h, 2 * h**2, -6 * h, 4 * h**2],
            ]
        )
        / h**3
    )


def hermite_mass(length: float, *, lumped: bool) -> Array:
    """Integral of the Hermite cubics, or half the mass at either end."""
    h = length
    if lumped:
        return np.diag([h / 2, 0.0, h / 2, 0.0])
    return (
        np.array(
            [
                [156, 22 * h, 54, -13 * h],
                [22 * h, 4 * h**2, 13 * h, -3 * h**2],
                [54, 13 * h, 156, -22 * h],
                [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
            ]
        )
        * h
        / 420
    )


@dataclass(frozen=True)
class Beam(PhysicalElement):
    """Straight Euler-Bernoulli beam: tension, torsion and bending about both axes, in 3-D.

    Local x runs from start to end. Local z lies in the plane of x and ``orientation``, on the side of ``orientation``,
    and local y completes the right-handed frame. By default, local y of a horizontal beam is horizontal and local z
    points upwards, so that ``I_yy`` is for vertical bending and ``I_zz`` for lateral bending.

    Parameters
    ----------
    start, end : hashable
        Names of its two nodes.
    E, G : float
        Young's and shear modulus in Pa.
    A : float
        Cross-sectional area in m2.
    I_yy, I_zz : float
        Second moments of area about local y and z in m4.
    J : float
        Torsion constant in m4.
    density : float, default=0.0
        In kg/m3.
    I_p : float, optional
        Polar moment of area of the mass in m4, by default ``I_yy + I_zz``.
    orientation : sequence of 3 floats, optional
        A vector in the local x-z plane, by default global z, or global x for a vertical beam.
    lumped : bool, default=False
        Half the mass and half its polar inertia at either end instead of the consistent mass matrix.
    release_start, release_end : collection of str, default=()
        Local directions in which that end is not connected to its node, such as ("ry", "rz") for a
        ball joint that carries torsion.
    offset_start, offset_end : sequence of 3 floats, default=(0.0, 0.0, 0.0)
        Rigid arm from the node to that end of the beam, in global directions, m.

    Notes
    -----
    Where an end is released, stiffness and mass of each of the four actions [Prz68]_ are condensed separately (Guyan),
    so that matrices stay affine in the properties. Shear deformation and the rotary inertia of bending are left out.

    Examples
    --------
    A cantilever's first two frequencies, bending about its weak and its strong axis:

    >>> import numpy as np
    >>> from skthermo.fem import Beam, Structure
    >>> section = dict(E=210e9, G=81e9, A=0.02, I_yy=4e-5, I_zz=1e-5, J=3e-5, density=7850.0)
    >>> nodes = {i: (0.5 * i, 0, 0) for i in range(9)}
    >>> beams = {f"beam {i}": Beam(i, i + 1, **section) for i in range(8)}
    >>> cantilever = Structure(nodes, beams, {0: "xyz rx ry rz"}, {"all": list(beams)})
    >>> cantilever.assemble(["all"], n_modes=2).frequencies([[1.0]]).round(2)
    array([[4.04, 8.09]])
    """

    start: Hashable
    end: Hashable
    E: float
    G: float
    A: float
    I_yy: float
    I_zz: float
    J: float
    density: float = 0.0
    I_p: float | None = None
    orientation: tuple[float, float, float] | None = None
    lumped: bool = False
    release_start: Collection[str] = ()
    release_end: Collection[str] = ()
    offset_start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    offset_end: tuple[float, float, float] = (0.0, 0.0, 0.0)

    _properties = ("E", "G", "A", "I_yy", "I_zz", "J", "density", "I_p")
    _may_be_zero = ("density", "I_p")

    def __post_init__(self) -> None:
        if self.I_p is None and is_real(self.I_yy) and is_real(self.I_zz):  # others are refused in the structure
            object.__setattr__(self, "I_p", self.I_yy + self.I_zz)
        for name in ("release_start", "release_end"):
            released = getattr(self, name)
            directions = released if isinstance(released, Collection) else [released]
            unknown = [direction for direction in directions if direction not in DIRECTIONS]
            if unknown:
                raise ValueError(f"{name} names {unknown}; expected a collection of local directions {DIRECTIONS}")
        for name in ("orientation", "offset_start", "offset_end"):
            vector = getattr(self, name)
            if vector is not None or name != "orientation":
                values = real_array(vector, name)
                if values.shape != (3,) or not np.isfinite(values).all():
                    raise ValueError(f"{name} is {vector!r:.100}; expected three finite numbers")

    @property
    def nodes(self) -> tuple[Hashable, Hashable]:
        """Its two nodes."""
        return self.start, self.end

    def dofs(self, dimension: int) -> list[Dof]:
        """Translations and rotations of both nodes."""
        return [(node, direction) for node in self.nodes for direction in DIRECTIONS]

    def ends(self, coordinates: Array) -> Array:
        """Coordinates of both ends of the beam, offsets included."""
        if coordinates.shape[1] != 3:
            raise ValueError(f"beam from node {self.start!r} to node {self.end!r}: expected three coordinates, got two")
        return coordinates + np.array([self.offset_start, self.offset_end])

    def stiffness(self, coordinates: Array) -> ByProperties:
        """E A, G J, E I_zz and E I_yy, each with its own matrix."""
        length, to_nodes = self._geometry(coordinates)
        return {
            action.stiffness_of: self._value(action.stiffness_of) * self._assembled(action, action.stiffness, to_nodes)
            for action in actions(length, lumped=self.lumped)
        }

    def mass(self, coordinates: Array) -> ByProperties:
        """density A of the translations and density I_p of the twist."""
        length, to_nodes = self._geometry(coordinates)
        matrices: ByProperties = {}
        for action in actions(length, lumped=self.lumped):
            matrix = self._value(action.mass_of) * self._assembled(action, action.mass, to_nodes)
            matrices[action.mass_of] = matrices.get(action.mass_of, 0) + matrix
        return matrices

    def _value(self, properties: tuple[str, ...]) -> float:
        return math.prod(getattr(self, name) for name in properties)

    def _assembled(self, action: Action, matrix: Array, to_nodes: Array) -> Array:
        """A matrix of one action, condensed where ends are released, at the nodes' 12 degrees of freedom."""
        path = to_nodes[action.dofs]
        if len(self.release_start) or len(self.release_end):
            released = [name in ends for ends in (self.release_start, self.release_end) for name in DIRECTIONS]
            path = condensation(action.stiffness, np.array(released)[action.dofs]) @ path
        return path.T @ matrix @ path

    def _geometry(self, coordinates: Array) -> tuple[float, Array]:
        """Length, and the matrix from the nodes' global motion to the ends' local motion."""
        start, end = self.ends(coordinates)
        length = float(np.linalg.norm(end - start))
        rotation = local_axes((end - start) / length, self.orientation)
        arms = np.eye(12)
        for first, offset in ((0, self.offset_start), (6, self.offset_end)):
            x, y, z = offset
            arms[first : first + 3, first + 3 : first + 6] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]  # rotation x arm
        return length, np.kron(np.eye(4), rotation) @ arms


def condensation(stiffness: Array, released: NDArray[np.bool_]) -> Array:
    """Matrix from the kept degrees of freedom to all of them, if the released ones carry no force."""
    kept = ~released
    motion = np.diag(kept.astype(float))
    if released.any():
        motion[np.ix_(released, kept)] = (
            -np.linalg.pinv(stiffness[np.ix_(released, released)]) @ stiffness[np.ix_(released, kept)]
        )
    return motion


def local_axes(x: Array, orientation: Sequence[float] | None) -> Array:
    """Unit vectors of local x, y and z in its rows."""
    if orientation is None:
        vertical = np.hypot(x[0], x[1]) < 1e-6
        orientation = (1.0, 0.0, 0.0) if vertical else (0.0, 0.0, 1.0)
    y = np.cross(np.asarray(orientation, dtype=float), x)
    if not np.linalg.norm(y) > 1e-9 * np.linalg.norm(orientation):
        raise ValueError(f"orientation {tuple(orientation)} is along the beam; expected a vector across it")
    y /= np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)])
