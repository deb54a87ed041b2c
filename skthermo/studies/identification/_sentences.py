"""What an identification found, in sentences: those of its summary, of the owner's report and of drawings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from skthermo._formatting import listed, percent, probability_text

YES, NO, DOUBTFUL, ALONE = "yes", "no", "doubtful", "yes, if nothing else has changed"
OF_GROUP = {
    YES: "{} has lost {} of its stiffness (± {}).",
    ALONE: "{} has lost {} of its stiffness (± {}), if nothing else has changed.",
    DOUBTFUL: "It is doubtful whether {} is damaged: a loss of {} (± {}) may come from what else has changed.",
}
"""What is said of a damaged group, its severity and two standard errors."""


def damaged(found: Any) -> pd.Series:
    """Whether each group is damaged, in words.

    Where damage does not explain the shifts, standard errors are widened; a severity within two of them is doubtful.
    """
    table = found.table
    answers = pd.Series(NO, table.index).mask(table["significant"].eq(True), YES)  # missing where a group is not seen
    if not found.is_unexplained:
        return answers
    small = table["severity"] < 2 * table["standard_error"]
    return answers.mask(answers == YES, small.map({True: DOUBTFUL, False: ALONE}))


def answer(found: Any) -> Iterator[str]:
    """Whether something has changed, and where: the first sentence follows the probability by chance."""
    yield _first(found)
    answers = damaged(found)
    for group, row in found.table[answers != NO].iterrows():
        yield OF_GROUP[answers[group]].format(group, _percent(row["severity"]), _percent(2 * row["standard_error"]))
    if found.is_evident and (answers == NO).all():
        yield _place_unknown(found)
    if not found.is_evident and not found.is_unexplained:
        yield _unnoticed(found)


def _first(found: Any) -> str:
    chance, misfit = probability_text(found.p_value), probability_text(found.misfit_p_value)
    if found.is_evident and found.is_unexplained:
        return (
            f"Something has changed (probability by chance {chance}), and damage of these groups does not explain all "
            f"of it (probability of such a misfit by chance {misfit}): uncertainties are {found.widening:.1f} times as "
            "wide for that."
        )
    if found.is_unexplained:
        return f"Something has changed, but no damage of these groups explains it (probability by chance {misfit})."
    if found.is_evident:
        return f"Something has changed (probability by chance {chance})."
    return f"No change is evident (probability by chance {chance})."


def _place_unknown(found: Any) -> str:
    """Which groups may be behind a change that none of them clearly shows."""
    table = found.table.dropna(subset=["severity"])
    possible = table[table["severity"] > 0]
    losses = [
        f"{percent(row['severity'], '.1f')} (± {_percent(2 * row['standard_error'])}) in {group}"
        for group, row in possible.iterrows()
    ]
    if not losses:
        return "Which part cannot be said."
    best = f"the best explanation is a loss of {listed(losses)}, none of them clear by itself."
    return f"Which part cannot be said: {best}"


def _unnoticed(found: Any) -> str:
    """What could be damaged all the same."""
    table = found.table.dropna(subset=["severity", "standard_error"])
    highest = (table["severity"] + 2 * table["standard_error"]).clip(upper=1.0)
    losses = [f"{_percent(severity)} in {group}" for group, severity in highest.items()]
    return f"A loss of stiffness of up to {listed(losses)} could have gone unseen."


def limits(found: Any) -> Iterator[str]:
    """What cannot be said of the place or the cause."""
    for groups in found.confused:
        yield f"{listed(groups)} cannot be told apart by these modes: only their common effect is known."
    if len(found.unseen):
        yield f"{listed(found.unseen)} cannot be seen in these modes: the standard error would be above 10 %."
    rest = found.unexplained
    if np.isnan(found.misfit_p_value):
        yield "There are no more modes than damaged groups, so that any shift can be explained: it proves little."
    elif found.is_unexplained and not np.isnan(rest).all():
        worst = int(np.nanargmax(np.abs(rest)))
        measured, explained = found.shifts[["measured", "explained"]].to_numpy(dtype=float)[worst]
        yield (
            f"Mode {found.shifts.index[worst]} moved by {measured:+.2%}, of which damage explains {explained:+.2%}: "
            f"{found.likely_cause or 'something else has changed too, or the model is wrong'}."
        )


def _percent(share: float) -> str:
    return percent(share, ".1f")


def warnings(found: Any) -> Iterator[tuple[str, str]]:
    """What is doubtful, by kind and text."""
    if found.confused:
        sets = "; ".join(" and ".join(group) for group in found.confused)
        yield "confused groups", f"groups that these modes cannot tell apart: {sets}. Only their common effect is known"
    if found.unseen:
        yield "unseen groups", f"groups that these modes hardly show: {', '.join(found.unseen)}"


def explanation_text(causes: tuple[str, ...], amounts: Any) -> str:
    """An explanation with its amounts, such as "side span 12 %, main stays 4 %"."""
    parts = [f"{cause} {percent(amount, '.2g')}" for cause, amount in zip(causes, amounts, strict=False)]
    return ", ".join([*parts, *causes[len(amounts) :]]) or "no damage"
