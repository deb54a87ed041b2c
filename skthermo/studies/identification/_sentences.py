"""What an identification found, in sentences: those of its summary, of the owner's report and of drawings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from skthermo._arguments import seem_rad_per_s
from skthermo._arrays import Array
from skthermo._formatting import SPACE, chance_text, listed, percent
from skthermo.studies.identification._causes import HIGHEST_SEVERITY
from skthermo.studies.identification._told import Amount, either, told

NAMED, MOST_NAMED = 0.01, 4
"""Probability from which on another explanation is named, and the largest number of those that are."""

SURE = 0.9  # probability from which on the most probable explanation is not followed by averages over all
LIKELY = 0.1  # probability from which on a cause is named among the averages
RARE = 0.05  # probability by chance below which a misfit, or a shift of a healthy structure, is told
NEAR_2_PI = 0.25  # relative distance from 2 pi up to which ratios of frequencies suggest rad/s
CLEAR = 2.0  # standard errors by which a frequency must move to count as moved
EVEN = 0.1  # relative scatter of shifts up to which they count as even


def answer(found: Any) -> Iterator[str]:
    """What is most probable, how probable, what else could be."""
    first, *others = told(found)
    yield f"Most probable: {first.phrase(with_bands=True)}, probability {chance_text(first.probability)}."
    if first.is_else:
        yield f"{_departure(found)}."
        yield f"Likely causes: {likely_cause(found)}."
    named = [one for one in others if not one.is_healthy and one.probability >= NAMED][:MOST_NAMED]
    if named:
        yield f"It could also be: {'; '.join(f'{one.phrase()} ({chance_text(one.probability)})' for one in named)}."
    if not first.is_healthy:
        yield f"The probability that nothing has changed is {chance_text(1 - found.probability_of_damage)}."
    if first.probability < SURE and not first.is_else:
        yield from _averages(found)
    if first.is_healthy:
        yield from _unnoticed(found)


def _averages(found: Any) -> Iterator[str]:
    """Causes that are likely over all explanations together."""
    table = found.table[found.table["probability"] >= LIKELY].sort_values("probability", ascending=False, kind="stable")
    named = []
    for cause, row in table.head(MOST_NAMED).iterrows():
        amount = Amount(str(cause), row["kind"], row["severity"], row["lowest"], row["highest"])
        named.append(f"{cause} {chance_text(row['probability'])}, {amount.size} on average ({amount.band})")
    if named:
        yield f"Over all explanations together, each has changed with a probability of: {'; '.join(named)}."


def _unnoticed(found: Any) -> Iterator[str]:
    """What could be damaged all the same."""
    table = found.table[found.table["kind"] == "damage"]
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
        yield "There are no more shifts than changes to find, so that any shift can be explained: the fit proves little."
    elif found.misfit_p_value < RARE and not best.has_else:
        yield (
            f"The most probable explanation does not explain all (probability by chance "
            f"{chance_text(found.misfit_p_value)}). {_departure(found)}."
        )
    if found.rest >= NAMED:
        yield f"Explanations that are not listed have a probability of {chance_text(found.rest)} together."


def warnings(found: Any) -> Iterator[tuple[str, str]]:
    """What is doubtful, by kind and text."""
    best = told(found)[0]
    yield from found.records.warnings()
    if found.confused:
        sets = "; ".join(" and ".join(causes) for causes in found.confused)
        yield "confused groups", f"groups that these modes cannot tell apart: {sets}. Only their common effect is known"
    if found.unseen:
        names = ", ".join(found.unseen)
        yield "unseen groups", f"groups that these modes do not show, of which nothing is known: {names}"
    highest = [str(cause) for cause in found.most_probable if found.severities.get(cause, 0.0) >= HIGHEST_SEVERITY]
    if highest:
        yield "severity at its bound", f"severity is at its upper bound of {HIGHEST_SEVERITY:.0%}: {', '.join(highest)}"
    if best.is_else or found.misfit_p_value < RARE:
        chance = found.probability_of_else if best.has_else else found.misfit_p_value
        yield (
            "unexplained shifts",
            f"damage of these groups does not explain the shifts (probability {chance_text(chance)}): "
            f"{likely_cause(found)}",
        )


def _departure(found: Any) -> str:
    """The mode that damage explains least, in standard errors."""
    shifts = found.shifts
    worst = int(np.nanargmax(np.abs(unexplained(found))))
    measured, explained = (float(shifts[name].iloc[worst]) for name in ("measured", "explained"))
    error = float(shifts["standard_error"].iloc[worst])
    return (
        f"Mode {shifts.index[worst]} departs most: it moved by {_signed(measured)} (standard error "
        f"{100 * error:.2f}{SPACE}%), of which damage of these groups explains {_signed(explained)}"
    )


def unexplained(found: Any) -> Array:
    """Measured less explained shift of each mode in standard errors; NaN for a mode that was not measured."""
    shifts = found.shifts
    return ((shifts["measured"] - shifts["explained"]) / shifts["standard_error"]).to_numpy(dtype=float)


def likely_cause(found: Any) -> str:
    """What may have shifted the frequencies where damage does not: what the shifts suggest, else all that is usual."""
    known = found.shifts[found.shifts["measured"].notna()]
    measured, error = (known[name].to_numpy(dtype=float) for name in ("measured", "standard_error"))
    if seem_rad_per_s(1 + measured, NEAR_2_PI):
        return "the measured frequencies are about 2 pi times the predicted ones, perhaps in rad/s; expected Hz"
    rest, rose, mean = unexplained(found), measured > CLEAR * error, float(measured.mean())
    worst = int(np.nanargmax(np.abs(rest)))
    usual = "damage outside these groups, a change of mass or of a support, a wrong sensor, or a wrong model"
    if len(known) > 2 and measured.std() < EVEN * abs(mean):
        return f"all frequencies moved by about {_signed(mean)}, as by another clock of the logger; else {usual}"
    if rose.any() and rest[worst] > 0 and not found.table["kind"].eq("stiffening").any():
        return (
            f"{rose.sum()} of {len(known)} frequencies rose, that of mode {found.shifts.index[worst]} by "
            f"{_signed(found.shifts['measured'].iloc[worst])}, and strengthening was not sought (stiffening=...); "
            f"else {usual}"
        )
    if (np.abs(rest) > CLEAR).sum() == 1:
        return f"another mode was taken for mode {found.shifts.index[worst]}, which alone departs; else {usual}"
    return usual


def _signed(shift: float) -> str:
    return f"{100 * shift:+.2f}{SPACE}%"
