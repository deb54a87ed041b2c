"""What is known of many bridges, in a few lines for their owner."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pandas as pd

from skthermo._formatting import counted

MOST_NAMED = 5  # bridges or kinds in a sentence
SILENT = 7  # days without a record, after which a bridge counts as silent


def in_words(fleet: Any) -> str:
    """What was fitted, and how the bridges stand."""
    return "\n".join(_sentences(fleet))


def _sentences(fleet: Any) -> Iterator[str]:
    table = fleet.table
    broken = table.index[~table["is_fitted"]]
    yield f"{int(table['is_fitted'].sum())} of {len(table)} bridges are fitted."
    if len(broken):
        yield f"Not fitted: {named(broken)}."
    fitted = table[table["is_fitted"]]
    watched = fitted[fitted["state"] != ""]
    if len(watched) < len(fitted):
        yield f"{len(fitted) - len(watched)} fitted bridges have no monitor: nothing is known of their state."
    if len(watched):
        begun = watched["last"].notna()
        if not begun.all():
            yield (
                f"{(~begun).sum()} of {len(watched)} monitors have had no record since they were fitted: nothing is "
                "known of their bridges."
            )
        watched = watched[begun]
    if len(watched):
        state = watched["state"]
        yield (
            f"Of {len(watched)} monitors {(state == 'alarm').sum()} are in alarm, {(state == 'not judged').sum()} "
            f"cannot judge, {(state == 'healthy').sum()} saw no change in their newest record."
        )
        if (state == "alarm").any():
            yield f"In alarm: {named(watched.index[state == 'alarm'])}."
        if (state == "not judged").any():
            yield f"Not judged, and so not known to be healthy: {named(watched.index[state == 'not judged'])}."
        silent = watched.index[(state != "not judged") & (watched["days_silent"] > SILENT)]
        if len(silent):
            yield f"Without a record for more than {SILENT} days before the newest of all: {named(silent)}."
    failed = fitted.index[fitted["error"] != ""]
    if len(failed):
        yield f"Fitted, but with an error since: {named(failed)}."
    warned = fleet.warnings
    if len(warned):
        yield f"Warnings: {kinds(warned)}."


def named(names: Any) -> str:
    """The first names, and how many there are besides."""
    shown = ", ".join(str(name) for name in names[:MOST_NAMED])
    return shown if len(names) <= MOST_NAMED else f"{shown} and {len(names) - MOST_NAMED} more"


def kinds(warned: pd.DataFrame) -> str:
    """Kinds of warnings by how many bridges gave them."""
    numbers = warned.groupby("kind")["bridge"].nunique().sort_values(ascending=False, kind="stable")
    shown = [f"{kind!r} of {counted(number, 'bridge')}" for kind, number in numbers.iloc[:MOST_NAMED].items()]
    rest = [f"{len(numbers) - MOST_NAMED} other kinds"] if len(numbers) > MOST_NAMED else []
    return ", ".join(shown + rest).replace("\N{NO-BREAK SPACE}", " ")
