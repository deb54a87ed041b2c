"""Where in its groups a structure is damaged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._effects import read_groups
from skthermo._estimators.warnings import reported_by_caller, warn_user, without_warnings
from skthermo._tables.arrays import as_random_state
from skthermo.exceptions import ResultWarning
from skthermo.fem import Structure
from skthermo.studies.identification import DamagePrior, IdentifiedDamage, identify_damage, observe
from skthermo.studies.location._division import Division, lines_of
from skthermo.studies.location._located import LIKELY, LocatedDamage, Places, fewest, located_damage
from skthermo.studies.location._question import PLAUSIBLE, Answer, Explained, MeasuredShift, members_of
from skthermo.studies.scenarios import check_chain

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
    with reported_by_caller(OF_WHOLE_GROUPS):
        found = identify_damage(fem, T, F, contents, noise=noise, prior=prior, random_state=random, **measured)
    with without_warnings():  # identify_damage has given them
        seen = observe(fem, T, F, noise)
    mean = seen.theta[~np.isnan(seen.frequencies).all(axis=1)].mean(axis=0, keepdims=True)
    question = MeasuredShift(
        fem, structure, contents, seen.shift, mean, found.prior, plausible_together(found), **measured
    )
    lines = {group: lines_of(structure, members_of(fem.model, own)) for group, own in contents.items()}
    places = {group: Places(structure, of_group) for group, of_group in lines.items()}
    answer, pieces, levels = divided(question, lines, asked(found, places), random)
    located = located_damage(answer, found, places, pieces, levels)
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
) -> tuple[Answer, dict[str, int], pd.DataFrame]:
    """The answer to the finest division of some groups, into how many pieces each was divided, and a row a level."""
    most = MOST_SLOW_PIECES if getattr(question.fem.model, "prefer", "processes") == "processes" else MOST_PIECES
    divisions = {group: Division.of(group, lines[group], most) for group in groups}
    levels: list[dict[str, Any]] = []
    pieces: dict[str, int] = {}
    for level in range(1, MOST_LEVELS + 1):
        answer, finer = question.explained(divisions, random), {}
        for group, division in divisions.items():
            row, chosen = next_pieces(division, answer.explained)
            levels.append({"level": level, "group": group, **row})
            if row["probability"] >= WORTH_ASKING:
                finer[group] = division.finer(chosen)
        pieces |= {group: len(division.pieces) for group, division in divisions.items()}
        if not any(len(division.pieces) > pieces[group] for group, division in finer.items()):
            break
        divisions = finer  # groups that have become improbable stay whole
    return answer, pieces, pd.DataFrame(levels, columns=COLUMNS)


def plausible_together(found: IdentifiedDamage) -> list[tuple[str, ...]]:
    """Groups that explain the shifts together with some probability, as sets."""
    probable = found.explanations.index[found.explanations["probability"] >= PLAUSIBLE]
    estimates = found.estimates[found.estimates.index.get_level_values(0).isin(probable)]
    sets = [tuple(rows.index.get_level_values(1)) for _, rows in estimates.groupby(level=0, sort=False)]
    return [groups for groups in dict.fromkeys(sets) if len(groups) > 1]


def asked(found: IdentifiedDamage, places: Mapping[str, Places]) -> list[str]:
    """Groups of several members that are divided: probable ones, or all if whole groups do not explain the shifts."""
    is_open = found.is_unexplained or found.probability_other > SOME_ELSE
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
