"""What is thought of damage before the records are seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from skthermo._arrays import is_real, real_array

MOST_CAUSES = 3  # largest number of causes in one explanation


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
    model_error : float, default=0.03
        Standard deviation of the error of the model's effect on each mode, relative to that effect. It may be three
        times as large or as small, as the misfit of the modes says; the effect on all modes together is as uncertain.

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
    model_error: float = 0.03

    def __post_init__(self) -> None:
        numbers = real_array(self.numbers, "numbers")
        if (
            numbers.ndim != 1
            or not 1 < len(numbers) <= MOST_CAUSES + 1
            or not (numbers >= 0).all()
            or not np.isclose(numbers.sum(), 1)
        ):
            raise ValueError(
                f"numbers is {self.numbers!r}; expected probabilities of none, one, two and at most three causes, "
                "which add up to 1"
            )
        if not isinstance(self.law, str) or self.law not in ("half-normal", "uniform"):
            raise ValueError(f"law is {self.law!r}; expected 'half-normal' or 'uniform'")
        for name, lowest, highest in (("severity", 0, 1), ("something_else", 0, 1), ("model_error", 0, 1)):
            value = getattr(self, name)
            if not is_real(value) or not lowest <= value <= highest or (name == "severity" and value == 0):
                raise ValueError(f"{name} is {value!r}; expected a number between {lowest} and {highest}")
        object.__setattr__(self, "numbers", tuple(numbers.tolist()))
