"""Where in its groups a structure is damaged: stretches of neighbouring members as causes of a shift."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from math import comb
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import Array, as_random_state
from skthermo._core.warnings import warn_user, without_kinds, without_warnings
from skthermo.exceptions import ResultWarning
from skthermo.fem import Structure
from skthermo.fem.damage import read_groups
from skthermo.studies._scenarios import check_chain
from skthermo.studies.identification._causes import SOMETHING_ELSE, Cause, DamagePrior
from skthermo.studies.identification._curves import Curves, Observed
from skthermo.studies.identification._evidence import Posterior, Scale, screen
from skthermo.studies.identification._identified import RARE, IdentifiedDamage
from skthermo.studies.identification._identify import compared, identify_damage
from skthermo.studies.identification._located import LIKELY, Explained, LocatedDamage, Places, fewest, located_damage
from skthermo.studies.identification._shift import FrequencyShift, observe
from skthermo.surrogate import with_model
from skthermo.surrogate.effects import FrequencyEffects, StructuralChanges

MOST_PIECES, MOST_SLOW_PIECES = 16, 8
"""Into how many pieces a group is divided first; fewer for models that are slow to solve."""

MOST_LEVELS = 4
WORTH_DIVIDING = 0.05  # probability of a group, and of a piece of a damaged group, from which on it is divided further
CANNOT_TELL = 0.75  # share of a group's pieces that may be worth it before dividing them would tell nothing
WORTH_ASKING = 0.02  # probability of a whole group from which on it is divided at all
MOSTLY_ELSE = 0.5  # probability of something else from which on a warning says so
OF_WHOLE_GROUPS = ("unexplained-shifts", "indistinguishable-groups")
"""Warnings that hold for whole groups, and may not hold for parts of them."""

SOME_ELSE = 0.1  # probability of something else from which on every group is divided: a part of one may be behind it

COLUMNS = ["level", "group", "pieces", "stretches", "probability", "likely"]

PLAUSIBLE = 0.01  # probability of several groups together from which on each of them is divided in turn

ALIKE = 0.98  # cosine between the effects of two stretches from which on modes cannot tell one from the other
AS_PROBABLE = 0.2  # and the ratio of their probabilities from which on both are named

Line = list[Hashable]

MOST_LINES = 4  # more lines than these, as in a grid of beams, are no lines along which damage extends

WHOLE = 0.25  # prior probability that a damaged group is damaged throughout, by one severity
LARGEST_SCALE = 3.0
"""Most that the severities of a short stretch may scatter more widely than those of a whole group."""
Piece = tuple[Hashable, ...]


def locate_damage(
    fem: Any,
    structure: Structure,
    T: ArrayLike,
    F: ArrayLike,
    groups: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
    *,
    noise: ArrayLike | Literal["fitted"] = "fitted",
    prior: DamagePrior | None = None,
    shapes: tuple[ArrayLike, ArrayLike] | None = None,
    dofs: ArrayLike | None = None,
    shape_noise: ArrayLike | Literal["fitted"] = 0.01,
    random_state: int | np.random.RandomState | None = None,
) -> LocatedDamage:
    """Members that are damaged, as far as measured frequencies tell them apart.

    Parameters
    ----------
    fem : DataInformedFEM
        Fitted to healthy records; its model was assembled from the structure. It may have been calibrated since.
    structure : Structure
        Nodes and members of the model; an `~skthermo.fem.ImportedStructure` for members that another program has
        assembled.
    T : array-like or DataFrame of shape (n_samples, n_sensors)
        Temperatures of the records to explain, in degrees Celsius.
    F : array-like or DataFrame of shape (n_samples, n_modes)
        Their frequencies in Hz; NaN is allowed. Records should be of one state, so that their mean says what changed.
    groups : sequence of str, or mapping of str to sequence of str, optional
        Damage groups of the model, as in `identify_damage`.
    noise : "fitted", float or array-like of shape (n_modes,), default="fitted"
        Errors of the mean shift, as in `identify_damage`.
    prior : DamagePrior, optional
        What is thought of damage before the records are seen.
    shapes : (array-like, array-like), optional
        Measured mode shapes of the healthy and of the damaged structure, as in `identify_damage`. They tell mirrored
        places of a symmetric structure apart, which frequencies do not.
    dofs : array-like of int of shape (n_dofs,), or list of (node, direction), optional
        Degrees of freedom of the shapes' rows, by position, counted from 0, or by label, as in ``fem.model.dofs``;
        needed with ``shapes``.
    shape_noise : float, array-like of shape (n_modes,) or "fitted", default=0.01
        Errors of the shapes, as in `identify_damage`.
    random_state : int, RandomState or None, default=None
        Seed of the draws behind severities.

    Returns
    -------
    LocatedDamage
        Probability of damage and severity by member, which places cannot be distinguished, and what was asked.

    Raises
    ------
    ValueError
        If the model was not assembled from this structure, or for what `identify_damage` does not accept.

    Warns
    -----
    UserWarning
        As in `identify_damage`; that shifts are not explained, if no damage of neighbouring members explains them.

    Notes
    -----
    Each stretch of neighbouring members may be damaged, by one severity, and the whole group:
    :ref:`how-explanations-are-weighed`.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign, truss_structure
    >>> from skthermo.studies import locate_damage
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
    >>> structure, model = truss_structure(), make_truss()
    >>> fem = DataInformedFEM(model, random_state=0).fit(year.temperatures, year.frequencies)
    >>> divided = structure.divide(model, {"diagonal": {"two bays": ["10", "22"]}})
    >>> healthy, damaged = (m.frequencies([[1.0] * 4]) for m in (divided, divided.damaged({"two bays": 0.4})))
    >>> F = later.frequencies * damaged / healthy
    >>> located = locate_damage(fem, structure, later.temperatures, F, ["top", "diagonal"], random_state=0)
    >>> sorted(located.likely_members())
    ['10', '22']
    """
    check_chain(fem)
    if not isinstance(structure, Structure):
        raise ValueError(f"structure is {structure!r:.200}; expected the Structure or ImportedStructure of the model")
    contents = read_groups(fem.model, groups)
    structure.divide(fem.model, {name: {} for own in contents.values() for name in own})
    random = as_random_state(random_state)
    measured = {"shapes": shapes, "dofs": dofs, "shape_noise": shape_noise}
    with without_kinds(OF_WHOLE_GROUPS):
        found = identify_damage(fem, T, F, contents, noise=noise, prior=prior, random_state=random, **measured)
    with without_warnings():  # identify_damage has given them
        seen = observe(fem, T, F, noise)
    mean = seen.theta[~np.isnan(seen.frequencies).all(axis=1)].mean(axis=0, keepdims=True)
    question = MeasuredShift(
        fem, structure, contents, seen.shift, mean, found.prior, plausible_together(found), **measured
    )
    lines = {group: lines_of(structure, members_of(fem.model, own)) for group, own in contents.items()}
    places = {group: Places(structure, of_group) for group, of_group in lines.items()}
    explained, alike, pieces, levels = divided(question, lines, asked(found, places), random)
    alike = [f"{places[one.group].text(one.members)} of {one.group}" for one in alike]
    located = located_damage(explained, alike, found, places, pieces, levels)
    if located.probability_other >= MOSTLY_ELSE:
        warn_user(
            "no damage of neighbouring members explains the shifts (something else has a probability of "
            f"{located.probability_other:.0%}). Damage may be in several places, or something else has changed. See "
            "the likely causes of identify_damage",
            ResultWarning,
            "unexplained-shifts",
        )
    return located


def divided(
    question: MeasuredShift, lines: Mapping[str, Any], groups: Sequence[str], random: np.random.RandomState
) -> tuple[list[Explained], tuple[Stretch, ...], dict[str, int], pd.DataFrame]:
    """Explanations of the finest division of some groups, probable stretches that look alike, into how many pieces each
    group was divided, and a row a level."""
    most = MOST_SLOW_PIECES if getattr(question.fem.model, "prefer", "processes") == "processes" else MOST_PIECES
    divisions = {group: Division.of(group, lines[group], most) for group in groups}
    levels: list[dict[str, Any]] = []
    pieces: dict[str, int] = {}
    for level in range(1, MOST_LEVELS + 1):
        (explained, alike), finer = question.explained(divisions, random), {}
        for group, division in divisions.items():
            row, chosen = next_pieces(division, explained)
            levels.append({"level": level, "group": group, **row})
            if row["probability"] >= WORTH_ASKING:
                finer[group] = division.finer(chosen)
        pieces |= {group: len(division.pieces) for group, division in divisions.items()}
        if not any(len(division.pieces) > pieces[group] for group, division in finer.items()):
            break
        divisions = finer  # groups that have become improbable stay whole
    return explained, alike, pieces, pd.DataFrame(levels, columns=COLUMNS)


def plausible_together(found: IdentifiedDamage) -> list[tuple[str, ...]]:
    """Groups that explain the shifts together with some probability, as sets."""
    probable = found.explanations.index[found.explanations["probability"] >= PLAUSIBLE]
    estimates = found.estimates[found.estimates.index.get_level_values(0).isin(probable)]
    sets = [tuple(rows.index.get_level_values(1)) for _, rows in estimates.groupby(level=0, sort=False)]
    return [groups for groups in dict.fromkeys(sets) if len(groups) > 1]


def asked(found: IdentifiedDamage, places: Mapping[str, Places]) -> list[str]:
    """Groups of several members that are divided: probable ones, or all if whole groups do not explain the shifts."""
    is_open = found.probabilities.misfit_p_value < RARE or found.probabilities.other > SOME_ELSE
    probable = found.table["probability"]
    several = [group for group, where in places.items() if len(where.members) > 1]
    return [group for group in several if is_open or probable[group] >= WORTH_ASKING]


def next_pieces(division: Division, explained: Sequence[Explained]) -> tuple[dict[str, Any], NDArray[np.bool_]]:
    """What a division has shown, and which of its pieces to divide further."""
    sets = [(one.members[division.group], one.probability) for one in explained if division.group in one.members]
    total = sum(share for _, share in sets)
    shares = np.array([sum(share for inside, share in sets if inside & set(piece)) for piece in division.pieces])
    row = {
        "pieces": len(division.pieces),
        "stretches": sum(1 for _ in division.stretches()),
        "probability": total,
        "likely": len(fewest(sets, LIKELY)[0]),
    }
    is_probable = shares > WORTH_DIVIDING * total
    if total < WORTH_DIVIDING or is_probable.mean() > CANNOT_TELL:
        return row, np.zeros(len(shares), dtype=bool)
    return row, is_probable & [len(piece) > 1 for piece in division.pieces]


@dataclass(frozen=True)
class Stretch:
    """A whole group, or a part of it, some neighbouring pieces, as a cause."""

    group: str
    columns: tuple[int, ...]
    members: frozenset[Hashable]
    prior: float
    scale: float
    is_part: bool


@dataclass(frozen=True)
class Question:
    """Stretches of groups as causes, and the explanations that they make up with their prior probabilities.

    ``names`` are the damage groups of the divided model whose severities the stretches' ``columns`` count.
    """

    stretches: Sequence[Stretch]
    names: Sequence[str]
    parts: Mapping[str, Mapping[str, Sequence[Hashable]]]

    @classmethod
    def of(cls, model: Any, contents: Mapping[str, Sequence[str]], divisions: Mapping[str, Division]) -> Question:
        """Of groups that consist of the model's groups, each divided or, by default, whole."""
        stretches, names, parts = [], [], {}
        for group, own in contents.items():
            first = len(names)
            division = divisions.get(group)
            if division is None:
                names += [name for name in own if name not in names]
                columns = tuple(names.index(name) for name in own)
                stretches.append(Stretch(group, columns, frozenset(members_of(model, own)), 1.0, 1.0, False))
                continue
            labels = [f"{group}, piece {number}" for number in range(1, len(division.pieces) + 1)]
            names += labels
            for name in own:
                inside = set(members_of(model, [name]))
                named = {
                    label: inside.intersection(piece) for label, piece in zip(labels, division.pieces, strict=True)
                }
                parts[name] = {label: members for label, members in named.items() if members}
            for positions, prior, scale in division.stretches():
                members = frozenset(member for position in positions for member in division.pieces[position])
                columns = tuple(first + position for position in positions)
                is_part = len(positions) < len(division.pieces)
                stretches.append(Stretch(group, columns, members, prior, scale, is_part))
        return cls(stretches, names, parts)

    @property
    def incidence(self) -> Array:
        """Which stretch contains which of the divided model's groups, (n_stretches, n_names)."""
        found = np.zeros((len(self.stretches), len(self.names)), dtype=bool)
        for row, stretch in zip(found, self.stretches, strict=True):
            row[list(stretch.columns)] = True
        return found

    def of_group(self, group: str) -> list[int]:
        """Positions of the stretches of a group, the whole of it first."""
        return [position for position, stretch in enumerate(self.stretches) if stretch.group == group]

    def explanations(
        self, prior: DamagePrior, together: Sequence[tuple[str, ...]]
    ) -> Iterator[tuple[tuple[int, ...], float]]:
        """Sets of stretches and the logarithms of their prior probabilities.

        Of several groups, given as ``together``, one after the other is divided, while the others are whole.
        """
        groups = list(dict.fromkeys(stretch.group for stretch in self.stretches))
        by_group = {group: self.of_group(group) for group in groups}
        yield (), np.log(prior.numbers[0])
        for number, share in enumerate(prior.numbers[1:], 1):
            for chosen in combinations(groups, number):
                if (number > 2 and chosen not in together) or not share:
                    continue
                each = share / comb(len(groups), number)
                divided = [group for group in chosen if len(by_group[group]) > 1]
                if (number > 1 and chosen not in together) or not divided:
                    yield tuple(by_group[group][0] for group in chosen), np.log(each)
                    continue
                for group in divided:
                    others = tuple(by_group[other][0] for other in chosen if other != group)
                    for position in by_group[group]:
                        yield (position, *others), np.log(each / len(divided) * self.stretches[position].prior)


