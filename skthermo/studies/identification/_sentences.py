"""What an identification found, in sentences: those of its summary, of the owner's report and of drawings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from skthermo._formatting import SPACE, chance_text, listed, percent
from skthermo.studies.identification._told import Amount, Told, either, told
from skthermo.studies.identification.weighing import HIGHEST_SEVERITY, NO_DAMAGE

NAMED, MOST_NAMED = 0.01, 4
"""Probability from which on another explanation is named, and the largest number of those that are."""

SURE = 0.9  # probability from which on the most probable explanation is not followed by averages over all
LIKELY = 0.1  # probability from which on a cause is named among the averages
RARE = 0.05  # probability by chance below which a misfit, or a shift of a healthy structure, is told
CLEAR = 2.0  # standard errors by which a frequency must move to count as moved
PILED_UP = 1.05  # standard errors between the mean of an exponential law and its bound, with some margin
EVEN = 0.1  # relative scatter of shifts up to which they count as even


def answer(found: Any) -> Iterator[str]:
    """What is most probable, how probable, what else could be."""
    explanations = told(found)
    first, *others = explanations
    shown = " that these modes show" if found.unseen else ""
    yield (
        f"Most probable: {first.phrase(in_full=True)}{shown * first.is_healthy}, probability "
        f"{chance_text(first.probability)}."
    )
    if first.has_else:
        what = "No damage of these groups" if first.is_else else "Damage of these groups alone hardly"
        yield f"{what} explains the shifts; {_departure(found)}."
        yield f"Likely causes: {likely_causes(found)}."
    yield from _others(first, others)
    if not first.is_healthy:
        unchanged = sum(one.probability for one in explanations if one.is_healthy)
        nothing = "of no change that these modes show" if found.unseen else "that nothing has changed"
        yield f"The probability {nothing} is {chance_text(unchanged)}."
    if first.probability < SURE and not first.is_else:
        yield from _averages(found, first)
    if first.is_healthy:
        yield from _unnoticed(found)


def _others(first: Told, others: Sequence[Told]) -> Iterator[str]:
    """What else could be: the most probable explanation with one thing more, then others."""
    probable = [one for one in others if not one.is_healthy and one.probability >= NAMED]
    more = {more: one for one in probable if (more := one.beside(first))}
    named = [f"{extra} ({chance_text(one.probability)})" for extra, one in more.items()][:MOST_NAMED]
    texts = [f"about the same and {either(named)}"] if named else []
    different = [one for one in probable if one not in more.values()][:MOST_NAMED]
    texts += [f"{one.phrase()} ({chance_text(one.probability)})" for one in different]
    if texts:
        yield f"It could also be: {'; '.join(texts)}."


def _averages(found: Any, first: Told) -> Iterator[str]:
    """Causes that are likely over all explanations together, unless they are those of the first and sure."""
    table = found.table[(found.table["probability"] >= LIKELY) & ~found.table.index.isin(found.unseen)]
    told_first = {amounts[0].cause for amounts in first.changes}
    if told_first.issuperset(table.index) and (table["probability"] >= SURE).all():
        return
    named = []
    for cause, row in table.sort_values("probability", ascending=False, kind="stable").head(MOST_NAMED).iterrows():
        amount = Amount(str(cause), row["kind"], row["severity"], row["lowest"], row["highest"])
        word = "damaged" if row["kind"] == "damage" else "changed"
        probability = f"{word} with probability {chance_text(row['probability'])}"
        named.append(f"{cause} {amount.size} ({amount.band}; {probability})")
    if named:
        yield f"Averaged over all explanations: {'; '.join(named)}."


def _unnoticed(found: Any) -> Iterator[str]:
    """What could be damaged all the same."""
    table = found.table[(found.table["kind"] == "damage") & ~found.table.index.isin(found.unseen)]
    losses = [f"{percent(bound, '.2g')} in {group}" for group, bound in table["highest_if_damaged"].dropna().items()]
    if losses:
        yield f"A loss of stiffness of up to {listed(losses)} could have gone unseen."


def limits(found: Any) -> Iterator[str]:
    """What cannot be said of the place or the cause."""
    best = told(found)[0]
    for causes in found.confused:
        yield f"{listed(causes)} cannot be told apart by these modes: only their common effect is known."
    if found.unseen:
        yield f"Damage in {either(found.unseen)} cannot be seen in these modes: nothing is known of it."
    if best.is_healthy and found.p_value < RARE:
        yield f"Yet a healthy structure shows such shifts with a probability of only {chance_text(found.p_value)}."
    if np.isnan(found.misfit_p_value):
        yield "There are no more shifts than causes, so that any shift can be explained: the fit proves little."
    elif found.misfit_p_value < RARE and not best.has_else:
        yield (
            "The most probable explanation leaves something unexplained (probability by chance "
            f"{chance_text(found.misfit_p_value)}): {_departure(found)}."
        )
    if found.rest >= NAMED:
        yield f"Explanations that are not listed have a probability of {chance_text(found.rest)} together."


def warnings(found: Any) -> Iterator[tuple[str, str]]:
    """What is doubtful, by kind and text."""
    yield from found.records.warnings()
    best = told(found)[0]
    if found.confused:
        sets = "; ".join(" and ".join(causes) for causes in found.confused)
        yield "confused groups", f"groups that these modes cannot tell apart: {sets}. Only their common effect is known"
    if found.unseen:
        names = ", ".join(found.unseen)
        yield "unseen groups", f"groups that these modes do not show, of which nothing is known: {names}"
    highest = [str(cause) for cause in found.most_probable if _is_at_bound(found, cause)]
    if highest:
        yield "severity at its bound", f"severity is at its upper bound of {HIGHEST_SEVERITY:.0%}: {', '.join(highest)}"
    if best.has_else or found.misfit_p_value < RARE:
        doubt = (
            f"probability of something else {chance_text(found.probability_of_else)}"
            if best.has_else
            else f"probability of such a misfit by chance {chance_text(found.misfit_p_value)}"
        )
        yield (
            "unexplained shifts",
            f"damage of these groups alone does not explain the shifts ({doubt}); likely causes: "
            f"{likely_causes(found)}",
        )


def _is_at_bound(found: Any, cause: str) -> bool:
    """Whether the law of a severity piles up at its upper bound, so that its mean is a standard error below it."""
    if cause not in found.table.index or found.table.loc[cause, "kind"] != "damage":
        return False
    amount = found.estimates.loc[(found.explanations.index[0], cause)]
    return bool(amount["severity"] + PILED_UP * amount["standard_error"] >= HIGHEST_SEVERITY)


def _departure(found: Any) -> str:
    """The mode that damage explains least, in standard errors."""
    shifts = found.shifts
    worst = int(np.nanargmax(np.abs(found.unexplained)))
    measured, explained = (float(shifts[name].iloc[worst]) for name in ("measured", "explained"))
    error = float(shifts["standard_error"].iloc[worst])
    return (
        f"mode {shifts.index[worst]} departs most: it moved by {_signed(measured)} (standard error "
        f"{100 * error:.2f}{SPACE}%), of which these groups explain {_signed(explained)}"
    )


def likely_causes(found: Any) -> str:
    """What may have shifted the frequencies where damage does not: what the shifts suggest, then what is usual."""
    known, rest = found.shifts[found.shifts["measured"].notna()], found.unexplained
    measured, error = (known[name].to_numpy(dtype=float) for name in ("measured", "standard_error"))
    n_rose, mean, worst = int((measured > CLEAR * error).sum()), float(measured.mean()), int(np.nanargmax(np.abs(rest)))
    causes = []
    if len(known) > 2 and measured.std() < EVEN * abs(mean):
        causes.append(
            f"another clock of the logger, or mass or stiffness all over the structure: all frequencies moved by about "
            f"{_signed(mean)}"
        )
    elif n_rose and rest[worst] > 0 and not found.table["kind"].eq("stiffening").any():
        causes.append(
            f"strengthening, which was not sought (stiffening=...): {n_rose} of {len(known)} frequencies rose, that "
            f"of mode {found.shifts.index[worst]} by {_signed(found.shifts['measured'].iloc[worst])}"
        )
    elif (np.abs(rest) > CLEAR).sum() == 1:
        causes.append(f"another mode taken for mode {found.shifts.index[worst]}, which alone departs")
    usual = "damage outside these groups, a change of mass or of a support, a wrong sensor, or a wrong model"
    return "; or ".join([*causes, usual])


def _signed(shift: float) -> str:
    return f"{100 * shift + 0.0:+.2f}{SPACE}%".replace("-0.00", "+0.00")


def explanation_text(causes: Sequence[str], amounts: Sequence[float]) -> str:
    """An explanation with its amounts, such as "side span 12 %, main stays 4 %"."""
    sizes = [percent(abs(amount), ".2g" if abs(amount) < 0.995 else ".0f") for amount in amounts]
    parts = [f"{cause} {size}" for cause, size in zip(causes, sizes, strict=False)]
    return ", ".join([*parts, *causes[len(amounts) :]]) or NO_DAMAGE
