"""Located damage, as `locate_damage` returns it, and where along its lines it lies in words."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from skthermo._core.arrays import check_probability
from skthermo._core.text import Sentences, counted, listed, percent, share_text
from skthermo.fem import Structure
from skthermo.studies.identification._identified import IdentifiedDamage

LIKELY, PROBABLE = 0.9, 0.5
"""Probabilities with which a summary says where damage is: almost surely, and more likely than not."""
WORTH_NAMING = 0.1  # probability of a group from which on a summary says where in it


@dataclass(frozen=True)
class Explained:
    """One explanation: the damaged members and the severity of each group in it, and its probability."""

    probability: float
    members: Mapping[str, frozenset[Hashable]]
    severities: Mapping[str, float]
    has_else: bool


@dataclass(frozen=True)
class Places:
    """The lines of a group's members, in the words "elements 4 to 6 of 16"."""

    structure: Structure
    lines: Sequence[Sequence[Hashable]]

    @property
    def numbers(self) -> dict[Hashable, int]:
        """Number of each member on its line, from 1."""
        return {member: number for line in self.lines for number, member in enumerate(line, 1)}

    @property
    def members(self) -> list[Hashable]:
        return [member for line in self.lines for member in line]

    def text(self, chosen: Collection[Hashable], *, alternatives: bool = False) -> str:
        """Members as ranges of neighbours; as alternatives, if the damage is in one of them."""
        chosen = set(chosen)
        if chosen >= set(self.members):
            return f"all {counted(len(self.members), 'element')}"
        ranges = [self._range(line, first, last) for line in self.lines for first, last in _runs(line, chosen)]
        return listed(ranges, "or" if alternatives else "and")

    def _range(self, line: Sequence[Hashable], first: int, last: int) -> str:
        which = f"element {first + 1}" if first == last else f"elements {first + 1} to {last + 1}"
        of_line = "" if len(self.lines) == 1 else f" of line {self.lines.index(line) + 1}"
        return f"{which} of {len(line)}{of_line}{self._extent(line, line[first : last + 1])}"

    def _extent(self, line: Sequence[Hashable], members: Sequence[Hashable]) -> str:
        """Coordinates between which members lie, along the axis on which their line extends most."""
        nodes, ends = self.structure.nodes, self.structure.members
        whole, part = (np.array([nodes[node] for m in some for node in ends[m].nodes]) for some in (line, members))
        axis = int(np.ptp(whole, axis=0).argmax())
        low, high = part[:, axis].min(), part[:, axis].max()
        along = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
        return f" ({'xyz'[axis]} = {along} m)"


def _runs(line: Sequence[Hashable], chosen: Collection[Hashable]) -> Iterator[tuple[int, int]]:
    """First and last position of each run of chosen members."""
    first = None
    for position, member in enumerate([*line, None]):
        inside = position < len(line) and member in chosen
        if inside and first is None:
            first = position
        if not inside and first is not None:
            yield first, position - 1
            first = None


