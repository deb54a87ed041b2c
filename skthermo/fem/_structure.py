"""Structures of members, own ones and those that another program has assembled, as affine models."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Literal

import numpy as np
import scipy.sparse

from skthermo._core.arrays import Array, Label, Matrix, MatrixLike, mapping_of, real_array
from skthermo.fem._terms import Content, Key, PartsOfMass
from skthermo.fem.affine import AffineModel, ReducedModel
from skthermo.fem.elements import (
    ROTATIONS,
    TRANSLATIONS,
    ByProperties,
    Dof,
    Element,
    PhysicalElement,
    check_element,
    check_matrices,
)


class TermAssembler:
    """Sums members' matrices, at the free ``dofs``, into one term for each combination of parameters and groups."""

    def __init__(self, dofs: Sequence[Label]):
        self._index = {dof: i for i, dof in enumerate(dofs)}
        self._entries: dict[tuple[Key, frozenset[str]], list[tuple[tuple[Hashable, Key], tuple[Array, ...]]]] = {}

    def add(
        self,
        member: Hashable,
        matrices: ByProperties,
        dofs: Sequence[Dof],
        bound: Mapping[str, str],
        damage: Mapping[str, str] | None = None,
    ) -> None:
        """Add one member's matrices, given the parameters and damage groups bound to its properties."""
        rows = np.array([self._index.get(dof, -1) for dof in dofs])
        free = np.flatnonzero(rows >= 0)
        square, kept = np.ix_(free, free), rows[free]
        grid = np.repeat(kept, len(kept)), np.tile(kept, len(kept))
        for properties, matrix in matrices.items():
            key = tuple(
                parameter
                for parameter, prop in bound.items()
                for _ in range(1 if prop in ("stiffness", "mass") else properties.count(prop))
            )
            groups = frozenset(g for g, prop in (damage or {}).items() if prop in ("stiffness", *properties))
            block = matrix[square].ravel()
            self._entries.setdefault((key, groups), []).append(((member, properties), (block, *grid)))

    def terms(self) -> list[tuple[Key, scipy.sparse.csr_array]]:
        """Parameters and matrix of every term."""
        shape, terms = (len(self._index), len(self._index)), list[tuple[Key, scipy.sparse.csr_array]]()
        for (key, _), entries in self._entries.items():
            values, rows, columns = map(np.concatenate, zip(*(block for _, block in entries), strict=True))
            terms.append((key, scipy.sparse.csr_array((values, (rows, columns)), shape=shape)))
        return terms or [((), scipy.sparse.csr_array(shape))]

    def positions(self, group: str) -> list[int]:
        """Positions of the terms that a damage group scales."""
        return [i for i, (_, damage) in enumerate(self._entries) if group in damage]

    @property
    def contents(self) -> list[list[tuple[Hashable, Key]]]:
        """Members and properties whose matrices each term sums."""
        return [[content for content, _ in entries] for entries in self._entries.values()]


Binding = tuple[str, str] | tuple[str, str, str]
Target = tuple[str, str, tuple[str, ...]]


Assembled = tuple[
    list[tuple[Key, Matrix]], list[tuple[Key, Matrix]] | Matrix, dict[str, list[int]], list[list[Content]], PartsOfMass
]
"""Terms of stiffness and mass, stiffness terms of each damage group, members and properties of each, and the masses of
damage groups."""


