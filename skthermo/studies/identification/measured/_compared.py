"""The records behind an identification: how many could be compared, and how many independent ones they are worth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array, as_floats
from skthermo._formatting import counted, listed, significant
from skthermo._weather import FAR_OUTSIDE
from skthermo.studies.identification.measured._shift import Shift

IN_A_ROW = 3  # number of last records, all far from those before, that is no chance
FEW, FEW_TRAINED = 3.0, 20.0
"""Numbers of independent records, new ones and those of the training, below which a warning is given."""


@dataclass(frozen=True)
class ComparedRecords:
    """Records that were compared with the healthy structure, and what they are worth.

    Parameters
    ----------
    n_given : int
        Number of records.
    left_out : mapping of str to int
        How many of them could not be compared, by reason.
    n_independent : float
        As many independent records as would determine the mean shift as well as those that were compared, in the mode
        where they are worth least.
    n_trained, n_trained_independent : float
        The same for the training records.
    wider : mapping of str to float
        Modes that scatter clearly more widely than in the training records, and how many times; their standard errors
        allow for it.
    n_latest : int, default=0
        Number of the last records that were all left out because they are far from those before.
    """

    n_given: int
    left_out: Mapping[str, int]
    n_independent: float
    n_trained: int
    n_trained_independent: float
    wider: Mapping[str, float]
    n_latest: int = 0

    @classmethod
    def of(
        cls, left_out: Mapping[str, NDArray[np.bool_]], shift: Shift, n_trained: int, n_latest: int = 0
    ) -> ComparedRecords:
        """The records of a shift, and rows that were left out of it by reason."""
        counts = {reason: int(rows.sum()) for reason, rows in left_out.items() if rows.any()}
        n_given = max(len(rows) for rows in left_out.values())
        measured = shift.n_independent[shift.n_records > 0]
        wider = {str(mode): float(f) for mode, f in zip(shift.modes, shift.wider, strict=True) if f > 1}
        return cls(n_given, counts, float(measured.min(initial=n_given)), n_trained, shift.n_trained, wider, n_latest)

    @property
    def n_compared(self) -> int:
        """Number of records that were compared."""
        return self.n_given - sum(self.left_out.values())

    def sentences(self) -> Iterator[str]:
        """How many records were compared, what they are worth, and what was left out."""
        new = _worth("record", self.n_compared, self.n_independent)
        yield f"Compared: {new}; with {_worth('training record', self.n_trained, self.n_trained_independent)}."
        if self.left_out:
            yield f"{self._left_out()}."
        if self.n_latest >= IN_A_ROW:
            latest = self._latest()
            yield f"{latest[0].upper()}{latest[1:]}."
        for mode, factor in self.wider.items():
            yield (
                f"Mode {mode} scatters {significant(factor)} times as widely as in the training records; its "
                "uncertainty allows for that."
            )

    def warnings(self) -> Iterator[tuple[str, str]]:
        """What is doubtful, by kind and text."""
        if self.left_out:
            yield "records that were not compared", self._left_out()
        if self.n_latest >= IN_A_ROW:
            yield "the last records differ", self._latest()
        few = [(self.n_independent, self.n_compared, "record", FEW)]
        few += [(self.n_trained_independent, self.n_trained, "training record", FEW_TRAINED)]
        for independent, number, noun, least in few:
            if independent < least:
                yield (
                    f"few independent {noun}s",
                    f"too few independent {noun}s: {_worth(noun, number, independent)}; expected {least:g} or more, "
                    "since probabilities and standard errors are rough with fewer",
                )

    def _latest(self) -> str:
        return (
            f"the last {counted(self.n_latest, 'record')} are all far from those before and were left out: perhaps the "
            "structure has just changed; expected records of one state, so identify the last ones on their own"
        )

    def _left_out(self) -> str:
        n_left = sum(self.left_out.values())
        reasons = [f"{number:,} {reason}" for reason, number in self.left_out.items()]
        return f"{n_left:,} of {counted(self.n_given, 'record')} could not be compared: {listed(reasons)}"


def _worth(noun: str, number: int, independent: float) -> str:
    """A number of records and, if that is less, how many independent ones they are worth."""
    if independent > 0.95 * number:
        return counted(number, noun)
    said = significant(independent) if independent < 10 else f"{independent:,.0f}"
    return f"{counted(number, noun)}, worth {said} independent {'one' if said == '1.0' else 'ones'}"


def left_out_rows(fem: Any, T: Any, theta: Array, F: Array) -> dict[str, NDArray[np.bool_]]:
    """Rows that cannot be compared, by reason, each with the first reason that holds."""
    excess = as_floats(fem.applicability(T).drop(columns=["outside_bounds", "from_fleet"], errors="ignore"))
    reasons = {
        "without a frequency": np.isnan(F).all(axis=1),
        "without all temperatures and lagged ones": np.isnan(theta).any(axis=1),
        "in weather far outside that of the training records": (np.nan_to_num(excess) > FAR_OUTSIDE).any(axis=1),
    }
    taken = np.zeros(len(F), dtype=bool)
    for reason, rows in reasons.items():
        reasons[reason], taken = rows & ~taken, taken | rows
    if taken.all():
        counts = [f"{rows.sum():,} {reason}" for reason, rows in reasons.items() if rows.any()]
        raise ValueError(
            f"none of {counted(len(F), 'record')} can be compared with the healthy structure: {listed(counts)}; "
            "expected frequencies, and temperatures like those of the training records"
        )
    return reasons