@dataclass(frozen=True, eq=False)
class LocatedDamage(Sentences):
    """Where in its groups a structure is damaged, member by member, as far as records tell.

    Parameters
    ----------
    table : DataFrame
        One row a member of a group: ``group``; ``element``, its number along the group; ``probability`` that it is
        among the damaged members; ``severity``, its mean over all explanations, where those without it count as 0;
        ``if_damaged``, its mean where it is damaged; ``is_likely``, whether it is in the smallest set that holds all
        damaged members with a probability of 90 %, given that there are any, and but for groups that these modes do not
        show.
    groups : DataFrame
        One row a group: ``probability`` that a part of it is damaged, or all; ``severity``, ``elements``, their number;
        ``pieces``, into how many it was divided; ``likely``, how many elements hold its damage with a probability of
        90 %.
    levels : DataFrame
        One row a division and group: ``pieces``; ``stretches`` of neighbouring pieces of which was asked whether they
        are damaged; ``probability`` of the group; ``likely``, how many elements held its damage with a probability of
        90 %.
    found : IdentifiedDamage
        What was found for whole groups.
    probability_of_damage : float
        Probability that a member is damaged.
    probability_other : float
        Probability that something else shifted the frequencies, beside damage or alone.
    alike : list of str
        Two probable places, in words, that these modes cannot distinguish; empty if there are none.
    explained : sequence of explanations
        Those of the finest division, each with its ``probability``, and the damaged ``members`` and the ``severities``
        by group.
    places : mapping of str to places
        Group -> its members, line by line.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign, truss_structure
    >>> from skthermo.studies import locate_damage
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
    >>> structure, model = truss_structure(), make_truss()
    >>> fem = DataInformedFEM(model, random_state=0).fit(year.temperatures, year.frequencies)
    >>> divided = structure.divide(model, {"top": {"middle": ["13"]}})
    >>> healthy, damaged = (m.frequencies([[1.0] * 4]) for m in (divided, divided.damaged({"middle": 0.4})))
    >>> F = later.frequencies * damaged / healthy
    >>> located = locate_damage(fem, structure, later.temperatures, F, ["top", "diagonal"], random_state=0)
    >>> print(located.summary())
    top is damaged with a probability of over 99.9 %, probably in element 3 of 5 (x = 10.4 to 15.6 m) (over 99.9 %).
    Damage in the rest of top is unlikely.
    >>> round(float(located.table.loc["13", "severity"]), 1)
    0.4
    """

    table: pd.DataFrame
    groups: pd.DataFrame
    levels: pd.DataFrame
    found: IdentifiedDamage
    probability_of_damage: float
    probability_other: float
    alike: list[str]
    explained: Sequence[Explained] = field(repr=False)
    places: Mapping[str, Places] = field(repr=False)

    def likely_members(self, probability: float = LIKELY, group: str | None = None) -> list[Hashable]:
        """The fewest members that hold all damaged ones with a probability, given that there are any.

        Parameters
        ----------
        probability : float, default=0.9
            Between 0 and 1.
        group : str, optional
            Only damage in this group. By default in any that these modes show.

        Returns
        -------
        list of members
            The most probable first; none if there is no damage.

        Raises
        ------
        ValueError
            If the group is unknown, or the probability is not between 0 and 1.
        """
        if group is not None and group not in self.places:
            raise ValueError(f"unknown group {group!r}; expected one of {sorted(self.places)}")
        return fewest(self._sets(group), check_probability(probability, "probability"))[0]

    def _sets(self, group: str | None) -> list[tuple[frozenset[Hashable], float]]:
        if group is not None:
            return [(e.members[group], e.probability) for e in self.explained if group in e.members]
        return visible_sets(self.explained, self.found.separability.unobservable)

    def _answer(self) -> Iterator[str]:
        is_named = (self.groups["probability"] >= WORTH_NAMING) & ~self.groups.index.isin(
            self.found.separability.unobservable
        )
        probable = self.groups[is_named]
        if probable.empty:
            yield f"No group is damaged with a probability above {percent(WORTH_NAMING)}: no place is given."
        named = set(probable.index)
        of_several = sum(one.probability for one in self.explained if len(named.intersection(one.members)) > 1)
        if len(probable) > 1 and of_several < WORTH_NAMING:
            yield f"Most probably only one of {listed(list(probable.index))} is damaged."
        for group, row in probable.sort_values("probability", ascending=False, kind="stable").iterrows():
            yield from self._of_group(str(group), row)

    def _limits(self) -> Iterator[str]:
        if self.alike:
            yield f"These modes do not distinguish {' from '.join(self.alike)}."
        if self.probability_other >= WORTH_NAMING:
            yield f"Another cause may have shifted the frequencies (probability {_share(self.probability_other)})."
        if self.found.separability.unobservable:
            yield f"Damage in {listed(self.found.separability.unobservable)} is unobservable in these modes."

    def _of_group(self, group: str, row: pd.Series) -> Iterator[str]:
        damaged = f"{group} is damaged with a probability of {_share(row['probability'])}"
        places = self.places[group]
        if row["pieces"] == 1:
            yield damaged + (", of one element." if row["elements"] == 1 else "; it was not divided.")
            return
        (small, in_small), (wide, in_wide) = (fewest(self._sets(group), level) for level in (PROBABLE, LIKELY))
        if len(small) == len(places.members):
            sets, everything = self._sets(group), frozenset(places.members)
            whole = sum(share for inside, share in sets if inside == everything) / sum(share for _, share in sets)
            yield damaged + (
                f", probably all {len(small)} elements alike ({_share(whole)})."
                if whole >= PROBABLE
                else "; these records do not show where in it."
            )
            return
        yield f"{damaged}, probably in {places.text(small, alternatives=True)} ({_share(in_small)})."
        if len(wide) == len(places.members):
            yield f"Damage in the rest of {group} cannot be excluded."
        elif set(wide) != set(small):
            where = places.text(wide, alternatives=True)
            yield f"It lies in {where} ({_share(in_wide)}). Damage in the rest of {group} is unlikely."
        else:
            yield f"Damage in the rest of {group} is unlikely."

    def __repr__(self) -> str:
        best = self.groups["probability"].sort_values(ascending=False, kind="stable")[:3]
        return f"LocatedDamage({', '.join(f'{group} {share:.0%}' for group, share in best.items())})"


