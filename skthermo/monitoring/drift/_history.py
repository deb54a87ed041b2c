"""Stiffness of groups over years, as `track_parameters` returns it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from skthermo._arrays import Array

N_ERRORS = 1.96


class Followed(NamedTuple):
    """Levels of some groups through all days, their covariances, and levels and rates at the end."""

    groups: tuple[int, ...]
    means: Array
    covariances: Array
    end: Array
    end_covariance: Array
    walk: float


@dataclass(frozen=True, eq=False)
class ParameterHistory:
    """History."""

    daily: Any
    effects: Any
    trends: Any
    explanations: Any
    followed: Any
    significance: float

    @property
    def p_value(self) -> float:
        return self.explanations.p_value

    @property
    def has_drift(self) -> bool:
        return self.p_value <= self.significance

    def _of(self, group):
        for f in self.followed.values():
            if group in f.groups:
                k = f.groups.index(group)
                return f.means[:, k], np.sqrt(f.covariances[:, k, k])

    @property
    def table(self):
        cols = {}
        for g, name in enumerate(self.effects.names):
            m, s = self._of(g)
            cols[name, "estimate"], cols[name, "lower"], cols[name, "upper"] = (
                np.exp(m),
                np.exp(m - N_ERRORS * s),
                np.exp(m + N_ERRORS * s),
            )
        return pd.DataFrame(cols, index=self.daily.days)