def members_of(model: Any, names: Sequence[str]) -> list[Hashable]:
    """Members of a structure whose stiffness some damage groups of a model scale."""
    positions = dict.fromkeys(position for name in names for position in model.groups[name])
    return list(dict.fromkeys(member for position in positions for member, _ in model.contents[position]))


@dataclass(frozen=True)
class MeasuredShift:
    """A measured shift of frequencies, and of shapes if there are any, to be explained by stretches of groups.

    ``contents`` are the model's groups in each group, and ``together`` the groups that probably explain it together.
    ``theta`` is a row of parameters, the mean of the records.
    """

    fem: Any
    structure: Structure
    contents: Mapping[str, Sequence[str]]
    shift: FrequencyShift
    theta: Array
    prior: DamagePrior
    together: Sequence[tuple[str, ...]]
    shapes: Any = None
    dofs: Any = None
    shape_noise: Any = None

    def explained(
        self, divisions: Mapping[str, Division], random: np.random.RandomState
    ) -> tuple[list[Explained], tuple[Stretch, ...]]:
        """Explanations by stretches of divided groups, and by groups that are not divided; and two probable stretches
        that look alike, if there are such."""
        question = Question.of(self.fem.model, self.contents, divisions)
        observed, curves = self._curves(question)
        labels = [f"{stretch.group} [{number}]" for number, stretch in enumerate(question.stretches)]
        causes = [Cause(label, scale=stretch.scale) for label, stretch in zip(labels, question.stretches, strict=True)]
        scale = Scale(observed, None, causes, self.prior, curves)
        sets, logs = zip(*question.explanations(self.prior, self.together), strict=True)
        posterior = Posterior.of(scale, screen(scale, sets, logs), np.array(logs), random)
        stretch_of = dict(zip(labels, question.stretches, strict=True))
        explained = []
        for one in posterior.explanations:
            stretches = [stretch_of[label] for label in one.named]
            explained.append(
                Explained(
                    one.probability,
                    {stretch.group: stretch.members for stretch in stretches},
                    dict(zip([stretch.group for stretch in stretches], one.draws.mean(axis=0).tolist(), strict=True)),
                    SOMETHING_ELSE in one.causes,
                )
            )
        probable = np.array([posterior.probability_of(label) for label in labels])
        return explained, alike_stretches(question, curves, probable)

    def _curves(self, question: Question) -> tuple[Observed, Curves]:
        """What was measured, and the effects of all stretches on it."""
        twin = with_model(self.fem, self.structure.divide(self.fem.model, question.parts))
        changes = StructuralChanges.of_damage(twin.model, question.names)
        mode_is_known = np.where(np.isnan(self.shift.mean), np.nan, 1.0)[np.newaxis]
        effects = FrequencyEffects.averaged(twin, self.theta, mode_is_known, changes)
        with without_kinds(["foreign-shapes"]):
            comparison = compared(effects, self.shift, self.shapes, self.dofs, self.shape_noise)
        observed = comparison.observed(self.prior.model_error)
        return observed, Curves.of_stretches(comparison.effects, question.incidence, observed.rotation)