class Structure:
    """Nodes, members, supports and named groups, from which FE models are assembled.

    Parameters
    ----------
    nodes : mapping of node to coordinates
        (x, y) or (x, y, z) in m.
    members : mapping of member to element
        `Bar`, `Beam`, `Membrane`, `Spring` and `PointMass` objects.
    supports : mapping of node to directions
        Fixed directions of a node, such as "xy", ("x", "y") or "xyz rx ry rz".
    groups : mapping of group to members, optional
        Named groups; a member may be in several, or in none.

    Attributes
    ----------
    dofs : list of (node, direction)
        Free degrees of freedom in the order of the matrices' rows.
    nodes, members : dict
        Coordinates of every node in m, and elements by name.
    groups, supports : dict
        Members of every named group, and fixed directions of every supported node.

    Raises
    ------
    ValueError
        If a node, member, group or direction is unknown, duplicated or disconnected, or a member is shorter than a
        millionth of the structure or has a property that is not positive. The error names it.

    Examples
    --------
    A king-post truss with its post and rafters as parameters:

    >>> from skthermo.fem import Bar, Structure
    >>> steel = dict(E=210e9, A=0.01, density=7850.0)
    >>> structure = Structure(
    ...     nodes={"left": (0, 0), "foot": (3, 0), "right": (6, 0), "apex": (3, 2)},
    ...     members={
    ...         "tie 1": Bar("left", "foot", **steel), "tie 2": Bar("foot", "right", **steel),
    ...         "rafter 1": Bar("left", "apex", **steel), "rafter 2": Bar("apex", "right", **steel),
    ...         "post": Bar("foot", "apex", **steel)},
    ...     supports={"left": "xy", "right": "y"},
    ...     groups={"rafters": ["rafter 1", "rafter 2"], "post": ["post"]})
    >>> model = structure.assemble(["rafters", "post"], n_modes=2)
    >>> model.frequencies([[1.0, 1.0]]).round(2)
    array([[ 93.94, 186.36]])
    """

    def __init__(
        self,
        nodes: Mapping[Hashable, Sequence[float]],
        members: Mapping[Hashable, Element],
        supports: Mapping[Hashable, Collection[str]],
        groups: Mapping[str, Collection[Hashable]] | None = None,
    ):
        either = "a mapping of node to directions, such as {'left': 'xy'}, or {} where springs hold the structure"
        self.nodes = read_coordinates(mapping_of(nodes, "nodes", "a mapping of node to coordinates"))
        self.members = dict(mapping_of(members, "members", "a mapping of member to element"))
        places = np.array(list(self.nodes.values()))
        extent = float(np.linalg.norm(places.max(axis=0) - places.min(axis=0)))
        for name, element in self.members.items():
            check_element(name, element, self.nodes, extent)
        self._check_places()
        named = mapping_of(groups or {}, "groups", "a mapping of group to members")
        self.groups = {group: self._read_group(group, names) for group, names in named.items()}
        self.supports = self._read_supports(mapping_of(supports, "supports", either))
        self.dofs: list[Label] = list(self._free_dofs())

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(next(iter(self.nodes.values())))

    @property
    def n_dof(self) -> int:
        """Number of free degrees of freedom."""
        return len(self.dofs)

    def assemble(
        self,
        parameters: Sequence[str] | Mapping[str, str | Binding],
        *,
        groups: Sequence[str] | Mapping[str, str | Binding] | None = None,
        n_modes: int | None = None,
        track: bool = False,
    ) -> AffineModel:
        """The structure as an FE model.

        Parameters
        ----------
        parameters : sequence of str, or mapping of str to group or (property, group[, matrix])
            Parameters, and the properties that theta multiplies. The name of a group means its whole stiffness;
            ``{"A_arch": ("A", "arches")}`` means one property ("E", "A", "I_yy", "k", "m", ...) of its members, in
            stiffness and mass; ``("A", "arches", "stiffness")`` means the stiffness alone (or ``"mass"``); ``("mass",
            group)`` means the whole mass of a group.
        groups : sequence of str, or mapping of str to group or (property, group), optional
            Damage groups: the whole stiffness of a group, or the part of it that one property multiplies, as in
            ``{"torsion": ("G", "girder")}``. By default all groups of the structure. With its section, a group loses
            the mass of its members, or the part that the property multiplies; point masses stay.
        n_modes : int, optional
            How many of the lowest modes the model gives. By default six, or all if there are fewer.
        track : bool, default=False
            Whether a column follows its mode rather than its rank.

        Returns
        -------
        AffineModel
            With the parameters and damage groups asked for.

        Raises
        ------
        ValueError
            If a group or property is unknown, a property in ``groups`` does not affect the stiffness, or the structure
            is a mechanism.
        """
        bindings = self._read_bindings(parameters, "parameter")
        damageable = self._read_bindings(list(self.groups) if groups is None else groups, "damage group")
        stiffness, mass, scaled, contents, parts = self._assembled(bindings, damageable)
        scaled = {name: terms for name, terms in scaled.items() if terms or groups is not None}
        known = {name: places for name, places in parts.groups.items() if name in scaled}
        return AffineModel(
            stiffness,
            mass,
            n_modes=n_modes,
            parameter_names=tuple(bindings),
            groups=scaled,
            group_mass=parts._replace(groups=known),
            track=track,
            dofs=self.dofs,
            contents=contents,
        )

    def _assembled(self, bindings: Mapping[str, Target], damageable: Mapping[str, Target]) -> Assembled:
        stiffness, mass, parts = (TermAssembler(self.dofs) for _ in range(3))
        for name, element in self.members.items():
            coordinates = np.array([self.nodes[node] for node in element.nodes])
            dofs = element.dofs(self.dimension)
            damage = self._bound(name, damageable, "stiffness")
            matrices = check_matrices(name, element, element.stiffness(coordinates), len(dofs), "stiffness")
            stiffness.add(name, matrices, dofs, self._bound(name, bindings, "stiffness"), damage)
            masses = check_matrices(name, element, element.mass(coordinates), len(dofs), "mass")
            bound = self._bound(name, bindings, "mass")
            mass.add(name, masses, dofs, bound)
            if matrices and damage:
                parts.add(name, masses, dofs, bound, damage)
        scaled = {name: stiffness.positions(name) for name in damageable}
        lost = {name: tuple(parts.positions(name)) for name in damageable}
        groups_mass = PartsOfMass(parts.terms() if parts.contents else [], lost, parts.contents)
        return stiffness.terms(), mass.terms(), scaled, stiffness.contents, groups_mass

    def divide(
        self, model: AffineModel | ReducedModel, groups: Mapping[str, Mapping[str, Collection[Hashable]]]
    ) -> AffineModel | ReducedModel:
        """A model of this structure with further damage groups, which hold some members of its groups.

        Parameters
        ----------
        model : AffineModel or ReducedModel
            Assembled from this structure; it may have been calibrated, damaged or reduced since.
        groups : mapping of str to mapping of str to collection of members
            Damage group of the model -> name of each part -> members of the part. Parts of a group may not overlap; a
            group need not be divided wholly. If one property is damaged in the group, so it is in its parts.

        Returns
        -------
        AffineModel or ReducedModel
            With the same parameters and frequencies.

        Raises
        ------
        ValueError
            If the model is of another structure or divided already, a group or member is unknown, a member is in two
            parts, or a name is taken.

        Examples
        --------
        >>> from skthermo.fem import Bar, Structure
        >>> steel = dict(E=210e9, A=0.01, density=7850.0)
        >>> bars = {"west": Bar("left", "apex", **steel), "east": Bar("apex", "right", **steel)}
        >>> nodes = {"left": (0, 0), "right": (6, 0), "apex": (3, 2)}
        >>> structure = Structure(nodes, bars, {"left": "xy", "right": "xy"}, {"rafters": ["west", "east"]})
        >>> divided = structure.divide(structure.assemble("rafters", n_modes=2), {"rafters": {"western": ["west"]}})
        >>> divided.groups
        {'rafters': (0, 1), 'western': (1,)}
        """
        if not getattr(model, "contents", ()):
            raise ValueError(
                f"{model!r:.200} does not know its members; expected a model that this structure has assembled, "
                "by structure.assemble(...), and that is not divided yet"
            )
        terms = model.stiffness_terms
        if terms[0].shape[0] != self.n_dof:
            raise ValueError(
                f"the model has {terms[0].shape[0]} degrees of freedom, but the structure {self.n_dof}; expected a "
                "model that this structure has assembled"
            )
        masses = model._parts_of_mass
        parts: dict[str, dict[int, MatrixLike]] = {}
        lighter: dict[str, dict[int, MatrixLike]] = {}
        for group, named in groups.items():
            if group not in model.groups:
                raise ValueError(f"unknown damage group {group!r}; expected one of {sorted(model.groups)}")
            part_of = {member: name for name, members in named.items() for member in members}
            if len(part_of) < sum(len(set(members)) for members in named.values()):
                raise ValueError(f"parts of group {group!r} overlap; expected every member in one part only")
            inside = {member for position in model.groups[group] for member, _ in model.contents[position]}
            unknown = part_of.keys() - inside
            if unknown:
                raise ValueError(f"{sorted(map(str, unknown))} are not in group {group!r}; expected members of it")
            for position in model.groups[group]:
                for name, matrix in self._sum_by_part(model.contents[position], part_of, terms[position]).items():
                    parts.setdefault(name, {})[position] = matrix
            lighter |= {name: {} for name in named if group in masses.groups and masses.contents}
            for position in masses.groups.get(group, ()) if masses.contents else ():
                contents, mass = masses.contents[position], masses.terms[position][1]
                for name, matrix in self._sum_by_part(contents, part_of, mass, "mass").items():
                    lighter[name][position] = matrix
        return model.with_parts(parts, lighter)

    def _sum_by_part(
        self,
        contents: Sequence[tuple[Hashable, tuple[str, ...]]],
        part_of: Mapping[Hashable, str],
        term: Matrix,
        what: Literal["stiffness", "mass"] = "stiffness",
    ) -> dict[str, Matrix]:
        """Summed matrices of the members of every part of a term, after a check that all members make up the term."""
        assembler = TermAssembler(self.dofs)
        for member, properties in contents:
            element = self.members.get(member)
            nodes = [] if element is None else [self.nodes[node] for node in element.nodes]
            matrices = {} if element is None else getattr(element, what)(np.array(nodes))
            if element is None or properties not in matrices:
                raise ValueError(
                    f"member {member!r} of the model is not in the structure; expected the model's structure"
                )
            part = {part_of[member]: "stiffness"} if member in part_of else {}
            assembler.add(member, {properties: matrices[properties]}, element.dofs(self.dimension), {}, part)
        summed = [matrix for _, matrix in assembler.terms()]
        check_same(sum(summed), term, contents)
        names = [name for name in dict.fromkeys(part_of.values()) if assembler.positions(name)]
        return {name: summed[assembler.positions(name)[0]] for name in names}

    def _bound(self, member: Hashable, bindings: Mapping[str, Target], matrix: str) -> dict[str, str]:
        """The parameters or damage groups of one member, and the property that each acts on."""
        return {
            name: prop
            for name, (prop, group, matrices) in bindings.items()
            if member in self.groups[group] and matrix in matrices
        }

    def _read_bindings(self, targets, what: str) -> dict[str, Target]:
        """Property, group and matrices of every parameter or damage group."""
        if not isinstance(targets, Mapping):
            names = [targets] if isinstance(targets, str) else list(targets) if isinstance(targets, Iterable) else []
            if not names or not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
                raise ValueError(f"{what}s is {targets!r}; expected names of groups, each once, or a mapping")
            targets = {group: group for group in names}
        bindings = {}
        for name, target in targets.items():
            if not isinstance(target, str) and not (isinstance(target, Sequence) and len(target) in (2, 3)):
                expected = "a group, (property, group) or (property, group, matrix)"
                raise ValueError(f"{what} {name!r} is {target!r}; expected {expected}")
            prop, group, *where = ("stiffness", target) if isinstance(target, str) else target
            matrices = (prop,) if prop in ("stiffness", "mass") else ("stiffness", "mass")
            if not set(where) <= set(matrices):
                raise ValueError(f"{what} {name!r} is {target!r}; expected {' or '.join(matrices)} as its matrix")
            if group not in self.groups:
                raise ValueError(f"{what} {name!r}: unknown group {group!r}; expected one of {sorted(self.groups)}")
            members = self.groups[group]
            known = {symbol for member in members for symbol, _, _ in self.members[member].properties()}
            if prop not in known | {"stiffness", "mass"}:
                raise ValueError(
                    f"{what} {name!r} is the property {prop!r} of group {group!r}; "
                    f"expected 'stiffness', 'mass' or one of {sorted(known)}"
                )
            bindings[name] = (prop, group, tuple(where) or matrices)
        return bindings

    def _check_places(self) -> None:
        """Refuse two nodes at one place that no member connects: a joint has a spring."""
        connected = [set(element.nodes) for element in self.members.values()]
        first: dict[tuple[float, ...], Hashable] = {}
        for node, xyz in self.nodes.items():
            twin = first.setdefault(tuple(xyz.tolist()), node)
            if twin != node and not any({twin, node} <= nodes for nodes in connected):
                raise ValueError(
                    f"nodes {twin!r} and {node!r} are duplicates: both are at {tuple(xyz.tolist())}; expected one "
                    f"node, or a joint, such as Spring({twin!r}, 'rz', k, to={node!r})"
                )

    def _read_group(self, group: str, names: object) -> frozenset:
        if not isinstance(names, Collection):
            raise ValueError(f"group {group!r} is {names!r}; expected names of members")
        members = frozenset([names] if isinstance(names, str) else names)
        unknown = members - self.members.keys()
        if unknown or not members:
            raise ValueError(f"group {group!r} holds {list(unknown) or 'no member'}; expected names of members")
        return members

    def _free_dofs(self) -> Sequence[Label]:
        directions = self._directions
        used: set[Dof] = set()
        for name, element in self.members.items():
            for node, direction in element.dofs(self.dimension):
                if direction not in directions:
                    raise ValueError(
                        f"member {name!r} acts along {direction!r} of node {node!r}; expected one of {directions}"
                    )
                used.add((node, direction))
        connected = {node for element in self.members.values() for node in element.nodes}
        for node in self.nodes:
            if node not in connected:
                raise ValueError(f"node {node!r} is disconnected: no member ends there")
        used -= {(node, direction) for node, along in self.supports.items() for direction in along}
        free = [dof for node in self.nodes for d in directions if (dof := (node, d)) in used]
        if not free:
            raise ValueError("the supports fix every node in every direction; expected a structure that can move")
        return free

    def _read_supports(self, supports: Mapping[Hashable, Collection[str]]) -> dict[Hashable, tuple[str, ...]]:
        found = {}
        for node, along in supports.items():
            if node not in self.nodes:
                raise ValueError(f"the supports name node {node!r}, which is not among the nodes")
            found[node] = tuple(_read_directions(along, node))
            wrong = [direction for direction in found[node] if direction not in self._directions]
            if wrong:
                raise ValueError(f"support of node {node!r} along {wrong[0]!r}; expected some of {self._directions}")
        return found

    @property
    def _directions(self) -> tuple[str, ...]:
        return TRANSLATIONS[:2] if self.dimension == 2 else (*TRANSLATIONS, *ROTATIONS)

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}({len(self.nodes)} nodes, {len(self.members)} members, "
            f"{self.n_dof} degrees of freedom, groups {sorted(self.groups)})"
        )


