"""The interface of finite elements: nodes, properties, stiffness and mass.

Every element gives one matrix for each product of properties, such as E A, so that any of these properties can become
a parameter.
"""

from collections.abc import Hashable, Iterator, Mapping
from typing import Protocol

import numpy as np

from skthermo._core.arrays import Array, is_real

Dof = tuple[Hashable, str]
ByProperties = dict[tuple[str, ...], Array]

TRANSLATIONS = ("x", "y", "z")
ROTATIONS = ("rx", "ry", "rz")


class Element(Protocol):
    """The interface of elements that `Structure` assembles; your own element needs these methods.

    Attributes
    ----------
    nodes : tuple of hashable
        Names of its nodes.

    Notes
    -----
    Stiffness is a dictionary from properties to matrices: ``{("E", "A"): matrix}`` says that the matrix is
    proportional to the properties E and A, so that each of them can be a parameter. The same holds for mass. Rows are
    in the order of ``dofs``, whose directions are "x", "y", "z", "rx", "ry" and "rz" (in 2-D: "x" and "y").
    """

    @property
    def nodes(self) -> tuple[Hashable, ...]:
        """Names of its nodes."""

    def dofs(self, dimension: int) -> list[Dof]:
        """Degrees of freedom of every row of the matrices.

        Parameters
        ----------
        dimension : {2, 3}
            Of the structure.

        Returns
        -------
        list of (hashable, str)
            Node and direction.
        """

    def properties(self) -> Iterator[tuple[str, float, bool]]:
        """Physical properties, such as E and A.

        Yields
        ------
        name : str
            Symbol.
        value : float
            In SI units.
        may_be_zero : bool
            Whether the value 0 is allowed.
        """

    def ends(self, coordinates: Array) -> Array:
        """Ends or corners of the element itself.

        Parameters
        ----------
        coordinates : ndarray of shape (n_nodes, dimension)
            Of its nodes in m.

        Returns
        -------
        ndarray of shape (n_ends, dimension)
            In m; the nodes, unless the element begins at an offset from them.
        """

    def stiffness(self, coordinates: Array) -> ByProperties:
        """Stiffness matrices, one for each product of properties.

        Parameters
        ----------
        coordinates : ndarray of shape (n_nodes, dimension)
            Of its nodes in m.

        Returns
        -------
        dict of tuple of str to ndarray of shape (n_dofs, n_dofs)
            In N/m for translations.
        """

    def mass(self, coordinates: Array) -> ByProperties:
        """Mass matrices, one for each product of properties.

        Parameters
        ----------
        coordinates : ndarray of shape (n_nodes, dimension)
            Of its nodes in m.

        Returns
        -------
        dict of tuple of str to ndarray of shape (n_dofs, n_dofs)
            In kg for translations.
        """


class PhysicalElement(Element, Protocol):
    """Base of the elements: properties by their names, translations of all nodes, ends at the nodes."""

    _properties: tuple[str, ...]
    _may_be_zero: tuple[str, ...] = ()

    def properties(self) -> Iterator[tuple[str, float, bool]]:
        for name in self._properties:
            yield name, getattr(self, name), name in self._may_be_zero

    def dofs(self, dimension: int) -> list[Dof]:
        return [(node, direction) for node in self.nodes for direction in TRANSLATIONS[:dimension]]

    def ends(self, coordinates: Array) -> Array:
        return coordinates


def check_matrices(name: Hashable, element: Element, matrices: ByProperties, n_dofs: int, what: str) -> ByProperties:
    """Refuse matrices of another size than the element's degrees of freedom, or of properties that it has not."""
    known = {symbol for symbol, _, _ in element.properties()}
    for properties, matrix in matrices.items():
        if not isinstance(properties, tuple) or not set(properties) <= known:
            raise ValueError(
                f"the {what} of member {name!r} has the key {properties!r}; expected a tuple of its properties "
                f"{sorted(known)}"
            )
        if np.shape(matrix) != (n_dofs, n_dofs):
            raise ValueError(
                f"the {what} of member {name!r} has shape {np.shape(matrix)}; expected ({n_dofs}, {n_dofs}), a row for "
                "each of its dofs"
            )
    return matrices


def check_element(name: Hashable, element: Element, coordinates: Mapping[Hashable, Array], extent: float) -> None:
    """Raise an error if an element has unknown nodes, is too short, or has a property that is not positive."""
    interface = ("nodes", "dofs", "properties", "ends", "stiffness", "mass")
    missing = [member for member in interface if not hasattr(element, member)]
    if isinstance(element, type) or missing:
        lacks = f", which has no {missing[0]!r}" if missing and len(missing) < len(interface) else ""
        raise ValueError(f"member {name!r} is {element!r}{lacks}; expected an element such as Bar(...)")
    for node in element.nodes:
        if not isinstance(node, Hashable) or node not in coordinates:
            raise ValueError(f"member {name!r} ends at node {node!r:.100}; expected one of the nodes")
    lumped = getattr(element, "lumped", False)
    if not isinstance(lumped, bool):
        raise ValueError(f"member {name!r} has lumped = {lumped!r:.100}; expected True or False")
    ends = element.ends(np.array([coordinates[node] for node in element.nodes]))
    sides = np.linalg.norm(ends - np.roll(ends, 1, axis=0), axis=1)
    shortest = 1e-6 * extent
    if len(ends) > 1 and sides.min() <= shortest:
        raise ValueError(
            f"member {name!r} has a length of {sides.min():.3g} m; expected at least {shortest:.3g} m, "
            f"a millionth of the structure's extent of {extent:.6g} m: are two of its nodes the same?"
        )
    for symbol, value, may_be_zero in element.properties():
        expected = "zero or more" if may_be_zero else "a positive number"
        if not (is_real(value) and value < 1e40 and (value > 0 or (may_be_zero and value == 0))):  # products are finite
            raise ValueError(f"member {name!r} has {symbol} = {value!r}; expected {expected}")