def alike_stretches(question: Question, curves: Curves, probable: NDArray) -> tuple[Stretch, ...]:
    """The most probable part of a group and, if damage elsewhere looks the same, the most probable such place."""
    slopes = curves.slopes[:, 0]
    slopes = slopes / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), np.finfo(float).tiny)
    is_part = np.array([stretch.is_part for stretch in question.stretches])
    best = int(np.where(is_part, probable, -1.0).argmax())
    first = question.stretches[best]
    is_elsewhere = np.array([not stretch.members & first.members for stretch in question.stretches])
    is_alike = is_part & is_elsewhere & (slopes @ slopes[best] > ALIKE) & (probable > AS_PROBABLE * probable[best])
    if not first.is_part or not is_alike.any():
        return ()
    return first, question.stretches[int(np.where(is_alike, probable, -1.0).argmax())]


def lines_of(structure: Structure, members: Collection[Hashable]) -> list[Line]:
    """Members that are connected, line by line, each from its end of lower coordinates.

    Members that no other one touches, such as stays or bearings, are one line together; so are all members where
    there are more than a few lines.
    """
    ends = {member: structure.members[member].nodes for member in members}
    middles = {member: np.mean([structure.nodes[node] for node in nodes], axis=0) for member, nodes in ends.items()}
    at_node = defaultdict(list)
    for member, nodes in ends.items():
        for node in nodes if len(nodes) > 1 else ():
            at_node[node].append(member)
    lines: list[Line] = []
    left = dict.fromkeys(members)
    while left:
        line = _connected(next(iter(left)), ends, at_node)
        left = dict.fromkeys(member for member in left if member not in line)
        lines.append(line)
    if len(lines) - sum(len(line) == 1 for line in lines) > MOST_LINES:
        return [_by_place(list(members), middles)]
    alone = [line[0] for line in lines if len(line) == 1]
    lines = [_in_order(line, ends, at_node, middles) for line in lines if len(line) > 1]
    lines += [_by_place(alone, middles)] if alone else []
    return sorted(lines, key=lambda line: tuple(middles[line[0]].round(6)))