def check_same(summed: Matrix, term: Matrix, contents: Sequence[tuple[Hashable, Key]]) -> None:
    """Raise an error if the matrices of a term's members do not add up to the term."""
    if abs(summed - term).max() > 1e-9 * abs(term).max():
        raise ValueError(
            f"members such as {contents[0][0]!r} have another stiffness in the model than in the structure; "
            "expected the structure that assembled the model"
        )


def _read_directions(along: object, node: Hashable) -> list[str]:
    """List of directions from a collection such as ("x", "ry"), or from text: "xyz rx ry" names five."""
    if not isinstance(along, Collection | None):
        raise ValueError(f"support of node {node!r} is {along!r}; expected directions such as 'xy' or ('x', 'ry')")
    if not isinstance(along, str):
        return list(along or ())
    words = along.split()
    return [d for word in words for d in (word if set(word) <= set(TRANSLATIONS) else [word])]


def read_coordinates(nodes: Mapping[Hashable, Sequence[float]]) -> dict[Hashable, Array]:
    """Coordinates of every node, two or three finite numbers each."""
    if not nodes:
        raise ValueError("nodes is empty; expected a mapping of node to coordinates")
    coordinates: dict[Hashable, Array] = {}
    first = np.shape(next(iter(nodes.values())))
    for node, place in nodes.items():
        try:
            xyz = np.array(real_array(place, "coordinates"))
        except (TypeError, ValueError):
            xyz = np.empty(0)
        if xyz.shape not in ((2,), (3,)) or xyz.shape != first or not np.isfinite(xyz).all():
            raise ValueError(
                f"node {node!r} has the coordinates {place!r}; expected two or three finite numbers, "
                "as many as the first node has"
            )
        xyz = xyz + 0.0  # no negative zeros
        xyz.flags.writeable = False
        coordinates[node] = xyz
    return coordinates


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
        the mass, stay as they are; ``group_mass`` of members is the mass that groups of them lose with their section.
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
        nodes = mapping_of(nodes, "nodes", "a mapping of node to coordinates")
        members = mapping_of(members, "members", "a mapping of parameter to nodes")
        supports = mapping_of(supports or {}, "supports", "a mapping of node to directions")
        self._matrices, self._rest = matrices_by_member(model, list(members))
        coordinates, ends = placed(nodes, members, supports)
        self._labels = model.dofs
        super().__init__(coordinates, {name: ImportedMember(ends[name]) for name in members}, supports, groups)
        self._mass = model.matrices(np.ones(len(model.parameter_names)))[1]
        self._masses: dict[Hashable, Matrix] = dict(model.group_mass.items())

    @property
    def n_dof(self) -> int:
        return self._mass.shape[0]

    def _assembled(self, bindings: Mapping[str, Target], damageable: Mapping[str, Target]) -> Assembled:
        for name, (what, _, _) in {**bindings, **damageable}.items():
            if what == "mass":
                raise ValueError(f"{name!r} multiplies mass, which is not known by member; expected groups")
        members_of: dict[tuple[Key, Key], list[Hashable]] = {}
        for member in self.members:
            key, damage = (tuple(self._bound(member, bound, "stiffness")) for bound in (bindings, damageable))
            members_of.setdefault((key, damage), []).append(member)
        terms = [(key, self._sum_of(members, self._matrices)) for (key, _), members in members_of.items()]
        contents: list[list[tuple[Hashable, Key]]] = [[(one, ()) for one in members] for members in members_of.values()]
        if self._rest.nnz:
            terms.append(((), self._rest))
            contents.append([])
        scaled = {name: [i for i, (_, damage) in enumerate(members_of) if name in damage] for name in damageable}
        known = [name for name, (_, group, _) in damageable.items() if self.groups[group] <= self._masses.keys()]
        masses = [((), self._sum_of(members, self._masses)) for members in members_of.values()]
        parts = PartsOfMass(masses if known else [], {name: tuple(scaled[name]) for name in known}, contents)
        return terms, self._mass, scaled, contents, parts

    def _free_dofs(self) -> Sequence[Label]:
        return self._labels

    def _sum_by_part(
        self,
        contents: Sequence[tuple[Hashable, Key]],
        part_of: Mapping[Hashable, str],
        term: Matrix,
        what: Literal["stiffness", "mass"] = "stiffness",
    ) -> dict[str, Matrix]:
        matrices = self._matrices if what == "stiffness" else self._masses
        check_same(self._sum_of([member for member, _ in contents], matrices), term, contents)
        parts: dict[str, list[Hashable]] = {}
        for member, _ in contents:
            if member in part_of:
                parts.setdefault(part_of[member], []).append(member)
        return {name: self._sum_of(members, matrices) for name, members in parts.items()}

    def _sum_of(self, members: Sequence[Hashable], matrices: Mapping[Hashable, Matrix]) -> Matrix:
        known = (matrices[member] for member in members if member in matrices)
        return reduce(add, known, scipy.sparse.csc_array((self.n_dof, self.n_dof)))


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
