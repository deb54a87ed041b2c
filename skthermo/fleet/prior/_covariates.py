"""Covariates of bridges, such as span and material, as numbers."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.linalg import block_diag

from skthermo._tables.arrays import Array, is_real


@dataclass(frozen=True)
class Covariates:
    """A row (1, standardised numbers, centred indicators of categories) for a bridge; 0 where a covariate is unknown.

    ``centre`` and ``scale`` are those of numbers by name; ``shares`` of categories by name and value.
    """

    numbers: Mapping[Hashable, tuple[float, float]]
    shares: Mapping[Hashable, Mapping[Any, float]]

    @classmethod
    def of(cls, table: pd.DataFrame | None, bridges: Sequence[Hashable]) -> tuple[Covariates, Array, list[Array]]:
        """The encoding, the rows of the bridges, and the covariances of what is unknown of them."""
        numbers, shares = {}, {}
        if table is not None:
            if not isinstance(table, pd.DataFrame):
                raise ValueError(
                    f"covariates is {table!r:.100}; expected a DataFrame with a row for each bridge's name"
                )
            missing = [name for name in bridges if name not in table.index]
            if missing or not table.index.is_unique:
                raise ValueError(
                    f"covariates have the rows {list(table.index)[:20]}; expected each bridge's name once, and lack "
                    f"{missing[:20]}"
                )
            table = table.loc[list(bridges)]
            for name, column in table.items():
                known = column[~column.isna()]
                if not len(known):
                    raise ValueError(f"covariate {name!r} is missing for all {len(column)} bridges; expected values")
                if pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column):
                    values = known.to_numpy(dtype=float)
                    numbers[name] = (float(values.mean()), float(values.std()) or 1.0)
                else:
                    counts = known.value_counts()
                    shares[name] = {value: counts[value] / len(known) for value in sorted(counts.index, key=str)}
        found = cls(numbers, shares)
        rows = [found.row(None if table is None else table.loc[name].to_dict()) for name in bridges]
        return found, np.array([row for row, _ in rows]), [unknown for _, unknown in rows]

    def row(self, covariates: Mapping[Hashable, Any] | pd.Series | None) -> tuple[Array, Array]:
        """The numbers of one bridge, (n_columns,), and the covariance of those that are unknown."""
        given = {} if covariates is None else dict(covariates)
        unknown = [name for name in given if name not in self.numbers and name not in self.shares]
        if unknown:
            raise ValueError(f"covariates {unknown} are unknown; expected some of {[*self.numbers, *self.shares]}")
        values, covariances = [1.0], [np.zeros((1, 1))]
        for name, (centre, scale) in self.numbers.items():
            value = given.get(name)
            if value is None or pd.isna(value):
                values, covariances = [*values, 0.0], [*covariances, np.ones((1, 1))]
                continue
            if not is_real(value):
                raise ValueError(f"covariate {name!r} is {value!r}; expected a number, as for the other bridges")
            values, covariances = [*values, (float(value) - centre) / scale], [*covariances, np.zeros((1, 1))]
        for name, shares in self.shares.items():
            value, share = given.get(name), np.array(list(shares.values()))
            if value is None or pd.isna(value):
                values = [*values, *np.zeros(len(share))]
                covariances.append(np.diag(share) - np.outer(share, share))
                continue
            if value not in shares:
                raise ValueError(f"covariate {name!r} is {value!r}; expected one of {list(shares)}, or None if unknown")
            values = [*values, *(np.array([value == known for known in shares], dtype=float) - share)]
            covariances.append(np.zeros((len(share), len(share))))
        return np.array(values), block_diag(*covariances)
