"""What may have changed, and how probable that is beforehand: groups, parameters, masses, stretches of members."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, pairwise
from typing import Any, Literal

import numpy as np
import scipy.sparse
from scipy.sparse.csgraph import connected_components

from skthermo._core.arrays import Array, check_names, is_real, real_array
from skthermo.fem import Structure
from skthermo.fem.damage import ALL_GROUPS, LossKind, kind_option, read_groups

SOMETHING_ELSE, NO_DAMAGE = "something else", "no damage"
MemberLine = list[Hashable]
LIKELY_ONCE = 5.0  # the scale by which an amount of 1 is one standard deviation of the default prior


@dataclass(frozen=True)
class DamagePrior:
    """What is thought of damage before the records are seen: how many causes, how severe, and what else.

    Parameters
    ----------
    numbers : tuple of float, default=(0.5, 0.3, 0.15, 0.05)
        Probabilities that none, one, two or three causes changed the structure; at most four numbers, which add up
        to 1. All sets of as many causes are equally probable.
    severity : float, default=0.2
        Scale of severities: the standard deviation of the half-normal law before it ends at a cause's bounds, or the
        largest severity of the uniform law.
    law : {"half-normal", "uniform"}, default="half-normal"
        Law of severities.
    something_else : float, default=0.05
        Probability that something else shifted the frequencies too: a shift of each mode, independent from mode to
        mode, of unknown size; 0 leaves it out.
    model_error : float, default=0.05
        Standard deviation of the error of the model's effect on each mode, relative to that effect; the effect on all
        modes together is as uncertain.

    Raises
    ------
    ValueError
        If a value is not possible.

    Examples
    --------
    >>> from skthermo.studies import DamagePrior
    >>> DamagePrior(severity=0.3).law
    'half-normal'
    """

    numbers: tuple[float, ...] = (0.5, 0.3, 0.15, 0.05)
    severity: float = 0.2
    law: Literal["half-normal", "uniform"] = "half-normal"
    something_else: float = 0.05
    model_error: float = 0.05

    def __post_init__(self) -> None:
        numbers = real_array(self.numbers, "numbers")
        if numbers.shape not in ((2,), (3,), (4,)) or (numbers < 0).any() or not np.isclose(numbers.sum(), 1):
            expected = "expected probabilities of none, one, two and at most three causes, which add up to 1"
            raise ValueError(f"numbers is {self.numbers!r}; {expected}")
        if not isinstance(self.law, str) or self.law not in ("half-normal", "uniform"):
            raise ValueError(f"law is {self.law!r}; expected 'half-normal' or 'uniform'")
        for name in ("severity", "something_else", "model_error"):
            value = getattr(self, name)
            if not is_real(value) or not 0 <= value <= 1 or (name == "severity" and value == 0):
                raise ValueError(f"{name} is {value!r}; expected a number between 0 and 1")
        object.__setattr__(self, "numbers", tuple(numbers.tolist()))


@dataclass(frozen=True, eq=False)
class Cause:
    """Something that may have changed, by one unknown amount between 0 and a bound, which may be negative.

    Amounts are severities of damage (below 0 for stiffening), relative changes of a parameter, or how many times a
    ``pattern`` of mass or stiffness was added. ``of`` names the model's groups or the parameter that changes. ``rows``
    are the rows of a table in which it counts: its own, those of all groups, or the members of a stretch of ``group``.
    ``scale`` is the standard deviation of the amount over the prior's severity, and ``share`` the part of its group's
    prior probability. One that is ``alone`` explains without others. ``place`` says where a stretch is.
    """

    name: str
    kind: Literal["damage", "stiffening", "parameter", "mass", "spring"] = "damage"
    bound: float = 0.95
    of: tuple[str, ...] = ()
    pattern: Any = None
    scale: float = 1.0
    rows: tuple[Hashable, ...] = ()
    group: str = ""
    share: float = 1.0
    alone: bool = False
    place: str = ""

    @property
    def direction(self) -> int:
        """1 + direction * amount is the factor of what changes."""
        return -1 if self.kind in ("damage", "stiffening") else 1

    def excludes(self, other: Cause) -> bool:
        """Whether both change the same thing, in opposite directions."""
        is_same = self.direction == other.direction and set(self.of) & set(other.of)
        return bool(is_same) and (self.bound > 0) != (other.bound > 0)


def read_causes(
    model: Any, groups: Any, stiffening: Any, parameters: Any, added_mass: Any, added_stiffness: Any
) -> list[Cause]:
    """Causes that are asked for, and an even loss in all groups."""
    members = read_groups(model, groups)
    known = {name: [name] for name in model.groups} | members
    if stiffening is None or isinstance(stiffening, bool | np.bool_):
        stiffening = list(members) if stiffening else []
    causes = [Cause(name, of=tuple(of)) for name, of in members.items()]
    for name, bound, scale in _rises(stiffening, "stiffening", known):
        causes.append(Cause(f"{name} stiffer", "stiffening", -bound, tuple(known[name]), scale=scale))
    for name, bound, scale in _rises([] if parameters is None else parameters, "parameters", model.parameter_names):
        if not isinstance(parameters, Mapping):
            causes.append(Cause(f"{name} lower", "parameter", -0.95, (name,)))
        causes.append(Cause(f"{name} higher", "parameter", bound, (name,), scale=scale))
    for kind, what, given in (("mass", "mass", added_mass), ("spring", "stiffness", added_stiffness)):
        for name, pattern in _read_patterns(model, what, given).items():
            lowest = pattern.diagonal().min()  # what takes away does so once at most
            bound = 3.0 if lowest >= 0 else 1.0
            causes.append(Cause(name, kind, bound, pattern=pattern, scale=LIKELY_ONCE))
    names = [cause.name for cause in causes]
    wrong = [name for name in names if name in (SOMETHING_ELSE, NO_DAMAGE, ALL_GROUPS, "") or names.count(name) > 1]
    if wrong:
        raise ValueError(
            f"causes have the names {wrong}; expected names in groups or of what was added that differ from each other "
            f"and from {SOMETHING_ELSE!r}, {NO_DAMAGE!r} and {ALL_GROUPS!r}"
        )
    causes = [replace(cause, rows=(cause.name,), group=cause.name) for cause in causes]
    if len(members) > 1:
        everything = tuple(dict.fromkeys(name for of in members.values() for name in of))
        causes.append(Cause(ALL_GROUPS, of=everything, rows=tuple(members), group=ALL_GROUPS, alone=True))
    return causes


def _rises(given: Any, what: str, known: Collection[str]) -> Iterator[tuple[str, float, float]]:
    """Names of what may rise, up to which relative rise, and the scale of the amount: a rise that is given is likely,
    and three times as much possible."""
    for name in check_names([given] if isinstance(given, str) else given, what, sorted(known)):
        if not isinstance(given, Mapping):
            yield name, 1.0, 1.0
            continue
        size = given[name]
        if not is_real(size) or not 0 < size < np.inf:
            raise ValueError(f"{what} has {name!r}: {size!r}; expected a relative rise above 0, such as 4.0")
        yield name, 3.0 * size, LIKELY_ONCE * size


def _read_patterns(model: Any, what: str, given: Any) -> dict[str, Any]:
    """Matrices of added mass or stiffness; a vector is the diagonal of one."""
    if given is None:
        return {}
    argument, unit = f"added_{what}", {"mass": "kg", "stiffness": "N/m"}[what]
    if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
        raise ValueError(f"{argument} is {given!r:.200}; expected a mapping of name to {what} in {unit}")
    if given and not hasattr(model, "with_added"):
        raise ValueError(f"{argument} is given, but {model!r} has no method 'with_added'; expected an AffineModel")
    found = {}
    for name, pattern in given.items():
        array = pattern if scipy.sparse.issparse(pattern) else np.asarray(pattern, dtype=float)
        found[name] = scipy.sparse.diags(array, format="csr") if array.ndim == 1 else array
        try:
            model.with_added(**{what: found[name]})
        except ValueError as error:
            raise ValueError(f"{argument} {name!r}: {error}") from error
    return found


def changed(
    model: Any, theta: Array, causes: Sequence[Cause], amounts: Sequence[float], kind: LossKind
) -> tuple[Any, Array]:
    """The model, and its parameters theta (1, n_parameters), after some amounts of causes, damage of one kind."""
    factors: dict[str, float] = {}
    theta = theta.copy()
    for cause, amount in zip(causes, amounts, strict=True):
        if cause.kind in ("mass", "spring"):
            model = model.with_added(**{"mass" if cause.kind == "mass" else "stiffness": amount * cause.pattern})
        elif cause.kind == "parameter":
            theta[:, list(model.parameter_names).index(cause.of[0])] *= 1 + amount
        else:
            factors |= {name: factors.get(name, 1.0) * (1 - amount) for name in cause.of}
    damage, options = {name: float(1 - by) for name, by in factors.items()}, kind_option(model, kind)
    return (model.damaged(damage, **options) if damage else model), theta


def members_of(model: Any, names: Sequence[str]) -> MemberLine:
    """Members of a structure whose stiffness some damage groups of a model scale."""
    positions = dict.fromkeys(position for name in names for position in model.groups[name])
    return list(dict.fromkeys(member for position in positions for member, _ in model.contents[position]))


def lines_of(structure: Structure, members: Sequence[Hashable]) -> list[MemberLine]:
    """Members that common nodes connect, line by line, each in the order of its coordinates.

    Members that no other one touches, such as stays or bearings, are one line together.
    """
    ends = [structure.members[member].nodes for member in members]
    middles = np.array([np.mean([structure.nodes[node] for node in nodes], axis=0) for nodes in ends])
    places = {node: place for place, node in enumerate(dict.fromkeys(node for some in ends for node in some))}
    has_node = np.zeros((len(ends), len(places)))
    for row, some in zip(has_node, ends, strict=True):
        row[[places[node] for node in some if len(some) > 1]] = 1
    labels = connected_components(has_node @ has_node.T, directed=False)[1]
    is_alone = np.bincount(labels)[labels] == 1
    labels[is_alone] = labels.max() + 1
    lines = [_by_place(np.flatnonzero(labels == label), middles) for label in np.unique(labels)]
    lines = sorted(lines, key=lambda line: tuple(middles[line[0]]))
    return [[members[place] for place in line] for line in lines]


def _by_place(line: Array, middles: Array) -> list[int]:
    """Members by their coordinate along the axis on which they extend most."""
    axes = np.argsort(np.ptp(middles[line], axis=0), kind="stable")
    return line[np.lexsort(middles[line][:, axes].round(9).T)].tolist()


def pieces_of(lines: Sequence[MemberLine], most: int = 24) -> list[tuple[int, MemberLine]]:
    """Pieces of lines, about so many in all, each of members that follow each other, with the number of the line."""
    size, found = -(-sum(map(len, lines)) // most), []
    for number, line in enumerate(lines):
        edges = np.linspace(0, len(line), -(-len(line) // size) + 1).round().astype(int)
        found += [(number, line[low:high]) for low, high in pairwise(edges)]
    return found


def place_of(structure: Structure, members: Sequence[Hashable], group: Sequence[Hashable]) -> str:
    """Where members are, along the axis on which their group extends most, such as "x = 10 to 15 m"."""
    some, all_ = (
        np.array([structure.nodes[node] for member in names for node in structure.members[member].nodes])
        for names in (members, group)
    )
    axis = int(np.ptp(all_, axis=0).argmax())
    ends = dict.fromkeys(f"{end:.6g}" for end in (some[:, axis].min(), some[:, axis].max()))
    return f"{'xyz'[axis]} = {' to '.join(ends)} m"


def stretches(
    structure: Structure, cause: Cause, pieces: Sequence[tuple[int, MemberLine]], names: Sequence[str]
) -> list[Cause]:
    """The whole group, and each run of pieces of one line, which have these names in the divided model, as causes.

    Every length is less probable the longer it is, and every place of a length equally probable.
    """
    members, found = tuple(member for _, piece in pieces for member in piece), []
    of_line = [line for line, _ in pieces]
    for low, high in combinations_with_replacement(range(len(pieces)), 2):
        number, most = high - low + 1, of_line.count(of_line[low])
        if of_line[low] != of_line[high] or number == len(names):
            continue
        rows = tuple(member for _, piece in pieces[low : high + 1] for member in piece)
        which = f"{rows[0]} to {rows[-1]}" if len(rows) > 1 else f"{rows[0]}"
        found.append(
            Cause(
                f"{cause.name}: {which}",
                of=tuple(names[low : high + 1]),
                scale=float(min(np.sqrt(len(members) / len(rows)), 3.0)),  # what is smaller may be more severe
                rows=rows,
                group=cause.name,
                share=most / number / (most - number + 1),
                alone=True,
                place=place_of(structure, rows, members),
            )
        )
    total = sum(one.share for one in found)
    found = [replace(one, share=0.75 * one.share / total) for one in found]
    return [replace(cause, rows=members, share=0.25 if found else 1.0), *found]


def divided_causes(
    asked: Sequence[Cause], model: Any, structure: Structure
) -> tuple[list[Cause], list[Cause], dict[str, dict[str, set[Hashable]]], dict[Hashable, dict[str, Any]]]:
    """Causes with stretches in place of damaged groups; pieces, the sums of whose effects are those of stretches;
    members of each piece by group of the model, which is divided so; and the group and place of each member."""
    causes: list[Cause] = []
    pieces: list[Cause] = []
    parts: dict[str, dict[str, set[Hashable]]] = {}
    members: dict[Hashable, dict[str, Any]] = {}
    for cause in asked:
        if cause.kind != "damage":
            causes.append(cause)
        if cause.kind != "damage" or cause.alone:
            continue
        lines = lines_of(structure, members_of(model, cause.of))
        for place, line in enumerate(lines, 1):
            for number, member in enumerate(line, 1):
                middle = np.mean([structure.nodes[node] for node in structure.members[member].nodes], axis=0)
                at = dict(zip("xyz", middle.tolist(), strict=False))
                members[member] = {"group": cause.name, "line": place, "element": number} | at
        divided = pieces_of(lines)
        named = {f"{cause.name}, piece {number}": set(piece) for number, (_, piece) in enumerate(divided, 1)}
        for name in cause.of:
            inside = set(members_of(model, [name]))
            parts[name] = {piece: rows & inside for piece, rows in named.items() if rows & inside}
        pieces += [Cause(name, of=(name,)) for name in named]
        causes += stretches(structure, cause, divided, [*named])
    return causes, pieces, parts, members