def _connected(first: Hashable, ends: dict, at_node: dict) -> Line:
    """The members that a chain of common nodes connects to the first one, in the order in which they are reached."""
    reached = {first: None}
    waiting = [first]
    while waiting:
        for node in ends[waiting.pop()]:
            new = [member for member in at_node[node] if member not in reached]
            reached.update(dict.fromkeys(new))
            waiting += new
    return list(reached)


def _in_order(line: Line, ends: dict, at_node: dict, middles: dict[Hashable, Array]) -> Line:
    """A line followed from its end; by place where members branch or form a ring."""
    by_place = _by_place(line, middles)
    touching = {member: {other for node in ends[member] for other in at_node[node]} - {member} for member in line}
    tips = [member for member in by_place if len(touching[member]) == 1]
    if len(tips) != 2 or max(map(len, touching.values())) > 2:
        return by_place
    ordered = tips[:1]
    while len(ordered) < len(line):
        ordered.append(next(other for other in touching[ordered[-1]] if other not in ordered[-2:]))
    return ordered


def _by_place(line: Line, middles: dict[Hashable, Array]) -> Line:
    """Members by their coordinate along the axis on which they extend most."""
    places = np.array([middles[member] for member in line])
    axes = np.argsort(-np.ptp(places, axis=0), kind="stable")
    order = np.lexsort(places[:, axes[::-1]].round(9).T)
    return [line[i] for i in order]