def located_damage(
    explained: Sequence[Explained],
    alike: list[str],
    found: IdentifiedDamage,
    places: Mapping[str, Places],
    pieces: Mapping[str, int],
    levels: pd.DataFrame,
) -> LocatedDamage:
    """From the explanations of the finest division, and the number of pieces of each group that was divided."""
    total = sum(one.probability for one in explained)
    likely, rows = set(fewest(visible_sets(explained, found.separability.unobservable), LIKELY)[0]), {}
    for group, where in places.items():
        for member, number in where.numbers.items():
            if member not in rows:
                shares = [
                    (one.probability / total, one.severities[name])
                    for one in explained
                    for name, inside in one.members.items()
                    if member in inside
                ]
                rows[member] = _averages(shares) | {
                    "group": group,
                    "element": number,
                    "is_likely": member in likely,
                }
    columns = ["group", "element", "probability", "severity", "if_damaged", "is_likely"]
    table = pd.DataFrame(list(rows.values()), pd.Index(list(rows), tupleize_cols=False, name="member"), columns)
    by_group = {}
    for group, where in places.items():
        inside = [one for one in explained if group in one.members]
        of_group = [(one.members[group], one.probability) for one in inside]
        by_group[group] = _averages([(one.probability / total, one.severities[group]) for one in inside]) | {
            "elements": len(where.members),
            "pieces": pieces.get(group, 1),
            "likely": len(fewest(of_group, LIKELY)[0]),
        }
    groups = pd.DataFrame.from_dict(by_group, orient="index")
    return LocatedDamage(
        table=table,
        groups=groups,
        levels=levels,
        found=found,
        probability_of_damage=sum(one.probability for one in explained if one.members) / total,
        probability_other=sum(one.probability for one in explained if one.has_else) / total,
        alike=alike,
        explained=explained,
        places=places,
    )


def visible_sets(
    explained: Sequence[Explained], unobservable: Sequence[str]
) -> list[tuple[frozenset[Hashable], float]]:
    """Sets of damaged members and their probabilities, less groups of which the modes show nothing."""
    found = []
    for one in explained:
        members = [inside for group, inside in one.members.items() if group not in unobservable]
        if members:
            found.append((frozenset().union(*members), one.probability))
    return found


def _averages(shares: Sequence[tuple[float, float]]) -> dict[str, float]:
    """Probability, mean severity where the rest counts as 0, and mean severity where there is damage."""
    probability = sum(share for share, _ in shares)
    mean = sum(share * severity for share, severity in shares)
    return {
        "probability": probability,
        "severity": mean,
        "if_damaged": mean / probability if probability > 0 else float("nan"),
    }


def _share(probability: float) -> str:
    """A probability in percent, which is never quite 100."""
    return share_text(min(probability, 1 - 1e-6))


def fewest(sets: Collection[tuple[frozenset[Hashable], float]], probability: float) -> tuple[list[Hashable], float]:
    """The fewest members, by their own probabilities, that hold all damaged ones with a probability, and theirs."""
    shares: dict[Hashable, float] = {}
    for members, share in sets:
        for member in members:
            shares[member] = shares.get(member, 0.0) + share
    ordered = sorted(shares, key=lambda member: -shares[member])
    rank = {member: position for position, member in enumerate(ordered)}
    held = np.zeros(len(ordered))
    for members, share in sets:
        held[max(rank[member] for member in members)] += share
    held = np.cumsum(held) / max(held.sum(), np.finfo(float).tiny)
    number = int(np.searchsorted(held, probability * (1 - 1e-9))) + 1
    return ordered[:number], float(held[number - 1]) if ordered else 0.0
