"""Structures of members whose matrices another program has assembled."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
import scipy.sparse

from skthermo._core.arrays import Array, Label, Matrix
from skthermo.fem._structure import (
    Assembled,
    Key,
    Structure,
    Target,
    check_same,
    read_coordinates,
)
from skthermo.fem.affine import AffineModel
from skthermo.fem.elements import ByProperties, PhysicalElement


@dataclass(frozen=True)
class ImportedMember(PhysicalElement):
    """Ends or corners of a member, whose stiffness `ImportedStructure` holds, a matrix of all degrees of freedom."""

    corners: tuple[Hashable, ...]

    _properties = ()

    @property
    def nodes(self) -> tuple[Hashable, ...]:
        return self.corners

    def stiffness(self, coordinates: Array) -> ByProperties:
        return {}

    def mass(self, coordinates: Array) -> ByProperties:
        return {}


class ImportedStructure(Structure):
    """Nodes, members and groups of a model that another program has assembled, with a term for each member.

    It serves wherever a `Structure` does: `assemble` makes the whole stiffness of groups of members the parameters,
    `divide` takes groups apart, `skthermo.studies.identify_damage` finds damaged members, and displays draw them.

    Parameters
    ----------
    model : AffineModel
        Each member is one of its parameters, as `load_affine` gives them for a folder with one file for each member. A
        member may be one element or several, such as all shells between two cross beams. Stiffness of no member, and
        the mass, stay as they are.
    nodes : mapping of node to coordinates
        (x, y) or (x, y, z) in m. Nodes at which neither members end nor supports are, are left out.
    members : mapping of str to node or sequence of nodes
        Parameter of the model -> its ends or corners. They say which members follow each other, and where they are
        drawn: two nodes are a line, three or more a surface, and a single one is a point, such as a bearing.
    groups : mapping of str to collection of str, optional
        Named groups of members; a member may be in several, or in none.
    supports : mapping of node to directions, optional
        Fixed directions of a node, such as "xy"; only for drawing.

    Attributes
    ----------
    dofs : list of (node, direction)
        Labels of the matrices' rows, as in the model; none if it has none.

    Raises
    ------
    ValueError
        If a member is no parameter of the model or shares a term with another, the model is damaged or calibrated, or
        for nodes, members and groups that `Structure` does not accept.

    See Also
    --------
    load_affine : Reads such a model from files.
    Structure : Assembles members of your own.

    Examples
    --------
    A tower of three storeys; a program has written the stiffness of each:

    >>> import numpy as np
    >>> from skthermo.fem import AffineModel, ImportedStructure
    >>> stiffness = {("s1",): 400 * np.diag([1.0, 0, 0])}
    >>> for name, i in {"s2": 0, "s3": 1}.items():
    ...     stiffness[name,] = np.zeros((3, 3))
    ...     stiffness[name,][i : i + 2, i : i + 2] = [[400, -400], [-400, 400]]
    >>> heights = {storey: (0.0, 0.0, 3.0 * storey) for storey in range(4)}
    >>> members = {"s1": (0, 1), "s2": (1, 2), "s3": (2, 3)}
    >>> exported = AffineModel(stiffness, np.eye(3), n_modes=2)
    >>> tower = ImportedStructure(exported, heights, members, {"all": members, "upper": ["s2", "s3"]})
    >>> model = tower.assemble(["all"], groups=["upper"], n_modes=2)
    >>> model.parameter_names, model.frequencies([[1.0], [1.1]]).round(3).tolist()
    (('all',), [[1.417, 3.969], [1.486, 4.163]])
    >>> tower.divide(model, {"upper": {"top": ["s3"]}}).groups
    {'upper': (1, 2), 'top': (2,)}
    """

    def __init__(
        self,
        model: AffineModel,
        nodes: Mapping[Hashable, Sequence[float]],
        members: Mapping[str, Hashable | Sequence[Hashable]],
        groups: Mapping[str, Collection[str]] | None = None,
        *,
        supports: Mapping[Hashable, Collection[str]] | None = None,
    ):
        if not isinstance(model, AffineModel):
            raise ValueError(f"model is {model!r:.200}; expected an AffineModel with a parameter for each member")
        for what, argument in {"nodes": nodes, "members": members}.items():
            if not isinstance(argument, Mapping) or not argument:
                raise ValueError(f"{what} is {argument!r:.200}; expected a mapping that is not empty")
        self._matrices, self._rest = matrices_by_member(model, list(members))
        if not isinstance(supports, Mapping | None):
            raise ValueError(f"supports is {supports!r:.200}; expected a mapping of node to directions")
        coordinates, ends = placed(nodes, members, supports or {})
        self._labels = model.dofs
        super().__init__(coordinates, {name: ImportedMember(ends[name]) for name in members}, supports or {}, groups)
        self._mass = model.matrices(np.ones(len(model.parameter_names)))[1]

    @property
    def n_dof(self) -> int:
        return self._mass.shape[0]

    def _assembled(self, bindings: Mapping[str, Target], damageable: Mapping[str, Target]) -> Assembled:
        for name, (what, _, _) in {**bindings, **damageable}.items():
            if what == "mass":
                raise ValueError(f"{name!r} multiplies mass, which is not known by member; expected groups")
        members_of: dict[tuple[Key, Key], list[Hashable]] = {}
        for member in self._members:
            key, damage = (tuple(self._bound(member, bound, "stiffness")) for bound in (bindings, damageable))
            members_of.setdefault((key, damage), []).append(member)
        terms = [(key, self._sum_of(members)) for (key, _), members in members_of.items()]
        contents: list[list[tuple[Hashable, Key]]] = [[(one, ()) for one in members] for members in members_of.values()]
        if self._rest.nnz:
            terms.append(((), self._rest))
            contents.append([])
        scaled = {name: [i for i, (_, damage) in enumerate(members_of) if name in damage] for name in damageable}
        return Assembled(terms, self._mass, scaled, contents)

    def _free_dofs(self, supports: Mapping[Hashable, Collection[str]]) -> Sequence[Label]:
        self._fixed_dofs(supports)
        return self._labels

    def _sum_by_part(
        self, contents: Sequence[tuple[Hashable, Key]], part_of: Mapping[Hashable, str], term: Matrix
    ) -> dict[str, Matrix]:
        check_same(self._sum_of([member for member, _ in contents]), term, contents)
        parts: dict[str, list[Hashable]] = {}
        for member, _ in contents:
            if member in part_of:
                parts.setdefault(part_of[member], []).append(member)
        return {name: self._sum_of(members) for name, members in parts.items()}

    def _sum_of(self, members: Sequence[Hashable]) -> Matrix:
        matrices = (self._matrices[member] for member in members if member in self._matrices)
        return reduce(add, matrices, scipy.sparse.csc_array((self.n_dof, self.n_dof)))


def matrices_by_member(
    model: AffineModel, members: Sequence[str]
) -> tuple[dict[Hashable, Matrix], scipy.sparse.csc_array]:
    """Stiffness of each member, the sum of the terms that its parameter multiplies, and the rest, of no member."""
    known, terms = model.parameter_terms, model.stiffness_terms
    unknown = [member for member in members if not known.get(member)]
    if unknown:
        raise ValueError(f"members {unknown[:5]} have no stiffness term in the model; expected some of {list(known)}")
    owners: dict[int, str] = {}
    for member in members:
        for position in known[member]:
            if owners.setdefault(position, member) != member:
                raise ValueError(f"members {owners[position]!r} and {member!r} share a term; expected one for each")
    none = scipy.sparse.csc_array(terms[0].shape)
    total = model.matrices(np.ones(len(known)))[0]
    if abs(reduce(add, terms, none) - total).max() > 1e-9 * abs(total).max():
        raise ValueError(f"{model!r} is damaged or calibrated; expected the model as the program has written it")
    matrices: dict[Hashable, Matrix] = {
        member: reduce(add, (terms[position] for position in known[member]), none) for member in members
    }
    rest = reduce(add, (term for position, term in enumerate(terms) if position not in owners), none)
    return matrices, rest


def placed(
    nodes: Mapping[Hashable, Sequence[float]],
    members: Mapping[str, Hashable | Sequence[Hashable]],
    supports: Collection[Hashable],
) -> tuple[dict[Hashable, tuple[float, ...]], dict[str, tuple[Hashable, ...]]]:
    """Coordinates of nodes that are used, and the ends of members; nodes at the same place become one."""
    ends = {name: _nodes_of(name, place, nodes) for name, place in members.items()}
    used = [*(node for node in supports if node in nodes), *(node for places in ends.values() for node in places)]
    first: dict[tuple[float, ...], Hashable] = {}
    same = {
        node: first.setdefault(tuple(place.tolist()), node)
        for node, place in read_coordinates({node: nodes[node] for node in used}).items()
    }
    joined = {name: tuple(dict.fromkeys(same[node] for node in places)) for name, places in ends.items()}
    return {node: tuple(place) for place, node in first.items()}, joined


def _nodes_of(name: str, place: object, nodes: Mapping[Hashable, object]) -> tuple[Hashable, ...]:
    """One node, or several; a tuple that is a node's name is one."""
    is_one = isinstance(place, Hashable) and place in nodes
    places = (place,) if is_one or isinstance(place, str) or not isinstance(place, Iterable) else tuple(place)
    unknown = [node for node in places if not isinstance(node, Hashable) or node not in nodes]
    if unknown or not places:
        raise ValueError(
            f"member {name!r} ends at {unknown[0] if unknown else 'no node'!r}; expected some of the nodes"
        )
    return places