@dataclass(frozen=True)
class Division:
    """Pieces of a group, line by line; each consists of members that follow each other."""

    group: str
    lines: tuple[tuple[Piece, ...], ...]

    @classmethod
    def of(cls, group: str, lines: Sequence[Sequence[Hashable]], most: int) -> Division:
        """At most so many pieces, or one for each line, of about equal numbers of members."""
        size = int(np.ceil(sum(map(len, lines)) / most))
        return cls(group, tuple(_cut(line, int(np.ceil(len(line) / size))) for line in lines))

    @property
    def pieces(self) -> list[Piece]:
        return [piece for line in self.lines for piece in line]

    @property
    def members(self) -> list[Hashable]:
        return [member for piece in self.pieces for member in piece]

    def finer(self, chosen: Sequence[bool]) -> Division:
        flags = iter(chosen)
        lines = [
            [half for piece in line for half in (_cut(piece, 2) if next(flags) else [piece])] for line in self.lines
        ]
        return Division(self.group, tuple(map(tuple, lines)))

    def stretches(self) -> Iterator[tuple[tuple[int, ...], float, float]]:
        """Positions of the pieces, prior probability and scale of severities of each stretch.

        A stretch is a run of neighbouring pieces of a line, or the whole group, which comes first. It stands for all
        runs of members that begin in its first and end in its last piece; every length is less probable the longer it
        is, and every place of a run equally probable.
        """
        n_members = len(self.members)
        yield tuple(range(len(self.pieces))), WHOLE if len(self.pieces) > 1 else 1.0, 1.0
        found, first = [], 0
        for line in self.lines:
            edges = np.cumsum([0, *map(len, line)])
            priors = _priors_of_runs(edges) * (edges[-1] / n_members)
            for i in range(len(line)):
                for j in range(i, len(line)):
                    if j - i + 1 < len(self.pieces):
                        found.append((tuple(range(first + i, first + j + 1)), priors[i, j], edges[j + 1] - edges[i]))
            first += len(line)
        total = sum(prior for _, prior, _ in found)
        for positions, prior, size in found:
            yield positions, (1 - WHOLE) * prior / total, min(np.sqrt(n_members / size), LARGEST_SCALE)


def _cut(members: Sequence[Hashable], n_pieces: int) -> tuple[Piece, ...]:
    """Neighbouring members in pieces of about equal size."""
    edges = np.linspace(0, len(members), min(n_pieces, len(members)) + 1).round().astype(int)
    return tuple(tuple(members[low:high]) for low, high in pairwise(edges))


def _priors_of_runs(edges: Array) -> Array:
    """Prior of the runs of members that begin in piece i and end in piece j, (n_pieces, n_pieces)."""
    n = edges[-1]
    first, last = np.arange(n)[:, np.newaxis], np.arange(n)
    length = last - first + 1
    priors = np.where(length > 0, 1 / np.maximum(length * (n - length + 1), 1), 0.0)
    return np.add.reduceat(np.add.reduceat(priors, edges[:-1], axis=0), edges[:-1], axis=1)
